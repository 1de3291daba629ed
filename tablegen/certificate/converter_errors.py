"""The errors of the emitted integers alone on the scanner: roundings, behind the dynamics of the axis.

The certificate's own figures are of the codes. A resonance makes more of their noise: with a line of some thousand
codes at 1 kHz, several times as much.
"""

from math import sqrt

import numpy as np
from msgspec import Struct

from tablegen.certificate.line_errors import CHORD, EmittedPeriod
from tablegen.compensation.line import Sweep
from tablegen.numerics.arrays import Floats
from tablegen.planning.line_plan import LinePlan

_MOST_TICKS = 1 << 20  # of a period whose spectrum is taken; in a longer one a code is held for longer than it rings
_POINTS = 801  # over the window


class ConverterErrors(Struct, frozen=True):
    """The errors in percent of the line in the window, as in ``Expectation``; ``rms`` and ``scaling`` by direction."""

    rms: dict[str, float]
    scaling: dict[str, float]
    mismatch: float


def converter_errors(line: LinePlan, played: EmittedPeriod) -> ConverterErrors:
    """Compute the position errors of the directions that image from those of the codes, through the axis' dynamics."""
    shape = line.drive.shape
    sides: dict[str, Sweep] = {"forward": shape.forward}
    if line.band_limit.directions == "both":
        sides["backward"] = shape.backward
    position = np.linspace(*line.band_limit.window, _POINTS)
    chord = round(CHORD / (position[1] - position[0]))
    chord = max(1, min(chord, _POINTS - 1))
    span = position[chord] - position[0]
    rms: dict[str, float] = {}
    scaling: dict[str, float] = {}
    mismatch = 0.0
    for deviation in _periods(line, played):
        count, errors = len(deviation), []
        for side, branch in sides.items():
            here = np.interp(shape.times(side, position) * count - 0.5, np.arange(count), deviation)
            error = 100.0 * here / branch.slope(position if side == "forward" else 1.0 - position)
            error -= float(np.mean(error))
            rms[side] = max(rms.get(side, 0.0), sqrt(float(np.mean(error * error))))
            scaling[side] = max(scaling.get(side, 0.0), float(np.ptp(error[chord:] - error[:-chord]) / span))
            errors.append(error)
        mismatch = max(mismatch, float(np.max(np.abs(errors[0] - errors[-1]))))
    return ConverterErrors(rms, scaling, mismatch)


def _periods(line: LinePlan, played: EmittedPeriod) -> list[Floats]:
    """Return the errors of w behind the dynamics, of one period, or of several of a shaped axis (the worst counts)."""
    if played.shaped is not None and played.shaped.is_whole:
        return list(played.shaped.position_errors / line.codes_per_unit)
    ticks = line.program.ticks
    count = min(ticks, _MOST_TICKS)
    at = (2 * np.arange(count, dtype=np.int64) + 1) * ticks // (2 * count)
    return [_behind_dynamics(line, played.errors(at) / line.codes_per_unit, full=count == ticks)]


def _behind_dynamics(line: LinePlan, error: Floats, full: bool) -> Floats:
    """Return errors of w, one a tick of a period, (n,), behind the dynamics."""
    response = line.drive.response
    if response is None or not full:
        return error
    f: Floats = float(line.rate) * np.arange(len(error) // 2 + 1, dtype=np.float64)
    known = f <= response.highest_hz
    real, imaginary = response.inverse(f[known])
    spectrum = np.fft.rfft(error)
    spectrum[known] /= real + 1j * imaginary
    spectrum[~known] = 0.0
    return np.fft.irfft(spectrum, len(error))
