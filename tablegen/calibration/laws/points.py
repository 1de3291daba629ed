"""Hysteresis as measured at each amplitude, for scanners that (22) and one u_peak do not describe."""

from typing import Any

from tablegen.base.input_errors import Unphysical
from tablegen.calibration.laws.hysteresis import TurnFit
from tablegen.compensation.hysteresis import BranchShape
from tablegen.fitting.estimate import Estimate
from tablegen.fitting.measured_branch import MeasuredBranch

_MIN_BETA_ERRORS = 3.0  # standard errors of a beta whose peak is significant
_MAX_PEAK_ERROR = 0.1  # standard error of a u_peak that was not determined


def measured_points(branch: TurnFit, direction: str) -> list[dict[str, Any]]:
    """Return the entries of ``points`` of one direction.

    Each has size_v, beta and u_peak, by ascending amplitude; of several offsets, by ascending offset_v. Where noise
    hides the peak, u_peak is that of the mean; an amplitude at which noise hides everything is left out.

    Raises
    ------
    Unphysical
        If a residual has the wrong sign, or makes no branch.
    """
    return [
        {**place, "beta": beta.rounded, "u_peak": peak.rounded} for place, beta, peak in estimates(branch, direction)
    ]


def estimates(branch: TurnFit, direction: str) -> list[tuple[dict[str, float], Estimate, Estimate]]:
    """Return the place of each of these points, and beta and u_peak with their standard errors.

    Raises
    ------
    Unphysical
        If a residual has the wrong sign or makes no branch, or an amplitude was measured twice.
    """
    points: list[tuple[dict[str, float], Estimate, Estimate]] = []
    offsets = branch.offsets_v or (None,) * len(branch.traces)
    for trace, offset_v in sorted(zip(branch.traces, offsets, strict=True), key=lambda one: one[1] or 0.0):
        side: MeasuredBranch = getattr(trace, direction)
        beta, peak = side.beta, side.u_peak
        size_v = float(f"{trace.v_scan:.5g}")
        if beta.value < 0.0:
            if beta.value < -_MIN_BETA_ERRORS * beta.standard_error:
                raise Unphysical(f"{size_v:g} V, {direction}: the residual has the wrong sign")
            continue
        if beta.value < _MIN_BETA_ERRORS * beta.standard_error or peak.standard_error > _MAX_PEAK_ERROR:
            peak = getattr(branch, direction).u_peak
        place = {} if offset_v is None else {"offset_v": offset_v}
        if any((point["size_v"], point.get("offset_v")) == (size_v, offset_v) for point, _, _ in points):
            raise Unphysical(f"{size_v:g} V was measured twice; give one of the two")
        try:
            BranchShape.harmonic(beta.value, peak.value)
        except Unphysical as reason:
            raise Unphysical(f"{size_v:g} V, {direction}: {reason}") from None
        points.append(({**place, "size_v": size_v}, beta, peak))
    return points
