"""The drive of an axis that follows the line and the frame at once, as of a scan at an angle: learnt on the operator.

The wanted position is a share of the fast motion and one of the slow motion. Their hysteresis does not add up: the
fast motion wipes out what the slow one would leave, so that two separate corrections make the slow part 9 to 17 % too
large. Here the drive of a whole frame is played on the operator in time, and corrected line by line: the distance
of the position from its target inside the imaging windows, over the sensitivity of the axis, is projected on the
harmonics of the line and added. The corrected lines differ so little from each other that two products are enough:

    u(l, t) = slow(l) + (slow(l + 1) - slow(l)) t + gain(l) (fast(t) + ratio(l) second(t))

with t in 0..1 the phase of line l. Between the imaged lines, where y turns, gain and ratio go straight, and the slow
part is as smooth as its harmonics allow.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.compensation.operator.frame_layer import FrameLayer
from tablegen.compensation.operator.in_time import OperatorInTime
from tablegen.numerics.arrays import Bools, Floats, Ints, freeze, tree_sum
from tablegen.numerics.linear import Cholesky
from tablegen.numerics.turns import sine_and_cosine
from tablegen.waveform.series import FourierSeries, on_one_grid

_SAMPLES_PER_HARMONIC = 8
_LEAST_SAMPLES = 256  # of a line
_ROUNDS = 24
_CONVERGED = 1e-4  # rms distance inside the windows, of the longer of both motions
_SETTLED = 1e-2  # of the longer motion: a drive that leaves more is refused
_STUCK = 0.97  # of the distance of the round before: what goes on so slowly has converged
_LEAST_ROUNDS = 8
_SMOOTHNESS = 1e-8  # of the penalty on n^4, against the mean square of the error
_SLOW_RELAXATION = 0.7  # of the slow correction: the sensitivity to a slow drive is the larger one
_FIRST_ROUNDS = 3
_NEAR = 0.1  # of v_max, from an end of the driver's range: a first guess further inside does not leave it by its size
_BEYOND = 0.01  # of v_max: what a round may leave the driver's range by
_AT_REST = 1e-9  # of the longer motion: a fast motion that is none, as at 90 degrees
_POWERS = 60  # rounds of the power iteration, whose ratio of lines is 0.1 or less
_KNOT_STIFFNESS = 1e-4  # of knots, against the mean square of what they fit
_COARSE_FROM = 96  # lines of a frame, from which on its start is learnt on fewer
_COARSER = 4
_COARSE_ROUNDS = 10
_ROUNDS_AFTER_COARSE = 3
_ROUNDING = 2.0**30  # parts of the drive are multiples of its inverse: the last bits of a round do not matter then


@dataclass(frozen=True, slots=True)
class FrameMotion:
    """What an axis is to do in a frame: ``fast_nm`` of the line's motion and ``slow_nm`` of the frame's, either signed.

    ``fast_nm`` and ``slow_nm`` are from x = 0 to 1 of each. Turns are in periods; the line is imaged over
    ``fast_window``, backward too if ``both``; ``imaged`` says which lines of a frame are, shape (lines,). ``centre`` is
    the middle of the drive, of v_max. ``layer`` is what the axis was measured to go further than its operator says.
    """

    fast_nm: float
    slow_nm: float
    fast_turn: float
    fast_window: tuple[float, float]
    both: bool
    slow_turn: float
    imaged: Bools
    line_rate_hz: float
    harmonics: int
    slow_harmonics: int
    centre: float
    layer: FrameLayer | None = None

    @property
    def lines(self) -> int:
        """Line periods of a frame."""
        return len(self.imaged)

    @property
    def longest_nm(self) -> float:
        """The longer of both motions."""
        return max(abs(self.fast_nm), abs(self.slow_nm))

    def wanted_nm(self, lines: Ints, t: Floats) -> Floats:
        """Return the wanted position in nm at phases ``t`` of lines, of the shape to which both broadcast."""
        phase = (lines + t) / self.lines
        return np.asarray(self.fast_nm * (self.fast(t) - 0.5) + self.slow_nm * (self.slow(phase) - 0.5))

    def fast(self, t: Floats) -> Floats:
        """Return x of the line from 0 to 1 at its phases ``t``, of any shape."""
        return _triangle(t, self.fast_turn)

    def slow(self, phase: Floats) -> Floats:
        """Return x of the frame from 0 to 1 at its phases, of any shape."""
        return _triangle(phase, self.slow_turn)

    def inside(self, t: Floats) -> Bools:
        """Return which phases ``t`` of a line are imaged, shape of ``t``."""
        x, (low, high) = self.fast(t), self.fast_window
        return np.asarray((x >= low) & (x <= high) & (self.both | (t <= self.fast_turn)))


@dataclass(frozen=True, eq=False)
class FrameDrive:
    """The drive of a frame in its parts, of v_max; ``fast`` and ``second`` have no mean.

    ``gains`` and ``ratios`` are at knots that are ``spacing`` lines apart, shape (knots,), the last as the first.
    ``distance_percent`` is what is left inside the windows, rms, of the longer motion, without a constant.
    """

    slow: FourierSeries
    fast: FourierSeries
    second: FourierSeries
    gains: Floats
    ratios: Floats
    spacing: int
    rounds: int
    distance_percent: float

    def at_lines(self, knots: Floats, lines: int) -> Floats:
        """Return values at lines 0..lines - 1, straight between knots."""
        return np.asarray(np.interp(np.arange(lines), self.spacing * np.arange(len(knots)), knots))

    def on_grid(self, lines: int, count: int) -> Floats:
        """Return the drive at ``count`` phases of each line, shape (lines, count)."""
        return self.at(lines, np.arange(count) / count)

    def at(self, lines: int, t: Floats) -> Floats:
        """Return the drive at phases of each line, shape (lines, len(t))."""
        start = self.slow.on_grid(lines)
        rise = np.roll(start, -1) - start
        gain, ratio = self.at_lines(self.gains, lines), self.at_lines(self.ratios, lines)
        shape = self.fast.value(t) + ratio[:, None] * self.second.value(t)
        return np.asarray(start[:, None] + rise[:, None] * t + gain[:, None] * shape)


Inverse = Callable[[FourierSeries], FourierSeries]  # what has to arrive at the piezo for a line


def learn_frame(axis: OperatorInTime, motion: FrameMotion, inverse: Inverse, knots: int) -> FrameDrive:
    """Learn the drive with which an axis follows both motions.

    Parameters
    ----------
    axis
        The axis in time, at the rate of the line.
    motion
        What it is to do.
    inverse
        Inverse dynamics of a line's series.
    knots
        Intervals between knots of gain and ratio over the frame, a divisor of its lines or not.

    Raises
    ------
    Unphysical
        If the drive leaves the range of the driver or of the operator, or does not settle.
    """
    learner = _FrameLearner(axis, motion, inverse)
    many = motion.lines >= _COARSE_FROM
    slow, lines = _coarse(axis, motion, inverse) if many else learner.first()
    least_rounds = _ROUNDS_AFTER_COARSE if many else _LEAST_ROUNDS
    before = np.inf
    for turn in range(1, _ROUNDS + 1):
        left = learner.missing(learner.drive(slow, lines))
        distance = learner.rms(left)
        if distance < _CONVERGED or turn == _ROUNDS or (turn > least_rounds and distance > _STUCK * before):
            break
        before = distance
        slow, lines = learner.corrected(slow, lines, left)
    if distance > _SETTLED:
        raise Unphysical(
            f"the drive of the frame did not settle on the operator: {100.0 * distance:.2g} % are left after {turn} "
            "rounds; a smaller scan or a lower line rate may help"
        )
    return learner.separated(slow, lines, knots, turn)


def _coarse(axis: OperatorInTime, motion: FrameMotion, inverse: Inverse) -> tuple[FourierSeries, Floats]:
    """Return a start for a long frame: what is learnt on every fourth line, in a fourth of the time."""
    few = replace(
        motion,
        imaged=motion.imaged[::_COARSER].copy(),
        slow_harmonics=min(motion.slow_harmonics, -(-motion.lines // _COARSER) // 3),
    )
    learner = _FrameLearner(axis, few, inverse)
    slow, rows = learner.first()
    for _ in range(_COARSE_ROUNDS):
        slow, rows = learner.corrected(slow, rows, learner.missing(learner.drive(slow, rows)))
    at, coarse = np.arange(motion.lines) / motion.lines, np.arange(few.lines) / few.lines
    lines = np.stack([np.interp(at, coarse, one, period=1.0) for one in rows.T], axis=-1)
    more = np.zeros(motion.slow_harmonics - few.slow_harmonics)
    return FourierSeries(slow.a0, np.append(slow.a, more), np.append(slow.b, more)), lines


class BeyondDriver(Unphysical):
    """A frame that leaves the driver's range; ``least`` and ``most`` are the ends of its drive, of v_max."""

    def __init__(self, least: float, most: float) -> None:
        self.least, self.most = least, most
        super().__init__(f"the frame takes {100.0 * least:.3g} to {100.0 * most:.3g} % of the driver's range")


