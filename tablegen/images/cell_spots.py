"""Compare the spots of a spectrum with the waves of a cell."""

import numpy as np

from tablegen.images.autocorrelation import Spots
from tablegen.images.cell_vectors import lattices_of_index, reduced
from tablegen.images.image_views import NEAR_SPOT, STRAIN
from tablegen.numerics.arrays import Bools, Floats, Ints

OFF = 0.12  # of an index: largest distance of a spot from a whole number
INFORMATIVE = 0.25  # of an index: a spot with more uncertainty is not compared
_ORDERS = (2, 4, 6, 10)  # indices up to which a cell is fitted to spots, one after the other
_FRACTIONS = (2, 3, 4)  # of the waves of a cell, where a superstructure has its own
_NEAR_FRACTION = 0.045
_PARALLEL = 0.1  # radians
_CORRECTED = 0.05  # share: what spots may change of the sides that the maxima have
_SLOW, _SLOW_SHARE = 4.0, 0.5  # periods in the image, and of the slowest wave of the cell: a terrace has waves below
SAME_CELL = 0.12  # share
STREAK = 4  # spots in one direction: the edge of a terrace


def same_lattice(one: Floats, other: Floats) -> bool:
    """Return True if two cells are bases of nearly one lattice."""
    change = one @ np.linalg.inv(other)
    whole = np.round(change)
    return bool(abs(abs(np.linalg.det(whole)) - 1.0) < 1e-6 and np.max(np.abs(change - whole)) < SAME_CELL)


def explained_spots(vectors: Floats, spots: Spots) -> tuple[Bools, Bools]:
    """Return which spots are at whole numbers of a cell's reciprocal, and which are near enough to 0 to tell.

    Parameters
    ----------
    vectors
        The cell in pixels, shape (2, 2).
    """
    index = spots.waves @ vectors.T
    off = np.max(np.abs(index - np.round(index)), axis=1)
    tolerance = OFF + STRAIN * np.max(np.abs(index), axis=1)
    return np.asarray(off <= tolerance), np.asarray(tolerance <= INFORMATIVE)


def fitted_to_spots(vectors: Floats, spots: Spots) -> Floats:
    """Fit a cell, shape (2, 2) in pixels, to spots, from the low indices to the high ones."""
    for most in _ORDERS:
        index = spots.waves @ vectors.T
        whole = np.round(index)
        near = np.all(np.abs(index - whole) <= OFF, axis=1) & (np.max(np.abs(whole), axis=1) <= most)
        if np.linalg.matrix_rank(whole[near]) < 2:
            continue
        base = np.linalg.lstsq(whole[near], spots.waves[near], rcond=None)[0]
        if np.max(np.abs(base @ vectors.T - np.eye(2))) > _CORRECTED:
            return vectors
        vectors = np.linalg.inv(base).T
    return vectors


def of_an_edge(waves: Floats, own: Floats, extent: Floats) -> Bools:
    """Return True for slow waves if all slow ones are in one direction: those of a step, a facet or a bow.

    A larger cell would have slow waves in two directions, or faster ones beside those of the smaller cell.

    Parameters
    ----------
    waves, own
        Waves per pixel that a cell does not explain, and that it does, shape (n, 2) and (m, 2).
    extent
        Columns and rows of the image.
    """
    periods, least = waves * extent, np.min(np.hypot(*(own * extent).T), initial=np.inf)
    slow: Bools = np.hypot(*periods.T) < min(_SLOW, _SLOW_SHARE * float(least))
    if not np.any(slow):
        return slow
    unit = np.linalg.svd(periods[slow], full_matrices=False)[2][0]
    across = np.abs(periods @ np.array([-unit[1], unit[0]]))
    return np.asarray(slow & np.all(across[slow] <= NEAR_SPOT))


def at_fractions(index: Floats) -> Bools:
    """Return True for indices, shape (n, 2), at small fractions."""
    fractional = np.zeros(len(index), dtype=np.bool_)
    for parts in _FRACTIONS:
        fractional |= np.all(np.abs(parts * index - np.round(parts * index)) <= parts * _NEAR_FRACTION, axis=1)
    return fractional


def parallel_waves(waves: Floats) -> Ints:
    """Return how many waves have the direction of each, with itself."""
    direction = np.arctan2(waves[:, 1], waves[:, 0])
    beside = np.abs((direction[:, None] - direction[None] + np.pi / 2) % np.pi - np.pi / 2) < _PARALLEL
    return np.asarray(np.sum(beside, axis=1), dtype=np.int64)


def one_direction(waves: Floats) -> bool:
    """Return True if waves, shape (n, 2), are parallel."""
    if not len(waves):
        return False
    unit = waves / np.hypot(*waves.T)[:, None]
    return bool(np.linalg.svd(unit, compute_uv=False)[-1] < _PARALLEL * len(waves) ** 0.5) if len(waves) > 1 else True


def supercell(vectors: Floats, waves: Floats) -> Floats | None:
    """Return the smallest multiple of a cell of which these waves are; None if it has more than 16 times the area."""
    for index in range(2, max(_FRACTIONS) ** 2 + 1):
        for basis in lattices_of_index(index):
            numbers = waves @ (basis @ vectors).T
            if np.all(np.abs(numbers - np.round(numbers)) <= index * _NEAR_FRACTION):
                return reduced(basis @ vectors)
    return None
