"""The part of the errors of codes that arrives in the position, behind the passage that a certificate states."""

import numpy as np
import numpy.typing as npt

from tablegen.manifest.fields import ManifestPassage, ManifestResponse
from tablegen.numerics.arrays import Floats

Complex = npt.NDArray[np.complex128]

_FOLLOWED_TURNS = 0.375  # of the phase between two points, up to which 1 / H is followed


def passes(passage: ManifestPassage, f_hz: Floats) -> Complex:
    """Return the complex gain of a passage for errors.

    Parameters
    ----------
    f_hz
        Frequencies in Hz, any shape.

    Returns
    -------
    Complex
        Dimensionless, shape of ``f_hz``.
    """
    if passage.response is not None:
        return np.asarray(np.where(f_hz <= passage.response.hz[-1], _measured(passage.response, f_hz), 0.0))
    if passage.frequency_hz is None or passage.quality is None:
        return np.asarray(f_hz <= (passage.band_hz or 0.0), dtype=np.complex128)
    r = f_hz / passage.frequency_hz
    late = np.exp(-2j * np.pi * f_hz * (passage.delay_s or 0.0))
    return np.asarray(late / (1.0 - r * r + 1j * r / passage.quality))


def _measured(response: ManifestResponse, f_hz: Floats) -> Complex:
    """Return a measured response.

    1 / H without the phase that is linear from the first point to the last is a cubic between two points, whose slopes
    there are those of parabolas through three points; gain and phase are linear where the rest of the phase turns by
    more than 3/8. Below the first point the gain stays, and the phase goes to the half turn that is nearest.
    """
    points, gains, turns = (np.array(values) for values in (response.hz, response.gain, response.phase_turns))
    first = float(turns[0])
    linear = np.interp(f_hz, points, gains) * np.exp(
        2j * np.pi * np.interp(f_hz, [0.0, *points], [np.rint(2.0 * first) / 2.0, *turns])
    )
    ramp = (turns[-1] - first) / (points[-1] - points[0])
    rest = turns - ramp * (points - points[0])
    inverse = np.exp(-2j * np.pi * rest) / gains
    slopes = np.gradient(inverse, points, edge_order=2 if len(points) > 2 else 1)
    k = np.clip(np.searchsorted(points, f_hz) - 1, 0, len(points) - 2)
    step = points[k + 1] - points[k]
    t = (np.clip(f_hz, points[0], points[-1]) - points[k]) / step
    # The cubic by powers of t: value and slope of its beginning, then what is left to those of its end.
    missing, turned = inverse[k + 1] - inverse[k] - step * slopes[k], step * (slopes[k + 1] - slopes[k])
    cubic = inverse[k] + t * (step * slopes[k] + t * (3.0 * missing - turned + t * (turned - 2.0 * missing)))
    followed = (np.abs(np.diff(rest))[k] <= _FOLLOWED_TURNS) & (f_hz >= points[0])
    late = np.exp(2j * np.pi * ramp * (f_hz - points[0]))
    return np.asarray(np.where(followed, late / np.where(followed, cubic, 1.0), linear), dtype=np.complex128)
