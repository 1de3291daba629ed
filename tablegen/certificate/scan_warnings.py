"""Warnings of a scan that is worse than it should be: the error, its cause, and remedies that were tried."""

from collections.abc import Mapping

from tablegen.certificate.certificate import Certificate
from tablegen.certificate.excess import Excess, excess
from tablegen.certificate.matching import apart_warning
from tablegen.config.load import Setup
from tablegen.planning.line_plan import LinePlan, Plan
from tablegen.problems import Problem


def brief_warnings(plan: Plan, certificates: Mapping[str, Certificate]) -> list[str]:
    """What exceeds 1 % or the uncompensated line, a sentence an axis, without remedies: it costs nothing."""
    return [found.text(line.axis) for line, found in _found(plan, certificates)]


def scan_warnings(setup: Setup, plan: Plan, certificates: Mapping[str, Certificate]) -> list[Problem]:
    """The same with remedies, each at the key that the cause stands at. Every remedy was planned and measured.

    And what trace and retrace are apart by ticks alone, where that is more than a quarter of a pixel.
    """
    warnings = []
    for line, found in _found(plan, certificates):
        share = _share(line, found, certificates[line.axis])
        why = f"{found.text(line.axis)}; {share}{_advice(setup, plan, line, found)}"
        warnings.append(setup.scan_file.problem(_key(setup, line, found), why))
    if apart := apart_warning(plan):
        given = setup.scan.timing.ticks_per_line is not None
        warnings.append(setup.scan_file.problem(f"timing.{'ticks_per_line' if given else 'line_rate_hz'}", apart))
    return warnings


def limit_advice(setup: Setup, plan: Plan, certificates: Mapping[str, Certificate], axis: str) -> str:
    """Remedies that were tried for an axis above ``limits.max_scaling_error_percent``, in words."""
    line = plan.x if axis == "x" else plan.y
    most = plan.limits.max_scaling_error_percent
    found = excess(certificates[axis].scaling, most)
    return "" if found is None else _advice(setup, plan, line, found, most)


def _advice(setup: Setup, plan: Plan, line: LinePlan, found: Excess, most: float | None = None) -> str:
    from tablegen.certificate.remedies import tried  # only a scan that needs them pays for them

    remedies = tried(setup, plan, line, found, most)
    good = [str(one) for one in remedies if one.enough]
    best = min(remedies, key=lambda one: one.percent, default=None)
    if good:
        return f"tried: {'; or '.join(good)}"
    if best is not None and best.percent < 0.9 * abs(found.percent):
        return f"no remedy that was tried is enough; the best: {best}"
    return "no remedy that was tried helps"


def _found(plan: Plan, certificates: Mapping[str, Certificate]) -> list[tuple[LinePlan, Excess]]:
    every = [(line, excess(certificates[line.axis].scaling)) for line in plan.lines]
    return [(line, found) for line, found in every if found is not None]


def _share(line: LinePlan, found: Excess, certificate: Certificate) -> str:
    """What of the converter, of the table or of the band the scan uses."""
    if found.cause == "quantisation":
        codes, full = certificate.highest_code - certificate.lowest_code + 1, 1 << line.converter.bits
        word = abs(line.codes_per_unit) * line.scale / 2.0**line.program.bits
        coarse = f", and a word of the table {word:.3g} codes" if word > 0.5 else ""
        return f"the scan spans {codes} of the converter's {full} codes{coarse}; "
    if found.cause == "model":
        return f"max_boost_db holds back {len(line.held_harmonics)} of {line.series.harmonics} harmonics; "
    return ""


def _key(setup: Setup, line: LinePlan, found: Excess) -> str:
    axis = line.axis
    scan = getattr(setup.scan, axis)
    if found.cause == "quantisation":
        return f"{axis}.{'size_v' if scan.size_v is not None else 'size_nm'}"
    if scan.band_limit.method != "window" and found.cause == "band limit":
        return f"{axis}.band_limit.method"
    return f"{axis}.band_limit.{'harmonics' if scan.band_limit.cutoff_hz is None else 'cutoff_hz'}"
