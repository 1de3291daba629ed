"""Plan and certificate in words: the block in every emitted file and on the terminal, in plain ASCII."""

from fractions import Fraction
from math import log10

import numpy as np

from tablegen.certificate.certificate import Certificate
from tablegen.certificate.excess import excess
from tablegen.certificate.matching import pixel_mismatch_percent
from tablegen.certificate.shaped_errors import ShapedErrors
from tablegen.certificate.shaped_periods import Passage
from tablegen.certificate.tilt_text import tilt_blocks
from tablegen.compensation.expectation import LEVEL_PERCENT, Expectation, Figure
from tablegen.compensation.hold import hold_inverse
from tablegen.fixedpoint.shaping import Shaping
from tablegen.planning.line_plan import LinePlan, Plan
from tablegen.planning.pixel_errors import PixelErrors
from tablegen.planning.settling import settling, settling_text

_GRID = 32  # points per period of the highest harmonic


def drive_lines(line: LinePlan) -> list[tuple[str, str]]:
    """List what is applied to an axis, factor by factor: label and value."""
    drive, output = line.drive, line.program.output
    if drive.resting:
        return [
            ("rests", f"at {drive.v_offset:.6g} V, {drive.position_nm:.6g} nm"),
            ("offset", f"code {output.offset_code}"),
        ]
    rows = [
        *([("motion", "a sine, pixels where the operator says that the piezo is")] if line.imaged else []),
        (
            "scan",
            f"{drive.size_nm:.6g} nm line, {drive.window_nm:.6g} nm window, at {drive.position_nm:.6g} nm",
        ),
        ("V_offset", f"{drive.v_offset:.6g} V   p = {drive.p_offset:+.4f}"),
        ("V_scan", f"{drive.v_scan:.6g} V   {drive.v_scan_normalised:.6g} of {drive.driver.unit}, (9) (12)"),
        ("m", f"{drive.m:.6f}   offset, (1)"),
        ("g", f"{drive.g:.6f}   frequency, (23)"),
        ("m g V_scan", f"{drive.v_amplitude:.6g} V peak to peak"),
        ("branches", line.drive.hysteresis.described(line.drive.shape)),
        ("line", f"{line.program.ticks} ticks, {rate(line.rate)}{_requested(line)}, turn {drive.turn:g}"),
        (
            "harmonics",
            f"{line.series.harmonics}, up to {_hz(line.series.harmonics * float(line.rate))}, {_method(line)}",
        ),
        ("table", f"{len(line.program.words)} words of {line.program.bits} bits, {line.program.mode}{_chosen(line)}"),
        *_needs_of_table(line),
        *(("", text) for text in _takes(line)),
        ("gain, offset", f"{output.gain_word} / 2^{output.gain_q}, code {output.offset_code}"),
    ]
    if line.layer is not None:
        layer = 100.0 * float(np.max(np.abs(line.layer.on_grid(_GRID * line.layer.harmonics))))
        rows.append(("refinement", f"{line.layer.harmonics} harmonics learnt, up to {layer:.3g} % of the line"))
    rows.append(("hold", _hold(line)))
    if line.held_harmonics:
        first, last = line.held_harmonics[0], line.held_harmonics[-1]
        rows.append(("boost limit", f"holds back {len(line.held_harmonics)} harmonics, {first} to {last}"))
    return rows


def _hold(line: LinePlan) -> str:
    """Describe how the compensation of the converter's hold changes the harmonics."""
    codes = line.program.phase.ticks
    text = f"{5e5 / (float(line.rate) * codes):.6g} us ahead, half of what a code holds"
    if line.program.hold > 1:
        return text
    raised = 20.0 * log10(float(np.hypot(*hold_inverse(line.series.harmonics, codes, steps=False))[-1]))
    return text if raised < 0.001 else f"{text}; the highest harmonic raised by {raised:.2g} dB"


def _method(line: LinePlan) -> str:
    low, high = line.band_limit.window
    allowed = "" if line.kept_percent is None else f", minimum acceleration at {line.kept_percent:.3g} %"
    return f"{line.band_limit.method} {low:g}..{high:g} {line.band_limit.directions}{allowed}"


def _needs_of_table(line: LinePlan) -> list[tuple[str, str]]:
    """List what a device must have: a build knows neither its options nor its clock, and cannot refuse."""
    if line.program.mode != "cubic":
        return []
    return [("", "needs DAC_SPLINE=1 in C; in Verilog 11 clocks a tick, 90 in low area")]


def _chosen(line: LinePlan) -> str:
    return "" if line.table_request is None else f", {line.table_request}"


def _requested(line: LinePlan) -> str:
    same = abs(float(line.rate) - line.requested_hz) <= 1e-12 * line.requested_hz
    return " as asked" if same else f" (asked {_hz(line.requested_hz)})"


def _hz(value: float) -> str:
    return f"{value:.6g} Hz"


