"""Measurements on the emitted integers of one whole period, against the float waveform and through the scanner's model.

The scaling error is the paper's: relative deviation of the local slope from the ideal, in percent, peak to
peak over the imaging window. Of float waveforms the slope is the analytic one; of integers it is a chord of 1/20 of the
line, since the slope between neighbouring codes means nothing.
"""

from dataclasses import dataclass
from math import ceil, floor, log10

import numpy as np

from tablegen.compensation.dynamics import capped_inverse
from tablegen.compensation.line import Sweep
from tablegen.fixedpoint.runs import Runs, runs_of
from tablegen.numerics.arrays import Floats, Ints, merged
from tablegen.planning.line_plan import LinePlan
from tablegen.waveform.sampler import Expansion, Sampler, on_grid
from tablegen.waveform.series import FourierSeries, values

CHORD = 0.05  # share of the line, about one lattice constant of the paper's images
_POINTS_PER_HARMONIC = 16  # points per harmonic over the window, for analytic slopes
_CHUNK_RUNS = 1 << 14  # runs that are worked out together, in the cache
_MAX_SPECTRUM_TICKS = 1 << 22  # longest period whose spectrum is taken


@dataclass(frozen=True)
class ScalingError:
    """Scaling error of one direction in percent: peak to peak over the window, and of the window as a whole.

    ``total`` is of the emitted integers through the scanner's model; ``band_limit``, ``quantisation`` and
    ``model`` are its parts taken alone, the last being what the boost limit leaves of the dynamics. ``size`` is the
    error of the window's extent. ``uncompensated`` is what a triangle of the same amplitude would give.
    """

    total: float
    band_limit: float
    quantisation: float
    model: float
    size: float
    uncompensated: float


@dataclass(frozen=True)
class Refined:
    """What the layer moves in one direction, by the scanner's model, in percent over the window.

    ``position`` is by how much of the line at most, ``scaling`` the scaling error, peak to peak, that it takes away.
    """

    position: float
    scaling: float


