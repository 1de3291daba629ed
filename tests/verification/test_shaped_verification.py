"""Shaped builds verified: codes and figures once more in other ways, and tamperings that are found."""

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from building import VARIANTS, Variant, build
from editing import Outcome, run
from hypothesis import given
from hypothesis import strategies as st
from kept_plays import own_program_alone
from replacing import replace
from verifying import edit_manifest, failed, make_right, verdicts

from tablegen.fixedpoint.output import Output
from tablegen.fixedpoint.phase import RationalPhase
from tablegen.fixedpoint.program import Program
from tablegen.fixedpoint.shaping import MAXIMUM_ZERO, Shaping
from tablegen.manifest.read import NotABuild, read_build
from tablegen.verification.checks.certificate_checks import check_certificates
from tablegen.verification.checks.shaped import shaped_codes

SECOND_ORDER = {"frequency_hz": 1000.0, "quality": 10.0}
SHORT = {"timing.lines": 8, "x.size_nm": 20.0, "y.size_nm": 20.0}


def wrong(folder: Path) -> list[str]:
    return [check.failure for check in check_certificates(read_build(folder), True).checks if check.failure is not None]


@given(st.data())
def test_two_ways_to_shaped_codes(data: st.DataObject) -> None:
    order = data.draw(st.integers(1, 3))
    shaping = Shaping(order, data.draw(st.integers(0, MAXIMUM_ZERO)) if order == 3 else 0)
    bits = data.draw(st.sampled_from([8, 12, 16, 24]))
    words = np.array(data.draw(st.lists(st.integers(-32768, 32767), min_size=4, max_size=4)), dtype=np.int64)
    top = (1 << bits) - 1
    gain_q, gain = 16 + 16 + 5 - bits, data.draw(st.integers(-(1 << 17), (1 << 17) - 1))
    offset = data.draw(st.integers(0, 1 << bits + gain_q))
    output = Output(gain, gain_q, offset, 0, top, top, 0, bits, "offset-binary", "right", bits, shaping=shaping)
    program = Program(RationalPhase(data.draw(st.integers(8, 50))), 1, "interpolated", 16, words, output)
    count = data.draw(st.integers(0, 300))
    assert shaped_codes(program, count).tolist() == program.played(0, count).tolist()


@pytest.mark.common
@pytest.mark.parametrize("shaping", ["first", "second", "scanner"])
def test_every_figure_is_found_again(shaping: str, tmp_path: Path) -> None:
    made = build(tmp_path, Variant({**SHORT, "dac.shaping": shaping}, {"y.resonance": SECOND_ORDER}))
    assert made.manifest["axes"]["x"]["output"]["shaping"]["order"] == {"first": 1, "second": 2, "scanner": 3}[shaping]
    assert wrong(made.folder) == []


