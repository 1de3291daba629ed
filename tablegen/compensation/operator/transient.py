"""The transient of an axis after a change of offset or size: hysteresis keeps its memory for a period, creep for long.

Hysteresis remembers only where a settled loop turned last (return-point memory), whatever its family. So the way
from one line to another goes along loops that the operator knows: that of the line before, the branch that rises from
0 V, where the axis has rested before, and the new line's. Creep adds its share of the change late, by exp(-t / tau)
for each term, and so does the memory of the bias after a change of offset.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from msgspec.structs import replace

from tablegen.base.input_errors import Unphysical
from tablegen.compensation.operator.bias_memory import late_terms
from tablegen.compensation.operator.loop import POINTS, Loop
from tablegen.compensation.operator.operator import SMALL_STROKE, Operator
from tablegen.compensation.transient import OFFSET_CHANGE, SIZE_CHANGE, CreepTerm, Transient
from tablegen.numerics.arrays import tree_sum
from tablegen.numerics.elementary import exp

SLOWEST_HZ = 0.01  # of frames over which drift is followed
_POINTS = 65  # of the first sweep
_MANY_PERIODS = 1e3  # periods; of a longer time constant only the mean of a line counts


@dataclass(frozen=True, slots=True)
class SettledLine:
    """A settled, straight line between the normalised drives ``low`` and ``high``, of this turn and ``period_s``."""

    low: float
    high: float
    turn: float
    period_s: float

    @classmethod
    def about(cls, stroke: float, centre: float, turn: float, period_s: float) -> "SettledLine":
        """Return the line of a stroke about a centre, as much of it as 0..1 holds."""
        stroke = min(stroke, 2.0 * centre, 2.0 - 2.0 * centre)
        return cls(centre - 0.5 * stroke, centre + 0.5 * stroke, turn, period_s)


def after_offset(
    operator: Operator,
    stroke: float,
    centre: float,
    factor: float,
    turn: float,
    period_s: float,
    factor_ratio: Callable[[float], float] | None = None,
) -> Transient:
    """Return the transient after a line whose centre was ``OFFSET_CHANGE`` nearer to the middle, or beyond it.

    ``factor_ratio`` is the factor at a centre over that at the new line, where (1) is known.
    """
    before = centre - OFFSET_CHANGE if centre >= 0.5 else centre + OFFSET_CHANGE
    lines = [SettledLine.about(stroke, at, turn, period_s) for at in (before, centre)]
    after = transient_between(operator, lines[0], lines[1], factor)
    if operator.bias_memory is not None or factor_ratio is None or factor_ratio(before) == 1.0:
        return after  # it is known, or (1) says nothing of the sensitivity
    return replace(after, unknown_nm=_late_sensitivity_nm(operator, before, centre, factor, factor_ratio(before)))


def _late_sensitivity_nm(operator: Operator, before: float, centre: float, factor: float, ratio: float) -> float:
    """Return how far the position moves if it is first as sensitive as at the centre before: in proportion from 0 V."""
    highest = max([centre, *(line.centre + 0.5 * line.stroke for line in operator.lines)])
    virgin = _loop(operator, 0.0, highest)
    here, there = (_at_rest(operator, at) for at in (centre, before))
    position = virgin.extent_nm * float(virgin.position(np.array([centre]), True)[0]) * here / factor
    return abs(position * (1.0 - there / (here * ratio)))


def after_size(
    operator: Operator, stroke: float, centre: float, factor: float, turn: float, period_s: float
) -> Transient:
    """Return the transient after a line at the same centre of ``SIZE_CHANGE`` the stroke."""
    lines = [SettledLine.about(size, centre, turn, period_s) for size in (SIZE_CHANGE * stroke, stroke)]
    return transient_between(operator, lines[0], lines[1], factor)


def transient_between(operator: Operator, before: SettledLine, now: SettledLine, factor: float) -> Transient:
    """Return the transient from one settled line to another that reaches further, either way, from lower turn on.

    ``factor`` is that of ``Operator.loop`` at the new line: the motion is as sensitive as there.
    """
    last, settled = (_loop(operator, line.low, line.high) for line in (before, now))
    # Positions are counted from the upper turn of the line before.
    u = now.low + (now.high - now.low) * (np.arange(_POINTS) / (_POINTS - 1))
    along, memory = settled.position(u, True), np.zeros(_POINTS)
    if now.high > before.high:
        highest = max([now.high, *(line.centre + 0.5 * line.stroke for line in operator.lines)])
        virgin = _loop(operator, 0.0, highest)
        further = virgin.extent_nm * (virgin.position(u, True) - virgin.position(np.array([before.high]), True))
        low = float(further[-1]) - settled.extent_nm
        # Up to the turn of the line before the first sweep is a branch from the lower one of both lower turns.
        back = last if before.low <= now.low else settled
        until = back.extent_nm * (back.position(u, True) - back.position(np.array([before.high]), True))
        memory = np.where(u < before.high, until, further) - (low + settled.extent_nm * along)
    else:  # the lower turn of the first period erases the memory before it
        low = -_loop(operator, now.low, before.high).extent_nm
    scale = _at_rest(operator, 0.5 * (now.low + now.high)) / factor
    sweep_s = now.turn * now.period_s
    mean = scale * float(tree_sum(0.5 * np.diff(along) * (memory[1:] + memory[:-1])))  # of the first sweep, in time
    late = []
    for share, tau_s in operator.creep.terms():
        step = low + settled.extent_nm * _late_state(now, tau_s) + last.extent_nm * (1.0 - _late_state(before, tau_s))
        decay = exp(-sweep_s / tau_s)
        nm = scale * share * step
        late.append(CreepTerm(nm, decay * nm - (1.0 - decay) * share * mean, tau_s))
    measured_s = max((1.0 / line.rate_hz for line in operator.lines), default=0.0)
    whole = scale * (low + 0.5 * (settled.extent_nm + last.extent_nm))
    bias = _bias_terms(operator, 0.5 * (now.low + now.high - before.low - before.high), whole, sweep_s)
    return Transient(tuple(late), measured_s, sweep_s * along, scale * memory, bias)


def _bias_terms(operator: Operator, step: float, whole_nm: float, sweep_s: float) -> tuple[CreepTerm, ...]:
    """Return what the memory of the bias lacks of a step of the offset, which moves the mean by ``whole_nm``."""
    share, time_s = (0.0, 0.0) if operator.bias_memory is None else operator.bias_memory.late(step)
    if not share:
        return ()
    terms = [(share * whole_nm * part, tau_s) for part, tau_s in late_terms(operator.creep, time_s)]
    return tuple(CreepTerm(nm, exp(-sweep_s / tau_s) * nm, tau_s) for nm, tau_s in terms)


def _loop(operator: Operator, low: float, high: float) -> Loop:
    """Return the settled loop, as sensitive as the family is there; a straight line if it is not monotonic."""
    centre, stroke = 0.5 * (low + high), high - low
    try:
        return operator.loop(low, high, _at_rest(operator, centre))
    except Unphysical:
        straight = np.arange(POINTS) / (POINTS - 1)
        return Loop(low, high, straight, straight, operator.family.extent(stroke, centre))


def _at_rest(operator: Operator, centre: float) -> float:
    """Return the factor with which ``Operator.loop`` has the extents of the family, whose sensitivity is constant."""
    return operator.family.extent(SMALL_STROKE, operator.centre) / operator.family.extent(SMALL_STROKE, centre)


def _late_state(line: SettledLine, tau_s: float) -> float:
    """Return the state of a term of creep at the lower turn of a settled line: 0 is that turn, 1 the other.

    The steady state of tau s' = p - s for a triangle p: its mean where tau is long, its value where tau is short.
    """
    tau = tau_s / line.period_s
    if tau > _MANY_PERIODS:
        return 0.5
    up, down = line.turn, 1.0 - line.turn
    first, second = exp(-up / tau), exp(-down / tau)
    bend = tau * (1.0 / up + 1.0 / down)
    return bend * (1.0 - second) / (1.0 - first * second) - tau / up