def linear_frame(motion: FrameMotion, nm_per_drive: float) -> tuple[FourierSeries, FourierSeries]:
    """Return the drive of a linear piezo that follows both motions: its slow part, and that of every line.

    Parameters
    ----------
    motion
        What the piezo is to do; its layer is not used.
    nm_per_drive
        Displacement in nm by a drive of v_max, signed.

    Returns
    -------
    tuple of FourierSeries
        The slow part over the frame, about the centre of the motion, and the line without its mean, of v_max.
    """
    line, half = _LinearFrame(motion, nm_per_drive).line(), motion.harmonics
    # A window that is not in the middle of a line gives the line a mean, which no table of a line has.
    slow = linear_slow(motion, nm_per_drive, float(line[0]))
    fast = FourierSeries(0.0, line[1 : half + 1].copy(), line[half + 1 :].copy())
    return slow, rounded_series(fast)


def linear_slow(motion: FrameMotion, nm_per_drive: float, mean: float) -> FourierSeries:
    """Return the slow part of a linear piezo's drive, about the centre of the motion, and the mean of a line."""
    # Within a line the slow part goes straight to the start of the next one: those behind imaged lines count as well.
    ends = np.flatnonzero(motion.imaged | np.roll(motion.imaged, 1)) / motion.lines
    heights = (motion.slow_nm / nm_per_drive) * (motion.slow(ends) - 0.5)
    slow = _SlowFit(ends, motion.slow_harmonics).of(heights)
    return rounded_series(FourierSeries(slow.a0 + motion.centre + mean, slow.a, slow.b))


