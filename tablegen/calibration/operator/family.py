"""Fit a hysteresis family to settled lines: its shape, its weights, the gains of offsets and creep together.

The weights follow from the rest by non-negative least squares; the rest, some ten numbers, by steps of Levenberg and
Marquardt on the residual of the weights.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar

import numpy as np
from scipy.optimize import nnls

from tablegen.calibration.operator.periodic_line import PeriodicLine
from tablegen.compensation.operator.creep import LogarithmicCreep
from tablegen.compensation.operator.family import Family
from tablegen.compensation.operator.field import SAME_CENTRE, distinct
from tablegen.numerics.arrays import Floats

DEGREE = 4  # of the reversible polynomial
STRIDE = 8  # of the phases that are fitted
_MOST_GAIN = 0.5  # largest difference from 1 of the gain at another centre
_MOST_LOSS = 0.06  # of creep, per decade
_LOSS_STEP = 0.002  # for derivatives
_GAIN_STEP = 1e-3
_TRIALS = 4  # of a step, each with more damping
_CONVERGED = 1e-3  # of the cost
_FIRST_ROUNDS = 4
_ITERATIONS = 30  # of the weights, for each of them: ten times what scipy allows

CreepOf = Callable[[float], LogarithmicCreep]


@dataclass(frozen=True, eq=False)
class FamilyFit:
    """The family, and its basis: its own numbers with creep's loss per decade, the centres beside the main one, gains.

    ``numbers`` has shape (numbers,), ``gains`` shape (centres,).
    """

    family: Family
    numbers: Floats
    centres: Floats
    gains: Floats

    @property
    def loss_per_decade(self) -> float:
        """Creep's loss per decade."""
        return float(self.numbers[-1])


def groups_of(centres: Sequence[float]) -> list[int]:
    """Return a number for each line: equal for lines of one centre, from 0 in the order of their first."""
    unique = distinct(centres)
    return [next(i for i, one in enumerate(unique) if abs(one - centre) < SAME_CENTRE) for centre in centres]


@dataclass(frozen=True, eq=False)
class _WeightsFit:
    numbers: Floats
    weights: Floats
    residual: Floats
    cost: float


