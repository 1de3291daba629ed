"""Candidate cells from the maxima of an autocorrelation: pairs of lags whose sums are maxima too."""

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from tablegen.images.autocorrelation import Autocorrelation, maxima
from tablegen.images.cell_vectors import area, lattice_points, reduced, sides_and_angle
from tablegen.images.nearby_maxima import NearbyMaxima
from tablegen.numerics.arrays import Floats

_LEAST_SIDE = 3.0  # pixels
_LEAST_HEIGHT = 0.35  # of the highest maximum, and of the pair's for the sums
_LEAST_CORRELATION = 0.05
_NEAREST, _HIGHEST = 18, 10  # maxima that are paired
_LEAST_SINE = 0.4  # of the angle of a pair
_NEAR = 0.12  # of the shorter side: a maximum this near to a lattice point is its own
_SAME = 0.08  # of the side: cells that differ by less are one
_REACH = 3  # cells to either side that the refinement uses


@dataclass(frozen=True, eq=False)
class Candidate:
    """A reduced cell in pixels, shape (2, 2), the least maximum that it rests on, and the scatter of its maxima."""

    vectors: Floats
    level: float
    scatter: float  # pixels

    @property
    def area(self) -> float:
        """Area in square pixels."""
        return area(self.vectors)


def candidates(correlation: Autocorrelation) -> list[Candidate]:
    """Return candidate cells, the smallest first."""
    lags, heights = maxima(correlation, _LEAST_SIDE)
    if not len(lags):
        return []
    high = heights >= max(_LEAST_HEIGHT * heights[0], _LEAST_CORRELATION)
    near = np.argsort(np.hypot(*lags[high].T), kind="stable")[:_NEAREST]
    chosen = np.union1d(near, np.arange(min(int(high.sum()), _HIGHEST)))
    both = NearbyMaxima(np.concatenate([lags, -lags]), np.concatenate([heights, heights]))
    cells: list[Candidate] = []
    known = np.empty((0, 2, 2))
    for i, j in combinations(chosen.tolist(), 2):
        pair = lags[[i, j]]
        if area(pair) < _LEAST_SINE * float(np.prod(np.hypot(*pair.T))):
            continue
        vectors = reduced(pair)
        if np.hypot(*vectors[0]) < _LEAST_SIDE or _known(vectors, known):
            continue
        level = _sums(vectors, correlation, both)
        if level >= _LEAST_HEIGHT * min(heights[i], heights[j]):
            cells.append(_refined(Candidate(vectors, level, np.inf), both))
            known = np.concatenate([known, cells[-1].vectors[None]])
    return distinct(cells)


def distinct(cells: list[Candidate]) -> list[Candidate]:
    """Return the cells that differ, the smallest first."""
    unique: list[Candidate] = []
    for cell in sorted(cells, key=lambda one: one.area):
        if not _known(cell.vectors, np.array([one.vectors for one in unique])):
            unique.append(cell)
    return unique


def _known(vectors: Floats, cells: Floats) -> bool:
    """Return True if a cell is nearly one of others, shape (n, 2, 2)."""
    if not len(cells):
        return False
    side = abs(float(vectors[0, 0])) + abs(float(vectors[0, 1]))
    off = np.abs(cells - vectors)
    return bool(np.min(np.max(off, axis=(1, 2))) < _SAME * side)


def _sums(vectors: Floats, correlation: Autocorrelation, peaks: NearbyMaxima) -> float:
    """Return the least of the maxima at the sides of a cell, their difference, and their sum if the lags reach it."""
    side = float(np.hypot(*vectors[0]))
    a, b = vectors
    level = np.inf
    for point in (a, b, b - a, a + b):
        if np.any(np.abs(point) > np.array(correlation.reach) - 2.0):
            if point is a or point is b:
                return 0.0
            continue
        level = min(level, peaks.highest(point, max(_NEAR * side, 1.5)))
    return level


def _refined(cell: Candidate, peaks: NearbyMaxima) -> Candidate:
    """Fit a cell to the maxima at its lattice points, from the near ones to the far ones."""
    vectors, scatter = cell.vectors, np.inf
    for reach in range(1, _REACH + 1):
        points = lattice_points(reach)
        near = max(_NEAR * float(np.hypot(*vectors[0])), 1.5)
        nearest, matched = peaks.nearest(points @ vectors, near)
        matched &= peaks.heights[nearest] > 0.0
        if not _span(points[matched]):
            break
        weight, places = peaks.heights[nearest[matched]], peaks.lags[nearest[matched]]
        weighted = points[matched] * weight[:, None]
        fit = np.linalg.solve(weighted.T @ weighted, weighted.T @ (places * weight[:, None]))
        vectors = np.asarray(fit, dtype=np.float64)
        scatter = float(np.sqrt(np.mean(np.sum((points[matched] @ fit - places) ** 2, axis=1))))
    a, _, _ = sides_and_angle(vectors)
    return Candidate(reduced(vectors) if a > 0.0 else cell.vectors, cell.level, scatter)


def _span(points: Floats) -> bool:
    """Return True if whole numbers, shape (n, 2), are not all in one direction."""
    return bool(np.any(points[:1, 0] * points[:, 1] != points[:1, 1] * points[:, 0]))
