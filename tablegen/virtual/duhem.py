"""Hysteresis of another family: a Duhem operator, after Coleman and Hodgdon, in which a branch relaxes.

The displacement is a reversible part R(u) plus lags. While the drive u rises, a lag z relaxes towards -b(u), and while
it falls towards +c(u), each over its own share of the full drive:

    rising   dz/du = rise (-b(u) - z)         falling   dz/du = -fall (c(u) - z)

No turning point is wiped out: the memory of a lag decays with the path of the drive, and small cycles about one drive
bring a lag to its balance there. R', b and c are Bernstein polynomials with coefficients >= 0. The equation is linear:
a branch is a polynomial and an exponential, exact whatever the number of ticks, and one period maps a lag to a linear
function of itself, whose fixed point is the steady state.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from math import exp, expm1

import numpy as np

from tablegen.numerics.arrays import Floats, FloatsLike
from tablegen.virtual.pieces import monotonic, normalised, powers_of

LEAST_RATE = 0.5  # below it a branch would be the difference of large numbers
POINTS = np.linspace(0.0, 1.0, 201)  # drives at which the slope is checked


@dataclass(frozen=True)
class Lag:
    """One lag: rates per full drive; ``below`` and ``above`` are the Bernstein coefficients of b and c in nm."""

    rise: float
    fall: float
    below: tuple[float, ...]
    above: tuple[float, ...]

    @cached_property
    def towards(self) -> tuple[Floats, Floats]:
        """Polynomials that solve the equation of a rise and of a fall; every other solution approaches them.

        Returns
        -------
        Power coefficients in nm, lowest first, shapes (len(below),) and (len(above),).
        """
        return -_relaxed(self.below, -self.rise), _relaxed(self.above, self.fall)

    def balance(self, drive: FloatsLike) -> Floats:
        """Return the lag to which small cycles about a drive lead.

        Returns
        -------
        Lag in nm, of the shape of ``drive`` (0..1).
        """
        polyval = np.polynomial.polynomial.polyval
        pulled = self.fall * polyval(drive, powers_of(self.above)) - self.rise * polyval(drive, powers_of(self.below))
        return np.asarray(pulled / (self.rise + self.fall), dtype=np.float64)

    @cached_property
    def reach(self) -> tuple[Floats, Floats]:
        """The lowest and the highest lag that a history which began in balance can lead to.

        Returns
        -------
        Lags in nm at each of ``POINTS``, shape (201,) each.
        """
        low, high = self.balance(POINTS), self.balance(POINTS)
        solutions = [np.polynomial.polynomial.polyval(POINTS, solution) for solution in self.towards]
        count = len(POINTS)
        ways = [(0, range(count - 1), 1), (1, range(count - 1, 0, -1), -1)]
        for direction, places, step in ways + ways:
            at, decay = solutions[direction], exp(-(self.fall if direction else self.rise) / (count - 1))
            for n in places:
                low[n + step] = min(low[n + step], at[n + step] + (low[n] - at[n]) * decay)
                high[n + step] = max(high[n + step], at[n + step] + (high[n] - at[n]) * decay)
        return low, high

    def after(self, z: float, turned: float, drive: FloatsLike, up: bool) -> Floats:
        """Return the lag along a branch.

        Parameters
        ----------
        z, turned
            The lag in nm and the drive where the branch began.
        drive
            Drives of 0..1 on the branch, of any shape.
        up
            True if the branch rises.

        Returns
        -------
        Lag in nm, of the shape of ``drive``.
        """
        rate, solution = (self.rise, self.towards[0]) if up else (self.fall, self.towards[1])
        away = z - float(np.polynomial.polynomial.polyval(turned, solution))
        drive = np.asarray(drive, dtype=np.float64)
        lag: Floats = np.polynomial.polynomial.polyval(drive, solution) + away * np.exp(-rate * np.abs(drive - turned))
        return lag


@dataclass(frozen=True, slots=True)
class Lags:
    """The state: the drive, 0..1, and each lag there in nm."""

    drive: float
    nm: tuple[float, ...]


@dataclass(frozen=True)
class Duhem:
    """The operator; drive normalised to 0..1, displacement in nm above that at drive 0 in balance.

    ``reversible``: Bernstein coefficients of the slope R' over 0..1, in nm per full drive.

    Raises
    ------
    ValueError
        If a branch could run backwards after some history, or if a coefficient or a rate is out of range.
    """

    reversible: tuple[float, ...]
    lags: tuple[Lag, ...]

    def __post_init__(self) -> None:
        coefficients = [*self.reversible, *(c for lag in self.lags for c in (*lag.below, *lag.above))]
        if not self.reversible or not all(lag.below and lag.above for lag in self.lags) or min(coefficients) < 0.0:
            raise ValueError("reversible slope, below and above need coefficients, none of which is below 0")
        if min((rate for lag in self.lags for rate in (lag.rise, lag.fall)), default=LEAST_RATE) < LEAST_RATE:
            raise ValueError(f"a lag must not relax at less than {LEAST_RATE:g} per full drive")
        slope = self.least_slope()
        if slope < 0.0:
            raise ValueError(f"a branch could run backwards, at {-slope:.3g} nm per full drive")

    @cached_property
    def _integral(self) -> Floats:
        slope = powers_of(self.reversible)
        return np.append(0.0, slope / np.arange(1, len(slope) + 1))

    @cached_property
    def rest(self) -> Lags:
        """The state at drive 0, in balance."""
        return Lags(0.0, tuple(float(lag.balance(0.0)) for lag in self.lags))

    def least_slope(self) -> float:
        """Return a lower bound of the slope of a branch after any history, in nm per full drive."""
        polyval = np.polynomial.polynomial.polyval
        rising = falling = polyval(POINTS, powers_of(self.reversible))
        for lag in self.lags:
            low, high = lag.reach
            rising = rising - lag.rise * (polyval(POINTS, powers_of(lag.below)) + high)
            falling = falling - lag.fall * (polyval(POINTS, powers_of(lag.above)) - low)
        return float(min(np.min(rising), np.min(falling)))

    def middle(self, drive: FloatsLike) -> Floats:
        """Return the displacement in balance, between the branches of every small loop at a drive.

        Returns
        -------
        Displacement in nm, of the shape of ``drive`` (0..1).
        """
        lags = sum(lag.balance(drive) for lag in self.lags) - sum(self.rest.nm)
        return np.asarray(np.polynomial.polynomial.polyval(drive, self._integral) + lags, dtype=np.float64)

    def play(self, drive: Floats, memory: Lags | None = None) -> tuple[Floats, Lags]:
        """Return the displacement along a sequence of drives, and the state after it.

        Parameters
        ----------
        drive
            Drives of 0..1, shape (ticks,).
        memory
            The state before; at rest at drive 0 if None.

        Returns
        -------
        Displacement in nm, shape (ticks,), and the state.

        Raises
        ------
        ValueError
            If a drive is outside 0..1.
        """
        drive = normalised(drive)
        memory = memory or self.rest
        at, z = memory.drive, [*memory.nm]
        out = np.asarray(np.polynomial.polynomial.polyval(drive, self._integral) - sum(self.rest.nm), dtype=np.float64)
        for first, stop, turned, up in _branches(drive, at):
            for n, lag in enumerate(self.lags):
                lagging = lag.after(z[n], turned, drive[first:stop], up)
                out[first:stop] += lagging
                z[n] = float(lagging[-1])
            at = float(drive[stop - 1])
        return out, Lags(at, tuple(z))

    def settled(self, drive: Floats) -> Floats:
        """Return the displacement over one period of a drive that has been repeated for ever.

        Parameters
        ----------
        drive
            Drives of 0..1 over one period, shape (ticks,).

        Returns
        -------
        Displacement in nm, shape (ticks,).

        Raises
        ------
        ValueError
            If a drive is outside 0..1.
        """
        drive = normalised(drive)
        at = float(drive[-1])
        _, memory = self.play(np.array([at]))
        way = np.diff(np.append(at, drive))
        up, down = float(np.sum(way[way > 0.0])), -float(np.sum(way[way < 0.0]))
        if up == 0.0:
            return self.play(drive, memory)[0]
        # A period maps z to decay z + gained, whose fixed point is gained / (1 - decay).
        gained = self.play(drive, Lags(at, (0.0,) * len(self.lags)))[1].nm
        decay = [-expm1(-lag.rise * up - lag.fall * down) for lag in self.lags]
        return self.play(drive, Lags(at, tuple(g / one for g, one in zip(gained, decay, strict=True))))[0]


def _branches(drive: Floats, at: float) -> Iterator[tuple[int, int, float, bool]]:
    """Yield the first and last tick of every monotonic piece, the drive where it begins, and whether it rises."""
    for first, stop in monotonic(np.append(at, drive)):
        turned = at if first == 0 else float(drive[first - 1])
        yield first, stop, turned, bool(drive[stop - 1] > turned)


def _relaxed(bernstein: tuple[float, ...], rate: float) -> Floats:
    """Return s + s'/rate + s''/rate^2 + ..., which solves p' = rate (p - s)."""
    term = powers_of(bernstein)
    out = term.copy()
    for count in range(len(term) - 1, 0, -1):
        term = np.arange(1, count + 1) * term[1:] / rate
        out[:count] += term
    return out
