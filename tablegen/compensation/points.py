"""Hysteresis as it was measured at each amplitude: ``points`` of a branch, in place of the growth law (22)."""

from collections.abc import Sequence
from typing import Annotated

from msgspec import Meta

from tablegen.compensation.model import Parameters
from tablegen.figures import at_most
from tablegen.problems import Unphysical
from tablegen.quantities import Normalised, PositiveVolts

# Measured points serve scans this much larger than the largest of them, of v_max.
SIZE_REACH = 0.1
FULL_SCALE_TOLERANCE = 0.02  # relative difference allowed between a measured full scale and v_max

Residual = Annotated[float, Meta(ge=0.0, lt=0.5)]
Rows = tuple[tuple[float, float, float], ...]  # normalised scan voltage, beta, u_peak


class HysteresisPoint(Parameters, frozen=True):
    """Hysteresis of one direction as measured at one scan voltage."""

    size_v: Annotated[PositiveVolts, Meta(description="scan voltage V_scan of the measurement, at the piezo")]
    beta: Annotated[Residual, Meta(description="peak residual at this voltage, as a fraction of the scan")]
    u_peak: Annotated[Normalised, Meta(description="position of the peak; harmonic model only")] | None = None


def rows_of(points: Sequence[HysteresisPoint], v_max: float) -> Rows:
    """The points by ascending voltage."""
    found = [(p.size_v / v_max, p.beta, 0.5 if p.u_peak is None else p.u_peak) for p in points]
    return tuple(sorted(found))


def between_points(rows: Rows, v: float, v_max: float) -> tuple[float, float]:
    """beta and u_peak at a normalised scan voltage: linear between points; below the first beta falls to 0 at v = 0
    and u_peak stays, beyond the last both stay.

    Raises ``Unphysical`` for a scan that is larger than what was measured.
    """
    largest = rows[-1][0]
    if v > largest + SIZE_REACH + 1e-9:
        served = at_most((largest + SIZE_REACH) * v_max, 6)
        raise Unphysical(
            f"measured up to {largest * v_max:g} V, which serves scans up to {served} V; this one takes "
            f"{v * v_max:.6g} V; measure a larger one"
        )
    before = (0.0, 0.0, rows[0][2])
    for point in rows:
        if v <= point[0]:
            share = (v - before[0]) / (point[0] - before[0])
            return before[1] + share * (point[1] - before[1]), before[2] + share * (point[2] - before[2])
        before = point
    return before[1], before[2]


def twice(points: Sequence[HysteresisPoint]) -> list[tuple[str, str]]:
    """Points at one voltage, and what is wrong with them."""
    return [
        (f"points[{j}].size_v", f"{point.size_v:g} V is measured twice")
        for j, point in enumerate(points)
        if any(point.size_v == earlier.size_v for earlier in points[:j])
    ]


def beyond_driver(points: Sequence[HysteresisPoint], v_max: float) -> list[tuple[str, str]]:
    """No hysteresis can have been measured at more than the driver's range, but for the error of a voltage."""
    return [
        (f"points[{j}].size_v", f"{point.size_v:g} V is above v_max = {v_max:g} V")
        for j, point in enumerate(points)
        if point.size_v > (1.0 + FULL_SCALE_TOLERANCE) * v_max
    ]
