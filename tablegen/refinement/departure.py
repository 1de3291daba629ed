"""Residual and scaling error of a measured line against the requested one, inside the imaged windows.

Origin and size are those of the best straight line through the imaged windows of all directions. The turning points
are left out: the turnarounds are free, and their errors would tilt the whole line.
"""

from dataclasses import dataclass

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.certificate.line_errors import CHORD
from tablegen.numerics.arrays import Floats
from tablegen.planning.line_plan import LinePlan
from tablegen.refinement.measured import LineMeasurement

_WINDOW_POINTS = 801  # points over the window of a direction
_MAX_DEPARTURE = 0.1  # share of the line; more means another scan or another phase


@dataclass(frozen=True, eq=False)
class Imaged:
    """Points of the imaged windows, forward, then backward where that direction images too; each array (points,).

    ``times`` in periods, ``position`` on the line, 0..1, ``requested`` the position of the model there, and
    ``steepness`` of the model's branch, du/dtau, at that position.
    """

    sides: tuple[str, ...]
    times: Floats
    position: Floats
    requested: Floats
    steepness: Floats

    def by_side(self, values: Floats) -> dict[str, Floats]:
        """Split values at the points by direction.

        Parameters
        ----------
        values
            Values, shape (points,).

        Returns
        -------
        By direction, values of shape (points / directions,).
        """
        return dict(zip(self.sides, np.split(values, len(self.sides)), strict=True))


def imaged(line: LinePlan, share: Floats, forward_only: bool = False) -> Imaged:
    """Return the points of the imaged windows.

    Parameters
    ----------
    share
        Shares 0..1 of the window, shape (n,).
    forward_only
        True to leave out the window of the way back, where the scan has one.

    Returns
    -------
    Points, n per direction.
    """
    (low, high), turn, shape = line.band_limit.window, line.drive.turn, line.drive.shape
    x = low + (high - low) * share
    sides: tuple[str, ...] = ("forward",)
    times = turn * x
    if line.band_limit.directions == "both" and not forward_only:
        sides, times = ("forward", "backward"), np.concatenate([times, turn + (1.0 - turn) * (1.0 - x)])
    w = np.split(line.described.value(times), len(sides))
    requested, steepness = [shape.forward.inverse(w[0])], [shape.forward.slope(shape.forward.inverse(w[0]))]
    if len(sides) > 1:
        sweep = shape.backward.inverse(1.0 - w[1])
        requested.append(1.0 - sweep)
        steepness.append(shape.backward.slope(sweep))
    return Imaged(sides, times, np.tile(x, len(sides)), np.concatenate(requested), np.concatenate(steepness))


def requested_position(line: LinePlan, times: Floats) -> Floats:
    """Return the position that the model requests, in the turnarounds too.

    Parameters
    ----------
    times
        Times in periods, 0..1, shape (times,).

    Returns
    -------
    Positions as shares of the line, shape (times,).
    """
    shape = line.drive.shape
    w = line.described.value(times)
    return np.where(times <= shape.turn, shape.forward.inverse(w), 1.0 - shape.backward.inverse(1.0 - w))


@dataclass(frozen=True, eq=False)
class Departure:
    """Departure of the reached line from the requested one.

    ``error`` is reached less requested at the points, in lines, (points,); ``size_nm`` is that of the best line,
    negative where the sensor counts the other way.
    """

    points: Imaged
    error: Floats
    size_nm: float

    @property
    def rms_percent(self) -> float:
        """Residual of all directions, in percent of the line."""
        return 100.0 * float(np.sqrt(np.mean(self.error**2)))

    @property
    def residual_percent(self) -> dict[str, tuple[float, float]]:
        """Rms and largest residual of each direction, in percent of the line."""
        sides = self.points.by_side(100.0 * self.error)
        return {side: (float(np.sqrt(np.mean(e**2))), float(np.max(np.abs(e)))) for side, e in sides.items()}

    @property
    def scaling_percent(self) -> dict[str, float]:
        """Scaling error of each direction, peak to peak, by chords of 1/20 of the line like the paper's lattices."""
        scaling = {}
        reached = self.points.by_side(self.points.requested + self.error)
        for side, x in self.points.by_side(self.points.position).items():
            k = min(max(round(CHORD / float(x[1] - x[0])), 1), len(x) - 2)
            slope = (reached[side][k:] - reached[side][:-k]) / (x[k:] - x[:-k])
            middle = 0.5 * (x[k:] + x[:-k])
            scaling[side] = 100.0 * float(np.ptp(slope)) / float(np.interp(0.5, middle, slope))
        return scaling

    def with_drive_change(self, by: Floats) -> "Departure":
        """Return the departure after a change of the drive, by the model's slope.

        Parameters
        ----------
        by
            Change of the normalised drive at each point, shape (points,).
        """
        return _straightened(self.points, self.points.requested + self.error + by / self.points.steepness, self.size_nm)


def departure(line: LinePlan, measured: LineMeasurement, share: Floats | None = None) -> Departure:
    """Compare a measured period with the request of the plan, in the directions that were measured.

    Parameters
    ----------
    share
        Shares 0..1 of the window, shape (n,); evenly spread if None.

    Raises
    ------
    Unphysical
        If the measured line is not that of the scan.
    """
    share = np.linspace(0.0, 1.0, _WINDOW_POINTS) if share is None else share
    points = imaged(line, share, measured.forward_only)
    best = _straightened(points, measured.value(points.times), 1.0)
    if not abs(best.size_nm) > 0.0 or best.rms_percent > 100.0 * _MAX_DEPARTURE:
        raise Unphysical(
            f"the displacement is {best.rms_percent:.3g} % of the line away from this scan; is it another axis, "
            f"or is time 0 no line start?"
        )
    return best


def _straightened(points: Imaged, reached: Floats, unit_nm: float) -> Departure:
    origin, size = straight_line(points.requested) @ reached
    if size == 0.0:
        return Departure(points, np.full_like(reached, np.inf), 0.0)
    return Departure(points, (reached - origin) / size - points.requested, float(size) * unit_nm)


def straight_line(requested: Floats) -> Floats:
    """Return the matrix from values to the origin and the size of their best line.

    Parameters
    ----------
    requested
        Requested positions, shape (points,).

    Returns
    -------
    Matrix, shape (2, points).
    """
    matrix: Floats = np.linalg.pinv(np.column_stack([np.ones_like(requested), requested]))
    return matrix
