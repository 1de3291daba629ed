"""Piezos that the project does not contain, to identify operators on: plays, and Bouc-Wen's and Jiles-Atherton's.

Written without the operator's code: plays are stepped sample by sample, the equations are integrated. All lie before
creep, two modes and dead time, and their sensitivity depends on the mean drive.
"""

from dataclasses import dataclass, field
from math import copysign, tanh
from typing import Protocol

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
V_MAX = 100.0
CREEP_PER_DECADE = 0.026
BIAS = (0.12, 0.05)  # of the sensitivity: linear and quadratic in the mean drive from -1 to 1
MODES = ((60e3, 14.0, 0.96), (31e3, 20.0, 0.04))  # Hz, quality, share
DEAD_TIME_S = 2e-6
_CLOSED = 1e-10  # of what h may differ by from period to period
_MOST_PERIODS = 50


class Core(Protocol):
    """Static hysteresis, settled: nm of a period of normalised drives."""

    def settled(self, u: Floats) -> Floats: ...


@dataclass
class ManyPlays:
    """300 generalised plays with cubic envelopes that differ up and down, over a quartic."""

    seed: int = 1
    count: int = 300

    def __post_init__(self) -> None:
        random = np.random.default_rng(self.seed)
        self.thresholds = np.sort(random.uniform(0.0, 0.5, self.count))
        weights = np.exp(-self.thresholds / 0.18) * random.uniform(0.5, 1.5, self.count)
        self.weights = 0.35 * weights / np.sum(weights)
        self.bends = random.uniform(-0.25, 0.25, (2, 2))

    def settled(self, u: Floats) -> Floats:
        """Two periods, the second of which counts."""
        bent = u * (1.0 - u)
        up, down = (u + linear * bent + skew * bent * (u - 0.5) for linear, skew in self.bends)
        low = np.minimum(up, down)[:, None] - self.thresholds
        high = np.maximum(up, down)[:, None] + self.thresholds
        state = np.clip(0.0, low[0], high[0])
        out = np.empty(len(u))
        for _ in range(2):
            for k in range(len(u)):
                state = np.minimum(np.maximum(state, low[k]), high[k])
                out[k] = state @ self.weights
        reversible = u + 0.12 * u**2 + 0.10 * u**3 - 0.05 * u**4
        return 1250.0 * (out + (1.0 - float(np.sum(self.weights))) * reversible / 1.17)


class OneState:
    """A core whose hysteresis has one state, stepped with the drive."""

    def moved(self, state: float, u: float, by: float) -> float:
        """The state after the drive went from ``u`` by so much."""
        raise NotImplementedError

    def nm(self, u: Floats, state: Floats) -> Floats:
        """The displacement."""
        raise NotImplementedError

    def settled(self, u: Floats) -> Floats:
        """The period that ends where it began: a small loop takes hundreds to get there by itself."""
        drives = u.tolist()
        start, (states, after) = 0.0, self.period(drives, 0.0)
        for _ in range(_MOST_PERIODS):
            if abs(after - start) < _CLOSED:
                return self.nm(u, np.array(states))
            # Secant of what a period moves the start by: exact where that is linear, and it hardly bends.
            ahead = self.period(drives, after)[1]
            moves, next_moves = after - start, ahead - after
            start = after + next_moves * moves / (moves - next_moves)
            states, after = self.period(drives, start)
        raise ValueError(f"the loop of {self} did not close")

    def period(self, drives: list[float], state: float) -> tuple[list[float], float]:
        """The state at every drive of a period that begins with it, and at its end."""
        before, out = drives[0], []
        for drive in [*drives, drives[0]]:
            state = self.moved(state, before, drive - before)
            before = drive
            out.append(state)
        return out[:-1], out[-1]


@dataclass
class BoucWen(OneState):
    """dh = du (A - |h|^n (beta sign(h du) (1 + asymmetry sign(h) / 2) + gamma)), less from a bent line.

    With ``skew`` n is another one on either side, which no operator has.
    """

    a: float = 0.35
    beta: float = 6.0
    gamma: float = -2.0
    n: float = 1.3
    depth: float = 0.6
    asymmetry: float = 0.5
    bend: float = 0.15
    skew: float = 0.0

    def nm(self, u: Floats, state: Floats) -> Floats:
        return 1250.0 * (u * (1.0 + self.bend * u) - self.depth * state)

    def moved(self, state: float, u: float, by: float) -> float:
        steps = int(abs(by) / 2e-3) + 1
        du = by / steps
        for _ in range(steps):
            state += du * self._slope(state + 0.5 * du * self._slope(state, du), du)
        return state

    def _slope(self, h: float, du: float) -> float:
        lag = self.beta * (1.0 + copysign(0.5, h) * self.asymmetry)
        power = abs(h) ** (self.n * (1.0 + copysign(self.skew, h)) if self.skew else self.n)
        return float(self.a - power * (copysign(lag, h * du) + self.gamma))


