"""Traces that no operator can be made of are refused by their name, with the reason: each of them one mistake away."""

from collections.abc import Callable

import numpy as np
import pytest
from foreign_plants import V_MAX, BoucWen, ForeignPlant, record
from replacing import replace

from tablegen.base.input_errors import Unphysical
from tablegen.calibration.laws.hysteresis import Trace
from tablegen.calibration.operator import periodic_line as periodic_line_module
from tablegen.calibration.operator.fit import fit_operator
from tablegen.calibration.operator.periodic_line import periodic_line
from tablegen.calibration.operator.units import check_size

PLANT = ForeignPlant(BoucWen())
GOOD = tuple(
    Trace(f"{stroke:g}.csv", *record(PLANT, 0.5, stroke, seed=k, samples=200))
    for k, stroke in enumerate((0.2, 0.5, 0.9))
)


def clipped(values: np.ndarray, share: float) -> np.ndarray:
    """Its uppermost part cut off."""
    return np.minimum(values, np.min(values) + (1.0 - share) * np.ptp(values))


def chirped(trace: Trace) -> Trace:
    """The same periods, each a bit quicker than the one before."""
    t = trace.time_s / trace.time_s[-1]
    return replace(trace, time_s=trace.time_s[-1] * (t - 0.15 * t * t) / 0.85)


def with_hole(values: np.ndarray) -> np.ndarray:
    return np.where(np.arange(len(values)) == 70, np.nan, values)


def cut(trace: Trace, share: float) -> Trace:
    """Its beginning."""
    count = round(share * len(trace.time_s))
    return Trace(trace.name, trace.time_s[:count], trace.drive_v[:count], trace.displacement_nm[:count])


Change = Callable[[Trace], Trace]
MISTAKES: dict[str, tuple[Change, str]] = {
    "a sensor at the end of its range": (
        lambda one: replace(one, displacement_nm=clipped(one.displacement_nm, 0.2)),
        r"the displacement is at its largest value, [\d.]+, for \d+ % of the record; it was clipped, or stands still",
    ),
    "a drive that is recorded at the end of the recorder's range": (
        lambda one: replace(one, drive_v=clipped(one.drive_v, 0.2)),
        r"the drive is at its largest value, 65, for 20 % of the record; it was clipped",
    ),
    "periods that change": (chirped, r"the drive differs by [\d.]+ % of its span from period to period"),
    "less than a period": (lambda one: cut(one, 0.17), r"no whole period: the drive has to rise and to fall"),
    "no displacement": (
        lambda one: replace(one, displacement_nm=np.full(len(one.time_s), 3.0)),
        r"the displacement does not move",
    ),
    "no drive": (lambda one: replace(one, drive_v=np.zeros(len(one.time_s))), r"the drive does not move"),
    "a gap": (
        lambda one: replace(one, displacement_nm=with_hole(one.displacement_nm)),
        r"the displacement of sample 71 is nan; leave such samples out",
    ),
    "an infinite drive": (
        lambda one: replace(one, drive_v=np.where(one.time_s > 0.03, np.inf, one.drive_v)),
        r"the drive of sample \d+ is inf",
    ),
    "millivolts": (
        lambda one: replace(one, drive_v=1e3 * one.drive_v),
        r"a drive of 2\.5e\+04\.\.7\.5e\+04 V is outside the driver's 0\.\.100 V",
    ),
    "time that goes back": (
        lambda one: replace(one, time_s=np.abs(one.time_s - 0.02)),
        r"samples whose times ascend are needed",
    ),
    "few samples": (lambda one: Trace(one.name, one.time_s[::8], one.drive_v[::8], one.displacement_nm[::8]), "fewer"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_record_is_refused_with_its_reason(mistake: str) -> None:
    change, reason = MISTAKES[mistake]
    one = GOOD[1]
    assert periodic_line(one, V_MAX).stroke == pytest.approx(0.5, rel=1e-3)
    with pytest.raises(Unphysical, match=reason):
        periodic_line(change(one), V_MAX)


@pytest.mark.parametrize("samples", [40, 41, 50])
def test_few_samples_of_a_turn_that_are_the_same_are_no_clipping(samples: int) -> None:
    t = (np.arange(5 * samples) + 0.5) / samples
    drive = 20.0 + 60.0 * np.abs((t + 0.5) % 1.0 - 0.5) * 2.0
    assert periodic_line(Trace("few", t, drive, 12.0 * drive), V_MAX).periods == 3


def test_coarse_sensors_sines_and_a_little_drive_noise_are_no_clipping() -> None:
    t = np.arange(1000) / 200.0
    wave = 50.0 - 30.0 * np.cos(2.0 * np.pi * t)
    noisy = wave + 0.1 * np.random.default_rng(1).standard_normal(len(t))
    for drive in (wave, noisy):
        sensor = np.round(12.0 * wave / 4.0) * 4.0  # 180 steps
        assert periodic_line(Trace("sine", t, drive, sensor), V_MAX).rate_hz == pytest.approx(1.0, rel=1e-3)


@pytest.mark.parametrize(
    ("name", "change", "reason"),
    [
        (
            "micrometres",
            lambda one: replace(one, displacement_nm=1e-3 * one.displacement_nm),
            r"0\.5\.csv: moves 0\.001",
        ),
        (
            "picometres",
            lambda one: replace(one, displacement_nm=1e3 * one.displacement_nm),
            r"0\.5\.csv: moves 967 ",
        ),
    ],
)
def test_one_trace_in_other_units_is_named(name: str, change: Change, reason: str) -> None:
    traces = [GOOD[0], change(GOOD[1]), GOOD[2]]
    with pytest.raises(Unphysical, match=reason):
        fit_operator([periodic_line(one, V_MAX) for one in traces], None, lambda _: 1.0)


def test_traces_that_are_all_in_other_units_are_seen_by_the_scanner_file_and_the_driver() -> None:
    lines = [periodic_line(one, V_MAX) for one in GOOD]
    check_size(lines, 1000.0, "scanner.toml")
    wrong = [replace(line, displacement_nm=1e-3 * line.displacement_nm) for line in lines]
    with pytest.raises(Unphysical, match=r"the traces move 0\.001\d* times as far as scanner\.toml says"):
        check_size(wrong, 1000.0, "scanner.toml")
    shares = [periodic_line(replace(one, drive_v=one.drive_v / V_MAX), V_MAX) for one in GOOD]
    with pytest.raises(Unphysical, match=r"the largest drive moves by 0\.9 % of v_max; is it in volts at the piezo\?"):
        fit_operator(shares, None, lambda _: 1.0)


def counted(missing: float, monkeypatch: pytest.MonkeyPatch) -> set[int]:
    """Periods of a record of five, 1000 samples each, whose times differ by last bits."""
    monkeypatch.setattr(periodic_line_module, "_MISSING", missing)
    count = np.arange(5000)
    drive = 45.0 + 10.0 * np.abs((count / 500.0) % 2.0 - 1.0)
    times = [count * (1e-5 * (1.0 + bits * 2.0**-52)) for bits in range(-4, 5)]
    return {periodic_line(Trace("trace", time, drive, 9.0 * drive), 100.0).periods for time in times}


def test_the_last_bit_of_a_time_takes_no_period_away(monkeypatch: pytest.MonkeyPatch) -> None:
    assert counted(periodic_line_module._MISSING, monkeypatch) == {4}  # the first of five is left out
    assert counted(1e-3, monkeypatch) == {3, 4}, "a limit of just one sample would not tell"
