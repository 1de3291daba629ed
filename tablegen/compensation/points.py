"""Hysteresis as it was measured at each amplitude, and offset: ``points`` of a branch, in place of the law (22)."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Annotated

from msgspec import Meta, Struct

from tablegen.base.figures import at_least, at_most
from tablegen.base.input_errors import Unphysical
from tablegen.base.quantities import Normalised, PositiveVolts, Volts
from tablegen.compensation.model import Parameters
from tablegen.numerics.driver import Driver

# Measured points serve scans this much larger than the largest of them, of v_max.
SIZE_REACH = 0.1
# And scans this far beyond the outermost offsets at which they were measured, of v_max.
OFFSET_REACH = 0.1
FULL_SCALE_TOLERANCE = 0.02  # relative difference allowed between a measured full scale and v_max

Residual = Annotated[float, Meta(ge=0.0, lt=0.5)]
Rows = tuple[tuple[float, float, float], ...]  # normalised scan voltage, beta, u_peak


class HysteresisPoint(Parameters, frozen=True):
    """Hysteresis of one direction as measured at one scan voltage, and at one offset where it depends on that."""

    size_v: Annotated[PositiveVolts, Meta(description="scan voltage V_scan of the measurement, at the piezo")]
    beta: Annotated[Residual, Meta(description="peak residual at this voltage, as a fraction of the scan")]
    u_peak: Annotated[Normalised, Meta(description="position of the peak; harmonic model only")] | None = None
    offset_v: (
        Annotated[
            Volts, Meta(description="offset voltage of the measurement; without it, of any; of all points or none")
        ]
        | None
    ) = None


def rows_of(points: Sequence[HysteresisPoint], v_max: float) -> Rows:
    """Return the points by ascending voltage."""
    rows = [(p.size_v / v_max, p.beta, 0.5 if p.u_peak is None else p.u_peak) for p in points]
    return tuple(sorted(rows))


class OffsetRows(Struct, frozen=True):
    """Points at several offsets: the rows of each, by ascending offset as a share of v_max."""

    offsets: tuple[tuple[float, Rows], ...]

    @classmethod
    def of(cls, points: Sequence[HysteresisPoint], driver: Driver | float) -> "OffsetRows":
        """Return the rows of points that all have an offset."""
        driver = Driver.of(driver)
        groups: dict[float, list[HysteresisPoint]] = {}
        for point in points:
            groups.setdefault(driver.share(point.offset_v or 0.0), []).append(point)
        return cls(tuple((at, rows_of(groups[at], driver.span)) for at in sorted(groups)))

    def at(self, v: float, offset: float, driver: Driver | float) -> tuple[float, float]:
        """Return beta and u_peak at a normalised scan voltage and an offset, both shares of the driver's range.

        Linear in the offset between two offsets that were measured, constant beyond the outermost.

        Raises
        ------
        Unphysical
            If the scan is larger than the largest that was measured, or far from all offsets.
        """
        driver = Driver.of(driver)
        span, first, last = driver.span, self.offsets[0][0], self.offsets[-1][0]
        if not first - OFFSET_REACH - 1e-9 <= offset <= last + OFFSET_REACH + 1e-9:
            low = at_least(driver.volts(max(first - OFFSET_REACH, 0.0)), 6)
            high = at_most(driver.volts(min(last + OFFSET_REACH, 1.0)), 6)
            raise Unphysical(
                f"measured at offsets of {driver.volts(first):g} to {driver.volts(last):g} V, which serves {low} to "
                f"{high} V; this scan is at {driver.volts(offset):.6g} V; measure there, or leave offset_v "
                "away from all points"
            )
        if offset <= first or len(self.offsets) == 1:
            return between_points(self.offsets[0][1], v, span)
        for (low_at, left), (high_at, right) in pairwise(self.offsets):
            if offset <= high_at:
                share = (offset - low_at) / (high_at - low_at)
                return _between_offsets(left, right, share, v, span)
        return between_points(self.offsets[-1][1], v, span)


def _between_offsets(left: Rows, right: Rows, share: float, v: float, v_max: float) -> tuple[float, float]:
    """Interpolate between two offsets; beyond the largest scan of one, its residual grows as that of the other."""
    check_size(left[-1][0] + share * (right[-1][0] - left[-1][0]), v, v_max)
    common = min(left[-1][0], right[-1][0])
    sides = []
    for rows, other in ((left, right), (right, left)):
        beta, peak = interpolated(rows, v)
        if rows[-1][0] == common < v:
            there, peak_there = interpolated(other, common)
            beyond, peak_beyond = interpolated(other, v)
            beta *= beyond / there if there > 0.0 else 1.0
            peak += peak_beyond - peak_there
        sides.append((beta, peak))
    (beta_left, peak_left), (beta_right, peak_right) = sides
    return beta_left + share * (beta_right - beta_left), peak_left + share * (peak_right - peak_left)


def between_points(rows: Rows, v: float, v_max: float) -> tuple[float, float]:
    """Return beta and u_peak at a normalised scan voltage, as ``interpolated``.

    Raises
    ------
    Unphysical
        If the scan is larger than what was measured.
    """
    check_size(rows[-1][0], v, v_max)
    return interpolated(rows, v)


def check_size(largest: float, v: float, v_max: float) -> None:
    """Check that the points of a branch serve a scan of this size.

    Parameters
    ----------
    largest, v
        The largest measured amplitude and that of the scan, both as shares of v_max.
    v_max
        Range of the drive in V, for the message.

    Raises
    ------
    Unphysical
        If the scan is larger than the largest measured by more than ``SIZE_REACH``.
    """
    if v > largest + SIZE_REACH + 1e-9:
        served = at_most((largest + SIZE_REACH) * v_max, 6)
        raise Unphysical(
            f"measured up to {largest * v_max:g} V, which serves scans up to {served} V; this one takes "
            f"{v * v_max:.6g} V; measure a larger one"
        )


def interpolated(rows: Rows, v: float) -> tuple[float, float]:
    """Return beta and u_peak at a normalised scan voltage, linear between points.

    Below the first point beta falls to 0 at v = 0 and u_peak stays, beyond the last both stay.
    """
    before = (0.0, 0.0, rows[0][2])
    for point in rows:
        if v <= point[0]:
            share = (v - before[0]) / (point[0] - before[0])
            return before[1] + share * (point[1] - before[1]), before[2] + share * (point[2] - before[2])
        before = point
    return before[1], before[2]


def repeated_points(points: Sequence[HysteresisPoint]) -> list[tuple[str, str]]:
    """Return the keys of points at one voltage and offset, and of those that lack an offset, with the reason."""
    faults = [
        (f"points[{j}].size_v", f"{point.size_v:g} V is measured twice")
        for j, point in enumerate(points)
        if any((point.size_v, point.offset_v) == (earlier.size_v, earlier.offset_v) for earlier in points[:j])
    ]
    if any(point.offset_v is not None for point in points):
        lacking = [j for j, point in enumerate(points) if point.offset_v is None]
        faults += [(f"points[{j}].offset_v", "missing beside those of other points") for j in lacking]
    return faults


def beyond_driver(points: Sequence[HysteresisPoint], driver: Driver) -> list[tuple[str, str]]:
    """Return the keys of points outside the driver's range, but for the error of a voltage, with the reason."""
    faults = [
        (f"points[{j}].size_v", f"{point.size_v:g} V is above {driver.full_scale}")
        for j, point in enumerate(points)
        if point.size_v > (1.0 + FULL_SCALE_TOLERANCE) * driver.span
    ]
    return faults + [
        (f"points[{j}].offset_v", f"{point.offset_v:g} V is outside the driver's {driver}")
        for j, point in enumerate(points)
        if point.offset_v is not None and driver.beyond(point.offset_v, point.offset_v) > 0.0
    ]
