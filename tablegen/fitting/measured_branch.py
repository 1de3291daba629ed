"""Measurement at one amplitude: the peak residual of each branch and its place, from a sensor or from images."""

from dataclasses import dataclass

import numpy as np

from tablegen.compensation.hysteresis import BranchShape
from tablegen.fitting.estimate import Curve, Estimate
from tablegen.numerics.arrays import Floats

BINS = 20  # intervals per branch, the baseline of the scaling error
WINDOW = slice(2, 18)  # x = 0.1 .. 0.9


@dataclass(frozen=True)
class MeasuredBranch:
    """The peak residual and its place, (17), as fractions of the scan, in sweep-aligned coordinates."""

    beta: Estimate
    u_peak: Estimate


@dataclass(frozen=True, kw_only=True)
class AmplitudeFit:
    """Fit of the measurement at one amplitude.

    ``v_scan`` is peak to peak in V, ``v_offset`` its middle, None where it is unknown. ``residual_percent`` is the
    position error that the model leaves, in percent of the scan, averaged in bins of a twentieth of the line, forward
    then backward; ``scaling_percent`` the local scaling error that it leaves, peak to peak over x = 0.1..0.9, of each
    direction. ``noise_percent`` is that of the scan for a sensor, of the contrast for an image; ``drift_percent`` of
    the scan.
    """

    turn: Estimate
    v_scan: float
    v_offset: float | None = None
    samples: int
    forward: MeasuredBranch
    backward: MeasuredBranch
    noise_percent: float
    drift_percent: float
    residual_percent: Floats
    scaling_percent: tuple[float, float]
    curves: tuple[Curve, ...]


def measured_branch(shape: Floats, covariance: Floats) -> MeasuredBranch:
    """Return the peak of a branch with its standard errors.

    Parameters
    ----------
    shape
        Coordinates of the branch, shape (2,).
    covariance
        Their covariance, shape (2, 2).
    """
    beta, u_peak = BranchShape.at(shape).peak()
    step = 1e-6 * max(float(np.max(np.abs(shape))), 1e-3)
    steps = step * np.eye(len(shape))
    around = [np.subtract(BranchShape.at(shape + by).peak(), BranchShape.at(shape - by).peak()) for by in steps]
    slopes = np.stack(around, axis=1) / (2.0 * step)
    spread = np.sqrt(np.diag(slopes @ covariance @ slopes.T))
    return MeasuredBranch(Estimate(beta, float(spread[0])), Estimate(u_peak, float(spread[1])))