class _LinearFrame:
    """The fits of a frame's drive to its imaged samples, and the drive of a piezo without hysteresis.

    Lines are rows of a1..aH, b1..bH, in shares of v_max at the piezo's input.
    """

    def __init__(self, motion: FrameMotion, nm_per_drive: float) -> None:
        self._motion, self._nm = motion, nm_per_drive
        count = max(_LEAST_SAMPLES, 1 << (_SAMPLES_PER_HARMONIC * motion.harmonics).bit_length())
        self._count = count
        self._t = np.arange(count) / count
        self._inside = motion.inside(self._t)
        self._project = _projection(self._t[self._inside], self._edges(), motion.harmonics)
        starts = np.arange(motion.lines) / motion.lines
        self._slow_start = _SlowFit(starts[motion.imaged], motion.slow_harmonics)

    def first(self) -> tuple[FourierSeries, Floats]:
        """Return the drive of a piezo without hysteresis: the slow part, and a row a line."""
        motion, starts = self._motion, np.arange(self._motion.lines) / self._motion.lines
        slow = self._slow_start.of((motion.slow_nm / self._nm) * (motion.slow(starts[motion.imaged]) - 0.5))
        slow = FourierSeries(slow.a0 + motion.centre, slow.a, slow.b)
        return slow, np.tile(self.line()[1:], (motion.lines, 1))

    def line(self) -> Floats:
        """Return the mean and the harmonics of a line of that piezo, shape (2 H + 1,)."""
        motion = self._motion
        target = (motion.fast_nm / self._nm) * (motion.fast(self._t[self._inside]) - 0.5)
        return np.asarray(self._projected(target[None, :])[0])

    def _projected(self, rows: Floats) -> Floats:
        """Return the mean and the harmonics of rows of imaged samples, shape (rows, 2 H + 1)."""
        return np.stack([tree_sum(rows * weights) for weights in self._project], axis=-1)

    def _edges(self) -> Floats:
        """Return weights of the imaged samples: denser towards the edges of a window, as Chebyshev's points are."""
        low, high = self._motion.fast_window
        x = self._motion.fast(self._t[self._inside])
        edge = np.clip((x - low) / (high - low), 1e-3, 1.0 - 1e-3)
        weight = 1.0 / np.sqrt(edge * (1.0 - edge))
        return np.asarray(weight / float(tree_sum(weight)))


