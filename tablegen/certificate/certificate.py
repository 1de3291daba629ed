"""The certificate of a build, measured on every emitted integer of one whole period of each axis, and its limits."""

from collections.abc import Callable, Mapping
from functools import cached_property
from math import floor, log10, sqrt
from typing import TYPE_CHECKING

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from tablegen.base.input_errors import Document, Problem
from tablegen.base.remedies import CAUSE_REMEDIES, REMEDIES, FindingCode
from tablegen.certificate.expected import certified_expectation, known_expectation
from tablegen.certificate.line_errors import (
    EmittedPeriod,
    LayerEffect,
    ScalingError,
    power_at_resonance_db,
    refined,
    scaling_error,
)
from tablegen.certificate.shaped_errors import ShapedErrors, shaped_errors
from tablegen.certificate.shaped_periods import largest_and_rms
from tablegen.compensation.expectation import Expectation
from tablegen.compensation.line import Sweep
from tablegen.planning.line_plan import LinePlan, Plan
from tablegen.planning.pixel_errors import PixelErrors

if TYPE_CHECKING:
    from tablegen.certificate.position_errors import ArrivingErrors


class LimitedFigures(Struct, frozen=True):
    """The figures of an axis that are compared with limits, of its certificate or without the rest of it."""

    max_error_lsb: float
    largest_step: int
    max_step: int
    scaling: dict[str, ScalingError]
    expected: Expectation | None
    pixels: PixelErrors | None

    @property
    def scaling_error_percent(self) -> float:
        """The larger scaling error of both directions; ripple shorter than a chord counts in full."""
        return max((self._own(side) for side in self.scaling), default=0.0)

    @property
    def size_error_percent(self) -> float:
        """The larger size error of both directions, with its sign."""
        return max((error.size for error in self.scaling.values()), key=abs, default=0.0)

    @property
    def scaling_on_scanner(self) -> tuple[str, float, float] | None:
        """The worse direction, its expected error on the scanner and that of the waveform, in percent.

        None where nothing is expected. The errors may add up.
        """
        figures = {} if self.expected is None else self.expected.scaling
        both = [(side, figure.value, self._own(side)) for side, figure in figures.items()]
        return max(both, key=lambda one: one[1] + one[2], default=None)

    def _own(self, side: str) -> float:
        return max(self.scaling[side].total, self.scaling[side].band_limit)


class Certificate(Struct, frozen=True):
    """The error budget of one axis. Codes and LSB are the converter's; dB are of power, relative to the scan's.

    An axis at rest has no scaling errors and no cutoff. ``refinement`` is what the layer of ``tablegen refine`` moves,
    where there is one; it is not counted as an error.
    ``expected`` is what the scanner should do with the line; everything else is of the waveform.
    ``peak_acceleration`` is that of the target, of the line a period squared, where the waveform was made for the
    least; ``optimum`` the least of any, where ``certificate.optimum`` has worked it out.
    Errors of an axis with a ``shaped`` part are those of the position, and its codes and largest step are bounds: no
    two of its periods are the same. ``position`` has those of an unshaped axis whose scanner has a response,
    ``pixels`` those of pixels that are taken where the piezo is.
    """

    ticks: int
    max_error_lsb: float
    rms_error_lsb: float
    scaling: dict[str, ScalingError]
    lowest_code: int
    highest_code: int
    headroom_low: int
    headroom_high: int
    largest_step: int
    max_step: int
    peak_slew_v_per_s: float
    beyond_cutoff_db: float | None
    at_resonance_db: float | None
    refinement: dict[str, LayerEffect] | None = None
    expected: Expectation | None = None
    peak_acceleration: float | None = None
    optimum: float | None = None
    shaped: ShapedErrors | None = None
    position: "ArrivingErrors | None" = None
    pixels: PixelErrors | None = None

    @property
    def limited(self) -> LimitedFigures:
        """The figures that limits are compared with."""
        return LimitedFigures(
            self.max_error_lsb, self.largest_step, self.max_step, self.scaling, self.expected, self.pixels
        )

    @property
    def scaling_error_percent(self) -> float:
        """The larger scaling error of both directions; ripple shorter than a chord counts in full."""
        return self.limited.scaling_error_percent

    @property
    def size_error_percent(self) -> float:
        """The larger size error of both directions, with its sign."""
        return self.limited.size_error_percent

    @property
    def scaling_on_scanner(self) -> tuple[str, float, float] | None:
        """The worse direction, its expected error on the scanner and that of the waveform, in percent.

        None where nothing is expected. The errors may add up.
        """
        return self.limited.scaling_on_scanner


class EmittedPeriods:
    """The emitted period of each axis of a plan, measured as far as a caller needs it: no figure of it twice."""

    def __init__(self, plan: Plan) -> None:
        self.plan = plan

    @cached_property
    def axes(self) -> dict[str, EmittedPeriod]:
        """The period of each axis, "x" and "y"."""
        return {line.axis: EmittedPeriod(line) for line in self.plan.lines}

    @cached_property
    def pixels(self) -> PixelErrors | None:
        """The errors of pixels that are taken where the piezo is; None where they have equal lengths."""
        return self.plan.pixel_errors


