"""The line that a model makes: a sweep each way, what the drive is to follow, and how the piezo follows a drive.

Most models give the shape of two sweeps (``LineShape``), and the band limit is fitted to it. A model that makes the
whole periodic waveform itself gives a ``WholeLine``.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from pathlib import Path
from typing import Any, Self

import numpy as np
from msgspec import Struct

from tablegen.base.input_errors import Unphysical
from tablegen.compensation.dynamics import Response
from tablegen.compensation.identification import NO_IDENTIFICATION, Identification
from tablegen.numerics.arrays import Floats, FloatsLike
from tablegen.numerics.driver import Driver
from tablegen.waveform.error_allowance import AllowedError
from tablegen.waveform.series import FourierSeries

_GRID = 1025  # points on which a sweep is inverted first


class Sweep(ABC):
    """One direction of a line: the normalised drive u at the place tau of the line; both run 0..1 with the sweep.

    The backward direction of the line is 1 - u(1 - x) at the place x. A subclass has ``value`` and ``slope``.
    """

    __slots__ = ()

    @abstractmethod
    def value(self, tau: FloatsLike) -> Floats:
        """Return u(tau).

        Parameters
        ----------
        tau
            Places in the sweep, 0..1, any shape.

        Returns
        -------
        Floats
            Normalised drive, shape of ``tau``.
        """

    @abstractmethod
    def slope(self, tau: FloatsLike) -> Floats:
        """Return du/dtau, above 0.

        Parameters
        ----------
        tau
            Places in the sweep, 0..1, any shape.

        Returns
        -------
        Floats
            Shape of ``tau``.
        """

    def value_and_slope(self, tau: FloatsLike) -> tuple[Floats, Floats]:
        """Return value and slope at the same places; a subclass may compute them together.

        Parameters
        ----------
        tau
            Places in the sweep, 0..1, any shape.

        Returns
        -------
        value, slope
            Each of the shape of ``tau``.
        """
        return self.value(tau), self.slope(tau)

    def inverse(self, u: FloatsLike) -> Floats:
        """Return tau(u): where the modelled piezo is when the normalised drive is u.

        Parameters
        ----------
        u
            Normalised drive, clipped to 0..1, any shape.

        Returns
        -------
        Floats
            Places in the sweep, shape of ``u``.
        """
        u = np.clip(np.asarray(u, dtype=np.float64), 0.0, 1.0)
        grid = np.linspace(0.0, 1.0, _GRID)
        tau = np.interp(u, self.value(grid), grid)
        for _ in range(2):  # the grid is within 1e-6; each Newton step squares that
            value, slope = self.value_and_slope(tau)
            tau = tau - (value - u) / slope
        return tau

    def moments(self, y: Floats) -> tuple[Floats, Floats]:
        """Return int_0^1 u(s) exp(-2 pi i y s) ds, for a Fourier series in closed form.

        Parameters
        ----------
        y
            Periods of the kernel in the sweep, any shape.

        Returns
        -------
        real, imaginary
            Each of the shape of ``y``.

        Raises
        ------
        Unphysical
            If the model has no closed form.
        """
        raise Unphysical("this model of the piezo has no Fourier series in closed form; use method = 'window'")


class AppliedBranch(Struct, frozen=True):
    """Hysteresis of one branch at this scan size; ``u_peak`` in sweep-aligned coordinates."""

    beta: float
    u_peak: float

    @classmethod
    def of(cls, sweep: Sweep) -> "AppliedBranch":
        """Return the largest residual u - tau of any sweep, on a grid."""
        tau = np.linspace(0.0, 1.0, _GRID)
        u = sweep.value(tau)
        at = int(np.argmax(np.abs(u - tau)))
        return cls(float(u[at] - tau[at]), float(u[at]))


class LineShape(Struct, frozen=True):
    """The periodic normalised waveform of one line: forward for 0 < t <= turn, backward after, (14) and (17).

    ``applied`` is the residual in the manifest and in ``tablegen show``; without it, it is computed from the sweeps.
    ``identification`` is what the model knows of the piezo besides.
    """

    turn: float
    forward: Sweep
    backward: Sweep
    applied: tuple[AppliedBranch, AppliedBranch] | None = None
    identification: Identification = NO_IDENTIFICATION

    @property
    def peaks(self) -> tuple[AppliedBranch, AppliedBranch]:
        """The residual of each sweep, forward and backward."""
        return self.applied or (AppliedBranch.of(self.forward), AppliedBranch.of(self.backward))

    @property
    def whole(self) -> "WholeLine | None":
        """The line, where the model itself makes the waveform; None leaves that to ``band_limit`` of the scan."""
        return None

    def value(self, t: FloatsLike) -> Floats:
        """Return w(t), (14) and (17).

        Parameters
        ----------
        t
            Times in periods, any shape.

        Returns
        -------
        Floats
            Normalised drive, shape of ``t``.
        """
        return self._by_sweep(t, self.forward.value, lambda tau: 1.0 - self.backward.value(tau))

    def slope(self, t: FloatsLike) -> Floats:
        """Return dw/dt.

        Parameters
        ----------
        t
            Times in periods, any shape.

        Returns
        -------
        Floats
            Per period, shape of ``t``.
        """
        return self._by_sweep(
            t,
            lambda tau: self.forward.slope(tau) / self.turn,
            lambda tau: -self.backward.slope(tau) / (1.0 - self.turn),
        )

    def followed(
        self, side: str, position: Floats, drive: FourierSeries, value: Floats, slope: Floats
    ) -> tuple[Floats, Floats]:
        """Return how the piezo follows a drive where the line is at ``position`` in one direction.

        To first order in a deviation of at most some percent: x - tau = (w - u) / u'. A model that knows more of the
        drive than its values there overrides this.

        Parameters
        ----------
        position, value, slope
            The line's positions, and ``drive`` and its slope at these times; each (n,).

        Returns
        -------
        error, speed
            The place less ``position``, as a fraction of the line, and the speed over the line's; each (n,).
        """
        times = self.times(side, position)
        sweep = self.forward if side == "forward" else self.backward
        steepness = sweep.slope(position if side == "forward" else 1.0 - position)
        return (value - self.value(times)) / steepness, slope / self.slope(times)

    def times(self, side: str, position: Floats) -> Floats:
        """Return when the sweep of one direction passes a normalised position.

        Parameters
        ----------
        side
            "forward" or "backward".
        position
            Positions on the line, 0..1, any shape.

        Returns
        -------
        Floats
            Times in periods, shape of ``position``.
        """
        return self.turn * position if side == "forward" else self.turn + (1.0 - self.turn) * (1.0 - position)

    def _by_sweep(
        self, t: FloatsLike, forward: Callable[[Floats], Floats], backward: Callable[[Floats], Floats]
    ) -> Floats:
        """Return the values of either sweep at its own times, of the shape of ``t``."""
        t = np.asarray(t, dtype=np.float64)
        t = t - np.floor(t)
        going = t <= self.turn
        returning = ~going
        values = np.empty(t.shape)
        if going.any():
            values[going] = forward(t[going] / self.turn)
        if returning.any():
            values[returning] = backward((t[returning] - self.turn) / (1.0 - self.turn))
        return values


class SweptSeries(Sweep):
    """One sweep of a waveform that rises once and falls once; it can be inverted only where it does."""

    __slots__ = ("forward", "series", "turn")

    def __init__(self, series: FourierSeries, turn: float, forward: bool) -> None:
        self.series, self.turn, self.forward = series, turn, forward

    def value(self, tau: FloatsLike) -> Floats:
        """Return u(tau).

        Parameters
        ----------
        tau
            Places in the sweep, 0..1, any shape.

        Returns
        -------
        Floats
            Normalised drive, shape of ``tau``.
        """
        w = self.series.value(self._times(tau))
        return w if self.forward else 1.0 - w

    def slope(self, tau: FloatsLike) -> Floats:
        """Return du/dtau.

        Parameters
        ----------
        tau
            Places in the sweep, 0..1, any shape.

        Returns
        -------
        Floats
            Shape of ``tau``.
        """
        rise = self.series.value(self._times(tau), 1)
        return self.turn * rise if self.forward else (self.turn - 1.0) * rise

    def _times(self, tau: FloatsLike) -> Floats:
        tau = np.asarray(tau, dtype=np.float64)
        return self.turn * tau if self.forward else self.turn + (1.0 - self.turn) * tau


class AccelerationTrade(Struct, frozen=True, eq=False):
    """The scaling error of a ``WholeLine`` that was allowed for the sake of less acceleration, in percent.

    The piezo follows ``straight_series`` straight; ``beside_percent`` is the scaling error against it.
    """

    percent: float
    straight_series: FourierSeries | None = None
    beside_percent: float | None = None


class WholeLine(LineShape, frozen=True, kw_only=True):
    """A line whose waveform the model itself makes, in the harmonics that are played.

    ``trade`` is there where the model kept ``LineRequest.allowed``.
    """

    series: FourierSeries
    trade: AccelerationTrade | None = None

    @classmethod
    def of(cls, series: FourierSeries, turn: float, **more: Any) -> "Self":
        """Return the line of a waveform w(t), straight on the scanner by the model; ``more`` is for subclasses."""
        return cls(turn, SweptSeries(series, turn, True), SweptSeries(series, turn, False), series=series, **more)

    @property
    def whole(self) -> "WholeLine":
        """The line itself."""
        return self

    @property
    def straight(self) -> "WholeLine":
        """The line that the piezo follows straight, before acceleration was traded for error."""
        straight = None if self.trade is None else self.trade.straight_series
        return self if straight is None else WholeLine.of(straight, self.turn)

    def value(self, t: FloatsLike) -> Floats:
        """Return w(t).

        Parameters
        ----------
        t
            Times in periods, any shape.

        Returns
        -------
        Floats
            Normalised drive, shape of ``t``.
        """
        return self.series.value(t)

    def slope(self, t: FloatsLike) -> Floats:
        """Return dw/dt.

        Parameters
        ----------
        t
            Times in periods, any shape.

        Returns
        -------
        Floats
            Per period, shape of ``t``.
        """
        return self.series.value(t, 1)


class SineLine(WholeLine, frozen=True, kw_only=True):
    """A line whose drive is a sine: it is not straight in time, but the model knows where the piezo is.

    ``place`` is the position over a period, as a share of the line: from 0, where it turns, to 1 and back.
    """

    place: FourierSeries


class LineRequest(Struct, frozen=True):
    """The request of a scan to the model of one axis.

    ``v`` is the normalised scan voltage V_scan / V_max, in [0, 1], V_max the whole range of the
    ``driver``; ``v_amplitude`` = m g V_scan, volts peak to peak at
    the piezo for w from 0 to 1; ``harmonics`` the highest that is played; ``both`` whether both directions image.
    ``response`` are the dynamics, whose inverse gives no harmonic more than ``max_boost_db``; ``factor_at`` is m of (1)
    at an offset as a share of the driver's range, for small scans, ``rate_gain`` g of (23) at a rate in Hz, None
    where it is not calibrated. ``allowed`` is the scaling error in the window that may be left for the sake of
    less acceleration: a model that makes the whole waveform itself keeps it, where it is not None. ``sine`` asks for a
    ``SineLine``; a model that does not know where the piezo is at each time makes its own line all the same. ``v`` and
    ``v_amplitude`` are 0 where the size law refuses the size, and ``size_nm`` is where nothing gives one; the model is
    called all the same, so that its own faults are reported in the same run.
    """

    axis: str
    turn: float
    v: float
    driver: Driver
    v_amplitude: float
    v_offset: float
    size_nm: float
    rate_hz: float
    harmonics: int
    window: tuple[float, float]
    both: bool
    response: Response | None
    max_boost_db: float
    factor_at: Callable[[float], float]
    rate_gain: Callable[[float], float] | None
    folder: Path
    allowed: AllowedError | None = None
    sine: bool = False

    @property
    def v_share(self) -> float:
        """The offset as a share of the driver's range."""
        return self.driver.share(self.v_offset)
