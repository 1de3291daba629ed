"""The waveform that an operator's axis follows straight: learnt on the operator, before anything is built.

A round plays the waveform on the operator: the settled loop of its stroke, then creep and dynamics, which act on all
harmonics of the position, since a loop has many more of them than its drive. The distance of the position from the
target line inside the imaging windows, over the slope of the branch, is projected on the harmonics with a penalty on
n^4, and added; the amplitude is scaled to the size. Corrections that go to and fro are halved. Turns are rounded, so
that the stroke differs from the line; the loop is that of the stroke.
"""

from collections.abc import Callable
from dataclasses import astuple, dataclass

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.compensation.dynamics import Response
from tablegen.compensation.operator.loop import POINTS, Loop
from tablegen.compensation.operator.operator import Operator
from tablegen.numerics.arrays import Bools, Floats, tree_sum
from tablegen.numerics.fourier import filtered
from tablegen.numerics.linear import Cholesky
from tablegen.numerics.turns import sine_and_cosine
from tablegen.waveform.series import FourierSeries

CHORD = 0.05  # of the line, for scaling errors
_ROUNDS = 120
_WHOLE_ROUNDS = 20  # after as many, corrections are halved, again and again: on loops of few kinks they go to and fro
_CONVERGED = 1e-5  # of the line: the largest change of the position inside the windows in a round
_LATE_ROUNDS = 2 * _WHOLE_ROUNDS
_LATE_CONVERGED = 2e-4  # of the line: the same after as many rounds, of a whole correction; and the error of the size
_GRID_PER_HARMONIC = 16
_MIN_GRID = 1024
_SMOOTHNESS = 1e-8  # of the penalty on n^4, against the mean square of the error
_SLOPE_STEPS = 4  # points of the loop over which its slope is taken
_FIRST_ROUNDS = 4
_BEYOND = 0.01  # of v_max: what a round may leave the driver's range by
_SINE_CONVERGED = 1e-9  # of the size
_PLACE_HARMONICS = 64  # of the position of a sine: what is above them moves it by less than 1e-6 of the line
_ROUNDING = 2.0**40  # coefficients are multiples of its inverse: the last bits of a round do not matter then

Factor = Callable[[float], float]
ThroughInverse = Callable[[FourierSeries], FourierSeries]  # what has to arrive at the piezo for a target


@dataclass(frozen=True, slots=True)
class TargetLine:
    """The target line: ``size_nm`` from x = 0 to 1, turn in periods, imaged over ``window``, backward too if ``both``.

    ``centre`` is the offset, of v_max; ``factor`` m of (1) there over that at the operator's centre. ``with_mean`` is m
    at a mean of the drive, of v_max, over that at the offset.
    """

    size_nm: float
    turn: float
    window: tuple[float, float]
    both: bool
    rate_hz: float
    centre: float
    factor: float
    with_mean: Factor = lambda mean: 1.0


@dataclass(frozen=True, slots=True)
class ExpectedErrors:
    """The errors of the scan by the operator: percent of the line, forward and backward, but for ``mismatch``.

    ``rms`` is the residual about the common best line of all windows, ``scaling`` peak to peak of chords of 1/20 of the
    line, ``mismatch`` the largest distance of trace and retrace, ``size`` the error of the size.
    """

    rms: tuple[float, float]
    scaling: tuple[float, float]
    mismatch: float
    size: float

    def most_different(self, others: "list[ExpectedErrors]") -> "ExpectedErrors":
        """Return the largest distance of each error from that of other positions, 0 without others."""
        rows = [np.abs(np.hstack(astuple(other)) - np.hstack(astuple(self))) for other in others]
        a, b, c, d, mismatch, size = np.max(rows, axis=0).tolist() if rows else [0.0] * 6
        return ExpectedErrors((a, b), (c, d), mismatch, size)


