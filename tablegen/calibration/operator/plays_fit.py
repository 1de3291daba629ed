"""Fit plays to settled lines: their envelopes and weights, which are smooth in the threshold."""

from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from tablegen.calibration.operator.family import DEGREE, STRIDE, CreepOf, FamilyFit, FamilyProblem
from tablegen.calibration.operator.periodic_line import PeriodicLine
from tablegen.compensation.operator.creep import SEVERAL_RATES
from tablegen.compensation.operator.family import Family
from tablegen.compensation.operator.plays import BENDS, Plays, plays, stretch
from tablegen.numerics.arrays import Floats

NODES = 40  # of the density of plays, linear between them
THRESHOLDS = 160
_HIGHEST = 0.495  # of v_max; above it no play moves
_SPACING = 1.5  # thresholds grow with this power of their number
# The density is a trend and scatter about it. Weights of the differences of the trend and of the scatter, against
# residuals that are shares of the stroke, are in proportion to the relative noise of a line, as in a Bayesian
# prior. Their floor is the model error of the plays.
_TREND, _SCATTER = 1.25, 0.35
_LEAST_NOISE, _MOST_NOISE, _UNKNOWN_NOISE = 8e-5, 1.2e-2, 4e-4  # unknown where no line has two periods
_RIDGE = 1e-5
_MOST_GROWTH = 0.3  # of thresholds, per decade of the rate: a factor of 2
_BENDS_ALONE, _WITH_GROWTH = (0.02, 0.02, 0.02, 0.02, 0.0), (0.02, 0.02, 0.02, 0.02, 0.01)
_WORTH_GROWTH = 0.5  # of the cost without it
_MOST_BEND = 0.6  # an envelope still rises everywhere


class PlaysProblem(FamilyProblem):
    """Fit of the four bends of the envelopes, of the density of plays, and of the growth of thresholds a decade."""

    shape_limits = (*((-_MOST_BEND, _MOST_BEND),) * 4, (-_MOST_GROWTH, _MOST_GROWTH))
    # No start has two equal envelopes: its derivatives could not separate them.
    starts: ClassVar[tuple[Floats, ...]] = tuple(
        np.array([*bends, 0.0, 0.02])
        for bends in ((-0.1, 0.0, 0.1, 0.0), (-0.3, 0.0, -0.1, 0.0), (0.1, 0.0, 0.3, 0.0), (0.0, -0.2, 0.0, 0.2))
    )

    def __init__(self, lines: Sequence[PeriodicLine], main: float, creep: CreepOf) -> None:
        super().__init__(lines, main, creep)
        reference_hz = creep(0.0).reference_hz
        self._decades = [float(np.log10(line.rate_hz / reference_hz)) for line in lines]
        self._several = max(self._decades) - min(self._decades) >= np.log10(SEVERAL_RATES)
        self.shape_steps = _BENDS_ALONE
        self._thresholds = _HIGHEST * (np.arange(1, THRESHOLDS + 1) / THRESHOLDS) ** _SPACING
        self._spread = _spread(self._thresholds)
        self.penalty = _penalty(_noise(lines))

    def fit(self, near: FamilyFit | None, rounds: int) -> FamilyFit:
        """Fit without growth, and with it where lines of several rates ask for it: alone it would be mixed with creep.

        Parameters
        ----------
        near
            A fit of these lines and others, which has growth or none; the starts by default.
        rounds
            Largest number of steps.
        """
        if near is not None:
            self.shape_steps = _WITH_GROWTH if self._several and near.numbers[BENDS] else _BENDS_ALONE
            return super().fit(near, rounds)
        without = super().fit(None, rounds)
        if not self._several:
            return without
        self.shape_steps = _WITH_GROWTH
        growing = super().fit(without, rounds)
        costs = [self.best_weights(np.append(one.numbers, one.gains)).cost for one in (without, growing)]
        return growing if costs[1] < _WORTH_GROWTH * costs[0] else without

    def unit_displacements(self, shape: Floats) -> list[Floats]:
        """Return the displacement for plays of a density of 1 at one node.

        Parameters
        ----------
        shape
            The four bends, and the growth, shape (5,).

        Returns
        -------
        list of Floats
            For each line, shape (phases, NODES).
        """
        out = []
        bends, growth = shape[None, :BENDS], float(shape[BENDS])
        for line, u, decades in zip(self.lines, self.drives, self._decades, strict=True):
            thresholds = stretch(growth, decades) * self._thresholds
            rising, falling = (plays(u, line.low, line.high, going, thresholds, bends)[0] for going in (True, False))
            out.append((self._spread @ np.where(line.rising[::STRIDE], rising, falling)).T)
        return out

    def family(self, shape: Floats, weights: Floats, reversible: Floats) -> Family:
        """Return the family, of plays alone.

        Parameters
        ----------
        shape
            The four bends, and the growth, shape (5,).
        weights
            Density at the nodes, in nm, shape (NODES,).
        reversible
            Coefficients of u, u^2, ... in nm, shape (DEGREE,).
        """
        bends, growth = shape[None, :BENDS].copy(), float(shape[BENDS])
        return Family(Plays(self._thresholds, (weights @ self._spread)[None, :], reversible, bends, growth))


def _spread(thresholds: Floats) -> Floats:
    """Weights of all thresholds for a density of 1 at one node and linear to its neighbours, a row a node."""
    at = np.linspace(0.0, NODES - 1.0, len(thresholds))
    hats = np.maximum(0.0, 1.0 - np.abs(at[None, :] - np.arange(NODES)[:, None]))
    spread: Floats = hats * np.gradient(thresholds) * len(thresholds)
    return spread / NODES


def _noise(lines: Sequence[PeriodicLine]) -> float:
    """Return the noise of a line, as a share of it."""
    noise = [line.noise_nm / float(np.ptp(line.displacement_nm)) for line in lines if line.periods > 1]
    return float(np.clip(np.median(noise), _LEAST_NOISE, _MOST_NOISE)) if noise else _UNKNOWN_NOISE


def _penalty(noise: float) -> Floats:
    """Return the rows of the penalty on the density: those of the prior's covariance, and a ridge."""
    step = _TREND * noise * np.diff(np.eye(NODES), axis=0)
    trend = np.linalg.inv(step.T @ step + _RIDGE * _RIDGE * np.eye(NODES))
    prior = trend + np.eye(NODES) / (_SCATTER * noise) ** 2
    rows = _RIDGE * np.eye(NODES + 2 * DEGREE)
    rows[:NODES, :NODES] = np.linalg.cholesky(np.linalg.inv(prior)).T
    return rows
