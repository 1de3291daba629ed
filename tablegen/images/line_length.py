"""Length of the line of an image, from a lattice or a grating of known constant.

A lattice determines it by itself: base waves of q_j periods in the line are those of a cell with the direct vectors a_j
where

    L^2 = sum over i, j of q_i q_j a_i . a_j

whatever its direction. Drift from line to line, and a slow axis of another size or shear, change s and not q. One
wave, of a grating, gives L = q pitch / cos(angle); the angle comes from the rows, whose length has to be known about.
"""

from dataclasses import dataclass, replace
from itertools import product
from math import atan, cos, hypot, isnan, log, nan, radians, sin, sqrt, tan
from typing import Protocol

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.fitting.estimate import Estimate, LineSize
from tablegen.images.periodic_model import FitState, Geometry, PeriodicModel
from tablegen.numerics.arrays import Floats

ASPECT_ERROR = 0.1  # standard error of a frame's height over its width, where it follows from the pixels alone
DRIFT_ERROR = 0.02  # share of the line, in a frame: drift along x that one wave cannot tell from its angle
_MAX_ANGLE = 40.0  # degrees of a grating whose angle is not given
_MAX_ANGLE_OFF = 12.0  # degrees between a given angle and what the rows show
_ASPECT_SPREAD, _SHEAR_SPREAD = 0.15, 0.1  # distortions of a lattice by the slow axis and by drift
_MAX_STRAIN = 3.0  # in units of both spreads
_CLEARLY = 1.5  # in the same units: how much worse another reading of the waves has to be
_SAME_SIZE = 0.01  # share: readings that differ by less are one
_LARGEST_INDEX = 2
_SUPERCELLS = (2, 3)
_MIN_PART = 0.05  # share of the strongest amplitude: least wave between the others that counts
_FAINT_PART = 0.02  # share of the strongest amplitude: a wave between the others that may be of a larger cell
_MIN_PART_ERRORS = 8.0


@dataclass(frozen=True)
class Cell:
    """A lattice's direct cell: sides in nm, the angle between them in degrees."""

    a_nm: float
    b_nm: float
    gamma_deg: float
    name: str

    @classmethod
    def hexagonal(cls, constant_nm: float) -> "Cell":
        """Return a cell with sides of one length under 120 degrees."""
        return cls(constant_nm, constant_nm, 120.0, "hexagonal")

    @classmethod
    def square(cls, constant_nm: float) -> "Cell":
        """Return a cell with sides of one length under 90 degrees."""
        return cls(constant_nm, constant_nm, 90.0, "square")

    @property
    def vectors(self) -> Floats:
        """Direct vectors of the cell.

        Returns
        -------
        Floats
            A row for each side, in nm, shape (2, 2).
        """
        g = radians(self.gamma_deg)
        return np.array([[self.a_nm, 0.0], [self.b_nm * cos(g), self.b_nm * sin(g)]])


@dataclass(frozen=True)
class Grating:
    """Bars ``pitch_nm`` apart; the angle of their normal from the fast axis, with its standard error, where known."""

    pitch_nm: float
    angle_deg: Estimate | None = None


class ImagedWaves(Protocol):
    """A fitted image of a periodic sample, as far as a size needs it; see ``ImageLine``."""

    @property
    def geometry(self) -> Geometry:
        """Rows, columns and timing of the image."""

    @property
    def model(self) -> PeriodicModel:
        """The model that was fitted."""

    @property
    def state(self) -> FitState:
        """The model at the fitted parameters."""

    @property
    def indexed(self) -> bool:
        """True if the base waves are those of the indexer's cell."""

    @property
    def waves(self) -> Floats:
        """Base waves of the image.

        Returns
        -------
        Floats
            q and s, periods in the line and in the frame, shape (bases, 2).
        """

    @property
    def waves_covariance(self) -> Floats:
        """Covariance of q_1, s_1, q_2, s_2.

        Returns
        -------
        Floats
            In squared periods, shape (2 bases, 2 bases).
        """

    @property
    def amplitudes(self) -> Floats:
        """Amplitudes of the spots, for heights of unit variance.

        Returns
        -------
        Floats
            Magnitudes, dimensionless, shape (spots,).
        """


