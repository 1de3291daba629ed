"""The drive of a trace: period, turning point and levels of a triangle or sawtooth, to a fraction of a sample."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.fitting.least_squares import solve
from tablegen.numerics.arrays import Floats

_NAMES = ("period", "start", "turn", "low", "high")
_MIN_SWEEP_SAMPLES = 4  # samples in the middle half of a sweep


@dataclass(frozen=True)
class Triangle:
    """A drive that rises for ``turn`` of its period from a minimum at ``start_s``, and falls for the rest.

    ``timing_covariance`` is that of (period_s, start_s, turn); ``departure`` the rms of the recorded drive less the
    triangle, as a fraction of its height.
    """

    period_s: float
    start_s: float
    turn: float
    v_low: float
    v_high: float
    timing_covariance: Floats
    departure: float

    def phase(self, time_s: Floats) -> Floats:
        """Return the periods since a minimum.

        Parameters
        ----------
        time_s
            Times in s, any shape.

        Returns
        -------
        Floats
            In [0, 1), of the shape of ``time_s``.
        """
        t = (time_s - self.start_s) / self.period_s
        return t - np.floor(t)

    def value(self, time_s: Floats) -> Floats:
        """Return the normalised drive.

        Parameters
        ----------
        time_s
            Times in s, any shape.

        Returns
        -------
        Floats
            From 0 to 1, of the shape of ``time_s``.
        """
        phase = self.phase(time_s)
        return np.where(phase < self.turn, phase / self.turn, (1.0 - phase) / (1.0 - self.turn))

    def timing_slopes(self, time_s: Floats) -> Floats:
        """Return the derivatives of ``value`` by period_s, start_s and turn.

        Parameters
        ----------
        time_s
            Times in s, shape (samples,).

        Returns
        -------
        Floats
            Per s, per s and per unit of the turn, a column each, shape (samples, 3).
        """
        phase = self.phase(time_s)
        rising = phase < self.turn
        slope = np.where(rising, 1.0 / self.turn, -1.0 / (1.0 - self.turn))
        by_turn = np.where(rising, -phase / self.turn**2, (1.0 - phase) / (1.0 - self.turn) ** 2)
        by_start = -slope / self.period_s
        return np.stack([by_start * (time_s - self.start_s) / self.period_s, by_start, by_turn], axis=1)


def find_triangle(time_s: Floats, drive_v: Floats) -> Triangle:
    """Fit the triangle in a recorded drive, from one period on; noise is averaged over the whole record.

    Parameters
    ----------
    time_s
        Times in s, shape (samples,).
    drive_v
        Drive in V, shape (samples,).

    Raises
    ------
    Unphysical
        If the drive is no triangle.
    """
    first = _first_guess(time_s, drive_v)
    middle = 0.5 * (float(time_s[0]) + float(time_s[-1]))
    height = first.v_high - first.v_low
    # The minimum nearest the middle: there period and start do not depend on each other.
    start = first.start_s + round((middle - first.start_s) / first.period_s) * first.period_s

    def triangle(x: Floats) -> Triangle:
        """Return the triangle of these parameters: period and start in s, turn, low and high in V.

        Parameters
        ----------
        x
            Shape (5,).
        """
        return Triangle(float(x[0]), float(x[1]), float(x[2]), float(x[3]), float(x[4]), np.zeros((3, 3)), 0.0)

    def residuals(x: Floats) -> Floats:
        """Compute the triangle less the drive.

        Returns
        -------
        Floats
            Share of the height, shape (samples,).
        """
        low, high = float(x[3]), float(x[4])
        return (low + (high - low) * triangle(x).value(time_s) - drive_v) / height

    def jacobian(x: Floats) -> Floats:
        """Compute the derivatives of ``residuals``.

        Returns
        -------
        Floats
            Shape (samples, 5).
        """
        shape = triangle(x)
        value = shape.value(time_s)
        timing = shape.timing_slopes(time_s) * (shape.v_high - shape.v_low)
        return np.column_stack([timing, 1.0 - value, value]) / height

    room = min(first.turn, 1.0 - first.turn)
    period = first.period_s
    low = [0.7 * period, start - 0.5 * period, first.turn - 0.9 * room, -np.inf, -np.inf]
    high = [1.4 * period, start + 0.5 * period, first.turn + 0.9 * room, np.inf, np.inf]
    scales = [0.05 * period, 0.05 * period, 0.1 * room, height, height]
    begin = [period, start, first.turn, first.v_low, first.v_high]
    solution = solve(residuals, begin, _NAMES, scales, (low, high), jacobian)
    x = solution.values
    covariance = solution.unit_covariance[:3, :3] * max(solution.variance, 0.0)
    periods = float(np.floor((float(x[1]) - float(time_s[0])) / float(x[0])))
    early = float(x[1]) - periods * float(x[0])
    back = np.array([[1.0, 0.0, 0.0], [-periods, 1.0, 0.0], [0.0, 0.0, 1.0]])  # start is that many periods earlier
    departure = float(np.sqrt(np.mean(solution.residuals**2)))
    return Triangle(float(x[0]), early, float(x[2]), float(x[3]), float(x[4]), back @ covariance @ back.T, departure)


def _first_guess(time_s: Floats, drive_v: Floats) -> Triangle:
    """From lines through the middle half of each sweep."""
    few, most = np.quantile(drive_v, [0.01, 0.99])
    height = float(most - few) / 0.98
    if not height > 0.0:
        raise Unphysical("the drive does not move")
    low = float(few) - 0.01 * height
    sweeps = _sweeps(time_s, (drive_v - low) / height)
    rises, falls = ([s for s in sweeps if (s[1] > 0) == up] for up in (True, False))
    if not rises or not falls:
        raise Unphysical(
            "the drive has no complete sweep up and down of eight samples each; begin the record "
            "at a turn, or record two periods"
        )
    rise, fall = (float(np.median([1.0 / abs(slope) for _, slope in side])) for side in (rises, falls))
    same = max(rises, falls, key=len)
    periods = [later[0] - earlier[0] for earlier, later in pairwise(same)]
    period = float(np.median(periods)) if periods else rise + fall
    if not 0.5 < period / (rise + fall) < 2.0:
        raise Unphysical("the drive is not a triangle or sawtooth: it rests, or its sweeps differ")
    turn = rise / (rise + fall)
    return Triangle(period, rises[0][0] - 0.5 * turn * period, turn, low, low + height, np.zeros((3, 3)), 0.0)


def _sweeps(time_s: Floats, level: Floats) -> list[tuple[float, float]]:
    """Return the time of the middle and the slope (1/s) of each sweep from a quarter of the range to three quarters."""
    far = np.flatnonzero((level < 0.25) | (level > 0.75))
    ends = np.flatnonzero(np.diff(level[far] > 0.75))
    crossings = []
    for end in ends:
        inside = slice(int(far[end]) + 1, int(far[end + 1]))
        t, v = time_s[inside], level[inside]
        if len(t) < _MIN_SWEEP_SAMPLES:
            continue
        centre = float(np.mean(t))
        slope = float((t - centre) @ (v - np.mean(v)) / ((t - centre) @ (t - centre)))
        if slope * (1.0 if level[far[end]] < 0.5 else -1.0) > 0.0:
            crossings.append((centre + (0.5 - float(np.mean(v))) / slope, slope))
    return crossings