def limited_figures(periods: EmittedPeriods) -> dict[str, LimitedFigures]:
    """Measure what limits of errors are compared with, without the rest of the certificates.

    All figures are those of the certificates, but for ``expected``: without an operator it has no figure that a limit
    is compared with, and is left out; the uncertainty by the steps of the converter, which no limit counts, is missing.
    """
    plan = periods.plan
    return {
        line.axis: LimitedFigures(
            max_error_lsb=periods.axes[line.axis].largest_error(),
            largest_step=_largest_step(line, periods.axes[line.axis]),
            max_step=line.program.output.max_step,
            scaling=_scaling(line, periods.axes[line.axis]),
            expected=known_expectation(line),
            pixels=periods.pixels if line.axis == "x" else None,
        )
        for line in plan.lines
    }


def steps_beyond_guard(periods: EmittedPeriods) -> bool:
    """Return True if an axis steps by more than its slew guard."""
    return any(
        _largest_step(line, periods.axes[line.axis]) > line.program.output.max_step for line in periods.plan.lines
    )


def certify(plan: Plan, periods: EmittedPeriods | None = None) -> dict[str, Certificate]:
    """Measure the certificates of both axes; ``periods`` are those of the plan, where figures were measured already."""
    certificates: dict[str, Certificate] = {  # without periods one after the other, since long ones take memory
        line.axis: _certify(line, EmittedPeriod(line) if periods is None else periods.axes[line.axis])
        for line in plan.lines
    }
    if (pixels := plan.pixel_errors if periods is None else periods.pixels) is not None:
        certificates["x"] = _with_pixels(certificates["x"], pixels)
    return certificates


def _with_pixels(certificate: Certificate, pixels: PixelErrors) -> Certificate:
    """Add the errors of pixels to a certificate: they are what the image of a sine has, where the position is known."""
    expected = certificate.expected
    if expected is not None:
        assert expected.mismatch is not None
        expected = replace(
            expected,
            rms={side: replace(figure, value=pixels.rms[side]) for side, figure in expected.rms.items()},
            mismatch=replace(expected.mismatch, value=pixels.mismatch),
        )
    return replace(certificate, pixels=pixels, expected=expected)


def broken_limits(
    plan: Plan,
    certificates: Mapping[str, Certificate | LimitedFigures],
    file: Document,
    advise: Callable[[str], str] = lambda _: "",
    hardware_problem: Callable[[str, str, str], Problem] | None = None,
) -> list[Problem]:
    """List the limits of the configuration that a certificate exceeds, each with a remedy.

    ``advise`` adds to a scaling error of an axis ("x" or "y") what was tried against it. ``hardware_problem`` places
    one of a key of an axis' amplifier; without it that stands in ``file``.
    """
    problems = []
    for axis, certificate in certificates.items():
        if certificate.largest_step > certificate.max_step:
            guard = f"above its guard of {certificate.max_step}; {REMEDIES['step-guard']}"
            why = f"the {axis} axis steps by {certificate.largest_step} codes, {guard}"
            key = "amplifier.max_slew_v_per_s"
            problem = file.problem(key, why) if hardware_problem is None else hardware_problem(axis, key, why)
            problems.append(problem.coded("step-guard", axis))
        limit = plan.limits.max_error_lsb
        if limit is not None and certificate.max_error_lsb > limit:
            why = f"the {axis} axis errs by up to {certificate.max_error_lsb:.4g} LSB, above {limit:g}; "
            remedy = REMEDIES["converter-error"] if limit > 0.5 else "a code alone is rounded by up to 0.5"
            problems.append(file.problem("limits.max_error_lsb", why + remedy).coded("converter-error", axis))
        limit = plan.limits.max_scaling_error_percent
        if limit is None:
            continue
        worst, size = certificate.scaling_error_percent, certificate.size_error_percent
        if worst > limit or abs(size) > limit:
            what = f"scaling error of {worst:.4g} %" if worst > limit else f"size error of {size:+.4g} %"
            parts = max(certificate.scaling.values(), key=lambda error: max(error.total, error.band_limit))
            cause = cause_of(plan.x if axis == "x" else plan.y, parts)
            remedy = f"most of it is the {cause}: {CAUSE_REMEDIES[cause]}"
            why = "; ".join(filter(None, (f"the {axis} axis has a {what}, above {limit:g} %", remedy, advise(axis))))
            code: FindingCode = "scaling-error" if worst > limit else "size-error"
            problems.append(file.problem("limits.max_scaling_error_percent", why).coded(code, axis))
        elif certificate.pixels is not None and (worst := max(certificate.pixels.scaling.values())) > limit:
            why = (
                f"the pixels of {axis} begin on whole ticks, which is a scaling error of {worst:.4g} %, above "
                f"{limit:g} %; {REMEDIES['rounded-pixels']}"
            )
            problems.append(file.problem("limits.max_scaling_error_percent", why).coded("rounded-pixels", axis))
        elif expected := _expected_excess(certificate, limit):
            code, excess = expected
            why = f"on the scanner the {axis} axis is expected to have a {excess}"
            why = f"{why}; {advise(axis) or REMEDIES[code]}"  # what was tried says more than its kind
            problems.append(file.problem("limits.max_scaling_error_percent", why).coded(code, axis))
    return problems


