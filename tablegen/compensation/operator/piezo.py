"""The operator as a piezo for simulations, wrong by as much as it is uncertain.

A build knows the operator; the piezo departs from it. The size of the departure comes from the traces, each of which
was left out when the operator was identified: near it, loops are bent by smooth random curves of that rms, and sizes
changed by as much.
"""

from dataclasses import dataclass, replace

import numpy as np

from tablegen.compensation.dynamics import Response
from tablegen.compensation.operator.field import Field, Lengths, covariance
from tablegen.compensation.operator.operator import Operator
from tablegen.compensation.operator.settled import settled
from tablegen.numerics.arrays import Floats
from tablegen.numerics.driver import Driver

# Departures at two places are alike within this much of stroke and of centre, shares of v_max.
_ALIKE = Lengths(0.2, 0.2, 1e-9)
_WAVES = 8  # Chebyshev polynomials of a departure, at least
_WAVES_PER_ROUGHNESS = 0.2  # the same for the ratio of scaling error and rms, both in percent: finer ones scale more
_WINDOW = np.linspace(-0.8, 0.8, 161)  # x = 0.1..0.9, where the rms holds


@dataclass(frozen=True, eq=False, kw_only=True)
class DepartingField(Field):
    """A field with an error near each of its points.

    ``places`` are the points, shape (n, 2) of stroke and centre; ``departures`` has the shape of the weights.
    """

    places: Floats
    departures: Floats

    def at(self, stroke: float, centre: float) -> Floats:
        """Return the interpolated row with its departure, of the same variance between the points and beyond.

        Parameters
        ----------
        stroke, centre
            Shares of the driver's range.

        Returns
        -------
        Row, shape (columns,).
        """
        near = covariance(np.array([[stroke, centre]]), self.places, _ALIKE)[0]
        departure = near @ self.departures / np.sqrt(np.sum(near * near))
        return np.asarray(super().at(stroke, centre) + departure, dtype=np.float64)

    def at_many(self, strokes: Floats, centres: Floats) -> Floats:
        """Return ``at`` of many strokes and centres, shape (n, columns)."""
        return np.stack([self.at(*one) for one in zip(strokes.tolist(), centres.tolist(), strict=True)])


@dataclass(frozen=True, eq=False)
class OperatorPiezo:
    """An axis that does what an operator says, with its creep and dynamics; nm from the lower turn on."""

    operator: Operator
    factor: float
    driver: Driver
    response: Response | None

    def settled(self, volts: Floats, tick_s: float) -> Floats:
        """Return the settled position in the middle of each tick of a period.

        Parameters
        ----------
        volts
            One period in V, shape (ticks,), that rises once and falls once.
        tick_s
            Length of a tick in s.

        Returns
        -------
        Position in nm, shape (ticks,).

        Raises
        ------
        Unphysical
            If a departing branch would run backwards.
        """
        u = self.driver.share(volts)
        loop = self.operator.loop(float(np.min(u)), float(np.max(u)), self.factor, float(np.mean(u)))
        rate_hz = 1.0 / (len(u) * tick_s)
        return settled(loop, u, rate_hz, self.operator.creep, self.response)


def departing(operator: Operator, seed: tuple[int, ...]) -> Operator:
    """Return the operator with branches and sizes wrong by each trace's residual when it was left out.

    The error is at least the median of all traces: a single trace may agree by chance.
    """
    random = np.random.default_rng(seed)
    places = np.array([(line.stroke, line.centre) for line in operator.lines])
    half = len(operator.residual.weights[0]) // 2
    missed_by = 0.01 * np.abs([line.left_out for line in operator.lines])
    rms, _, _, size_error = np.maximum(missed_by, np.median(missed_by, axis=0)).T
    roughness = float(np.median([line.left_out[1] / max(line.left_out[0], 1e-9) for line in operator.lines]))
    waves = int(np.clip(_WAVES_PER_ROUGHNESS * roughness, min(_WAVES, half - 2), max(half - 2, 1)))
    bends = np.array([_bend(random, half, max(waves, 1)) for _ in places]) * rms[:, None]
    sizes = random.standard_normal((len(places), 1)) * size_error[:, None]
    residual, size = (
        DepartingField(
            field.points, field.weights, field.lengths, field.straight, field.decade, places=places, departures=rows
        )
        for field, rows in ((operator.residual, bends), (operator.size, sizes))
    )
    return replace(operator, residual=residual, size=size)


def _bend(random: np.random.Generator, count: int, waves: int) -> Floats:
    """Return coefficients of both branches, ``count`` each: 0 where the loop turns, of rms 1 inside the window."""
    fade = np.arange(1.0, waves + 1.0) ** -0.5
    turns = np.array([0.5, 0.0, -0.5])  # 1 - x^2
    polynomials = [np.polynomial.chebyshev.chebmul(turns, fade * random.standard_normal(waves)) for _ in range(2)]
    branches = np.array([np.pad(one, (0, max(count - len(one), 0)))[:count] for one in polynomials])
    bends = np.array([np.polynomial.chebyshev.chebval(_WINDOW, one) for one in branches])
    about = bends - np.polynomial.chebyshev.chebval(_WINDOW, np.polynomial.chebyshev.chebfit(_WINDOW, bends.mean(0), 1))
    return np.concatenate(branches) / float(np.sqrt(np.mean(about * about)))
