"""Calibrations on a driver of v_min..v_max: moved voltages give the same parameters, messages say volts as they are."""

import json
from pathlib import Path

import numpy as np
import pytest
from calibrating import AMPLITUDES, OFFSETS, V_MAX, Scanner, apparent
from editing import run
from msgspec import structs
from operator_files import operator_file, write_operator_scan
from replacing import replace

from tablegen.base.input_errors import Rejected, Unphysical
from tablegen.calibration.laws.hysteresis import fit_hysteresis
from tablegen.calibration.laws.offset import fit_offset
from tablegen.calibration.laws.size import fit_size
from tablegen.calibration.operator.periodic_line import periodic_line
from tablegen.compensation.operator.file import operator_text, read_operator
from tablegen.config.load import load, load_scanner
from tablegen.numerics.driver import Driver
from tablegen.planning.line_plan import make_plan

BOTH = Driver(0.5 * V_MAX, -0.5 * V_MAX)  # the same 100 V, about 0 V
BY = 0.5 * V_MAX


def test_offsets_of_both_signs_give_the_same_factors() -> None:
    sizes = apparent(OFFSETS, 0.92, 1.25, 17.7)
    one, other = fit_offset(OFFSETS, sizes, V_MAX), fit_offset(OFFSETS - BY, sizes, BOTH)
    assert other.m_minus.value == pytest.approx(one.m_minus.value, rel=1e-12) == pytest.approx(0.92)
    assert other.m_plus.value == pytest.approx(one.m_plus.value, rel=1e-12) == pytest.approx(1.25)
    assert other.curves[0].fitted[0][[0, -1]].tolist() == [-50.0, 50.0]
    with pytest.raises(Unphysical, match=r"an offset of -51 V is outside the driver's -50\.\.50 V"):
        fit_offset(np.array([-51.0, 0.0, 40.0]), sizes[:3], BOTH)


def test_traces_about_0_v_give_the_same_hysteresis_and_period() -> None:
    traces = [Scanner().trace(v) for v in AMPLITUDES]
    about = [replace(trace, drive_v=trace.drive_v - BY) for trace in traces]
    one, other = fit_hysteresis(traces, V_MAX), fit_hysteresis(about, BOTH)
    for side in ("forward", "backward"):
        before, after = getattr(one.branches[0], side), getattr(other.branches[0], side)
        assert after.beta_max.value == pytest.approx(before.beta_max.value, rel=1e-9)
        assert after.u_peak.value == pytest.approx(before.u_peak.value, rel=1e-9)
    line, there = periodic_line(traces[1], V_MAX), periodic_line(about[1], BOTH)
    assert (there.centre, there.stroke) == (pytest.approx(line.centre), pytest.approx(line.stroke))
    with pytest.raises(Unphysical, match=r"outside the driver's 0\.\.100 V"):
        fit_hysteresis(about, V_MAX)
    with pytest.raises(Unphysical, match=r"outside the driver's -50\.\.50 V"):
        periodic_line(traces[2], BOTH)


def test_a_scan_voltage_may_be_the_whole_range() -> None:
    drives = np.array([100.0, 200.0, 300.0, 440.0])
    law = 24.0 * drives
    assert fit_size(drives, law, Driver(220.0, -220.0), 1000.0, 0.5).k_nm_per_v.value == pytest.approx(24.0)
    with pytest.raises(Unphysical, match=r"a drive of 440 V is above v_max = 220 V"):
        fit_size(drives, law, 220.0, 1000.0)
    with pytest.raises(Unphysical, match=r"a drive of 440 V is above v_max - v_min = 400 V"):
        fit_size(drives, law, Driver(200.0, -200.0), 1000.0)


@pytest.mark.common
def test_the_operator_of_a_driver_of_both_signs(tmp_path: Path) -> None:
    """Its file keeps v_min, the plan is that of the moved voltages, and another driver is refused."""
    file = operator_file([0.3, 0.2, 0.1])
    before = make_plan(load(write_operator_scan(tmp_path, file, "x.offset_v = 62"))).x
    about = structs.replace(file, v_max=50.0, v_min=-50.0)
    assert "v_min = -50.0" in operator_text(about, [])
    assert "v_min" not in operator_text(file, [])
    scan = write_operator_scan(tmp_path, about, "x.offset_v = 12", "y.offset_v = 0", "amplifier.bias_v = 0")
    scanner = tmp_path / "scanner.toml"
    text = scanner.read_text("utf-8")
    scanner.write_text(text.replace("v_max = 100.0", "v_max = 50.0\nv_min = -50.0"), "utf-8")
    assert read_operator(tmp_path / "operator.toml", "operator.toml")[1].v_min == -50.0
    after = make_plan(load(scan)).x
    assert np.max(np.abs(after.program.words - before.program.words)) <= 1
    assert after.program.output.gain_word == before.program.output.gain_word
    scanner.write_text(text.replace("v_max = 100.0", "v_max = 50.0\nv_min = -40.0"), "utf-8")
    with pytest.raises(Rejected, match=r"operator\.toml was identified with v_min = -50 V, not -40 V"):
        make_plan(load(scan))


def test_the_command_line_takes_and_writes_v_min(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    rows = [f"{24.0 * v * (1 + 0.1 * v / 440):.9g},{24.0 * v:.9g}" for v in (44.0, 110.0, 220.0, 330.0)]
    Path("size.csv").write_text("actual_nm,nominal_nm\n" + "\n".join(rows) + "\n", "utf-8")
    axis = ("--axis", "x", "size.csv", "--k", "24", "--base-nm", "1000")
    options = ("--v-max", "220", "--v-min", "-220", "--scanner", "new.toml", "--write")
    outcome = run("calibrate", "size", *axis, *options)
    assert outcome.status == 0, outcome.err
    assert "v_max = 220.0 # V, maximum output of the piezo driver\nv_min = -220.0" in Path("new.toml").read_text(
        "utf-8"
    )
    found = run("calibrate", "size", *axis, "--scanner", "new.toml", "--json")
    assert json.loads(found.out)["parameters"]["k_nm_per_v"]["value"] == pytest.approx(24.0, rel=0.1)
    other = run("calibrate", "size", *axis, "--scanner", "new.toml", "--v-min", "-200")
    assert "new.toml: v_min: -220 there, and --v-min -200" in other.err
    Path("offset.csv").write_text("offset_v,apparent_nm\n-200,210\n-20,200\n0,200\n190,214\n", "utf-8")
    outcome = run("calibrate", "offset", "--axis", "x", "offset.csv", "--scanner", "new.toml", "--write")
    assert outcome.status == 0, outcome.err
    Path("y.toml").write_text(Path("new.toml").read_text("utf-8") + "\n[y.size]\nk_nm_per_v = 24.0\n", "utf-8")
    scanner = load_scanner("y.toml")[0]
    assert scanner.driver == Driver(220.0, -220.0)
    assert scanner.x.offset is not None
