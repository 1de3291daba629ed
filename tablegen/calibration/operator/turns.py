"""Extrapolate the harmonics of a line's turns, above those from which the dynamics were removed."""

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from tablegen.calibration.operator.periodic_line import PHASES, PeriodicLine
from tablegen.numerics.arrays import Floats, Ints

_LEAST_HARMONICS = 6  # whose dynamics were removed, in the upper half of them
_LEAST_SHARE = 1e-3  # of the drive's harmonics, from one to the next times n^2, of its fundamental: a turn is sharp


def with_turns(line: PeriodicLine, highest_hz: float) -> PeriodicLine:
    """Return the line with the harmonics above a frequency extrapolated from those below it.

    Both branches of a settled line meet in a corner at each turn of the drive, so that its harmonics are

        (a + b exp(-2 pi i n p)) / n^2 + i (c + d exp(-2 pi i n p)) / n^3,

    p the phase of the upper turn. a to d are fitted to the upper half of the harmonics below ``highest_hz``. Above it
    the measured ones still have the dynamics: a resonance there moves and rounds the turns, and with them the size.
    Turns that are rounded in the drive are rounded alike. A line without sharp turns, or with few harmonics below, is
    left as it is.

    Parameters
    ----------
    line
        A line without its dynamics up to ``highest_hz``.
    highest_hz
        The highest frequency at which they were removed.
    """
    last = min(int(highest_hz / line.rate_hz), PHASES // 2)
    band = np.arange((last + 1) // 2, last + 1)
    drive = np.abs(np.fft.rfft(line.drive))
    if len(band) < _LEAST_HARMONICS or last == PHASES // 2:
        return line
    sharpness = _pairs(drive)
    if np.mean(sharpness[band]) < _LEAST_SHARE * drive[1]:
        return line
    spectrum = np.fft.rfft(line.displacement_nm)
    top = int(np.argmax(line.drive)) / PHASES
    here = _corners(band, top)
    weights = band.astype(np.float64) ** 2
    values = spectrum[band] * weights
    parts, *_ = np.linalg.lstsq(
        np.vstack([(here * weights[:, None]).real, (here * weights[:, None]).imag]),
        np.concatenate([values.real, values.imag]),
        rcond=None,
    )
    above = np.arange(last + 1, PHASES // 2)
    rounded = np.minimum(sharpness[above] / np.mean(sharpness[band]), 1.0)
    spectrum[above] = rounded * (_corners(above, top) @ parts)
    spectrum[PHASES // 2] = 0.0
    return replace(line, displacement_nm=np.fft.irfft(spectrum, PHASES))


def _corners(harmonics: Ints, top: float) -> npt.NDArray[np.complex128]:
    """Return the harmonics of a corner and of a bend at both turns, shape (harmonics, 4)."""
    n = harmonics.astype(np.float64)
    both = np.stack([np.ones(len(n)), np.exp(-2j * np.pi * n * top)], axis=1)
    return np.hstack([both / n[:, None] ** 2, 1j * both / n[:, None] ** 3])


def _pairs(drive: Floats) -> Floats:
    """Return n^2 times each harmonic of the drive and the next one: those of one parity may be missing."""
    n = np.arange(len(drive), dtype=np.float64)
    pairs: Floats = n * n * np.hypot(drive, np.append(drive[1:], 0.0))
    return pairs
