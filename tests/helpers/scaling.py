"""The scaling error that the paper measures: how far from constant the slope of the motion is inside a window."""

import numpy as np

from tablegen.compensation.hysteresis import BranchShape
from tablegen.compensation.line import LineShape
from tablegen.waveform.series import FourierSeries

SECTION_8 = LineShape(0.5, BranchShape.harmonic(0.035, 0.37), BranchShape.harmonic(0.085, 0.48))


def scaling_error(shape: LineShape, series: FourierSeries, low: float, high: float, forward: bool) -> float:
    """Percent peak to peak, by central differences of the series summed with numpy: nothing of the module is used."""
    n = np.arange(1, series.harmonics + 1)

    def w(t: np.ndarray) -> np.ndarray:
        angle = 2 * np.pi * np.outer(t, n)
        return series.a0 + np.cos(angle) @ series.a + np.sin(angle) @ series.b

    def u(t: np.ndarray) -> np.ndarray:
        tau = t / shape.turn if forward else (t - shape.turn) / (1 - shape.turn)
        b = shape.forward if forward else shape.backward
        curve = (1 + 2 * b.xi_gamma) * tau + b.xi * np.sin(np.pi * tau) + b.xi_gamma * (np.cos(np.pi * tau) - 1)
        return curve if forward else 1 - curve

    x = np.linspace(low, high, 3001)
    t = shape.turn * x if forward else shape.turn + (1 - shape.turn) * (1 - x)
    h = 1e-5
    slope = (w(t + h) - w(t - h)) / (u(t + h) - u(t - h))
    return float(100 * (slope.max() - slope.min()))


def worst(shape: LineShape, series: FourierSeries, low: float = 0.1, high: float = 0.9) -> float:
    return max(scaling_error(shape, series, low, high, forward) for forward in (True, False))