@pytest.mark.common
def test_in_a_band_where_no_response_is_known(tmp_path: Path) -> None:
    made = build(tmp_path, Variant({**SHORT, "dac.shaping": "second"}))
    passages = {axis: made.manifest["axes"][axis]["certificate"]["shaped"]["passage"] for axis in "xy"}
    assert list(passages["x"]) == ["frequency_hz", "quality", "delay_s"]
    assert passages["y"] == {"band_hz": 64 * 400.0 / 8}
    assert wrong(made.folder) == []


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A build whose x has a response of 2000 points."""
    tmp_path = tmp_path_factory.mktemp("measured")
    f = np.linspace(100.0, 240e3, 2000)
    h = 1.0 / (1.0 - (f / 41e3) ** 2 + 1j * f / 41e3 / 7.0)
    columns = zip(f, np.abs(h), np.unwrap(np.angle(h, deg=True), period=360.0), strict=True)
    rows = "".join(f"{hz:.9g},{gain:.9g},{phase:.9g}\n" for hz, gain, phase in columns)
    (tmp_path / "response.csv").write_text(f"hz,gain,phase_deg\n{rows}", "ascii")
    scanner = {"x.resonance": {"response": "response.csv", "max_boost_db": 3.0}, "y.resonance": SECOND_ORDER}
    made = build(tmp_path, Variant({**SHORT, "dac.shaping": "scanner"}, scanner))
    certificate = made.manifest["axes"]["x"]["certificate"]
    assert list(certificate["shaped"]["passage"]) == ["response"]
    assert certificate["shaped"]["passage"]["response"]["hz"] == pytest.approx(f, rel=1e-8)
    assert certificate["rms_error_lsb"] < 0.1
    return made.folder


def test_behind_a_measured_response_every_figure_is_found_again(measured: Path) -> None:
    assert wrong(measured) == []


RESPONSE = ("shaped", "passage", "response")


@pytest.mark.common
@pytest.mark.parametrize(
    ("place", "change"),
    [
        (("rms_error_lsb",), lambda value: 1.01 * value),
        (("shaped", "rounded", "max_error_lsb"), lambda value: 0.99 * value),
        ((*RESPONSE, "gain"), lambda gain: [1.001 * one for one in gain]),
        ((*RESPONSE, "phase_turns"), lambda turns: [one - 1e-5 * i for i, one in enumerate(turns)]),
        ((*RESPONSE, "gain"), lambda gain: [*gain[:1000], *(0.5 * one for one in gain[1000:])]),
        (RESPONSE, lambda response: {key: values[:50] for key, values in response.items()}),
        (("shaped", "passage"), lambda _: {"frequency_hz": 41e3, "quality": 7.0, "delay_s": 0.0}),
        (("shaped", "passage"), lambda _: {"band_hz": 12800.0}),
    ],
)
def test_a_tampering_behind_a_measured_response_is_found(
    place: tuple[str, ...], change: Callable[[Any], Any], measured: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "out"
    shutil.copytree(measured, folder)
    value = json.loads((folder / "manifest.json").read_text("utf-8"))["axes"]["x"]["certificate"]
    for key in place:
        value = value[key]
    edit_manifest(folder, "axes", "x", "certificate", *place, value=change(value))
    make_right(folder)
    assert wrong(folder)


@pytest.mark.parametrize(
    "response",
    [
        {"hz": [1.0, 2.0], "gain": [1.0], "phase_turns": [0.0, 0.0]},
        {"hz": [2.0, 1.0], "gain": [1.0, 1.0], "phase_turns": [0.0, 0.0]},
        {"hz": [1.0], "gain": [1.0], "phase_turns": [0.0]},
    ],
)
def test_a_manifest_with_no_response_is_no_build(
    response: dict[str, list[float]], measured: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "out"
    shutil.copytree(measured, folder)
    edit_manifest(folder, "axes", "x", "certificate", *RESPONSE, value=response)
    make_right(folder)
    with pytest.raises(NotABuild, match="a response"):
        read_build(folder)


@pytest.fixture(scope="module")
def played(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A short build with a third order on x and a second one on y."""
    short = VARIANTS["short_frame"]
    resonances = {"x.resonance": {"frequency_hz": 60e3, "quality": 8.0}, "y.resonance": SECOND_ORDER}
    return build(
        tmp_path_factory.mktemp("played"), Variant({**short.scan, "dac.shaping": "scanner"}, resonances)
    ).folder


def all_shaped(outcome: Outcome) -> None:
    assert (outcome.status, outcome.err) == (0, "")
    assert set(verdicts(outcome).values()) == {"ok"}
    assert {("x", "shaped codes"), ("y", "shaped codes")} <= verdicts(outcome).keys()


@pytest.mark.common
def test_the_c_plays_shaped_codes(played: Path) -> None:
    all_shaped(run("verify", played, "--target", "c"))


@pytest.mark.rest
def test_the_verilog_plays_shaped_codes(played: Path) -> None:
    """Those of the program of the build; the session with requests clamps and holds back too."""
    with own_program_alone():
        outcome = run("verify", played, "--sim", "icarus", "--axis", "blocks")
    assert (outcome.status, outcome.err) == (0, "")
    for axis in "xy":
        assert verdicts(outcome)[axis, "shaped codes"] == verdicts(outcome)[axis, "integer model"] == "ok"