def _expected_excess(certificate: Certificate | LimitedFigures, limit: float) -> tuple[FindingCode, str] | None:
    """Return how the errors of the waveform and of the scanner together exceed a limit; None where they do not.

    The uncertainty is not counted: no change of the scan makes it smaller.
    """
    both, expected = certificate.scaling_on_scanner, certificate.expected
    if both is not None and both[1] + both[2] > limit:
        side, on_scanner, own = both
        return "expected-scaling-error", (
            f"scaling error of {on_scanner + own:.4g} % {side}, above {limit:g} %: {on_scanner:.3g} % since these "
            f"harmonics do not make the waveform that its operator needs over the window, {own:.3g} % of the emitted "
            "waveform"
        )
    if expected is not None and expected.size is not None:
        on_scanner, own = expected.size.value, certificate.size_error_percent
        if abs(on_scanner + own) > limit:
            return "expected-size-error", (
                f"size error of {on_scanner + own:+.4g} %, above {limit:g} %: {on_scanner:+.3g} % by its operator, "
                f"{own:+.3g} % of the emitted waveform"
            )
    return None


def cause_of(line: LinePlan, parts: ScalingError) -> str:
    """Return the largest part of an error, as ``CAUSE_REMEDIES`` names it."""
    largest = max(parts.band_limit, parts.quantisation, parts.model)
    if largest == parts.band_limit:
        return "band limit"
    if largest == parts.model:
        return "uncorrected dynamics"
    # A word of the table is more than a code, or the converter is the coarser one.
    return "table" if abs(line.codes_per_unit) * line.scale > 2.0**line.program.bits else "converter"


def _certify(line: LinePlan, played: EmittedPeriod) -> Certificate:
    output, shaping = line.program.output, line.program.output.shaping
    codes = played.runs.codes
    mean, square = played.error_moments()
    noise = square - mean * mean
    if played.shaped is not None:
        square, noise = largest_and_rms(played.shaped.position_errors)[1] ** 2, float(np.var(played.shaped.code_errors))
    # A rounded code is within half a code of its value, a shaped one within the excess.
    beyond = floor(shaping.excess + 0.5) if shaping.order else 0
    low, high = max(int(codes.min()) - beyond, output.code_min), min(int(codes.max()) + beyond, output.code_max)
    resting = line.drive.resting
    power = max(played.power(), 1e-30)
    return Certificate(
        ticks=line.program.ticks,
        max_error_lsb=played.largest_error(),
        rms_error_lsb=sqrt(square),
        scaling=_scaling(line, played),
        lowest_code=low,
        highest_code=high,
        headroom_low=low - output.code_min,
        headroom_high=output.code_max - high,
        largest_step=_largest_step(line, played),
        max_step=output.max_step,
        peak_slew_v_per_s=line.drive.v_amplitude * line.series.peak_slope() * float(line.rate),
        beyond_cutoff_db=None if resting else 10.0 * log10(max(noise, 1e-30) / power),
        at_resonance_db=power_at_resonance_db(line, played, power),
        refinement=None
        if line.layer is None
        else {side: refined(line, side, branch) for side, branch in _directions(line).items()},
        expected=certified_expectation(line, played),
        peak_acceleration=None if line.kept_percent is None else line.target.peak_acceleration(),
        shaped=shaped_errors(line, played, _directions(line)),
        position=_position(line, played),
    )


def _largest_step(line: LinePlan, played: EmittedPeriod) -> int:
    return played.largest_step() + line.program.output.shaping.step_excess


def _position(line: LinePlan, played: EmittedPeriod) -> "ArrivingErrors | None":
    """Compute the errors of the position behind the response of the axis; None without a response."""
    if line.drive.response is None:
        return None
    from tablegen.certificate.position_errors import position_errors  # few scanners have one

    return position_errors(line, played, _directions(line))


def position_scaling(line: LinePlan) -> float:
    """Return the larger scaling error of both directions behind the response of an axis, in percent; 0 without one."""
    played = EmittedPeriod(line)
    position = _position(line, played)
    scaling = (
        {side: one.total for side, one in _scaling(line, played).items()} if position is None else position.scaling
    )
    return max(scaling.values(), default=0.0)


def scaling_errors(line: LinePlan) -> dict[str, ScalingError]:
    """Compute the scaling errors of an axis, by the directions that image."""
    return _scaling(line, EmittedPeriod(line))


def _scaling(line: LinePlan, played: EmittedPeriod) -> dict[str, ScalingError]:
    return {side: scaling_error(line, played, side, branch) for side, branch in _directions(line).items()}


def _directions(line: LinePlan) -> dict[str, Sweep]:
    """Return the branches that image; none of an axis at rest."""
    shape = line.drive.shape
    if line.drive.resting:
        return {}
    both = {"forward": shape.forward, "backward": shape.backward}
    return both if line.band_limit.directions == "both" else {"forward": shape.forward}