def size_of_line(
    line: ImagedWaves, cell: Cell | None, grating: Grating | None, aspect: float | None = None
) -> LineSize:
    """Return the size of a line by what the image shows: two base waves are the lattice, one is the grating.

    ``aspect`` decides between readings of a lattice that differ in size by a tenth and more, and gives the angle of a
    grating. Where it is not given, pixels or the frame may be square.

    Parameters
    ----------
    aspect
        The frame's height over the line's length; its standard error is 10 %.

    Raises
    ------
    Unphysical
        If no reading fits, or several do that differ without ``aspect``.
    """
    if aspect is not None:
        return _size(line, cell, grating, aspect / line.geometry.part.times)
    span = line.geometry.window[1] - line.geometry.window[0]
    size = _size(line, cell, grating, line.geometry.rows * span / line.geometry.columns)
    if round(line.geometry.rows * line.geometry.part.times) == line.geometry.columns:
        return size
    try:
        other = _size(line, cell, grating, span / line.geometry.part.times)
    except Unphysical:
        return size
    differs = abs(other.nm.value / size.nm.value - 1.0)
    if differs > _SAME_SIZE:
        raise Unphysical(
            f"the line is {size.nm.value:.4g} nm long if pixels are square, and {other.nm.value:.4g} nm if the frame "
            f"is; say how high it is with --aspect"
        )
    return replace(size, shared=hypot(size.shared, differs if isnan(size.aspect) else 0.0))


def _size(line: ImagedWaves, cell: Cell | None, grating: Grating | None, expected: float) -> LineSize:
    waves, covariance = line.waves, line.waves_covariance
    if len(waves) == 2:
        if cell is None:
            raise Unphysical(
                "two waves are in the image, as of a lattice; its constant is needed, and not that of bars"
            )
        if not line.indexed:  # the indexer has judged all spots
            waves, covariance = _primitive(line, waves, covariance)
            if np.array_equal(waves, line.waves):
                _check_faint_parts(line)
        return _of_lattice(waves, covariance, cell, expected)
    if grating is None:
        raise Unphysical(
            "one wave is in the image, as of bars; a lattice shows two: is it that sample, and is its contrast enough?"
        )
    _check_whole_period(line)
    return _of_grating(waves[0], covariance, grating, expected)


def _of_grating(wave: Floats, covariance: Floats, grating: Grating, aspect: float) -> LineSize:
    q, s = float(wave[0]), float(wave[1])
    row_angle = atan(s / (aspect * q))
    if grating.angle_deg is not None:
        angle, error = radians(grating.angle_deg.value), radians(grating.angle_deg.standard_error)
        if abs(abs(angle) - abs(row_angle)) > radians(_MAX_ANGLE_OFF):
            raise Unphysical(
                f"the rows show bars under {np.degrees(abs(row_angle)):.3g} degrees, and {abs(np.degrees(angle)):.3g} "
                f"were given; is the frame as high as its pixels say (--aspect)?"
            )
        own, shared = 0.0, abs(tan(angle)) * error
    else:
        angle = row_angle
        if abs(angle) > radians(_MAX_ANGLE):
            raise Unphysical(
                f"the bars are turned by {np.degrees(abs(angle)):.3g} degrees; turn the sample to have the lines cross "
                f"them, or give --angle-deg"
            )
        own = abs(tan(angle)) * cos(angle) ** 2 * DRIFT_ERROR / aspect
        shared = sin(angle) ** 2 * ASPECT_ERROR
    size = q * grating.pitch_nm / cos(angle)
    error = size * hypot(sqrt(covariance[0, 0]) / q, own)
    return LineSize(Estimate(size, error), shared, float(np.degrees(angle)), nan, nan)


def _of_lattice(waves: Floats, covariance: Floats, cell: Cell, aspect: float) -> LineSize:
    """Return the reading of the waves, as whole numbers of the cell's, with the least strain across the rows."""
    direct = cell.vectors
    reciprocal = np.linalg.inv(direct).T
    readings: list[tuple[float, LineSize]] = []
    indices = range(-_LARGEST_INDEX, _LARGEST_INDEX + 1)
    for first, second in product(product(indices, indices), repeat=2):
        if abs(first[0] * second[1] - first[1] * second[0]) != 1:
            continue
        inverse = np.linalg.inv(np.array([first, second], dtype=np.float64))
        q, s = inverse @ waves[:, 0], inverse @ waves[:, 1]
        way = q @ direct  # the line as a vector in the crystal's frame
        size = float(np.hypot(*way))
        along = way / size
        across = np.array([-along[1], along[0]])
        matrix = np.stack([reciprocal @ across, reciprocal @ along], axis=1)
        height, drift = np.linalg.solve(matrix, s).tolist()
        if not height:
            continue
        strain = hypot(log(abs(height) / size / aspect) / _ASPECT_SPREAD, drift / size / _SHEAR_SPREAD)
        gradient = inverse.T @ (direct @ along)
        error = sqrt(float(gradient @ covariance[::2, ::2] @ gradient))
        angle = _turned(-float(np.degrees(np.arctan2(along[1], along[0]))), cell)
        readings.append((strain, LineSize(Estimate(size, error), 0.0, angle, abs(height) / size, drift / size)))
    strain, best = min(readings, key=lambda one: one[0])
    if strain > _MAX_STRAIN:
        raise Unphysical(
            f"the waves in the image are not those of a {cell.name} lattice, unless the frame is {best.aspect:.3g} "
            f"times as high as its lines are long and drifts by {100.0 * best.drift:.2g} % of them; is --aspect right, "
            f"which is {aspect:.3g} now, and the kind of lattice?"
        )
    others = [one for score, one in readings if score < strain + _CLEARLY]
    farthest = max(others, key=lambda one: abs(one.nm.value - best.nm.value))
    if abs(farthest.nm.value / best.nm.value - 1.0) > _SAME_SIZE:
        raise Unphysical(
            f"the line may be {best.nm.value:.4g} nm long in a frame {best.aspect:.3g} times as high, or "
            f"{farthest.nm.value:.4g} nm in one {farthest.aspect:.3g} times as high; say how high it is with --aspect"
        )
    return best


