"""The harmonic model: the residual and where it peaks, equations (17)-(21)."""

from typing import ClassVar

from tablegen.compensation.branch import Branch
from tablegen.compensation.branches import ByBranches
from tablegen.compensation.hysteresis import HIGHEST_PEAK, LOWEST_PEAK, BranchShape


class HarmonicModel(ByBranches, frozen=True, tag="harmonic"):
    """One harmonic each way, whose residual peaks at u_peak: what `tablegen calibrate hysteresis` fits."""

    purpose: ClassVar[str] = "(17)-(21)"
    calibration: ClassVar[str] = "`calibrate hysteresis`, `calibrate images`"
    order: ClassVar[int] = 2

    @classmethod
    def sweep(cls, beta: float, u_peak: float) -> BranchShape:
        """Return the sweep of equations (17)-(21)."""
        return BranchShape.harmonic(beta, u_peak)

    @classmethod
    def peak_at(cls, beta: float, u_peak: float) -> float:
        """Return the place of the peak in the table."""
        return u_peak

    @classmethod
    def wrong_key(cls, beta: float, u_peak: float) -> str | None:
        """Return ``u_peak`` outside the poles of (20); elsewhere None, since the residual is wrong."""
        return None if LOWEST_PEAK < u_peak - beta < HIGHEST_PEAK else "u_peak"

    def lacking(self, branch: Branch) -> list[str]:
        """Return the keys of the peaks that are not given."""
        return branch.without_peak


MODEL = HarmonicModel
