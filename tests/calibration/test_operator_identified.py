"""What is identified does not hang on how traces were recorded: order, units, time, drift, drive, turn and rate."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from foreign_plants import SIX, V_MAX, Floats, ForeignPlant, ManyPlays, record, triangle
from hypothesis import example, given, settings
from hypothesis import strategies as st

from tablegen.calibration.laws.hysteresis import Trace
from tablegen.calibration.operator.fit import OperatorFit, fit_operator
from tablegen.calibration.operator.loop_errors import compare
from tablegen.calibration.operator.periodic_line import PeriodicLine, periodic_line
from tablegen.calibration.tables.columns import DISPLACEMENT, DRIVE, TIME, TRACE
from tablegen.calibration.tables.table import read_table
from tablegen.calibration.tables.traces import split_traces

PLANT = ForeignPlant(ManyPlays())
STROKES = (0.1, 0.35, 0.65, 0.95)
SAMPLES = 500
LINES = ((0.4, 0.6), (0.25, 0.75), (0.1, 0.9))  # none of which was measured


def fitted(lines: list[PeriodicLine]) -> OperatorFit:
    return fit_operator(lines, None, lambda _: 1.0)


@cache
def records(noise: float) -> tuple[Trace, ...]:
    return tuple(
        Trace(f"{stroke:g}", *record(PLANT, 0.5, stroke, seed=k, noise=noise, samples=SAMPLES))
        for k, stroke in enumerate(STROKES)
    )


@cache
def base() -> OperatorFit:
    return fitted([periodic_line(one, V_MAX) for one in records(0.001)])


def distance(one: OperatorFit, other: OperatorFit) -> tuple[float, float]:
    """Largest distance of branches in percent, and of extents in percent after the first extent was made the same."""
    apart, ratios = 0.0, []
    for low, high in LINES:
        first, second = (fit.operator.loop(low, high) for fit in (one, other))
        inside = (first.rising > 0.1) & (first.rising < 0.9)
        for side in ("rising", "falling"):
            apart = max(apart, float(np.max(np.abs(getattr(first, side) - getattr(second, side))[inside])))
        ratios.append(second.extent_nm / first.extent_nm)
    return 100.0 * apart, 100.0 * float(np.ptp(ratios)) / ratios[0]


@pytest.mark.common
def test_noiseless_traces_of_an_operator_that_the_family_has_are_met() -> None:
    fit = fitted([periodic_line(one, V_MAX) for one in records(0.0)])
    assert fit.family == "plays"
    assert max(errors.rms for errors in fit.in_fit) < 0.005
    # Not only between the traces: the piezo itself, at sizes that none has.
    for stroke in (0.2, 0.5, 0.8):
        truth = periodic_line(Trace("", *record(PLANT, 0.5, stroke, noise=0.0)), V_MAX)
        truth = truth.without(None, fit.operator.creep)
        errors = compare(truth, fit.operator.loop(truth.low, truth.high))
        assert errors.rms < 0.03
        assert abs(errors.size) < 0.2


@pytest.mark.rest
@given(
    st.permutations(range(len(STROKES))),
    st.floats(0.2, 5.0),
    st.floats(-1e4, 1e4),
    st.floats(0.0, 1.0),
    st.tuples(*[st.floats(-0.05, 0.05)] * 3),
)
@example([3, 1, 0, 2], 1.0, 0.0, 0.0, (0.0, 0.0, 0.0))
@settings(max_examples=2)
def test_order_scale_origin_start_and_drift_change_nothing_else(
    order: list[int], scale: float, origin_nm: float, start: float, drift: tuple[float, float, float]
) -> None:
    """``drift`` is a cubic over the record, of the line; ``start`` is where a period begins."""
    found = []
    for one in (records(0.001)[at] for at in order):
        t = one.time_s / one.time_s[-1]
        late = round(start * SAMPLES)
        moved = one.displacement_nm + float(np.ptp(one.displacement_nm)) * np.polyval((*drift, 0.0), t)
        cut = Trace(one.name, one.time_s[late:] + 3.0 * start, one.drive_v[late:], scale * moved[late:] + origin_nm)
        found.append(periodic_line(cut, V_MAX))
    fit = fitted(found)
    same = start == 0.0 and drift == (0.0, 0.0, 0.0)
    apart, sizes = distance(base(), fit)
    assert apart < (1e-3 if same else 0.1)
    assert sizes < (1e-3 if same else 0.1)
    extents = [one.operator.loop(0.1, 0.9).extent_nm for one in (base(), fit)]
    assert extents[1] == pytest.approx(scale * extents[0], rel=1e-5 if same else 1e-3)


def played(volts: Floats, rate_hz: float, seed: int) -> tuple[Floats, Floats, Floats]:
    """Five settled periods of a waveform, with 0.1 % of noise."""
    nm, periods = PLANT.settled(volts, rate_hz), 5
    time = np.arange(periods * len(volts)) / (len(volts) * rate_hz)
    noise = 0.001 * np.ptp(nm) * np.random.default_rng(seed).standard_normal(len(time))
    return time, np.tile(volts, periods), np.tile(nm, periods) + noise


@pytest.mark.rest
def test_other_waveforms_turns_and_rates_tell_the_same_operator() -> None:
    phase = np.arange(SAMPLES) / SAMPLES
    sine = V_MAX * (0.5 - 0.125 * np.cos(2.0 * np.pi * phase))
    bent = V_MAX * (0.5 + 0.325 * np.sin(0.5 * np.pi * np.interp(phase, (0.0, 0.5, 1.0), (-1.0, 1.0, -1.0))) ** 3)
    recorded = (
        ("triangle", triangle(SAMPLES, 0.5, 0.1), 100.0),
        ("sine", sine, 40.0),
        ("slow triangle", triangle(SAMPLES, 0.5, 0.45), 30.0),
        ("bent", bent, 300.0),
        ("quick rise", triangle(SAMPLES, 0.5, 0.82, 0.3), 100.0),
        ("sawtooth", triangle(SAMPLES, 0.5, 0.97, 0.8), 100.0),
    )
    lines = [
        periodic_line(Trace(name, *played(volts, rate, k)), V_MAX) for k, (name, volts, rate) in enumerate(recorded)
    ]
    fit = fitted(lines)
    assert [line.stroke for line in fit.operator.lines] == pytest.approx([stroke for _, stroke in SIX], rel=0.01)
    for stroke in (0.2, 0.5, 0.8):
        truth = periodic_line(Trace("", *record(PLANT, 0.5, stroke, noise=0.0)), V_MAX)
        truth = truth.without(None, fit.operator.creep)
        errors = compare(truth, fit.operator.loop(truth.low, truth.high))
        assert errors.rms < 0.1
        assert abs(errors.size) < 0.5


def test_traces_of_one_file_are_those_of_several(tmp_path: Path) -> None:
    columns = [(one.time_s, one.drive_v, one.displacement_nm) for one in records(0.001)]
    head = "time_s,drive_v,displacement_nm"
    numbered = np.concatenate([np.column_stack([*three, np.full(len(three[0]), k)]) for k, three in enumerate(columns)])
    np.savetxt(tmp_path / "numbered.csv", numbered, "%.17g", ",", header=f"{head},trace", comments="")
    np.savetxt(tmp_path / "following.csv", numbered[:, :3], "%.17g", ",", header=head, comments="")
    for name in ("numbered.csv", "following.csv"):
        table = read_table(tmp_path / name, [TIME, DRIVE, DISPLACEMENT], [TRACE])
        lines = [periodic_line(trace, V_MAX) for trace in split_traces(table)]
        assert len(lines) == len(STROKES)
        for line, one in zip(lines, records(0.001), strict=True):
            assert np.array_equal(line.displacement_nm, periodic_line(one, V_MAX).displacement_nm)
