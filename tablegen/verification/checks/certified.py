"""The figures of a certificate, computed again from the words and the float waveform of the manifest alone.

Every code of a period comes from the integer arithmetic, and the waveform from numpy's inverse transform: in none of
the ways in which the build measures itself.
"""

from collections.abc import Mapping
from math import floor, log10, tau

import numpy as np

from tablegen.base.input_errors import shortened
from tablegen.fixedpoint.runs import runs_of
from tablegen.manifest.fields import ManifestAxis, ManifestSeries
from tablegen.numerics.arrays import Floats, Ints, union_sorted
from tablegen.verification.checks.shaped import MOST_TICKS, ShapedPlay, code_excess, step_excess

_MOST_ADVANCES = 1 << 22  # advances of the longest period that is checked advance by advance
_SLOPE_POINTS = 32  # per period of the highest harmonic
_GRID = 1 << 21  # points of a longer period, with cubics between them; errors below 1e-3 LSB
_LEAST_POWER = 1e-30
_SIX_DIGITS, _LONG_PERIOD = 1.1e-5, 1e-3  # relative: what six digits round away, also upwards


def on_grid(series: ManifestSeries, count: int, derivative: int = 0) -> Floats:
    """Return w, or its derivative with respect to t in periods, at k / count for k in [0, count).

    Returns
    -------
    Floats
        Shape (count,).
    """
    n = np.arange(1, len(series.a) + 1)
    factor = (tau * n) ** derivative
    a, b = np.array(series.a), np.array(series.b)
    for _ in range(derivative):
        a, b = b, -a
    spectrum = np.zeros(count, dtype=np.complex128)
    spectrum[0] = series.a0 if derivative == 0 else 0.0
    np.add.at(spectrum, n % count, 0.5 * factor * (a - 1j * b))
    np.add.at(spectrum, -n % count, 0.5 * factor * (a + 1j * b))
    values: Floats = np.fft.ifft(spectrum).real * count
    return values


def at(series: ManifestSeries, t: Floats, derivative: int = 0) -> Floats:
    """Evaluate the series, or a derivative, term by term.

    Parameters
    ----------
    t
        Times in periods, any shape.

    Returns
    -------
    Values of the shape of ``t``, in the series' unit (per period for each derivative).
    """
    total = np.full(t.shape, series.a0 if derivative == 0 else 0.0)
    for n, (a, b) in enumerate(zip(series.a, series.b, strict=True), start=1):
        for _ in range(derivative):
            a, b = b, -a
        angle = tau * ((n * t) % 1.0)
        total += (tau * n) ** derivative * (a * np.cos(angle) + b * np.sin(angle))
    return total


def played_series(axis: ManifestAxis) -> ManifestSeries:
    """Return the series of the played waveform w."""
    return ManifestSeries(axis.fourier.a, axis.fourier.b, axis.fourier.a0)


