"""Wrong records are named by what they look like; the same record without the fault has no such note."""

import re
from collections.abc import Callable

import numpy as np
import pytest
from calibrating import Scanner
from foreign_plants import V_MAX, BoucWen, ForeignPlant, record

from tablegen import Laboratory, calibrate, calibrate_operator
from tablegen.api.measured import table_of
from tablegen.base.input_errors import Rejected
from tablegen.base.warnings import Remark
from tablegen.calibration.record_checks import Known, table_remarks, trace_remarks
from tablegen.calibration.tables.columns import ACTUAL, APPARENT, DISPLACEMENT, DRIVE, OFFSET, TIME
from tablegen.calibration.tables.table import MeasuredTable
from tablegen.numerics.driver import Driver

DRIVER = Driver(100.0)
KNOWN = Known(DRIVER, nm_per_v=10.0, gain=20.0, absolute=True)
Columns = dict[str, np.ndarray]
CODES = {
    "assumed-unit", "clipped-sensor", "controller-volts", "inverted-sensor", "mains-hum", "sensor-delay",
    "wrong-length-unit",
}  # fmt: skip


def sound(v: float = 60.0, turn: float = 0.5, period_s: float = 0.01, delay_s: float = 0.0) -> Columns:
    """A trace of the paper's scanner, 10 nm per V, with noise of 0.2 %, in 12 periods."""
    noise = 0.002 * np.random.default_rng(round(v)).standard_normal((2, 4800))
    one = Scanner(turn=turn, period_s=period_s, delay_s=delay_s).trace(v, periods=12.0, samples=4800, noise=noise)
    return {"time_s": one.time_s, "drive_v": one.drive_v, "displacement_nm": one.displacement_nm}


def table(columns: Columns) -> MeasuredTable:
    return table_of(columns, [TIME, DRIVE, DISPLACEMENT])


def remarks(columns: Columns, known: Known = KNOWN) -> tuple[Remark, ...]:
    return trace_remarks([table(columns)], known, "x")


def clipped(columns: Columns) -> Columns:
    x = columns["displacement_nm"]
    return columns | {"displacement_nm": np.minimum(x, np.min(x) + 0.9 * np.ptp(x))}


def hum(hz: float, share: float = 0.01) -> Callable[[Columns], Columns]:
    def change(columns: Columns) -> Columns:
        x = columns["displacement_nm"]
        return columns | {"displacement_nm": x + share * np.ptp(x) * np.sin(2.0 * np.pi * hz * columns["time_s"] + 1.0)}

    return change


def times(name: str, factor: float) -> Callable[[Columns], Columns]:
    return lambda columns: columns | {name: factor * columns[name]}


REFUSED: dict[str, tuple[Callable[[Columns], Columns], str, str]] = {
    "micrometres": (
        times("displacement_nm", 1e-3), "wrong-length-unit",
        r"moves 0\.010\d nm per V where the size law of the scanner says 10: this looks like micrometres called "
        r"nanometres\. Name the column displacement_um",
    ),
    "nanometres as micrometres": (times("displacement_nm", 1e3), "wrong-length-unit", "nanometres called micrometres"),
    "volts of the controller": (
        lambda one: one | {"drive_v": one["drive_v"] / 20.0}, "controller-volts",
        r"reaches 4 V, 4 % of the driver's .*moves 20\.?\d* times as far per volt.*Give --drive-gain G",
    ),
    "a clipped sensor": (
        clipped, "clipped-sensor", r"stays at its largest value, [\d.]+ nm, for \d+ % of the record while the drive"
    ),
}  # fmt: skip
NOTED: dict[str, tuple[Callable[[Columns], Columns], str, str]] = {
    "an inverted sensor": (times("displacement_nm", -1.0), "inverted-sensor", "falls where the drive rises.*invert"),
    "hum of 50 Hz beside the harmonics": (
        lambda _: hum(50.0)(sound(period_s=0.03)), "mains-hum", r"a line at 50 Hz of 1 % of .* mains hum"
    ),
    "hum of 60 Hz on a harmonic": (lambda _: hum(60.0)(sound(period_s=0.2)), "mains-hum", "a line at 60 Hz of 1"),
}  # fmt: skip


@pytest.mark.parametrize("fault", REFUSED)
def test_a_record_whose_fit_would_be_wrong_is_refused(fault: str) -> None:
    change, code, reason = REFUSED[fault]
    assert remarks(sound()) == ()
    with pytest.raises(Rejected, match=reason) as caught:
        remarks(change(sound()))
    assert [(one.code, one.axis) for one in caught.value.problems] == [(code, "x")]


@pytest.mark.parametrize("fault", NOTED)
def test_a_record_that_may_be_wrong_has_a_note(fault: str) -> None:
    change, code, reason = NOTED[fault]
    (remark,) = remarks(change(sound()))
    assert remark.code == code
    assert re.search(reason, remark), remark


@pytest.mark.common
@pytest.mark.parametrize("turn", [0.5, 0.7])
@pytest.mark.parametrize("share", [0.01, 0.02, 0.04, -0.02])
def test_a_delay_is_named_in_percent_of_the_period(turn: float, share: float) -> None:
    late = sound(turn=turn, delay_s=share * 0.01)
    (remark,) = remarks(late)
    assert remark.code == "sensor-delay"
    assert remark.percent == pytest.approx(100.0 * abs(share), rel=0.06)
    assert "--delay-s fit" in remark
    assert remarks(late, Known(DRIVER, 10.0, fits_delay=True)) == ()
    assert remarks(late, Known(DRIVER, 10.0, delay_s=share * 0.01)) == ()


