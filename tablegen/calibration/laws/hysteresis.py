"""Fit beta_max, rho and u_peak of each branch to traces at several amplitudes and turns, equations (17)-(22)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.base.warnings import Remark, spoils
from tablegen.calibration.laws.trace import TraceFit, fit_trace
from tablegen.calibration.laws.triangle import Triangle
from tablegen.compensation.hysteresis import BranchShape
from tablegen.fitting.estimate import Curve, Estimate, Fit
from tablegen.fitting.growth import Growth, fit_growth
from tablegen.fitting.measured_branch import AmplitudeFit
from tablegen.numerics.arrays import Floats
from tablegen.numerics.driver import Driver

_SIDES: tuple[Literal["forward", "backward"], ...] = ("forward", "backward")

TYPICAL_RHO = 1.5  # the paper's backward scan, and the default of the scanner file
OFFSET_TOLERANCE = 0.02  # of v_max: offsets that differ by less are one
TURN_TOLERANCE = 0.02  # turns that differ by less are one calibration
_POOR_FIT_PERCENT = 1.0
_MAX_DRIVE_DEPARTURE = 0.01  # rms departure of the drive from a triangle


@dataclass(frozen=True)
class Trace:
    """One record and its name: times in s, the drive at the piezo in V, displacements in any unit."""

    name: str
    time_s: Floats
    drive_v: Floats
    displacement_nm: Floats


@dataclass(frozen=True)
class TurnFit:
    """Both directions at one turning point, and their traces or image pairs, by ascending amplitude.

    ``offsets_v`` are the offsets of these traces; empty where all have one, or where they are unknown.
    """

    turn: Estimate
    forward: Growth
    backward: Growth
    traces: tuple[AmplitudeFit, ...]
    offsets_v: tuple[float, ...] = ()


@dataclass(frozen=True, kw_only=True)
class HysteresisFit(Fit):
    """One entry for each turning point, ascending.

    Residuals are position errors in percent of the scan, averaged over periods and twentieths of a line.
    """

    branches: tuple[TurnFit, ...]


def fit_hysteresis(
    traces: Sequence[Trace],
    v_max: Driver | float,
    rho: float = TYPICAL_RHO,
    settle_periods: int | None = None,
    drift_order: int | None = None,
    delay_s: float | None = 0.0,
) -> HysteresisFit:
    """Fit both branches at each turn that was measured; see ``fit_trace`` for the treatment of a trace.

    Parameters
    ----------
    rho
        Decay constant of (22) where a turn was measured at one amplitude only.

    Raises
    ------
    Unphysical
        If a trace does not support the fit; the message has its name.
    """
    driver = Driver.of(v_max)
    fits: list[TraceFit] = []
    remarks: list[Remark] = []
    for trace in traces:
        try:
            fit = fit_trace(trace.time_s, trace.drive_v, trace.displacement_nm, settle_periods, drift_order, delay_s)
            low, high = fit.triangle.v_low, fit.triangle.v_high
            if driver.beyond(low, high) > 0.02 * driver.span:
                _check_triangle(fit.triangle)
                raise Unphysical(f"a drive of {low:.4g}..{high:.4g} V is outside the driver's {driver}")
        except Unphysical as reason:
            raise Unphysical(f"{trace.name}: {reason}" if trace.name else str(reason)) from None
        fits.append(fit)
        remarks += [text.under(trace.name) for text in _remarks(fit)]
    return combined(fits, driver.span, rho, remarks)


def _check_triangle(triangle: Triangle) -> None:
    """Check that the drive is a triangle, whose ends are then those of the drive.

    The triangle nearest a sine is 22 % higher than the sine, so that it leaves a range that the sine fills.

    Raises
    ------
    Unphysical
        If it is another waveform.
    """
    if triangle.departure > _MAX_DRIVE_DEPARTURE:
        raise Unphysical(
            f"the drive is not a triangle: it departs from the nearest one by {100.0 * triangle.departure:.2g} % rms, "
            "as a sine does; record a triangle, or give it to `calibrate operator`, which takes any record"
        )


def combined(fits: Sequence[AmplitudeFit], span: float, rho: float, remarks: Sequence[Remark]) -> HysteresisFit:
    """Fit (22) at each turn to amplitudes in any order; remarks of the single ones come first.

    Raises
    ------
    Unphysical
        If the amplitudes make no law.
    """
    remarks = list(remarks)
    groups: list[list[AmplitudeFit]] = []
    for fit in sorted(fits, key=lambda fit: fit.turn.value):
        if groups and fit.turn.value - groups[-1][0].turn.value < TURN_TOLERANCE:
            groups[-1].append(fit)
        else:
            groups.append([fit])
    branches = []
    for group in groups:
        group.sort(key=lambda fit: fit.v_scan)
        v = np.array([fit.v_scan / span for fit in group])
        turn = float(np.mean([fit.turn.value for fit in group]))
        spread = float(np.sqrt(np.sum([fit.turn.standard_error**2 for fit in group])) / len(group))
        sides = []
        for name in ("forward", "backward"):
            try:
                sides.append(fit_growth(v, [getattr(fit, name) for fit in group], rho))
                _check_shape(sides[-1], float(v[-1]))
            except Unphysical as reason:
                raise Unphysical(f"turn {turn:.4g}, {name}: {reason}") from None
            remarks += [text.under(f"turn {turn:.4g}, {name}") for text in sides[-1].remarks]
        offsets = _offsets(group, span)
        if offsets:
            listed = ", ".join(f"{volts:g}" for volts in sorted(set(offsets)))
            remarks.append(
                Remark(
                    f"turn {turn:.4g}: (22) is one for the offsets of {listed} V",
                    code="mixed-offsets",
                )
            )
        branches.append(TurnFit(Estimate(turn, spread), sides[0], sides[1], tuple(group), offsets))
    return HysteresisFit(
        points=sum(fit.samples for fit in fits),
        residual_percent=np.concatenate([fit.residual_percent for fit in fits]),
        before_percent=100.0 * max(abs(side.beta.value) for fit in fits for side in (fit.forward, fit.backward)),
        remarks=tuple(dict.fromkeys(remarks)),
        outliers=(),
        curves=tuple(_curves(branches, span)),
        branches=tuple(branches),
    )


def _offsets(group: Sequence[AmplitudeFit], span: float) -> tuple[float, ...]:
    """Return the offset of each amplitude, those near each other as one.

    Empty for one offset, and where no offset has two sizes: traces that all begin at 0 V do not show its effect.
    """
    offsets = sorted(fit.v_offset for fit in group if fit.v_offset is not None)
    if len(offsets) < len(group):
        return ()
    clusters = [[offsets[0]]]
    for volts in offsets[1:]:
        if volts - clusters[-1][0] > OFFSET_TOLERANCE * span:
            clusters.append([])
        clusters[-1].append(volts)
    means = {volts: float(f"{np.mean(cluster):.4g}") for cluster in clusters for volts in cluster}
    if len(clusters) < 2 or max(map(len, clusters)) < 2:
        return ()
    return tuple(means[fit.v_offset] for fit in group if fit.v_offset is not None)


def _check_shape(growth: Growth, v: float) -> None:
    """Check the drive that a build would compute from the shape, at the largest measured amplitude."""
    BranchShape.harmonic(float(growth.beta(np.array(v))), growth.u_peak.value)


def _remarks(fit: TraceFit) -> list[Remark]:
    remarks: list[Remark] = []
    if fit.triangle.departure > _MAX_DRIVE_DEPARTURE:
        remarks.append(
            spoils(
                f"the drive departs from a triangle by {100.0 * fit.triangle.departure:.2g} % rms; "
                "the fit assumes a triangle",
                100.0 * fit.triangle.departure,
                code="drive-shape",
            )
        )
    if fit.inverted:
        remarks.append(
            Remark("the displacement falls where the drive rises; its sign was inverted", code="inverted-sensor")
        )
    worst = float(np.max(np.abs(fit.residual_percent)))
    if worst > _POOR_FIT_PERCENT:
        remarks.append(
            spoils(
                f"the harmonic model leaves {worst:.2g} % of the scan; is the drive the triangle itself, the delay of "
                f"the sensor known, and the record settled?",
                worst,
                code="poor-fit",
            )
        )
    if fit.correlated > 3.0:
        remarks.append(
            Remark(
                f"residuals are correlated over {fit.correlated:.0f} samples: besides noise, they contain what "
                f"model and drift do not describe; standard errors were widened "
                f"by a factor of {fit.correlated**0.5:.2g}",
                code="widened-errors",
            )
        )
    if fit.strays:
        numbers = ", ".join(str(i + 1) for i in fit.strays[:5]) + (", ..." if len(fit.strays) > 5 else "")
        remarks.append(
            Remark(
                f"{len(fit.strays)} samples are far off the curve (number {numbers}); they were used",
                code="outlying-samples",
            )
        )
    for name, side in (("forward", fit.forward), ("backward", fit.backward)):
        if side.u_peak.standard_error > 0.1:
            remarks.append(
                spoils(
                    f"u_peak {name} is not determined by this trace; average more periods or drive it further",
                    code="undetermined-parameter",
                )
            )
    return remarks


def _curves(branches: Sequence[TurnFit], span: float) -> list[Curve]:
    """Return two curves for each turn: the residual at the largest amplitude, figure 5a, and its growth, figure 5k."""
    curves: list[Curve] = []
    line = np.linspace(0.0, 1.0, 101)
    for branch in branches:
        curves += branch.traces[-1].curves
        for name in _SIDES:
            growth: Growth = getattr(branch, name)
            v = np.array([fit.v_scan for fit in branch.traces])
            beta = np.array([getattr(fit, name).beta.value for fit in branch.traces])
            title = f"peak residual {name}, turn {branch.turn.value:.3g}"
            fitted = (line * span, 100.0 * growth.beta(line))
            label = "peak residual [% of the scan]"
            curves.append(Curve(title, "scan voltage [V]", label, (v, 100.0 * beta), fitted, None, name))
    return curves
