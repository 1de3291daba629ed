"""A cell in units of length, with the errors of its sides and its angle, and its distortion against an ideal one."""

from dataclasses import dataclass

import numpy as np

from tablegen.fitting.estimate import Estimate
from tablegen.images.cell_vectors import area, reduced, sides_and_angle
from tablegen.numerics.arrays import Floats

IDEAL_ANGLES = {"hexagonal": 60.0, "square": 90.0}


@dataclass(frozen=True, eq=False)
class MeasuredCell:
    """Sides ``a`` and ``b`` and the angle between them in degrees; ``vectors`` has the sides' x and y, shape (2, 2)."""

    a: Estimate
    b: Estimate
    angle_deg: Estimate
    vectors: Floats

    @property
    def area(self) -> float:
        """Area in squares of the unit of the sides."""
        return area(self.vectors)


def measured_cell(vectors: Floats, covariance: Floats, pixel: tuple[float, float]) -> MeasuredCell:
    """Convert a cell from pixels, and reduce it again, since pixels need not be square.

    Parameters
    ----------
    vectors
        Sides in pixels, shape (2, 2).
    covariance
        That of a_x, a_y, b_x, b_y in pixels, shape (4, 4).
    pixel
        Width and height of a pixel.
    """
    scale = np.array(pixel)
    scaled = vectors * scale
    basis = reduced(scaled)
    change = np.kron(np.round(basis @ np.linalg.inv(scaled)), np.diag(scale))
    full = change @ covariance @ change.T
    values = np.array(sides_and_angle(basis))
    gradient = np.zeros((3, 4))
    step = 1e-6 * float(values[0])
    for number in range(4):
        moved = basis.ravel().copy()
        moved[number] += step
        gradient[:, number] = (np.array(sides_and_angle(moved.reshape(2, 2))) - values) / step
    errors = np.sqrt(np.maximum(np.diag(gradient @ full @ gradient.T), 0.0))
    a, b, angle = (Estimate(float(v), float(e)) for v, e in zip(values, errors, strict=True))
    return MeasuredCell(a, b, angle, basis)


def stretches(vectors: Floats, kind: str) -> tuple[float, float]:
    """Return by how much a cell is longer than the ideal one of side 1, in the most and the least stretched direction.

    Parameters
    ----------
    vectors
        A reduced cell, shape (2, 2).
    kind
        "hexagonal" or "square".
    """
    angle = np.radians(IDEAL_ANGLES[kind])
    ideal = np.array([[1.0, 0.0], [np.cos(angle), np.sin(angle)]])
    values = np.linalg.svd(np.linalg.solve(ideal, vectors), compute_uv=False)
    return float(values[0]), float(values[1])
