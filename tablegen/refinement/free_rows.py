"""A periodic sample in trace and retrace of a nearly straight scan: the position of each column, with free rows.

height(row i, column j, direction d) = sum over spots of Re(A exp(2 pi i n . phase)) + a parabola in each row

phase_b = a_b(i) + q_b x_d(j) + r_b(i) t_d(j)

a_b(i), a phase of every wave b in every row, is free: it contains drift of any kind, jumps and the slow axis. r_b is
its growth within a line, t_d the time in the line. x_d is the requested position plus an error, a polynomial along the
window. The fit is least squares over all pixels by Gauss-Newton; rows are eliminated one by one, so that a step is
cheap.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from math import pi

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.images.periodic_model import Complexes, Geometry
from tablegen.numerics.arrays import Floats, Ints

_MAX_STEPS = 25
_HALVINGS = 6
_SETTLED = 1e-6  # of the line: convergence is a step that moves no column by more
_PACE_ORDER = 5  # order of the polynomial in the rows from which the growth of phases in a line comes
_CHUNK_VALUES = 1 << 22  # values of the derivatives that are evaluated at a time
_LOUD_ROWS = 3.0  # times the median rms residual of a row; rows above it weigh less
_RCOND = 1e-11
_MISSING_WEIGHT = 1e-6  # of a missing row's phase, where others have 1


@dataclass(frozen=True, eq=False)
class ColumnModes:
    """Modes of the position error, shape (modes, 2 columns), trace then retrace, as shares of the line."""

    values: Floats
    requested: Floats  # (2 columns,), of the line
    time: Floats  # (2 columns,), of the line's period, from its middle


@dataclass(frozen=True, eq=False)
class RowPhases:
    """Phases of each row in the middle of its line, (rows, waves), in periods; covariances (rows, waves, waves)."""

    phase: Floats
    covariance: Floats


@dataclass(frozen=True, eq=False)
class FreeRowsState:
    """Parameters of the fit.

    ``modes`` are the error's coefficients (modes,), ``q`` the periods in the whole line of each wave (waves,),
    ``amplitudes`` those of the spots (spots,).
    """

    modes: Floats
    q: Floats
    amplitudes: Complexes
    rows: Floats  # (rows, waves)


@dataclass(frozen=True, eq=False)
class FreeRowsFit:
    """Least-squares fit of free rows.

    ``covariance`` is of (modes, q), from each row by itself, so that noise may have any spectrum along a line.

    ``lags`` are the shares of ``r_b`` that the images show, each with its standard error: from trace to retrace, and
    along the line. Both are 1 where rows and columns are in the order of time. ``residuals`` of the two images, of unit
    variance; ``explained`` share of each image's variance; ``loud`` are rows unlike the others, counted from 0.
    """

    state: FreeRowsState
    covariance: Floats
    phases: RowPhases
    lags: tuple[tuple[float, float], tuple[float, float]]
    residuals: tuple[Floats, Floats]
    explained: tuple[float, float]
    loud: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class _Chunk:
    """A block of rows: derivatives by the free parameters and by the rows' phases, and the residual; levelled."""

    rows: slice
    derivatives: Floats  # (rows, 2 columns, parameters)
    across: Floats  # (rows, 2 columns, waves)
    residual: Floats  # (rows, 2 columns)


