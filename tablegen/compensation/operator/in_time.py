"""The position in time for any drive: hysteresis by its memory of turns, creep and a resonance by their modes.

Hysteresis remembers the turns that no later one has gone beyond (return-point memory). From the last of them the axis
goes towards the one before on the branch of the settled loop between both, and past it on the branch on which it was
before that loop. So a settled line is the closed form itself, and every family, and the measured residual over it,
has its motion in time.
"""

from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from tablegen.base.input_errors import Unphysical
from tablegen.compensation.dynamics import Response, SecondOrder
from tablegen.compensation.operator.loop import Loop
from tablegen.compensation.operator.operator import Operator
from tablegen.numerics.arrays import Floats

LEAST_SWING = 1e-3  # of the driver's range: what goes back by less, such as the noise of a recorder, is no turn


class Start(StrEnum):
    """The state in which a record begins: after many repetitions of itself, or at rest after the range's lower end."""

    SETTLED = "settled"
    REST = "rest"


@dataclass(frozen=True, eq=False)
class OperatorInTime:
    """An axis in time; ``factor`` is that of ``Operator.loop`` at the mean of the drive."""

    operator: Operator
    factor: float = 1.0
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
            If a branch of the operator would run backwards, or the dynamics are not a resonance and a delay.
        """
        settled = start is Start.SETTLED
        y = self.hysteresis(u, start)
        span_s = float(time_s[-1] - time_s[0])
        creep = self.operator.creep
        late = [share * late_mode(time_s, y, tau_s, settled).real for share, tau_s in creep.terms()]
        y = creep.direct * y + np.sum(late, axis=0) if late else y
        if self.response is None:
            return y
        if not isinstance(self.response, SecondOrder):
            raise Unphysical("in time a resonance and its delay are known, not a response that was measured in points")
        y = resonant(time_s, y, self.response, settled)
        ago = time_s - self.response.delay_s
        delayed: Floats = np.interp(ago, time_s, y, period=span_s) if settled else np.interp(ago, time_s, y)
        return delayed

    def hysteresis(self, u: Floats, start: Start = Start.SETTLED) -> Floats:
        """Return the position in nm without creep and dynamics.

        Parameters
        ----------
        u
            Normalised drives, shape (n,).
        start
            The state before the first of them.

        Raises
        ------
        Unphysical
            If a branch of the operator would run backwards.
        """
        mean, low, high = float(np.mean(u)), float(np.min(u)), float(np.max(u))
        if start is Start.REST:
            reach = max(line.centre + 0.5 * line.stroke for line in self.operator.lines)
            low, high = min(low, 0.0), max(high, reach)
        memory = _Memory(self.operator, self.factor, mean, low, high)
        if start is Start.REST:
            memory.move(np.array([low, float(u[0])]))
        else:
            _along(memory, u)
            memory.move(u[[-1, 0]])
        return _along(memory, u)


def late_mode(time_s: Floats, y: Floats, tau_s: complex, settled: bool) -> NDArray[np.complex128]:
    """Return s of tau s' = y - s, exactly for a y that is linear between the times.

    Parameters
    ----------
    time_s, y
        Ascending times in s and the input, shapes (n,).
    tau_s
        Time constant, of a complex mode a complex one, with a positive real part of its inverse.
    settled
        True if y repeats with the length of the record; else s begins as the first y.

    Returns
    -------
    NDArray
        Shape (n,).
    """
    x = np.diff(time_s) / tau_s
    decay = np.exp(-x)
    lost = -np.expm1(-x)
    first = np.where(np.abs(x) > 1e-5, lost / x, 1.0 - 0.5 * x)  # share of the first y beyond the decay
    gain = np.concatenate([[0.0], (first - decay) * y[:-1] + (1.0 - first) * y[1:]]).astype(np.complex128)
    factor = np.concatenate([[1.0], decay]).astype(np.complex128)
    step = 1
    while step < len(y):  # states over ever longer stretches: as many rounds as the length has binary digits
        gain[step:] = gain[step:] + factor[step:] * gain[:-step]
        factor[step:] = factor[step:] * factor[:-step]
        step *= 2
    begin = gain[-1] / (1.0 - factor[-1]) if settled else y[0]
    out: NDArray[np.complex128] = gain + factor * begin
    return out


def resonant(time_s: Floats, y: Floats, response: SecondOrder, settled: bool) -> Floats:
    """Return the output of a resonance, without its delay, by its two modes.

    Parameters
    ----------
    time_s, y
        Ascending times in s and the input, shapes (n,).
    response
        The resonance.
    settled
        True if y repeats with the length of the record; else it begins at rest.
    """
    taus_s, gains = resonance_modes(response)
    modes = [gain * late_mode(time_s, y, tau_s, settled) for tau_s, gain in zip(taus_s, gains, strict=True)]
    return np.asarray(np.sum(modes, axis=0).real, dtype=np.float64)


def resonance_modes(response: SecondOrder) -> tuple[list[complex], list[complex]]:
    """Return complex time constants in s and gains of the two modes of a resonance."""
    w, half = 2.0 * np.pi * response.frequency_hz, 0.5 / response.quality
    root = np.sqrt(complex(half * half - 1.0)) or 1e-6  # critical damping: two modes that are nearly one
    poles = w * (-half + root), w * (-half - root)
    gains = [complex(w * w / ((pole - other) * -pole)) for pole, other in (poles, poles[::-1])]
    return [-1.0 / pole for pole in poles], gains


class _Memory:
    """Turns that count, outermost first, and the branches between them."""

    def __init__(self, operator: Operator, factor: float, mean: float, low: float, high: float) -> None:
        self._operator, self._factor, self._mean = operator, factor, mean
        self._loops: dict[tuple[float, float], Loop] = {}
        extent = self._loop(low, high).extent_nm
        self._turns = [(high, extent), (low, 0.0)]
        self._rising = True
        self._at = low, 0.0

    def move(self, u: Floats) -> Floats:
        """Return the positions along a monotone stretch, whose first drive is where the axis is."""
        rising = bool(u[-1] > u[0]) if u[-1] != u[0] else self._rising
        if rising != self._rising:
            if self._at[0] != self._turns[-1][0]:
                self._turns.append(self._at)
            self._rising = rising
        out = np.full(len(u), self._at[1])
        first = 1
        sign = 1.0 if rising else -1.0
        while first < len(u):
            (last, y_last), (aim, y_aim) = self._turns[-1], self._turns[-2]
            until = first + int(np.searchsorted(sign * u[first:], sign * aim, side="right"))
            if until > first:
                loop = self._loop(min(last, aim), max(last, aim))
                here = loop.position(u[first:until], rising)
                share = here if rising else 1.0 - here
                out[first:until] = y_last + (y_aim - y_last) * share
            first = until
            if first < len(u) or u[-1] == aim:
                if len(self._turns) > 2:
                    del self._turns[-2:]
                    if len(self._turns) == 1:  # on the widest loop again, at one of its ends
                        self._turns.append((aim, y_aim))
                else:
                    self._turns.reverse()
                    break
        self._at = float(u[-1]), float(out[-1])
        return out

    def _loop(self, low: float, high: float) -> Loop:
        key = low, high
        if key not in self._loops:
            self._loops[key] = self._operator.loop(low, high, self._factor, self._mean)
        return self._loops[key]


def _along(memory: _Memory, u: Floats) -> Floats:
    """Return the positions along a drive, which begins where the memory is."""
    out = np.empty(len(u))
    turns = turns_of(u)
    for begin, end in pairwise(turns):
        part = u[begin : end + 1]
        running = np.maximum.accumulate(part) if part[-1] >= part[0] else np.minimum.accumulate(part)
        out[begin : end + 1] = memory.move(running)
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
