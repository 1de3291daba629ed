"""The waveform of least peak acceleration among those that are straight enough where the image is taken.

With w harmonics 1..H, u the line and E the scaling error that is allowed, peak to peak::

    minimise max_t |w''(t)|
    subject to |w'(t) / u'(t) - 1| <= E / 2 and |w(t) - u(t)| / |u'| <= E / 20 in the imaging windows, 0 <= w <= 1

It is a linear programme at some times, solved within some percent, and checked at those of the certificate. E / 20 of
the line is what a slope that is wrong by E makes over a chord of the certificate. Derivation: docs/waveform.md.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.numerics.arrays import Floats
from tablegen.numerics.interior_point import BoundConstraint, Minimum, least_bound
from tablegen.numerics.turns import cosine
from tablegen.waveform.harmonic_rows import HarmonicRows, series_of, unknowns
from tablegen.waveform.refined import WaveformShape
from tablegen.waveform.series import FourierSeries, values
from tablegen.waveform.window_fit import fit_window

POSITION = 0.1  # of the slope's bound: by how much of the line w may be beside u
_GAP = 0.02  # of the optimum
_NODES_PER_WAVE = 14  # in a window, of the highest harmonic
_ACCELERATIONS_PER_WAVE = 12
_RANGE_PER_WAVE, _LEAST_RANGE = 8, 512
_PLACES = 17  # of a window at which the position is held
_TIGHT = 0.94  # share of the bound imposed at the nodes, so that it holds between them
_TRIALS = 4
_RANGE_MARGIN = 1e-3
_CERTIFICATE_POINTS = 16, 513  # of a window: so many a harmonic, and so many more


@dataclass(frozen=True)
class Straightness:
    """The places where a line of ``shape`` has to be straight: the ``window`` in position, backward too if ``both``.

    ``target`` is what is followed there; slopes are measured in those of ``shape``.
    """

    shape: WaveformShape
    target: WaveformShape
    window: tuple[float, float]
    both: bool

    @property
    def up_to_its_turns(self) -> bool:
        """True if an end of the line is imaged: within [0, 1] there is no room to turn."""
        return self.window[0] <= 0.0 or self.window[1] >= 1.0

    def times(self, x: Floats) -> list[Floats]:
        """Return when each direction that images passes places of the window.

        Parameters
        ----------
        x
            Places in the window, 0 at its lower end and 1 at its upper, any shape.

        Returns
        -------
        list of Floats
            Times in periods: forward, then backward if ``both``; each of the shape of ``x``.
        """
        low, high = self.window
        place, turn = low + (high - low) * x, self.shape.turn
        forward = turn * place
        return [forward, turn + (1.0 - turn) * (1.0 - place)] if self.both else [forward]

    def error_percent(self, series: FourierSeries) -> float:
        """Return the scaling error in percent: twice the largest error of a slope on the grid of the certificate."""
        per_harmonic, more = _CERTIFICATE_POINTS
        count = per_harmonic * series.harmonics + more
        t = np.concatenate(self.times(np.arange(count) / (count - 1.0)))
        slope = values(t, (series, 1))[0]
        return 200.0 * float(np.max(np.abs((slope - self.target.slope(t)) / self.shape.slope(t))))


class Unreachable(Unphysical):
    """The harmonics cannot be as straight as requested; ``least_percent`` is their least error, None if not known."""

    def __init__(self, why: str, least_percent: float | None = None) -> None:
        super().__init__(why)
        self.least_percent = least_percent


def minimum_acceleration_series(straight: Straightness, harmonics: int, percent: float) -> FourierSeries:
    """Return the series of minimum acceleration that keeps a scaling error of ``percent``, peak to peak.

    Its peak acceleration is within some percent of the optimum, and never above that of ``fit_window`` where that is as
    straight.

    Raises
    ------
    Unreachable
        If the harmonics cannot keep the error.
    """
    first = _window(straight, harmonics)
    error = straight.error_percent(first)
    try:
        best = _minimum_acceleration(straight, harmonics, percent, first, error, hold_range=False)
        if not _in_range(best):
            best = _minimum_acceleration(straight, harmonics, percent, first, error, hold_range=True)
    except Unreachable:
        if error > percent:
            raise
        return first
    return first if error <= percent and first.peak_acceleration() <= best.peak_acceleration() else best


def least_percent(straight: Straightness, harmonics: int, enough: float = 0.0) -> float:
    """Return the least scaling error, percent, that is kept for certain, or any below ``enough``.

    Raises
    ------
    Unreachable
        If the harmonics cannot stay in the range.
    """
    first = _window(straight, harmonics)
    programme = _Programme(straight, harmonics, hold_range=False)
    optimum = programme.straightest(first, enough)
    if not _in_range(series_of(optimum.y)):
        optimum = _Programme(straight, harmonics, hold_range=True).straightest(first, enough)
    return _promised(optimum.bound)


def fewest_harmonics(straight: Straightness, percent: float, first: int, most: int) -> int | None:
    """Return the fewest harmonics from ``first`` to ``most`` that keep a scaling error of ``percent``; None if none do.

    More harmonics are never less straight, so that the number is found by bisection. No number of them draws a line
    that is straight up to where it turns.
    """
    if straight.up_to_its_turns:
        return None

    def keeps(harmonics: int) -> bool:
        try:
            return least_percent(straight, harmonics, percent) <= percent
        except Unphysical:
            return False

    low, high = first - 1, first
    while not keeps(high):
        if high >= most:
            return None
        low, high = high, min(2 * high, most)
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if keeps(middle) else (middle, high)
    return high


def _window(straight: Straightness, harmonics: int) -> FourierSeries:
    return fit_window(straight.target, harmonics, straight.window, straight.both)


def _in_range(series: FourierSeries) -> bool:
    count = 32 * series.harmonics
    w = series.on_grid(count)
    between = series.peak_acceleration() / (8.0 * count * count)  # by which it may bulge from one time to the next
    return float(np.min(w)) >= between and float(np.max(w)) <= 1.0 - between


def _promised(bound: float) -> float:
    """Return the percent that can be promised for a bound on slopes at the nodes that was reached within the gap."""
    return 200.0 * 1.02 * bound / _TIGHT


def _minimum_acceleration(
    straight: Straightness, harmonics: int, percent: float, first: FourierSeries, error: float, hold_range: bool
) -> FourierSeries:
    programme = _Programme(straight, harmonics, hold_range)
    share = _TIGHT
    start = first
    if hold_range or error > 0.9 * share * percent:
        straightest = programme.straightest(first, percent)
        if _promised(straightest.bound) > percent:
            least = _promised(straightest.bound)
            raise Unreachable(f"{harmonics} harmonics leave at least {least:.3g} % in this window", least)
        start = series_of(straightest.y)
    for _ in range(_TRIALS):
        series = series_of(programme.minimise(start, share * percent / 200.0).y)
        error = straight.error_percent(series)
        if error <= percent and (not hold_range or _in_range(series)):
            return series
        share *= min(0.99, 0.995 * percent / error)
    raise Unreachable(f"{harmonics} harmonics came to no waveform of {percent:g} % in this window; allow more")


class _Programme:
    """The rows of a line: slopes and places in its windows, accelerations outside, and the range if ``hold_range``."""

    def __init__(self, straight: Straightness, harmonics: int, hold_range: bool) -> None:
        shape, turn = straight.shape, straight.shape.turn
        low, high = straight.window
        slope_times, place_times = [], []
        for side, share in enumerate((turn, 1.0 - turn) if straight.both else (turn,)):
            count = ceil(_NODES_PER_WAVE * harmonics * share * (high - low)) + 24
            x = 0.5 - 0.5 * cosine(np.arange(count) / (2.0 * (count - 1)))
            slope_times.append(straight.times(x)[side])
            place_times.append(straight.times(np.arange(_PLACES) / (_PLACES - 1.0))[side])
        t = np.concatenate(slope_times)
        slope = shape.slope(t)
        self._slopes = HarmonicRows(t, 1.0 / slope, harmonics, 1), straight.target.slope(t) / slope
        # Position error over the line: (w - u) / u', in the line's own time, which a share of the period stretches.
        t = np.concatenate(place_times)
        steepness = np.abs(shape.slope(t)) * np.where(t <= turn, turn, 1.0 - turn)
        self._places = HarmonicRows(t, 1.0 / steepness, harmonics, 0), straight.target.value(t) / steepness
        count = _ACCELERATIONS_PER_WAVE * harmonics
        t = np.arange(count) / count
        place = np.where(t <= turn, t / turn, (1.0 - t) / (1.0 - turn))
        t = t[(place <= low) | (place >= high) | ((t > turn) & (not straight.both))]
        self._accelerations = HarmonicRows(t, np.ones(len(t)), harmonics, 2), np.zeros(len(t))
        self._range: list[BoundConstraint] = []
        if hold_range:
            count = max(_RANGE_PER_WAVE * harmonics, _LEAST_RANGE)
            rows = HarmonicRows(np.arange(count) / count, np.ones(count), harmonics, 0)
            self._range = [BoundConstraint(rows, np.full(count, 0.5), 0.5 - _RANGE_MARGIN, 0.0)]

    def straightest(self, start: FourierSeries, percent: float) -> Minimum:
        """Return the least bound on slopes, or the first one for which ``percent`` can be promised."""
        parts = [BoundConstraint(*self._slopes, 0.0, 1.0), BoundConstraint(*self._places, 0.0, POSITION), *self._range]
        return least_bound(parts, unknowns(start), _GAP, lambda bound: _promised(bound) <= percent)

    def minimise(self, start: FourierSeries, half: float) -> Minimum:
        """Return the least acceleration with slopes within ``half``."""
        parts: Sequence[BoundConstraint] = [
            BoundConstraint(*self._accelerations, 0.0, 1.0),
            BoundConstraint(*self._slopes, half, 0.0),
            BoundConstraint(*self._places, POSITION * half, 0.0),
            *self._range,
        ]
        return least_bound(parts, unknowns(start), _GAP)
