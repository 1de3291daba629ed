"""Fit the memory of the bias to records of lines that go through a change of offset.

The mean of each line after a change is a constant, what hysteresis and creep leave by the operator, and what the
sensitivity still has to follow: a share of the change of the mean position, by exp(-t / time), with its own creep.
Steps up and steps down have values of their own; the time is searched, the share is linear.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.calibration.laws.hysteresis import Trace
from tablegen.compensation.operator.bias_memory import BiasMemory, late_terms
from tablegen.compensation.operator.creep import NO_CREEP, LogarithmicCreep
from tablegen.compensation.operator.in_time import turns_of
from tablegen.compensation.operator.operator import Operator
from tablegen.compensation.operator.transient import SettledLine, transient_between
from tablegen.numerics.arrays import Floats
from tablegen.numerics.driver import Driver

LEAST_LINES = 20  # at the offset before a change, and at the one after it
_LEAST_STEP = 0.02  # of the driver's range
_SAME = 0.2  # of the stroke: turns that are nearer to each other are those of one offset
_SKIPPED = 0.05  # of the lines after a change: hysteresis of some families closes its loop meanwhile
_MOST_SKIPPED = 50
_TRIALS = 120  # of time constants
_LONGEST = 2.0  # of the longest stretch, for time constants
_WORTH = 0.8  # of the squares that creep alone leaves: a memory that leaves more is none


@dataclass(frozen=True, eq=False)
class Stretch:
    """Lines at one offset: ``means_nm`` of each, shape (lines,), from ``begin_s`` on."""

    line: SettledLine
    begin_s: float
    means_nm: Floats

    @property
    def centre(self) -> float:
        """The offset, in shares of the driver's range."""
        return 0.5 * (self.line.low + self.line.high)


@dataclass(frozen=True)
class BiasMemoryFit:
    """The memory of the bias, None where the records show none.

    ``rms_nm`` is what the means of the lines are from the fit, and ``without_nm`` from creep alone.
    """

    memory: BiasMemory | None
    rms_nm: float
    without_nm: float


def stretches(trace: Trace, driver: Driver) -> list[Stretch]:
    """Split a record into the lines at each offset.

    Raises
    ------
    Unphysical
        If there is no change of offset, or too few lines before or after one.
    """
    u, time, moved = driver.share(trace.drive_v), trace.time_s, trace.displacement_nm
    if len(time) < 4 * LEAST_LINES or not np.all(np.isfinite([time, u, moved])) or np.any(np.diff(time) <= 0.0):
        raise Unphysical("needs ascending times and finite values, of some lines at each of two offsets")
    corners = turns_of(u)
    lows = [here for here, after in pairwise(corners[1:-1]) if u[after] > u[here]]
    if not lows:
        raise Unphysical("the drive has no lines; record the running scan while its offset changes")
    strokes = [float(np.max(u[a:b]) - u[a]) for a, b in pairwise(lows)]
    limit = _SAME * float(np.median(strokes)) if strokes else 0.0
    groups = [[lows[0]]]
    for at in lows[1:]:
        if abs(u[at] - np.median(u[groups[-1]])) <= limit:
            groups[-1].append(at)
        else:
            groups.append([at])
    area = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(time) * (moved[1:] + moved[:-1]))])
    out = [_stretch(u, time, area, group) for group in groups if len(group) > LEAST_LINES]
    steps = [after.centre - before.centre for before, after in pairwise(out)]
    if not any(abs(step) >= _LEAST_STEP for step in steps):
        raise Unphysical(
            f"has no change of offset of {100.0 * _LEAST_STEP:g} % of the driver's range with {LEAST_LINES} lines "
            "before and after it; record the running scan from some lines before the change on"
        )
    return out


def _stretch(u: Floats, time: Floats, area: Floats, lows: Sequence[int]) -> Stretch:
    """Return the lines between lower turns; ``area`` is the integral of the displacement up to each sample."""
    first, last = lows[0], lows[-1]
    begin, lines = float(time[first]), len(lows) - 1
    period = (float(time[last]) - begin) / lines
    # A whole period has the same mean wherever it begins, so the turns need not be sampled.
    at = begin + period * np.arange(lines + 1)
    means = np.diff(np.interp(at, time, area)) / period
    tops = [a + int(np.argmax(u[a:b])) for a, b in pairwise(lows)]
    turn = float(np.median((time[tops] - time[list(lows[:-1])]) / period))
    line = SettledLine(float(np.median(u[list(lows)])), float(np.median(u[tops])), min(max(turn, 0.02), 0.98), period)
    return Stretch(line, begin, means)


