"""Notes and expectations of a planned scan, with weights: what to know before its image is trusted."""

from collections.abc import Mapping

from tablegen.base.warnings import Finding, axis_name, worst_first
from tablegen.certificate.certificate import Certificate
from tablegen.certificate.matching import pixel_mismatch_note, pixel_mismatch_percent
from tablegen.certificate.shaped_periods import Changes
from tablegen.planning.line_plan import Plan
from tablegen.planning.settling import settling

_TRAVEL = 0.01  # of the travel of rounded codes; a simulated Bouc-Wen piezo then leaves some 0.05 % of the line more
_UNMEASURED_PERCENT = 0.01  # of the line: content above the measured response, from which it is worth a note
_TYPICAL_PERCENT = 10.0  # of a piezo whose hysteresis is not compensated: 10 to 20 % of the line


def scan_findings(plan: Plan, certificates: Mapping[str, Certificate]) -> list[Finding]:
    """List the findings of a scan, the worst first; warnings, which the certificate has, are not among them."""
    findings = note_findings(plan)
    for line in plan.lines:
        shaped = certificates[line.axis].shaped
        if shaped is not None and line.drive.hysteresis.compensates:
            findings += shaped_travel(line.axis, shaped.changes, shaped.rounded.changes)
        expected, pixels = certificates[line.axis].expected, certificates[line.axis].pixels
        if pixels is not None:
            findings.append(whole_ticks(line.axis, pixels.worst, pixels.scaling, pixels.mismatch))
        elif expected is not None and expected.mismatch is not None:
            figure = expected.mismatch
            findings.append(expected_mismatch(line.axis, expected.basis, figure.value, figure.uncertainty))
    return worst_first(findings)


def shaped_travel(axis: str, shaped: Changes, rounded: Changes) -> list[Finding]:
    """Return the finding of shaped codes that go to and fro, which hysteresis may follow; none where they hardly do."""
    if not rounded.mean_step or (extra := shaped.travel / rounded.travel - 1.0) < _TRAVEL:
        return []
    text = (
        f"shaped codes of {axis} go to and fro, {100.0 * extra:.3g} % further in all than without shaping: a piezo "
        "whose hysteresis follows every step then leaves its model, which no error of the position here contains"
    )
    return [Finding("expect", 0.0, text, code="shaped-travel", axis=axis_name(axis))]


def expected_mismatch(axis: str, basis: str, percent: float, uncertainty: float | None) -> Finding:
    """Return the finding of what the model of an axis is expected to leave between trace and retrace."""
    by = "" if uncertainty is None else f" \u00b1 {uncertainty:.2g}"
    what = "the operator expects" if basis == "traces" else "the laws expect"
    why = ", since turnarounds are rounded" if basis == "laws" else ""
    text = (
        f"the model leaves {percent:.3g}{by} % of the line: trace and retrace of {axis} are so far apart, {what}{why}"
    )
    return Finding("expect", percent, text, code="model-mismatch", axis=axis_name(axis))


def whole_ticks(axis: str, worst: Mapping[str, float], scaling: Mapping[str, float], mismatch: float) -> Finding:
    """Return the finding of what the rounding of a sine's pixels to whole ticks leaves, all in percent."""
    by_side = " and ".join(f"{value:.3g} % {side}" for side, value in scaling.items())
    text = (
        f"pixels of {axis} begin on whole ticks, which moves them by up to {max(worst.values()):.3g} % of the line: a "
        f"scaling error of {by_side}, and trace and retrace {mismatch:.3g} % of the line apart"
    )
    return Finding("expect", mismatch, text, code="rounded-pixels", axis=axis_name(axis))


def note_findings(plan: Plan) -> list[Finding]:
    """List the findings that follow from the plan alone, the worst first."""
    schedule, findings, resting = plan.schedule, [], plan.y.drive.resting
    per_pixel = schedule.pixel_ticks
    if per_pixel.denominator != 1 and schedule.pixel_table is None:
        whole = [n for n in (int(per_pixel), int(per_pixel) + 1) if n > 0]
        rates = [f"{float(schedule.line_rate) * float(per_pixel) / n:.6g} Hz" for n in whole]
        text = (
            f"a pixel is {float(per_pixel):.4g} ticks, so its start is rounded to the tick; "
            f"line rates near {' or '.join(rates)} make it {' or '.join(map(str, whole))} whole ticks"
        )
        findings.append(Finding("note", 50.0 / schedule.ticks, text, code="rounded-pixels", axis="x"))
    if mismatch := pixel_mismatch_note(plan):
        findings.append(Finding("note", pixel_mismatch_percent(plan), mismatch, code="image-offset", axis="x"))
    pixels = (
        f"a frame images {schedule.pixels} x {schedule.up.count}"
        + (f" + {schedule.down.count}" if schedule.down.count else "")
        + (" pixels: y rests" if resting else f" pixels: the lines inside the window of y, of {schedule.lines} a frame")
    )
    findings.append(Finding("note", 0.0, pixels, code="imaged-pixels"))
    for line in plan.lines:
        settles = settling(line.axis, line.drive, schedule)
        if settles is not None and settles.lines > schedule.settle_lines:
            text = (
                f"{line.axis} drifts by more than {settles.bound_nm:.3g} nm a frame after the {schedule.settle_lines} "
                f"settle_lines that follow a change of offset of {settles.offset_v:.4g} V or a smaller scan"
            )
            percent = 100.0 * settles.bound_nm / line.drive.size_nm
            findings.append(Finding("expect", percent, text, code="offset-drift", axis=axis_name(line.axis)))
        if (beyond := line.drive.shape.identification.unmeasured_percent) >= _UNMEASURED_PERCENT:
            assert line.drive.response is not None
            text = (
                f"{beyond:.2g} % of the line of {line.axis}, rms, are harmonics of its position above "
                f"{line.drive.response.highest_hz:.6g} Hz, where the response was not measured; they are taken to "
                "have the gain measured there, and any phase"
            )
            axis = axis_name(line.axis)
            findings.append(Finding("expect", beyond, text, code="unmeasured-response", axis=axis))
        if not line.drive.hysteresis.compensates and not line.drive.resting:
            text = f"hysteresis of {line.axis} is not compensated: the scanner file has no model for it"
            axis = axis_name(line.axis)
            findings.append(Finding("spoils", _TYPICAL_PERCENT, text, code="uncompensated-hysteresis", axis=axis))
    return worst_first(findings)
