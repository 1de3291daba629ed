"""The plan and its certificate as plain data: the content of the manifest."""

from collections.abc import Mapping
from decimal import ROUND_CEILING, Context, Decimal
from typing import TYPE_CHECKING, Any

import numpy as np
from msgspec.structs import asdict

from tablegen.certificate.certificate import Certificate
from tablegen.certificate.line_errors import LayerEffect, ScalingError
from tablegen.certificate.shaped_errors import ShapedErrors
from tablegen.certificate.shaped_periods import Passage
from tablegen.compensation.dynamics import capped_inverse
from tablegen.compensation.expectation import Expectation, Figure
from tablegen.compensation.line import SineLine
from tablegen.device.schedule import Schedule, Window
from tablegen.fixedpoint.converter import Converter
from tablegen.fixedpoint.frame_program import FrameProgram
from tablegen.fixedpoint.output import Output
from tablegen.fixedpoint.shaping import Shaping
from tablegen.manifest.format import CONVERTER_KEYS
from tablegen.numerics.arrays import Floats
from tablegen.planning.line_plan import LinePlan, Plan
from tablegen.planning.pixel_errors import PixelErrors

if TYPE_CHECKING:
    from tablegen.compensation.operator.turned_frame import FrameMotion
    from tablegen.planning.tilt import TiltedOutput, TiltErrors

_WRITTEN_APART = frozenset(
    {"scaling", "refinement", "expected", "peak_acceleration", "optimum", "shaped", "position", "pixels"}
)


def plan_record(plan: Plan) -> dict[str, Any]:
    """Return everything that decides what a device plays, as JSON-ready data: axes and schedule."""
    axes = {line.axis: _axis(line) for line in plan.lines}
    x, y = axes["x"]["output"], axes["y"]["output"]
    if any(x[key] != y[key] for key in CONVERTER_KEYS):
        y["own_hardware"] = True
    record = {"name": plan.name, "scanner": plan.scanner, "sequence": sequence_record(plan.schedule), "axes": axes}
    return record | {tilt.name: {"offset_v": _centre_v(tilt), **tilt_record(tilt)} for tilt in plan.tilts}


def tilt_record(tilt: "TiltedOutput") -> dict[str, Any]:
    """Return an output beside x and y as JSON-ready data: slopes, motion and integers."""
    slopes = {"slope_x": tilt.slope_x, "slope_y": tilt.slope_y, "nm_per_v": tilt.nm_per_v}
    return slopes | frame_axis_record(tilt.motion, tilt.program, tilt.converter)


def _centre_v(tilt: "TiltedOutput") -> float:
    """Return the volts in the centre of the scan."""
    return tilt.converter.v_zero + tilt.converter.v_per_code * tilt.offset


def frame_axis_record(motion: "FrameMotion", program: FrameProgram, converter: Converter) -> dict[str, Any]:
    """Return an output with a slow part as JSON-ready data."""
    return {
        "fast_nm": motion.fast_nm,
        "slow_nm": motion.slow_nm,
        "bits": program.fast.bits,
        "words": program.fast.words.tolist(),
        "second": program.second.tolist(),
        "gains": {"spacing": program.gains.spacing, "words": program.gains.words.tolist()},
        "ratios": {"spacing": program.ratios.spacing, "words": program.ratios.words.tolist()},
        "slow": {
            "gain_word": program.slow.gain_word,
            "offset_word": program.slow.offset_word,
            "words": program.slow.words.tolist(),
        },
        "output": output_record(program.output, converter),
    }


def tilt_certificate_record(errors: "TiltErrors") -> dict[str, Any]:
    """Return the certificate of z or aux as JSON-ready data; a maximum is one as printed."""
    return {
        "error_lsb": _bound(errors.error_lsb),
        "error_nm": _bound(errors.error_nm),
        "codes": asdict(errors.codes),
    }


def certificate_record(certificate: Certificate) -> dict[str, Any]:
    """Return a certificate as JSON-ready data, its figures to six significant digits."""
    record: dict[str, Any] = {
        name: _figure(getattr(certificate, name))
        for name in certificate.__struct_fields__
        if name not in _WRITTEN_APART
    }
    if certificate.peak_acceleration is not None:
        record["peak_acceleration"] = _bound(certificate.peak_acceleration)
    record["max_error_lsb"] = _bound(certificate.max_error_lsb)
    record["scaling_error_percent"] = _sides(certificate.scaling)
    if certificate.refinement is not None:
        record["refinement_percent"] = _sides(certificate.refinement)
    if certificate.expected is not None:
        record["expected"] = _expected(certificate.expected)
    if certificate.shaped is not None:
        record["shaped"] = _shaped(certificate.shaped)
    if certificate.pixels is not None:
        record["pixels"] = _pixels(certificate.pixels)
    if certificate.position is not None:
        position = certificate.position
        record["position"] = {
            "passage": _passage(position.passage),
            "max_error_lsb": _bound(position.max_error_lsb),
            "rms_error_lsb": _figure(position.rms_error_lsb),
            "scaling_error_percent": {side: _figure(value) for side, value in position.scaling.items()},
        }
    return record


