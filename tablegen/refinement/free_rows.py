"""A periodic sample in trace and retrace of a nearly straight scan: where each column was, whatever the rows do.

height(row i, column j, direction d) = sum over spots of Re(A exp(2 pi i n . phase)) + a parabola in each row

phase_b = a_b(i) + q_b x_d(j) + r_b(i) t_d(j)

a_b(i), a phase of every wave b in every row, is free: drift of any kind, jumps and the slow axis are in it. r_b is by
how much it goes on in a line, t_d the time in the line. x_d is what was asked for plus an error, a polynomial along the
window. Least squares over all pixels, by Gauss and Newton; rows are eliminated one by one, so that a step costs little.
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
_SETTLED = 1e-6  # of the line: a step that moves no column by more
_PACE_ORDER = 5  # order of the polynomial in the rows by which phases go on in a line
_CHUNK_VALUES = 1 << 22  # values of the derivatives that are worked out at a time
_LOUD_ROWS = 3.0  # times the usual rms of what a row leaves; louder ones count less
_RCOND = 1e-11


@dataclass(frozen=True, eq=False)
class ColumnModes:
    """What the error of the position can be: (modes, 2 columns), trace then retrace, of the line."""

    values: Floats
    asked: Floats  # (2 columns,), of the line
    time: Floats  # (2 columns,), of the line's period, from its middle


@dataclass(frozen=True, eq=False)
class RowPhases:
    """Of each row in the middle of its line, (rows, waves), in periods, and covariances (rows, waves, waves)."""

    phase: Floats
    covariance: Floats


@dataclass(frozen=True, eq=False)
class FreeRowsState:
    """``modes`` are the error's coefficients, ``q`` periods in the whole line of each wave, ``amplitudes`` of spots."""

    modes: Floats
    q: Floats
    amplitudes: Complexes
    rows: Floats  # (rows, waves)


@dataclass(frozen=True, eq=False)
class FreeRowsFit:
    """Least-squares fit of free rows.

    ``covariance`` is of (modes, q), from each row by itself, so that noise may have any spectrum along a line.

    ``lags`` are how much of ``r_b`` the images show, each with its standard error: from trace to retrace, and along the
    line. Both are 1 where rows and columns are in the order of time. ``left`` of the images, of unit variance;
    ``explained`` share of each image's variance; ``loud`` are rows unlike the others, counted from 0.
    """

    state: FreeRowsState
    covariance: Floats
    phases: RowPhases
    lags: tuple[tuple[float, float], tuple[float, float]]
    left: tuple[Floats, Floats]
    explained: tuple[float, float]
    loud: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class _Chunk:
    """Rows at a time: derivatives by the free parameters, by the rows' phases, and what is left; levelled."""

    rows: slice
    derivatives: Floats  # (rows, 2 columns, parameters)
    across: Floats  # (rows, 2 columns, waves)
    left: Floats  # (rows, 2 columns)


