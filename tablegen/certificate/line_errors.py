"""Measurements on the emitted integers of one whole period, against the float waveform and through the scanner's model.

The scaling error is the paper's: relative deviation of the local slope from the ideal, in percent, peak to
peak over the imaging window. Of float waveforms the slope is the analytic one; of integers it is a chord of 1/20 of the
line, since the slope between neighbouring codes means nothing.
"""

from collections.abc import Iterator
from functools import cached_property
from itertools import pairwise
from math import ceil, floor, log10

import numpy as np
from msgspec import Struct

from tablegen.certificate.shaped_periods import ShapedPeriods
from tablegen.compensation.dynamics import capped_inverse
from tablegen.compensation.line import Sweep
from tablegen.fixedpoint.runs import runs_of
from tablegen.numerics.arrays import Floats, Ints
from tablegen.planning.line_plan import LinePlan
from tablegen.waveform.extremes import extreme_points, extreme_ticks
from tablegen.waveform.sampler import Expansion, Sampler, on_grid
from tablegen.waveform.series import FourierSeries, values

CHORD = 0.05  # share of the line, about one lattice constant of the paper's images
_POINTS_PER_HARMONIC = 16  # points per harmonic over the window, for analytic slopes
_CHUNK_RUNS = 1 << 14  # runs whose figures are summed together
# Numbers that are computed at a time: so few that the memory of one part serves the next. Larger arrays go back to
# the system, and each page of the next ones is fetched anew, which takes longer than the arithmetic.
_CHUNK = 1 << 12
_MOST_KEPT_RUNS = 1 << 18  # runs whose errors are kept; of more they are computed again where they are needed
_PLACES = 1025  # at which a line is asked whether it rises
_MAX_SPECTRUM_TICKS = 1 << 22  # longest period whose spectrum is taken


class ScalingError(Struct, frozen=True):
    """The scaling error of one direction in percent, peak to peak over the window, and the size error of the window.

    ``total`` is of the emitted integers through the scanner's model; ``band_limit``, ``quantisation`` and
    ``model`` are its parts taken alone, the last being what the boost limit leaves of the dynamics. ``size`` is the
    error of the window's extent. ``uncompensated`` is what a triangle of the same amplitude would give; None where
    the compensated line does not rise over so much of the drive, so that no place follows from it.
    """

    total: float
    band_limit: float
    quantisation: float
    model: float
    size: float
    uncompensated: float | None


class LayerEffect(Struct, frozen=True):
    """The effect of the layer in one direction, by the scanner's model, in percent over the window.

    ``position`` is by how much of the line at most, ``scaling`` the scaling error, peak to peak, that it takes away.
    """

    position: float
    scaling: float


class FollowedSweep(Struct, frozen=True, eq=False):
    """The modelled piezo on one direction of a line, without rounding; arrays have the shape (n,).

    ``deviation`` is where it is less ``position``, in shares of the line; ``speed`` is its speed over the line's, and
    ``target_speed`` that of the target. ``steepness`` is the slope of the branch.
    """

    position: Floats
    deviation: Floats
    speed: Floats
    target_speed: Floats
    steepness: Floats


class TickErrors:
    """The errors of every tick of a period."""

    by_tick = True

    def __init__(self, errors: Floats) -> None:
        self._errors = errors

    def errors(self, k: Ints) -> Floats:
        """Return the errors at ticks.

        Parameters
        ----------
        k
            Ticks of the period, any shape.

        Returns
        -------
        Floats
            LSB of the converter, shape of ``k``.
        """
        return self._errors[k]

    def corners(self, first: int, stop: int) -> tuple[Ints, Floats]:
        """Return all ticks in [first, stop), and their errors.

        Returns
        -------
        ticks, errors
            Each of shape (stop - first,).
        """
        return np.arange(first, stop), self._errors[first:stop]

    def stretches(self, first: int, stop: int) -> Iterator[tuple[int, int]]:
        """Yield the ticks [first, stop) in parts that are computed together."""
        return pairwise([first, *range(first + _CHUNK, stop, _CHUNK), stop])