def rate(value: Fraction) -> str:
    """Format a rate as a number, with the exact fraction where the number is not exact."""
    number = _hz(float(value))
    if Fraction(f"{float(value):.6g}") == value:
        return number
    return f"{number} = {value.numerator}/{value.denominator} Hz"


def certificate_lines(certificate: Certificate) -> list[tuple[str, str]]:
    """List the figures of a certificate: label and value."""
    c = certificate
    error = f"max {_lsb(c.max_error_lsb)} LSB, rms {_lsb(c.rms_error_lsb)} LSB"
    if c.shaped is None:
        rows = [("error", f"{error}, over all {c.ticks} ticks")]
    else:
        rows = [("error", f"{error}, of the position, {behind(c.shaped.passage)}"), *shaped_lines(c.shaped)]
    for side, e in c.scaling.items():
        parts = (
            f"band limit {_percent(e.band_limit)}, quantisation {_percent(e.quantisation)}, model {_percent(e.model)}"
        )
        rows.append(("scaling " + side, f"{_percent(e.total)} % peak to peak ({parts})"))
        bare = "" if e.uncompensated is None else f"uncompensated {_percent(e.uncompensated)} %; "
        rows.append(("", f"{bare}window's size off by {e.size:+.4f} %"))
    if c.position is not None:
        sides = ", ".join(f"scaling {side} {_percent(value)} %" for side, value in c.position.scaling.items())
        rows.append(("position", f"{sides}, with the steps of the codes"))
        errors = f"max {_lsb(c.position.max_error_lsb)} LSB, rms {_lsb(c.position.rms_error_lsb)} LSB"
        rows.append(("", f"{errors}, {behind(c.position.passage)}"))
    for side, r in (c.refinement or {}).items():
        moves = f"moves up to {_percent(r.position)} % of the line, takes away {_percent(r.scaling)} % peak to peak"
        rows.append(("refined " + side, moves))
    if c.pixels is not None:
        rows += [("pixels" if not i else "", text) for i, text in enumerate(_pixel_texts(c.pixels))]
    expected = [] if c.expected is None else expected_lines(c.expected)
    rows += [("" if i else "on the scanner", text) for i, text in enumerate(expected)]
    rows += [
        (
            "codes",
            f"{c.lowest_code}..{c.highest_code}, headroom {c.headroom_low} below, {c.headroom_high} above",
        ),
        (
            "step",
            f"at most {c.largest_step} of {c.max_step} codes a tick; {c.peak_slew_v_per_s:.4g} V/s at the piezo",
        ),
    ]
    if c.beyond_cutoff_db is not None:
        rows.append(("beyond cutoff", f"{c.beyond_cutoff_db:.1f} dB" + _resonance(c)))
    if c.peak_acceleration is not None:
        rows.append(("acceleration", f"at most {c.peak_acceleration:.4g} of the line a period squared{_optimum(c)}"))
    return rows


def behind(passage: Passage) -> str:
    """Describe the response behind which errors of the position are judged."""
    if passage.band_hz is not None:
        return f"up to {_hz(passage.band_hz)}: no response is known"
    if passage.frequency_hz is not None:
        return f"behind {_hz(passage.frequency_hz)}, Q {passage.quality:g}"
    assert passage.response is not None
    return f"behind the response of {len(passage.response.f_hz)} points"


def shaped_lines(shaped: ShapedErrors) -> list[tuple[str, str]]:
    """List what shaping does beside rounding alone, and what it costs: label and value."""
    was, order = shaped.rounded, shaping_text(shaped.shaping)
    scaling = "".join(f", scaling {side} {_percent(value)} %" for side, value in was.scaling.items())
    largest, rms = shaped.code_error_lsb
    now, before = shaped.changes, was.changes
    return [
        ("shaping", f"{order}; judged over {shaped.ticks} ticks"),
        ("", f"without: max {_lsb(was.max_error_lsb)} LSB, rms {_lsb(was.rms_error_lsb)} LSB{scaling}"),
        ("", f"codes alone: max {largest:.3f} LSB, rms {rms:.3f} LSB, steps up to {shaped.largest_step} codes"),
        (
            "",
            f"codes change on {now.percent:.3g} % of ticks, by {now.mean_step:.3g} in the mean; "
            f"without on {before.percent:.3g} %, by {before.mean_step:.3g}",
        ),
    ]


def shaping_text(shaping: Shaping) -> str:
    """Return the order of a shaping, and where its zeros are."""
    if shaping.order == 3:
        return f"third order, zeros at 0 Hz and at 2 cos = {shaping.zero}/64"
    return {0: "off", 1: "first order", 2: "second order"}[shaping.order]