@pytest.mark.long
@pytest.mark.timeout(86_400)
def test_the_verilog_plays_shaped_codes_of_a_whole_session(played: Path) -> None:
    all_shaped(run("verify", played, "--sim", "icarus", "--axis", "blocks"))


@pytest.mark.rest
@pytest.mark.parametrize(
    ("name", "pattern", "new", "target"),
    [
        ("dac_run.h", r"next.older = last.newest;", "next.older = last.older;", ("--target", "c")),
        ("dac_run.h", r"\) >> 6\)", ") >> 5)", ("--target", "c")),
        pytest.param(
            "dac_shaper.v",
            "product - ",
            "product + ",
            ("--sim", "icarus", "--axis", "blocks"),
            marks=pytest.mark.common,
        ),
    ],
)
def test_a_sequencer_that_shapes_otherwise_is_found(
    name: str, pattern: str, new: str, target: tuple[str, ...], played: Path, tmp_path: Path
) -> None:
    shutil.copytree(played, tmp_path / "out")
    path = tmp_path / "out" / name
    text, count = re.subn(pattern, new, path.read_text("ascii"))
    assert count >= 1
    path.write_text(text, "ascii")
    make_right(tmp_path / "out", version="0.2.0")
    with own_program_alone():  # of the Verilog
        outcome = run("verify", tmp_path / "out", "--other-version", *target)
    assert {("x", "integer model"), ("x", "shaped codes")} <= failed(outcome)


TAMPERINGS: list[tuple[tuple[str, ...], Any]] = [
    (("output", "shaping"), {"order": 2, "zero": 0}),
    (("output", "shaping", "zero"), 109),
    (("certificate", "rms_error_lsb"), 0.03),
    (("certificate", "largest_step"), 3),
    (("certificate", "lowest_code"), 32100),
    (("certificate", "shaped", "rms_code_error_lsb"), 0.5),
    (("certificate", "shaped", "changes", "percent"), 1.0),
    (("certificate", "shaped", "rounded", "rms_error_lsb"), 1.0),
    (("certificate", "shaped", "rounded", "scaling_error_percent"), {"forward": 9.0, "backward": 9.0}),
    (("certificate", "shaped", "passage"), {"band_hz": 100.0}),
    (("certificate", "shaped"), None),
    (("output", "shaping"), None),
]


@pytest.mark.rest
@pytest.mark.parametrize(("place", "value"), TAMPERINGS, ids=lambda value: str(value)[:50])
def test_a_tampering_is_found(place: tuple[str, ...], value: Any, tmp_path: Path) -> None:
    made = build(tmp_path, Variant({**SHORT, "dac.shaping": "scanner"}, {"y.resonance": SECOND_ORDER}))
    edit_manifest(made.folder, "axes", "x", *place, value=value)
    make_right(made.folder)
    assert wrong(made.folder)


def test_a_manifest_of_no_shaping_is_no_build(tmp_path: Path) -> None:
    made = build(tmp_path, Variant({**SHORT, "dac.shaping": "first"}))
    for value in ({"order": 4, "zero": 0}, {"order": 0, "zero": 0}, {"order": 1, "zero": 1}, {"order": 3, "zero": 129}):
        edit_manifest(made.folder, "axes", "x", "output", "shaping", value=value)
        with pytest.raises(NotABuild, match="is damaged"):
            read_build(made.folder)


def test_the_model_is_not_asked(tmp_path: Path) -> None:
    """A model that forgets its remainders between lines is not what is found here."""
    program = read_build(build(tmp_path, Variant({**SHORT, "dac.shaping": "second"})).folder).program.x
    ticks = program.ticks
    forgetful = np.concatenate([program.played(0, ticks), program.played(0, ticks)])
    assert not np.array_equal(shaped_codes(program, 2 * ticks), forgetful)
    other = replace(program, output=replace(program.output, shaping=Shaping(1)))
    assert not np.array_equal(shaped_codes(program, ticks), other.played(0, ticks))