class EmittedPeriod:
    """The emitted period beside the float one, at any tick.

    Of a shaped axis this is the period without shaping; ``shaped`` has what is emitted.
    """

    def __init__(self, line: LinePlan) -> None:
        self._line = line
        self._hold = line.program.hold
        self._expansions: dict[int, tuple[FourierSeries, Expansion]] = {}
        self._followed: dict[str, FollowedSweep] = {}
        self._scaling: dict[str, ScalingError] = {}
        self._reference = Sampler(line.series, line.program.phase.ticks)
        # Between its extremes the float waveform is monotonic, so that errors are largest where runs begin and end.
        self.runs = runs_of(line.program.rounded).split_at(self._extremes())
        self._by_tick = np.zeros(0)  # errors, where every run is a single tick
        if self.runs.by_tick:
            self._by_tick = np.empty(self.runs.ticks)
            for which in self._chunks():
                self._by_tick[which] = self.runs.codes[which] - self._target_codes(self.runs.starts[which])
        self.shaped: ShapedPeriods | None = None
        if line.program.output.shaping.order:
            ticks = np.arange(ShapedPeriods.target_ticks(line.program), dtype=np.int64)
            self.shaped = ShapedPeriods(line, self._target_codes(ticks))

    def _extremes(self) -> Ints:
        """Return the ticks before and behind each extreme of the float waveform."""
        series, slopes = self._line.series, self.expansion(self._line.series)
        grid = on_grid(series, extreme_points(series))
        return extreme_ticks(grid, lambda t: slopes.at(t, 1, 2), self._line.program.ticks)

    def expansion(self, series: FourierSeries) -> Expansion:
        """Expand a series of the line once, for values at any times."""
        if id(series) not in self._expansions:
            self._expansions[id(series)] = series, Expansion(series)  # the series is kept, so that no other has its id
        return self._expansions[id(series)][1]

    def followed(self, side: str, branch: Sweep) -> FollowedSweep:
        """Follow one direction, "forward" or "backward", once; ``branch`` is the branch u(x) of this direction."""
        if side not in self._followed:
            self._followed[side] = _followed(self._line, self, side, branch)
        return self._followed[side]

    def scaling_error(self, side: str, branch: Sweep) -> ScalingError:
        """Compute the scaling error of one direction once; parameters as of ``followed``."""
        if side not in self._scaling:
            self._scaling[side] = _scaling_error(self._line, self, side, branch)
        return self._scaling[side]

    def _target_codes(self, k: Ints) -> Floats:
        codes = np.empty(len(k))
        for at in range(0, len(k), _CHUNK):
            chunk = slice(at, at + _CHUNK)
            advances = k[chunk] if self._hold == 1 else k[chunk] // self._hold
            codes[chunk] = self._line.float_codes(self._reference.at(advances))
        return codes

    def errors(self, k: Ints) -> Floats:
        """Return the emitted code less the unrounded target code.

        Parameters
        ----------
        k
            Ticks in [0, ticks), shape (n,).

        Returns
        -------
        Floats
            LSB of the converter, shape (n,).
        """
        return self._by_tick[k] if self.runs.by_tick else self.runs.at(k) - self._target_codes(k)

    @property
    def by_tick(self) -> bool:
        """True if every run is a single tick."""
        return self.runs.by_tick

    def arriving(self) -> "list[EmittedPeriod | TickErrors]":
        """List the errors that are judged: those of the codes, or of shaped codes those of the position, a period each.

        Of a shaped period that is too long for that, it is what rounding alone would leave.
        """
        if self.shaped is None or not self.shaped.is_whole:
            return [self]
        return [TickErrors(errors) for errors in self.shaped.position_errors]

    def largest_error(self) -> float:
        """Return max |error| over every tick; of shaped codes, that of the position."""
        if self.shaped is not None:
            return float(np.max(np.abs(self.shaped.position_errors)))
        parts = (errors(which) for which in self._chunks() for errors in (self._errors_at_begin, self._errors_at_end))
        return max(float(np.max(np.abs(errors))) for errors in parts)

    def error_moments(self) -> tuple[float, float]:
        """Return mean and mean square of the error over every tick, along a run by a parabola of three of its ticks."""
        return self._moments_of_error

    def power(self) -> float:
        """Return the mean square of the codes about their mean."""
        ticks, offset = self.runs.ticks, float(self._line.program.output.offset_code)
        sums = np.zeros(2)
        for power in (1, 2):
            for which in self._chunks():
                levels = self.runs.codes[which] - offset - sums[0] / ticks * (power - 1)
                sums[power - 1] += np.sum(self.runs.lengths_of(which) * levels**power)
        return float(sums[1]) / ticks

    def largest_step(self) -> int:
        """Return the largest step between consecutive codes, the last and the first too."""
        codes = self.runs.codes
        inside = (int(np.max(np.abs(np.diff(codes[at.start : at.stop + 1])), initial=0)) for at in self._chunks())
        return max(abs(int(codes[0] - codes[-1])), *inside)

    def stretches(self, first: int, stop: int) -> Iterator[tuple[int, int]]:
        """Yield the ticks [first, stop) in parts whose runs are computed together."""
        edges = self.runs.starts[slice(*np.searchsorted(self.runs.starts, (first + 1, stop)))][_CHUNK::_CHUNK]
        return pairwise([first, *edges.tolist(), stop])

    def _chunks(self) -> Iterator[slice]:
        """Yield parts of the runs that fit into the cache together."""
        return (slice(at, at + _CHUNK_RUNS) for at in range(0, len(self.runs.starts), _CHUNK_RUNS))

    def _errors_at_begin(self, which: slice) -> Floats:
        """Return the errors at the first tick of some runs, shape (n,)."""
        if self.runs.by_tick:
            return self._by_tick[which]
        if len(self.runs.starts) > _MOST_KEPT_RUNS:
            return self.runs.codes[which] - self._target_codes(self.runs.starts[which])
        return self._end_errors[0][which]

    def _errors_at_end(self, which: slice) -> Floats:
        """Return the errors at the last tick of some runs, shape (n,)."""
        if self.runs.by_tick:
            return self._by_tick[which]
        if len(self.runs.starts) > _MOST_KEPT_RUNS:
            ends = self.runs.starts[which] + self.runs.lengths_of(which) - 1
            return self.runs.codes[which] - self._target_codes(ends)
        return self._end_errors[1][which]

    @cached_property
    def _end_errors(self) -> tuple[Floats, Floats]:
        """The errors at the first and at the last tick of each run, each of shape (runs,)."""
        codes, starts = self.runs.codes, self.runs.starts
        return codes - self._target_codes(starts), codes - self._target_codes(self.runs.lasts)

    @cached_property
    def _moments_of_error(self) -> tuple[float, float]:
        """The mean of the error, and the mean square."""
        sums = np.zeros(2)
        for which in self._chunks():
            n, first, last = self.runs.lengths_of(which), self._errors_at_begin(which), self._errors_at_end(which)
            sums += self._moments(which, n, first, last)
        mean, square = sums / self.runs.ticks
        return float(mean), float(square)

    def _moments(self, which: slice, n: Ints, first: Floats, last: Floats) -> tuple[float, float]:
        """Sum the error and its square over the ticks of some runs, with the errors of their ends."""
        starts = self.runs.starts[which]
        if self.runs.by_tick:
            return float(np.sum(first)), float(np.sum(first * first))
        steps = np.maximum(n - 1, 1)  # the parabola is 4 i (steps - i) / steps^2 at tick i, on a straight line
        halfway = n // 2
        straight = first + (last - first) * (halfway / steps)
        height = np.where(n > 2, 4.0 * halfway * (steps - halfway) / steps**2, 1.0)
        bend = (
            np.where(n > 2, self.runs.codes[which] - self._target_codes(starts + halfway % n) - straight, 0.0) / height
        )
        arch, arch_square = 2.0 / 3.0 * (1.0 - 1.0 / steps), 8.0 / 15.0 * (1.0 - 1.0 / steps) * (1.0 + 1.0 / steps**2)
        mean = 0.5 * (first + last)
        square = mean * mean + (last - first) ** 2 * (n + 1) / (12.0 * steps)
        square = square + bend * (2.0 * arch * mean + arch_square * bend)
        return float(np.sum(n * (mean + arch * bend))), float(np.sum(n * square))

    def corners(self, first: int, stop: int) -> tuple[Ints, Floats]:
        """Return the ticks in [first, stop) at which a run begins, those at which one ends, and their errors.

        Returns
        -------
        ticks, errors
            Each of shape (n,); the tick of a run of one is there twice.
        """
        if self.runs.by_tick:
            return np.arange(first, stop), self._by_tick[first:stop]
        starts = self.runs.starts
        begins = slice(*np.searchsorted(starts, (first, stop)).tolist())
        first_end, behind = np.searchsorted(starts[1:], (first + 1, stop + 1)).tolist()
        ends = slice(first_end, behind if stop < self.runs.ticks else len(starts))
        return (
            np.concatenate([starts[begins], starts[ends] + self.runs.lengths_of(ends) - 1]),
            np.concatenate([self._errors_at_begin(begins), self._errors_at_end(ends)]),
        )


