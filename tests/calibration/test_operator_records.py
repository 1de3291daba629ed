"""Records of any drive, fitted in time: what another record of the same piezo leaves, and what is refused by name."""

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from foreign_plants import BoucWen, JilesAtherton, ManyPlays, OneState
from stepped_plants import random_triangle, recorded

import tablegen
from tablegen.api.calibrated_records import CalibratedRecords
from tablegen.base.input_errors import Unphysical
from tablegen.calibration.laws.hysteresis import Trace
from tablegen.calibration.operator.record_fit import RecordsFit, fit_records
from tablegen.calibration.operator.time_columns import Begin, late_sum, resonance_and_delay
from tablegen.calibration.operator.time_record import time_record
from tablegen.compensation.dynamics import SecondOrder
from tablegen.compensation.operator.in_time import OperatorInTime, Start, resonant
from tablegen.numerics.arrays import Floats

V_MAX = 100.0
PLAYS = ManyPlays(count=60)
SECONDS = 0.25


def chirp(count: int = 800) -> Floats:
    t = np.arange(count) / count
    return 0.5 - 0.47 * np.cos(2.0 * np.pi * (2.0 * t + 5.0 * t * t))


def falling_sine(count: int = 1000) -> Floats:
    t = np.arange(count) / count
    return 0.5 - 0.48 * np.clip(1.8 - 1.8 * t, 0.0, 1.0) * np.cos(2.0 * np.pi * 12.0 * t)


def path_through(*turns: float, samples: int = 200) -> Floats:
    return np.concatenate([np.linspace(a, b, samples, endpoint=False) for a, b in pairwise(turns)])


def steps() -> Floats:
    levels = np.random.default_rng(4).uniform(0.05, 0.95, 20)
    ramps = [np.concatenate([np.linspace(a, b, 8), np.full(22, b)]) for a, b in pairwise([0.0, 0.95, 0.05, *levels])]
    return np.concatenate(ramps)


def trace(u: Floats, core: ManyPlays | OneState = PLAYS, name: str = "record.csv", seed: int = 1) -> Trace:
    time = np.linspace(0.0, SECONDS, len(u))
    return Trace(name, time, V_MAX * u, recorded(core, u, time, seed=seed))


def fitted(*traces: Trace, delay_s: float | None = 0.0) -> RecordsFit:
    return fit_records([time_record(one, V_MAX) for one in traces], None, lambda _: 1.0, delay_s)


def error_of_another(fit: RecordsFit, core: ManyPlays | OneState) -> float:
    """The rms error, in percent, of a record that the fit has not seen, as `predict` has it."""
    u = random_triangle(77, 16, 30)
    time = np.linspace(0.0, SECONDS, len(u))
    measured = recorded(core, u, time, noise=0.0)
    error = OperatorInTime(fit.operator).position(time, u, Start.REST) - measured
    return 100.0 * float(np.std(error) / np.ptp(measured))


DRIVES: dict[str, tuple[Callable[[], Floats], float]] = {
    "random triangle": (lambda: random_triangle(3), 0.09),
    "chirp": (chirp, 0.25),
    "first loop": (lambda: path_through(0.0, 0.9, 0.1, 0.7, 0.0), 0.4),
    "sine that falls": (falling_sine, 0.15),
    "steps": (steps, 0.3),
}


@pytest.mark.common
@pytest.mark.parametrize("drive", DRIVES)
def test_a_record_of_any_drive_predicts_another_one(drive: str) -> None:
    make, most = DRIVES[drive]
    fit = fitted(trace(make()))
    (errors,) = fit.errors
    assert errors.rms < 0.16  # of which 0.1 is noise
    assert errors.predicted_rms < 0.35
    assert error_of_another(fit, PLAYS) < most


@pytest.mark.common
@pytest.mark.parametrize(("core", "most"), [(BoucWen(), 0.8), (JilesAtherton(), 0.9)])
def test_other_families_are_met_as_well_as_plays_can(core: OneState, most: float) -> None:
    fit = fitted(trace(random_triangle(3), core), trace(chirp(), core, "chirp.csv", 2))
    assert error_of_another(fit, core) < most
    for errors in fit.errors:  # the prediction of the last part is honest about it
        assert 0.3 * errors.rms < errors.predicted_rms < 3.0 * errors.rms


@pytest.mark.common
def test_several_records_are_better_than_one() -> None:
    one = fitted(trace(chirp()))
    both = fitted(trace(chirp()), trace(random_triangle(3), name="other.csv", seed=2))
    assert error_of_another(both, PLAYS) < 0.6 * error_of_another(one, PLAYS)
    assert [one.record.name for one in both.errors] == ["record.csv", "other.csv"]


