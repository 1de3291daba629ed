"""Positions from images of a periodic sample, in the form in which they are learnt: a line with its errors."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from tablegen.numerics.arrays import Floats

# The known part: one direction; both; or of both only their difference.
Parts = Literal["forward", "both", "difference"]


@dataclass(frozen=True, eq=False)
class WindowLine:
    """The reached line in the imaged windows: the requested one, and an error in polynomials along the window.

    ``requested`` takes times in periods to the line, 0..1; ``unit_nm`` is nm per line. ``coefficients``, (modes,), are
    of the error in lines, those common to both directions before those of their difference, each from the lowest degree
    on; ``line_covariance``, (modes, modes), is theirs. Times are those of the windows: no image shows the turnarounds.
    """

    requested: Callable[[Floats], Floats]
    unit_nm: float
    turn: float
    window: tuple[float, float]
    degree: int
    parts: Parts
    coefficients: Floats
    line_covariance: Floats

    @property
    def detail(self) -> int:
        """The number of harmonics of the period that are as fine as the highest degree."""
        return max(self.degree, 1)

    @property
    def forward_only(self) -> bool:
        """True if the way back was not imaged."""
        return self.parts == "forward"

    @property
    def covariance(self) -> Floats:
        """The covariance of the coefficients.

        Returns
        -------
        Matrix in nm^2, shape (coefficients, coefficients).
        """
        return self.line_covariance * self.unit_nm**2

    def basis(self, times: Floats) -> Floats:
        """Return the matrix from coefficients to the line.

        Parameters
        ----------
        times
            Times in periods, shape (times,).

        Returns
        -------
        Matrix, shape (times, coefficients).
        """
        forward = times % 1.0 <= self.turn
        place = np.where(forward, times % 1.0 / self.turn, (1.0 - times % 1.0) / (1.0 - self.turn))
        return error_modes(place, forward, self.window, self.degree, self.parts).T

    def value(self, times: Floats) -> Floats:
        """Return the position of the piezo.

        Parameters
        ----------
        times
            Times in periods, shape (times,).

        Returns
        -------
        Positions in nm, shape (times,).
        """
        position: Floats = self.unit_nm * (self.requested(times) + self.basis(times) @ self.coefficients)
        return position

    def error(self, requested: Callable[[Floats], Floats], size_nm: float) -> Floats:
        """Return the coefficients of the reached line less the requested one; neither parameter matters.

        Returns
        -------
        Coefficients in nm, shape (coefficients,).
        """
        return self.unit_nm * self.coefficients

    @property
    def groups(self) -> list[list[int]]:
        """Coefficients that are learnt or discarded as a group: those of a degree."""
        modes_by_degree: dict[int, list[int]] = {}
        for i, degree in enumerate(mode_degrees(self.degree, self.parts)):
            modes_by_degree.setdefault(degree, []).append(i)
        return list(modes_by_degree.values())


def mode_degrees(degree: int, parts: Parts) -> list[int]:
    """Return the degree of each mode; common to both directions, origin and size are no error."""
    common = [] if parts == "difference" else list(range(2, degree + 1))
    return common if parts == "forward" else [*common, *range(degree + 1)]


def error_modes(
    place: Floats, forward: np.typing.NDArray[np.bool_], window: tuple[float, float], degree: int, parts: Parts
) -> Floats:
    """Return Legendre polynomials of the position in the window, common to both directions, then of opposite sign.

    Parameters
    ----------
    place
        Positions on the line, 0..1, shape (places,).
    forward
        True where the line rises, shape (places,).

    Returns
    -------
    Modes, shape (modes, places).
    """
    low, high = window
    at = 2.0 * (place - low) / (high - low) - 1.0
    polynomials = np.asarray(np.polynomial.legendre.legvander(at, degree).T, dtype=np.float64)
    if parts == "forward":
        return polynomials[2:]
    opposite: Floats = np.where(forward, polynomials, -polynomials)
    return opposite if parts == "difference" else np.concatenate([polynomials[2:], opposite])


def averaged(lines: Sequence[WindowLine]) -> WindowLine:
    """Average the same line measured several times, each time with its own noise."""
    degree = min(line.degree for line in lines)
    modes = [[i for i, d in enumerate(mode_degrees(line.degree, line.parts)) if d <= degree] for line in lines]
    pairs = list(zip(lines, modes, strict=True))
    mean = np.mean([line.coefficients[i] for line, i in pairs], axis=0)
    covariance = np.mean([line.line_covariance[np.ix_(i, i)] for line, i in pairs], axis=0) / len(lines)
    return replace(lines[0], degree=degree, coefficients=mean, line_covariance=covariance)
