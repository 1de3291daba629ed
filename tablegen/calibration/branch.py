"""What is measured at one amplitude: the peak residual of each branch and where it is, whatever measured it."""

from dataclasses import dataclass
from math import pi

import numpy as np

from tablegen.calibration.estimate import Curve, Estimate
from tablegen.compensation.hysteresis import HIGHEST_PEAK, LOWEST_PEAK
from tablegen.numerics.arrays import Floats

BINS = 20  # intervals per branch, the baseline of the scaling error
WINDOW = slice(2, 18)  # x = 0.1 .. 0.9


@dataclass(frozen=True)
class MeasuredBranch:
    """The peak residual and where it is, (17), as a fraction of the scan, in sweep-aligned coordinates."""

    beta: Estimate
    u_peak: Estimate


@dataclass(frozen=True, kw_only=True)
class AmplitudeFit:
    """What one amplitude says.

    ``v_scan`` is peak to peak in V. ``residual_percent`` is the position error that the model leaves, in percent of
    the scan, averaged in bins of a twentieth of the line, forward then backward; ``scaling_percent`` the local scaling
    error that it leaves, peak to peak over x = 0.1..0.9, of each direction. ``noise_percent`` is that of the scan for
    a sensor, of the contrast for an image; ``drift_percent`` of the scan.
    """

    turn: Estimate
    v_scan: float
    samples: int
    forward: MeasuredBranch
    backward: MeasuredBranch
    noise_percent: float
    drift_percent: float
    residual_percent: Floats
    scaling_percent: tuple[float, float]
    curves: tuple[Curve, ...]


def peak(shape: Floats) -> tuple[float, float]:
    """beta and u_peak of (xi, xi gamma): u - tau turns once between the poles of (20)."""
    xi, xi_gamma = float(shape[0]), float(shape[1])
    tau = np.linspace(LOWEST_PEAK, HIGHEST_PEAK, 257)
    slope = pi * xi * np.cos(pi * tau) + xi_gamma * (2.0 - pi * np.sin(pi * tau))
    turning = np.flatnonzero(np.sign(slope[1:]) != np.sign(slope[:-1]))
    if not len(turning):  # no hysteresis at all
        return 0.0, 0.5
    at = int(turning[0])
    low, high = float(tau[at]), float(tau[at + 1])
    rising = slope[at] > 0.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        value = pi * xi * np.cos(pi * middle) + xi_gamma * (2.0 - pi * np.sin(pi * middle))
        low, high = (middle, high) if (value > 0.0) == rising else (low, middle)
    beta = xi * np.sin(pi * low) + xi_gamma * (np.cos(pi * low) - 1.0 + 2.0 * low)
    return float(beta), float(low + beta)


def measured_branch(shape: Floats, covariance: Floats) -> MeasuredBranch:
    """The branch that belongs to (xi, xi gamma) and their covariance."""
    beta, u_peak = peak(shape)
    step = 1e-6 * max(float(np.max(np.abs(shape))), 1e-3)
    steps = step * np.eye(2)
    slopes = np.stack([np.subtract(peak(shape + by), peak(shape - by)) / (2.0 * step) for by in steps], axis=1)
    spread = np.sqrt(np.diag(slopes @ covariance @ slopes.T))
    return MeasuredBranch(Estimate(beta, float(spread[0])), Estimate(u_peak, float(spread[1])))
