"""The virtual scanner: volts at the amplifier's output stage in, nanometres out.

amplifier bandwidth -> hysteresis -> sensitivity at the mean drive -> creep -> resonance, each axis by itself.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from tablegen.numerics.arrays import Floats, FloatsLike
from tablegen.virtual import parameters
from tablegen.virtual.creep import logarithmic_creep
from tablegen.virtual.modes import Modes, low_pass, second_order
from tablegen.virtual.parameters import Truth, sensitivity
from tablegen.virtual.preisach import Preisach

_STRAIGHT = Modes(1.0)
_DRIVE_LEVELS = 2.0**36  # levels of the drive


@dataclass(frozen=True)
class VirtualAxis:
    """One axis. Displacements are in nm above the axis at rest at 0 V."""

    v_max: float
    amplifier: Modes
    hysteresis: Preisach
    sensitivity: tuple[float, ...]
    creep: Modes
    resonance: Modes

    @classmethod
    def of(cls, axis: parameters.AxisTruth, v_max: float, amplifier: parameters.AmplifierTruth) -> "VirtualAxis":
        """From the parameters of a file."""
        h, c, r = axis.hysteresis, axis.creep, axis.resonance
        creep = _STRAIGHT
        if c is not None:
            creep = logarithmic_creep(c.loss_per_decade, c.reference_hz, c.fastest_s, c.slowest_s, c.terms_per_decade)
        return cls(
            v_max=v_max,
            amplifier=_STRAIGHT if amplifier.bandwidth_hz is None else low_pass(amplifier.bandwidth_hz),
            hysteresis=Preisach(tuple(h.reversible_nm), tuple(map(tuple, h.density_nm))),
            sensitivity=tuple(axis.sensitivity),
            creep=creep,
            resonance=_STRAIGHT if r is None else second_order(r.frequency_hz, r.quality),
        )

    def settled(self, volts: Floats, tick_s: float) -> Floats:
        """Where the axis is, as a mean over each tick, in a period that has been held tick by tick for ever."""
        drive = self._normalised(self.amplifier.settled(volts, tick_s))
        moved = self._sensitivity(float(np.mean(volts))) * self.hysteresis.settled(drive)
        return self.resonance.settled(self.creep.settled(moved, tick_s), tick_s)

    def follow(self, volts: Floats, tick_s: float, mean_v: float | None = None) -> Floats:
        """The same of a drive that begins after a long rest at its first voltage.

        The sensitivity is that at ``mean_v``, by default the mean of this drive; it does not change meanwhile.
        """
        drive = self._normalised(self.amplifier.follow(volts, tick_s))
        rest, memory = self.hysteresis.play(self._normalised(volts[:1]))
        factor = self._sensitivity(float(np.mean(volts)) if mean_v is None else mean_v)
        moved = factor * self.hysteresis.play(drive, memory)[0]
        at_rest = factor * float(rest[0])
        crept = self.creep.follow(moved, tick_s, at_rest)
        return self.resonance.follow(crept, tick_s, at_rest * float(self.creep.response(0.0).real))

    def response(self, f_hz: FloatsLike) -> npt.NDArray[np.complex128]:
        """The linear part of the response to small signals, hysteresis aside: amplifier, creep, resonance."""
        return self.amplifier.response(f_hz) * self.creep.response(f_hz) * self.resonance.response(f_hz)

    def _sensitivity(self, mean_v: float) -> float:
        return sensitivity(list(self.sensitivity), 2.0 * mean_v / self.v_max - 1.0)

    def _normalised(self, volts: Floats) -> Floats:
        """The drive, 0..1; the operator is made for no other.

        Rounded, since the last bits of a level that the amplifier holds would else be turning points.
        """
        low, high = float(np.min(volts)), float(np.max(volts))
        if low < -1e-6 * self.v_max or high > (1.0 + 1e-6) * self.v_max:
            raise ValueError(f"{low:g}..{high:g} V leaves the 0..{self.v_max:g} V of the virtual scanner")
        return np.clip(np.rint(volts * (_DRIVE_LEVELS / self.v_max)) / _DRIVE_LEVELS, 0.0, 1.0)


@dataclass(frozen=True)
class VirtualScanner:
    """Both axes; they do not couple."""

    name: str
    x: VirtualAxis
    y: VirtualAxis

    @classmethod
    def of(cls, truth: Truth) -> "VirtualScanner":
        """The scanner of a file."""
        return cls(truth.name, *(VirtualAxis.of(axis, truth.v_max, truth.amplifier) for axis in (truth.x, truth.y)))