@pytest.mark.common
def test_the_misfit_is_what_is_left_beyond_noise() -> None:
    """Of plays there is hardly any, of another family some; noise is none of it, though it is most of the rms."""
    for core, low, high in ((PLAYS, 0.0, 0.12), (BoucWen(), 0.25, 0.6)):
        fits = []
        for noise in (0.0005, 0.003):
            u = random_triangle(3)
            time = np.linspace(0.0, SECONDS, len(u))
            fits.append(fitted(Trace("a.csv", time, V_MAX * u, recorded(core, u, time, noise))))
        quiet, loud = (fit.operator.misfit_percent for fit in fits)
        assert quiet is not None
        assert loud is not None
        assert low < quiet < high
        assert loud < quiet + 0.12
        assert fits[1].errors[0].rms > quiet + 0.12 if core is PLAYS else fits[1].errors[0].rms > 0.4


def test_gaps_and_uneven_times_are_no_matter() -> None:
    whole = trace(random_triangle(3))
    random = np.random.default_rng(2)
    rows = np.flatnonzero(random.uniform(size=len(whole.time_s)) < 0.7)
    rows = rows[(rows < 300) | (rows > 420)]
    part = Trace("part", whole.time_s[rows], whole.drive_v[rows], whole.displacement_nm[rows])
    assert error_of_another(fitted(part), PLAYS) < 0.4  # turns were in the gap


@pytest.mark.parametrize("begin", [Begin.AFTER_LOW, Begin.VIRGIN])
def test_the_state_before_a_record_is_found(begin: Begin) -> None:
    u = path_through(0.45, 0.9, 0.2, 0.8, 0.3, samples=150)
    first = {Begin.AFTER_LOW: np.zeros(30), Begin.VIRGIN: np.full(30, 0.45)}[begin]
    r = 0.4 * (np.arange(1, 31) / 30.0)
    state = first + r if begin is Begin.AFTER_LOW else first
    moved = np.empty(len(u))
    for k, drive in enumerate(u):
        state = np.clip(state, drive - r, drive + r)
        moved[k] = 400.0 * drive + 600.0 * np.mean(state)
    fit = fitted(Trace("plays", np.linspace(0.0, 1.0, len(u)), V_MAX * u, moved))
    assert fit.errors[0].begin is begin
    assert fit.errors[0].rms < 0.25


@pytest.mark.common
def test_a_start_in_no_state_of_the_model_is_left_out() -> None:
    record = trace(chirp())
    record.displacement_nm[:20] += 300.0 * np.linspace(1.0, 0.2, 20)
    (errors,) = fitted(record).errors
    assert 19 * SECONDS / 799 < errors.skipped_s < 30 * SECONDS / 799
    assert errors.rms < 0.16


@pytest.mark.common
def test_a_late_sensor_is_found_and_named() -> None:
    record = trace(chirp())
    late = np.interp(record.time_s - 4e-4, record.time_s, record.displacement_nm)
    found = fitted(Trace("late", record.time_s, record.drive_v, late), delay_s=None)
    assert found.delay.value == pytest.approx(4e-4, abs=5e-5)
    (errors,) = found.errors
    inside = slice(20, -20)  # beside the ends, where the delay reaches beyond the record
    left = (late - errors.displacement_nm)[inside]
    early = (late - np.interp(record.time_s + 4e-4, record.time_s, errors.displacement_nm))[inside]
    assert np.std(left) < 1e-2 * (errors.rms + 0.02) * float(np.ptp(late))  # at the times of the record
    assert np.std(early) > 3.0 * np.std(left)
    unaware = fitted(Trace("late", record.time_s, record.drive_v, late))
    assert unaware.delay.value == 0.0
    assert unaware.best_delay_s == pytest.approx(4e-4, abs=5e-5)
    assert unaware.delay_gain > 0.3


def test_a_known_resonance_is_taken_out() -> None:
    response = SecondOrder(400.0, 5.0, 1e-4)
    record = trace(chirp())
    y = resonant(record.time_s, record.displacement_nm, response, 0)
    y = np.interp(record.time_s - response.delay_s, record.time_s, y)
    records = [time_record(Trace("ringing", record.time_s, record.drive_v, y), V_MAX)]
    assert (
        fit_records(records, response, lambda _: 1.0, 0.0).errors[0].rms
        < 0.5 * fitted(Trace("ringing", record.time_s, record.drive_v, y)).errors[0].rms
    )
    modes, lag_s = resonance_and_delay(response, 0.0)
    assert modes is not None
    assert lag_s == response.delay_s
    column = late_sum(record.time_s, record.drive_v[:, None], *modes)[:, 0]
    assert column == pytest.approx(resonant(record.time_s, record.drive_v, response, 0), abs=1e-9 * V_MAX)


def test_few_samples_give_a_simple_operator_that_says_so() -> None:
    u = path_through(0.0, 0.9, 0.1, 0.7, samples=20)
    record = trace(u)
    columns = {"time_s": record.time_s, "drive_v": record.drive_v, "displacement_nm": record.displacement_nm}
    fit = tablegen.calibrate_operator(columns, axis="x", v_max=V_MAX)
    assert isinstance(fit, CalibratedRecords)
    assert fit.family == "plays, simple"
    assert fit.in_time.weights <= 8
    assert "a simpler model than usual: 58 samples carry no more weights" in fit.summary()