def scaling_error(line: LinePlan, played: EmittedPeriod, side: str, branch: Sweep) -> ScalingError:
    """Compute the scaling error of one direction and its parts, in percent, peak to peak over the window.

    Parameters
    ----------
    line
        The planned axis.
    played
        Its emitted period.
    side
        "forward" or "backward".
    branch
        The branch u(x) of this direction.

    Returns
    -------
    ScalingError
        The total and its parts: band limit, quantisation, model; the size error with its sign.
    """
    return played.scaling_error(side, branch)


def _scaling_error(line: LinePlan, played: EmittedPeriod, side: str, branch: Sweep) -> ScalingError:
    low, high = line.band_limit.window
    followed = played.followed(side, branch)
    deviation, speed, target_speed = followed.deviation, followed.speed, followed.target_speed
    sweep = followed.position if side == "forward" else 1.0 - followed.position
    chords = [_chords(line, one, side, followed) for one in played.arriving()]
    return ScalingError(
        total=max(_peak_to_peak(total) for total, _ in chords),
        band_limit=_peak_to_peak(target_speed),
        quantisation=max(_peak_to_peak(noise) for _, noise in chords),
        model=_peak_to_peak(speed - target_speed),
        size=100.0 * float(deviation[-1] - deviation[0]) / (high - low),
        uncompensated=_uncompensated(branch, sweep),
    )


