"""Foreign piezos followed in time through a change of offset or size, line after line: hysteresis stepped, creep late.

A scan that has lasted for ever is followed by another one that begins at its lower turn; the creep of the first one
goes on in the second.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt
from foreign_plants import BIAS, CREEP_PER_DECADE, V_MAX, ForeignPlant, ManyPlays, OneState

from tablegen.virtual.duhem import Duhem, Lags
from tablegen.virtual.preisach import Preisach, TurningPoints

Floats = npt.NDArray[np.float64]
Play = Callable[[list[Floats]], list[Floats]]  # nm of drives one after the other, from rest at 0 on

_EARLIER = np.concatenate([np.linspace(0.0, 1.0, 60), np.linspace(1.0, 0.0, 60)])  # up and down, then up again
_TERMS_S = np.logspace(-3.0, 3.0, 19)  # of creep, three a decade


def sweep(low: float, high: float, turn: float, samples: int) -> Floats:
    """A period of normalised drives from the lower turn on."""
    t = np.arange(samples) / samples
    return low + (high - low) * np.where(t < turn, t / turn, (1.0 - t) / (1.0 - turn))


def plays_played(core: ManyPlays) -> Play:
    """Plays that keep their state."""

    def play(parts: list[Floats]) -> list[Floats]:
        state, out = np.zeros(core.count), []
        for u in parts:
            bent = u * (1.0 - u)
            one, other = (u + linear * bent + skew * bent * (u - 0.5) for linear, skew in core.bends)
            moved = np.empty(len(u))
            for k in range(len(u)):
                low, high = min(one[k], other[k]) - core.thresholds, max(one[k], other[k]) + core.thresholds
                state = np.minimum(np.maximum(state, low), high)
                moved[k] = state @ core.weights
            reversible = u + 0.12 * u**2 + 0.10 * u**3 - 0.05 * u**4
            out.append(1250.0 * (moved + (1.0 - float(np.sum(core.weights))) * reversible / 1.17))
        return out

    return play


def one_state_played(core: OneState) -> Play:
    """An equation of one state, integrated from one drive to the next."""

    def play(parts: list[Floats]) -> list[Floats]:
        h, before, out = 0.0, 0.0, []
        for u in parts:
            moved = np.empty(len(u))
            for k, drive in enumerate(u.tolist()):
                h = core.moved(h, before, drive - before)
                before = drive
                moved[k] = h
            out.append(core.nm(u, moved))
        return out

    return play


def virtual_played(core: Preisach | Duhem) -> Play:
    """A core of a virtual scanner, of drives that leave 0..1 by no more than a rounding."""

    def play(parts: list[Floats]) -> list[Floats]:
        out, memory = [], None
        for u in parts:
            moved, memory = step(np.clip(u, 0.0, 1.0), memory)
            out.append(moved)
        return out

    step: Callable[[Floats, TurningPoints | Lags | None], tuple[Floats, TurningPoints | Lags]] = core.play  # type: ignore[assignment]
    return play


def play_of(core: ManyPlays | OneState | Preisach | Duhem) -> Play:
    """The player of a core."""
    if isinstance(core, ManyPlays):
        return plays_played(core)
    return one_state_played(core) if isinstance(core, OneState) else virtual_played(core)


@dataclass(frozen=True)
class Followed:
    """Distance of each line's mean from where the line is when all has settled, in nm; and of the first sweep."""

    lines: Floats
    first_sweep: Floats

    def drift(self, first: int, count: int) -> float:
        """By how much that changes from one line on over some."""
        return float(abs(self.lines[first + count] - self.lines[first]))


def followed(
    play: Play,
    creep: tuple[Floats, Floats],
    before: tuple[float, float],
    now: tuple[float, float],
    turn: float,
    period_s: float,
    line_s: float,
    lines: int,
    samples: int,
    periods: int = 3,
) -> Followed:
    """From one line (low, high) to another; ``creep`` has shares of what a slow drive reaches, and times in s.

    The loop has closed after ``periods``.
    """
    rest = np.concatenate([_EARLIER, np.linspace(0.0, before[0], 20)])
    old, new = sweep(*before, turn, samples), sweep(*now, turn, samples)
    slew = np.linspace(before[0], now[0], 20)
    played = play([rest, *[old] * periods, slew, *[new] * periods])
    last, found = played[periods], played[periods + 2 :]
    settled = found[-1]
    shares, times = creep
    dt = period_s / samples
    decay = np.exp(-dt / times)[:, None]

    def kept(period: Floats) -> Floats:
        """Each term's state at the end of a period that has lasted for ever."""
        powers = decay ** np.arange(samples - 1, -1, -1)
        return np.asarray(((powers * (1.0 - decay)) @ period) / (1.0 - decay[:, 0] ** samples))

    # What is linear is followed in what differs from the settled line: its late terms and its hysteresis.
    state = kept(last) - kept(settled)
    count = int(np.ceil(lines * line_s / period_s))
    off = np.empty(count * samples)
    for k in range(count):
        period = found[min(k, periods - 1)] - settled
        for j in range(samples):
            state = decay[:, 0] * state + (1.0 - decay[:, 0]) * period[j]
            off[k * samples + j] = period[j] + float(shares @ state)
    a_line = round(line_s / dt)
    means = off[: lines * a_line].reshape(lines, a_line).mean(axis=1)
    up = round(turn * samples)
    return Followed(means, (found[0] - settled)[:up])