def _pixel_texts(pixels: PixelErrors) -> list[str]:
    """Describe the errors that the rounding of pixels to whole ticks leaves."""
    sides = ", ".join(
        f"{side} rms {_percent(pixels.rms[side])} %, at most {_percent(pixels.worst[side])} %" for side in pixels.rms
    )
    scaling = ", ".join(f"{side} {_percent(value)} %" for side, value in pixels.scaling.items())
    return [f"{sides} of the line", f"scaling {scaling}; trace and retrace {_percent(pixels.mismatch)} % apart"]


def _lsb(value: float) -> str:
    return f"{value:.3f}" if value >= 0.01 else f"{value:.2g}"


def _optimum(c: Certificate) -> str:
    if c.optimum is None or c.peak_acceleration is None:
        return ""
    return f", {c.peak_acceleration / c.optimum:.3f} of the optimum {c.optimum:.4g}"


def expected_lines(expectation: Expectation) -> list[str]:
    """List what to expect on the scanner; each figure has its uncertainty, or a word that there is none."""
    if expectation.basis == "laws":
        assert expectation.mismatch is not None
        mismatch = _percent(expectation.mismatch.value)
        return [
            f"trace and retrace up to {mismatch} % of the line apart by the laws, since turnarounds",
            "are rounded; no measured uncertainty",
        ]
    rows = [
        (f"{what} {side}", figure)
        for what, sides in (("rms", expectation.rms), ("scaling", expectation.scaling))
        for side, figure in sides.items()
    ]
    rows += [(what, one) for what, one in (("mismatch", expectation.mismatch), ("size", expectation.size)) if one]
    texts = [f"{what} {_figure(figure, what == 'size')}" for what, figure in rows]
    lines = [", ".join(texts[i : i + 2]) for i in range(0, len(texts), 2)]
    if expectation.distance is not None:
        away = f"nearest measured line {expectation.distance:.2g} % of v_max away"
        lines.append(f"{away}; +- holds for {LEVEL_PERCENT} % of scans")
    return lines


def _figure(figure: Figure, signed: bool) -> str:
    value = f"{figure.value:+.2g}" if signed else f"{figure.value:.2g}"
    return f"{value} %" if figure.uncertainty is None else f"{value} +- {figure.uncertainty:.2g} %"


def _resonance(certificate: Certificate) -> str:
    at = certificate.at_resonance_db
    return "" if at is None else f"; at the resonance {at:.1f} dB"


def _percent(value: float) -> str:
    return f"{value:.3g}" if abs(value) >= 0.0005 else "0.000"


def _windows(plan: Plan) -> list[str]:
    """Describe which ticks are imaged, and the distance between trace and retrace for that alone."""
    schedule = plan.schedule
    text = f"imaged are ticks {schedule.forward.first}..{schedule.forward.stop - 1}"
    if not schedule.backward.count:
        return [text]
    text += f" and {schedule.backward.first}..{schedule.backward.stop - 1}"
    mismatch = _percent(pixel_mismatch_percent(plan))
    return [f"{text}; a pixel's places in trace and retrace are up to {mismatch} % of the line apart"]


def _volts(line: LinePlan) -> str:
    """Describe the volts of an axis with a converter or an amplifier of its own."""
    zero, step = line.converter.v_zero, line.converter.v_per_code
    return f"{zero:.6g} V {'-' if step < 0.0 else '+'} {abs(step):.6g} V c, at the piezo"


def _takes(line: LinePlan) -> list[str]:
    """Return what a sample takes, if the scan file names a processor, and what would give it runs."""
    takes = line.sample_cost
    return [] if takes is None else [f"{takes}, in C", *([takes.remedy] if takes.remedy else [])]


def summary(plan: Plan, certificates: dict[str, Certificate]) -> list[str]:
    """List the lines of text of the whole summary."""
    schedule = plan.schedule
    lines = [
        f"{schedule.ticks} ticks a line, {schedule.lines} lines a frame, "
        f"{rate(schedule.line_rate)} lines, {rate(schedule.frame_rate)} frames, {schedule.pixels} pixels",
        *_windows(plan),
    ]
    settles = {line.axis: settling(line.axis, line.drive, schedule) for line in plan.lines}
    for line in plan.lines:
        lines += ["", f"{line.axis} drive"]
        lines += [f"  {label:<18}{value}" for label, value in drive_lines(line)]
        if plan.x.converter != plan.y.converter:
            lines.append(f"  {'volts of code c':<18}{_volts(line)}")
        one = settles[line.axis]
        texts = [f"not known: there is no operator of {line.axis}"] if any(settles.values()) else []
        for i, text in enumerate(texts if one is None else settling_text(one)):
            lines.append(f"  {'' if i else 'settles':<18}{text}")
        lines += [f"{line.axis} certificate"]
        lines += [f"  {label:<18}{value}" for label, value in certificate_lines(certificates[line.axis])]
        exceeded = excess(certificates[line.axis].scaling)
        for i, text in enumerate([] if exceeded is None else exceeded.text(line.axis).split("; ")):
            lines.append(f"  {'' if i else 'warning':<18}{text}")
    return lines + tilt_blocks(plan)
