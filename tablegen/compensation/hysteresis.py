"""Hysteresis of the line, equations (13)-(22): the shape of each branch, and how it grows with the scan size."""

from dataclasses import dataclass
from math import atan, pi, sqrt

import numpy as np

from tablegen.numerics.arrays import Bools, Floats, FloatsLike
from tablegen.numerics.elementary import exp
from tablegen.numerics.turns import cosine, sine, sine_and_cosine
from tablegen.problems import Unphysical

# Where 1 - (pi/2) sin(pi u) = 0: the poles of (20), beyond which the residual peaks with the opposite sign.
LOWEST_PEAK = atan(0.5 * (pi - sqrt(pi * pi - 4.0))) * 2.0 / pi
HIGHEST_PEAK = 1.0 - LOWEST_PEAK


@dataclass(frozen=True, slots=True)
class BranchShape:
    """u(tau) = lambda tau + xi sin(pi tau) + xi_gamma (cos(pi tau) - 1) with lambda = 1 + 2 xi_gamma, (17), (18).

    tau in [0, 1] runs with the sweep, for both directions; the backward branch of (17) is 1 - u(1 - tau).
    The sinusoidal model (15) has xi_gamma = 0, the triangle xi = 0 as well. Dimensionless.
    """

    xi: float = 0.0
    xi_gamma: float = 0.0

    @property
    def linear(self) -> float:
        """lambda, equation (18)."""
        return 1.0 + 2.0 * self.xi_gamma

    @classmethod
    def sinusoidal(cls, beta: float) -> "BranchShape":
        """Equation (15)."""
        return cls(xi=beta)._checked(f"beta = {beta:.4g}")

    @classmethod
    def harmonic(cls, beta: float, u_peak: float) -> "BranchShape":
        """Equations (17)-(21): the residual u - tau peaks at beta, where u = u_peak.

        (19) and (20) are multiplied out: gamma itself is infinite at its poles, while xi and xi gamma are not.
        """
        u0 = u_peak - beta  # (21)
        if not LOWEST_PEAK < u0 < HIGHEST_PEAK:
            low, high = LOWEST_PEAK + beta, HIGHEST_PEAK + beta
            raise Unphysical(
                f"with beta = {beta:.4g} equation (20) needs {low:.4f} < u_peak < {high:.4f}; {u_peak:g} is outside"
            )
        s, c = float(sine(0.5 * u0)), float(cosine(0.5 * u0))
        numerator, denominator = -0.5 * pi * c, 1.0 - 0.5 * pi * s  # gamma = numerator / denominator
        scale = beta / (numerator * (c + 2.0 * u0 - 1.0) + denominator * s)
        shape = cls(xi=scale * denominator, xi_gamma=scale * numerator)
        return shape._checked(f"beta = {beta:.4g} at u_peak = {u_peak:g}")

    def _checked(self, what: str) -> "BranchShape":
        steepness = self.least_slope()
        if steepness <= 0.0:
            raise Unphysical(f"{what} makes the branch run backwards, its slope falls to {steepness:.4g}; lower it")
        return self

    def value(self, tau: FloatsLike) -> Floats:
        """u(tau), equation (17)."""
        tau = np.asarray(tau, dtype=np.float64)
        s, c = sine_and_cosine(0.5 * tau)
        return self.linear * tau + self.xi * s + self.xi_gamma * (c - 1.0)

    def slope(self, tau: FloatsLike) -> Floats:
        """du/dtau."""
        s, c = sine_and_cosine(0.5 * np.asarray(tau, dtype=np.float64))
        return self.linear + pi * (self.xi * c - self.xi_gamma * s)

    def inverse(self, u: FloatsLike) -> Floats:
        """tau(u): where the modelled piezo is when the normalised drive is u. Clipped to u in [0, 1]."""
        u = np.clip(np.asarray(u, dtype=np.float64), 0.0, 1.0)
        grid = np.linspace(0.0, 1.0, 1025)
        tau = np.interp(u, self.value(grid), grid)
        for _ in range(2):  # the grid is within 1e-6; each Newton step squares that
            tau = tau - (self.value(tau) - u) / self.slope(tau)
        return tau

    def least_slope(self) -> float:
        """The least du/dtau over [0, 1]: at an end, or where xi cos + ... turns, that is tan(pi tau) = -xi_gamma/xi."""
        candidates = [0.0, 1.0]
        if self.xi or self.xi_gamma:
            turning = (atan(-self.xi_gamma / self.xi) / pi) % 1.0 if self.xi else 0.5
            candidates.append(turning)
        return float(np.min(self.slope(candidates)))


@dataclass(frozen=True, slots=True)
class LineShape:
    """The periodic normalised waveform of one line: forward for 0 < t <= turn, backward after, (14) and (17)."""

    turn: float
    forward: BranchShape
    backward: BranchShape

    def value(self, t: FloatsLike) -> Floats:
        """w(t) with t in periods."""
        going, tau = self._split(t)
        return np.where(going, self.forward.value(tau), 1.0 - self.backward.value(tau))

    def slope(self, t: FloatsLike) -> Floats:
        """dw/dt per period."""
        going, tau = self._split(t)
        rise = self.forward.slope(tau) / self.turn
        return np.where(going, rise, -self.backward.slope(tau) / (1.0 - self.turn))

    def _split(self, t: FloatsLike) -> tuple[Bools, Floats]:
        t = np.asarray(t, dtype=np.float64)
        t = t - np.floor(t)
        going = t <= self.turn
        return going, np.where(going, t / self.turn, (t - self.turn) / (1.0 - self.turn))


def beta_at(v_scan_normalised: float, beta_max: float, rho: float) -> float:
    """Growth of the residual with the scan size, equation (22); rho is dimensionless."""
    return beta_max * (1.0 - exp(-rho * v_scan_normalised)) / (1.0 - exp(-rho))
