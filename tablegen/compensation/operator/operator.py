"""The operator: a hysteresis family, the measured residual over it, the size at every offset, and creep."""

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from math import sqrt

import numpy as np
from msgspec import structs

from tablegen.base.input_errors import Unphysical
from tablegen.compensation.dynamics import Measured, Response
from tablegen.compensation.identification import MeasuredLine
from tablegen.compensation.operator.bias_memory import BiasMemory
from tablegen.compensation.operator.creep import SEVERAL_RATES, LogarithmicCreep
from tablegen.compensation.operator.family import Family
from tablegen.compensation.operator.field import Field
from tablegen.compensation.operator.loop import POINTS, Loop
from tablegen.compensation.operator.sweep_loss import SweepLoss
from tablegen.numerics.arrays import Floats, tree_sum
from tablegen.numerics.elementary import log10

SMALL_STROKE = 0.1  # of v_max: the size of the scans from which m of (1) is taken to come
STROKE_REACH = 0.05  # of v_max: an operator serves strokes this far beyond the largest that was measured
CENTRE_REACH = 0.4  # of v_max: and centres this far from any that was measured
_MOST_MISFIT = 1.5e-3  # rms of the lines' residuals; 7e-4 and less where a family fits, 3.6e-3 for Duhem's piezo
_INSIDE = np.linspace(-0.8, 0.8, 81)  # -1 and 1 are the turns
END_POINTS = 48  # of a branch at either end
LEAST_SLOPE = 0.05  # of a straight line's; below it a branch nearly stands still, and cannot be inverted


@dataclass(frozen=True, eq=False)
class Operator:
    """The settled lines of one axis: a Gaussian-process residual over a parametric hysteresis model, and creep.

    ``residual`` has rows of 2 K + 2 Chebyshev coefficients, those of the rising branch first: measured less family, of
    positions from 0 to 1. ``size`` has one column: the measured extent over ``expected_extent``, less 1. ``centre`` is
    the one at which most lines were measured, of v_max. ``bias_memory`` is None where it was not measured; ``sweep`` is
    what the axis' measured response contains of hysteresis and creep. ``misfit_percent`` is what the fit to records in
    time leaves beyond the noise, of their widest stroke; None where settled lines were fitted.
    """

    family: Family
    residual: Field
    size: Field
    creep: LogarithmicCreep
    centre: float
    lines: tuple[MeasuredLine, ...]
    bias_memory: BiasMemory | None = None
    sweep: SweepLoss | None = None
    misfit_percent: float | None = None

    @property
    def knows_rates(self) -> bool:
        """True if the creep says what the rate does to the size.

        It does beside a family that describes the lines, and where they have several rates; else it is less certain
        than (23).
        """
        rates = [line.rate_hz for line in self.lines]
        several = max(rates, default=1.0) >= SEVERAL_RATES * min(rates, default=1.0)
        return self.creep.loss_per_decade > 0.0 and (several or self._family_serves)

    @cached_property
    def _family_serves(self) -> bool:
        """True if the residuals of the lines are small: their median rms about the best common line."""
        if not self.family.has_hysteresis:
            return False
        rows = np.array([self.residual.at(line.stroke, line.centre) for line in self.lines])
        half = rows.shape[-1] // 2 if len(rows) else 0
        left = [_rms(chebyshev(row[:half], _INSIDE), chebyshev(row[half:], _INSIDE)) for row in rows]
        return float(np.median(left)) < _MOST_MISFIT if left else True

    def at_rate(self, rate_hz: float) -> "Operator":
        """Return the operator whose plays and fields are those of lines of a rate.

        Plays go on growing up to a decade beyond the measured rates.
        """
        if not (self.residual.lengths.rate_share or self.family.plays.growth):
            return self
        measured = [line.rate_hz for line in self.lines] or [rate_hz]
        near = min(max(rate_hz, 0.1 * min(measured)), 10.0 * max(measured))
        family = self.family.at_decades(log10(near / self.creep.reference_hz))
        return replace(self, family=family, residual=self.residual.at_rate(near), size=self.size.at_rate(near))

    def dynamics(self, response: Response | None) -> Response | None:
        """Return the dynamics behind the operator: a measured response without what the operator has itself."""
        return self.sweep.without(response) if self.sweep and isinstance(response, Measured) else response

    def loop(self, low: float, high: float, factor: float = 1.0, mean: float | None = None) -> Loop:
        """Return the settled loop between two normalised drives, of a drive with a ``mean``; default: their middle.

        ``factor`` is m of (1) at the mean over that at ``self.centre``. The size is that of a triangle about the mean,
        to which (1) refers; where the middle between the turns is another one, the loop is larger by its own bend.

        Raises
        ------
        Unphysical
            If a branch would stand still or run backwards.
        """
        shape = self._shape(low, high)
        stroke, centre = high - low, 0.5 * (low + high)
        mean = centre if mean is None else mean
        extent = self.expected_extent(stroke, mean, factor) * (1.0 + float(self.size.at(stroke, mean)[0]))
        loop = structs.replace(shape, extent_nm=extent * (1.0 + shape.grown(mean)))
        self._check_slope(loop)
        return loop

    def shape(self, low: float, high: float) -> Loop:
        """Return ``loop`` without its size: its extent is 1 nm.

        Raises
        ------
        Unphysical
            If a branch would stand still or run backwards.
        """
        shape = self._shape(low, high)
        self._check_slope(shape)
        return shape

    def _shape(self, low: float, high: float) -> Loop:
        rising, falling = _branches(self.family, low, high)
        row = self.residual.at(high - low, 0.5 * (low + high))
        half = len(row) // 2
        of_rising, of_falling = chebyshev(row.reshape(2, half).T[:, :, None], 2.0 * GRID - 1.0)
        rising, falling = rising + of_rising, falling + of_falling
        rising, falling = _closed(rising, falling)
        return Loop(low, high, _monotonic_ends(rising), _monotonic_ends(falling), 1.0)

    def _check_slope(self, loop: Loop) -> None:
        if not loop.least_slope > 0.5 * LEAST_SLOPE:
            stroke, centre = loop.high - loop.low, 0.5 * (loop.low + loop.high)
            raise Unphysical(
                f"at a stroke of {stroke:.3g} and a centre of {centre:.3g} of v_max the operator's branches run "
                f"{'backwards' if loop.least_slope < 0.0 else 'nearly flat'}; measure a trace there"
            )

    def expected_extent(self, stroke: float, centre: float, factor: float) -> float:
        """Return the nm between the turns, by the family and the offset law, without the field of sizes."""
        return self.family.extent(stroke, centre) * self.sensitivity(centre, factor)

    def sensitivity(self, centre: float, factor: float) -> float:
        """Return the part of the sensitivity at a mean of the drive that the family has not, at a small stroke."""
        at_main, here = (self.family.extent(SMALL_STROKE, at) for at in (self.centre, centre))
        return at_main / (here * factor)

    def distance(self, stroke: float, centre: float) -> float:
        """Return how far a line is from the nearest measured one, in shares of v_max."""
        return min(max(abs(stroke - line.stroke), abs(centre - line.centre)) for line in self.lines)

    @property
    def nm_per_drive(self) -> float:
        """The approximate travel of the axis in nm for the whole of v_max: a first guess of amplitudes."""
        return self.family.extent(SMALL_STROKE, self.centre) / SMALL_STROKE