def drawn(record: Trace, **columns: Floats) -> Trace:
    old = {"time_s": record.time_s, "drive_v": record.drive_v, "displacement_nm": record.displacement_nm}
    return Trace(record.name, **{**old, **columns})


MISTAKES: dict[str, tuple[Callable[[Trace], Trace], str]] = {
    "empty": (lambda one: Trace("", *[np.zeros(0)] * 3), "has 0 samples; 40 or more are needed"),
    "one sample": (lambda one: Trace("", *[np.ones(1)] * 3), "has 1 samples; 40 or more"),
    "constant drive": (lambda one: drawn(one, drive_v=np.full(800, 50.0)), "the drive does not move; record a drive"),
    "constant displacement": (lambda one: drawn(one, displacement_nm=np.ones(800)), "the displacement does not move"),
    "no turn": (lambda one: drawn(one, drive_v=np.linspace(0.0, 90.0, 800)), "the drive never turns"),
    "wrapped time": (
        lambda one: drawn(one, time_s=one.time_s % 0.1),
        r"the time of sample 321, \S+ s, does not come after \S+ s: the counter wrapped",
    ),
    "equal times": (lambda one: drawn(one, time_s=np.round(one.time_s, 2)), "does not come after 0 s"),
    "not a number": (
        lambda one: drawn(one, displacement_nm=np.where(one.time_s > 0.1, np.nan, 1.0)),
        "the displacement of sample 321 is nan",
    ),
    "millivolts": (lambda one: drawn(one, drive_v=1e3 * one.drive_v), "is outside the driver's"),
    "volts of a controller": (lambda one: drawn(one, drive_v=0.01 * one.drive_v), "is it in volts at the piezo|Is it"),
    "clipped drive": (
        lambda one: drawn(one, drive_v=np.minimum(one.drive_v, 40.0)),
        "the drive stays at its largest value while the displacement moves by .* the recorder was clipped",
    ),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_record_without_information_is_refused_with_its_reason(mistake: str) -> None:
    change, reason = MISTAKES[mistake]
    record = trace(chirp())
    time_record(record, V_MAX)
    with pytest.raises(Unphysical, match=reason):
        time_record(change(record), V_MAX)


@pytest.mark.common
def test_records_that_contradict_each_other_are_named() -> None:
    good = [trace(random_triangle(k), name=f"{k}.csv", seed=k) for k in (3, 4)]
    other = trace(chirp(), name="chirp.csv")
    bad = drawn(other, displacement_nm=1.15 * other.displacement_nm)
    with pytest.raises(Unphysical, match=r"chirp\.csv contradicts the others: .* Leave it out, or record it again"):
        fitted(*good, bad)
    with pytest.raises(Unphysical, match=r"(chirp|3)\.csv contradicts (chirp|3)\.csv"):
        fitted(good[0], bad)
    with pytest.raises(Unphysical, match=r"chirp\.csv: moves 0\.\d+ times as far for its drive as the other records"):
        fitted(*good, drawn(other, displacement_nm=1e-3 * other.displacement_nm))


SCANNER = 'name = "own"\nv_max = 50\nv_min = -50\n[x.size]\nk_nm_per_v = 12\n[y]\nlike = "x"\n'


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_bipolar_volts_are_fitted_written_and_predicted(tmp_path: Path, sign: float) -> None:
    record = trace(falling_sine())
    columns = {
        "time_s": record.time_s,
        "drive_v": record.drive_v - 50.0,
        "displacement_nm": sign * record.displacement_nm,
    }
    scanner = tmp_path / "own.toml"
    scanner.write_text(SCANNER)
    fit = tablegen.calibrate_operator(columns, axis="x", scanner=scanner)
    assert isinstance(fit, CalibratedRecords)
    assert "the drive differs by" in fit.reason
    assert fit.record["records"][0]["predicted"]["rms_percent"] < 0.3
    assert ("inverted-sensor" in [one.code for one in fit.remarks]) == (sign < 0.0)
    fit.write(scanner)
    u = random_triangle(77, 16, 30)
    time = np.linspace(0.0, SECONDS, len(u))
    table = np.column_stack([time, V_MAX * u - 50.0, recorded(PLAYS, u, time, noise=0.0)])
    file = tmp_path / "other.csv"
    np.savetxt(file, table, delimiter=",", header="time_s,drive_v,displacement_nm", comments="")
    predicted = tablegen.predict(scanner, file, axis="x", against=file)
    assert predicted.errors_percent is not None
    assert predicted.errors_percent[0] < 0.2


def test_time_that_goes_back_is_named_by_its_line() -> None:
    record = trace(chirp())
    columns: dict[str, Any] = {"drive_v": record.drive_v, "displacement_nm": record.displacement_nm}
    time = record.time_s.copy()
    time[[400, 401]] = time[[401, 400]]
    time[[405, 406]] = time[[406, 405]]
    with pytest.raises(Unphysical, match=r"the time goes back from \S+ to \S+ s after 401 samples"):
        tablegen.calibrate_operator({"time_s": time, **columns}, axis="x", v_max=V_MAX)
