"""The numbers of a manifest that follow from others of it, derived again."""

from fractions import Fraction
from math import ceil, floor, isclose

import numpy as np

from tablegen.fixedpoint.interpolation import guard_bits
from tablegen.fixedpoint.output import UNIT_GAIN_BITS
from tablegen.fixedpoint.program import sample_gain
from tablegen.fixedpoint.rounding import round_number
from tablegen.fixedpoint.spline_words import spline_factors
from tablegen.fixedpoint.synthesis import FourierWords, encode, synthesize
from tablegen.manifest.fields import Manifest, ManifestAxis
from tablegen.manifest.format import CONVERTER_KEYS
from tablegen.manifest.read import StoredBuild
from tablegen.verification.checks.pixels import wrong_edges

_RELATIVE = 1e-9  # relative error of floats after JSON and a few operations
_WINDOW_TICKS = 2  # ticks by which a window may be off the requested place


def wrong_derived(stored: StoredBuild) -> tuple[int, list[str]]:
    """Return how many numbers follow from others, and those that do not."""
    manifest = stored.manifest
    checks = _sequence(manifest)
    for name, axis in stored.axes:
        checks += [(f"axes.{name}.{key}", right, why) for key, right, why in _axis(manifest, name, axis)]
    x, y = manifest.axes.x, manifest.axes.y
    ranges = [axis.drive.v_scan / axis.drive.v_scan_normalised for axis in (x, y)]
    requested = y.line.requested_hz
    right = x.line.requested_hz / manifest.sequence.frame_lines
    checks += [
        ("axes.y.drive.v_scan_normalised", _close(*ranges), f"of {ranges[1]:g} V, of x it is of {ranges[0]:g} V"),
        ("axes.y.line.requested_hz", _close(requested, right), f"{requested}, that of x makes it {right}"),
    ]
    checks += _hardware(x, y)
    return len(checks), [f"{key} is {why}" for key, right, why in checks if not right]


Results = list[tuple[str, bool, str]]


def _hardware(x: ManifestAxis, y: ManifestAxis) -> Results:
    """Compare converter and amplifier of y with those of x, unless the manifest states that they differ."""
    pairs = [(key, getattr(y.output, key), getattr(x.output, key)) for key in CONVERTER_KEYS]
    if y.output.own_hardware:
        differs = any(mine != other for _, mine, other in pairs)
        results: Results = [("axes.y.output.own_hardware", differs, "stated, and nothing of it differs from that of x")]
    else:
        results = [(f"axes.y.output.{key}", mine == other, f"{mine}, of x it is {other}") for key, mine, other in pairs]
    return [*results, ("axes.x.output.own_hardware", not x.output.own_hardware, "stated, and only y can")]


def _sequence(manifest: Manifest) -> Results:
    """Compare turns and windows with the turn of each axis and its imaging window."""
    sequence, x, y = manifest.sequence, manifest.axes.x, manifest.axes.y
    results: Results = []
    ticks, lines = sequence.line_ticks, sequence.frame_lines
    for key, axis, period in (("turn_tick", x, ticks), ("turn_line", y, lines)):
        stated, right = getattr(sequence, key), ceil(_exact(axis.drive.turn) * period)
        results.append((f"sequence.{key}", stated == right, f"{stated}, the turn makes it {right}"))
    for key, axis, period, slack in (
        ("forward_ticks", x, ticks, _WINDOW_TICKS),
        ("backward_ticks", x, ticks, _WINDOW_TICKS),
        ("up_lines", y, lines, 1),
        ("down_lines", y, lines, 1),
    ):
        stated = getattr(sequence, key)
        if key.endswith("ticks") and sequence.pixel_table is not None:
            continue
        begin, end = _requested_window(axis, backward=key in ("backward_ticks", "down_lines"))
        if begin == end:
            results.append((f"sequence.{key}", stated[1] == 0, f"{stated}, nothing of it is imaged"))
            continue
        first, stop = floor(begin * period), ceil(end * period)
        right = abs(stated[0] - first) <= slack and abs(stated[0] + stated[1] - stop) <= slack
        results.append(
            (f"sequence.{key}", right, f"{list(stated)}, the imaging window is near {[first, stop - first]}")
        )
        if key.endswith("ticks"):
            enough = stated[1] >= sequence.pixels
            results.append(("sequence.pixels", enough, f"{sequence.pixels}, more than the ticks of a window"))
    if sequence.pixel_table is not None:
        fault = wrong_edges(sequence, x)
        results.append(("sequence.pixel_table", fault is None, fault or ""))
    return results


