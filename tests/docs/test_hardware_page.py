"""docs/hardware.md: its example is the tube of the examples, and its table of words is what is sent."""

import re
import tomllib
from typing import Any

import pytest
from building import REPOSITORY, changed
from editing import EXAMPLES, run

from tablegen.config.hardware import AxisAmplifier, AxisDac
from tablegen.config.load import from_values, load
from tablegen.fixedpoint.converter import Converter
from tablegen.planning.line_plan import make_plan

PAGE = (REPOSITORY / "docs" / "hardware.md").read_text("utf-8")
ROW = re.compile(r"^\| `([a-z-]+)` \| `(true|false)` \| (0x[0-9A-F]{4}) \| (0x[0-9A-F]{4}) \|", re.MULTILINE)


def flat(values: dict[str, Any], path: str = "") -> dict[str, Any]:
    found: dict[str, Any] = {}
    for key, value in values.items():
        found |= flat(value, f"{path}{key}.") if isinstance(value, dict) else {f"{path}{key}": value}
    return found


def test_the_example_is_that_of_the_tube() -> None:
    shown = flat(tomllib.loads(PAGE.partition("```toml\n")[2].partition("```")[0]))
    tube = flat(tomllib.loads((EXAMPLES / "tube_scanner.toml").read_text("utf-8")))
    assert len(shown) == 11
    assert shown == {key: tube[key] for key in shown}
    assert not {"dac", "amplifier"} & {*tomllib.loads((EXAMPLES / "tube_5um.toml").read_text("utf-8"))}


@pytest.mark.parametrize("row", ROW.findall(PAGE))
def test_the_words_of_the_lowest_and_the_highest_voltage(row: tuple[str, str, str, str]) -> None:
    coding, inverted, *words = row
    scanner = {"dac": {"coding": coding, "inverted": inverted == "true"}}
    scan = changed(EXAMPLES / "annexin_200nm.toml", {"timing.lines": 20, "y.band_limit.harmonics": 16})
    del scan["dac"]["coding"], scan["limits"]
    line = make_plan(from_values(scan, changed(EXAMPLES / "scanner.toml", scanner))).x
    by_volts = {line.converter.v_zero + line.converter.v_per_code * code: code for code in (0, 65535)}
    assert sorted(by_volts) == pytest.approx([0.0, 100.0 - 100.0 / 65536])
    assert [f"0x{line.program.output.word(by_volts[volts]):04X}" for volts in sorted(by_volts)] == words


def test_all_four_codings_are_told() -> None:
    assert len({row[:2] for row in ROW.findall(PAGE)}) == 4


@pytest.mark.parametrize("inverted", [False, True])
def test_volts_are_those_of_the_equations(inverted: bool) -> None:
    dac = AxisDac(bits=12, v_min=-2.0, v_max=6.0, update_rate_hz=1e5, inverted=inverted)
    converter = Converter.of(dac, AxisAmplifier(gain=-7.0, bias_v=3.0))
    for code in (0, 1, 2048, 4095):
        v_dac = -2.0 + 8.0 * ((4095 - code) if inverted else code) / 4096
        assert converter.v_zero + converter.v_per_code * code == pytest.approx(-7.0 * v_dac + 3.0, abs=1e-12)
        assert converter.code(-7.0 * v_dac + 3.0) == pytest.approx(code, abs=1e-9)


def test_a_reference_of_the_other_sign_is_a_gain_of_the_other_sign() -> None:
    """The page's advice: code 0 gives +5 V there, and the converter as it is told -5 V, behind the inverted gain."""
    told = Converter.of(AxisDac(16, -5.0, 5.0, 1e5), AxisAmplifier(gain=-10.0))
    for code in (0, 30000, 65535):
        real = 10.0 * (5.0 - 10.0 * code / 65536)
        assert told.v_zero + told.v_per_code * code == pytest.approx(real, abs=1e-9)


def test_the_tube_has_the_keys_of_both_files() -> None:
    hardware = load(EXAMPLES / "tube_5um.toml").hardware("y")
    assert hardware.amplifier == AxisAmplifier(-22.5, 1.5, 1e5)
    outcome = run("check", EXAMPLES / "tube_5um.toml")
    assert outcome.status == 0, outcome.err
    assert outcome.messages == [], "and its limits hold, without a warning"
