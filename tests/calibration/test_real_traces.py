"""Records of a piezo by somebody else are read as they are: micrometres, and volts at the amplifier's input."""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from building import REPOSITORY
from real_files import real_folder

import tablegen
from tablegen.api.calibrated_records import CalibratedRecords
from tablegen.api.predict import Predicted
from tablegen.calibration.record_checks import Known, trace_remarks
from tablegen.calibration.tables.columns import DISPLACEMENT, DRIVE, TIME
from tablegen.calibration.tables.recorder import Recorder
from tablegen.compensation.operator.uncertainty import possible_errors
from tablegen.numerics.arrays import Bools, Floats
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


@dataclass(frozen=True, eq=False)
class Prediction:
    """The fit to the records before a time, and the second record predicted; errors in percent of its stroke."""

    fit: CalibratedRecords
    predicted: Predicted
    from_s: float

    @property
    def later(self) -> Bools:
        return self.predicted.time_s >= self.from_s

    @property
    def stroke_nm(self) -> float:
        assert self.predicted.measured_nm is not None
        return float(np.ptp(self.predicted.measured_nm[self.predicted.time_s > 1.0]))

    @property
    def error(self) -> Floats:
        """Of the part that is predicted, without its mean."""
        assert self.predicted.measured_nm is not None
        error = (self.predicted.position_nm - self.predicted.measured_nm)[self.later]
        return np.asarray(100.0 * (error - np.mean(error)) / self.stroke_nm)

    @property
    def rms(self) -> float:
        return float(np.sqrt(np.mean(self.error**2)))

    @property
    def uncertainty(self) -> float:
        """The rms error that `predict` states for the part that is predicted."""
        return 100.0 * float(np.sqrt(np.mean(self.predicted.sweep_uncertainty_nm[self.later] ** 2))) / self.stroke_nm


def prediction(place: Path, until_s: int, from_s: float) -> Prediction:
    """The second record, by an operator of the first and of the second until a time; 0 s leaves that out."""
    assert FOLDER is not None
    full, ramp = (FOLDER / name for name in NAMES)
    before = place / "before.csv"
    before.write_text("".join(ramp.read_text("utf-8").splitlines(keepends=True)[: until_s * 200 + 1]), "utf-8")
    scanner = place / "stage.toml"
    scanner.write_text('name = "stage"\nv_max = 3.6\n[x.size]\nk_nm_per_v = 12500\n[y]\nlike = "x"\n', "utf-8")
    records = [full, before] if until_s else [full]
    fit = tablegen.calibrate_operator(records, axis="x", scanner=scanner, drive_gain=1.0, delay_s="fit")
    assert isinstance(fit, CalibratedRecords)
    fit.write(scanner)
    predicted = tablegen.predict(scanner, ramp, axis="x", against=ramp, drive_gain=1.0, delay_s=fit.delay.value)
    return Prediction(fit, predicted, from_s)


def page() -> str:
    return " ".join((REPOSITORY / "docs" / "evidence.md").read_text("utf-8").split())


@pytest.mark.common
def test_the_fall_of_a_real_amplitude_is_predicted_from_records_before_it(tmp_path: Path) -> None:
    made = prediction(tmp_path, 17, 17.0)
    (_, before) = made.fit.in_time.errors
    assert max(one.predicted_rms for one in made.fit.in_time.errors) < 0.3
    rms, largest = made.rms, float(np.max(np.abs(made.error)))
    assert rms < 0.35
    assert largest < 1.2
    assert f"| both, to 17 s | 17 to 25 s | {rms:.2f} | {largest:.2f} |" in page()
    assert f"| operator in time | {made.fit.in_time.weights} |" in page()
    smooth = np.convolve(made.error, np.full(5, 0.2), "valid")
    assert f"averaged over 25 ms, is {np.max(np.abs(smooth)):.2f} %" in page()
    expected = possible_errors(made.fit.fit.operator, 1.0, 0.5)[0]
    assert 0.4 * expected < rms < expected
    assert f"states {expected:.2f} % rms for lines of the full stroke" in page()
    assert 0.3 * made.uncertainty < rms < made.uncertainty
    assert f"an uncertainty of {made.uncertainty:.2f} % rms from 17 s on, beside the {rms:.2f} % that were" in page()
    whole, error = made.predicted, made.predicted.error_nm
    assert error is not None
    percent = 100.0 / made.stroke_nm
    left = f"{percent * np.std(error):.2f} % rms, beside {percent * whole.uncertainty_nm:.2f} %"
    assert f"the whole of the second record leaves {left}" in page()
    assert f"to {made.fit.in_time.candidates['medium']:.3f} %" in page()
    assert made.fit.fit.operator.creep.loss_per_decade == 0.0
    assert "its fitted loss is 0" in page()
    assert before.predicted_from_s < 17.0


@pytest.mark.rest
@pytest.mark.parametrize(
    ("row", "until_s", "from_s"),
    [
        ("both, to 15 s | 15 to 25 s", 15, 15.0),
        ("both, to 18 s | 18 to 25 s", 18, 18.0),
        ("the first alone | 17 to 25 s", 0, 17.0),
    ],
)
def test_the_other_rows_of_the_page(tmp_path: Path, row: str, until_s: int, from_s: float) -> None:
    made = prediction(tmp_path, until_s, from_s)
    assert f"| {row} | {made.rms:.2f} | {np.max(np.abs(made.error)):.2f} |" in page()
    assert made.rms < made.uncertainty


@pytest.mark.common
def test_curves_without_memory_and_the_noise_of_the_sensor() -> None:
    assert FOLDER is not None
    full, ramp = (np.loadtxt(FOLDER / name, delimiter=",", skiprows=1) for name in NAMES)
    time_s, drive, um = ramp.T
    stroke = float(np.ptp(um[time_s > 1.0]))
    for row, until_s, from_s in (
        ("both, to 15 s | 15 to 25 s", 15.0, 15.0),
        ("both, to 17 s | 17 to 25 s", 17.0, 17.0),
        ("both, to 18 s | 18 to 25 s", 18.0, 18.0),
        ("the first alone | 17 to 25 s", 0.0, 17.0),
    ):
        some = np.concatenate([full, ramp[time_s < until_s]])
        left = []
        for degree in (1, 3):
            error = np.polyval(np.polyfit(some[:, 1], some[:, 2], degree), drive) - um
            left.append(100.0 * float(np.std(error[time_s >= from_s])) / stroke)
        assert re.search(rf"\| {re.escape(row)} \| [\d.]+ \| [\d.]+ \| {left[0]:.2f} \| {left[1]:.2f} \|", page()), left
    rests = um[time_s >= 20.0]
    noise, most = (100.0 * float(one) / stroke for one in (np.std(rests), np.max(np.abs(rests - np.mean(rests)))))
    assert f"{noise:.2f} % rms while the stage rests from 20 s on, single samples up to {most:.2f} %" in page()