def _requested_window(axis: ManifestAxis, backward: bool) -> tuple[Fraction, Fraction]:
    """Return the window in which a direction images, in periods; empty where it does not."""
    turn, (low, high) = _exact(axis.drive.turn), (_exact(edge) for edge in axis.fourier.window)
    if not backward:
        return turn * low, turn * high
    if axis.fourier.directions == "forward":
        return Fraction(0), Fraction(0)
    return turn + (1 - turn) * (1 - high), turn + (1 - turn) * (1 - low)


def _exact(value: float) -> Fraction:
    return Fraction(repr(value))


def _axis(manifest: Manifest, name: str, axis: ManifestAxis) -> Results:
    drive, line, fourier, table, output = axis.drive, axis.line, axis.fourier, axis.table, axis.output
    low, high = fourier.window if fourier.imaged is None else fourier.imaged
    rate = Fraction(*manifest.sequence.update_rate_hz) / line.ticks
    amplitude = 0.5 * drive.v_amplitude / output.v_per_code
    unit = sample_gain(table.mode) * abs(amplitude) * 2.0 ** (UNIT_GAIN_BITS + 1 - output.dac_bits)
    offset = round_number((drive.v_offset - output.v_zero) / output.v_per_code * float(1 << output.gain_q))
    middle = axis.program.output.offset_code
    words = _fourier_words(axis)
    rendered = words is not None and np.array_equal(
        synthesize(words, len(table.words), table.bits), np.array(table.words, dtype=np.int64)
    )
    results: Results = [
        ("line.rate_exact", Fraction(*line.rate_exact) == rate, f"{list(line.rate_exact)}, the ticks make it {rate}"),
        ("line.rate_hz", line.rate_hz == float(rate), f"{line.rate_hz}, the ticks make it {float(rate)}"),
        ("drive.v_amplitude", _close(drive.v_amplitude, drive.m * drive.g * drive.v_scan), "not m g v_scan"),
        ("drive.window_nm", _close(drive.window_nm, drive.size_nm * (high - low)), "not size_nm times the window"),
        ("fourier.window", 0.0 <= low < high <= 1.0, f"{[low, high]}"),
        ("table.scale", _close(table.scale * unit, abs(output.gain_word)), "not what gain_word makes of the amplitude"),
        ("output.gain_word", output.gain_word * amplitude > 0.0, f"{output.gain_word}, of the wrong sign"),
        ("output.offset_word", output.offset_word == offset, f"{output.offset_word}, v_offset makes it {offset}"),
        ("output.offset_code", output.offset_code == middle, f"{output.offset_code}, the word makes it {middle}"),
        ("output.word_bits", output.dac_bits <= output.word_bits <= 32, f"{output.word_bits}"),
        ("fourier.words", words is not None and _same_words(axis, words), "not (2 w - 1) / scale of its coefficients"),
        ("table.words", rendered, "not what the Fourier words make"),
        ("table.guard_bits", table.guard_bits == guard_bits(table.bits), f"{table.guard_bits}"),
    ]
    shares = len(fourier.held_factors) == len(fourier.held_harmonics) and all(
        0.0 < share < 1.0 + _RELATIVE for share in fourier.held_factors
    )
    results.append(("fourier.held_factors", shares, "not a share for each of the held harmonics"))
    if axis.resting:
        flat = fourier.a0 == 0.5 and not any(fourier.a) and not any(fourier.b)
        results.append(("drive.size_nm", flat, "0, and the waveform moves"))
    if fourier.target is not None:
        target = len(fourier.target.a) == len(fourier.target.b) == fourier.harmonics
        results.append(("fourier.target", target, f"not of {fourier.harmonics} harmonics"))
    return results


def _close(a: float, b: float) -> bool:
    return isclose(a, b, rel_tol=_RELATIVE, abs_tol=_RELATIVE)


def _fourier_words(axis: ManifestAxis) -> FourierWords | None:
    fourier = axis.fourier
    try:
        a, b = np.array(fourier.a), np.array(fourier.b)
        if axis.table.mode == "cubic":
            real, imaginary = spline_factors(len(a), len(axis.table.words))
            a, b = a * real + b * imaginary, b * real - a * imaginary
        return encode(fourier.a0, a, b, axis.table.scale)
    except OverflowError:
        return None


def _same_words(axis: ManifestAxis, words: FourierWords) -> bool:
    return np.array_equal(words.in_order, axis.fourier_words)
