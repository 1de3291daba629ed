"""A position behind a response that was measured in points, for any drive, by fast transforms.

A record that does not repeat is continued on both sides until the axis has stopped ringing: by its first line, or at
rest. Above the last point the response acts as there, as in ``settled``.
"""

import numpy as np

from tablegen.compensation.dynamics import Measured
from tablegen.numerics.arrays import Floats

_SAMPLES_PER_PERIOD = 8  # of the highest frequency of the response, of the grid
_SAMPLES_PER_STEP = 8  # of the record
_MOST = 21  # powers of two of the samples of the grid; of a longer record it is coarser
_RINGS = 5.0  # of 1 / half the width of the resonance, in s, until the ringing has decayed
_PERIODS = 2.0  # of the lowest frequency of the response, over which an answer reaches as well


def behind_measured(time_s: Floats, y: Floats, response: Measured, repeated: int) -> Floats:
    """Return the output of a response, with its delay.

    Parameters
    ----------
    time_s, y
        Ascending times in s and the input, linear between them, shapes (n,).
    response
        The response; it is 1 at 0 Hz.
    repeated
        How many samples from the first one on were repeated before; 0 if the input begins at rest.

    Returns
    -------
    Floats
        Shape (n,).
    """
    span_s = float(time_s[-1] - time_s[0])
    whole = repeated == len(y)
    margin_s = 0.0 if whole else max(_RINGS / response.half_width_hz, _PERIODS / float(response.f_hz[0]))
    length_s = span_s + 2.0 * margin_s
    step_s = min(1.0 / (_SAMPLES_PER_PERIOD * response.highest_hz), span_s / (_SAMPLES_PER_STEP * len(y)))
    count = 2 ** min(_MOST, int(np.ceil(np.log2(length_s / step_s))))
    grid = time_s[0] - margin_s + length_s / count * np.arange(count)
    at = np.clip(grid, time_s[0], time_s[-1])
    if repeated:
        period_s = float(time_s[repeated - 1] - time_s[0])
        at = np.where(grid < time_s[0], time_s[0] + (grid - time_s[0]) % period_s, at)
    level = float(y[-1])
    spectrum = np.fft.rfft(np.interp(at, time_s, y) - level)
    f_hz = np.arange(len(spectrum)) / length_s
    real, imaginary = response.inverse(np.minimum(f_hz, response.highest_hz))
    out = np.fft.irfft(spectrum / (real + 1j * imaginary), count) + level
    return np.asarray(np.interp(time_s, grid, out, period=length_s), dtype=np.float64)
