"""Fit Bouc and Wen's equation to settled lines: its exponent, coefficients and depth."""

from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from tablegen.calibration.operator.family import DEGREE, STRIDE, CreepOf, FamilyProblem
from tablegen.calibration.operator.periodic_line import PeriodicLine
from tablegen.compensation.operator.bouc_wen import BoucWen
from tablegen.compensation.operator.family import Family
from tablegen.compensation.operator.plays import NO_PLAYS
from tablegen.numerics.arrays import Floats

_RIDGE = 1e-5


class BoucWenProblem(FamilyProblem):
    """Fit of n, beta, gamma, the asymmetry and both bends; its one weight is the depth."""

    shape_limits = ((1.0, 3.0), (0.05, 40.0), (-30.0, 30.0), (-0.9, 0.9), (-0.6, 0.6), (-0.6, 0.6))
    shape_steps = (0.02, 0.05, 0.05, 0.02, 0.01, 0.01)
    starts: ClassVar[tuple[Floats, ...]] = tuple(
        np.array([n, beta, gamma, 0.0, 0.0, 0.0, 0.02]) for n, beta, gamma in ((1.2, 4.0, -1.0), (1.2, 1.5, 0.0))
    )

    def __init__(self, lines: Sequence[PeriodicLine], main: float, creep: CreepOf) -> None:
        super().__init__(lines, main, creep)
        self.penalty = _RIDGE * np.eye(1 + 2 * DEGREE)

    def unit_displacements(self, shape: Floats) -> list[Floats]:
        """Return the displacement for a depth of 1.

        Parameters
        ----------
        shape
            n, beta, gamma, asymmetry and both bends, shape (6,).

        Returns
        -------
        list of Floats
            For each line, shape (phases, 1).
        """
        model, out = _model(1.0, shape), []
        for line, u in zip(self.lines, self.drives, strict=True):
            rising, falling = (model.branch(u, line.low, line.high, going) for going in (True, False))
            out.append(np.where(line.rising[::STRIDE], rising, falling)[:, None])
        return out

    def family(self, shape: Floats, weights: Floats, reversible: Floats) -> Family:
        """Return the family, without plays.

        Parameters
        ----------
        shape
            n, beta, gamma, asymmetry and both bends, shape (6,).
        weights
            Depth in nm, shape (1,).
        reversible
            Coefficients of u, u^2, ... in nm, shape (DEGREE,).
        """
        bare = Family(NO_PLAYS, _model(float(weights[0]), shape))
        return bare.over(reversible)


def _model(depth: float, shape: Floats) -> BoucWen:
    n, beta, gamma, asymmetry, linear, cubic = shape.tolist()
    return BoucWen(depth, n, beta, gamma, asymmetry, (linear, cubic))