def _passage(passage: Passage) -> dict[str, Any]:
    """Return the fields of a passage that apply; all points of a measured response."""
    response = passage.response
    if response is None:
        return {key: value for key, value in asdict(passage).items() if value is not None}
    points = {"hz": response.f_hz, "gain": response.gain, "phase_turns": response.phase_turns}
    return {"response": {key: value.tolist() for key, value in points.items()}}


def _shaped(shaped: ShapedErrors) -> dict[str, Any]:
    """Return the passage behind which the position is judged, and the figures without shaping."""
    largest, rms = shaped.code_error_lsb
    rounded = shaped.rounded
    return {
        "passage": _passage(shaped.passage),
        "ticks": shaped.ticks,
        "max_code_error_lsb": _bound(largest),
        "rms_code_error_lsb": _figure(rms),
        "largest_step": shaped.largest_step,
        "changes": {key: _figure(value) for key, value in asdict(shaped.changes).items()},
        "rounded": {
            "max_error_lsb": _bound(rounded.max_error_lsb),
            "rms_error_lsb": _figure(rounded.rms_error_lsb),
            "scaling_error_percent": {side: _figure(value) for side, value in rounded.scaling.items()},
            "changes": {key: _figure(value) for key, value in asdict(rounded.changes).items()},
        },
    }


def _pixels(pixels: PixelErrors) -> dict[str, Any]:
    """Return the errors of pixels, of all together and of each in the order of its direction's image."""
    sides: dict[str, Any] = {
        f"{name}_percent": {side: _figure(value) for side, value in getattr(pixels, name).items()}
        for name in ("rms", "worst", "scaling")
    }
    errors = {side: [_figure(float(value)) for value in values] for side, values in pixels.errors.items()}
    return {**sides, "mismatch_percent": _figure(pixels.mismatch), "errors_percent": errors}


def _expected(expectation: Expectation) -> dict[str, Any]:
    """Return the known figures of an expectation."""

    def pair(figure: Figure) -> dict[str, Any]:
        return {"value": _figure(figure.value), "uncertainty": _figure(figure.uncertainty)}

    record: dict[str, Any] = {"basis": expectation.basis}
    for name, sides in (("rms", expectation.rms), ("scaling", expectation.scaling)):
        if sides:
            record[f"{name}_percent"] = {side: pair(figure) for side, figure in sides.items()}
    for name, figure in (("mismatch", expectation.mismatch), ("size", expectation.size)):
        if figure is not None:
            record[f"{name}_percent"] = pair(figure)
    if expectation.stroke is not None:
        stroke = expectation.stroke
        record["stroke"] = {
            **{
                side: dict(zip(("beta", "u_peak"), getattr(stroke, side), strict=True))
                for side in ("forward", "backward")
            },
            "size": stroke.size,
        }
    if expectation.distance is not None:
        record["distance_percent"] = _figure(expectation.distance)
    return record


def _sides(figures: Mapping[str, ScalingError] | Mapping[str, LayerEffect]) -> dict[str, dict[str, Any]]:
    return {
        side: {part: _figure(value) for part in one.__struct_fields__ if (value := getattr(one, part)) is not None}
        for side, one in figures.items()
    }


def _bound(value: float) -> float:
    """Round up to six significant digits: a maximum has to be one as printed."""
    return float(Context(prec=6, rounding=ROUND_CEILING).create_decimal(Decimal(value)))


def _figure(value: float | int | None) -> float | int | None:
    return float(f"{value:.6g}") if isinstance(value, float) else value


def _window(window: Window) -> list[int]:
    return [window.first, window.count]


def sequence_record(schedule: Schedule) -> dict[str, Any]:
    """Return a schedule as JSON-ready data."""
    return {
        "update_rate_hz": [schedule.update_rate_hz.numerator, schedule.update_rate_hz.denominator],
        "line_ticks": schedule.ticks,
        "frame_lines": schedule.lines,
        "pixels": schedule.pixels,
        "settle_lines": schedule.settle_lines,
        "turn_tick": schedule.turn_tick,
        "forward_ticks": _window(schedule.forward),
        "backward_ticks": _window(schedule.backward),
        "turn_line": schedule.turn_line,
        "up_lines": _window(schedule.up),
        "down_lines": _window(schedule.down),
        **({} if schedule.pixel_table is None else {"pixel_table": [list(counts) for counts in schedule.pixel_table]}),
    }


def _layer(line: LinePlan) -> dict[str, Any]:
    """Return the layer that `tablegen refine` learnt; nothing without one, so that such a build keeps its hash."""
    if line.layer is None:
        return {}
    return {"refinement": {"harmonics": line.layer.harmonics, "a": line.layer.a.tolist(), "b": line.layer.b.tolist()}}


