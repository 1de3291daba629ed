"""Warnings of a scan that is worse than it should be: the error, its cause, and tested remedies."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

from tablegen.base.input_errors import Problem
from tablegen.base.warnings import Finding, as_printed, worst_first
from tablegen.certificate.certificate import Certificate
from tablegen.certificate.excess import Excess, excess
from tablegen.certificate.expectation_checks import RESONANCE_PERCENT, ExpectationWarning, expectation_warnings
from tablegen.certificate.matching import pixel_mismatch_percent, pixel_mismatch_warning
from tablegen.config.load import Setup
from tablegen.planning.line_plan import LinePlan, Plan

if TYPE_CHECKING:
    from tablegen.certificate.remedies import Remedy


def brief_warnings(plan: Plan, certificates: Mapping[str, Certificate]) -> list[str]:
    """List errors above 1 % or the uncompensated line, and doubtful expectations, without remedies, which take time."""
    findings = [
        Finding("spoils", abs(one.percent), f"{one.text(line.axis)}{_behind_resonance(one, certificates[line.axis])}")
        for line, one in _exceeded(plan, certificates)
    ]
    findings += [
        Finding("spoils", warning_percent(warning, certificates[line.axis]), warning.text)
        for line, warning in _expectation_warnings(plan, certificates)
    ]
    return [one.text for one in worst_first(findings)]


def scan_warnings(setup: Setup, plan: Plan, certificates: Mapping[str, Certificate]) -> list[Problem]:
    """List the warnings with remedies, each at the key of its cause; see ``weighed_warnings``."""
    return [problem for _, problem in weighed_warnings(setup, plan, certificates)]


def weighed_warnings(setup: Setup, plan: Plan, certificates: Mapping[str, Certificate]) -> list[tuple[float, Problem]]:
    """List the warnings of a scan, each with a percentage of the line, the worst first.

    They are errors above their limits, doubts about the expectation on the scanner, and pixels whose places in trace
    and retrace differ by more than a quarter of a pixel. Every remedy in them was planned and measured.
    """
    warnings = []
    for line, exceeded in _exceeded(plan, certificates):
        certificate = certificates[line.axis]
        share = _share(line, exceeded, certificate)
        text = f"{exceeded.text(line.axis)}{_behind_resonance(exceeded, certificate)}"
        text += _resonance_advice(setup, plan, line, exceeded, certificate)
        why = f"{text}; {share}{_advice(setup, plan, line, exceeded)}"
        problem = setup.scan_file.problem(_key(setup, line, exceeded), why)
        warnings.append((abs(exceeded.percent), problem.coded(exceeded.code, line.axis)))
    for line, warning in _expectation_warnings(plan, certificates):
        key, advice = _size_key(setup, line), ""
        if warning.code == "expected-scaling-error":
            from tablegen.certificate.remedies import operator_remedies

            remedies = operator_remedies(setup, plan, line, warning.limit, own=False)
            key, advice = _band_key(setup, line), "; " + _in_words(remedies, warning.percent)
        elif warning.code == "resonance":
            from tablegen.certificate.remedies import resonance_remedies

            advice = "; " + _in_words(resonance_remedies(setup, plan, line, warning.limit), warning.percent)
        percent = warning_percent(warning, certificates[line.axis])
        warnings.append((percent, setup.scan_file.problem(key, warning.text + advice).coded(warning.code, line.axis)))
    if mismatch := pixel_mismatch_warning(plan):
        fixed_ticks = setup.scan.timing.ticks_per_line is not None
        key = f"timing.{'ticks_per_line' if fixed_ticks else 'line_rate_hz'}"
        warnings.append(
            (pixel_mismatch_percent(plan), setup.scan_file.problem(key, mismatch).coded("image-offset", "x"))
        )
    return sorted(warnings, key=lambda one: -as_printed(one[0]))


def warning_percent(warning: ExpectationWarning, certificate: Certificate) -> float:
    """Return the error of the scan in percent; for a distance, which is one of volts, the operator's uncertainty."""
    expected = certificate.expected
    if warning.code != "operator-distance" or expected is None:
        return warning.percent
    return max((figure.value + (figure.uncertainty or 0.0) for figure in expected.rms.values()), default=0.0)


def limit_advice(setup: Setup, plan: Plan, certificates: Mapping[str, Certificate], axis: str) -> str:
    """Return tested remedies for an axis above ``limits.max_scaling_error_percent``, in words."""
    line = plan.x if axis == "x" else plan.y
    most = plan.limits.max_scaling_error_percent
    exceeded = excess(certificates[axis].scaling, most)
    if exceeded is not None:
        return _advice(setup, plan, line, exceeded, most)
    both = certificates[axis].scaling_on_scanner
    if both is None or most is None or both[1] + both[2] <= most:
        return ""
    from tablegen.certificate.remedies import operator_remedies

    return _in_words(operator_remedies(setup, plan, line, most, own=True), both[1] + both[2])