class FamilyProblem(ABC):
    """The lines of a fit. ``shape_limits`` and ``shape_steps`` are those of the family's own numbers.

    A number whose step is 0 stays as it is. ``starts`` are shapes and creep to begin from; ``penalty`` are the rows of
    a quadratic penalty on the weights.
    """

    shape_limits: ClassVar[tuple[tuple[float, float], ...]]
    shape_steps: tuple[float, ...]
    starts: ClassVar[tuple[Floats, ...]]
    penalty: Floats

    def __init__(self, lines: Sequence[PeriodicLine], main: float, creep: CreepOf) -> None:
        """``lines`` still have their creep; the gain of the centre ``main`` is 1."""
        self.lines = lines
        self.drives = [line.drive[::STRIDE] for line in lines]
        self.scale = max(float(np.ptp(line.displacement_nm)) / line.stroke for line in lines)  # nm for all of v_max
        self._shapes = len(self.shape_limits)
        groups = groups_of([line.centre for line in lines])
        nearest = groups[int(np.argmin([abs(line.centre - main) for line in lines]))]
        others = sorted(set(groups) - {nearest})
        first = self._shapes + 1
        self._gain_of = [None if group == nearest else first + others.index(group) for group in groups]
        self._gains = len(others)
        self._centres = np.array([lines[groups.index(group)].centre for group in others])
        self._share = [1.0 / (line.stroke * np.sqrt(len(u))) for line, u in zip(lines, self.drives, strict=True)]
        powers = [np.stack([u**n for n in range(1, DEGREE + 1)]) for u in self.drives]
        self._powers = [(part - part.mean(axis=1, keepdims=True)).T for part in powers]
        self._displacements = lru_cache(maxsize=4)(self._columns)
        self._measured = lru_cache(maxsize=4)(lambda loss: self._values(creep(loss)))

    @abstractmethod
    def unit_displacements(self, shape: Floats) -> list[Floats]:
        """Return the displacement of each line for weights of 1.

        Parameters
        ----------
        shape
            The family's own numbers, shape (numbers,).

        Returns
        -------
        list of Floats
            For each line, shape (phases, weights).
        """

    @abstractmethod
    def family(self, shape: Floats, weights: Floats, reversible: Floats) -> Family:
        """Return the family of these weights.

        Parameters
        ----------
        shape
            The family's own numbers, shape (numbers,).
        weights
            Weights of the columns of ``unit_displacements``, in nm, shape (weights,).
        reversible
            Coefficients of u, u^2, ... in nm, shape (DEGREE,).
        """

    def fit(self, near: FamilyFit | None, rounds: int) -> FamilyFit:
        """Fit from the best of the starts, or from a fit that is near.

        Parameters
        ----------
        near
            A fit of these lines and others; the starts by default.
        rounds
            Largest number of steps.
        """
        if near is None:
            ones = np.ones(self._gains)
            solutions = [self.improve(self.best_weights(np.append(one, ones)), _FIRST_ROUNDS) for one in self.starts]
            best = self.improve(min(solutions, key=lambda one: one.cost), rounds)
        else:
            nearest = [int(np.argmin(np.abs(near.centres - centre))) for centre in self._centres]
            best = self.improve(self.best_weights(np.append(near.numbers, near.gains[nearest])), rounds)
        weights, shape = best.weights * self.scale, best.numbers[: self._shapes]
        count = len(weights) - 2 * DEGREE
        reversible = weights[count : count + DEGREE] - weights[count + DEGREE :]
        own, gains = np.split(best.numbers, [self._shapes + 1])
        return FamilyFit(self.family(shape, weights[:count], reversible), own, self._centres, gains)

    def best_weights(self, numbers: Floats) -> _WeightsFit:
        """Fit the weights for these numbers.

        Parameters
        ----------
        numbers
            Own numbers, creep's loss per decade and gains, shape (numbers,).
        """
        parts, measured = (
            self._displacements(tuple(numbers[: self._shapes].tolist())),
            self._measured(float(numbers[self._shapes])),
        )
        gains = [1.0 if at is None else float(numbers[at]) for at in self._gain_of]
        matrix = np.vstack([gain * part for gain, part in zip(gains, parts, strict=True)])
        rows = np.vstack([matrix, self.penalty])
        right = np.concatenate([measured, np.zeros(len(self.penalty))])
        weights, _ = nnls(rows, right, maxiter=_ITERATIONS * len(rows.T))
        residual = rows @ weights - right
        return _WeightsFit(numbers, weights, residual, float(residual @ residual))

    def improve(self, best: _WeightsFit, rounds: int) -> _WeightsFit:
        """Improve the fit by steps of Levenberg and Marquardt; stop early where they no longer help."""
        damping = 1e-3
        for _ in range(rounds):
            jacobian, before = self.jacobian(best), best.cost
            normal, slope = jacobian.T @ jacobian, jacobian.T @ best.residual
            for _ in range(_TRIALS):
                by = np.linalg.solve(normal + damping * np.diag(np.diag(normal) + 1e-12), slope)
                trial = self.best_weights(self._limited(best.numbers - by))
                if trial.cost < best.cost:
                    best, damping = trial, damping * 0.2
                    break
                damping *= 8.0
            if before - best.cost < _CONVERGED * before:
                break
        return best

    def jacobian(self, at: _WeightsFit) -> Floats:
        """Return the derivatives of the residual by the numbers, with the weights that follow them.

        Returns
        -------
        Floats
            Shape (residuals, numbers).
        """
        rows = []
        for i, step in enumerate([*self.shape_steps, _LOSS_STEP, *[_GAIN_STEP] * self._gains]):
            numbers = at.numbers.copy()
            numbers[i] += step
            rows.append((self.best_weights(numbers).residual - at.residual) / step if step else 0.0 * at.residual)
        return np.stack(rows, axis=1)

    def _limited(self, numbers: Floats) -> Floats:
        """Clip the numbers to their limits."""
        gain = (1.0 - _MOST_GAIN, 1.0 + _MOST_GAIN)
        low, high = zip(*self.shape_limits, (0.0, _MOST_LOSS), *[gain] * self._gains, strict=True)
        return np.clip(numbers, low, high)

    def _columns(self, shape: tuple[float, ...]) -> list[Floats]:
        """Return the columns of all weights for each line: the family's, and those of the polynomial, up and down."""
        displacements = self.unit_displacements(np.array(shape))
        return [
            share * np.hstack([part - part.mean(axis=0), powers, -powers])
            for share, part, powers in zip(self._share, displacements, self._powers, strict=True)
        ]

    def _values(self, creep: LogarithmicCreep) -> Floats:
        """Return the measured values without their creep."""
        parts = [line.without(None, creep).displacement_nm[::STRIDE] for line in self.lines]
        return np.concatenate(
            [share / self.scale * (y - y.mean()) for share, y in zip(self._share, parts, strict=True)]
        )