class FreeRows:
    """Levelled images of one shape, trace then retrace, and the spots: rows of whole numbers, one a wave.

    ``moves`` is whether the slow axis goes on within a line, or steps between lines.
    """

    def __init__(
        self, geometry: Geometry, heights: list[Floats], spots: Ints, modes: ColumnModes, moves: bool = True
    ) -> None:
        self.geometry, self.spots, self.modes, self.moves = geometry, spots, modes, moves
        self.heights = np.concatenate(heights, axis=1)
        self._centre = float(np.mean(modes.asked))

    def fit(self, start: FreeRowsState) -> FreeRowsFit:
        """Fit from a start within a fraction of a period.

        Raises
        ------
        Unphysical
            If the fit does not converge.
        """
        state = start
        weights = np.ones(self.geometry.rows)
        cost = self._cost(state, weights)
        for step in range(_MAX_STEPS):
            solved, moves = self._solved(state, weights)
            size = 1.0
            for _ in range(_HALVINGS):
                tried = self._moved(state, solved, moves, size)
                now = self._cost(tried, weights)
                if now <= cost * (1.0 + 1e-9):
                    break
                size *= 0.5
            else:
                break
            moved = float(np.max(np.abs((tried.modes - state.modes) @ self.modes.values), initial=0.0))
            state = tried
            if step == 1:  # once the start is behind it
                weights = self._weights(state)
                now = self._cost(state, weights)
            cost = now
            if moved < _SETTLED and step > 2:
                break
        else:
            raise Unphysical("the fit does not converge; is the sample periodic, and are the images from one scan?")
        return self._result(state, weights)

    def positions(self, state: FreeRowsState) -> Floats:
        """Of all columns, trace then retrace, in lines."""
        return np.asarray(self.modes.asked + state.modes @ self.modes.values, dtype=np.float64)

    def _count(self, state: FreeRowsState) -> int:
        return len(state.modes) + len(state.q) + 2 * len(state.amplitudes)

    def _times(self) -> Floats:
        """(2 columns, 2): the mean time of each direction, and how far a column's is from it."""
        mean = np.repeat([np.mean(half) for half in np.split(self.modes.time, 2)], self.geometry.columns)
        return np.column_stack([mean, self.modes.time - mean])

    def _pace(self, rows: Floats) -> Floats:
        """(rows, waves): by how much phases go on in a line."""
        if not self.moves:
            return np.zeros_like(rows)
        y = self.geometry.y
        fitted = np.polynomial.polynomial.polyfit(y, rows, min(_PACE_ORDER, len(y) - 1))
        steps = np.polynomial.polynomial.polyval(y, np.polynomial.polynomial.polyder(fitted)).T
        return np.asarray(steps / self.geometry.rows, dtype=np.float64)

    def _waves(self, state: FreeRowsState, rows: slice, pace: Floats) -> Complexes:
        """(spots, rows, 2 columns)."""
        x = self.positions(state) - self._centre
        phase = state.rows[rows, None, :] + x[:, None] * state.q + pace[rows, None, :] * self.modes.time[:, None]
        waves: Complexes = np.exp(2j * pi * np.moveaxis(phase @ self.spots.T, -1, 0))
        return waves

    def _drawn(self, state: FreeRowsState, rows: slice, pace: Floats) -> Floats:
        waves = self._waves(state, rows, pace)
        return self._levelled(np.real(np.tensordot(state.amplitudes, waves, 1)))

    def _levelled(self, values: Floats) -> Floats:
        """Of (rows, 2 columns, ...): each direction less its rows' parabolas."""
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
        """With ``lag`` the last two derivatives are those by factors of what goes on in a line."""
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
            seen = (np.swapaxes(basis, 1, 2) @ chunk.left[:, :, None])[:, :, 0]
            free = chunk.derivatives - basis @ on_rows
            flat = (np.sqrt(weight)[:, None, None] * free).reshape(-1, free.shape[-1])
            normal += flat.T @ flat
            right += np.einsum("i,ijp,ij->p", weight, free, chunk.left, optimize=True)
            blocks.append((_inverted(triangle), on_rows, seen))
        step = _pseudo_inverse(normal) @ right

        def of_rows(applied: Floats) -> Floats:
            return np.concatenate([(back @ (seen - on @ applied)[:, :, None])[:, :, 0] for back, on, seen in blocks])

        return step, of_rows

    def _moved(
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
            rows=state.rows + size * rows(step),
        )

    def _left(self, state: FreeRowsState) -> Floats:
        pace = self._pace(state.rows)
        return self.heights - self._drawn(state, slice(None), pace)

    def _cost(self, state: FreeRowsState, weights: Floats) -> float:
        return float(weights @ np.sum(self._left(state) ** 2, axis=1))

    def _weights(self, state: FreeRowsState) -> Floats:
        """1, and less where a row leaves far more than the others."""
        power = np.sqrt(np.mean(self._left(state) ** 2, axis=1))
        usual = _LOUD_ROWS * float(np.median(power))
        weights: Floats = (
            np.minimum(1.0, (usual / np.maximum(power, 1e-300)) ** 2) if usual > 0.0 else np.ones(len(power))
        )
        return weights

    def _result(self, state: FreeRowsState, weights: Floats) -> FreeRowsFit:
        count, whole = len(state.modes) + len(state.q), np.zeros((self._count(state) + 2,) * 2)
        scores, inverses = [], []
        for chunk in self._chunks(state, lag=True):
            basis, triangle = np.linalg.qr(chunk.across)
            free = chunk.derivatives - basis @ (np.swapaxes(basis, 1, 2) @ chunk.derivatives)
            weight = weights[chunk.rows]
            flat = (np.sqrt(weight)[:, None, None] * free).reshape(-1, free.shape[-1])
            whole += flat.T @ flat
            scores.append(weight[:, None] * np.einsum("ijp,ij->ip", free, chunk.left, optimize=True))
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
            phases=RowPhases(state.rows, noise * np.concatenate(inverses)),
            lags=(first, second),
            left=(both[0], both[1]),
            explained=(explained[0], explained[1]),
            loud=tuple(np.flatnonzero(weights < 1.0).tolist()),
        )


def _spread(influence: Floats, parameters: int) -> Floats:
    """Return the covariance of the parameters from each row by itself."""
    rows = len(influence)
    centred = influence - np.mean(influence, axis=0)
    return np.asarray(centred.T @ centred * (rows / max(rows - 0.5 * parameters, 1.0)), dtype=np.float64)


def _pseudo_inverse(normal: Floats) -> Floats:
    """Of a matrix of positive scale: what nothing determines is left alone."""
    scale = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    both = np.outer(scale, scale)
    return np.asarray(np.linalg.pinv(normal / both, rcond=_RCOND, hermitian=True) / both, dtype=np.float64)


def _inverted(triangles: Floats) -> Floats:
    """Of each row; of one in which a wave has no contrast, nothing."""
    return np.asarray(np.linalg.pinv(triangles, rcond=1e-6), dtype=np.float64)
