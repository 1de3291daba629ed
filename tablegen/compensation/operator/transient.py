"""What an axis does after a change of offset or size: the plays keep their memory for a period, creep for long.

The plays forget all that the new line's turns pass within its first period. The mean position then has moved by a
step, of which creep brings its share late: s a exp(-t / tau) / |C| is still to come of every term, after a step s.
"""

import numpy as np

from tablegen.compensation.operator.operator import Operator
from tablegen.compensation.operator.plays import Plays, envelopes
from tablegen.compensation.transient import OFFSET_CHANGE, SIZE_CHANGE, Transient
from tablegen.numerics.arrays import Floats, tree_sum

_POINTS = 257  # of a sweep


def after_offset(operator: Operator, stroke: float, centre: float, factor: float, turn: float) -> Transient:
    """After a line whose centre was ``OFFSET_CHANGE`` nearer to the middle of v_max, or beyond it."""
    before = centre - OFFSET_CHANGE if centre >= 0.5 else centre + OFFSET_CHANGE
    return _after(operator, (min(stroke, 2.0 * before, 2.0 - 2.0 * before), before), (stroke, centre), factor, turn)


def after_size(operator: Operator, stroke: float, centre: float, factor: float, turn: float) -> Transient:
    """After a line at the same centre of ``SIZE_CHANGE`` the stroke."""
    return _after(operator, (SIZE_CHANGE * stroke, centre), (stroke, centre), factor, turn)


def _after(
    operator: Operator, before: tuple[float, float], now: tuple[float, float], factor: float, turn: float
) -> Transient:
    """From one settled line to another, (stroke, centre) each of v_max; sizes are those of the other."""
    plays, loop = operator.family.plays, operator.family.bouc_wen
    memory = np.zeros(plays.weights.shape)
    for _ in range(2):
        rising, falling, memory = _period(plays, memory, *before)
    if loop is not None:
        u, low, high = _sweep(*before)
        rising, falling = (rising + loop.branch(u, low, high, True), falling + loop.branch(u, low, high, False))
    earlier = _mean(rising, falling, turn)
    first, _, memory = _period(plays, memory, *now)
    rising, falling, memory = _period(plays, memory, *now)
    if loop is not None:
        ends, (u, low, high) = (_sweep(*before)[1:]), _sweep(*now)
        first = first + loop.first_branch(u, low, ends)
        rising, falling = (rising + loop.branch(u, low, high, True), falling + loop.branch(u, low, high, False))
    # An offset moves the piezo as far as the largest line does, which is more than a small one where plays are missing.
    largest = max(((line.stroke, line.centre) for line in operator.lines), default=now)
    extent = operator.expected_extent(*largest, factor) * (1.0 + float(operator.size.at(*largest)[0]))
    scale = extent / operator.family.extent(*largest)
    step = scale * (_mean(rising, falling, turn) - earlier)
    return Transient(
        tuple((step * share, tau_s) for share, tau_s in operator.creep.terms()),
        scale * float(np.max(np.abs(first - rising))),
    )


def _sweep(stroke: float, centre: float) -> tuple[Floats, float, float]:
    """Even drives of a line, its lowest and its highest."""
    low, high = centre - 0.5 * stroke, centre + 0.5 * stroke
    return low + (high - low) * (np.arange(_POINTS) / (_POINTS - 1)), low, high


def _period(family: Plays, memory: Floats, stroke: float, centre: float) -> tuple[Floats, Floats, Floats]:
    """A line from its lower turn on: positions rising and falling, at even drives from its low; and the plays then."""
    u, _, _ = _sweep(stroke, centre)
    r = family.thresholds[None, :, None]
    both = np.stack([envelopes(u, bend) for bend in family.bends])
    below, above = both[:, :1, :] - r, both[:, 1:, :] + r
    begin = np.minimum(np.maximum(memory[:, :, None], below[:, :, :1]), above[:, :, :1])
    rising = np.maximum(begin, below)
    falling = np.minimum(rising[:, :, -1:], above)
    along, power = np.zeros_like(u), np.ones_like(u)
    for coefficient in family.reversible:
        power = power * u
        along = along + float(coefficient) * power
    up, down = (
        along + tree_sum((family.weights[:, :, None] * part).transpose(2, 0, 1).reshape(_POINTS, -1))
        if family.thresholds.size
        else along
        for part in (rising, falling)
    )
    return up, down, falling[:, :, 0]


def _mean(rising: Floats, falling: Floats, turn: float) -> float:
    up, down = (float(tree_sum(values)) / _POINTS for values in (rising, falling))
    return turn * up + (1.0 - turn) * down
