"""Records of a piezo by somebody else are read as they are: micrometres, and volts at the amplifier's input."""

from pathlib import Path

import numpy as np
import pytest
from building import REPOSITORY
from real_files import real_folder

import tablegen
from tablegen.api.calibrated_records import CalibratedRecords
from tablegen.calibration.record_checks import Known, trace_remarks
from tablegen.calibration.tables.columns import DISPLACEMENT, DRIVE, TIME
from tablegen.calibration.tables.recorder import Recorder
from tablegen.compensation.operator.uncertainty import possible_errors
from tablegen.numerics.driver import Driver

NAMES = ("piezo_1hz_full.csv", "piezo_1hz_ramp.csv")
GAIN = 20.0
FOLDER = real_folder()  # conftest.py leaves this module out where there is none


@pytest.mark.common
@pytest.mark.parametrize("name", [name for name in NAMES if FOLDER and (FOLDER / name).is_file()])
def test_a_real_trace_is_read_as_it_is(name: str) -> None:
    assert FOLDER is not None
    path = FOLDER / name
    table = Recorder(None, GAIN).read(path, [TIME, DRIVE, DISPLACEMENT])
    plain = np.loadtxt(path, delimiter=",", skiprows=1)
    assert np.array_equal(table[TIME], plain[:, 0])
    assert table[DRIVE] == pytest.approx(GAIN * plain[:, 1], rel=1e-15)
    assert table[DISPLACEMENT] == pytest.approx(1e3 * plain[:, 2], rel=1e-15)
    assert 39e3 < np.ptp(table[DISPLACEMENT]) < 50e3  # nm, with the first loop from rest
    assert 60.0 < np.ptp(table[DRIVE]) <= 72.0  # V, of 0 to 3.6 V at the amplifier's input
    chosen = Recorder("time=1,drive=2,position=3:um", GAIN).read(path, [TIME, DRIVE, DISPLACEMENT])
    assert np.array_equal(chosen[DISPLACEMENT], table[DISPLACEMENT])
    assert trace_remarks([table], Known(Driver(100.0), states_gain=True, absolute=True), "x") == ()
    raw = Recorder().read(path, [TIME, DRIVE, DISPLACEMENT])
    (remark,) = trace_remarks([raw], Known(Driver(100.0)), "x")
    assert remark.code == "controller-volts"


@pytest.mark.common
def test_the_fall_of_a_real_amplitude_is_predicted_from_records_before_it(tmp_path: Path) -> None:
    assert FOLDER is not None
    full, ramp = (FOLDER / name for name in NAMES)
    before = tmp_path / "ramp_to_17s.csv"
    before.write_text("".join(ramp.read_text("utf-8").splitlines(keepends=True)[: 17 * 200 + 1]), "utf-8")
    scanner = tmp_path / "stage.toml"
    scanner.write_text('name = "stage"\nv_max = 3.6\n[x.size]\nk_nm_per_v = 12500\n[y]\nlike = "x"\n', "utf-8")
    fit = tablegen.calibrate_operator([full, before], axis="x", scanner=scanner, drive_gain=1.0, delay_s="fit")
    assert isinstance(fit, CalibratedRecords)
    assert max(one.predicted_rms for one in fit.in_time.errors) < 0.3
    fit.write(scanner)
    predicted = tablegen.predict(scanner, ramp, axis="x", against=ramp, drive_gain=1.0, delay_s=fit.delay.value)
    later = predicted.time_s >= 17.0
    assert predicted.measured_nm is not None
    error = (predicted.position_nm - predicted.measured_nm)[later]
    error = 100.0 * (error - np.mean(error)) / np.ptp(predicted.measured_nm[predicted.time_s > 1.0])
    rms, largest = float(np.sqrt(np.mean(error**2))), float(np.max(np.abs(error)))
    assert rms < 0.35
    assert largest < 1.5
    page = " ".join((REPOSITORY / "docs" / "evidence.md").read_text("utf-8").split())
    expected = possible_errors(fit.fit.operator, 1.0, 0.5)[0]
    assert 0.4 * expected < rms < expected
    assert f"an uncertainty of {expected:.2f} % rms for lines of the full stroke" in page
    assert f"| both, to 17 s | 17 to 25 s | {rms:.2f} | {largest:.2f} |" in page