@pytest.mark.common
@pytest.mark.parametrize("turn", [0.3, 0.5, 0.8])
@pytest.mark.parametrize("period_s", [0.0017, 0.01, 0.1, 1.0])
@pytest.mark.parametrize("v", [10.0, 60.0, 100.0])
def test_sound_traces_have_no_note(v: float, period_s: float, turn: float) -> None:
    assert remarks(sound(v, turn, period_s)) == ()


def test_traces_of_other_piezos_have_no_note() -> None:
    """Creep, drift and another kind of hysteresis are no fault of the record."""
    for stroke, rate_hz in ((0.1, 3.0), (0.5, 100.0), (0.97, 10.0)):
        t, v, x = record(ForeignPlant(BoucWen()), 0.5, stroke, rate_hz, samples=400)
        columns = {"time_s": t, "drive_v": v, "displacement_nm": x}
        assert remarks(columns, Known(Driver(V_MAX), states_gain=stroke < 0.2)) == ()


def test_volts_of_the_controller_by_the_gain_in_the_scanner_file_or_by_their_range() -> None:
    low = sound() | {"drive_v": sound()["drive_v"] / 20.0}
    with pytest.raises(Rejected, match=r"the amplifier of the scanner file has a gain of 20"):
        remarks(low, Known(DRIVER, gain=20.0))
    (remark,) = remarks(low, Known(DRIVER))
    assert (remark.code, remark.weight) == ("controller-volts", "spoils")
    assert remarks(low, Known(DRIVER, gain=20.0, states_gain=True)) == ()


def test_lengths_are_compared_with_those_of_any_scanner_where_the_size_is_not_calibrated() -> None:
    small = times("displacement_nm", 1e-3)(sound())
    with pytest.raises(Rejected, match=r"piezo scanners move 0\.1 to 20000: .* calibrate the size first"):
        remarks(small, Known(DRIVER, absolute=True))
    (remark,) = remarks(small, Known(DRIVER))
    assert (remark.code, remark.weight) == ("wrong-length-unit", "spoils")


def test_traces_of_both_signs_are_named() -> None:
    tables = [table(sound(30.0)), table(times("displacement_nm", -1.0)(sound()))]
    (remark,) = trace_remarks(tables, KNOWN, "x")
    assert (remark.code, remark.weight) == ("inverted-sensor", "spoils")


def test_tables_of_sizes_and_offsets() -> None:
    volts, nm = np.array([10.0, 30.0, 60.0, 100.0]), np.array([100.0, 310.0, 640.0, 1100.0])

    def codes(drive: np.ndarray, size: np.ndarray) -> list[str]:
        one = table_of({"drive_v": drive, "actual_nm": size}, [DRIVE, ACTUAL])
        return [remark.code for remark in table_remarks(one, Known(DRIVER))]

    assert codes(volts, nm) == []
    assert codes(volts, nm / 1e3) == ["wrong-length-unit"]
    assert codes(volts / 20.0, nm) == ["controller-volts"]
    for gain, expected in ((1.0, []), (20.0, ["controller-volts"])):
        offsets = {"offset_v": np.array([7.0, 50.0, 93.0]) / gain, "apparent_nm": np.array([16.0, 17.7, 21.0])}
        one = table_of(offsets, [OFFSET, APPARENT])
        assert [remark.code for remark in table_remarks(one, Known(DRIVER))] == expected


def test_the_laboratory_has_no_note_and_a_fault_reaches_the_findings() -> None:
    trace = Laboratory().trace("x", 60.0, 50.0, 100.0, samples=200)
    assert not CODES & {one.code for one in calibrate("hysteresis", [trace], axis="x", v_max=100.0).findings()}
    trace = dict(trace) | {"displacement_nm": -np.asarray(trace["displacement_nm"])}
    findings = calibrate("hysteresis", [trace], axis="x", v_max=100.0).findings()
    assert [one.code for one in findings if one.code in CODES] == ["inverted-sensor"]
    assert sum("its sign was inverted" in one.text for one in findings) == 1


@pytest.mark.parametrize("truth", ["default", "duhem"])
@pytest.mark.parametrize("rate_hz", [1.0, 10.0, 100.0])
def test_traces_that_begin_after_a_rest_have_no_note(rate_hz: float, truth: str) -> None:
    """Settling and creep are below the mains, and above them."""
    trace = Laboratory(truth).trace("x", 30.0, 50.0, rate_hz, samples=200, turn=0.8)
    assert remarks(dict(trace), Known(DRIVER)) == ()


def test_an_operator_is_not_fitted_to_a_wrong_record() -> None:
    traces = [times("displacement_nm", 1e-3)(sound(v)) for v in (10.0, 60.0, 100.0)]
    with pytest.raises(Rejected, match="micrometres called nanometres") as caught:
        calibrate_operator(traces, axis="y", v_max=100.0)
    assert {(one.code, one.axis) for one in caught.value.problems} == {("wrong-length-unit", "y")}
    with pytest.raises(Rejected, match="'speed' is none of time, drive, displacement, trace"):
        calibrate_operator(traces, axis="y", v_max=100.0, columns="speed=1")
