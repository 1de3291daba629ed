"""One harmonic of hysteresis, equations (13)-(22): the shape of a branch, and how it grows with the scan size."""

from math import atan, pi, sqrt
from typing import ClassVar

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.compensation.line import Sweep
from tablegen.numerics.arrays import Floats, FloatsLike
from tablegen.numerics.elementary import exp
from tablegen.numerics.moments import plain_moment, ramp_moment
from tablegen.numerics.turns import sine_and_cosine, sine_and_cosine_of

# Where 1 - (pi/2) sin(pi u) = 0: the poles of (20), beyond which the residual peaks with the opposite sign.
LOWEST_PEAK = atan(0.5 * (pi - sqrt(pi * pi - 4.0))) * 2.0 / pi
HIGHEST_PEAK = 1.0 - LOWEST_PEAK


class BranchShape(Sweep):
    """A branch u(tau) = lambda tau + xi sin(pi tau) + xi_gamma (cos(pi tau) - 1), lambda = 1 + 2 xi_gamma, (17), (18).

    tau in [0, 1] runs with the sweep, for both directions; the backward branch of (17) is 1 - u(1 - tau).
    The sinusoidal model (15) has xi_gamma = 0, the triangle xi = 0 as well. Dimensionless.
    """

    COORDINATES: ClassVar[tuple[str, ...]] = ("xi", "xi_gamma")

    __slots__ = ("xi", "xi_gamma")

    def __init__(self, xi: float = 0.0, xi_gamma: float = 0.0) -> None:
        self.xi, self.xi_gamma = xi, xi_gamma

    @property
    def linear(self) -> float:
        """The slope lambda of equation (18)."""
        return 1.0 + 2.0 * self.xi_gamma

    @property
    def lag(self) -> float:
        """The lag xi of the sweep behind the drive in its first mode.

        Its sign is certain even where few data leave the skew, and with it the sign of the peak, open.
        """
        return self.xi

    @classmethod
    def sinusoidal(cls, beta: float) -> "BranchShape":
        """Return the branch of equation (15).

        Raises
        ------
        Unphysical
            If the branch would run backwards.
        """
        return cls(xi=beta)._checked(f"beta = {beta:.4g}")

    @classmethod
    def harmonic(cls, beta: float, u_peak: float) -> "BranchShape":
        """Return the branch of equations (17)-(21): the residual u - tau peaks at beta, where u = u_peak.

        (19) and (20) are multiplied out: gamma itself is infinite at its poles, while xi and xi gamma are not.

        Raises
        ------
        Unphysical
            If the peak is outside the poles of (20), or the branch would run backwards.
        """
        u0 = u_peak - beta  # (21)
        if not LOWEST_PEAK < u0 < HIGHEST_PEAK:
            low, high = LOWEST_PEAK + beta, HIGHEST_PEAK + beta
            raise Unphysical(
                f"with beta = {beta:.4g} equation (20) needs {low:.4f} < u_peak < {high:.4f}; {u_peak:g} is outside"
            )
        s, c = sine_and_cosine_of(0.5 * u0)
        numerator, denominator = -0.5 * pi * c, 1.0 - 0.5 * pi * s  # gamma = numerator / denominator
        scale = beta / (numerator * (c + 2.0 * u0 - 1.0) + denominator * s)
        shape = cls(xi=scale * denominator, xi_gamma=scale * numerator)
        return shape._checked(f"beta = {beta:.4g} at u_peak = {u_peak:g}")

    def _checked(self, what: str) -> "BranchShape":
        steepness = self.least_slope()
        if steepness <= 0.0:
            raise Unphysical(f"{what} makes the branch run backwards, its slope falls to {steepness:.4g}; lower it")
        return self

    @classmethod
    def at(cls, coordinates: Floats) -> "BranchShape":
        """Return the branch at a point of ``basis``, whether it is monotonic or not.

        Parameters
        ----------
        coordinates
            xi and xi_gamma, shape (2,).

        Returns
        -------
        BranchShape
            Its parameters are not checked.
        """
        return cls(float(coordinates[0]), float(coordinates[1]))

    @property
    def coordinates(self) -> Floats:
        """The coordinates of the branch in ``basis``.

        Returns
        -------
        Floats
            xi and xi_gamma, shape (2,).
        """
        return np.array([self.xi, self.xi_gamma])

    @staticmethod
    def basis(tau: Floats) -> tuple[Floats, Floats]:
        """Return the derivatives of u(tau) by each coordinate.

        The branch is tau and a sum of these, so that fits are linear and have no poles. For calibration: numpy's sines,
        whose last bits differ between processors.

        Parameters
        ----------
        tau
            Places in the sweep, 0..1, any shape.

        Returns
        -------
        by_xi, by_xi_gamma
            Each of the shape of ``tau``.
        """
        return np.sin(pi * tau), 2.0 * tau + np.cos(pi * tau) - 1.0

    def peak(self) -> tuple[float, float]:
        """Return beta and u_peak: u - tau has one extreme between the poles of (20)."""
        tau = np.linspace(LOWEST_PEAK, HIGHEST_PEAK, 257)
        slope = pi * self.xi * np.cos(pi * tau) + self.xi_gamma * (2.0 - pi * np.sin(pi * tau))
        turning = np.flatnonzero(np.sign(slope[1:]) != np.sign(slope[:-1]))
        if not len(turning):  # no hysteresis at all
            return 0.0, 0.5
        at = int(turning[0])
        low, high = float(tau[at]), float(tau[at + 1])
        rising = slope[at] > 0.0
        for _ in range(60):
            middle = 0.5 * (low + high)
            value = pi * self.xi * np.cos(pi * middle) + self.xi_gamma * (2.0 - pi * np.sin(pi * middle))
            low, high = (middle, high) if (value > 0.0) == rising else (low, middle)
        beta = self.xi * np.sin(pi * low) + self.xi_gamma * (np.cos(pi * low) - 1.0 + 2.0 * low)
        return float(beta), float(low + beta)

    def value(self, tau: FloatsLike) -> Floats:
        """Return u(tau), equation (17).

        Parameters
        ----------
        tau
            Places in the sweep, 0..1, any shape.

        Returns
        -------
        Floats
            Normalised drive, shape of ``tau``.
        """
        return self.value_and_slope(tau)[0]

    def slope(self, tau: FloatsLike) -> Floats:
        """Return du/dtau, the derivative of (17).

        Parameters
        ----------
        tau
            Places in the sweep, 0..1, any shape.

        Returns
        -------
        Floats
            Shape of ``tau``.
        """
        return self.value_and_slope(tau)[1]

    def value_and_slope(self, tau: FloatsLike) -> tuple[Floats, Floats]:
        """Return u(tau) and du/dtau, from the same sines.

        Parameters
        ----------
        tau
            Places in the sweep, 0..1, any shape.

        Returns
        -------
        value, slope
            Each of the shape of ``tau``.
        """
        tau = np.asarray(tau, dtype=np.float64)
        s, c = sine_and_cosine(0.5 * tau)
        value = self.linear * tau + self.xi * s + self.xi_gamma * (c - 1.0)
        return value, self.linear + pi * (self.xi * c - self.xi_gamma * s)

    def moments(self, y: Floats) -> tuple[Floats, Floats]:
        """Return int_0^1 u(s) exp(-2 pi i y s) ds in closed form.

        Parameters
        ----------
        y
            Periods of the kernel in the sweep, any shape.

        Returns
        -------
        real, imaginary
            Each of the shape of ``y``.
        """
        ramp, plain = ramp_moment(y), plain_moment(y)
        below, above = plain_moment(y - 0.5), plain_moment(y + 0.5)  # of exp(+- i pi s) times the kernel
        sine = 0.5 * (below[1] - above[1]), 0.5 * (above[0] - below[0])
        cosine = 0.5 * (below[0] + above[0]), 0.5 * (below[1] + above[1])
        linear, xi, xi_gamma = self.linear, self.xi, self.xi_gamma
        return (
            linear * ramp[0] + xi * sine[0] + xi_gamma * (cosine[0] - plain[0]),
            linear * ramp[1] + xi * sine[1] + xi_gamma * (cosine[1] - plain[1]),
        )

    def least_slope(self) -> float:
        """Return the least du/dtau over [0, 1]: at an end, or at the extreme, where tan(pi tau) = -xi_gamma/xi."""
        candidates = [0.0, 1.0]
        if self.xi or self.xi_gamma:
            turning = (atan(-self.xi_gamma / self.xi) / pi) % 1.0 if self.xi else 0.5
            candidates.append(turning)
        waves = [sine_and_cosine_of(0.5 * tau) for tau in candidates]
        return min(self.linear + pi * (self.xi * c - self.xi_gamma * s) for s, c in waves)


def beta_at(v_scan_normalised: float, beta_max: float, rho: float) -> float:
    """Return the residual at a normalised scan voltage by equation (22); rho is dimensionless."""
    return beta_max * (1.0 - exp(-rho * v_scan_normalised)) / (1.0 - exp(-rho))
