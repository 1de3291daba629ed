"""Compare a predicted loop with a measured line, in the measures of the certificate, percent of the line."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from tablegen.calibration.operator.periodic_line import PeriodicLine
from tablegen.compensation.operator.loop import Loop
from tablegen.numerics.arrays import Bools, Floats

WINDOW = (0.1, 0.9)
_CHORD = 0.05  # of the line
_POINTS = 321  # over the window
_LEAST_SAMPLES = 8  # on either branch, inside the window
_SMOOTHING = 12  # degree of the Chebyshev series over the window, which suppresses noise


@dataclass(frozen=True, slots=True)
class LineErrors:
    """Rms and largest scaling error of both directions, largest distance of trace and retrace, error of the size.

    ``sides`` has the residual, rising and falling, in percent at even positions over ``WINDOW``; None without a loop.
    """

    rms: float
    scaling: float
    mismatch: float
    size: float
    sides: Floats | None = field(default=None, compare=False, repr=False)

    @property
    def figures(self) -> tuple[float, float, float, float]:
        """The four numbers in their order."""
        return self.rms, self.scaling, self.mismatch, self.size


WORST = LineErrors(100.0, 100.0, 100.0, 100.0)  # of an impossible loop


def compare(line: PeriodicLine, loop: Loop) -> LineErrors:
    """Return the errors of a scan linearised by ``loop`` on an axis whose line is the measured one."""
    predicted = np.where(line.rising, loop.position(line.drive, True), loop.position(line.drive, False))
    measured = line.displacement_nm
    inside = (predicted > WINDOW[0]) & (predicted < WINDOW[1])
    scale, offset = np.polyfit(predicted[inside], measured[inside], 1)
    error = 100.0 * ((measured - offset) / scale - predicted)
    sides = [predicted[side & inside] for side in (line.rising, ~line.rising)]
    errors = [error[side & inside] for side in (line.rising, ~line.rising)]
    return _figures(sides, errors, 100.0 * (loop.extent_nm / float(scale) - 1.0))


def sweep_errors(position: Floats, error: Floats, rising: Bools) -> LineErrors | None:
    """Return the errors of sweeps in time; None without samples enough on a rising and a falling one.

    Parameters
    ----------
    position
        Predicted positions, 0..1 along each sweep, shape (samples,).
    error
        Measured less predicted displacement, in percent of the sweep, shape (samples,).
    rising
        True on rising sweeps, shape (samples,).
    """
    inside = (position > WINDOW[0]) & (position < WINDOW[1])
    if min(int(np.sum(inside & side)) for side in (rising, ~rising)) < _LEAST_SAMPLES:
        return None
    slope, offset = np.polyfit(position[inside], error[inside], 1)
    bent = error - slope * position - offset
    sides, errors = zip(*((position[inside & one], bent[inside & one]) for one in (rising, ~rising)), strict=True)
    return _figures(sides, errors, -float(slope))


def _figures(positions: Sequence[Floats], errors: Sequence[Floats], size: float) -> LineErrors:
    """Return the errors of a rising and a falling branch about their best common line."""
    x = np.linspace(*WINDOW, _POINTS)
    sides = [_smooth(at, error, x) for at, error in zip(positions, errors, strict=True)]
    step = round(_CHORD / (x[1] - x[0]))
    scaling = max(float(np.ptp(one[step:] - one[:-step])) / (x[step] - x[0]) for one in sides)
    rms = float(np.sqrt(np.mean(np.square(sides))))
    mismatch = float(np.max(np.abs(sides[0] - sides[1])))
    return LineErrors(rms, scaling, mismatch, size, np.stack(sides))


def _smooth(at: Floats, error: Floats, x: Floats) -> Floats:
    fit = np.polynomial.Chebyshev.fit(at, error, min(_SMOOTHING, max(len(at) // 8, 1)), domain=list(WINDOW))
    return np.asarray(fit(x), dtype=np.float64)
