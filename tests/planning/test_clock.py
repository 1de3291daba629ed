"""The clock of an FPGA: a whole number of clocks a tick, and enough of them for the sequencer."""

import re
from pathlib import Path

import pytest
from building import NAME, VARIANTS, Variant, build, write_variant

from tablegen.base.input_errors import Rejected
from tablegen.config.load import load
from tablegen.emit.stored import stored_content
from tablegen.manifest.read import read_build
from tablegen.planning.line_plan import make_plan

CUBIC = {axis + ".table": {"mode": "cubic", "length": 256, "bits": 14} for axis in "xy"}


def clocks(folder: Path, clock_hz: float, **scan: object) -> int:
    variant = Variant({"emit.clock_hz": clock_hz, "timing.lines": 40, **scan})
    return make_plan(load(write_variant(folder, variant))).clocks_per_tick


@pytest.mark.parametrize(
    ("clock_hz", "expected"), [(500e3, 1), (50e6, 100), (125e6, 250), (50.004e6, 100), (49.996e6, 100)]
)
def test_clocks_of_a_tick_are_whole(tmp_path: Path, clock_hz: float, expected: int) -> None:
    """At 500 kHz; the last two are 0.008 % off."""
    assert clocks(tmp_path, clock_hz) == expected


@pytest.mark.parametrize(
    ("clock_hz", "scan", "why"),
    [
        (
            12.3e6,
            {},
            "24.6 clocks a tick, which is not whole; an update_rate_hz of 492000 has 25 clocks",
        ),
        (50.006e6, {}, "100.012 clocks a tick, which is not whole"),
        (100e3, {}, "0.2 clocks a tick, and the sequencer of this scan takes 1; take a clock of at least 500000 Hz"),
        (5e6, CUBIC, "10 clocks a tick, and the sequencer of this scan takes 11; take a clock of at least 5.5e+06 Hz"),
    ],
)
def test_other_clocks_are_refused_with_what_fits(
    tmp_path: Path, clock_hz: float, scan: dict[str, object], why: str
) -> None:
    with pytest.raises(Rejected, match=rf"emit\.clock_hz: .*{re.escape(why)}"):
        clocks(tmp_path, clock_hz, **scan)


def test_the_least_clock_that_is_named_fits(tmp_path: Path) -> None:
    assert clocks(tmp_path, 5.5e6, **CUBIC) == 11


def test_a_build_has_the_clocks_and_the_same_plan(tmp_path: Path) -> None:
    plain = build(tmp_path / "plain", VARIANTS["example"])
    clocked = build(tmp_path / "clocked", Variant({"emit.clock_hz": 50e6}))
    changed = {name for name, content in clocked.files.items() if content != plain.files[name]}
    assert changed == {f"{NAME}.vh", f"{NAME}_top.v", "manifest.json"}
    assert f"{NAME.upper()}_CLOCKS_PER_TICK = 32'sd100;" in clocked.files[f"{NAME}.vh"].decode("ascii")
    assert "parameter CLOCKS_PER_TICK = 100," in clocked.files[f"{NAME}_top.v"].decode("ascii")
    stored = read_build(clocked.folder)
    assert stored.manifest.hash == stored.own_hash == read_build(plain.folder).manifest.hash
    assert stored_content(stored).clocks_per_tick == 100
