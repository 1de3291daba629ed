"""The hysteresis family of settled lines: plays whose envelopes, weights, gains and creep are fitted together.

The weights follow from the rest by non-negative least squares, smooth in the threshold; the rest, some ten numbers, by
Gauss-Newton steps of Levenberg and Marquardt on what the weights leave.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from tablegen.calibration.operator.nonnegative import nonnegative
from tablegen.calibration.operator.periodic_line import PeriodicLine
from tablegen.compensation.operator.creep import LogarithmicCreep
from tablegen.compensation.operator.field import SAME_CENTRE, distinct
from tablegen.compensation.operator.plays import Plays, plays
from tablegen.numerics.arrays import Floats

NODES = 40  # of the density of plays, linear between them
THRESHOLDS = 160
_HIGHEST = 0.495  # of v_max; above it no play moves
_SPACING = 1.5  # thresholds grow with this power of their number
DEGREE = 4  # of the reversible polynomial
_SMOOTHNESS = 3e-4  # weight of the differences of the density, against residuals that are shares of the stroke
_RIDGE = 1e-5
_STRIDE = 8  # every so many phases are fitted
_MOST_BEND = 0.6  # an envelope still rises everywhere
_MOST_GAIN = 0.5  # by which the gain at another centre may differ from 1
_MOST_LOSS = 0.06  # of creep, per decade
_STEPS = (0.02, 0.02, 0.02, 0.02, 0.002)  # for the derivatives by the bends and by the creep
_GAIN_STEP = 1e-3
_TRIALS = 4  # of a step, each shorter
_CONVERGED = 1e-3  # of the cost
_FIRST_ROUNDS = 4
# Bends and creep to begin from: where both envelopes are the same, none of them can tell which way to part.
STARTS = tuple(
    np.array([*bends, 0.02])
    for bends in ((-0.1, 0.0, 0.1, 0.0), (-0.3, 0.0, -0.1, 0.0), (0.1, 0.0, 0.3, 0.0), (0.0, -0.2, 0.0, 0.2))
)

CreepOf = Callable[[float], LogarithmicCreep]


@dataclass(frozen=True, eq=False)
class FamilyFit:
    """The plays, and what they rest on: four bends, the creep's loss per decade, and the gain of every other centre."""

    plays: Plays
    numbers: Floats

    @property
    def loss_per_decade(self) -> float:
        """Of creep."""
        return float(self.numbers[4])


def groups_of(centres: Sequence[float]) -> list[int]:
    """Which lines share their centre: a number each, from 0 in the order of their first."""
    known = distinct(centres)
    return [next(i for i, one in enumerate(known) if abs(one - centre) < SAME_CENTRE) for centre in centres]


def fit_family(
    lines: Sequence[PeriodicLine], main: float, creep: CreepOf, start: Sequence[Floats], rounds: int
) -> FamilyFit:
    """Plays that describe all lines, each with the gain of its centre; that of the centre ``main`` is 1.

    ``lines`` still have their creep. ``start`` are numbers to begin from, the best of which goes on; gains that they
    lack are 1.
    """
    problem = _Problem(lines, main, creep)
    found = [problem.settled(problem.left(problem.whole(one)), _FIRST_ROUNDS) for one in start]
    best = problem.settled(min(found, key=lambda one: one.cost), rounds)
    return FamilyFit(problem.plays(best), best.numbers)


@dataclass(frozen=True, eq=False)
class _Left:
    numbers: Floats
    weights: Floats
    residual: Floats
    cost: float