def _advice(setup: Setup, plan: Plan, line: LinePlan, exceeded: Excess, most: float | None = None) -> str:
    from tablegen.certificate.remedies import excess_remedies  # only a scan that needs them pays for them

    return _in_words(excess_remedies(setup, plan, line, exceeded, most), abs(exceeded.percent))


def _resonance_advice(setup: Setup, plan: Plan, line: LinePlan, exceeded: Excess, certificate: Certificate) -> str:
    """Return what tested remedies leave of a scaling error that the resonance makes larger; "" where it does not.

    The remedies of the excess itself are judged by the codes alone, without the resonance.
    """
    position = certificate.position
    if position is None or exceeded.what != "scaling error":
        return ""
    percent = position.worst[1]
    if percent <= max(exceeded.percent, RESONANCE_PERCENT):
        return ""
    from tablegen.certificate.remedies import resonance_remedies

    remedies = resonance_remedies(setup, plan, line, RESONANCE_PERCENT)
    texts = [str(one) for one in remedies if one.percent < 0.9 * percent]
    return f" ({', '.join(texts)})" if texts else ""


def _in_words(remedies: "list[Remedy]", percent: float) -> str:
    good = [str(one) for one in remedies if one.enough]
    best = min(remedies, key=lambda one: one.percent, default=None)
    if good:
        return f"tried: {'; or '.join(good)}"
    if best is not None and best.percent < 0.9 * percent:
        return f"no remedy that was tried is enough; the best: {best}"
    return "no remedy that was tried helps"


def _exceeded(plan: Plan, certificates: Mapping[str, Certificate]) -> list[tuple[LinePlan, Excess]]:
    every = [(line, excess(certificates[line.axis].scaling)) for line in plan.lines]
    return [(line, exceeded) for line, exceeded in every if exceeded is not None]


def _expectation_warnings(
    plan: Plan, certificates: Mapping[str, Certificate]
) -> list[tuple[LinePlan, ExpectationWarning]]:
    """List the warnings of both axes; one of a resonance is left out where the scaling error already names it."""
    explained = {line.axis for line, exceeded in _exceeded(plan, certificates) if exceeded.what == "scaling error"}
    every = [(line, warning) for line in plan.lines for warning in expectation_warnings(line, certificates[line.axis])]
    return [(line, warning) for line, warning in every if warning.code != "resonance" or line.axis not in explained]


def _behind_resonance(exceeded: Excess, certificate: Certificate) -> str:
    """Return a scaling error that the resonance makes larger, in words; "" where it does not."""
    position = certificate.position
    if position is None or exceeded.what != "scaling error":
        return ""
    side, percent = position.worst
    return f"; with the resonance that steps drive it is {percent:.3g} % {side}" if percent > exceeded.percent else ""


def _share(line: LinePlan, exceeded: Excess, certificate: Certificate) -> str:
    """Return how much of the converter, of the table or of the band the scan uses."""
    if exceeded.cause == "quantisation":
        codes, full = certificate.highest_code - certificate.lowest_code + 1, 1 << line.converter.bits
        word = abs(line.codes_per_unit) * line.scale / 2.0**line.program.bits
        coarse = f", and a word of the table {word:.3g} codes" if word > 0.5 else ""
        return f"the scan spans {codes} of the converter's {full} codes{coarse}; "
    if exceeded.cause == "model":
        return f"max_boost_db holds back {len(line.held_harmonics)} of {line.series.harmonics} harmonics; "
    return ""


def _key(setup: Setup, line: LinePlan, exceeded: Excess) -> str:
    if exceeded.cause == "quantisation":
        return _size_key(setup, line)
    if line.band_limit.method != "window" and exceeded.cause == "band limit":
        return f"{line.axis}.band_limit.method"
    return _band_key(setup, line)


def _size_key(setup: Setup, line: LinePlan) -> str:
    return f"{line.axis}.{'size_v' if getattr(setup.scan, line.axis).size_v is not None else 'size_nm'}"


def _band_key(setup: Setup, line: LinePlan) -> str:
    axis = line.axis
    scan = getattr(setup.scan, axis)
    if scan.band_limit.max_scaling_error_percent is not None:
        return f"{axis}.band_limit.max_scaling_error_percent"
    return f"{axis}.band_limit.{'harmonics' if scan.band_limit.cutoff_hz is None else 'cutoff_hz'}"
