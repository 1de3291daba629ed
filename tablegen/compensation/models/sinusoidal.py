"""The sinusoidal model: one number a direction, equations (13)-(16)."""

from typing import ClassVar

from tablegen.compensation.branches import ByBranches
from tablegen.compensation.hysteresis import BranchShape


class SinusoidalModel(ByBranches, frozen=True, tag="sinusoidal"):
    """The residual is half a sine along the sweep; u_peak follows from beta, and is not read."""

    purpose: ClassVar[str] = "(15)"
    calibration: ClassVar[str] = "`calibrate hysteresis`, `calibrate images`; `u_peak` is not read"
    order: ClassVar[int] = 1

    @classmethod
    def sweep(cls, beta: float, u_peak: float) -> BranchShape:
        """Return the sweep of equation (15)."""
        return BranchShape.sinusoidal(beta)

    @classmethod
    def peak_at(cls, beta: float, u_peak: float) -> float:
        """Return the place of the peak by equation (16)."""
        return 0.5 + beta


MODEL = SinusoidalModel
