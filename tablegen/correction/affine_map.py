"""Correct the affine distortion of an image of a lattice: the width, the height and the shear, from its cell alone.

The cell of an image and the known lattice give the linear map from the picture to the sample, up to a rotation. Rows
stay rows. The displacement within the lines and between rows is not measured.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.correction.distortion import Distortion, Sweep1D
from tablegen.correction.levelled_cell import levelled_cell
from tablegen.fitting.estimate import Estimate
from tablegen.images.cell_spots import same_lattice
from tablegen.images.direction_shift import DirectionShift, direction_shift
from tablegen.images.image_cell import ImageCell
from tablegen.images.indexer import find_cell
from tablegen.images.measured_cell import IDEAL_ANGLES, MeasuredCell, measured_cell
from tablegen.numerics.arrays import Floats

_MOST_SHEARED = 0.15  # of the picture, from its first row to its last: a steady drift
_MOST_SCALED = 1.4, 1.6  # factor of the width, and of the height
_SUPPORTED = 4.0  # standard deviations of a mean square over its expectation of 1
_ERRORS = 3.0  # standard errors
_HALF = 0.5
_BASES = [
    np.array(one, dtype=np.float64).reshape(2, 2)
    for one in product((-1, 0, 1), repeat=4)
    if abs(one[0] * one[3] - one[1] * one[2]) == 1
]


class ImplausibleMap(Unphysical):
    """The cell is that of another kind of lattice, or of another constant."""


@dataclass(frozen=True)
class _Reading:
    """The map of one basis of the cell: factors of width and height, and the shear as a share of the width."""

    kind: str
    basis: Floats
    width: float
    height: float
    shear: float

    @property
    def strain(self) -> float:
        """The change of shape."""
        return abs(float(np.log(self.height / self.width))) + abs(self.shear)

    def plausible(self, known_size: bool) -> bool:
        """Return True if calibration and a steady drift explain the map."""
        most_width, most_height = np.log(_MOST_SCALED)
        factors = np.abs(np.log([self.height / self.width, self.height, self.width]))
        most = np.array([most_height, most_height, most_width])[: 3 if known_size else 1]
        return bool(np.all(factors[: len(most)] < most)) and abs(self.shear) <= _MOST_SHEARED


@dataclass(frozen=True, eq=False)
class AffineMap:
    """The map from the picture of the file to the sample.

    ``width`` and ``height`` are factors of those of the file, ``shear_nm`` is how far the last row is moved to the
    right of the first one. ``cell`` is that of the recorded image, ``shift`` that of the retrace, None without one.
    ``sheared`` is False where shear and aspect are within their errors, and left out.
    """

    kind: str
    constant_nm: float
    width: Estimate
    height: Estimate
    shear_nm: Estimate
    cell: MeasuredCell
    shift: DirectionShift | None
    sheared: bool
    distortion: Distortion

    def sides_nm(self, height_nm: float) -> Floats:
        """Return the sides of the cell on the sample, from a file of this height, in nm, shape (2, 2)."""
        shear = self.shear_nm.value / height_nm
        change = np.array([[self.width.value, 0.0], [shear, self.height.value]])
        return np.asarray(self.cell.vectors @ change, dtype=np.float64)

    @property
    def record(self) -> dict[str, Any]:
        """The map as plain data."""
        sides = {name: _number(getattr(self.cell, name)) for name in ("a", "b", "angle_deg")}
        record: dict[str, Any] = {
            "width_factor": _number(self.width),
            "height_factor": _number(self.height),
            "shear_nm": _number(self.shear_nm),
            "cell_nm": sides,
            "sheared": self.sheared,
        }
        if self.shift is not None:
            record["retrace_shift_pixels"] = [round(float(value), 4) for value in self.shift.pixels]
        return record


def _number(estimate: Estimate) -> dict[str, float]:
    return {"value": round(estimate.value, 6), "standard_error": round(estimate.standard_error, 6)}


def affine_map(
    images: Sequence[Floats],
    ways: Sequence[bool],
    size_nm: tuple[float, float],
    constant_nm: float | None,
    kind: str,
) -> AffineMap:
    """Measure the affine map of an image of a hexagonal or square lattice.

    Parameters
    ----------
    images
        Heights of the trace, or of the retrace alone, or of both, with the left end on the left, shape (rows, columns).
    ways
        True for each image that is a trace.
    size_nm
        Width and height of the picture by the file.
    constant_nm
        Constant of the lattice; None where it is unknown: then the width of the file stands.
    kind
        "hexagonal" or "square": a strong shear makes each look like the other one.

    Raises
    ------
    Unphysical
        If the image has no cell, or another one in each direction, or the map is ambiguous, implausible or within its
        errors.
    """
    rows, columns = images[0].shape
    pixel = size_nm[0] / columns, size_nm[1] / rows
    expected = None
    if constant_nm is not None:
        expected = constant_nm**2 * float(np.sin(np.radians(IDEAL_ANGLES[kind]))) / (pixel[0] * pixel[1])
    mean = _mean_cell(images, expected)
    vectors, covariance = mean.vectors, mean.covariance
    cell = measured_cell(vectors, covariance, pixel)
    shift = direction_shift(images[0], images[1], mean) if len(images) == 2 else None
    reading = _reading(cell.vectors, size_nm, constant_nm, kind)
    scale = np.tile(pixel, 2)
    change = np.kron(np.round(cell.vectors @ np.linalg.inv(vectors * np.array(pixel))), np.eye(2))
    spread = change @ (covariance * np.outer(scale, scale)) @ change.T
    factors = _factors(cell.vectors, reading, size_nm, constant_nm)
    slope = np.zeros((3, 4))
    for number in range(4):
        moved = cell.vectors.ravel().copy()
        step = 1e-6 * float(np.hypot(*cell.vectors[0]))
        moved[number] += step
        slope[:, number] = (_factors(moved.reshape(2, 2), reading, size_nm, constant_nm) - factors) / step
    errors = slope @ spread @ slope.T
    width, height, shear = factors.tolist()
    sheared = _significant(width, height, shear, errors)
    if not sheared:
        if constant_nm is None:
            raise Unphysical(
                f"the cell is {reading.kind} within its errors: there is no affine distortion to correct; give "
                f"--lattice-nm, for the size"
            )
        width = height = float(np.sqrt(width * height))
        shear = 0.0
    across, along = pixel[0] * width, pixel[1] * height
    standard = np.sqrt(np.diag(errors))
    return AffineMap(
        kind=reading.kind,
        constant_nm=constant_nm or _constant(cell.vectors, reading, size_nm),
        width=Estimate(width, float(standard[0])),
        height=Estimate(height, float(standard[1])),
        shear_nm=Estimate(shear * width * size_nm[0], float(standard[2]) * width * size_nm[0]),
        cell=cell,
        shift=shift,
        sheared=sheared,
        distortion=_distortion((rows, columns), ways, across, along, shear * width * size_nm[0], shift),
    )


def _mean_cell(images: Sequence[Floats], expected: float | None) -> ImageCell:
    """Return the cell of the first image, with the mean of both directions, whose hysteresis is opposite."""
    cell = find_cell(images[0], images[1] if len(images) == 2 else None, expected)
    vectors, covariance = levelled_cell(images[0], cell)
    if len(images) == 1:
        return replace(cell, vectors=vectors, covariance=covariance)
    other = find_cell(images[1], images[0], expected)
    if not same_lattice(cell.vectors, other.vectors):
        raise Unphysical(
            "trace and retrace show different cells; are both of one scan? Choose another --channel, or give the "
            "sample's --lattice-nm"
        )
    change = np.kron(np.round(cell.vectors @ np.linalg.inv(other.vectors)), np.eye(2))
    second, spread = levelled_cell(images[1], other)
    second = (change @ second.ravel()).reshape(2, 2)
    mean, its_covariance = 0.5 * (vectors + second), 0.25 * (covariance + change @ spread @ change.T)
    return replace(cell, vectors=mean, covariance=its_covariance)


def _map(vectors: Floats, basis: Floats, kind: str) -> Floats:
    """Return width, height and shear per unit of x, y and y of the file, in constants of the lattice, shape (3,)."""
    angle = np.radians(IDEAL_ANGLES[kind])
    ideal = np.array([[1.0, 0.0], [np.cos(angle), np.sin(angle)]])
    to_sample = np.linalg.solve(basis @ vectors, ideal)  # up to a rotation
    lower = np.linalg.cholesky(to_sample @ to_sample.T)
    return np.array([lower[0, 0], lower[1, 1], lower[1, 0]])


def _factors(vectors: Floats, reading: _Reading, size_nm: tuple[float, float], constant_nm: float | None) -> Floats:
    """Return factors of width and height, and the shear as a share of the width after the map, shape (3,)."""
    width, height, shear = _map(vectors, reading.basis, reading.kind)
    scale = 1.0 / width if constant_nm is None else constant_nm
    return np.array([scale * width, scale * height, shear / width * size_nm[1] / size_nm[0]])


def _constant(vectors: Floats, reading: _Reading, size_nm: tuple[float, float]) -> float:
    """Return the constant of the lattice where the width of the file is right."""
    return 1.0 / float(_map(vectors, reading.basis, reading.kind)[0])


def _reading(vectors: Floats, size_nm: tuple[float, float], constant_nm: float | None, kind: str) -> _Reading:
    """Return the one plausible map. Raise an error if there is none, or more than one."""
    readings: dict[tuple[float, ...], _Reading] = {}
    for basis in _BASES:
        one = _Reading(kind, basis, 1.0, 1.0, 0.0)
        width, height, shear = _factors(vectors, one, size_nm, constant_nm).tolist()
        one = replace(one, width=width, height=height, shear=shear)
        readings.setdefault(tuple(round(value, 6) for value in (width, height, shear)), one)
    ranked = sorted(readings.values(), key=lambda one: one.strain)
    plausible = [one for one in ranked if one.plausible(constant_nm is not None)]
    if not plausible:
        raise ImplausibleMap(
            f"as a {kind} lattice the frame would be {_size(ranked[0], size_nm)}; a factor of {_MOST_SCALED[0]:g} of "
            f"the width, one of {_MOST_SCALED[1]:g} of the height and a shear of {100.0 * _MOST_SHEARED:.0f} % are "
            f"plausible; is the sample such a lattice (--lattice), and this its constant?"
        )
    if len(plausible) > 1:
        sizes = " or ".join(_size(one, size_nm) for one in plausible[:2])
        raise Unphysical(f"the affine map is ambiguous: the frame may be {sizes}; scan with less drift")
    return plausible[0]


def _size(one: _Reading, size_nm: tuple[float, float]) -> str:
    width, height = one.width * size_nm[0], one.height * size_nm[1]
    return f"{width:.4g} x {height:.4g} nm, sheared by {100.0 * one.shear:.2g} % of the width"


def _significant(width: float, height: float, shear: float, errors: Floats) -> bool:
    """Return True if aspect and shear are more than their errors make of them."""
    slope = np.array([[-1.0 / width, 1.0 / height, 0.0], [0.0, 0.0, 1.0]])
    values = np.array([np.log(height / width), shear])
    square = float(values @ np.linalg.solve(slope @ errors @ slope.T, values)) / len(values)
    return bool(square > 1.0 + _SUPPORTED * np.sqrt(2.0 / len(values)))


def _distortion(
    shape: tuple[int, int],
    ways: Sequence[bool],
    across: float,
    along: float,
    shear_nm: float,
    shift: DirectionShift | None,
) -> Distortion:
    """Return the distortion in nm with straight lines; trace and retrace are moved by half their shift each."""
    rows, columns = shape
    x_shift, y_shift = (0.0, 0.0) if shift is None else shift.pixels.tolist()
    sweeps: dict[bool, Sweep1D] = {}
    for way in ways:
        half = _HALF if way else -_HALF
        place = across * (np.arange(columns, dtype=np.float64) + _HALF + half * x_shift)
        sweeps[way] = Sweep1D(np.asarray(place, dtype=np.float64), np.full(columns, _HALF + half * y_shift))
    times = np.arange(rows + 1.0)
    drift = shear_nm * (times / rows - _HALF)
    return Distortion(rows, columns, sweeps.get(True), sweeps.get(False), along * times, drift)
