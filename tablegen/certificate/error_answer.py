"""One line an axis: how large its error is, what limits it, and what to do next; of every command the same text.

Percentages are of the whole line, errors those inside the imaging window. A pixel of x is the window over the pixels of
a line, one of y the window over the image lines.
"""

from collections.abc import Mapping
from fractions import Fraction
from typing import Any, Literal

from msgspec import Struct
from msgspec.structs import replace

from tablegen.base.remedies import CAUSE_REMEDIES, REMEDIES, FindingCode
from tablegen.certificate.certificate import Certificate, cause_of
from tablegen.certificate.excess import excess
from tablegen.certificate.expectation_checks import expectation_warnings
from tablegen.certificate.expected import forward_residual
from tablegen.compensation.expectation import LEVEL_PERCENT
from tablegen.config.load import Setup
from tablegen.config.schema import Limits, Refinement
from tablegen.device.schedule import Schedule
from tablegen.planning.line_plan import LinePlan, Plan

_CONVERTER_SHARE = 0.5  # of the error; above it a better piezo model gains little

Basis = Literal["measured", "predicted", "laws", "uncompensated", "rests"]
Of = Literal["rms", "rms of one way, at least", "trace to retrace, rms", "trace to retrace, at most"]


class ErrorAnswer(Struct, frozen=True):
    """The error of one axis in percent of the line, nm and pixels, where it is from, its limit and the next step.

    ``code`` is that of the axis' most serious finding, and ``next_step`` the remedy of this. ``percent``, ``nm`` and
    ``pixels`` are None where nothing is known of the piezo, and ``of`` is then empty.
    """

    axis: str
    basis: Basis
    source: str
    code: FindingCode
    next_step: str
    of: Of | None = None
    percent: float | None = None
    nm: float | None = None
    pixels: float | None = None
    limit: str = ""

    def __str__(self) -> str:
        if self.basis == "rests":
            return f"{self.axis}: {self.source}"
        parts = [f"limited by {self.limit}"] if self.limit else []
        parts.append(f"next: {self.next_step}")
        if self.percent is None or self.nm is None or self.pixels is None:
            return "; ".join([f"{self.axis}: not measured: {self.source}", *parts])
        figures = f"{short(self.percent)} % of the line = {short(self.nm)} nm = {short(self.pixels)} pixel ({self.of})"
        if self.basis == "laws":
            return "; ".join([f"{self.axis}: not measured; by laws alone {figures}", *parts])
        return "; ".join([f"{self.axis}: {figures}, {self.source}", *parts])

    @property
    def brief(self) -> str:
        """The line without the next step."""
        return str(self).removesuffix(f"; next: {self.next_step}")

    def record(self) -> dict[str, Any]:
        """Return the answer as JSON outputs have it: its fields under their names, and the line as ``text``."""
        return {
            "basis": self.basis,
            "of": self.of,
            "percent": self.percent,
            "nm": self.nm,
            "pixels": self.pixels,
            "source": self.source,
            "limit": self.limit or None,
            "code": self.code or None,
            "next": self.next_step or None,
            "text": str(self),
        }


def short(value: float) -> str:
    """Format an error with two digits, and without an exponent where it is not tiny."""
    return f"{value:.2g}" if abs(value) < 99.5 else f"{value:.0f}"


def error_answers(setup: Setup, plan: Plan, certificates: Mapping[str, Certificate]) -> list[ErrorAnswer]:
    """Return the answer of each axis: measured before predicted, and predicted by traces before the laws alone."""
    answers = []
    for line in plan.lines:
        certificate = certificates[line.axis]
        answer = _answer(line, plan.schedule, certificate, getattr(setup.scan, line.axis).refinement)
        if fault := _fault(line, certificate, plan.limits):  # refine cannot learn what the scan itself spoils
            answer = replace(answer, code=fault[0], next_step=fault[1])
        answers.append(answer)
    return answers


def first_lines(setup: Setup, plan: Plan, certificates: Mapping[str, Certificate]) -> list[str]:
    """Return the lines that every output of a scan begins with: the error of each axis, and the time of an image."""
    return [*map(str, error_answers(setup, plan, certificates)), duration(plan.schedule)]


def measured_answer(line: LinePlan, count: int, of: Of, percent: float, source: str, code: FindingCode) -> ErrorAnswer:
    """Return the answer of a measurement of the running scan, whose window has ``count`` pixels along the axis."""
    return _with_figures(line, count, of, percent, basis="measured", source=source, code=code)


def pixel_count(line: LinePlan, schedule: Schedule) -> int:
    """Return the number of pixels of the imaging window along an axis."""
    return schedule.pixels if line.axis == "x" else max(schedule.up.count, 1)


def converter_percent(line: LinePlan, certificate: Certificate) -> float:
    """Return the rms error of the emitted codes, behind the response where one is known, in percent of the line."""
    rms = certificate.rms_error_lsb if certificate.position is None else certificate.position.rms_error_lsb
    return 100.0 * rms / abs(line.codes_per_unit)


def duration(schedule: Schedule) -> str:
    """Return the time of an image, and of a frame where that holds two, such as ``9 min 28 s an image``."""
    frame_s = float(Fraction(1) / schedule.frame_rate)
    if not schedule.down.count:
        return f"{time_text(frame_s)} an image"
    return f"{time_text(0.5 * frame_s)} an image, two images a frame: up and down"


