"""The weights of the plays, from settled lines: non-negative least squares, smooth in the threshold."""

from collections.abc import Sequence

import numpy as np

from tablegen.calibration.operator.nonnegative import nonnegative
from tablegen.calibration.operator.periodic_line import PeriodicLine
from tablegen.compensation.operator.field import SAME_CENTRE, distinct
from tablegen.compensation.operator.plays import TRANSFORMS, Plays, plays
from tablegen.numerics.arrays import Floats

THRESHOLDS = 40
_LOWEST, _HIGHEST = 0.006, 0.485  # of v_max; above the highest no play moves
DEGREE = 4  # of the reversible polynomial
_SMOOTHNESS = 1e-3  # weight of the roughness of the density of plays, against residuals that are shares of the stroke
_RIDGE = 1e-5
_STRIDE = 4  # every so many phases are fitted
_ROUNDS = 4
_MOST_GAIN = 0.5  # by which the gain at another centre may differ from 1


def groups_of(centres: Sequence[float]) -> list[int]:
    """Which lines share their centre: a number each, from 0 in the order of their first."""
    known = distinct(centres)
    return [next(i for i, one in enumerate(known) if abs(one - centre) < SAME_CENTRE) for centre in centres]


def fit_plays(lines: Sequence[PeriodicLine], main: float) -> Plays:
    """Plays that describe all lines, each with the gain of its centre; that of the centre ``main`` is 1."""
    thresholds = np.geomspace(_LOWEST, _HIGHEST, THRESHOLDS)
    scale = max(float(np.ptp(line.displacement_nm)) / line.stroke for line in lines)
    columns, values = [], []
    for line in lines:
        columns.append(_columns(line, thresholds) / line.stroke)
        y = line.displacement_nm[::_STRIDE]
        values.append((y - np.mean(y)) / (line.stroke * scale))
    normals = [part.T @ part / len(part) for part in columns]
    rights = [part.T @ y / len(y) for part, y in zip(columns, values, strict=True)]
    penalty = _penalty(thresholds)
    groups = groups_of([line.centre for line in lines])
    nearest = groups[int(np.argmin([abs(line.centre - main) for line in lines]))]
    count = max(groups) + 1

    def solved(gains: Floats) -> tuple[Floats, Floats]:
        """The weights with these gains, and the gains that then fit best."""
        of_line = [float(gains[group]) for group in groups]
        normal = sum((g * g * part for g, part in zip(of_line, normals, strict=True)), penalty)
        right = sum(g * part for g, part in zip(of_line, rights, strict=True))
        weights = nonnegative(normal, np.asarray(right))
        better = np.ones(count)
        for group in range(count):
            mine = [i for i, other in enumerate(groups) if other == group]
            power = sum(float(weights @ normals[i] @ weights) for i in mine)
            better[group] = sum(float(weights @ rights[i]) for i in mine) / power
        return weights, better / better[nearest]

    gains = np.ones(count)
    for _ in range(_ROUNDS if count > 1 else 0):  # Steffensen's: rounds by themselves creep towards the gains
        once = solved(gains)[1]
        twice = solved(once)[1]
        bend = twice - 2.0 * once + gains
        ahead = np.where(np.abs(bend) > 1e-9, gains - (once - gains) ** 2 / np.where(bend == 0.0, 1.0, bend), twice)
        gains = np.where(np.abs(ahead - 1.0) < _MOST_GAIN, ahead, twice)
    weights = solved(gains)[0]
    weights = weights * scale
    split = len(TRANSFORMS) * THRESHOLDS
    reversible = weights[split : split + DEGREE] - weights[split + DEGREE :]
    return Plays(thresholds, weights[:split].reshape(len(TRANSFORMS), THRESHOLDS), reversible)


def _columns(line: PeriodicLine, thresholds: Floats) -> Floats:
    """Every play, and the powers of the drive with either sign, a column each, about their means."""
    u, rising = line.drive[::_STRIDE], line.rising[::_STRIDE]
    low, high = line.low, line.high
    both = [plays(u, low, high, going, thresholds).reshape(-1, len(u)) for going in (True, False)]
    powers = np.stack([u**n for n in range(1, DEGREE + 1)])
    all_columns: Floats = np.concatenate([np.where(rising, *both), powers, -powers]).T
    centred: Floats = all_columns - np.mean(all_columns, axis=0)
    return centred


def _penalty(thresholds: Floats) -> Floats:
    """Differences of the density of neighbouring thresholds; the last one ends in 0."""
    k = len(thresholds)
    width = np.gradient(thresholds)
    size = len(TRANSFORMS) * k + 2 * DEGREE
    rows = np.zeros((len(TRANSFORMS) * k, size))
    for transform in range(len(TRANSFORMS)):
        for i in range(k):
            at = transform * k + i
            rows[at, at] = np.mean(width) / width[i]
            if i + 1 < k:
                rows[at, at + 1] = -np.mean(width) / width[i + 1]
    return _SMOOTHNESS**2 * (rows.T @ rows) + _RIDGE**2 * np.eye(size)
