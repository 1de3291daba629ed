"""The certificate of shaped axes: errors of the position, what rounding would leave, and what shaping costs."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from building import Variant, build, write_variant
from replacing import replace

from tablegen.base.input_errors import Document, Unphysical
from tablegen.certificate.certificate import Certificate, broken_limits, certify
from tablegen.certificate.line_errors import EmittedPeriod
from tablegen.certificate.scan_notes import scan_findings, shaped_travel
from tablegen.certificate.shaped_periods import Changes, errors_behind_response
from tablegen.certificate.summary import certificate_lines
from tablegen.config.load import load
from tablegen.planning.line_plan import Plan, make_plan

SMALL = {"x.size_nm": 20.0, "y.size_nm": 20.0, "timing.lines": 8}
RESONANCE = {"frequency_hz": 1000.0, "quality": 10.0}


def planned(folder: Path, shaping: str, **scan: Any) -> Plan:
    changes = {**SMALL, "dac.shaping": shaping, **scan}
    return make_plan(load(write_variant(folder, Variant(changes, {"y.resonance": RESONANCE}))))


@pytest.fixture(scope="module")
def certified(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[Plan, dict[str, Certificate]]]:
    found = {}
    for shaping in ("off", "first", "scanner"):
        plan = planned(tmp_path_factory.mktemp(shaping), shaping)
        found[shaping] = plan, certify(plan)
    return found


Certified = dict[str, tuple[Plan, dict[str, Certificate]]]


@pytest.mark.parametrize("f_hz", [400.0, 10e3, 40e3, 100e3])
def test_a_tone_arrives_as_the_response_has_it(certified: Certified, f_hz: float) -> None:
    line = certified["scanner"][0].x
    t = np.arange(20000) / 500e3
    arrived = errors_behind_response(line, np.sin(2.0 * np.pi * f_hz * t))[10000:]
    r = f_hz / 40e3
    h = 1.0 / (1.0 - r * r + 1j * r / 20.0)
    wanted = np.imag(h * np.exp(2j * np.pi * f_hz * t[10000:]))
    assert np.max(np.abs(arrived - wanted)) < 0.01 * abs(h) + 1e-3


def test_a_band_ends_at_the_highest_harmonic(tmp_path: Path) -> None:
    line = make_plan(load(write_variant(tmp_path, Variant({**SMALL, "dac.shaping": "first"})))).y
    t = np.arange(1 << 16) / 500e3
    inside, outside = (errors_behind_response(line, np.sin(2.0 * np.pi * f * t))[20000:40000] for f in (1000.0, 8000.0))
    assert np.max(np.abs(inside - np.sin(2.0 * np.pi * 1000.0 * t[20000:40000]))) < 0.05
    assert np.max(np.abs(outside)) < 0.05


def test_shaping_leaves_less_and_says_what_rounding_would(certified: Certified) -> None:
    rms = {name: certificates["x"].rms_error_lsb for name, (_, certificates) in certified.items()}
    assert rms["scanner"] < 0.08
    for name in ("first", "scanner"):
        shaped = certified[name][1]["x"].shaped
        assert shaped is not None
        assert shaped.rounded.rms_error_lsb == pytest.approx(0.386, abs=0.01)
        assert shaped.ticks == 16 * 1250
    assert certified["off"][1]["x"].shaped is None
    worst = {name: certificates["x"].scaling_error_percent for name, (_, certificates) in certified.items()}
    assert worst["scanner"] < 1.0 < 2.0 < worst["off"]


def test_codes_and_steps_are_bounds_of_all_lines(certified: Certified) -> None:
    plan, certificates = certified["scanner"]
    for line in plan.lines:
        codes = line.codes(0, 40 * plan.schedule.frame_ticks)
        found = certificates[line.axis]
        assert found.lowest_code <= codes.min() <= found.lowest_code + 4
        assert found.highest_code - 4 <= codes.max() <= found.highest_code
        largest = int(np.max(np.abs(np.diff(codes))))
        assert found.largest_step - 4 <= largest <= found.largest_step <= found.max_step
        shaped = found.shaped
        assert shaped is not None
        assert shaped.largest_step <= largest
        assert found.headroom_low == found.lowest_code - line.program.output.code_min >= 0


def test_changes_of_codes() -> None:
    assert Changes.of(np.array([5, 5, 6, 4, 4])) == Changes(50.0, 1.5)
    assert Changes.of(np.array([5, 5])) == Changes(0.0, 0.0)
    assert Changes.of(np.array([5])) == Changes(0.0, 0.0)


def test_limits_are_those_of_the_position(certified: Certified) -> None:
    plan, certificates = certified["scanner"]
    limits = replace(plan, limits=type(plan.limits)(max_error_lsb=0.3, max_scaling_error_percent=1.0))
    assert broken_limits(limits, certificates, Document("scan", None)) == []
    assert certificates["x"].shaped is not None
    assert certificates["x"].shaped.code_error_lsb[0] > 3.0
    assert len(broken_limits(limits, certified["first"][1], Document("scan", None))) >= 2


def test_the_summary_says_it(certified: Certified) -> None:
    text = "\n".join(value for _, value in certificate_lines(certified["scanner"][1]["x"]))
    for part in ("of the position, behind 40000 Hz, Q 20", "2 cos = 110/64", "without: max", "codes change on"):
        assert part in text
    assert "position" not in "\n".join(value for _, value in certificate_lines(certified["off"][1]["x"]))


@pytest.mark.common
def test_a_period_too_long_for_all_is_judged_in_part(tmp_path: Path) -> None:
    plan = planned(tmp_path, "second", **{"timing.line_rate_hz": 2.0, "timing.lines": 20})
    line = plan.y
    assert line.program.ticks == 5_000_000
    shaped = EmittedPeriod(line).shaped
    assert shaped is not None
    assert not shaped.is_whole
    assert shaped.ticks == 1 << 20


@pytest.mark.common
@pytest.mark.parametrize("name", ["csv", "npz", "wav", "pwl"])
def test_a_file_of_one_period_is_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(Unphysical, match="shaped codes have none"):
        build(tmp_path, Variant({**SMALL, "dac.shaping": "first", "emit.formats": [name]}))


def test_without_shaping_no_byte_says_anything_of_it(tmp_path: Path) -> None:
    """But the parameters of the Verilog, which every build has: they are 0."""
    files = build(tmp_path, Variant({**SMALL})).files
    constants = next(content for name, content in files.items() if name.endswith(".vh"))
    assert set(re.findall(rb"_SHAPING\w* = 32'sd(\d+);", constants)) == {b"0"}
    for name, content in files.items():
        if not name.startswith(("dac_", "program_loader")) and not name.endswith((".vh", "_top.v")):
            assert b"shap" not in content.lower().replace(b'"dac_shap', b""), name  # names of its files


def test_codes_that_go_to_and_fro_are_noted(certified: Certified) -> None:
    """Hysteresis follows them, and no error of the position contains that."""
    codes = {
        shaping: [one.axis for one in scan_findings(*both) if one.code == "shaped-travel"]
        for shaping, both in certified.items()
    }
    assert codes["off"] == []
    assert codes["scanner"] == ["x", "y"]
    plan, certificates = certified["scanner"]
    shaped = certificates["x"].shaped
    assert shaped is not None
    played = plan.x.program.played(0, 2 * plan.x.program.ticks)
    rounded = np.tile(plan.x.program.rounded.codes(np.arange(plan.x.program.ticks)), 2)
    extra = np.sum(np.abs(np.diff(played))) / np.sum(np.abs(np.diff(rounded))) - 1.0
    (finding,) = shaped_travel("x", shaped.changes, shaped.rounded.changes)
    stated = re.search(r"([\d.e+]+) % further in all than without shaping", finding.text)
    assert stated is not None
    assert float(stated[1]) == pytest.approx(100.0 * extra, rel=0.1)  # of other periods


@pytest.mark.parametrize(("travel", "noted"), [(1.009, 0), (1.011, 1)])
def test_a_travel_of_less_than_a_percent_is_no_matter(travel: float, noted: int) -> None:
    assert len(shaped_travel("x", Changes(100.0, travel), Changes(100.0, 1.0))) == noted


def test_codes_that_never_change_have_no_travel() -> None:
    assert shaped_travel("y", Changes(70.0, 1.0), Changes(0.0, 0.0)) == []