@dataclass
class JilesAtherton(OneState):
    """Jiles and Atherton's equation over a bent line: of no family, since its slope goes with drive and state.

    The irreversible part m follows the curve tanh(x) of x = (u - centre) / width + coupling m, where that is ahead of
    it, the more readily the smaller ``pinning`` is.
    """

    centre: float = 0.35
    width: float = 0.45
    coupling: float = 0.15
    pinning: float = 0.35
    share: float = 0.35
    bend: float = 0.1

    def nm(self, u: Floats, state: Floats) -> Floats:
        return 1250.0 * ((1.0 - self.share) * u * (1.0 + self.bend * u) + 0.5 * self.share * state)

    def moved(self, state: float, u: float, by: float) -> float:
        steps = int(abs(by) / 2e-3) + 1
        du = by / steps
        for k in range(steps):
            middle = state + 0.5 * du * self._slope(state, u + k * du, du)
            state += du * self._slope(middle, u + (k + 0.5) * du, du)
        return state

    def _slope(self, m: float, u: float, du: float) -> float:
        ahead = copysign(1.0, du) * (tanh((u - self.centre) / self.width + self.coupling * m) - m)
        return max(ahead, 0.0) / self.pinning


@dataclass
class ForeignPlant:
    """A core with sensitivity, creep, modes and dead time behind it."""

    core: Core
    creep: float = CREEP_PER_DECADE
    times_s: Floats = field(default_factory=lambda: np.logspace(-5.0, 3.0, 25))

    def settled(self, volts: Floats, rate_hz: float) -> Floats:
        """nm of one period of volts at the piezo."""
        u = volts / V_MAX
        mean = 2.0 * float(np.mean(u)) - 1.0
        moved = self.core.settled(u) * (1.0 + BIAS[0] * mean + BIAS[1] * mean * mean)
        f = rate_hz * np.arange(len(u) // 2 + 1)
        return np.fft.irfft(np.fft.rfft(moved) * self.dynamics(f) * self.crept(f), len(u))

    def dynamics(self, f_hz: Floats) -> npt.NDArray[np.complex128]:
        """Modes and dead time: what `calibrate resonance` would measure."""
        total = sum(share / (1.0 - (f_hz / f) ** 2 + 1j * f_hz / (f * q)) for f, q, share in MODES)
        return np.asarray(total * np.exp(-2j * np.pi * f_hz * DEAD_TIME_S))

    def crept(self, f_hz: Floats) -> npt.NDArray[np.complex128]:
        """Logarithmic creep, of which three terms a decade are summed."""
        late = sum(self.creep / 3.0 / (1.0 + 2j * np.pi * f_hz * t) for t in self.times_s)
        at_100_hz = sum(self.creep / 3.0 / (1.0 + 2j * np.pi * 100.0 * t) for t in self.times_s)
        return (1.0 + late) / abs(1.0 + at_100_hz)


@dataclass
class RateDependentPlant(ForeignPlant):
    """One whose loops depend on the rate: a number of its core grows by a share per decade from 100 Hz on."""

    number: str = "thresholds"
    growth: float = 0.1

    def settled(self, volts: Floats, rate_hz: float) -> Floats:
        """nm of one period of volts at the piezo."""
        at_100_hz = getattr(self.core, self.number)
        setattr(self.core, self.number, at_100_hz * (1.0 + self.growth * float(np.log10(rate_hz / 100.0))))
        try:
            return super().settled(volts, rate_hz)
        finally:
            setattr(self.core, self.number, at_100_hz)


def triangle(count: int, centre: float, stroke: float, turn: float = 0.5) -> Floats:
    """One period in V, from the minimum on; centre and stroke are shares of ``V_MAX``."""
    t = np.arange(count) / count
    return V_MAX * (centre + stroke * (np.where(t < turn, t / turn, (1.0 - t) / (1.0 - turn)) - 0.5))


def record(
    plant: ForeignPlant,
    centre: float,
    stroke: float,
    rate_hz: float = 100.0,
    seed: int = 0,
    turn: float = 0.5,
    noise: float = 0.001,
    periods: int = 5,
    samples: int = 1000,
) -> tuple[Floats, Floats, Floats]:
    """Times in s, volts and noisy nm of some settled periods, with drift: what a laboratory records."""
    volts = triangle(samples, centre, stroke, turn)
    moved = plant.settled(volts, rate_hz)
    time = np.arange(periods * samples) / (samples * rate_hz)
    span = float(np.ptp(moved))
    drift = 0.01 * span * np.log1p(time * rate_hz)
    random = noise * span * np.random.default_rng(seed).standard_normal(len(time))
    return time, np.tile(volts, periods), np.tile(moved, periods) + drift + random + 300.0


SIX = tuple((0.5, stroke) for stroke in (0.10, 0.25, 0.45, 0.65, 0.82, 0.97))
TEN = (*SIX, (0.7, 0.25), (0.7, 0.58), (0.85, 0.12), (0.85, 0.28))