@dataclass(frozen=True, eq=False)
class LearntWaveform:
    """The waveform, about 0..1, of which 1 is ``v_amplitude`` of v_max; its errors; and its turns.

    ``unmeasured`` bounds the errors by what the position has above the highest frequency of a measured response, which
    is ``unmeasured_percent`` of the line, rms. ``mean`` is that of the drive over a period, of v_max; ``grown`` by
    which share the loop is larger since its turns are not even about that.
    """

    series: FourierSeries
    v_amplitude: float
    expected: ExpectedErrors
    unmeasured: ExpectedErrors
    unmeasured_percent: float
    stroke: float
    centre: float
    mean: float
    grown: float
    rounds: int


def learn_waveform(
    operator: Operator,
    target: TargetLine,
    start: FourierSeries,
    inverse: ThroughInverse,
    dynamics: Response | None,
    learn: bool = True,
) -> LearntWaveform:
    """Learn the waveform that the operator follows straight, starting from ``start``, in its harmonics.

    Without ``learn`` the waveform is ``start``, and only its amplitude is adapted. Coefficients are multiples of 2^-40.

    Raises
    ------
    Unphysical
        If it does not converge, or is larger than the driver or the operator reach.
    """
    learner = _Learner(operator, target, start.harmonics, inverse, dynamics)
    series, amplitude = start, learner.first_amplitude()
    before: Floats | None = None
    for turn in range(1, _ROUNDS + 1):
        due = amplitude
        if turn <= _FIRST_ROUNDS:  # the amplitude is not known yet, and what cannot be played teaches nothing
            amplitude = min(amplitude, learner.most_amplitude(series))
        played = learner.play(series, amplitude)
        line = learner.line_of(played.position)
        inside = played.position[learner.imaged] - line[1]
        share = 0.5 ** ((turn - 1) // _WHOLE_ROUNDS)
        settled = before is not None and learner.converged(turn, share, line[0], inside - before)
        if settled and amplitude == due:  # a line that is held at the ends of the driver settles at another size
            at = 0.5 * (played.loop.low + played.loop.high)
            expected, unmeasured = learner.expected(played.position), learner.unmeasured(played)
            stroke, mean = played.loop.high - played.loop.low, played.mean
            return LearntWaveform(
                _rounded(series),
                amplitude,
                expected,
                expected.most_different([learner.expected(played.position + by) for by in unmeasured]),
                100.0 * max((float(np.std(by)) for by in unmeasured), default=0.0) / (2.0 * target.size_nm),
                stroke,
                at,
                mean,
                played.loop.grown(mean),
                turn,
            )
        before = inside
        grown = target.size_nm / line[0]
        amplitude *= grown if share == 1.0 else 0.5 * (1.0 + grown)
        if learn:
            series = series.plus(learner.correction(played, amplitude, line, share))
    raise Unphysical(
        f"the waveform did not settle within {_ROUNDS} rounds on the operator; a smaller scan, a lower line rate or "
        "fewer harmonics may help"
    )


def size_sine(
    operator: Operator, target: TargetLine, inverse: ThroughInverse, dynamics: Response | None
) -> tuple[LearntWaveform, FourierSeries]:
    """Adapt the amplitude of a sine whose position spans the target's size from turn to turn.

    Returns
    -------
    waveform, place
        The sine, whose expected errors are 0 where the position is known; and the position, 0..1 of the size, over a
        period, in more harmonics than the drive has: the loop makes them, and creep and dynamics act on each.

    Raises
    ------
    Unphysical
        If it does not converge, or is larger than the driver or the operator reach.
    """
    series = FourierSeries(0.5, np.array([-0.5]), np.zeros(1))
    learner = _Learner(operator, target, 1, inverse, dynamics)
    amplitude = learner.first_amplitude()
    for turn in range(1, _ROUNDS + 1):
        due = amplitude
        if turn <= _FIRST_ROUNDS:
            amplitude = min(amplitude, learner.most_amplitude(series))
        played = learner.play(series, amplitude)
        extent = float(np.ptp(played.position))
        if abs(extent / target.size_nm - 1.0) < _SINE_CONVERGED and amplitude == due:
            break
        amplitude *= target.size_nm / extent
    else:
        raise Unphysical(f"the amplitude of a sine did not settle within {_ROUNDS} rounds on the operator")
    place = (played.position - float(np.min(played.position))) / extent
    unmeasured = [by / extent for by in learner.unmeasured(played)]
    stroke = played.loop.high - played.loop.low
    waveform = LearntWaveform(
        _rounded(series),
        amplitude,
        ExpectedErrors((0.0, 0.0), (0.0, 0.0), 0.0, 0.0),
        learner.displaced(place, unmeasured),
        100.0 * max((float(np.std(by)) for by in unmeasured), default=0.0) / 2.0,
        stroke,
        0.5 * (played.loop.low + played.loop.high),
        played.mean,
        played.loop.grown(played.mean),
        turn,
    )
    return waveform, _rounded(_series_of(place))


def _series_of(values: Floats) -> FourierSeries:
    """Return the first harmonics of one period on a grid."""
    times = np.arange(len(values)) / len(values)
    sines, cosines = sine_and_cosine(times)
    at = (np.arange(1, _PLACE_HARMONICS + 1)[:, None] * np.arange(len(values))) % len(values)
    a, b = (tree_sum(wave[at] * values) * (2.0 / len(values)) for wave in (cosines, sines))
    return FourierSeries(float(tree_sum(values)) / len(values), np.asarray(a), np.asarray(b))


@dataclass(frozen=True, eq=False)
class _Played:
    """One round: the drive on the grid and its mean, of v_max; the loop; where it rises; the position in nm."""

    drive: Floats
    mean: float
    loop: Loop
    rising: Bools
    position: Floats


class _Learner:
    """The data that the rounds share: the grid of times, the projection, and the operator behind its dynamics."""

    def __init__(
        self, operator: Operator, target: TargetLine, harmonics: int, inverse: ThroughInverse, dynamics: Response | None
    ) -> None:
        self._operator, self._target, self._harmonics, self._inverse = operator, target, harmonics, inverse
        self._count = max(_MIN_GRID, 1 << (_GRID_PER_HARMONIC * harmonics - 1).bit_length())
        times = np.arange(self._count) / self._count
        self._going = times <= target.turn
        self._x = np.where(self._going, times / target.turn, (1.0 - times) / (1.0 - target.turn))
        low, high = target.window
        inside = (self._x >= low) & (self._x <= high)
        self.imaged: Bools = inside & (self._going | target.both)
        self._sines, self._cosines = sine_and_cosine(times)
        f_hz = np.arange(1.0, self._count // 2) * target.rate_hz
        real, imaginary = operator.creep.response(f_hz)
        if dynamics is not None:
            r, i = dynamics.inverse(np.minimum(f_hz, dynamics.highest_hz))
            square = r * r + i * i
            real, imaginary = (real * r + imaginary * i) / square, (imaginary * r - real * i) / square
        self._real, self._imaginary = real, imaginary
        self._late = bool(np.any(real != 1.0) or np.any(imaginary != 0.0))
        self._beyond: Bools = f_hz > (np.inf if dynamics is None else dynamics.highest_hz)
        n = np.arange(1.0, harmonics + 1.0)
        k = np.arange(self._count)[self.imaged]
        at = (np.arange(1, harmonics + 1)[:, None] * k) % self._count
        # Denser towards the edges of a window, as Chebyshev's points are, or the error piles up there.
        edge = np.clip((self._x[self.imaged] - low) / (high - low), 1e-3, 1.0 - 1e-3)
        self._weight = 1.0 / np.sqrt(edge * (1.0 - edge))
        self._weight = self._weight / float(tree_sum(self._weight))
        basis = np.concatenate([np.ones((1, len(k))), self._cosines[at], self._sines[at]])
        normal = np.zeros((len(basis), len(basis)))
        for at_row, row in enumerate(basis):  # what is above the diagonal is not read
            normal[at_row, : at_row + 1] = tree_sum(basis[: at_row + 1] * (row * self._weight))
        square = n * n
        penalty = _SMOOTHNESS * np.concatenate([[0.0], square * square, square * square])
        self._basis = basis
        self._factor = Cholesky(normal + np.diag(penalty + 1e-14))

    def first_amplitude(self) -> float:
        """Return a first guess of the amplitude of this size: larger lines are more than proportionally larger."""
        target, operator = self._target, self._operator
        amplitude = target.size_nm / operator.nm_per_drive
        for _ in range(_FIRST_ROUNDS):
            stroke = min(amplitude, 1.0)
            extent = operator.expected_extent(stroke, target.centre, target.factor)
            if not extent > 0.0:
                break
            amplitude = target.size_nm * stroke / extent
        return amplitude

    def most_amplitude(self, series: FourierSeries) -> float:
        """Return the amplitude with which the drive just stays inside the driver's range."""
        wave = self._inverse(series).on_grid(self._count) - 0.5
        centre = self._target.centre
        return min((centre + _BEYOND) / -float(np.min(wave)), (1.0 - centre + _BEYOND) / float(np.max(wave)))

    def play(self, series: FourierSeries, amplitude: float) -> _Played:
        """Play a waveform on the operator.

        Raises
        ------
        Unphysical
            If the drive leaves the range of the operator.
        """
        target = self._target
        u = target.centre + amplitude * (self._inverse(series).on_grid(self._count) - 0.5)
        low, high = float(np.min(u)), float(np.max(u))
        if low < -_BEYOND or high > 1.0 + _BEYOND:
            reach = 2.0 * min(target.centre, 1.0 - target.centre)
            raise Unphysical(
                f"{target.size_nm:.6g} nm take {100.0 * (high - low):.3g} % of v_max by the operator; at this offset "
                f"{100.0 * reach:.3g} % are left; lower the size, or move the offset to the middle"
            )
        mean = float(tree_sum(u)) / self._count
        loop = self._operator.loop(low, high, target.factor * target.with_mean(mean), mean)
        bottom, top = int(np.argmin(u)), int(np.argmax(u))
        k = np.arange(self._count)
        rising = (k - bottom) % self._count < (top - bottom) % self._count
        place = np.where(rising, loop.position(u, True), loop.position(u, False))
        if self._late:
            place = filtered(place, self._real, self._imaginary)
        return _Played(u, mean, loop, rising, loop.extent_nm * place)

    def line_of(self, position: Floats) -> tuple[float, float]:
        """Fit the best common line through the windows of both directions.

        Parameters
        ----------
        position
            Positions in nm at the times of the grid, shape (count,).

        Returns
        -------
        slope, middle
            Slope in nm from x = 0 to 1, and position in nm at x = 1/2.
        """
        x, y, weight = self._x[self.imaged] - 0.5, position[self.imaged], self._weight
        mean_x, mean_y = float(tree_sum(weight * x)), float(tree_sum(weight * y))
        slope = float(tree_sum(weight * (x - mean_x) * y)) / float(tree_sum(weight * (x - mean_x) * x))
        return slope, mean_y - slope * mean_x

    def converged(self, turn: int, share: float, size_nm: float, change_nm: Floats) -> bool:
        """Return whether a round, with a share of its correction, has changed as good as nothing.

        Parameters
        ----------
        change_nm
            Changes of the position in nm at the imaged times of the grid, shape (imaged,).
        """
        most, target_nm = float(np.max(np.abs(change_nm))), self._target.size_nm
        if turn <= _LATE_ROUNDS:
            return most < _CONVERGED * target_nm
        return most < share * _LATE_CONVERGED * target_nm and abs(size_nm - target_nm) < _LATE_CONVERGED * target_nm

    def correction(self, played: _Played, amplitude: float, line: tuple[float, float], share: float) -> FourierSeries:
        """Return a share of the missing part of the waveform, projected on its harmonics."""
        imaged, loop = self.imaged, played.loop
        missing = line[0] * (self._x[imaged] - 0.5) + line[1] - played.position[imaged]
        step = (loop.high - loop.low) / (POINTS - 1) * _SLOPE_STEPS
        u, rising = played.drive[imaged], played.rising[imaged]
        ahead, behind = (
            np.where(rising, loop.position(u + by, True), loop.position(u + by, False)) for by in (step, -step)
        )
        slope = loop.extent_nm * (ahead - behind) / (2.0 * step) * amplitude  # nm for 1 of w
        right = tree_sum(self._basis * (missing / slope * self._weight))
        c = share * self._factor.solve(right)
        return FourierSeries(0.0, c[1 : self._harmonics + 1], c[self._harmonics + 1 :])

    def expected(self, position: Floats) -> ExpectedErrors:
        """Return the errors of a position; fast sums will do, since no emitted word depends on them.

        Parameters
        ----------
        position
            Positions in nm at the times of the grid, shape (count,).

        Returns
        -------
        ExpectedErrors
            In percent of the line.
        """
        slope, middle = self.line_of(position)
        error = 100.0 * ((position - middle) / slope - (self._x - 0.5))
        grid = np.linspace(*self._target.window, 401)
        sides = []
        for going in (self._going, ~self._going):
            order = np.argsort(self._x[going])
            sides.append(np.interp(grid, self._x[going][order], error[going][order]))
        step = max(1, min(round(CHORD / (grid[1] - grid[0])), 400))
        scaling = [float(np.ptp((one[step:] - one[:-step]) / (grid[step] - grid[0]))) for one in sides]
        rms = [float(np.sqrt(np.mean(one * one))) for one in sides]
        mismatch = float(np.max(np.abs(sides[0] - sides[1])))
        return ExpectedErrors(
            (rms[0], rms[1]), (scaling[0], scaling[1]), mismatch, 100.0 * (slope / self._target.size_nm - 1.0)
        )

    def displaced(self, place: Floats, others: list[Floats]) -> ExpectedErrors:
        """Return the largest errors of a sine's image where the position is other than ``place``, in percent.

        Parameters
        ----------
        place
            Positions that the pixels are taken at, 0..1 of the line, at the times of the grid, shape (count,).
        others
            Displacements in the same unit and shape; errors are 0 without any.
        """
        rows = []
        grid = np.linspace(*self._target.window, 401)
        step = max(1, min(round(CHORD / (grid[1] - grid[0])), 400))
        for other in others:
            sides = []
            for going in (self._going, ~self._going):
                order = np.argsort(place[going], kind="stable")
                sides.append(100.0 * np.interp(grid, place[going][order], other[going][order]))
            rms = [float(np.std(one)) for one in sides]
            scaling = [float(np.ptp((one[step:] - one[:-step]) / (grid[step] - grid[0]))) for one in sides]
            rows.append([*rms, *scaling, float(np.max(np.abs(sides[0] - sides[1]))), float(np.ptp(other)) * 100.0])
        a, b, c, d, mismatch, size = np.max(rows, axis=0).tolist() if rows else [0.0] * 6
        return ExpectedErrors((a, b), (c, d), mismatch, size)

    def unmeasured(self, played: _Played) -> list[Floats]:
        """Return what the position may differ by, in nm, since the response is not measured at its highest harmonics.

        These act as at the last frequency that was measured. They may have any phase; a gain that is larger than there
        is another resonance, which nothing tells.
        """
        if not np.any(self._beyond):
            return []
        none = np.zeros(len(self._beyond))
        size = played.position - np.mean(played.position)
        content, quarter = (
            filtered(size, np.where(self._beyond, re, 0.0), np.where(self._beyond, im, 0.0))
            for re, im in ((none + 1.0, none), (none, none + 1.0))
        )
        return [-2.0 * content, quarter - content, -quarter - content]


def _rounded(series: FourierSeries) -> FourierSeries:
    a, b = (np.rint(values * _ROUNDING) / _ROUNDING for values in (series.a, series.b))
    return FourierSeries(round(series.a0 * _ROUNDING) / _ROUNDING, a, b)