GRID = np.arange(POINTS) / (POINTS - 1)


@lru_cache(maxsize=512)  # while lengths are chosen, the same loops come again and again
def _branches(family: Family, low: float, high: float) -> tuple[Floats, Floats]:
    """Return both branches of the family from 0 to 1."""
    u = low + (high - low) * GRID
    rising, falling = family.branches(u, low, high)
    extent = float(rising[-1] - rising[0])
    return (rising - rising[0]) / extent, (falling - rising[0]) / extent


def _rms(rising: Floats, falling: Floats) -> float:
    """Return the rms of two branches at ``_INSIDE`` about their best common line."""
    middle = 0.5 * (rising + falling)
    slope = float(tree_sum(middle * _INSIDE)) / float(tree_sum(_INSIDE * _INSIDE))
    line = float(tree_sum(middle)) / len(middle) + slope * _INSIDE
    square = float(tree_sum((rising - line) ** 2 + (falling - line) ** 2))
    return sqrt(square / (2.0 * len(middle)))


def _closed(rising: Floats, falling: Floats) -> tuple[Floats, Floats]:
    """Return both branches from 0 to 1: they meet where the drive turns, since a settled loop is closed."""
    low, high = 0.5 * (rising[0] + falling[0]), 0.5 * (rising[-1] + falling[-1])
    return (rising - low) / (high - low), (falling - low) / (high - low)


def _monotonic_ends(branch: Floats) -> Floats:
    """Return the branch with its outermost parts, which are not imaged, no flatter than ``LEAST_SLOPE``.

    The series of the residual follows the noise there.
    """
    out = branch.copy()
    step = LEAST_SLOPE / (POINTS - 1)
    ends = END_POINTS
    if (out[:ends] <= out[1 : ends + 1] - step).all() and (out[-ends:] >= out[-ends - 1 : -1] + step).all():
        return out  # nothing of it is flatter
    for i in range(END_POINTS, 0, -1):
        out[i - 1] = min(out[i - 1], out[i] - step)
        out[-i] = max(out[-i], out[-i - 1] + step)
    return out


def chebyshev(coefficients: Floats, x: Floats) -> Floats:
    """Return sum_k c_k T_k(x), by Clenshaw's recurrence.

    Parameters
    ----------
    coefficients
        c_0, c_1, ..., k >= 1 of them, each a number or of one shape that broadcasts against ``x``.
    x
        Arguments in -1..1, any shape.

    Returns
    -------
    Floats
        Shape of ``x``, or that of ``x`` and a coefficient together.
    """
    one, two, twice = np.zeros_like(x), np.zeros_like(x), 2.0 * x
    for coefficient in coefficients[:0:-1]:
        one, two = coefficient + twice * one - two, one
    return np.asarray(coefficients[0] + x * one - two)
