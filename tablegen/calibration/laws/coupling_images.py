"""Coupling of the axes from images of a lattice of known cell.

A tip whose axes move by u and v is at M (u, v) on the sample, with 1 on the diagonal of M, and x_per_y and y_per_x
beside it. An image at a scan angle shows two directions of the sample: that of its lines, which is the angle of
M R(angle) e1, and that of its columns, M R(angle) e2. They are known up to the direction in which the sample lies,
unless that is given. Lines are too short for drift; columns lean by drift over the speed of the slow motion. A slow
motion that is a ramp and no stair leans the lines by up to half a row: that is a parameter known within a quarter.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from math import log, radians

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.base.warnings import Remark, spoils
from tablegen.calibration.laws.coupling import MOST_COUPLING, CouplingFit, loose_remarks
from tablegen.fitting.estimate import Estimate
from tablegen.numerics.arrays import Floats

_MOST_STRAIN = log(1.6)  # of the image against the sample, as for ``tablegen lattice``
_CLEARLY = 0.1  # in the same measure: how much worse another reading of the cell has to be
_SAME = 1e-6  # of strain: maps_of_images of one cell by the symmetry of the lattice
_LEAST_SINGULAR = 0.05  # of the normalised design: parameters that measurements tell apart have more
_STEP = 1e-6  # of a numerical derivative
_ROUNDS = 20
_MOST_SCATTER = 3.0  # of the directions, in their standard errors
_RAMP, _RAMP_ERROR = 0.25, 0.25  # rows that the slow motion goes on in a trace: none on a stair, a half on a ramp
_PARAMETERS = ("direction", "x_per_y", "y_per_x", "size_ratio", "drift_x", "drift_y", "ramp")


@dataclass(frozen=True, eq=False)
class CouplingImage:
    """The cell of an image at a scan angle, counterclockwise from x.

    ``vectors`` has its sides as rows, shape (2, 2): x to the right and y upwards, in nm; ``covariance`` is that of
    a_x, a_y, b_x, b_y. ``down`` is true if the frame went down, ``row`` the height of a row over the length of a line,
    ``nm_per_s`` the speed of the slow motion where the file has it, ``sized`` true if the lengths are by the file, and
    false if a pixel was taken for a square of 1.
    """

    name: str
    angle_deg: float
    down: bool
    vectors: Floats
    covariance: Floats
    row: float
    nm_per_s: float | None
    sized: bool


def fit_coupling_images(images: Sequence[CouplingImage], cell: Floats, lies_deg: Estimate | None = None) -> CouplingFit:
    """Fit the coupling to images of one lattice, which was not turned between them.

    Parameters
    ----------
    cell
        Sides of the sample's cell as rows in nm, shape (2, 2).
    lies_deg
        Direction of its first side, counterclockwise from x, where it is known; the second one is on its left.

    Raises
    ------
    Unphysical
        If an image does not show this lattice, or the images do not determine a coupling.
    """
    maps_of_images = [_SampleMaps.of(image, cell, lies_deg is not None) for image in images]
    if lies_deg is None:
        lies = _turn_of(maps_of_images[0].maps[0]) - radians(images[0].angle_deg)
        maps = [one.turned(lies) for one in maps_of_images]
    else:
        known = radians(lies_deg.value)
        maps = [_rotation(known) @ one.turned(-known) for one in maps_of_images]
    data = np.array([_directions(image, one) for image, one in zip(images, maps, strict=True)])
    weights = [_weight(image, one) for image, one in zip(images, maps, strict=True)]
    error = None if lies_deg is None else max(radians(lies_deg.standard_error), 1e-6)
    model = _Model(images, data, weights, error)
    return model.fit()


@dataclass(frozen=True, eq=False)
class _SampleMaps:
    """All maps from an image to the sample that differ by the symmetry of the lattice, shape (maps, 2, 2)."""

    angle_deg: float
    maps: Floats

    @classmethod
    def of(cls, image: CouplingImage, cell: Floats, absolute: bool) -> "_SampleMaps":
        """Return the maps of the least strain.

        Raises
        ------
        Unphysical
            If none is small, or another one is as small.
        """
        inverse = np.linalg.inv(image.vectors.T)
        mirrored = cell * np.array([1.0, -1.0])
        maps, strains = [], []
        for numbers in product(range(-2, 3), repeat=4):
            change = np.array(numbers, dtype=np.float64).reshape(2, 2)
            if abs(round(float(np.linalg.det(change)))) != 1:
                continue
            for sides in (cell,) if absolute else (cell, mirrored):
                one = (change @ sides).T @ inverse
                if np.linalg.det(one) > 0.0:
                    maps.append(one)
                    strains.append(_strain(one, image.sized))
        least = min(strains)
        if least > _MOST_STRAIN:
            raise Unphysical(
                f"{image.name}: the cell differs from the sample's by a factor of {np.exp(least):.3g} in a direction; "
                "is this the sample, and the size of the file right?"
            )
        if any(least + _SAME < one < least + _CLEARLY for one in strains):
            raise Unphysical(
                f"{image.name}: the cell can be read in two ways that differ in shear; scan with less distortion"
            )
        same = [one for one, strain in zip(maps, strains, strict=True) if strain <= least + _SAME]
        return cls(image.angle_deg, np.array(same))

    def turned(self, lies: float) -> Floats:
        """Return the map that turns an image by its scan angle and ``lies`` more in radians."""
        off = [abs(_nearest(_turn_of(one) - radians(self.angle_deg) - lies)) for one in self.maps]
        return np.asarray(self.maps[int(np.argmin(off))])


def _strain(one: Floats, sized: bool) -> float:
    """Return by how much a map stretches, as a logarithm; of a file without size, in one direction over the other."""
    most, least = np.log(np.linalg.svd(one, compute_uv=False))
    return float(max(abs(most), abs(least)) if sized else most - least)


def _turn_of(one: Floats) -> float:
    """Return the rotation in a map, in radians."""
    return float(np.arctan2(one[1, 0] - one[0, 1], one[0, 0] + one[1, 1]))


def _rotation(angle: float) -> Floats:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s], [s, c]])


def _nearest(angle: float) -> float:
    """Return an angle in radians, from -pi to pi."""
    return float((angle + np.pi) % (2.0 * np.pi) - np.pi)


def _directions(image: CouplingImage, one: Floats) -> Floats:
    """Return the directions of lines and columns against the scan angle in radians, shape (2,)."""
    at = radians(image.angle_deg)
    x, y = one.T
    return np.array([_nearest(np.arctan2(x[1], x[0]) - at), _nearest(np.arctan2(y[1], y[0]) - at - 0.5 * np.pi)])


def _weight(image: CouplingImage, one: Floats) -> Floats:
    """Return the inverse of the square root of the covariance of the directions, shape (2, 2)."""
    sides = one @ image.vectors.T
    start, step = _directions(image, one), _STEP * float(np.abs(image.vectors).max())
    gradient = np.zeros((2, 4))
    for number in range(4):
        moved = image.vectors.ravel().copy()
        moved[number] += step
        other = _directions(image, sides @ np.linalg.inv(moved.reshape(2, 2).T))
        gradient[:, number] = [_nearest(angle) / step for angle in other - start]
    covariance = gradient @ image.covariance @ gradient.T
    values, vectors = np.linalg.eigh(covariance + 1e-16 * np.eye(2))
    return np.asarray(vectors.T / np.sqrt(values)[:, None])


class _Model:
    """Directions of lines and columns of all images, as functions of the parameters."""

    def __init__(
        self, images: Sequence[CouplingImage], data: Floats, weights: Sequence[Floats], lies_error: float | None
    ) -> None:
        self._images, self._weights, self._lies_error = images, weights, lies_error
        self._start = 0.0 if lies_error is not None else float(data[0, 0])
        self._data = np.array([[_nearest(angle - self._start) for angle in row] for row in data])
        speeds = [image.nm_per_s for image in images]
        self._first = np.array([*(0.0 for _ in _PARAMETERS[1:]), _RAMP])
        self._timed = all(speed is not None for speed in speeds)
        self._per_nm = [
            (-1.0 if image.down else 1.0) / (speed if self._timed and speed else 1.0)
            for image, speed in zip(images, speeds, strict=True)
        ]

    def fit(self) -> CouplingFit:
        """Fit as many of the parameters as the images tell apart."""
        free, remarks = self._choice()
        values = self._first.copy()
        for _ in range(_ROUNDS):
            design = self._design(values, free)
            step = np.linalg.lstsq(design, -self._misfit(values), rcond=None)[0]
            values[free] += step
            if np.max(np.abs(step)) < 1e-12:
                break
        misfit = self._misfit(values)
        spare = len(misfit) - len(free)
        scatter = float(np.sqrt(np.sum(misfit**2) / spare)) if spare else 1.0
        covariance = np.linalg.inv(design.T @ design) * max(scatter, 1.0) ** 2
        errors = np.zeros(len(_PARAMETERS))
        errors[free] = np.sqrt(np.diag(covariance))
        estimates = {
            name: Estimate(float(value), float(error))
            for name, value, error in zip(_PARAMETERS, values, errors, strict=True)
        }
        for name in ("x_per_y", "y_per_x"):
            if abs(values[_PARAMETERS.index(name)]) > MOST_COUPLING:
                raise Unphysical(f"{name} would be {estimates[name].value:.3g}; no scanner has more than 0.5")
        if scatter > _MOST_SCATTER:
            text = (
                f"the images differ by {scatter:.2g} standard errors from any coupling: the sample was turned between "
                "them, a scan angle has the other sign, or drift changed"
            )
            remarks.append(spoils(text, code="unlike-images"))
        drift = (estimates["drift_x"], estimates["drift_y"]) if {4, 5} & {*free} else None
        return CouplingFit(
            x_per_y=estimates["x_per_y"],
            y_per_x=estimates["y_per_x"],
            remarks=(*remarks, *loose_remarks(estimates["x_per_y"], estimates["y_per_x"])),
            directions_deg=np.degrees(self._data),
            fitted_deg=np.degrees(self._directions(values)),
            drift=drift,
            drift_unit="nm/s" if self._timed else "of the height of an image, over the image",
            size_ratio=estimates["size_ratio"] if 3 in free else None,
            shear_alone=self._lies_error is None,
        )

    def _choice(self) -> tuple[list[int], list[Remark]]:
        """Return the numbers of the parameters that the images tell apart, and what was assumed of the others."""
        base = [0, 1, 6] if self._lies_error is None else [0, 1, 2, 6]
        design = self._design(self._first, list(range(len(_PARAMETERS))))
        lengths = np.linalg.norm(design, axis=0)
        size = [3] if lengths[3] > 0.05 * lengths[1] else []
        unit = 1.0 / max(abs(one) for one in self._per_nm)
        drift = [at for at in (4, 5) if lengths[at] * unit > 0.05 * max(lengths[0], 1e-300)]
        for extra in (size + drift, drift, size, []):
            free = sorted({*base, *extra})
            unknown = free[:-1] if self._lies_error is None else free[1:-1]  # without what is known within an error
            if len(free) <= len(design) and _independent(design[:, unknown]):
                break
        else:
            raise Unphysical(
                "images at this scan angle show the sizes of the axes, and not their coupling; scan at 0 or 90 degrees"
            )
        remarks = []
        if self._lies_error is None:
            text = (
                "y_per_x is 0 by choice: an image cannot tell a rotation of both axes from a sample that lies at "
                "another angle, so lines along x are the reference, and x_per_y is the whole shear"
            )
            remarks.append(Remark(text, code="assumed-value"))
        if {*drift} - {*free}:
            remarks.append(Remark(self._drift_text(), code="assumed-value"))
        if {*size} - {*free}:
            text = "a scan angle between the axes shows their sizes as coupling: these were taken for right"
            remarks.append(Remark(text, code="assumed-value"))
        return free, remarks

    def _drift_text(self) -> str:
        image = self._images[0]
        amount = (
            "drift by 1 % of the height of the image would change it by 0.01"
            if image.nm_per_s is None
            else f"1 nm/s would change it by {1.0 / image.nm_per_s:.2g}"
        )
        text = f"drift along the lines looks like coupling, and was taken for 0: {amount}"
        return f"{text}. Image a frame that goes down too"

    def _design(self, values: Floats, free: Sequence[int]) -> Floats:
        """Return the weighted derivatives, shape (misfits, free)."""
        columns = []
        for at in free:
            step = np.zeros(len(_PARAMETERS))
            step[at] = _STEP / max(abs(one) for one in self._per_nm) if at in (4, 5) else _STEP
            columns.append((self._misfit(values + step) - self._misfit(values - step)) / (2.0 * step[at]))
        return np.array(columns).T

    def _misfit(self, values: Floats) -> Floats:
        """Return directions of the model less those of the images, in standard errors."""
        off = self._directions(values) - self._data
        parts = [weight @ row for weight, row in zip(self._weights, off, strict=True)]
        parts.append((values[6:] - _RAMP) / _RAMP_ERROR)
        if self._lies_error is not None:
            parts.append(values[:1] / self._lies_error)
        return np.concatenate(parts)

    def _directions(self, values: Floats) -> Floats:
        direction, x_per_y, y_per_x, ratio, *drift, ramp = values.tolist()
        moved = np.array([[1.0, x_per_y * (1.0 + ratio)], [y_per_x, 1.0 + ratio]])
        rows = []
        for image, per_nm in zip(self._images, self._per_nm, strict=True):
            one = moved @ _rotation(radians(image.angle_deg))
            one[:, 1] -= per_nm * np.array(drift)
            one[:, 0] += (-1.0 if image.down else 1.0) * ramp * image.row * one[:, 1]
            rows.append(direction + _directions(image, one))
        return np.array(rows)


def _independent(design: Floats) -> bool:
    lengths = np.linalg.norm(design, axis=0)
    if not np.all(lengths > 0.0):
        return False
    return float(np.linalg.svd(design / lengths, compute_uv=False)[-1]) > _LEAST_SINGULAR