class _Problem:
    """The lines, prepared once; see ``fit_family``."""

    def __init__(self, lines: Sequence[PeriodicLine], main: float, creep: CreepOf) -> None:
        self._lines, self._creep = lines, creep
        self._thresholds = _HIGHEST * (np.arange(1, THRESHOLDS + 1) / THRESHOLDS) ** _SPACING
        self._spread = _spread(self._thresholds)
        self._scale = max(float(np.ptp(line.displacement_nm)) / line.stroke for line in lines)
        groups = groups_of([line.centre for line in lines])
        nearest = groups[int(np.argmin([abs(line.centre - main) for line in lines]))]
        others = sorted(set(groups) - {nearest})
        self._gain_of = [None if group == nearest else 5 + others.index(group) for group in groups]
        self._count = 5 + len(others)
        self._penalty = _penalty()
        powers = [np.stack([line.drive[::_STRIDE] ** n for n in range(1, DEGREE + 1)]) for line in lines]
        self._powers = [(part - part.mean(axis=1, keepdims=True)).T for part in powers]

    def whole(self, numbers: Floats) -> Floats:
        """With gains of 1 where there are none."""
        return np.append(numbers, np.ones(self._count))[: self._count] if len(numbers) < self._count else numbers

    def limited(self, numbers: Floats) -> Floats:
        """Inside what the numbers may be."""
        low = [*[-_MOST_BEND] * 4, 0.0, *[1.0 - _MOST_GAIN] * (self._count - 5)]
        high = [*[_MOST_BEND] * 4, _MOST_LOSS, *[1.0 + _MOST_GAIN] * (self._count - 5)]
        return np.clip(numbers, low, high)

    def left(self, numbers: Floats) -> "_Left":
        """What the best weights leave."""
        late = self._creep(float(numbers[4]))
        columns, values = [], []
        for line, powers, at in zip(self._lines, self._powers, self._gain_of, strict=True):
            gain = 1.0 if at is None else float(numbers[at])
            u, rising = line.drive[::_STRIDE], line.rising[::_STRIDE]
            both = [
                plays(u, line.low, line.high, going, self._thresholds, numbers[None, :4])[0] for going in (True, False)
            ]
            moved = np.where(rising, *both)
            dense = (self._spread @ moved).T
            part = np.hstack([dense - dense.mean(axis=0), powers, -powers])
            columns.append(gain / (line.stroke * np.sqrt(len(u))) * part)
            y = line.without(None, late).displacement_nm[::_STRIDE]
            values.append((y - y.mean()) / (line.stroke * self._scale * np.sqrt(len(u))))
        matrix, right = np.vstack(columns), np.concatenate(values)
        weights = nonnegative(matrix.T @ matrix + self._penalty.T @ self._penalty, matrix.T @ right)
        residual = np.concatenate([matrix @ weights - right, self._penalty @ weights])
        return _Left(numbers, weights, residual, float(residual @ residual))

    def settled(self, best: "_Left", rounds: int) -> "_Left":
        """So many steps on, or fewer where they no longer help."""
        damping = 1e-3
        for _ in range(rounds):
            jacobian, before = self.jacobian(best), best.cost
            normal, slope = jacobian.T @ jacobian, jacobian.T @ best.residual
            for _ in range(_TRIALS):
                by = np.linalg.solve(normal + damping * np.diag(np.diag(normal) + 1e-12), slope)
                trial = self.left(self.limited(best.numbers - by))
                if trial.cost < best.cost:
                    best, damping = trial, damping * 0.2
                    break
                damping *= 8.0
            if before - best.cost < _CONVERGED * before:
                break
        return best

    def jacobian(self, at: _Left) -> Floats:
        """Of the residual by the numbers, with the weights that move along."""
        rows = []
        steps = [*_STEPS, *[_GAIN_STEP] * (self._count - 5)]
        for i, step in enumerate(steps):
            moved = at.numbers.copy()
            moved[i] += step
            low = self.left(moved)
            rows.append((low.residual - at.residual) / step)
        return np.stack(rows, axis=1)

    def plays(self, found: _Left) -> Plays:
        """In nm."""
        weights = found.weights * self._scale
        reversible = weights[NODES : NODES + DEGREE] - weights[NODES + DEGREE :]
        dense = weights[:NODES] @ self._spread
        return Plays(self._thresholds, dense[None, :], reversible, found.numbers[None, :4].copy())


def _spread(thresholds: Floats) -> Floats:
    """Weights of all thresholds for a density of 1 at one node and linear to its neighbours, a row a node."""
    at = np.linspace(0.0, NODES - 1.0, len(thresholds))
    hats = np.maximum(0.0, 1.0 - np.abs(at[None, :] - np.arange(NODES)[:, None]))
    spread: Floats = hats * np.gradient(thresholds) * len(thresholds)
    return spread / NODES


def _penalty() -> Floats:
    """Differences of the density of neighbouring nodes, and a ridge."""
    size = NODES + 2 * DEGREE
    rows = np.zeros((NODES - 1, size))
    for i in range(NODES - 1):
        rows[i, i : i + 2] = (1.0, -1.0)
    return np.vstack([_SMOOTHNESS * rows, _RIDGE * np.eye(size)])