class _FrameLearner(_LinearFrame):
    """The data that the rounds share."""

    def __init__(self, axis: OperatorInTime, motion: FrameMotion, inverse: Inverse) -> None:
        super().__init__(motion, axis.operator.nm_per_drive)
        self._axis, self._rounds = axis, 0
        self._first_reach = 0.0, 1.0
        lines, count = motion.lines, self._count
        target = motion.wanted_nm(np.arange(lines)[:, None], self._t)
        if motion.layer is not None:  # the operator has to stay behind by what the piezo goes further
            target = target - motion.layer.at(lines, self._t)
        self._target = target[motion.imaged][:, self._inside]
        self._time_s = np.arange(lines * count + 1) / (count * motion.line_rate_hz)
        self._inverse = inverse
        mid = (np.arange(lines) + 0.5) / lines
        self._slow_fit = _SlowFit(mid[motion.imaged], motion.slow_harmonics)

    def drive(self, slow: FourierSeries, lines: Floats) -> Floats:
        """Return the drive of a frame, shape (lines * count,)."""
        harmonics = self._motion.harmonics
        start = slow.on_grid(self._motion.lines)
        rise = np.roll(start, -1) - start
        series = [self._inverse(FourierSeries(0.0, row[:harmonics].copy(), row[harmonics:].copy())) for row in lines]
        rows = on_one_grid(series, self._count)
        return np.asarray(start[:, None] + rise[:, None] * self._t + rows).ravel()

    def missing(self, u: Floats) -> Floats:
        """Return the distance to the target at the imaged samples in nm, without its mean, shape (imaged, inside)."""
        least, most = float(np.min(u)), float(np.max(u))
        self._rounds += 1
        if self._rounds == 1:
            self._first_reach = least, most
        if (least < -_BEYOND or most > 1.0 + _BEYOND) and self._rounds > _FIRST_ROUNDS:
            low, high = self._first_reach  # what was clipped since has grown beyond all measure
            if low > _NEAR and high < 1.0 - _NEAR:
                raise Unphysical(
                    "the drive of the frame grows from round to round on the operator; a lower line rate may help"
                )
            raise BeyondDriver(low, high)
        u = np.clip(u, -_BEYOND, 1.0 + _BEYOND)  # amplitudes are not known in the first rounds
        position = self._axis.position(self._time_s, np.append(u, u[0]))[:-1]
        rows = position.reshape(self._motion.lines, self._count)
        left = self._target - rows[self._motion.imaged][:, self._inside]
        return np.asarray(left - float(tree_sum(left.ravel())) / left.size)

    def rms(self, left: Floats) -> float:
        """Return the rms of distances, of the longer motion."""
        return float(np.sqrt(tree_sum((left * left).ravel()) / left.size)) / self._motion.longest_nm

    def corrected(self, slow: FourierSeries, lines: Floats, left: Floats) -> tuple[FourierSeries, Floats]:
        """Return the drive with what is missing in it."""
        solution = self._projected(left / self._nm)
        change = self._slow_fit.of(_SLOW_RELAXATION * solution[:, 0])
        return slow.plus(change), lines + self._over_frame(solution[:, 1:])

    def separated(self, slow: FourierSeries, lines: Floats, knots: int, rounds: int) -> FrameDrive:
        """Return the drive as two products, with what they leave."""
        motion = self._motion
        spacing = max(-(-motion.lines // knots), 1)
        gain, first, share, second = _two_products(lines[motion.imaged])
        mean = float(tree_sum(gain)) / len(gain)
        fit = _KnotFit(np.flatnonzero(motion.imaged), motion.lines, spacing)
        moves = abs(motion.fast_nm) > _AT_REST * motion.longest_nm
        drive = FrameDrive(
            slow=rounded_series(slow),
            fast=rounded_series(self._inverse(self._series(mean * first if moves else 0.0 * first))),
            second=rounded_series(self._inverse(self._series(second if moves else 0.0 * second))),
            gains=_rounded(fit.of(gain / mean)) if moves else np.ones(fit.knots),
            ratios=_rounded(fit.of(share * mean / gain)) if moves else np.zeros(fit.knots),
            spacing=spacing,
            rounds=rounds,
            distance_percent=0.0,
        )
        left = self.rms(self.missing(drive.on_grid(motion.lines, self._count).ravel()))
        return replace(drive, distance_percent=100.0 * left)

    def _series(self, row: Floats) -> FourierSeries:
        half = self._motion.harmonics
        return FourierSeries(0.0, row[:half].copy(), row[half:].copy())

    def _over_frame(self, rows: Floats) -> Floats:
        """Return rows of all lines from those of the imaged ones, straight between them."""
        lines, at = self._motion.lines, np.flatnonzero(self._motion.imaged)
        around = np.concatenate([at - lines, at, at + lines])
        return np.stack([np.interp(np.arange(lines), around, np.tile(one, 3)) for one in rows.T], axis=-1)


class _SlowFit:
    """The series of the slow part through values at phases of the frame, of least acceleration between them."""

    def __init__(self, phases: Floats, harmonics: int) -> None:
        weight = np.full(len(phases), 1.0 / len(phases))
        self._harmonics = harmonics
        self._rows = _projection(phases, weight, harmonics)

    def of(self, values: Floats) -> FourierSeries:
        """Return the series for values at the phases, shape (phases,)."""
        solution, half = tree_sum(self._rows * values), self._harmonics
        return FourierSeries(float(solution[0]), solution[1 : half + 1].copy(), solution[half + 1 :].copy())


class _KnotFit:
    """Straight lines between knots that go through values at lines; the last knot is the first of the next frame."""

    def __init__(self, at: Ints, lines: int, spacing: int) -> None:
        count = -(-lines // spacing)
        self.knots = count + 1
        left, share = at // spacing, (at % spacing) / spacing
        basis = np.zeros((count, len(at)))
        basis[left, np.arange(len(at))] += 1.0 - share
        basis[(left + 1) % count, np.arange(len(at))] += share
        normal = np.array([tree_sum(basis * row) for row in basis]) / len(at)
        bend = 2.0 * np.eye(count) - np.roll(np.eye(count), 1, axis=0) - np.roll(np.eye(count), -1, axis=0)
        stiff = np.array([tree_sum(bend * row) for row in bend])
        self._basis, self._factor = basis, Cholesky(normal + (_KNOT_STIFFNESS / count) * stiff + 1e-14 * np.eye(count))

    def of(self, values: Floats) -> Floats:
        """Return the knots, shape (count + 1,)."""
        solution = self._factor.solve(tree_sum(self._basis * values) / len(values))
        return np.append(solution, solution[0])


def _rounded(values: Floats) -> Floats:
    return np.asarray(np.rint(values * _ROUNDING) / _ROUNDING)


def rounded_series(series: FourierSeries) -> FourierSeries:
    """Return a series whose coefficients are multiples of 2^-30."""
    return FourierSeries(round(series.a0 * _ROUNDING) / _ROUNDING, _rounded(series.a), _rounded(series.b))


def _triangle(phase: Floats, turn: float) -> Floats:
    phase = phase % 1.0
    return np.asarray(np.where(phase < turn, phase / turn, (1.0 - phase) / (1.0 - turn)))


def _waves(t: Floats, harmonics: int) -> Floats:
    """Return 1, cosines and sines at phases, shape (2 harmonics + 1, len(t))."""
    n = np.arange(1.0, harmonics + 1.0)
    sines, cosines = sine_and_cosine(n[:, None] * t)
    return np.concatenate([np.ones((1, len(t))), cosines, sines])


def _projection(t: Floats, weight: Floats, harmonics: int) -> Floats:
    """Return rows whose sums with values at phases are the coefficients of the best smooth series.

    Its shape is (2 harmonics + 1, len(t)).
    """
    return _projection_of(t.tobytes(), weight.tobytes(), harmonics)


@lru_cache(maxsize=12)  # both axes have the same, and so have the changes of a session
def _projection_of(t: bytes, weights: bytes, harmonics: int) -> Floats:
    basis, weight = _waves(np.frombuffer(t), harmonics), np.frombuffer(weights)
    n = np.arange(1.0, harmonics + 1.0)
    square = n * n
    penalty = _SMOOTHNESS * np.concatenate([[0.0], square * square, square * square])
    normal = np.array([tree_sum(basis * (row * weight)) for row in basis])
    factor = Cholesky(normal + np.diag(penalty + 1e-14))
    weighted = basis * weight
    rows = np.stack([factor.solve(column) for column in weighted.T], axis=-1)
    freeze(rows)
    return rows


def _two_products(rows: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Return the two products of a column and a unit row that come nearest to rows, the larger one first."""
    first = _direction(rows)
    gain = tree_sum(rows * first)
    rest = rows - gain[:, None] * first
    second = _direction(rest)
    return gain, first, tree_sum(rest * second), second


def _direction(rows: Floats) -> Floats:
    """Return the unit row of which the rows have most, shape (columns,), its sign that of most of them."""
    lengths = tree_sum(rows * rows)
    row = rows[int(np.argmax(lengths))].copy()
    size = float(np.sqrt(tree_sum(row * row)))
    if not size > 0.0:
        return np.asarray(np.eye(1, rows.shape[1])[0])
    row /= size
    columns = rows.T.copy()
    for _ in range(_POWERS):
        row = tree_sum(columns * tree_sum(rows * row))
        row /= float(np.sqrt(tree_sum(row * row)))
    return np.asarray(row)
