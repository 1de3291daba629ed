"""The part of the errors of codes that arrives in the position, behind the passage that a certificate states."""

import numpy as np
import numpy.typing as npt

from tablegen.manifest.fields import ManifestPassage, ManifestResponse
from tablegen.numerics.arrays import Floats

Complex = npt.NDArray[np.complex128]


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

    Gain and phase are linear between the points; below the first the phase goes to the half turn that is nearest.
    """
    first = response.phase_turns[0]
    hz, turns = [0.0, *response.hz], [np.rint(2.0 * first) / 2.0, *response.phase_turns]
    gain = np.interp(f_hz, response.hz, response.gain)
    return np.asarray(gain * np.exp(2j * np.pi * np.interp(f_hz, hz, turns)))