class PlayedPeriod:
    """The codes of a period, and their distance from the waveform, at ticks."""

    def __init__(self, axis: ManifestAxis) -> None:
        self.axis, self.program = axis, axis.program.rounded
        self.runs = runs_of(self.program)
        self.is_whole = self.program.phase.ticks <= _MOST_ADVANCES
        points = self.program.phase.ticks if self.is_whole else _GRID
        drive, output, w = axis.drive, axis.output, on_grid(played_series(axis), points)
        self._intended = (drive.v_offset + drive.v_amplitude * (w - 0.5) - output.v_zero) / output.v_per_code
        self._slope = np.zeros(0) if self.is_whole else on_grid(played_series(axis), points, 1)

    def shaped_by(self, update_rate_hz: float) -> ShapedPlay | None:
        """Return what a shaped axis plays; None of any other axis."""
        if self.axis.output.shaping is None:
            return None
        ticks = np.arange(min(self.program.ticks, MOST_TICKS), dtype=np.int64)
        codes = self.runs.at(ticks) - self.errors(ticks)
        return ShapedPlay(self.axis, codes, update_rate_hz)

    @property
    def codes_per_unit(self) -> float:
        """The distance in codes of w = 1 from w = 0."""
        return self.axis.drive.v_amplitude / self.axis.output.v_per_code

    @property
    def edges(self) -> Ints:
        """The ticks at which a run of one code begins or ends.

        Returns
        -------
        Ints
            Ticks, ascending, shape (n,).
        """
        return union_sorted(self.runs.starts, self.runs.lasts)

    def errors(self, k: Ints) -> Floats:
        """Return the code less the unrounded code of the waveform.

        Parameters
        ----------
        k
            Ticks of any period, shape (n,).

        Returns
        -------
        Floats
            LSB of the converter, shape (n,).
        """
        advance = k % self.program.ticks // self.program.hold
        intended = self._intended[advance] if self.is_whole else self._between(advance)
        errors: Floats = self.runs.at(k % self.program.ticks) - intended
        return errors

    def _between(self, advance: Ints) -> Floats:
        """Interpolate the waveform between points of the grid, by values and slopes."""
        at, rest = np.divmod(advance * _GRID, self.program.phase.ticks)
        f, after = rest / self.program.phase.ticks, (at + 1) % _GRID
        y0, y1 = self._intended[at], self._intended[after]
        s0, s1 = (self.codes_per_unit / _GRID * self._slope[i] for i in (at, after))
        intended: Floats = y0 + f * (s0 + f * (3.0 * (y1 - y0) - 2.0 * s0 - s1 + f * (2.0 * (y0 - y1) + s0 + s1)))
        return intended

    def error_moments(self) -> tuple[float, float, float]:
        """Return the largest magnitude, the mean and the mean square of the error over every tick, in LSB."""
        if self.is_whole:
            error = self.errors(np.arange(self.program.phase.ticks, dtype=np.int64) * self.program.hold)
            return float(np.max(np.abs(error))), float(np.mean(error)), float(np.mean(error * error))
        runs = self.runs.split_at(self._extremes())
        first, last, n = self.errors(runs.starts), self.errors(runs.lasts), runs.lengths
        middle, slope = 0.5 * (first + last), last - first
        square = middle * middle + slope**2 * (n + 1) / (12.0 * np.maximum(n - 1, 1))
        largest = max(float(np.max(np.abs(first))), float(np.max(np.abs(last))))
        ticks = runs.ticks
        return largest, float(np.sum(n * middle)) / ticks, float(np.sum(n * square)) / ticks

    def _extremes(self) -> Ints:
        """Return the ticks on either side of every extreme of the waveform."""
        slope, after = self._slope, np.roll(self._slope, -1)
        near = np.flatnonzero(slope * after <= 0.0)
        inside = slope[near] / np.where(slope[near] == after[near], 1.0, slope[near] - after[near])
        before = np.floor((near + inside) / _GRID * self.program.ticks).astype(np.int64)
        return np.unique(np.concatenate([before, before + 1]) % self.program.ticks)

    def figures(self, rate_hz: float, shaped: ShapedPlay | None = None) -> dict[str, float | int | None]:
        """Return all figures but those of the scaling error; without those of a position that cannot be known."""
        axis, runs, output = self.axis, self.runs, self.axis.output
        codes, share = runs.codes, runs.lengths / runs.ticks
        largest, mean, square = self.error_moments()
        centred = codes - float(np.sum(share * (codes - codes[0]))) - float(codes[0])
        power = max(float(np.sum(share * centred**2)), _LEAST_POWER)
        points = _SLOPE_POINTS * axis.fourier.harmonics
        slope = float(np.max(np.abs(on_grid(played_series(axis), points, 1))))
        beyond = floor(code_excess(axis) + 0.5) if shaped is not None else 0
        low = max(int(codes.min()) - beyond, output.code_min)
        high = min(int(codes.max()) + beyond, output.code_max)
        noise = square - mean * mean if shaped is None else float(np.var(shaped.code_errors))
        values: dict[str, float | int | None] = {
            "ticks": runs.ticks,
            "max_error_lsb": largest,
            "rms_error_lsb": float(np.sqrt(square)),
            "lowest_code": low,
            "highest_code": high,
            "headroom_low": low - output.code_min,
            "headroom_high": output.code_max - high,
            "largest_step": int(np.max(np.abs(codes - np.roll(codes, 1)))) + step_excess(axis),
            "max_step": output.max_step,
            "peak_slew_v_per_s": axis.drive.v_amplitude * slope * rate_hz,
            "beyond_cutoff_db": self._beyond_cutoff(noise, power),
            "at_resonance_db": self._at_resonance(rate_hz, power, shaped),
        }
        if shaped is not None:
            errors = shaped.position_errors
            del values["max_error_lsb"], values["rms_error_lsb"]
            if errors is not None:
                values |= {"max_error_lsb": float(np.max(np.abs(errors)))}
                values |= {"rms_error_lsb": float(np.sqrt(np.mean(errors * errors)))}
        return values

    def largest_code_error(self) -> float:
        """Return the bound of the distance of a code from the waveform, in LSB, shaped or not."""
        shaped = 0.0 if self.axis.output.shaping is None else 0.5 + code_excess(self.axis)
        return self.error_moments()[0] + shaped

    def _beyond_cutoff(self, square: float, power: float) -> float | None:
        return None if self.axis.resting else 10.0 * log10(max(square, _LEAST_POWER) / power)

    def _at_resonance(self, rate_hz: float, power: float, shaped: ShapedPlay | None) -> float | None:
        resonance, ticks = self.axis.drive.resonance, self.program.ticks
        if resonance is None or ticks > _MOST_ADVANCES:
            return None
        codes = np.repeat(self.runs.codes, self.runs.lengths)
        if shaped is not None and shaped.is_whole:
            codes = shaped.codes
            rate_hz, ticks = rate_hz * ticks / len(codes), len(codes)
        last = (ticks - 1) // 2
        centre, half = resonance.hz / rate_hz, resonance.half_width_hz / rate_hz
        if round(centre) > last:
            return None
        n = slice(max(1, round(centre - half)), min(last, round(centre + half)) + 1)
        inside = 2.0 * float(np.sum(np.abs(np.fft.rfft(codes - float(self.runs.codes[0]))[n] / ticks) ** 2))
        return 10.0 * log10(max(inside, _LEAST_POWER) / power)


def agree(stated: float | int | None, figure: float | int | None, exact: bool, tiny: float) -> bool:
    """Return True if a figure of six digits equals the computed one; ``tiny`` is a negligible difference."""
    if stated is None or figure is None:
        return stated is None and figure is None
    if isinstance(figure, int):
        return stated == figure
    return abs(stated - figure) <= (_SIX_DIGITS if exact else _LONG_PERIOD) * abs(figure) + tiny


def different_figures(
    stated: Mapping[str, float | int | None], figures: Mapping[str, float | int | None], exact: bool, prefix: str = ""
) -> list[str]:
    """List the figures that a certificate states otherwise, or not at all."""
    wrong = []
    for name, value in figures.items():
        tiny = 1e-3 if name.endswith("_db") else 1e-9
        if not agree(stated.get(name), value, exact, tiny):
            right = "none" if value is None else f"{value:.6g}" if isinstance(value, float) else str(value)
            wrong.append(f"certificate.{prefix}{name} is {shortened(str(stated.get(name)))}, the words make it {right}")
    return wrong
