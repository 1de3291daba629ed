"""Dependence of the sensitivity on the offset voltage, equations (1)-(4), and the position that an offset gives."""

import numpy as np
from msgspec import Struct

from tablegen.base.figures import at_least, at_most
from tablegen.base.input_errors import Unphysical
from tablegen.numerics.arrays import tree_sum
from tablegen.numerics.driver import Driver
from tablegen.numerics.linear import Cholesky

_MIN_SPAN = 1e-3  # span of p, which runs from -1 to 1; a parabola through points closer than that is noise
_SIMPSON_PANELS = 1024  # panels of Simpson's rule; the integrand is smooth and the error below 1e-13


class OffsetLaw(Struct, frozen=True):
    """The law m(p) = 1 + alpha p + beta p^2, equation (1), with p in [-1, 1]; all dimensionless."""

    alpha: float = 0.0
    beta: float = 0.0

    def __post_init__(self) -> None:
        vertex = -self.alpha / (2.0 * self.beta) if self.beta else 0.0
        lowest = min(self.factor(p) for p in (-1.0, 1.0, max(-1.0, min(1.0, vertex))))
        if lowest <= 0.0:
            raise Unphysical(
                f"the amplitude factor falls to {lowest:.4g} inside the driver's range; it has to stay above 0"
            )

    @classmethod
    def from_ends(cls, m_minus: float, m_plus: float) -> "OffsetLaw":
        """Return the law of the factors at p = -1 and p = +1, equations (3) and (4)."""
        return cls(0.5 * (m_plus - m_minus), 0.5 * (m_plus + m_minus) - 1.0)

    @classmethod
    def fit(cls, p: list[float], apparent: list[float]) -> "OffsetLaw":
        """Fit the law to apparent sizes of one object (any unit) at three or more p: least squares, exact for three.

        The p of each point is used as given, since the paper advises points away from the edges. The apparent
        size is proportional to m; the size at the centre is a result of the fit.

        Raises
        ------
        Unphysical
            If the offsets do not determine a parabola, or m is not above 0 in the driver's range.
        """
        return cls.fitted(p, apparent)[0]

    @classmethod
    def fitted(cls, p: list[float], apparent: list[float]) -> "tuple[OffsetLaw, float]":
        """Return the law of ``fit``, and the apparent size at the centre.

        Raises
        ------
        Unphysical
            As ``fit``.
        """
        if len(set(p)) < 3:
            raise Unphysical(f"{len(set(p))} different offsets do not determine a parabola; at least 3 are needed")
        if max(p) - min(p) < _MIN_SPAN:
            raise Unphysical(
                f"the offsets span {0.5 * (max(p) - min(p)):.2g} of v_max; at least {0.5 * _MIN_SPAN:g} of it is "
                f"needed, better most of it"
            )
        x, y = np.asarray(p), np.asarray(apparent)
        # Orthogonal to the constant first: the normal equations of three close offsets stay accurate.
        middle = float(tree_sum(x)) / len(x)
        powers = np.stack([np.ones_like(x), x - middle, (x - middle) ** 2])
        scale = np.sqrt(tree_sum(powers * powers))
        powers = powers / scale[:, None]
        try:
            factor = Cholesky(tree_sum(powers[:, None, :] * powers[None, :, :]))
        except ArithmeticError:
            raise Unphysical("the offsets are too close together to determine a parabola") from None
        c = factor.solve(tree_sum(powers * y))
        residual = y - c[0] * powers[0] - c[1] * powers[1] - c[2] * powers[2]
        c = (c + factor.solve(tree_sum(powers * residual))) / scale
        quadratic, linear = float(c[2]), float(c[1] - 2.0 * c[2] * middle)
        centre = float(c[0] - c[1] * middle + c[2] * middle * middle)
        if centre <= 0.0:
            raise Unphysical(f"the fit gives an apparent size of {centre:.4g} at the centre; it has to be above 0")
        return cls(linear / centre, quadratic / centre), centre

    def factor(self, p: float) -> float:
        """Return m(p), equation (1)."""
        return 1.0 + self.alpha * p + self.beta * p * p

    def position_nm(self, v_offset: float, driver: Driver | float, k_nm_per_v: float) -> float:
        """Return the position in nm above that at 0 V: the integral of the slope k / m over the offset voltage."""
        if v_offset == 0.0:
            return 0.0
        p = Driver.of(driver).p(v_offset * (np.arange(_SIMPSON_PANELS + 1) / _SIMPSON_PANELS))
        slope = 1.0 / (1.0 + self.alpha * p + self.beta * p * p)
        weights = np.full(_SIMPSON_PANELS + 1, 2.0)
        weights[1::2] = 4.0
        weights[0] = weights[-1] = 1.0
        return k_nm_per_v * v_offset * float(tree_sum(weights * slope)) / (3.0 * _SIMPSON_PANELS)

    def voltage_at(self, position_nm: float, driver: Driver | float, k_nm_per_v: float) -> float:
        """Return the offset voltage of a position; the inverse of ``position_nm``.

        Raises
        ------
        Unphysical
            If the position is outside the driver's range.
        """
        driver = Driver.of(driver)
        low, high = (self.position_nm(end, driver, k_nm_per_v) for end in (driver.v_min, driver.v_max))
        if not low <= position_nm <= high:
            reach = f"{at_least(low, 6)}..{at_most(high, 6)} nm that {driver} reach"
            raise Unphysical(f"{position_nm:g} nm is outside the {reach}")
        v = driver.v_min + driver.span * (position_nm - low) / (high - low)
        for _ in range(60):  # Newton on a smooth, increasing function converges in a few rounds
            error = self.position_nm(v, driver, k_nm_per_v) - position_nm
            step = error * self.factor(driver.p(v)) / k_nm_per_v
            v = min(max(v - step, driver.v_min), driver.v_max)
            if abs(step) <= 1e-15 * driver.span:
                break
        return v


def normalised_offset(v_offset: float, driver: Driver | float) -> float:
    """Return p = 2 V_offset / V_max - 1, equation (2); with V_offset from v_min on, and V_max for the whole range."""
    return Driver.of(driver).p(v_offset)