class FreeRows:
    """The model of levelled images of one shape, trace then retrace; ``spots`` are rows of whole numbers, one per wave.

    ``moves`` is true if the slow axis moves within a line, false if it steps between lines.
    """

    def __init__(
        self, geometry: Geometry, heights: list[Floats], spots: Ints, modes: ColumnModes, moves: bool = True
    ) -> None:
        self.geometry, self.spots, self.modes, self.moves = geometry, spots, modes, moves
        self.heights = np.concatenate(heights, axis=1)
        self._centre = float(np.mean(modes.requested))

    def fit(self, start: FreeRowsState) -> FreeRowsFit:
        """Fit from a start within a fraction of a period.

        Raises
        ------
        Unphysical
            If the fit does not converge.
        """
        state = start
        weights = self._row_weight()
        cost = self._cost(state, weights)
        for step in range(_MAX_STEPS):
            solved, moves = self._solved(state, weights)
            size = 1.0
            for _ in range(_HALVINGS):
                trial = self._stepped(state, solved, moves, size)
                now = self._cost(trial, weights)
                if now <= cost * (1.0 + 1e-9):
                    break
                size *= 0.5
            else:
                break
            largest_shift = float(np.max(np.abs((trial.modes - state.modes) @ self.modes.values), initial=0.0))
            state = trial
            if step == 1:  # once the start is behind it
                weights = self._weights(state)
                now = self._cost(state, weights)
            cost = now
            if largest_shift < _SETTLED and step > 2:
                break
        else:
            raise Unphysical("the fit does not converge; is the sample periodic, and are the images from one scan?")
        return self._result(state, weights)

    def _row_weight(self) -> Floats:
        weight = self.geometry.row_weight
        return np.ones(self.geometry.rows) if weight is None else weight.copy()

    def _certainty(self) -> Floats:
        """Return 1, and next to nothing for a missing row, whose phase is that of its neighbours."""
        return np.maximum(self._row_weight(), _MISSING_WEIGHT)

    def positions(self, state: FreeRowsState) -> Floats:
        """Return the position of all columns, trace then retrace.

        Returns
        -------
        Positions in lines, shape (2 columns,).
        """
        return np.asarray(self.modes.requested + state.modes @ self.modes.values, dtype=np.float64)

    def _count(self, state: FreeRowsState) -> int:
        return len(state.modes) + len(state.q) + 2 * len(state.amplitudes)

    def _times(self) -> Floats:
        """Return the mean time of each direction, and the distance of each column from it, (2 columns, 2)."""
        mean = np.repeat([np.mean(half) for half in np.split(self.modes.time, 2)], self.geometry.columns)
        return np.column_stack([mean, self.modes.time - mean])

    def _pace(self, rows: Floats) -> Floats:
        """Return the growth of the phases in a line, (rows, waves)."""
        if not self.moves:
            return np.zeros_like(rows)
        y = self.geometry.y
        fitted = np.polynomial.polynomial.polyfit(y, rows, min(_PACE_ORDER, len(y) - 1))
        steps = np.polynomial.polynomial.polyval(y, np.polynomial.polynomial.polyder(fitted)).T
        return np.asarray(steps / self.geometry.rows, dtype=np.float64)

    def _waves(self, state: FreeRowsState, rows: slice, pace: Floats) -> Complexes:
        """Return the waves at every pixel, (spots, rows, 2 columns)."""
        x = self.positions(state) - self._centre
        phase = state.rows[rows, None, :] + x[:, None] * state.q + pace[rows, None, :] * self.modes.time[:, None]
        waves: Complexes = np.exp(2j * pi * np.moveaxis(phase @ self.spots.T, -1, 0))
        return waves

    def _drawn(self, state: FreeRowsState, rows: slice, pace: Floats) -> Floats:
        waves = self._waves(state, rows, pace)
        return self._levelled(np.real(np.tensordot(state.amplitudes, waves, 1)))

    def _levelled(self, values: Floats) -> Floats:
        """Subtract from (rows, 2 columns, ...) the parabola of each row and direction."""
        parabola = self.geometry.parabola
        halves = []
        for half in np.split(values, 2, axis=1):
            if half.ndim == 2:
                halves.append(half - (half @ parabola) @ parabola.T)
            else:
                halves.append(half - parabola @ (parabola.T @ half))
        levelled_values: Floats = np.concatenate(halves, axis=1)
        return levelled_values

    def _chunks(self, state: FreeRowsState, lag: bool = False) -> Iterator[_Chunk]:
        """Yield blocks of rows; with ``lag`` the last two derivatives are by factors of the growth in a line."""
        step = max(_CHUNK_VALUES // (self.heights.shape[1] * self._count(state)), 1)
        pace = self._pace(state.rows)
        x = self.positions(state) - self._centre
        for first in range(0, self.geometry.rows, step):
            rows = slice(first, min(first + step, self.geometry.rows))
            waves = self._waves(state, rows, pace)
            slopes = np.stack(
                [
                    np.real(np.tensordot(2j * pi * state.amplitudes * self.spots[:, b], waves, 1))
                    for b in range(self.spots.shape[1])
                ],
                axis=-1,
            )  # (rows, 2 columns, waves)
            steep = slopes @ state.q
            parts: list[Floats] = [steep[:, :, None] * self.modes.values.T, slopes * x[:, None]]
            parts += [np.moveaxis(np.real(waves), 0, -1), np.moveaxis(-np.imag(waves), 0, -1)]
            if lag:
                parts.append(np.sum(slopes * pace[rows, None, :], axis=-1, keepdims=True) * self._times())
            residual = self.heights[rows] - self._levelled(np.real(np.tensordot(state.amplitudes, waves, 1)))
            derivatives = self._levelled(np.concatenate(parts, axis=-1))
            yield _Chunk(rows, derivatives, self._levelled(slopes), residual)

    def _solved(self, state: FreeRowsState, weights: Floats) -> tuple[Floats, Callable[[Floats], Floats]]:
        """Return the step of the parameters, and the function from a step to the rows' phases."""
        count = self._count(state)
        normal, right, blocks = np.zeros((count, count)), np.zeros(count), []
        for chunk in self._chunks(state):
            weight = weights[chunk.rows]
            basis, triangle = np.linalg.qr(chunk.across)
            on_rows = np.swapaxes(basis, 1, 2) @ chunk.derivatives
            projections = (np.swapaxes(basis, 1, 2) @ chunk.residual[:, :, None])[:, :, 0]
            free = chunk.derivatives - basis @ on_rows
            flat = (np.sqrt(weight)[:, None, None] * free).reshape(-1, free.shape[-1])
            normal += flat.T @ flat
            right += np.einsum("i,ijp,ij->p", weight, free, chunk.residual, optimize=True)
            blocks.append((_inverted(triangle), on_rows, projections))
        step = _pseudo_inverse(normal) @ right

        def row_step(applied: Floats) -> Floats:
            return np.concatenate(
                [(back @ (projections - on @ applied)[:, :, None])[:, :, 0] for back, on, projections in blocks]
            )

        return step, row_step

    def _stepped(
        self, state: FreeRowsState, step: Floats, rows: Callable[[Floats], Floats], size: float
    ) -> FreeRowsState:
        modes, waves, spots = len(state.modes), len(state.q), len(state.amplitudes)
        applied = size * step
        a = applied[modes + waves :]
        return replace(
            state,
            modes=state.modes + applied[:modes],
            q=state.q + applied[modes : modes + waves],
            amplitudes=state.amplitudes + a[:spots] + 1j * a[spots:],
            rows=self.geometry.bridged(state.rows + size * rows(step)),
        )

    def _left(self, state: FreeRowsState) -> Floats:
        pace = self._pace(state.rows)
        return self.geometry.weighted(self.heights - self._drawn(state, slice(None), pace))

    def _cost(self, state: FreeRowsState, weights: Floats) -> float:
        return float(weights @ np.sum(self._left(state) ** 2, axis=1))

    def _weights(self, state: FreeRowsState) -> Floats:
        """Return 1, and less where a row has a far larger residual than the others."""
        power = np.sqrt(np.mean(self._left(state) ** 2, axis=1))
        there = self._row_weight()
        usual = _LOUD_ROWS * float(np.median(power[there > 0.0]))
        weights: Floats = (
            np.minimum(1.0, (usual / np.maximum(power, 1e-300)) ** 2) if usual > 0.0 else np.ones(len(power))
        )
        return weights * there

    def _result(self, state: FreeRowsState, weights: Floats) -> FreeRowsFit:
        count, whole = len(state.modes) + len(state.q), np.zeros((self._count(state) + 2,) * 2)
        scores, inverses = [], []
        for chunk in self._chunks(state, lag=True):
            basis, triangle = np.linalg.qr(chunk.across)
            free = chunk.derivatives - basis @ (np.swapaxes(basis, 1, 2) @ chunk.derivatives)
            weight = weights[chunk.rows]
            flat = (np.sqrt(weight)[:, None, None] * free).reshape(-1, free.shape[-1])
            whole += flat.T @ flat
            scores.append(weight[:, None] * np.einsum("ijp,ij->ip", free, chunk.residual, optimize=True))
            back = _inverted(triangle)
            inverses.append(back @ np.swapaxes(back, 1, 2))
        by_row = np.concatenate(scores)
        # Without the lags, which are 1; then with them, to see whether they are.
        covariance = _spread(by_row[:, :-2] @ _pseudo_inverse(whole[:-2, :-2])[:, :count], len(whole))
        late = by_row @ _pseudo_inverse(whole)[:, -2:]
        errors = np.sqrt(np.diag(_spread(late, len(whole)))).tolist()
        first, second = zip((1.0 + np.sum(late, axis=0)).tolist(), errors, strict=True)
        residual = self._left(state)
        images = np.split(self.heights, 2, axis=1)
        both = np.split(residual, 2, axis=1)
        noise = float(np.mean(residual**2))
        explained = [
            1.0 - float(np.mean(one**2)) / float(np.mean(image**2)) for image, one in zip(images, both, strict=True)
        ]
        return FreeRowsFit(
            state=state,
            covariance=covariance,
            phases=RowPhases(state.rows, noise * np.concatenate(inverses) / self._certainty()[:, None, None]),
            lags=(first, second),
            residuals=(both[0], both[1]),
            explained=(explained[0], explained[1]),
            loud=tuple((np.flatnonzero((weights < 1.0) & (weights > 0.0)) + self.geometry.part.first_row).tolist()),
        )


def _spread(influence: Floats, parameters: int) -> Floats:
    """Return the covariance of the parameters from each row by itself."""
    rows = len(influence)
    centred = influence - np.mean(influence, axis=0)
    return np.asarray(centred.T @ centred * (rows / max(rows - 0.5 * parameters, 1.0)), dtype=np.float64)


def _pseudo_inverse(normal: Floats) -> Floats:
    """Invert a matrix of positive scale; directions that nothing determines do not change."""
    scale = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    both = np.outer(scale, scale)
    return np.asarray(np.linalg.pinv(normal / both, rcond=_RCOND, hermitian=True) / both, dtype=np.float64)


def _inverted(triangles: Floats) -> Floats:
    """Invert the triangle of each row; the part of a wave without contrast becomes 0."""
    return np.asarray(np.linalg.pinv(triangles, rcond=1e-6), dtype=np.float64)