class EmittedPeriod:
    """The emitted period beside the float one, at any tick."""

    def __init__(self, line: LinePlan) -> None:
        self._line = line
        self._hold = line.program.hold
        self._expansions: dict[int, tuple[FourierSeries, Expansion]] = {}
        self._reference = Sampler(line.series, line.program.phase.ticks)
        # Between its extremes the float waveform is monotonic, so that errors are largest where runs begin and end.
        self.runs = runs_of(line.program).split_at(self._extremes())
        self._lasts = self.runs.lasts
        self._first = self.runs.codes - self._asked(self.runs.starts)
        self._last = self._first if self.runs.by_tick else self.runs.codes - self._asked(self._lasts)

    def _extremes(self) -> Ints:
        """The ticks before and behind each extreme of the float waveform."""
        points = 64 * self._line.series.harmonics
        w = on_grid(self._line.series, points)
        turning = (w - np.roll(w, 1)) * (np.roll(w, -1) - w) <= 0.0
        t = np.flatnonzero(turning) / points
        for _ in range(3):  # Newton on the slope; where it is flat any tick is as good
            slope, bend = self.expansion(self._line.series).at(t, 1, 2)
            step = slope / np.where(bend == 0.0, np.inf, bend)
            t = t - np.clip(step, -1.0 / points, 1.0 / points)
        ticks = self._line.program.ticks
        before = np.floor(t * ticks).astype(np.int64)
        return merged(before % ticks, (before + 1) % ticks)

    def expansion(self, series: FourierSeries) -> Expansion:
        """A series of the line, to be asked at any times; it is worked out once."""
        if id(series) not in self._expansions:
            self._expansions[id(series)] = series, Expansion(series)  # the series is kept, so that no other has its id
        return self._expansions[id(series)][1]

    def _asked(self, k: Ints) -> Floats:
        codes = np.empty(len(k))
        for at in range(0, len(k), _CHUNK_RUNS):
            chunk = slice(at, at + _CHUNK_RUNS)
            codes[chunk] = self._line.float_codes(self._reference.at(k[chunk] // self._hold))
        return codes

    def errors(self, k: Ints) -> Floats:
        """Emitted code less the code asked for, unrounded, at ticks k."""
        return self._first[k] if self.runs.by_tick else self.runs.at(k) - self._asked(k)

    def largest_error(self) -> float:
        """max |error| over every tick."""
        return max(float(np.max(np.abs(self._first))), float(np.max(np.abs(self._last))))

    def error_moments(self) -> tuple[float, float]:
        """Mean and mean square of the error over every tick; along a run it is the parabola of three of its ticks."""
        sums = np.zeros(2)
        for begin in range(0, len(self._first), _CHUNK_RUNS):
            sums += self._moments(slice(begin, begin + _CHUNK_RUNS))
        mean, square = sums / self.runs.ticks
        return float(mean), float(square)

    def _moments(self, which: slice) -> tuple[float, float]:
        """Sums of the error and of its square over the ticks of some runs."""
        first, last, starts = self._first[which], self._last[which], self.runs.starts[which]
        if self.runs.by_tick:
            return float(np.sum(first)), float(np.sum(first * first))
        n = self.runs.lengths_of(which)
        steps = np.maximum(n - 1, 1)  # the parabola is 4 i (steps - i) / steps^2 at tick i, on a straight line
        halfway = n // 2
        straight = first + (last - first) * (halfway / steps)
        height = np.where(n > 2, 4.0 * halfway * (steps - halfway) / steps**2, 1.0)
        bend = np.where(n > 2, self.runs.codes[which] - self._asked(starts + halfway % n) - straight, 0.0) / height
        arch, arch_square = 2.0 / 3.0 * (1.0 - 1.0 / steps), 8.0 / 15.0 * (1.0 - 1.0 / steps) * (1.0 + 1.0 / steps**2)
        mean = 0.5 * (first + last)
        square = mean * mean + (last - first) ** 2 * (n + 1) / (12.0 * steps)
        square = square + bend * (2.0 * arch * mean + arch_square * bend)
        return float(np.sum(n * (mean + arch * bend))), float(np.sum(n * square))

    def corners(self, first: int, stop: int) -> Ints:
        """Ticks in [first, stop) at which a run begins or ends."""
        if self.runs.by_tick:
            return np.arange(first, stop)
        both = (self.runs.starts, self._lasts)
        return merged(*(ticks[slice(*np.searchsorted(ticks, (first, stop)))] for ticks in both))


def scaling_error(line: LinePlan, played: EmittedPeriod, side: str, branch: Sweep) -> ScalingError:
    low, high = line.band_limit.window
    position = np.linspace(low, high, _POINTS_PER_HARMONIC * line.target.harmonics + 513)
    deviation, speed, wanted_speed = _followed(line, played, side, position)
    sweep = position if side == "forward" else 1.0 - position
    steepness = branch.slope(sweep)
    chords, noise = _chords(line, played, side, position, deviation, steepness)
    # A triangle leaves the piezo at the inverse of the branch, whose slope is 1 / u'.
    triangle = 1.0 / branch.slope(branch.inverse(sweep))
    middle = float(1.0 / branch.slope(branch.inverse(0.5)))
    return ScalingError(
        total=_peak_to_peak(chords),
        band_limit=_peak_to_peak(wanted_speed),
        quantisation=_peak_to_peak(noise),
        model=_peak_to_peak(speed - wanted_speed),
        size=100.0 * float(deviation[-1] - deviation[0]) / (high - low),
        uncompensated=_peak_to_peak(triangle / middle),
    )


def _followed(line: LinePlan, played: EmittedPeriod, side: str, position: Floats) -> tuple[Floats, Floats, Floats]:
    """Where the modelled piezo is, less ``position``; its speed over the line's; and that if the target arrived.

    What the layer moves is no error: it is there for what the model does not know. So all is taken without it.
    """
    shape, reached = line.drive.shape, _reached(line)
    times = shape.times(side, position)

    def at_times(series: FourierSeries) -> list[Floats]:
        if shape.waveform is not None:  # its branches are a series too, and equal ones have to leave nothing
            return list(values(times, (series, 0), (series, 1)))
        return played.expansion(series).at(times, 0, 1)

    def follow(series: FourierSeries) -> tuple[Floats, Floats]:
        value, slope = at_times(series)
        if line.layer is not None:
            layer_value, layer_slope = at_times(line.layer)
            series, value, slope = series.less(line.layer), value - layer_value, slope - layer_slope
        return shape.followed(side, position, series, value, slope)

    wanted = follow(line.target)
    return *(wanted if reached is line.target else follow(reached)), wanted[1]


def refined(line: LinePlan, side: str, branch: Sweep) -> Refined:
    """What the layer does, to first order: it moves the modelled piezo by r / u'."""
    assert line.layer is not None
    low, high = line.band_limit.window
    position = np.linspace(low, high, _POINTS_PER_HARMONIC * line.target.harmonics + 513)
    steepness = branch.slope(position if side == "forward" else 1.0 - position)
    moved = line.layer.value(line.drive.shape.times(side, position)) / steepness
    return Refined(100.0 * float(np.max(np.abs(moved))), _peak_to_peak(np.gradient(moved, position)))


def _peak_to_peak(values: Floats) -> float:
    return 100.0 * float(np.max(values) - np.min(values))


def _reached(line: LinePlan) -> FourierSeries:
    """The drive as the piezo sees it: the target, less what the boost limit held back."""
    if not line.held_harmonics or line.drive.response is None:
        return line.target
    n = np.arange(1.0, line.target.harmonics + 1.0)
    f = n * float(line.rate)
    asked_real, asked_imaginary = line.drive.response.inverse(f)
    given_real, given_imaginary, _ = capped_inverse(line.drive.response, f, line.drive.max_boost_db)
    # The phase is kept, so that the ratio is real.
    ratio = np.hypot(given_real, given_imaginary) / np.hypot(asked_real, asked_imaginary)
    return FourierSeries(line.target.a0, line.target.a * ratio, line.target.b * ratio)


def _chords(
    line: LinePlan, played: EmittedPeriod, side: str, position: Floats, deviation: Floats, steepness: Floats
) -> tuple[Floats, Floats]:
    """Slope errors (1 is 100 %) of the chords inside the window: of the emitted integers, and of quantisation alone.

    Of all chords those count that begin or end where a run does: between those the error of a chord is a straight
    line. ``deviation`` and ``steepness`` of the waveform stand at ``position``. A code stands for the middle of its
    tick.
    """
    ticks, turn = line.program.ticks, line.drive.turn
    share = turn if side == "forward" else 1.0 - turn
    ends = sorted(float(t) * ticks for t in line.drive.shape.times(side, position[[0, -1]]))
    first, stop = ceil(ends[0] - 0.5), floor(ends[1] - 0.5) + 1
    baseline = max(1, min(round(CHORD * share * ticks), stop - first - 1))
    if stop - first < 2:
        return np.zeros(1), np.zeros(1)
    begin = played.corners(first, stop - baseline)
    if not played.runs.by_tick:
        begin = merged(begin, played.corners(first + baseline, stop) - baseline)
    if not len(begin):
        begin = np.array([first])

    def noise_and_total(k: Ints) -> tuple[Floats, Floats, Floats]:
        t = (k + 0.5) / ticks
        where = t / turn if side == "forward" else (1.0 - t) / share
        noise = played.errors(k) / line.codes_per_unit / np.interp(where, position, steepness)
        return where, noise, noise + np.interp(where, position, deviation)

    totals, noises = np.empty(len(begin)), np.empty(len(begin))
    for at in range(0, len(begin), _CHUNK_RUNS):
        chunk = slice(at, at + _CHUNK_RUNS)
        x0, noise0, total0 = noise_and_total(begin[chunk])
        x1, noise1, total1 = noise_and_total(begin[chunk] + baseline)
        totals[chunk], noises[chunk] = (total1 - total0) / (x1 - x0), (noise1 - noise0) / (x1 - x0)
    return totals, noises


def power_at_resonance_db(line: LinePlan, runs: Runs, power: float) -> float | None:
    """Power of the emitted codes inside the resonance, at least its nearest harmonic, relative to the scan's."""
    response, ticks = line.drive.response, line.program.ticks
    if response is None or ticks > _MAX_SPECTRUM_TICKS:
        return None
    rate = float(line.rate)
    last = (ticks - 1) // 2
    centre, half = response.resonance_hz / rate, response.half_width_hz / rate
    if round(centre) > last:
        return None
    first, stop = max(1, round(centre - half)), min(last, round(centre + half)) + 1
    codes = np.repeat(runs.codes, runs.lengths) - float(line.program.output.offset_code)
    spectrum = np.abs(np.fft.rfft(codes)) / ticks
    inside = 2.0 * float(np.sum(spectrum[first:stop] ** 2))
    return 10.0 * log10(max(inside, 1e-30) / power)
