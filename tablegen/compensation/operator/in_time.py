"""The position in time for any drive: hysteresis by its memory of turns, creep and dynamics in time.

Hysteresis remembers the turns that no later one has gone beyond (return-point memory). From the last of them the axis
goes towards the one before on the branch of the settled loop between both, and past it on the branch on which it was
before that loop. So a settled line is the closed form itself, and every family, and the measured residual over it,
has its motion in time. Where the memory of the bias was measured, the sensitivity follows the running mean of the
drive; else it is that at the mean of the whole drive.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tablegen.base.input_errors import Unphysical
from tablegen.compensation.dynamics import Measured, Response, SecondOrder
from tablegen.compensation.operator.bias_in_time import Periods, remembered
from tablegen.compensation.operator.bias_memory import BiasMemory
from tablegen.compensation.operator.loop import Loop
from tablegen.compensation.operator.loop_stretches import LoopStretch, positions_on
from tablegen.compensation.operator.measured_in_time import behind_measured
from tablegen.compensation.operator.operator import Operator
from tablegen.numerics.arrays import Floats

LEAST_SWING = 1e-3  # of the driver's range: what goes back by less, such as the noise of a recorder, is no turn
_MEANS = 129  # means of the drive at which the sensitivity is computed; linear between them
_LEAST_TURNS = 4  # of a record that begins with a line: its first sample, three turns, and one sample more

_SAME_LEVEL = 0.2  # of the stroke of the first line, by which it may end elsewhere than it began


class Start(StrEnum):
    """The state in which a record begins: after many repetitions of it or of its first line, or at rest after v_min."""

    SETTLED = "settled"
    LINE = "line"
    REST = "rest"


def _constant(_: float) -> float:
    return 1.0


@dataclass(frozen=True, eq=False)
class OperatorInTime:
    """An axis in time; ``factor_at`` is that of ``Operator.loop`` at a mean of the drive."""

    operator: Operator
    factor_at: Callable[[float], float] = _constant
    response: Response | None = None

    def position(self, time_s: Floats, u: Floats, start: Start = Start.SETTLED) -> Floats:
        """Return the position in nm, from the lower turn of the widest loop on.

        Parameters
        ----------
        time_s
            Ascending times in s, even or not, shape (n,).
        u
            Normalised drives, linear between the times, shape (n,).
        start
            The state at the first time. ``settled`` is that of a drive that repeats: its last sample is its first one.

        Raises
        ------
        Unphysical
            If a branch of the operator would run backwards, or the record does not begin with a line that repeats.
        """
        repeated = repeated_samples(time_s, u, start)
        mean = mean_of(time_s, u)
        y = self.hysteresis(u, start, mean, repeated)
        if self.operator.bias_memory is not None:
            y = self._sensitive(self.operator.bias_memory, time_s, u, y, mean, repeated)
        creep = self.operator.creep
        late = [share * late_mode(time_s, y, tau_s, repeated).real for share, tau_s in creep.terms()]
        y = creep.direct * y + np.sum(late, axis=0) if late else y
        if self.response is None:
            return y
        if isinstance(self.response, Measured):
            return behind_measured(time_s, y, self.response, repeated)
        if not isinstance(self.response, SecondOrder):
            raise Unphysical("in time a resonance with its delay is known, or a response that was measured in points")
        y = resonant(time_s, y, self.response, repeated)
        ago = time_s - self.response.delay_s
        if repeated:
            period_s = float(time_s[repeated - 1] - time_s[0])
            ago = np.where(ago < time_s[0], time_s[0] + (ago - time_s[0]) % period_s, ago)
        delayed: Floats = np.interp(ago, time_s, y)
        return delayed

    def _sensitive(
        self, memory: BiasMemory, time_s: Floats, u: Floats, y: Floats, mean: float, repeated: int
    ) -> Floats:
        """Return the position with the sensitivity at the running mean of the drive, which follows it late."""
        periods = Periods.of(time_s, u, turns_of(u), repeated, min(memory.rise_time_s, memory.fall_time_s))
        means = periods.mean(u)
        grid = np.arange(_MEANS) / (_MEANS - 1)
        at = np.array([self.operator.sensitivity(float(one), self.factor_at(float(one))) for one in grid])
        here = np.interp(means, grid, at) / np.interp(mean, grid, at)
        low, highest = float(np.min(u)), self._reach(float(np.max(u)))
        from_low = 0.0
        if repeated == len(u) and low > 0.0:  # else positions are from v_min on already
            ends = self.operator.family.branch(np.array([0.0, low]), 0.0, highest, True)
            from_low = self.operator.sensitivity(mean, self.factor_at(mean)) * float(ends[1] - ends[0])
        whole = from_low + y
        settled_at = periods.mean(whole)  # a share is of a step of which both ends are as sensitive
        first = None if repeated == len(u) else float(settled_at[0] if repeated else whole[0])
        out: Floats = here * whole * remembered(memory, periods, settled_at, first) - from_low
        return out

    def _reach(self, high: float) -> float:
        """Return the highest drive that the axis has been at before it rested."""
        return max([high, *(line.centre + 0.5 * line.stroke for line in self.operator.lines)])

    def hysteresis(
        self, u: Floats, start: Start = Start.SETTLED, mean: float | None = None, repeated: int = 0
    ) -> Floats:
        """Return the position in nm without creep and dynamics.

        Parameters
        ----------
        u
            Normalised drives, shape (n,).
        start
            The state before the first of them.
        mean
            Mean of the drive, to which the sensitivity belongs; by default that of the samples.
        repeated
            The number of samples that were repeated before, for the start in a line.

        Raises
        ------
        Unphysical
            If a branch of the operator would run backwards.
        """
        mean = float(np.mean(u)) if mean is None else mean
        low, high = float(np.min(u)), float(np.max(u))
        if start is not Start.SETTLED:
            low, high = min(low, 0.0), self._reach(high)
        memory = _Memory(self.operator, self.operator.loop(low, high, self.factor_at(mean), mean))
        if start is not Start.SETTLED:
            memory.play(np.array([low, float(u[0])]))
        before = {Start.SETTLED: len(u), Start.LINE: repeated, Start.REST: 0}[start]
        if before:
            memory.play(np.append(u[:before], u[0]))
        return memory.positions(u)


def mean_of(time_s: Floats, u: Floats) -> float:
    """Return the mean over the time of drives that are linear between the times, shapes (n,)."""
    return float(np.sum(0.5 * np.diff(time_s) * (u[1:] + u[:-1])) / (time_s[-1] - time_s[0]))


def repeated_samples(time_s: Floats, u: Floats, start: Start) -> int:
    """Return how many samples from the first one on are a drive that was repeated before: all, a line, or none.

    Parameters
    ----------
    time_s, u
        Ascending times in s and normalised drives, shapes (n,).
    start
        The state at the first time.

    Raises
    ------
    Unphysical
        If the start is in a line, and the record does not begin with one.
    """
    if start is not Start.LINE:
        return len(u) if start is Start.SETTLED else 0
    turns = turns_of(u)
    if len(turns) > _LEAST_TURNS:
        period_s = float(time_s[turns[3]] - time_s[turns[1]])
        end = int(np.argmin(np.abs(time_s - time_s[0] - period_s)))
        line = u[: end + 1]
        if abs(float(line[-1] - line[0])) <= _SAME_LEVEL * float(np.ptp(line)):
            return end + 1
    raise Unphysical(
        "the record does not begin with lines of one size and offset, two at least; start in another state"
    )


def late_mode(time_s: Floats, y: Floats, tau_s: complex, repeated: int) -> NDArray[np.complex128]:
    """Return s of tau s' = y - s, exactly for a y that is linear between the times.

    Parameters
    ----------
    time_s, y
        Ascending times in s and the input, shapes (n,).
    tau_s
        Time constant, of a complex mode a complex one, with a positive real part of its inverse.
    repeated
        How many samples from the first one on were repeated before; 0 if s begins as the first y.

    Returns
    -------
    NDArray
        Shape (n,).
    """
    x = np.diff(time_s) / tau_s
    decay = np.exp(-x)
    lost = -np.expm1(-x)
    first = np.where(np.abs(x) > 1e-5, lost / x, 1.0 - 0.5 * x)  # share of the first y beyond the decay
    # Real numbers of a real mode have the bits of complex ones whose imaginary parts are 0.
    gain = np.concatenate([[0.0], (first - decay) * y[:-1] + (1.0 - first) * y[1:]])
    factor = np.concatenate([[1.0], decay])
    step = 1
    while step < len(y):  # states over ever longer stretches: as many rounds as the length has binary digits
        gain[step:] = gain[step:] + factor[step:] * gain[:-step]
        factor[step:] = factor[step:] * factor[:-step]
        step *= 2
    begin = np.complex128(y[0])
    if repeated:  # a complex division of real numbers rounds otherwise than a real one
        begin = np.complex128(gain[repeated - 1]) / (1.0 - np.complex128(factor[repeated - 1]))
    first_state = begin if np.iscomplexobj(gain) else begin.real
    out: NDArray[np.complex128] = np.asarray(gain + factor * first_state, dtype=np.complex128)
    return out


def resonant(time_s: Floats, y: Floats, response: SecondOrder, repeated: int) -> Floats:
    """Return the output of a resonance, without its delay, by its two modes.

    Parameters
    ----------
    time_s, y
        Ascending times in s and the input, shapes (n,).
    response
        The resonance.
    repeated
        How many samples from the first one on were repeated before; 0 if it begins at rest.
    """
    taus_s, gains = resonance_modes(response)
    modes = [gain * late_mode(time_s, y, tau_s, repeated) for tau_s, gain in zip(taus_s, gains, strict=True)]
    return np.asarray(np.sum(modes, axis=0).real, dtype=np.float64)


def resonance_modes(response: SecondOrder) -> tuple[list[complex], list[complex]]:
    """Return complex time constants in s and gains of the two modes of a resonance."""
    w, half = 2.0 * np.pi * response.frequency_hz, 0.5 / response.quality
    root = np.sqrt(complex(half * half - 1.0)) or 1e-6  # critical damping: two modes that are nearly one
    poles = w * (-half + root), w * (-half - root)
    gains = [complex(w * w / ((pole - other) * -pole)) for pole, other in (poles, poles[::-1])]
    return [-1.0 / pole for pole in poles], gains


class _Turn:
    """A drive at which an axis has been, and its position, once that is known."""

    __slots__ = ("u", "y")

    def __init__(self, u: float, y: float = np.nan) -> None:
        self.u, self.y = u, y


class _Piece(NamedTuple):
    """Samples of a way that are on a branch between two turns; ``stretch`` is the number of their positions."""

    first: int
    until: int
    last: _Turn
    aim: _Turn
    stretch: int
    reaches: bool


class _Way(NamedTuple):
    """A monotone way of so many samples: from ``start`` to ``end``, along the branches of its pieces."""

    begin: int
    samples: int
    start: _Turn
    end: _Turn
    pieces: list[_Piece]


class _Memory:
    """Turns that count, outermost first, and the branches between them.

    Which branches an axis runs along depends on the drive alone. So all ways are found first, then the positions on
    all branches together, and at last those of the axis, way by way.
    """

    def __init__(self, operator: Operator, widest: Loop) -> None:
        self._operator, self._widest = operator, widest
        self._turns = [_Turn(widest.high, widest.extent_nm), _Turn(widest.low, 0.0)]
        self._rising = True
        self._at = _Turn(widest.low, 0.0)
        self._ways: list[_Way] = []
        self._stretches: list[LoopStretch] = []
        self._numbers: dict[tuple[float, ...], int] = {}

    def play(self, u: Floats) -> None:
        """Go along a drive, which begins where the axis is."""
        for begin, end in pairwise(turns_of(u)):
            part = u[begin : end + 1]
            running = np.maximum.accumulate(part) if part[-1] >= part[0] else np.minimum.accumulate(part)
            self._ways.append(self._way(begin, running))

    def positions(self, u: Floats) -> Floats:
        """Go along a drive, and return its positions in nm."""
        before = len(self._ways)
        self.play(u)
        shares = self._shares()
        out = np.empty(len(u))
        for number, way in enumerate(self._ways):
            positions = _positions_of(way, shares)
            way.end.y = float(positions[-1])
            if number >= before:
                out[way.begin : way.begin + way.samples] = positions
        return out

    def _way(self, begin: int, u: Floats) -> _Way:
        """Go a monotone way, whose first drive is where the axis is."""
        first_u, last_u = float(u[0]), float(u[-1])
        rising = last_u > first_u if last_u != first_u else self._rising
        if rising != self._rising:
            if self._at.u != self._turns[-1].u:
                self._turns.append(self._at)
            self._rising = rising
        way = _Way(begin, len(u), self._at, _Turn(last_u), [])
        first, sign = 1, 1.0 if rising else -1.0
        ascending = u if rising else -u
        while first < len(u):
            last, aim = self._turns[-1], self._turns[-2]
            until = first + int(ascending[first:].searchsorted(sign * aim.u, side="right"))
            if until > first:
                # The branches of a measured loop have a gap at its end, which lines would add up.
                reaches = bool(u[until - 1] == aim.u)
                stretch = self._stretch(begin, first, until, last.u, aim.u, rising, u)
                way.pieces.append(_Piece(first, until, last, aim, stretch, reaches))
            first = until
            if first < len(u) or last_u == aim.u:
                if len(self._turns) > 2:
                    del self._turns[-2:]
                    if len(self._turns) == 1:  # on the widest loop again, at one of its ends
                        self._turns.append(aim)
                else:
                    self._turns.reverse()
                    break
        self._at = way.end
        return way

    def _stretch(self, begin: int, first: int, until: int, last: float, aim: float, rising: bool, u: Floats) -> int:
        """Return the number of a stretch; a drive that repeats goes along the same ones again."""
        key, drives = (begin, first, until, last, aim), u[first:until]
        number = self._numbers.get(key)
        if number is None or not np.array_equal(self._stretches[number].u, drives):
            self._numbers[key] = number = len(self._stretches)
            self._stretches.append(LoopStretch(min(last, aim), max(last, aim), rising, drives))
        return number

    def _shares(self) -> list[Floats]:
        """Return by which share of its way from turn to turn the axis has gone, on each stretch."""
        widest, stretches = self._widest, self._stretches
        inner = [one for one in stretches if (one.low, one.high) != (widest.low, widest.high)]
        positions = iter(positions_on(self._operator, inner))
        shares = []
        for one in stretches:
            on_widest = (one.low, one.high) == (widest.low, widest.high)
            here = widest.position(one.u, one.rising) if on_widest else next(positions)
            shares.append(here if one.rising else 1.0 - here)
        return shares


def _positions_of(way: _Way, shares: list[Floats]) -> Floats:
    """Return the positions in nm along a way whose turns are known."""
    out = np.full(way.samples, way.start.y)
    for first, until, last, aim, stretch, reaches in way.pieces:
        out[first:until] = last.y + (aim.y - last.y) * shares[stretch]
        if reaches:
            out[until - 1] = aim.y
    return out


def turns_of(u: Floats) -> list[int]:
    """Return the places of the first drive, of each turn and of the last drive; swings below ``LEAST_SWING`` are none.

    Parameters
    ----------
    u
        Normalised drives, shape (n,), n >= 2.
    """
    slopes = np.sign(np.diff(u))
    moving = np.flatnonzero(slopes)
    corners = moving[1:][np.diff(slopes[moving]) != 0.0]
    turns = [0]
    for at in [*corners.tolist(), len(u) - 1]:
        if len(turns) > 1 and (u[at] - u[turns[-1]]) * (u[turns[-1]] - u[turns[-2]]) >= 0.0:
            turns[-1] = at  # further the same way
        elif abs(u[at] - u[turns[-1]]) >= LEAST_SWING or at == len(u) - 1:
            turns.append(at)
    return turns