def _uncompensated(branch: Sweep, sweep: Floats) -> float | None:
    """Return what a triangle would give, which leaves the piezo at the inverse of the branch, whose slope is 1 / u'."""
    values = branch.value(np.linspace(0.0, 1.0, _PLACES))
    falls = np.flatnonzero(np.diff(values) <= 0.0)  # at the turns, where a band limit rounds them
    low = max((int(k) + 1 for k in falls if k < _PLACES // 2), default=0)
    high = min((int(k) for k in falls if k >= _PLACES // 2), default=_PLACES - 1)
    if np.min(sweep) < values[low] or np.max(sweep) > values[high]:
        return None
    triangle = 1.0 / branch.slope(branch.inverse(np.append(sweep, 0.5)))  # the last one is of its middle
    return _peak_to_peak(triangle[:-1] / triangle[-1])


def _followed(line: LinePlan, played: EmittedPeriod, side: str, branch: Sweep) -> FollowedSweep:
    """Follow the modelled piezo over the window.

    What the layer moves is no error: it is there for what the model does not know. So all is taken without it.
    """
    shape, reached = line.drive.shape, _reached(line)
    position = np.linspace(*line.band_limit.window, _POINTS_PER_HARMONIC * line.target.harmonics + 513)
    times = shape.times(side, position)

    def at_times(series: FourierSeries) -> list[Floats]:
        if shape.whole is not None:  # its branches are a series too, and equal ones have to leave nothing
            return list(values(times, (series, 0), (series, 1)))
        return played.expansion(series).at(times, 0, 1)

    def follow(series: FourierSeries) -> tuple[Floats, Floats]:
        """Return what the piezo makes of a drive, without the layer.

        Returns
        -------
        place, slope
            Each of the shape of ``times``.
        """
        value, slope = at_times(series)
        if line.layer is not None:
            layer_value, layer_slope = at_times(line.layer)
            series, value, slope = series.less(line.layer), value - layer_value, slope - layer_slope
        return shape.followed(side, position, series, value, slope)

    ideal = follow(line.target)
    deviation, speed = ideal if reached is line.target else follow(reached)
    steepness = branch.slope(position if side == "forward" else 1.0 - position)
    return FollowedSweep(position, deviation, speed, ideal[1], steepness)


def refined(line: LinePlan, side: str, branch: Sweep) -> LayerEffect:
    """Compute the effect of the layer to first order: it shifts the modelled piezo by r / u'."""
    assert line.layer is not None
    low, high = line.band_limit.window
    position = np.linspace(low, high, _POINTS_PER_HARMONIC * line.target.harmonics + 513)
    steepness = branch.slope(position if side == "forward" else 1.0 - position)
    shift = line.layer.value(line.drive.shape.times(side, position)) / steepness
    return LayerEffect(100.0 * float(np.max(np.abs(shift))), _peak_to_peak(np.gradient(shift, position)))


def _peak_to_peak(values: Floats) -> float:
    return 100.0 * float(np.max(values) - np.min(values))


def _reached(line: LinePlan) -> FourierSeries:
    """Return the drive at the piezo: the target less what the boost limit held back."""
    if not line.held_harmonics or line.drive.response is None:
        return line.target
    n = np.arange(1.0, line.target.harmonics + 1.0)
    f = n * float(line.rate)
    full_real, full_imaginary = line.drive.response.inverse(f)
    capped_real, capped_imaginary, _ = capped_inverse(line.drive.response, f, line.drive.max_boost_db)
    # The phase is kept, so that the ratio is real.
    ratio = np.hypot(capped_real, capped_imaginary) / np.hypot(full_real, full_imaginary)
    return FourierSeries(line.target.a0, line.target.a * ratio, line.target.b * ratio)


def tick_scaling(line: LinePlan, played: EmittedPeriod, side: str, branch: Sweep, errors: TickErrors) -> float:
    """Compute the total scaling error in percent, peak to peak, of a period with these errors."""
    return _peak_to_peak(_chords(line, errors, side, played.followed(side, branch))[0])


def _chords(
    line: LinePlan, played: EmittedPeriod | TickErrors, side: str, followed: FollowedSweep
) -> tuple[Floats, Floats]:
    """Return the least and the largest slope error (1 is 100 %) of chords inside the window: of codes, of quantisation.

    Of all chords those count that begin or end where a run does: between those the error of a chord is a straight
    line. A code stands for the middle of its tick.
    """
    ticks, turn = line.program.ticks, line.drive.turn
    position, deviation, steepness = followed.position, followed.deviation, followed.steepness
    share = turn if side == "forward" else 1.0 - turn
    ends = sorted(float(t) * ticks for t in line.drive.shape.times(side, position[[0, -1]]))
    first, stop = ceil(ends[0] - 0.5), floor(ends[1] - 0.5) + 1
    baseline = max(1, min(round(CHORD * share * ticks), stop - first - 1))
    if stop - first < 2:
        return np.zeros(1), np.zeros(1)

    def noise_and_total(k: Ints, errors: Floats) -> tuple[Floats, Floats, Floats]:
        """Return the errors in the middle of ticks.

        Parameters
        ----------
        k, errors
            Ticks of the sweep, and the errors of their codes, each (n,).

        Returns
        -------
        where, noise, total
            Place on the line, its error by quantisation, and with that of the waveform; shares of the line, each (n,).
        """
        t = (k + 0.5) / ticks
        where = t / turn if side == "forward" else (1.0 - t) / share
        noise = errors / line.codes_per_unit / np.interp(where, position, steepness)
        return where, noise, noise + np.interp(where, position, deviation)

    totals, noises = [], []
    for low, high in played.stretches(first, stop - baseline):
        begin, error = played.corners(low, high)
        chords = [(begin, error, played.errors(begin + baseline))]
        if not played.by_tick:  # those that end where a run does
            end, end_error = played.corners(low + baseline, high + baseline)
            chords.append((end - baseline, played.errors(end - baseline), end_error))
        if not any(len(begin) for begin, _, _ in chords):
            begin = np.array([low])
            chords = [(begin, played.errors(begin), played.errors(begin + baseline))]
        for begin, errors, end_errors in chords:
            if not len(begin):
                continue
            x0, noise0, total0 = noise_and_total(begin, errors)
            x1, noise1, total1 = noise_and_total(begin + baseline, end_errors)
            total, noise = (total1 - total0) / (x1 - x0), (noise1 - noise0) / (x1 - x0)
            totals += [np.min(total), np.max(total)]
            noises += [np.min(noise), np.max(noise)]
    return np.array([min(totals), max(totals)]), np.array([min(noises), max(noises)])


def power_at_resonance_db(line: LinePlan, played: EmittedPeriod, power: float) -> float | None:
    """Power of the emitted codes inside the resonance, at least its nearest harmonic, relative to the scan's."""
    response, ticks = line.drive.response, line.program.ticks
    if response is None or ticks > _MAX_SPECTRUM_TICKS:
        return None
    rate, runs = float(line.rate), played.runs
    shaped = played.shaped if played.shaped is not None and played.shaped.is_whole else None
    if shaped is not None:
        rate, ticks = rate * ticks / shaped.ticks, shaped.ticks
    last = (ticks - 1) // 2
    centre, half = response.resonance_hz / rate, response.half_width_hz / rate
    if round(centre) > last:
        return None
    first, stop = max(1, round(centre - half)), min(last, round(centre + half)) + 1
    codes = np.repeat(runs.codes, runs.lengths) if shaped is None else shaped.judged_codes
    spectrum = np.abs(np.fft.rfft(codes - float(line.program.output.offset_code))) / ticks
    inside = 2.0 * float(np.sum(spectrum[first:stop] ** 2))
    return 10.0 * log10(max(inside, 1e-30) / power)
