"""Converter and amplifier said once, in the scanner file: which key counts, and what is refused where."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from building import REMOVED, Variant, changed, to_toml
from editing import EXAMPLES, run
from hypothesis import given, settings
from hypothesis import strategies as st

from tablegen.base.input_errors import Rejected
from tablegen.certificate.certificate import certify
from tablegen.config.hardware import AxisAmplifier, AxisDac, Place
from tablegen.config.load import Setup, from_values, load, load_scanner
from tablegen.emit.render import render
from tablegen.planning.line_plan import make_plan

SCAN, SCANNER = EXAMPLES / "annexin_200nm.toml", EXAMPLES / "scanner.toml"
DAC = {"bits": 16, "v_min": -5.0, "v_max": 5.0, "update_rate_hz": 500e3}
NO_HARDWARE = {"dac": REMOVED, "amplifier": REMOVED}
SMALL = {"timing.lines": 20, "y.band_limit.harmonics": 16, "limits": REMOVED}


def setup_of(scan: dict[str, Any], scanner: dict[str, Any]) -> Setup:
    return from_values(changed(SCAN, scan), changed(SCANNER, scanner))


def refusal(folder: Path, variant: Variant) -> list[str]:
    """The messages about a pair of files, without the folder."""
    (folder / "scan.toml").write_text(to_toml(changed(SCAN, variant.scan)), "utf-8")
    (folder / "scanner.toml").write_text(to_toml(changed(SCANNER, variant.scanner)), "utf-8")
    outcome = run("check", folder / "scan.toml")
    assert outcome.status == 2
    # Where a table of the helper's TOML begins is its own business; the key is the program's.
    return [re.sub(r"(:|line )\d+", r"\1N", message.replace(f"{folder}/", "")) for message in outcome.messages]


def test_each_axis_has_its_own_hardware_and_the_common_table_fills_up() -> None:
    setup = setup_of(
        NO_HARDWARE,
        {
            "dac": DAC,
            "amplifier": {"gain": 10.0, "max_slew_v_per_s": 1e6},
            "y.dac": {"v_min": 0.0, "inverted": True, "coding": "twos-complement", "word_bits": 24, "align": "left"},
            "y.amplifier": {"gain": -20.0, "bias_v": 100.0},
        },
    )
    x, y = setup.hardware("x"), setup.hardware("y")
    assert x.dac == AxisDac(16, -5.0, 5.0, 500e3, "offset-binary", False, None, "right", None)
    assert x.amplifier == AxisAmplifier(10.0, 0.0, 1e6)
    assert y.dac == AxisDac(16, 0.0, 5.0, 500e3, "twos-complement", True, None, "left", 24)
    assert y.amplifier == AxisAmplifier(-20.0, 100.0, 1e6)
    assert y.where("amplifier.gain") == (Place(True, "y.amplifier.gain"),)
    assert y.where("amplifier.max_slew_v_per_s") == (Place(True, "amplifier.max_slew_v_per_s"),)
    assert x.where("amplifier.bias_v") == (Place(True, "amplifier.bias_v"),), "where it would stand"


def test_the_scan_file_alone_serves_both_axes_as_before() -> None:
    setup = load(SCAN)
    for axis in "xy":
        assert setup.hardware(axis).amplifier == AxisAmplifier(10.0, 50.0, 2e6)
        assert setup.hardware(axis).where("dac.bits") == (Place(False, "dac.bits"),)


def test_what_both_files_say_alike_is_taken() -> None:
    setup = setup_of({}, {"x.amplifier": {"gain": 10.0}, "dac": DAC})
    assert setup.hardware("x").where("amplifier.gain") == (
        Place(False, "amplifier.gain"),
        Place(True, "x.amplifier.gain"),
    )
    assert make_plan(setup).x.converter == make_plan(load(SCAN)).x.converter


CASES = {
    "a gain of another size": (
        {},
        {"x.amplifier": {"gain": 15.0}},
        [
            "scan.toml:N: amplifier.gain: 10, and x.amplifier.gain is 15 at scanner.toml:N; the scanner file's is that "
            "of the instrument: remove this key, or correct the other"
        ],
    ),
    "both axes apart from the scan": (
        {},
        {"x.dac": {"coding": "twos-complement"}, "dac": {"v_min": 0.0}},
        [
            "scan.toml:N: dac.coding: 'offset-binary', and x.dac.coding is 'twos-complement' at scanner.toml:N; the "
            "scanner file's is that of the instrument: remove this key, or correct the other",
            "scan.toml:N: dac.v_min: -5, and dac.v_min is 0 at scanner.toml:N; the scanner file's is that of the "
            "instrument: remove this key, or correct the other",
        ],
    ),
    "one axis has no amplifier": (
        {"amplifier": REMOVED},
        {"x.amplifier": {"gain": 10.0, "bias_v": 50.0}},
        ["scanner.toml:N: y.amplifier.gain: missing; this key is required, here or in [amplifier]"],
    ),
    "no file has a converter": (
        {"dac": REMOVED},
        {},
        ["scan.toml:N: dac: missing; this table is required, here or in the scanner file"],
    ),
    "the scanner's converter is not whole": (
        {"dac": REMOVED},
        {"dac": {"bits": 16, "v_min": -5.0, "v_max": 5.0}},
        ["scanner.toml:N: dac.update_rate_hz: missing; this key is required, here or in the scan file"],
    ),
    "different bits": (
        {"dac.bits": REMOVED},
        {"x.dac": {"bits": 16}, "y.dac": {"bits": 14}},
        [
            "scanner.toml:N: y.dac.bits: 14 of y, and x.dac.bits at line N is 16 of x; the device computes codes of as "
            "many bits for both axes: give bits = 14 to both, and to the one of 16 bits word_bits = 16 with align = "
            "'left' as well, which sends them as its upper bits"
        ],
    ),
    "different clocks": (
        {"dac.update_rate_hz": REMOVED},
        {"x.dac": {"update_rate_hz": 5e5}, "y.dac": {"update_rate_hz": 2.5e5}},
        [
            "scanner.toml:N: y.dac.update_rate_hz: 250000 of y, and x.dac.update_rate_hz at line N is 500000 of x; "
            "both axes move on the same ticks: give it once, in [dac]"
        ],
    ),
    "both on one output": (
        {},
        {"x.dac": {"output": "B"}, "y.dac": {"output": "B"}},
        ["scanner.toml:N: y.dac.output: x is on B and y is on B; give one axis 'A' and the other 'B', or none of them"],
    ),
    "one of two outputs": (
        {},
        {"x.dac": {"output": "B"}},
        ["dac.output: x is on B and y is on none; give one axis 'A' and the other 'B', or none of them"],
    ),
    "a range of two files that is none": (
        {"dac.v_min": REMOVED},
        {"y.dac": {"v_min": 5.0}, "x.dac": {"v_min": -5.0}},
        ["scan.toml:N: dac.v_max: 5 V is not above v_min = 5 V"],
    ),
    "no gain": (
        {"amplifier": REMOVED},
        {"amplifier": {"gain": 10.0, "bias_v": 50.0}, "y.amplifier": {"gain": 0.0}},
        ["scanner.toml:N: y.amplifier.gain: 0 is no gain; at least 1e-4 in size is needed"],
    ),
    "a wrong value is said once": (
        {},
        {"x.dac": {"bits": 99, "hue": 1}},
        ["scanner.toml:N: x.dac.bits: 99 is above 24", "known here"],
    ),
    "a drive beyond the axis' own converter": (
        {"amplifier": REMOVED},
        {"x.amplifier": {"gain": 10.0, "bias_v": 50.0}, "y.amplifier": {"gain": -1.0, "bias_v": 50.0}},
        ["scanner.toml:N: y.amplifier.gain: the y drive of 40.7440..59.3354 V needs -9.3354..9.2560 V of the "],
    ),
    "a slow amplifier of one axis": (
        {"amplifier": REMOVED},
        {
            "amplifier": {"gain": 10.0, "bias_v": 50.0},
            "y.amplifier": {"max_slew_v_per_s": 700.0},
        },
        ["scanner.toml:N: y.amplifier.max_slew_v_per_s: 700 V/s are 0.918 codes of the y axis in a tick"],
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_what_is_refused(name: str, tmp_path: Path) -> None:
    scan, scanner, says = CASES[name]
    messages = refusal(tmp_path, Variant(scan, scanner))
    assert len(messages) == len(says), messages
    for message, text in zip(messages, says, strict=True):
        assert text in message


def test_a_scan_file_without_hardware_is_still_told_from_a_scanner_file(tmp_path: Path) -> None:
    scan, scanner = changed(SCAN, NO_HARDWARE), changed(SCANNER, {"dac": DAC, "amplifier": {"gain": 10.0}})
    (tmp_path / "a.toml").write_text(to_toml(scan), "utf-8")
    (tmp_path / "scanner.toml").write_text(to_toml(scanner), "utf-8")
    assert "this is a scanner file" in run("check", tmp_path / "scanner.toml").err
    with pytest.raises(Rejected, match="this is a scan file"):
        load_scanner(tmp_path / "a.toml")
    (tmp_path / "b.toml").write_text(to_toml(changed(SCAN, {**NO_HARDWARE, "scanner": "a.toml"})), "utf-8")
    assert "is a scan file, not a scanner file" in run("check", tmp_path / "b.toml").err


def hardware(gain: float, bias_v: float, inverted: bool, top: float) -> dict[str, Any]:
    return {"dac": {"v_max": top, "inverted": inverted}, "amplifier": {"gain": gain, "bias_v": bias_v}}


one = st.builds(
    hardware,
    st.sampled_from((9.5, 12.0, -11.25, -20.0)),
    st.floats(45.0, 55.0),
    st.booleans(),
    st.sampled_from((5.0, 5.5)),
)


@settings(derandomize=True, deadline=None, max_examples=4)
@given(one, one)
def test_swapping_the_axes_swaps_the_converters_and_each_gives_the_volts_of_its_drive(
    first: dict[str, Any], second: dict[str, Any]
) -> None:
    """And nothing of an axis depends on the hardware of the other."""
    common = {"dac": {**DAC, "v_min": -5.5}}

    def plan(x: dict[str, Any], y: dict[str, Any]) -> Any:
        keys = {f"{axis}.{part}": its[part] for axis, its in (("x", x), ("y", y)) for part in its}
        return make_plan(setup_of({**SMALL, **NO_HARDWARE}, {**common, **keys}))

    plans = {key: plan(*both) for key, both in {"as": (first, second), "swapped": (second, first)}.items()}
    alone = plan(first, first)
    assert plans["as"].x.converter == plans["swapped"].y.converter == alone.x.converter
    assert plans["as"].y.converter == plans["swapped"].x.converter
    assert plans["as"].x.program.output == alone.x.program.output
    assert plans["swapped"].y.program.output == alone.y.program.output
    for its, line in ((first, plans["as"].x), (second, plans["as"].y)):
        output, dac = line.program.output, its["dac"]
        lsb = (dac["v_max"] + 5.5) / 65536
        for code in (output.code_min, output.offset_code, output.park_code, output.code_max):
            up = 65535 - code if dac["inverted"] else code
            volts = its["amplifier"]["gain"] * (-5.5 + lsb * up) + its["amplifier"]["bias_v"]
            assert line.converter.v_zero + line.converter.v_per_code * code == pytest.approx(volts, abs=1e-9)
            assert -1e-4 <= volts <= 100.0 + 1e-4
        assert abs(output.offset_code - line.converter.code(50.0)) <= 0.5 + 1e-6


def test_swapped_outputs_are_told_to_the_board_and_change_no_code() -> None:
    """Constants, manifest and the channels of a WAV file; the words of both axes are those of a build without it."""
    scan = {**SMALL, "emit": {"formats": ["c", "verilog", "wav"]}}
    outputs = {"x.dac": {"output": "B"}, "y.dac": {"output": "A"}}
    plain, swapped = (make_plan(setup_of(scan, scanner)) for scanner in ({}, outputs))
    before, after = (render(plan, certify(plan)) for plan in (plain, swapped))
    for name in ("annexin_200nm.h", "annexin_200nm.vh"):
        assert b"_X_DAC_OUTPUT" not in before[name]
        text = after[name].decode("ascii")
        assert re.search(r"ANNEXIN_200NM_X_DAC_OUTPUT\b[ =]+(32'sd)?1\b", text), text
        assert re.search(r"ANNEXIN_200NM_Y_DAC_OUTPUT\b[ =]+(32'sd)?0\b", text)
    manifest = json.loads(after["manifest.json"])
    assert [manifest["axes"][axis]["output"]["channel"] for axis in "xy"] == ["B", "A"]
    assert b"channel" not in before["manifest.json"]
    samples = [np.frombuffer(files["annexin_200nm.wav"][44:], "<i2").reshape(-1, 2) for files in (before, after)]
    assert np.array_equal(samples[0], samples[1][:, ::-1])
    for axis in "xy":
        assert before[f"annexin_200nm_{axis}.mem"] == after[f"annexin_200nm_{axis}.mem"]
