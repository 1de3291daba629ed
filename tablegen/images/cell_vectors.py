"""Vectors of a cell: reduction, sides and angle, and the lattice that indices generate."""

from functools import lru_cache
from itertools import product
from math import gcd

import numpy as np

from tablegen.numerics.arrays import Floats, Ints


def reduced(vectors: Floats) -> Floats:
    """Return the Gauss-reduced basis of a lattice: the shortest two vectors, at 60 to 90 degrees, the shorter first.

    Parameters
    ----------
    vectors
        A row for each side, shape (2, 2), not parallel.

    Returns
    -------
    Floats
        Shape (2, 2); the first one points to the right, or up.
    """
    a, b = np.array(vectors[0], dtype=np.float64), np.array(vectors[1], dtype=np.float64)
    while True:
        if a @ a > b @ b:
            a, b = b, a
        steps = round(float(a @ b) / float(a @ a))
        if not steps or (b - steps * a) @ (b - steps * a) >= (b @ b) * (1.0 - 1e-9):
            break
        b = b - steps * a
    if a[0] < -1e-9 or (abs(a[0]) <= 1e-9 and a[1] < 0.0):
        a = -a
    return np.array([a, b if a @ b >= 0.0 else -b])


def area(vectors: Floats) -> float:
    """Return the area that two vectors, shape (2, 2), span."""
    return float(abs(vectors[0, 0] * vectors[1, 1] - vectors[0, 1] * vectors[1, 0]))


def sides_and_angle(vectors: Floats) -> tuple[float, float, float]:
    """Return the lengths of two vectors, shape (2, 2), and the angle between them in degrees."""
    a, b = (float(np.hypot(*one)) for one in vectors)
    cosine = float(np.clip(vectors[0] @ vectors[1] / (a * b), -1.0, 1.0))
    return a, b, float(np.degrees(np.arccos(cosine)))


def sublattice_index(indices: Ints) -> int:
    """Return the index in Z^2 of the lattice that indices generate: 1 for all of it, 0 for less than two dimensions.

    Parameters
    ----------
    indices
        Shape (n, 2).
    """
    index = 0
    for i in range(len(indices)):
        for j in range(i):
            index = gcd(index, abs(int(indices[i, 0] * indices[j, 1] - indices[i, 1] * indices[j, 0])))
    return index


def lattices_of_index(index: int) -> list[Ints]:
    """Return the sublattices of Z^2 of an index, each by a basis in Hermite's form, shape (2, 2)."""
    return [
        np.array([[a, b], [0, index // a]], dtype=np.int64)
        for a in range(1, index + 1)
        if index % a == 0
        for b in range(index // a)
    ]


@lru_cache
def lattice_points(reach: int) -> Floats:
    """Return the whole numbers (n, m) of one half of a lattice up to ``reach``, without the origin; not writable."""
    span = range(-reach, reach + 1)
    points = np.array([(n, m) for n, m in product(span, span) if n > 0 or (n == 0 and m > 0)], dtype=np.float64)
    points.flags.writeable = False
    return points
