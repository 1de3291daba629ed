"""How the hysteresis of one direction depends on the scan size: equation (22), or as it was measured."""

from dataclasses import dataclass

from tablegen.compensation.hysteresis import beta_at
from tablegen.config.figures import at_most
from tablegen.config.schema import Branch
from tablegen.problems import Unphysical

# Measured points serve scans this much larger than the largest of them, of v_max.
SIZE_REACH = 0.1


@dataclass(frozen=True, slots=True)
class ResidualLaw:
    """beta and u_peak against the normalised scan voltage v.

    With ``points``, (v, beta, u_peak) ascending in v, both are linear between points; below the first beta falls to 0
    at v = 0 and u_peak stays, beyond the last both stay. Without, beta is (22) of beta_max and rho, u_peak one number.
    """

    beta_max: float = 0.0
    rho: float = 1.5
    u_peak: float = 0.5
    points: tuple[tuple[float, float, float], ...] = ()

    @classmethod
    def of(cls, branch: Branch, v_max: float) -> "ResidualLaw":
        """As the scanner file has it."""
        if branch.points is not None:
            rows = [
                (point.size_v / v_max, point.beta, 0.5 if point.u_peak is None else point.u_peak)
                for point in branch.points
            ]
            return cls(points=tuple(sorted(rows)))
        peak = 0.5 if branch.u_peak is None else branch.u_peak
        return cls(0.0 if branch.beta_max is None else branch.beta_max, branch.rho, peak)

    def at(self, v: float, v_max: float) -> tuple[float, float]:
        """beta and u_peak at a normalised scan voltage.

        Raises ``Unphysical`` for a scan that is larger than what was measured.
        """
        if not self.points:
            return beta_at(v, self.beta_max, self.rho), self.u_peak
        largest = self.points[-1][0]
        if v > largest + SIZE_REACH + 1e-9:
            served = at_most((largest + SIZE_REACH) * v_max, 6)
            raise Unphysical(
                f"measured up to {largest * v_max:g} V, which serves scans up to {served} V; this one takes "
                f"{v * v_max:.6g} V; measure a larger one"
            )
        before = (0.0, 0.0, self.points[0][2])
        for point in self.points:
            if v <= point[0]:
                share = (v - before[0]) / (point[0] - before[0])
                return before[1] + share * (point[1] - before[1]), before[2] + share * (point[2] - before[2])
            before = point
        return before[1], before[2]