def time_text(seconds: float) -> str:
    """Format a time for people: ``9 min 28 s``, ``2 h 5 min``, ``0.5 s``, ``2.5 ms``."""
    if round(seconds) >= 3600:
        hours, minutes = divmod(round(seconds / 60.0), 60)
        return f"{hours} h {minutes} min" if minutes else f"{hours} h"
    if round(seconds) >= 60:
        minutes, rest = divmod(round(seconds), 60)
        return f"{minutes} min {rest} s" if rest else f"{minutes} min"
    for unit, factor in (("s", 1.0), ("ms", 1e3), ("us", 1e6)):
        if seconds * factor >= 0.1 or unit == "us":
            return f"{seconds * factor:.3g} {unit}"
    raise AssertionError("the last unit fits")  # pragma: no cover


def _answer(line: LinePlan, schedule: Schedule, certificate: Certificate, refinement: Refinement | None) -> ErrorAnswer:
    axis, expected, count = line.axis, certificate.expected, pixel_count(line, schedule)
    if line.drive.resting:
        return ErrorAnswer(axis, "rests", f"rests at {line.drive.v_offset:.6g} V", "", "")
    if line.layer is not None:
        return _refined(line, count, certificate, refinement)
    if expected is not None and expected.basis == "traces" and expected.rms:
        figure = max(expected.rms.values(), key=lambda one: one.value)
        source = "predicted by the operator"
        if figure.uncertainty is not None:
            source += f" +- {short(figure.uncertainty)} % for {LEVEL_PERCENT} % of scans"
        answer = _with_figures(line, count, "rms", figure.value, basis="predicted", source=source)
        if certificate.pixels is not None:
            code: FindingCode = "rounded-pixels"
            return replace(answer, limit="the whole ticks of pixels", code=code, next_step=REMEDIES[code])
        return _limited(answer, line, certificate)
    if not line.drive.hysteresis.compensates:
        source = "hysteresis is not corrected, typically some 10 % of the line"
        return _without_figures(axis, "uncompensated", source, "uncompensated-hysteresis")
    source = "laws of the scanner file alone"
    if expected is not None and expected.mismatch is not None:
        of: Of = "trace to retrace, at most"
        return _with_figures(line, count, of, expected.mismatch.value, basis="laws", source=source)
    if line.band_limit.directions == "forward" and (residual := forward_residual(line)) is not None:
        # What the laws do not describe comes on top, and no retrace shows it.
        one_way: Of = "rms of one way, at least"
        return _with_figures(line, count, one_way, residual, basis="laws", source=source)
    why = "which have no branches for the stroke that is played, so the size of the error is unknown"
    return _without_figures(axis, "laws", f"{source}, {why}")


def _refined(line: LinePlan, count: int, certificate: Certificate, refinement: Refinement | None) -> ErrorAnswer:
    """Return the answer of an axis with a layer: what was measured when it was learnt."""
    if refinement is None or refinement.before_percent is None:
        return _without_figures(line.axis, "laws", "refined, but its layer does not say what was measured")
    of: Of = "trace to retrace, rms" if refinement.before_of == "mismatch" else "rms"
    # The best of the rounds has the measurement that was made while it was played itself.
    best = refinement.best is True
    source = "measured (refine, best round)"
    if not best:
        source = "measured (refine) before the layer of the last round"
        if refinement.after_percent is not None:
            source += f", with which refine predicts {short(refinement.after_percent)} %"
    answer = _with_figures(line, count, of, refinement.before_percent, basis="measured", source=source)
    return _limited(answer, line, certificate, final=best)


def _limited(answer: ErrorAnswer, line: LinePlan, certificate: Certificate, final: bool = False) -> ErrorAnswer:
    """Add what limits the error: the converter where its codes make most of it, else the piezo."""
    assert answer.percent is not None
    if converter_percent(line, certificate) < _CONVERTER_SHARE * answer.percent:
        code: FindingCode = "final-round" if final else answer.code
        return replace(answer, limit="the piezo", code=code, next_step=REMEDIES[code])
    return replace(answer, limit="the converter", code="converter-limit", next_step=REMEDIES["converter-limit"])


def _fault(line: LinePlan, certificate: Certificate, limits: Limits) -> tuple[FindingCode, str] | None:
    """Return the code and the remedy of the worst warning or broken limit of an axis; None where there is none."""
    if certificate.largest_step > certificate.max_step:
        return "step-guard", REMEDIES["step-guard"]
    exceeded = excess(certificate.scaling) or excess(certificate.scaling, limits.max_scaling_error_percent)
    if exceeded is not None:
        return exceeded.code, CAUSE_REMEDIES[cause_of(line, exceeded.parts)]
    if limits.max_error_lsb is not None and certificate.max_error_lsb > limits.max_error_lsb:
        return "converter-error", REMEDIES["converter-error"]
    warnings = expectation_warnings(line, certificate)
    return (warnings[0].code, REMEDIES[warnings[0].code]) if warnings else None


def _with_figures(
    line: LinePlan,
    count: int,
    of: Of,
    percent: float,
    *,
    basis: Basis,
    source: str,
    code: FindingCode = "model-mismatch",
) -> ErrorAnswer:
    nm = 0.01 * percent * line.drive.size_nm
    pixels = nm * count / line.drive.window_nm
    return ErrorAnswer(line.axis, basis, source, code, REMEDIES[code], of, percent, nm, pixels)


def _without_figures(axis: str, basis: Basis, source: str, code: FindingCode = "model-mismatch") -> ErrorAnswer:
    return ErrorAnswer(axis, basis, source, code, REMEDIES[code])
