"""Nonlinearity of the scan size, equations (5)-(12)."""

from math import sqrt

from msgspec import Struct

from tablegen.base.figures import at_most
from tablegen.base.input_errors import Unphysical


class SizeLaw(Struct, frozen=True):
    """The size R = alpha V (1 + beta V) up to the threshold, (6), and its tangent beyond, (10); V = V_scan / V_max.

    ``alpha_nm`` is in nm per full scale. beta = 0 is the linear scanner.
    """

    alpha_nm: float
    beta: float
    v_threshold: float

    @classmethod
    def calibrated(cls, k_nm_per_v: float, v_max: float, beta: float, base_nm: float, v_threshold: float) -> "SizeLaw":
        """Return the law that reaches ``base_nm`` at the voltage base_nm / k, equation (8).

        In (8) k_scan is nm per full scale, that is k in nm/V times V_max. Where the base size lies beyond the
        threshold, alpha follows from (10) in place of (6), so that the calibration is met there too.

        Raises
        ------
        Unphysical
            If the base size needs more than v_max.
        """
        v_base = base_nm / (k_nm_per_v * v_max)
        if v_base > 1.0:
            reach = k_nm_per_v * v_max
            raise Unphysical(f"{base_nm:g} nm needs {v_base:.4g} of v_max; calibrate at {at_most(reach, 6)} nm or less")
        unit = cls(1.0, beta, v_threshold)
        return cls(base_nm / unit.size_nm(v_base), beta, v_threshold)

    def size_nm(self, v: float) -> float:
        """Return the scan size in nm at the normalised voltage v in [0, 1], equations (6) and (10)."""
        if v <= self.v_threshold:
            return self.alpha_nm * v * (1.0 + self.beta * v)
        threshold = self.v_threshold
        return self.alpha_nm * ((1.0 + 2.0 * self.beta * threshold) * v - self.beta * threshold * threshold)

    def voltage(self, size_nm: float) -> float:
        """Return the normalised voltage of a scan size in nm, equations (9) and (12).

        Raises
        ------
        Unphysical
            If the size needs more than v_max.
        """
        threshold = self.v_threshold
        if size_nm <= self.size_nm(threshold):
            ratio = size_nm / self.alpha_nm
            # (9) multiplied by its conjugate: no division by beta, hence exact for the linear scanner too.
            v = 2.0 * ratio / (1.0 + sqrt(1.0 + 4.0 * self.beta * ratio))
        else:
            bend = self.alpha_nm * self.beta * threshold * threshold
            v = (size_nm + bend) / (self.alpha_nm * (1.0 + 2.0 * self.beta * threshold))
        if v > 1.0 + 1e-12:  # full scale itself may come back a last place above 1
            raise Unphysical(f"{size_nm:g} nm needs {v:.4g} of v_max; at most {at_most(self.size_nm(1.0), 6)} nm fit")
        return min(v, 1.0)
