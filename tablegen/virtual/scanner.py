"""The virtual scanner: volts at the amplifier's output stage in, nanometres out.

The order is dead time, amplifier bandwidth, hysteresis, sensitivity at the mean drive, creep, resonances; the axes are
independent but for their coupling. The mean drive is that of the whole period or, with a memory, of the last tens of
seconds.
"""

from dataclasses import dataclass
from math import pi
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from tablegen.config.scanner import Coupling
from tablegen.numerics.arrays import Floats, FloatsLike
from tablegen.numerics.driver import Driver
from tablegen.virtual import parameters
from tablegen.virtual.creep import logarithmic_creep
from tablegen.virtual.modes import Modes, delay, low_pass, second_order, side_by_side
from tablegen.virtual.parameters import Truth, sensitivity

NO_COUPLING = Coupling()
_STRAIGHT = Modes(1.0)
_DRIVE_LEVELS = 2.0**36  # levels of the drive


class HysteresisOperator(Protocol):
    """Hysteresis of any family: a drive of 0..1 to nm above rest at drive 0."""

    def play(self, drive: Floats, memory: Any = None) -> tuple[Floats, Any]:
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
        """

    def settled(self, drive: Floats) -> Floats:
        """Return the displacement over one period of a drive that has been repeated for ever.

        Returns
        -------
        Displacement in nm, of the shape (ticks,) of ``drive``.
        """

    def middle(self, drive: FloatsLike) -> Floats:
        """Return the displacement between the branches.

        Returns
        -------
        Displacement in nm, of the shape of ``drive`` (0..1).
        """


@dataclass(frozen=True)
class VirtualAxis:
    """One axis. Displacements are in nm above the axis at rest at the driver's v_min."""

    driver: Driver
    amplifier: Modes
    hysteresis: HysteresisOperator
    sensitivity: tuple[float, ...]
    creep: Modes
    resonance: Modes
    memory: Modes | None = None
    dead_time_s: float = 0.0

    @classmethod
    def of(cls, axis: parameters.AxisTruth, v_max: float, amplifier: parameters.AmplifierTruth) -> "VirtualAxis":
        """Build the axis from the parameters of a file."""
        c, r, other = axis.creep, axis.resonance, axis.second_resonance
        creep = _STRAIGHT
        if c is not None:
            creep = logarithmic_creep(c.loss_per_decade, c.reference_hz, c.fastest_s, c.slowest_s, c.terms_per_decade)
        resonance = _STRAIGHT if r is None else second_order(r.frequency_hz, r.quality)
        if other is not None:
            resonance = side_by_side(resonance, second_order(other.frequency_hz, other.quality), other.share)
        remembered = axis.sensitivity_memory_s
        return cls(
            driver=Driver(v_max),
            amplifier=_STRAIGHT if amplifier.bandwidth_hz is None else low_pass(amplifier.bandwidth_hz),
            hysteresis=axis.hysteresis.operator(),
            sensitivity=tuple(axis.sensitivity),
            creep=creep,
            resonance=resonance,
            memory=None if remembered is None else low_pass(0.5 / (pi * remembered)),
            dead_time_s=axis.dead_time_s,
        )

    def settled(self, volts: Floats, tick_s: float) -> Floats:
        """Return the displacement over one period that has been repeated for ever.

        Parameters
        ----------
        volts
            One period in V, held tick by tick, shape (ticks,).
        tick_s
            Length of a tick in s.

        Returns
        -------
        Mean displacement in nm over each tick, shape (ticks,).

        Raises
        ------
        ValueError
            If the drive leaves the range of the driver.
        """
        late = delay(volts, self.dead_time_s / tick_s)
        drive = self._normalised(self.amplifier.settled(late, tick_s))
        mean_v: FloatsLike = float(np.mean(volts)) if self.memory is None else self.memory.settled(late, tick_s)
        displacement = self._with_sensitivity(self.hysteresis.settled(drive), mean_v)
        return self.resonance.settled(self.creep.settled(displacement, tick_s), tick_s)

    def follow(self, volts: Floats, tick_s: float, mean_v: float | None = None) -> Floats:
        """Return the response to a drive that begins after a long rest at its first voltage.

        Parameters
        ----------
        volts
            Drive in V, held tick by tick, shape (ticks,).
        tick_s
            Length of a tick in s.
        mean_v
            Without a memory the mean drive in V at which the sensitivity is taken, by default that of ``volts``; with a
            memory the mean drive before, by default the first voltage.

        Returns
        -------
        Mean displacement in nm over each tick, shape (ticks,).

        Raises
        ------
        ValueError
            If the drive leaves the range of the driver.
        """
        first = float(volts[0])
        late = delay(volts, self.dead_time_s / tick_s, first)
        drive = self._normalised(self.amplifier.follow(late, tick_s))
        rest, memory = self.hysteresis.play(self._normalised(volts[:1]))
        bias: FloatsLike
        if self.memory is None:
            start = bias = float(np.mean(volts)) if mean_v is None else mean_v
        else:
            start = first if mean_v is None else mean_v
            bias = self.memory.follow(late, tick_s, start)
        displacement = self._with_sensitivity(self.hysteresis.play(drive, memory)[0], bias)
        at_rest = float(self._with_sensitivity(rest, start)[0])
        crept = self.creep.follow(displacement, tick_s, at_rest)
        return self.resonance.follow(crept, tick_s, at_rest * float(self.creep.response(0.0).real))

    def response(self, f_hz: FloatsLike) -> npt.NDArray[np.complex128]:
        """Return the linear response to small signals, without hysteresis: dead time, amplifier, creep, resonance.

        Returns
        -------
        Complex gains, of the shape of ``f_hz``.
        """
        late = np.exp(-2j * pi * self.dead_time_s * np.asarray(f_hz, dtype=np.float64))
        linear = self.amplifier.response(f_hz) * self.creep.response(f_hz) * self.resonance.response(f_hz)
        return np.asarray(late * linear, dtype=np.complex128)

    def _with_sensitivity(self, displacement: Floats, mean_v: FloatsLike) -> Floats:
        """Apply the sensitivity; with a memory it scales about the displacement at the remembered drive."""
        factor = self._sensitivity(mean_v)
        if self.memory is None:
            return np.asarray(factor * displacement, dtype=np.float64)
        about = self.hysteresis.middle(np.clip(self.driver.share(np.asarray(mean_v, dtype=np.float64)), 0.0, 1.0))
        return np.asarray(about + factor * (displacement - about), dtype=np.float64)

    def _sensitivity(self, mean_v: FloatsLike) -> Floats:
        return sensitivity(self.sensitivity, self.driver.p(np.asarray(mean_v, dtype=np.float64)))

    def _normalised(self, volts: Floats) -> Floats:
        """Normalise the drive to 0..1; the operator is made for no other.

        Rounded, since the last bits of a level that the amplifier holds would else be turning points.
        """
        low, high = float(np.min(volts)), float(np.max(volts))
        driver = self.driver
        if driver.beyond(low, high) > 1e-6 * driver.span:
            raise ValueError(f"{low:g}..{high:g} V leaves the {driver} of the virtual scanner")
        return np.clip(np.rint((volts - driver.v_min) * (_DRIVE_LEVELS / driver.span)) / _DRIVE_LEVELS, 0.0, 1.0)


@dataclass(frozen=True)
class VirtualScanner:
    """The two axes, and how they couple."""

    name: str
    x: VirtualAxis
    y: VirtualAxis
    coupling: Coupling = NO_COUPLING

    @classmethod
    def of(cls, truth: Truth) -> "VirtualScanner":
        """Return the scanner of a file."""
        x, y = (VirtualAxis.of(axis, truth.v_max, truth.amplifier) for axis in (truth.x, truth.y))
        return cls(truth.name, x, y, truth.coupling)
