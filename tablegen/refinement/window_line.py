"""Positions that images of a periodic sample tell, as what learning takes: a line with its errors."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from tablegen.numerics.arrays import Floats

# What is known: one direction; both; or of both only what they differ by.
Parts = Literal["forward", "both", "difference"]


@dataclass(frozen=True, eq=False)
class WindowLine:
    """What was reached in the imaged windows: what was asked for, and an error in polynomials along the window.

    ``asked`` takes times in periods to the line, 0..1; ``unit_nm`` is nm a line. ``coefficients`` are of the error in
    lines, those of both directions together before those of their difference, each from the lowest degree on;
    ``covariance`` is theirs. Times are those of the windows: no image shows the turnarounds.
    """

    asked: Callable[[Floats], Floats]
    unit_nm: float
    turn: float
    window: tuple[float, float]
    degree: int
    parts: Parts
    coefficients: Floats
    line_covariance: Floats

    @property
    def detail(self) -> int:
        """How many harmonics of the period are as fine as the highest degree."""
        return max(self.degree, 1)

    @property
    def covariance(self) -> Floats:
        """In nm^2."""
        return self.line_covariance * self.unit_nm**2

    def basis(self, times: Floats) -> Floats:
        """Return the matrix from coefficients to the line: (times, coefficients)."""
        forward = times % 1.0 <= self.turn
        place = np.where(forward, times % 1.0 / self.turn, (1.0 - times % 1.0) / (1.0 - self.turn))
        return error_modes(place, forward, self.window, self.degree, self.parts).T

    def value(self, times: Floats) -> Floats:
        """Where the piezo was, in nm, at times in periods."""
        position: Floats = self.unit_nm * (self.asked(times) + self.basis(times) @ self.coefficients)
        return position

    def error(self, asked: Callable[[Floats], Floats], size_nm: float) -> Floats:
        """Return the coefficients of the reached line less the requested one, in nm."""
        return self.unit_nm * self.coefficients

    @property
    def groups(self) -> list[list[int]]:
        """Coefficients that are noise or not together: those of a degree."""
        modes_by_degree: dict[int, list[int]] = {}
        for i, degree in enumerate(mode_degrees(self.degree, self.parts)):
            modes_by_degree.setdefault(degree, []).append(i)
        return list(modes_by_degree.values())


def mode_degrees(degree: int, parts: Parts) -> list[int]:
    """Return the degree of each mode. Origin and size of both directions together are no error."""
    together = [] if parts == "difference" else list(range(2, degree + 1))
    return together if parts == "forward" else [*together, *range(degree + 1)]


def error_modes(
    place: Floats, forward: np.typing.NDArray[np.bool_], window: tuple[float, float], degree: int, parts: Parts
) -> Floats:
    """(modes, places): Legendre's polynomials of the place in the window; then again, with the other sign backward."""
    low, high = window
    at = 2.0 * (place - low) / (high - low) - 1.0
    polynomials = np.asarray(np.polynomial.legendre.legvander(at, degree).T, dtype=np.float64)
    if parts == "forward":
        return polynomials[2:]
    apart: Floats = np.where(forward, polynomials, -polynomials)
    return apart if parts == "difference" else np.concatenate([polynomials[2:], apart])


def averaged(lines: Sequence[WindowLine]) -> WindowLine:
    """Average the same line measured several times, each time with its own noise."""
    degree = min(line.degree for line in lines)
    modes = [[i for i, d in enumerate(mode_degrees(line.degree, line.parts)) if d <= degree] for line in lines]
    pairs = list(zip(lines, modes, strict=True))
    mean = np.mean([line.coefficients[i] for line, i in pairs], axis=0)
    covariance = np.mean([line.line_covariance[np.ix_(i, i)] for line, i in pairs], axis=0) / len(lines)
    return replace(lines[0], degree=degree, coefficients=mean, line_covariance=covariance)