def fit_bias_memory(
    records: Sequence[Sequence[Stretch]], operator: Operator, factor_at: Callable[[float], float]
) -> BiasMemoryFit:
    """Fit share and time constant to the lines of some records, for steps up and for steps down.

    Parameters
    ----------
    records
        The stretches of each record, of which the first two count: before the change the scan has lasted for long.
    operator
        The operator of settled traces, with its creep.
    factor_at
        The factor of ``Operator.loop`` at a centre.

    Raises
    ------
    Unphysical
        If the time constant is longer than the records show.
    """
    parts: dict[bool, list[_Lines]] = {True: [], False: []}
    for before, now, *_ in records:
        parts[now.centre > before.centre].append(_lines(before, now, operator, factor_at))
    fits = {rising: _fit_direction(some) for rising, some in parts.items() if some}
    count = sum(one.lines for one in fits.values())
    rms, without = (
        float(np.sqrt(sum(values) / count))
        for values in zip(*((one.squares, one.without) for one in fits.values()), strict=True)
    )
    shares = {rising: one.late for rising, one in fits.items() if one.late is not None}
    if not shares:
        return BiasMemoryFit(None, rms, without)
    # A direction that no record has takes the share of the other one.
    none = next(iter(shares.values())) if len(fits) == 1 else (0.0, next(iter(shares.values()))[1])
    return BiasMemoryFit(BiasMemory(*shares.get(True, none), *shares.get(False, none)), rms, without)


@dataclass(frozen=True, eq=False)
class _Lines:
    """The lines after a change: their times since, their means beside what the operator says, and the step, in nm."""

    since_s: Floats
    left_nm: Floats
    step_nm: float
    period_s: float
    creep: LogarithmicCreep

    def late(self, time_s: float) -> Floats:
        """Return the column of the share at a time constant, without its mean; shape (lines,)."""
        terms = [(share, tau_s) for share, tau_s in late_terms(self.creep, time_s) if tau_s > self.period_s]
        out = -self.step_nm * np.sum([share * np.exp(-self.since_s / tau_s) for share, tau_s in terms], axis=0)
        return np.asarray(out - np.mean(out), dtype=np.float64)


def _lines(before: Stretch, now: Stretch, operator: Operator, factor_at: Callable[[float], float]) -> _Lines:
    """Return the lines after a change, without the first ones, in which loops may close."""
    count, period_s = len(now.means_nm), now.line.period_s
    operator = operator.at_rate(1.0 / period_s)
    lines, factor = (before.line, now.line), factor_at(now.centre)
    after = transient_between(replace(operator, bias_memory=None), *lines, factor)
    unit = replace(operator, creep=NO_CREEP, bias_memory=BiasMemory(1.0, 1.0, 1.0, 1.0))  # the whole change is late
    step_nm = sum(term.nm for term in transient_between(unit, *lines, factor).bias)
    skipped = min(int(_SKIPPED * count) + 2, _MOST_SKIPPED)
    left = (now.means_nm - after.off_nm(period_s, count, 0.0))[skipped:]
    since = np.asarray(period_s * (np.arange(skipped, count) + 0.5), dtype=np.float64)
    left -= float(np.mean(left))
    return _Lines(since, left, step_nm, period_s, operator.creep)


@dataclass(frozen=True)
class _Direction:
    """Share and time constant in s of one direction, None where there are none; sums of squares, without them too."""

    late: tuple[float, float] | None
    squares: float
    without: float
    lines: int


def _fit_direction(some: Sequence[_Lines]) -> _Direction:
    """Search the time constant of one direction, and solve for the share."""
    longest = max(float(one.since_s[-1]) for one in some)
    trials = np.geomspace(LEAST_LINES * max(one.period_s for one in some), _LONGEST * longest, _TRIALS)
    left = np.concatenate([one.left_nm for one in some])
    total, solutions = float(left @ left), []
    for time_s in trials.tolist():
        column = np.concatenate([one.late(time_s) for one in some])
        share = float(column @ left) / float(column @ column)
        solutions.append((float(np.sum((left - share * column) ** 2)), share, time_s))
    squares, share, time_s = min(solutions)
    if squares > _WORTH * total:
        return _Direction(None, total, total, len(left))
    if time_s == trials[-1]:
        raise Unphysical(
            f"the lines still drift at the end of {longest:.3g} s: the memory of the bias is longer than the record "
            "shows; record for longer after the change"
        )
    return _Direction((share, float(f"{time_s:.4g}")), squares, total, len(left))
