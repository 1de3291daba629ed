"""Tell waves of time, such as mains hum, from those of the sample.

Hum has one frequency in time. Along the lines it is one wave and its harmonics, folded from row to row; a retrace is
scanned in the other direction, so that it shows the mirrored wave. The sample's waves are not mirrored.
"""

import numpy as np

from tablegen.numerics.arrays import Bools, Floats

_HARMONICS = 6
_NEAR_WAVE = 1.3  # periods in the image: waves of two images this near are one
_NEAR_INDEX = 0.06


def hum_waves(waves: Floats, other: Floats, shape: tuple[int, int]) -> Floats:
    """Return the waves of an image that are mirrored in the other direction, and not as they are.

    Parameters
    ----------
    waves, other
        Waves per pixel of the significant spots of trace and retrace, or the reverse, shape (n, 2) each.
    shape
        Rows and columns of the image.

    Returns
    -------
    Floats
        Some of ``waves``, shape (m, 2).
    """
    extent = np.array([shape[1], shape[0]])
    mirrored = other * np.array([1.0, -1.0])  # (-u, v) and (u, -v) are one wave
    return waves[_near(waves, mirrored, extent) & ~_near(waves, other, extent)]


def _near(waves: Floats, other: Floats, extent: Floats) -> Bools:
    if not len(waves) or not len(other):
        return np.zeros(len(waves), dtype=np.bool_)
    distance = np.hypot(*np.moveaxis((waves[:, None] - other[None]) * extent, -1, 0))
    return np.asarray(np.min(distance, axis=1) <= _NEAR_WAVE)


def of_hum(waves: Floats, hum: Floats, vectors: Floats, harmonics: int = _HARMONICS) -> Bools:
    """Return True for waves that are harmonics of hum, as they are or beside a wave of the lattice.

    Parameters
    ----------
    waves, hum
        Waves per pixel, shape (n, 2) and (m, 2); of hum the strongest first, whose harmonics count.
    vectors
        The cell in pixels, shape (2, 2).
    harmonics
        The highest harmonic.
    """
    members = np.zeros(len(waves), dtype=np.bool_)
    fundamentals = _fundamentals(hum[0]) if len(hum) and harmonics == _HARMONICS else []
    for number, wave in enumerate([*hum, *fundamentals]):
        most = harmonics if not number or number >= len(hum) else 1
        for n in [n for n in range(-most, most + 1) if n]:
            folded = n * wave - np.array([0.0, round(n * float(wave[1]))])
            index = (waves - folded) @ vectors.T
            members |= np.max(np.abs(index - np.round(index)), axis=1) <= _NEAR_INDEX
    return members


def _fundamentals(wave: Floats) -> list[Floats]:
    """Return the waves whose second harmonic is this one: mains hum often shows no other."""
    return [0.5 * (wave + np.array([0.0, fold])) for fold in (0.0, 1.0)]
