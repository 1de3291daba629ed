"""Functions that the hysteresis operators share: monotonic pieces of a drive, and Bernstein polynomials as powers."""

from collections.abc import Sequence
from itertools import pairwise
from math import comb

import numpy as np

from tablegen.numerics.arrays import Floats

# Drives this far outside 0..1 are the last bits of a voltage, not a voltage.
_SATURATION_TOLERANCE = 1e-9


def normalised(drive: Floats) -> Floats:
    """Clip a drive that leaves 0..1 by the last bits of a voltage.

    Parameters
    ----------
    drive
        Normalised drives, of any shape.

    Returns
    -------
    Drives of 0..1, of the same shape.

    Raises
    ------
    ValueError
        If the drive is outside 0..1.
    """
    drive = np.asarray(drive, dtype=np.float64)
    if drive.size and max(-float(drive.min()), float(drive.max()) - 1.0) > _SATURATION_TOLERANCE:
        raise ValueError(f"a drive of {drive.min():g}..{drive.max():g} leaves 0..1, for which the operator is made")
    return np.clip(drive, 0.0, 1.0)


def monotonic(drive: Floats) -> list[tuple[int, int]]:
    """Return the monotonic pieces of drive[1:]; flat parts belong to the piece before.

    Parameters
    ----------
    drive
        Drives, shape (n,), of which the first is where the sequence begins.

    Returns
    -------
    First and end index of each piece in drive[1:].
    """
    steps = np.sign(np.diff(drive))
    moving = np.flatnonzero(steps)
    if not len(moving):
        return [(0, len(steps))] if len(steps) else []
    turns = moving[1:][steps[moving[1:]] != steps[moving[:-1]]]
    ends = [0, *map(int, turns), len(steps)]
    return list(pairwise(ends))


def one_minus(n: int) -> Floats:
    """Return the coefficients of (1 - x)^n.

    Returns
    -------
    Coefficients of 1, x, ..., x^n, shape (n + 1,).
    """
    return np.array([(-1.0) ** k * comb(n, k) for k in range(n + 1)])


def powers_of(bernstein: Sequence[float]) -> Floats:
    """Convert Bernstein coefficients over 0..1 to coefficients of 1, x, x^2, ...

    Parameters
    ----------
    bernstein
        Coefficients, shape (n + 1,).

    Returns
    -------
    Coefficients, lowest power first, shape (n + 1,).
    """
    n = len(bernstein) - 1
    out = np.zeros(n + 1)
    for i, weight in enumerate(bernstein):
        out[i:] += weight * comb(n, i) * one_minus(n - i)
    return out
