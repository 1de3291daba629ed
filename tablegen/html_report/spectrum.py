"""The spectrum of the emitted waveform, with cutoff and resonance; and the rounding error of the codes."""

from itertools import pairwise

import numpy as np

from tablegen.charts.chart import Band, Chart, DrawnCurve, Mark
from tablegen.fixedpoint.program import Program
from tablegen.html_report.blocks import Charts, Paragraph, Section
from tablegen.html_report.number_text import hertz
from tablegen.html_report.subject import Subject, series_of
from tablegen.manifest.fields import ManifestAxis
from tablegen.numerics.arrays import Floats, Ints

_FLOOR_DB = -160.0
_MOST_SPECTRUM_TICKS = 1 << 18  # of a period whose codes are transformed
_MOST_TICKS = 1 << 14  # of a period of which every error is drawn
_BINS = 300  # of the spectrum of the codes, evenly spread over the logarithm


def spectrum(subject: Subject) -> Section:
    """Return the harmonics of the drive, and the noise of the codes beyond them."""
    charts = tuple(_spectrum(axis, entry) for axis, entry in subject.axes)
    return Section(
        "spectrum",
        "Spectrum",
        (Charts(charts),),
        "Power of each harmonic of the emitted waveform, relative to the first. Beyond the cutoff there is the noise "
        "of rounding to codes and tables.",
    )


def _spectrum(axis: str, entry: ManifestAxis) -> Chart:
    series, rate = series_of(entry), entry.line.rate_exact[0] / entry.line.rate_exact[1]
    n = np.arange(1.0, series.harmonics + 1.0)
    power = series.a**2 + series.b**2
    first = float(power[0]) or 1.0
    curves = [DrawnCurve("emitted harmonics", "other", n * rate, _db(power / first), "stems")]
    turn = entry.drive.turn
    triangle = (np.sin(np.pi * n * turn) / (np.pi * n) ** 2 / (turn * (1.0 - turn))) ** 2
    visible = triangle > triangle[0] * 10.0 ** (0.1 * _FLOOR_DB)
    if entry.fourier.place is None:  # beside a sine it says nothing
        curves.append(
            DrawnCurve("plain triangle", "before", n[visible] * rate, _db(triangle[visible] / triangle[0]), "points")
        )
    last = series.harmonics * rate
    ticks = entry.line.ticks
    if ticks <= _MOST_SPECTRUM_TICKS:
        codes = entry.program.played(0, ticks) * entry.output.v_per_code
        code_power = np.abs(np.fft.rfft(codes - np.mean(codes))[1:]) ** 2 / ticks**2 * 4.0 / entry.drive.v_amplitude**2
        noise = np.arange(1, len(code_power) + 1) > series.harmonics
        f, worst = _worst_of_bins(np.arange(1.0, len(code_power) + 1.0)[noise] * rate, code_power[noise] / first)
        curves.append(DrawnCurve("codes beyond the cutoff", "other", f, _db(worst), faint=True))
        last = rate * ticks / 2.0
    marks = [Mark(series.harmonics * rate, f"cutoff {hertz(series.harmonics * rate)}")]
    bands: list[Band] = []
    resonance = entry.drive.resonance
    if resonance is not None:
        marks.append(Mark(resonance.hz, f"resonance {hertz(resonance.hz)}"))
        bands.append(
            Band(max(resonance.hz - resonance.half_width_hz, rate), resonance.hz + resonance.half_width_hz, "")
        )
        last = max(last, 1.5 * resonance.hz)
    return Chart(
        f"spectrum-{axis}",
        f"{axis} spectrum",
        "frequency [Hz]",
        "power [dB of the first harmonic]",
        tuple(curves),
        tuple(bands),
        tuple(marks),
        log_x=True,
        x_range=(0.8 * rate, 1.2 * last),
    )


def _db(power: Floats) -> Floats:
    decibels: Floats = 10.0 * np.log10(np.maximum(power, 10.0 ** (0.1 * _FLOOR_DB)))
    return decibels


def _worst_of_bins(f: Floats, power: Floats) -> tuple[Floats, Floats]:
    """Return the largest power of each bin, with its frequency."""
    if len(f) <= _BINS:
        return f, power
    which = np.searchsorted(np.geomspace(f[0], f[-1], _BINS + 1), f, side="right")
    edges = np.flatnonzero(np.diff(which, prepend=-1))
    at = np.array([first + int(np.argmax(power[first:stop])) for first, stop in pairwise([*edges.tolist(), len(f)])])
    return f[at], power[at]


def quantisation(subject: Subject) -> Section:
    """Return the emitted code less the code of the unrounded waveform."""
    charts = []
    for axis, entry in subject.axes:
        k = _looked_at(entry.program)
        shaped = entry.output.shaping is not None
        error = (entry.program.played(0, len(k)) if shaped else entry.program.codes(k)) - entry.unrounded_codes(k)
        period_s = entry.line.rate_exact[1] / entry.line.rate_exact[0]
        times, unit = (1e3, "ms") if period_s < 1.0 else (1.0, "s")
        charts.append(
            Chart(
                f"quantisation-{axis}",
                f"{axis} error of the codes",
                f"time [{unit}]",
                "error [LSB]",
                (DrawnCurve("emitted less requested", "other", times * period_s * k / entry.line.ticks, error),),
                marks=() if shaped else _certified(entry.certificate.max_error_lsb),
                x_range=(0.0, times * period_s),
            )
        )
        values, edges = np.histogram(error, 41)
        share = 100.0 * values / max(len(error), 1)
        middle = np.repeat(edges, 2)[1:-1]
        charts.append(
            Chart(
                f"histogram-{axis}",
                f"{axis} errors by size",
                "error [LSB]",
                "share of the ticks [%]",
                (DrawnCurve("", "other", middle, np.repeat(share, 2).astype(np.float64), "area"),),
                y_range=(0.0, 1.1 * float(np.max(share))),
            )
        )
    thinned = [(axis, entry) for axis, entry in subject.axes if entry.line.ticks > _MOST_TICKS]
    words = [
        f"Of {axis} only some ticks are drawn; the certificate has all of them."
        if entry.output.shaping is None
        else f"Of {axis} only the first {_MOST_TICKS} ticks are drawn."
        for axis, entry in thinned
    ]
    words += [
        f"The codes of {axis} are shaped: they err by more than rounded ones, where the piezo does not follow."
        for axis, entry in subject.axes
        if entry.output.shaping is not None
    ]
    return Section(
        "quantisation",
        "Quantisation",
        (Charts(tuple(charts)), *(Paragraph(text, "quiet") for text in words)),
        "Rounding alone gives up to 0.5 LSB; the rest comes from the words of the table.",
    )


def _certified(worst: float) -> tuple[Mark, ...]:
    return tuple(Mark(at, f"certified {worst:.3f}" if at > 0 else "", "y") for at in (worst, -worst))


def _looked_at(program: Program) -> Ints:
    """Return all ticks of a period; of a long one as many, evenly spread at odd distances, so that no beat hides.

    Of a long shaped one it returns the first ticks: the code of a shaped tick depends on all before it.
    """
    if program.ticks <= _MOST_TICKS or program.output.shaping.order:
        return np.arange(min(program.ticks, _MOST_TICKS), dtype=np.int64)
    count = 1 << 13
    return (np.arange(count, dtype=np.int64) * program.ticks) // count