def _place(line: LinePlan) -> dict[str, Any]:
    """Return the position of a sine over a period, and the part of the line that is imaged; nothing of a line."""
    shape = line.drive.shape
    if not isinstance(shape, SineLine):
        return {}
    place = shape.place
    imaged = None if line.imaged is None else list(line.imaged)
    return {"place": {"a0": place.a0, "a": place.a.tolist(), "b": place.b.tolist()}, "imaged": imaged}


def _followed(line: LinePlan) -> dict[str, Any]:
    """Return the target of the piezo, where the played series does not tell it, and what the boost limit left of it."""
    response = line.drive.response
    if response is None:
        return {}
    target = {"a0": line.target.a0, "a": line.target.a.tolist(), "b": line.target.b.tolist()}
    limited = np.array(line.held_harmonics, dtype=np.float64)
    inverse, applied = response.inverse(limited * float(line.rate)), _capped(line, limited)
    # The phase is kept, so that the ratio is real.
    factors = (
        np.sqrt((applied[0] ** 2 + applied[1] ** 2) / (inverse[0] ** 2 + inverse[1] ** 2)) if len(limited) else limited
    )
    return {"target": target, "held_factors": factors.tolist()}


def _capped(line: LinePlan, harmonics: Floats) -> tuple[Floats, Floats]:
    """Return what these harmonics are multiplied by in place of the inverse response."""
    assert line.drive.response is not None
    return capped_inverse(line.drive.response, harmonics * float(line.rate), line.drive.max_boost_db)[:2]


def _resonance(line: LinePlan) -> dict[str, Any]:
    response = line.drive.response
    if response is None:
        return {}
    return {"resonance": {"hz": response.resonance_hz, "half_width_hz": response.half_width_hz}}


def _asked_table(line: LinePlan) -> dict[str, Any]:
    """Return the request of a table that the build chose; nothing for one that was written."""
    request = line.table_request
    if request is None:
        return {}
    cost = request.cost
    limit = {} if cost is None else {"processor": cost.processor, "max_instructions": cost.max_instructions}
    return {"asked": {"max_error_lsb": request.max_error_lsb, "free": list(request.free), **limit}}


def _shaping(shaping: Shaping) -> dict[str, Any]:
    return {"shaping": {"order": shaping.order, "zero": shaping.zero}} if shaping.order else {}


def _axis(line: LinePlan) -> dict[str, Any]:
    drive, program, output = line.drive, line.program, line.program.output
    return {
        "drive": {
            "v_offset": drive.v_offset,
            "v_scan": drive.v_scan,
            "v_scan_normalised": drive.v_scan_normalised,
            "v_amplitude": drive.v_amplitude,
            "m": drive.m,
            "g": drive.g,
            "size_nm": drive.size_nm,
            "window_nm": drive.window_nm,
            "position_nm": drive.position_nm,
            "forward": {"beta": drive.forward.beta, "u_peak": drive.forward.u_peak},
            "backward": {"beta": drive.backward.beta, "u_peak": drive.backward.u_peak},
            "turn": drive.turn,
            "model": drive.model,
            **({"model_files": dict(drive.model_files)} if drive.model_files else {}),
            **_resonance(line),
        },
        "line": {
            "ticks": program.ticks,
            "hold_ticks": program.hold,
            "rate_hz": float(line.rate),
            "rate_exact": [line.rate.numerator, line.rate.denominator],
            "requested_hz": line.requested_hz,
            "phase_step": program.phase.step,
            "phase_remainder": program.phase.remainder,
        },
        "fourier": {
            "band_limit": line.band_limit.method,
            "window": list(line.band_limit.window),
            "directions": line.band_limit.directions,
            "harmonics": line.series.harmonics,
            "a0": line.series.a0,
            "a": line.series.a.tolist(),
            "b": line.series.b.tolist(),
            "held_harmonics": list(line.held_harmonics),
            "q_format": "Q2.30",
            "a0_word": line.fourier.a0,
            "a_words": line.fourier.a.tolist(),
            "b_words": line.fourier.b.tolist(),
            **({} if line.kept_percent is None else {"max_scaling_error_percent": line.kept_percent}),
            **_followed(line),
            **_layer(line),
            **_place(line),
        },
        "table": {
            "mode": program.mode,
            "bits": program.bits,
            "scale": line.scale,
            "guard_bits": program.guard,
            "words": program.words.tolist(),
            **_asked_table(line),
        },
        "output": output_record(output, line.converter),
    }


def output_record(output: Output, converter: Converter) -> dict[str, Any]:
    """Return an output stage, and the volts of its codes, as JSON-ready data."""
    return {
        "gain_word": output.gain_word,
        "gain_q": output.gain_q,
        "offset_word": output.offset_word,
        "offset_code": output.offset_code,
        "code_min": output.code_min,
        "code_max": output.code_max,
        "max_step": output.max_step,
        "park_code": output.park_code,
        "v_zero": converter.v_zero,
        "v_per_code": converter.v_per_code,
        "dac_bits": output.dac_bits,
        "coding": output.coding,
        "align": output.align,
        "word_bits": output.word_bits,
        **({"channel": output.channel} if output.channel else {}),
        **_shaping(output.shaping),
    }
