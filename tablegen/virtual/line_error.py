"""Errors of a line in the paper's measures: residual and scaling error.

Residual: displacement less the ideal line, in percent of the line. Scaling error: relative deviation of the local
slope from that at x = 0.5, in percent, above 0 where the image is stretched; slopes are those of chords of 1/20 of the
line that lie inside the window.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tablegen.certificate.line_errors import CHORD
from tablegen.numerics.arrays import Floats

POINTS = 1001  # points over the whole line


@dataclass(frozen=True, eq=False)
class BranchError:
    """The errors of one direction; arrays run with the position x, 0 at the left end for both directions.

    ``residual`` stands at ``position``, shape (1001,) each; ``scaling`` at ``scaling_position``; both in percent.
    ``scaling`` is NaN where the axis rests at x = 0.5, as in the middle of a long step.
    """

    position: Floats
    residual: Floats
    scaling_position: Floats
    scaling: Floats
    window: tuple[float, float]

    @property
    def peak(self) -> tuple[float, float]:
        """The residual of the largest magnitude inside the window, with its sign, and its position."""
        inside = self._inside()
        i = int(np.argmax(np.abs(self.residual[inside])))
        return float(self.residual[inside][i]), float(self.position[inside][i])

    @property
    def residual_range(self) -> tuple[float, float]:
        """Lowest and highest residual inside the window."""
        inside = self.residual[self._inside()]
        return float(np.min(inside)), float(np.max(inside))

    @property
    def scaling_peak_to_peak(self) -> float:
        """Peak to peak of the scaling error inside the window."""
        return float(np.max(self.scaling) - np.min(self.scaling))

    def _inside(self) -> np.typing.NDArray[np.bool_]:
        low, high = self.window
        return (self.position >= low - 1e-9) & (self.position <= high + 1e-9)


@dataclass(frozen=True, eq=False)
class LineError:
    """The errors of both directions, and the size in nm of the ideal line."""

    size_nm: float
    forward: BranchError
    backward: BranchError


def about_window_line(error: LineError, directions: Sequence[str] = ("forward", "backward")) -> LineError:
    """Return the error about the straight line that fits the imaged windows of all ``directions`` best.

    Where turnarounds are rounded, the ends of the line are not imaged and need not be where the ends of a straight line
    would be. What an image shows is the departure from this line, and its slope is the size of the image.
    """
    imaged: list[BranchError] = [getattr(error, side) for side in directions]
    inside = [branch._inside() for branch in imaged]
    x = np.concatenate([branch.position[part] for branch, part in zip(imaged, inside, strict=True)])
    y = np.concatenate([branch.residual[part] for branch, part in zip(imaged, inside, strict=True)])
    slope, offset = np.polyfit(x, y, 1)
    grown = 1.0 + 0.01 * slope

    def branch(one: BranchError) -> BranchError:
        return replace(one, residual=(one.residual - offset - slope * one.position) / grown)

    return LineError(error.size_nm * grown, branch(error.forward), branch(error.backward))


def ideal_triangle(ticks: int, turn: float, first: float = 0.0) -> Floats:
    """Return the ideal position at every tick of a period, (14).

    Parameters
    ----------
    ticks
        Ticks per period.
    turn
        Share of the period in which the line rises.
    first
        Time of the first value, in ticks.

    Returns
    -------
    Positions of 0..1, shape (ticks,).
    """
    t = (np.arange(ticks) + first) / ticks
    return np.where(t <= turn, t / turn, (1.0 - t) / (1.0 - turn))


def line_error(
    displacement_nm: Floats,
    turn: float,
    window: tuple[float, float] = (0.1, 0.9),
    ideal: Floats | None = None,
    first: float = 0.0,
) -> LineError:
    """Compare one period of a settled displacement with the ideal line.

    The displacement's extremes are taken for those of ``ideal``: those of a triangle are the line's ends.

    Parameters
    ----------
    displacement_nm
        One period, shape (ticks,).
    turn
        Share of the period in which the line rises.
    window
        Part of the line on which the scaling error is computed.
    ideal
        Requested position at every tick, 0..1, rounded where the line turns, shape (ticks,); the triangle if None.
    first
        Time of the first value, in ticks: 0 for a drive that has value k at time k, 0.5 for one that is held from
        there on.

    Raises
    ------
    ValueError
        If the displacement is constant.
    """
    ticks = len(displacement_nm)
    intended = ideal_triangle(ticks, turn, first) if ideal is None else ideal
    low, high = float(np.min(displacement_nm)), float(np.max(displacement_nm))
    size = (high - low) / (float(np.max(intended)) - float(np.min(intended)))
    if not size > 0.0:
        raise ValueError("the displacement does not move")
    reached = (displacement_nm - low) / size + float(np.min(intended))
    x = np.linspace(0.0, 1.0, POINTS)
    times = (np.arange(ticks) + first) / ticks

    def branch(at: Floats) -> BranchError:
        y = np.interp(at, times, reached, period=1.0)
        first, last = (int(np.searchsorted(x, edge + way)) for edge, way in zip(window, (-1e-9, 1e-9), strict=True))
        baseline = min(round(CHORD * (POINTS - 1)), last - first - 1)
        slope = (y[first + baseline : last] - y[first : last - baseline]) / (baseline / (POINTS - 1))
        middle = 0.5 * (x[first + baseline : last] + x[first : last - baseline])
        reference = float(np.interp(0.5, middle, slope))
        # A y of few steps rests between two of them: there is no slope that others could be relative to.
        scaling = np.full(len(slope), np.nan) if reference == 0.0 else 100.0 * (1.0 - slope / reference)
        return BranchError(x, 100.0 * (y - x), middle, scaling, window)

    return LineError(size, branch(turn * x), branch(turn + (1.0 - turn) * (1.0 - x)))