def random_triangle(seed: int, sweeps: int = 24, samples: int = 40) -> Floats:
    """Normalised drives from 0 on, of sweeps with random turns: shape (sweeps x samples,)."""
    random = np.random.default_rng(seed)
    highs, lows = random.uniform(0.5, 0.97, sweeps // 2), random.uniform(0.03, 0.45, sweeps // 2)
    turns = np.concatenate([[0.0, 0.97, 0.02], np.stack([highs, lows], axis=1).ravel()[: sweeps - 2]])
    return np.concatenate([np.linspace(a, b, samples, endpoint=False) for a, b in pairwise(turns)])


def recorded(
    core: ManyPlays | OneState | Preisach | Duhem, u: Floats, time_s: Floats, noise: float = 0.001, seed: int = 1
) -> Floats:
    """Noisy nm of a foreign piezo that has been up to 1 and back, now at rest at 0, with creep of 2.6 % a decade."""
    played = play_of(core)([_EARLIER, u])[1]
    state, late = np.full(len(_TERMS_S), played[0]), np.empty(len(u))
    late[0] = float(np.sum(state))
    for k in range(1, len(u)):
        decay = np.exp(-(time_s[k] - time_s[k - 1]) / _TERMS_S)
        state = decay * state + (1.0 - decay) * 0.5 * (played[k] + played[k - 1])
        late[k] = float(np.sum(state))
    moved = played + CREEP_PER_DECADE / 3.0 * late
    random = np.random.default_rng(seed).standard_normal(len(u))
    return np.asarray(moved + noise * float(np.ptp(moved)) * random)


def settled(core: ManyPlays | OneState | Preisach | Duhem, u: Floats, rate_hz: float) -> Floats:
    """nm of one period that has lasted for ever, of the same piezo."""
    f_hz = rate_hz * np.arange(len(u) // 2 + 1)
    late = sum(CREEP_PER_DECADE / 3.0 / (1.0 + 2j * np.pi * f_hz * tau_s) for tau_s in _TERMS_S)
    return np.fft.irfft(np.fft.rfft(core.settled(np.clip(u, 0.0, 1.0))) * (1.0 + late), len(u))


def scan_through_steps(
    plant: ForeignPlant,
    centres: tuple[float, ...],
    stroke: float,
    lines: tuple[int, ...],
    memory_s: float | None,
    noise_nm: float = 0.0,
    line_s: float = 0.01,
    samples: int = 20,
) -> tuple[Floats, Floats, Floats]:
    """Times in s, volts and nm of a triangle whose offset changes; the first one has lasted for ever.

    Its sensitivity follows the mean drive by ``memory_s``, or at once. ``plant`` has plays or one state.
    """
    core = plant.core
    play = plays_played(core) if isinstance(core, ManyPlays) else one_state_played(core)  # type: ignore[arg-type]
    closed = min(3 if isinstance(core, ManyPlays) else 60, *lines)
    periods = [sweep(at - 0.5 * stroke, at + 0.5 * stroke, 0.5, samples) for at in centres]
    rest = np.concatenate([_EARLIER, np.linspace(0.0, periods[0][0], 20)])
    played = play([rest, *(one for period in periods for one in [period] * closed)])[1:]
    moved = []
    for k, count in enumerate(lines):
        own = played[k * closed : (k + 1) * closed]
        moved += [own[-1]] * count if k == 0 else [*own, *[own[-1]] * (count - closed)]
    u = np.concatenate([np.tile(period, count) for period, count in zip(periods, lines, strict=True)])
    y, dt = np.concatenate(moved), line_s / samples
    bias = np.repeat(centres, np.array(lines) * samples)
    if memory_s is not None:
        forget = float(np.exp(-dt / memory_s))
        for k in range(1, len(bias)):
            bias[k] += (bias[k - 1] - bias[k]) * forget
    mean = 2.0 * bias - 1.0
    y *= 1.0 + BIAS[0] * mean + BIAS[1] * mean * mean
    shares, decay = plant.creep / 3.0, np.exp(-dt / plant.times_s)
    powers = decay[:, None] ** np.arange(samples - 1, -1, -1)
    state = ((powers * (1.0 - decay[:, None])) @ y[:samples]) / (1.0 - decay**samples)
    late = np.empty(len(y))
    for k, here in enumerate(y.tolist()):
        state = decay * state + (1.0 - decay) * here
        late[k] = float(np.sum(state))
    at_once = 1.0 / abs(1.0 + np.sum(shares / (1.0 + 200j * np.pi * plant.times_s)))
    noise = noise_nm * np.random.default_rng(5).standard_normal(len(y))
    return dt * np.arange(len(y)), V_MAX * u, np.asarray(at_once * (y + shares * late) + noise)
