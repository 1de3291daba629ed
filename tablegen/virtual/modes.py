"""Linear dynamics as a sum of first-order terms, exact for a drive that is held from tick to tick.

H(s) = direct + sum of r / (s - p), each complex pole standing for its conjugate as well. A value is the mean over its
tick, which is what a pixel shows, and belongs to the middle of the tick: half a tick after the drive is put out.
"""

from dataclasses import dataclass
from math import pi, sqrt

import numpy as np
import numpy.typing as npt

from tablegen.numerics.arrays import Floats, FloatsLike

Complex = npt.NDArray[np.complex128]
_BLOCK_TICKS = 64  # ticks that are computed as one product of matrices


@dataclass(frozen=True)
class Modes:
    """Poles in rad/s, in the left half-plane, those with an imaginary part above 0 with their conjugate."""

    direct: float
    poles: tuple[complex, ...] = ()
    residues: tuple[complex, ...] = ()

    def response(self, f_hz: FloatsLike) -> Complex:
        """Return H at frequencies in Hz.

        Returns
        -------
        Complex gains, of the shape of ``f_hz``.
        """
        s = 2j * pi * np.asarray(f_hz, dtype=np.float64)
        out = np.full(s.shape, complex(self.direct))
        for p, r in zip(self.poles, self.residues, strict=True):
            out += r / (s - p)
            if p.imag:
                out += r.conjugate() / (s - p.conjugate())
        return out

    def faster(self, times: float) -> "Modes":
        """Return the modes with all frequencies multiplied by ``times``."""
        return Modes(self.direct, tuple(p * times for p in self.poles), tuple(r * times for r in self.residues))

    def settled(self, drive: Floats, tick_s: float) -> Floats:
        """Return the periodic response to one period of a drive.

        Parameters
        ----------
        drive
            Drive held in each tick, shape (ticks,).
        tick_s
            Length of a tick in s.

        Returns
        -------
        Mean over each tick, in the unit of ``drive``, shape (ticks,).
        """
        if not self.poles:
            return self.direct * drive
        # The response of each recursion, taken at the harmonics of the period: the steady state without waiting for it.
        z = np.exp(2j * pi * np.arange(len(drive) // 2 + 1) / len(drive))
        factor = np.full(z.shape, complex(self.direct))
        change, weight, state_weight, at_once = self._held(tick_s)
        for decrement, w, m, now, p in zip(-change, weight, state_weight, at_once, self.poles, strict=True):
            factor += now + m * w / (z - 1.0 + decrement)
            if p.imag:
                factor += np.conj(now) + np.conj(m * w) / (z - 1.0 + np.conj(decrement))
        return np.fft.irfft(np.fft.rfft(drive) * factor, len(drive))

    def follow(self, drive: Floats, tick_s: float, at_rest: float | None = None) -> Floats:
        """Return the response to a drive that follows a long rest.

        Parameters
        ----------
        drive
            Drive held in each tick, shape (ticks,).
        tick_s
            Length of a tick in s.
        at_rest
            The drive before; its own first value if None.

        Returns
        -------
        Mean over each tick, in the unit of ``drive``, shape (ticks,).
        """
        if not self.poles:
            return self.direct * drive
        change, weight, state_weight, at_once = self._held(tick_s)
        decay = 1.0 + change
        doubled = np.where(np.array(self.poles).imag != 0.0, 2.0, 1.0)  # a pole and its conjugate
        ticks = len(drive)
        blocks = np.pad(drive, (0, -ticks % _BLOCK_TICKS)).reshape(-1, _BLOCK_TICKS)
        k = np.arange(_BLOCK_TICKS)
        powers = decay[:, None] ** k
        later = np.sum((doubled * state_weight * weight)[:, None] * powers, axis=0).real
        impulse = np.append(self.direct + np.sum(doubled * at_once).real, later[:-1])
        kernel = np.where(k[:, None] <= k, impulse[np.maximum(k - k[:, None], 0)], 0.0)
        fed = blocks @ powers[:, ::-1].T
        state = (drive[0] if at_rest is None else at_rest) / -change
        states = np.empty((len(blocks), len(decay)), dtype=np.complex128)
        over = decay**_BLOCK_TICKS
        for i, feed in enumerate(fed):
            states[i] = state
            state = over * state + feed
        carried = (states @ ((doubled * state_weight * weight)[:, None] * powers)).real
        return (blocks @ kernel + carried).reshape(-1)[:ticks]

    def _held(self, tick_s: float) -> tuple[Complex, Complex, Complex, Complex]:
        """Return the weights of each term over a tick.

        These are the relative change of its state and the weight of the held drive in it; and, in the mean over the
        tick, the weight of the state at its beginning and that of the held drive.
        """
        p, r = np.array(self.poles, dtype=np.complex128), np.array(self.residues, dtype=np.complex128)
        change = np.expm1(p * tick_s)
        state_weight = change / (p * tick_s)
        return change, r * change / p, state_weight, r * (state_weight - 1.0) / p


def low_pass(bandwidth_hz: float) -> Modes:
    """Return one pole: half the power at ``bandwidth_hz``."""
    w = 2.0 * pi * bandwidth_hz
    return Modes(0.0, (complex(-w),), (complex(w),))


def second_order(frequency_hz: float, quality: float) -> Modes:
    """Return a resonance: 1 / (1 - r^2 + i r / Q) with r = f / frequency_hz; ``quality`` above 0.5."""
    w = 2.0 * pi * frequency_hz
    damped = w * sqrt(1.0 - 0.25 / quality**2)
    pole = complex(-0.5 * w / quality, damped)
    return Modes(0.0, (pole,), (w * w / (2j * damped),))


def side_by_side(first: Modes, second: Modes, share: float) -> Modes:
    """Return two modes that follow the same drive; ``share`` of the sum is the second's."""
    residues = (*((1.0 - share) * r for r in first.residues), *(share * r for r in second.residues))
    return Modes((1.0 - share) * first.direct + share * second.direct, first.poles + second.poles, residues)


def delay(drive: Floats, ticks: float, before: float | None = None) -> Floats:
    """Delay a held drive: periodic, or after a long rest.

    Parameters
    ----------
    held
        Drive held in each tick, shape (ticks,).
    ticks
        Delay in ticks, 0 or more.
    before
        The drive before the first tick; None if the drive is periodic.

    Returns
    -------
    Mean over each tick, in the unit of ``drive``, shape (ticks,).
    """
    whole = int(ticks)
    part = ticks - whole
    if before is None:
        late, later = np.roll(drive, whole), np.roll(drive, whole + 1)
    else:
        padded = np.concatenate((np.full(min(whole, len(drive)) + 1, before), drive))
        late, later = padded[1 : len(drive) + 1], padded[: len(drive)]
    return late + part * (later - late)
