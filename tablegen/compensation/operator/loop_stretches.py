"""Positions on stretches of many settled loops at once, with every bit of those on the whole loops.

A frame in time runs along some hundred loops, and of most of them along one branch with few samples. So only the
points of a branch beside these samples are computed, of several loops together. That no branch stands still is known
of such a loop without its other points: plays and their envelopes never run backwards, and the slope of the polynomial
and of the residual has a bound. A loop whose bound does not say so is made whole.
"""

from collections.abc import Sequence

import numpy as np
from msgspec import Struct

from tablegen.compensation.operator.family import Family
from tablegen.compensation.operator.loop import POINTS
from tablegen.compensation.operator.operator import GRID, LEAST_SLOPE, Operator, chebyshev
from tablegen.numerics.arrays import Bools, Floats

_BLOCK = 1 << 15  # drives that are computed at a time, so that they fit the cache
_ROUNDING = 1e-6  # of a slope, for what rounding may take from it: far more than it does
_PLACES = np.arange(9) / 8  # between the ends of a loop, at which the slope of the polynomial is taken


class LoopStretch(Struct, frozen=True, eq=False):
    """Drives on one branch of the settled loop between ``low`` and ``high``, shape (n,), n >= 1."""

    low: float
    high: float
    rising: bool
    u: Floats


def positions_on(operator: Operator, stretches: Sequence[LoopStretch]) -> list[Floats]:
    """Return the positions on each stretch, 0..1 between the ends of its loop, each of the shape of its drives.

    Raises
    ------
    Unphysical
        If a branch of a loop would stand still or run backwards.
    """
    positions: list[Floats | None] = [None] * len(stretches)
    order = sorted(range(len(stretches)), key=lambda at: (stretches[at].rising, len(stretches[at].u)))
    while order:
        some = [order[0]]
        for at in order[1:]:
            width = 2 * len(stretches[at].u) + 2
            if stretches[at].rising != stretches[some[0]].rising or width * (len(some) + 1) > _BLOCK:
                break
            some.append(at)
        order = order[len(some) :]
        of_some, steep = _positions(operator, [stretches[at] for at in some])
        for at, row, known in zip(some, of_some, steep.tolist(), strict=True):
            positions[at] = row[: len(stretches[at].u)] if known else None
    return [
        operator.shape(one.low, one.high).position(one.u, one.rising) if position is None else position
        for one, position in zip(stretches, positions, strict=True)
    ]


def _positions(operator: Operator, stretches: Sequence[LoopStretch]) -> tuple[Floats, Bools]:
    """Return rows of positions on branches of one direction, and which of them are known to rise everywhere."""
    rising, count = stretches[0].rising, max(len(one.u) for one in stretches)
    low, high = np.array([one.low for one in stretches]), np.array([one.high for one in stretches])
    u = np.empty((len(stretches), count))
    for row, one in zip(u, stretches, strict=True):
        row[: len(one.u)], row[len(one.u) :] = one.u, one.u[-1]
    v = (u - low[:, None]) * ((POINTS - 1) / (high - low))[:, None]
    left = np.clip(v, 0.0, POINTS - 2).astype(np.int64)
    ends = np.broadcast_to([0, POINTS - 1], (len(u), 2))
    index = np.concatenate([left, left + 1, ends], axis=1)
    drives = low[:, None] + (high - low)[:, None] * GRID[index]
    here = operator.family.branch_of_loops(drives, low, high, rising)
    other = operator.family.branch_of_loops(drives[:, -2:], low, high, not rising)
    first, last = (here if rising else other)[:, -2, None], (here if rising else other)[:, -1, None]
    extent = last - first
    here, other = (here - first) / extent, (other - first) / extent
    rows = operator.residual.at_many(high - low, 0.5 * (low + high))
    half = rows.shape[1] // 2
    mine, others = (rows[:, :half], rows[:, half:]) if rising else (rows[:, half:], rows[:, :half])
    if np.any(rows):
        here = here + chebyshev(mine.T[:, :, None], 2.0 * GRID[index] - 1.0)
        other = other + chebyshev(others.T[:, :, None], 2.0 * GRID[ends] - 1.0)
    bottom, top = 0.5 * (here[:, -2] + other[:, 0]), 0.5 * (here[:, -1] + other[:, 1])
    here = (here - bottom[:, None]) / (top - bottom)[:, None]
    values, after = here[:, :count], here[:, count : 2 * count]
    slope = _least_slope(operator.family, low, high) * (high - low) / extent[:, 0]
    n = np.arange(half)
    slope = (slope - 2.0 * np.max(np.abs(rows).reshape(-1, 2, half) @ (n * n), axis=1)) / (top - bottom)
    steep = (slope > LEAST_SLOPE + _ROUNDING) & (extent[:, 0] > 0.0) & (top > bottom)
    return values + (v - left) * (after - values), np.asarray(steep)


def _least_slope(family: Family, low: Floats, high: Floats) -> Floats:
    """Return a lower bound of the slope of both branches of loops, in units of the displacement, shape of ``low``.

    It is that of the polynomial, where nothing else runs backwards; else it is 0.
    """
    plays, linear, cubic = family.plays, family.plays.bends[:, [0, 2]], family.plays.bends[:, [1, 3]]
    never_back = bool(np.all(plays.weights >= 0.0)) and bool(np.all(np.abs(linear) + 0.5 * np.abs(cubic) <= 1.0))
    if family.bouc_wen is not None or not never_back:
        return np.zeros_like(low)
    u = low[:, None] + (high - low)[:, None] * _PLACES
    slope, bend = np.zeros_like(u), np.zeros_like(low)
    for power, coefficient in enumerate(plays.reversible.tolist()):
        slope += (power + 1) * coefficient * u**power
        bend += (power + 1) * power * abs(coefficient)  # drives are 0..1
    least = np.min(slope, axis=1) - 0.5 * (high - low) * _PLACES[1] * bend
    return np.asarray(np.where((low >= 0.0) & (high <= 1.0), least, 0.0))
