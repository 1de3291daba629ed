"""Hysteresis of one direction in the scanner file, and how it depends on the scan size: (22), or as measured."""

from collections.abc import Mapping
from typing import Annotated, Any

from msgspec import Meta, Struct

from tablegen.base.quantities import Normalised
from tablegen.compensation.hysteresis import beta_at
from tablegen.compensation.model import Parameters
from tablegen.compensation.points import HysteresisPoint, OffsetRows, Residual, Rows, between_points, rows_of
from tablegen.numerics.driver import Driver

Decay = Annotated[float, Meta(ge=1e-6, le=100.0)]
LAW = ("beta_max", "rho", "u_peak")  # keys of (22)
MEASURED = ("points",)  # keys of what takes its place


class Branch(Parameters, frozen=True):
    """Hysteresis of one direction, by (22) or by `points`. Both directions have u_peak in sweep-aligned coordinates."""

    beta_max: (
        Annotated[
            Residual, Meta(description="peak residual at full scale, as a fraction of the scan; or give `points`")
        ]
        | None
    ) = None
    rho: Annotated[Decay, Meta(description="dimensionless decay constant of (22)")] = 1.5
    u_peak: Annotated[Normalised, Meta(description="position of the peak residual; harmonic model only")] | None = None
    points: (
        Annotated[
            list[HysteresisPoint],
            Meta(
                min_length=1,
                max_length=64,
                description="measured values that replace (22); interpolated linearly, from 0 at 0 V",
            ),
        ]
        | None
    ) = None

    @classmethod
    def contradictions(cls, written: Mapping[str, Any]) -> list[tuple[str, str]]:
        """Return the faults of a branch that has neither of the two ways of calibration, or both."""
        if "points" in written:
            return [(name, "points is given as well; keep one of the two") for name in LAW if name in written]
        if "beta_max" not in written:
            return [("beta_max", "missing; give beta_max, rho and u_peak of (22), or points")]
        return []

    @property
    def without_peak(self) -> list[str]:
        """The keys of the peaks that are not given."""
        if self.points:
            return [f"points[{j}].u_peak" for j, point in enumerate(self.points) if point.u_peak is None]
        return ["u_peak"] if self.u_peak is None else []


class ResidualLaw(Struct, frozen=True):
    """The residual beta and its place u_peak against the normalised scan voltage v.

    With ``points``, (v, beta, u_peak) ascending in v, they are interpolated between these; with ``offsets``, between
    those of two offsets. Without, beta is (22) of beta_max and rho, u_peak one number.
    """

    beta_max: float = 0.0
    rho: float = 1.5
    u_peak: float = 0.5
    points: Rows = ()
    offsets: OffsetRows | None = None

    @classmethod
    def of(cls, branch: Branch, driver: Driver | float) -> "ResidualLaw":
        """Return the law of a branch of the scanner file."""
        if branch.points is not None and branch.points[0].offset_v is not None:
            return cls(offsets=OffsetRows.of(branch.points, driver))
        if branch.points is not None:
            return cls(points=rows_of(branch.points, Driver.of(driver).span))
        peak = 0.5 if branch.u_peak is None else branch.u_peak
        return cls(0.0 if branch.beta_max is None else branch.beta_max, branch.rho, peak)

    @property
    def measured(self) -> bool:
        """True if the law is that of measured points."""
        return bool(self.points) or self.offsets is not None

    def at(self, v: float, driver: Driver | float, v_offset: float | None = None) -> tuple[float, float]:
        """Return beta and u_peak at a normalised scan voltage and an offset in V (default: the middle of the range).

        Raises
        ------
        Unphysical
            If the scan is larger than what was measured, or far from its offsets.
        """
        driver = Driver.of(driver)
        if self.offsets is not None:
            return self.offsets.at(v, 0.5 if v_offset is None else driver.share(v_offset), driver)
        if self.points:
            return between_points(self.points, v, driver.span)
        return beta_at(v, self.beta_max, self.rho), self.u_peak


def residual_between(
    one: Branch, other: Branch, share: float, v: float, driver: Driver | float, v_offset: float
) -> tuple[float, float, float | None]:
    """Return beta and u_peak between two turns, and the beta_max that they come from where (22) gives both."""
    left, right = ResidualLaw.of(one, driver), ResidualLaw.of(other, driver)
    if not left.measured and not right.measured:
        beta_max, rho = _between(left.beta_max, right.beta_max, share), _between(left.rho, right.rho, share)
        law = ResidualLaw(beta_max, rho, _between(left.u_peak, right.u_peak, share))
        return *law.at(v, driver), beta_max
    (beta_left, peak_left), (beta_right, peak_right) = left.at(v, driver, v_offset), right.at(v, driver, v_offset)
    return _between(beta_left, beta_right, share), _between(peak_left, peak_right, share), None


def _between(left: float, right: float, share: float) -> float:
    return left + share * (right - left)