def _turned(angle_deg: float, cell: Cell) -> float:
    """Return the least angle by which the same lattice is turned."""
    same = {"hexagonal": 60.0, "square": 90.0}.get(cell.name, 180.0)
    return (angle_deg + 0.5 * same) % same - 0.5 * same


def _check_whole_period(line: ImagedWaves) -> None:
    """Raise ``Unphysical`` unless the wave is the grating's first harmonic."""
    for part in _SUPERCELLS:
        strongest = _strongest_part(line, part)
        if strongest is not None:
            raise Unphysical(
                f"there are waves between the harmonics of the strongest one, at parts of {part}: the bars differ, or "
                f"the sample has two periods; scan a simpler part of it"
            )


def _primitive(line: ImagedWaves, waves: Floats, covariance: Floats) -> tuple[Floats, Floats]:
    """Return base waves of all visible waves, where halves or thirds of the fitted ones are among them."""
    for part in _SUPERCELLS:
        between = _strongest_part(line, part)
        if between is None:
            continue
        # Find two base waves of which both base waves and this one are whole multiples.
        for change in product(range(-part, part + 1), repeat=4):
            basis = np.array(change, dtype=np.float64).reshape(2, 2) / part
            determinant = float(np.linalg.det(basis))
            if abs(abs(determinant) - 1.0 / part) > 1e-9:
                continue
            whole = np.linalg.solve(basis.T, np.stack([np.array(between) / part, [1.0, 0.0], [0.0, 1.0]], axis=1))
            if np.allclose(whole, np.round(whole)):
                both = np.kron(basis, np.eye(2))
                return basis @ waves, both @ covariance @ both.T
    return waves, covariance


def _check_faint_parts(line: ImagedWaves) -> None:
    """Raise ``Unphysical`` if a weak wave between those of whole numbers may be one of a larger cell."""
    for part in _SUPERCELLS:
        if _strongest_part(line, part, _FAINT_PART) is not None:
            raise Unphysical(
                f"a weak wave at parts of {part} of the strong ones may be that of a larger cell, and the size of the "
                f"line would be another with each; image more periods with less noise, or choose another --channel"
            )


def _strongest_part(line: ImagedWaves, part: int, share: float = _MIN_PART) -> tuple[int, ...] | None:
    """Return the strongest wave between those of whole numbers, in parts of the base waves; None if none counts."""
    model, state = line.model, line.state
    span = line.geometry.window[1] - line.geometry.window[0]
    reach = range(-2 * part, 2 * part + 1)
    waves = np.stack([model.q(state.parameters), model.s(state.parameters)[:, 0]], axis=1) / part
    spots = []
    for spot in product(reach, repeat=model.bases):
        q, s = np.array(spot) @ waves
        leading = next((n for n in spot if n), 0)
        if leading <= 0 or all(n % part == 0 for n in spot):
            continue
        if (
            hypot(q * span, s) > 1.2
            and abs(q) * span < 0.45 * line.geometry.columns
            and abs(s) < 0.45 * line.geometry.rows
        ):
            spots.append(spot)
    if not spots:
        return None
    finer, at = model.divided(state, part)
    strength = finer.strengths(at, np.array(spots))
    best = int(np.argmax(strength))
    pixels = line.geometry.lines * line.geometry.columns * len(model.images)
    noise = sqrt(2.0 * state.cost / pixels) * sqrt(2.0 * len(model.images) / pixels)
    least = max(share * float(np.max(line.amplitudes)), _MIN_PART_ERRORS * noise)
    return tuple(spots[best]) if strength[best] > least else None
