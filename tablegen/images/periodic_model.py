"""Model of a periodic sample on both sweeps: least squares that share one sample and both branches of the hysteresis.

height = sum over spots of Re(A exp(i phase)) + a parabola in each row
phase / 2 pi = q x + s_1 y + s_2 y^2 + ...

x is where the branch has the piezo at a pixel. Rows are levelled, model and data alike, since most images are. A
spot's phase is a row's part plus a column's, so that sums over pixels are products of two short ones, and a step of
the fit costs little more than one multiplication of the image.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import pi

import numpy as np
import numpy.typing as npt

from tablegen.base.input_errors import Unphysical
from tablegen.compensation.hysteresis import BranchShape
from tablegen.images.missing import Number, interpolated_rows
from tablegen.numerics.arrays import Bools, Floats, Ints

Complexes = npt.NDArray[np.complex128]

LAG, BASES = 4, 5  # indices of parameters; the coordinates of both branches come before them
_COLUMN_TERMS = 5  # 1, x, and x by both coordinates; the time within the line; ripples follow
_MIN_BRANCH_SLOPE = 0.05  # least du/dtau of a trial branch
_ROW_PARABOLA_TERMS = 3  # terms of a row's parabola
_MAX_STEPS = 100
_LEAST_PERIODS = 1.0  # in the line, of a wave that the parabola of a row cannot follow


@dataclass(frozen=True)
class FramePart:
    """The part of a frame whose other rows are missing: its first row, and all rows of the frame over its own."""

    first_row: int = 0
    times: float = 1.0


@dataclass(frozen=True, eq=False)
class Geometry:
    """Layout of the images: rows and columns, the turn, the window of each sweep that the columns span.

    Columns show the sample ``delay`` columns late. ``row_weight`` is 0 for a missing row and 1 for others, shape
    (rows,); None if none is missing. ``part`` says which rows of the frame these are.
    """

    rows: int
    columns: int
    turn: float = 0.5
    window: tuple[float, float] = (0.0, 1.0)
    delay: float = 0.0
    row_weight: Floats | None = None
    part: FramePart = FramePart()

    @property
    def lines(self) -> int:
        """The number of rows with data."""
        return self.rows if self.row_weight is None else int(np.sum(self.row_weight))

    def weighted(self, heights: Floats) -> Floats:
        """Return heights, shape (rows, columns), with 0 in missing rows."""
        return heights if self.row_weight is None else heights * self.row_weight[:, None]

    def bridged(self, values: npt.NDArray[Number]) -> npt.NDArray[Number]:
        """Interpolate values of the rows, shape (rows, n), over missing rows."""
        return values if self.row_weight is None else interpolated_rows(values, self.row_weight > 0.0)

    @cached_property
    def place(self) -> Floats:
        """Normalised drive in the middle of each column, on the way up; 0 is left.

        Returns
        -------
        Floats
            Shape (columns,).
        """
        low, high = self.window
        return low + (high - low) * (np.arange(self.columns) + 0.5) / self.columns

    @cached_property
    def y(self) -> Floats:
        """Position of each row in the frame.

        Returns
        -------
        Floats
            -1/2..1/2, shape (rows,).
        """
        return (np.arange(self.rows) + 0.5) / self.rows - 0.5

    @cached_property
    def parabola(self) -> Floats:
        """Orthonormal parabolas along a row.

        Returns
        -------
        Floats
            Shape (columns, 3).
        """
        return np.linalg.qr(np.vander(self.place - np.mean(self.place), _ROW_PARABOLA_TERMS))[0]

    def levelled(self, rows: npt.NDArray[np.inexact]) -> npt.NDArray[np.inexact]:
        """Subtract each row's parabola.

        Parameters
        ----------
        rows
            Heights in any unit, shape (..., columns).

        Returns
        -------
        numpy.ndarray
            Levelled heights of the same shape and unit.
        """
        return rows - (rows @ self.parabola) @ self.parabola.T

    def sweep(self, forward: bool) -> Floats:
        """Return the drive along the sweep that each column shows.

        Returns
        -------
        Floats
            0..1 from the start of the sweep, shape (columns,).
        """
        low, high = self.window
        way = self.place if forward else 1.0 - self.place
        return np.clip(way - self.delay * (high - low) / self.columns, 0.0, 1.0)


@dataclass(frozen=True, eq=False)
class Columns:
    """One direction: positions ``x``, their derivatives ``slopes`` by the branch's coordinates, the time in the line.

    Arrays have a value for each column; ``steep`` is dx/du.
    """

    x: Floats
    slopes: Floats  # (2, columns)
    time: Floats
    steep: Floats

    @classmethod
    def of(cls, geometry: Geometry, forward: bool, shape: Floats) -> "Columns":
        """Return the columns of one direction for a branch.

        Parameters
        ----------
        shape
            Coordinates of the branch, shape (2,).
        """
        branch = BranchShape.at(shape)
        u = geometry.sweep(forward)
        tau = branch.inverse(u)
        steep = 1.0 / branch.slope(tau)
        slopes = -np.stack(BranchShape.basis(tau)) * steep
        if forward:
            return cls(tau, slopes, geometry.turn * u - 0.5, steep)
        return cls(1.0 - tau, -slopes, geometry.turn + (1.0 - geometry.turn) * u - 0.5, steep)


@dataclass(frozen=True, eq=False)
class FitState:
    """The model at some parameters: ``amplitudes`` of the spots, residuals of each image, half their sum of squares.

    ``hessian`` and ``scores`` (of each row, both images together) are of all parameters, then of the real and the
    imaginary parts of the amplitudes.
    """

    parameters: Floats
    amplitudes: Complexes
    residuals: tuple[Floats, ...]
    steepness: tuple[Floats, ...]  # d height / dx of each image, levelled
    cost: float
    hessian: Floats
    scores: Floats


class PeriodicModel:
    """Levelled images, forward or backward each, and the spots: rows of whole numbers, one a base vector.

    ``order`` is that of the polynomial in y; ``off`` what is added to x, forward and backward: where it is known that
    the branches are not (17), so that phases stay within a small part of a period. ``row_off``, (bases, rows), is what
    is added to the polynomials, in periods. Parameters are the coordinates of the branch forward, then backward, the
    lag of y within the line (1 where y is a ramp, 0 where it steps), then of each base vector q and s_1, s_2, ...,
    then how much of each of ``ripples`` is added to x, forward and backward: rows of (count, columns) each, for
    branches that are not (17).
    """

    def __init__(
        self,
        geometry: Geometry,
        images: Sequence[tuple[bool, Floats]],
        spots: Sequence[tuple[int, ...]],
        order: int,
        off: tuple[Floats, Floats],
        ripples: tuple[Floats, Floats] | None = None,
        row_off: Floats | None = None,
    ) -> None:
        self.geometry, self.order, self.off = geometry, order, off
        nothing = np.zeros((0, geometry.columns))
        self.ripples = (nothing, nothing) if ripples is None else ripples
        self.images = tuple(images)
        self.spots: Ints = np.array(spots, dtype=np.int64)
        self.bases = self.spots.shape[1]
        self.row_off = np.zeros((self.bases, geometry.rows)) if row_off is None else row_off
        self.y_powers = geometry.y ** np.arange(order + 1)[:, None]
        self.rippled_from = BASES + self.bases * (order + 1)  # the first parameter of the ripples

    def q(self, parameters: Floats) -> Floats:
        """Return the periods in the line of each base vector.

        Parameters
        ----------
        parameters
            Shape (parameters,).

        Returns
        -------
        Floats
            Shape (bases,).
        """
        return parameters[BASES : self.rippled_from : self.order + 1]

    def s(self, parameters: Floats) -> Floats:
        """Return the coefficients s_1, s_2, ... of each base vector's polynomial in y.

        Parameters
        ----------
        parameters
            Shape (parameters,).

        Returns
        -------
        Floats
            In periods, shape (bases, order).
        """
        return parameters[BASES : self.rippled_from].reshape(self.bases, self.order + 1)[:, 1:]

    def allowed(self, parameters: Floats) -> bool:
        """Return True if both branches run forward.

        Parameters
        ----------
        parameters
            Shape (parameters,).
        """
        return all(BranchShape.at(parameters[i : i + 2]).least_slope() > _MIN_BRANCH_SLOPE for i in (0, 2))

    def at(self, parameters: Floats) -> FitState:
        """Evaluate the model at these parameters, with the amplitudes that fit best.

        Parameters
        ----------
        parameters
            Shape (parameters,).
        """
        count = len(self.spots)
        rows = self._rows(parameters)
        columns = [self._columns(parameters, forward) for forward, _ in self.images]
        # Amplitudes: of term (0, 0) of each spot, real and imaginary.
        plain = np.concatenate([np.eye(count), 1j * np.eye(count)])
        matrix, aim = np.zeros((2 * count, 2 * count)), np.zeros(2 * count)
        for (_, heights), column in zip(self.images, columns, strict=True):
            r, c = rows[0], column[0]
            matrix += _gram(plain, _products(r, c))
            aim += np.real(plain @ np.sum(r * _with_real(c, heights.T), axis=1))
        solved = np.linalg.lstsq(matrix, aim, rcond=1e-12)[0]
        amplitudes = solved[:count] + 1j * solved[count:]
        terms = self._terms(parameters, amplitudes)
        hessian = np.zeros((terms[0].shape[0],) * 2)
        scores = np.zeros((self.geometry.rows, len(hessian)))
        residuals, steepness = [], []
        for (forward, heights), column in zip(self.images, columns, strict=True):
            coefficients = terms[0] if forward else terms[1]
            residuals.append(heights - _real_product(rows[0].T * amplitudes, column[0]))
            waves = 2j * pi * (self.spots @ self.q(parameters))
            steepness.append(_real_product(rows[0].T * (amplitudes * waves), column[0]))
            r, c, places = self._laid_out(rows, column)
            first, second = _products(r, c, places)
            hessian += _gram(coefficients, (first, second))
            scores += _scores(coefficients, (r, c, places), residuals[-1])
        cost = 0.5 * sum(float(np.vdot(image, image)) for image in residuals)
        return FitState(parameters, amplitudes, tuple(residuals), tuple(steepness), cost, hessian, scores)

    def columns(self, parameters: Floats, forward: bool) -> Columns:
        """Return the columns of a direction, with ``off`` and ripples in their positions.

        Parameters
        ----------
        parameters
            Shape (parameters,).
        """
        i = 0 if forward else 2
        column = Columns.of(self.geometry, forward, parameters[i : i + 2])
        at = 0 if forward else 1
        more = parameters[self.rippled_from :].reshape(2, -1)[at] @ self.ripples[at]
        return replace(column, x=column.x + self.off[at] + more)

    def with_spots(self, spots: Sequence[tuple[int, ...]]) -> "PeriodicModel":
        """Return the same model with other spots."""
        return PeriodicModel(self.geometry, self.images, spots, self.order, self.off, self.ripples, self.row_off)

    def with_offsets(self, off: tuple[Floats, Floats], row_off: Floats) -> "PeriodicModel":
        """Return the same model with other offsets.

        Parameters
        ----------
        off
            Offsets of x, forward and backward, shares of the line, shape (columns,) each.
        row_off
            Offsets of the polynomials, in periods, shape (bases, rows).
        """
        spots = [tuple(spot) for spot in self.spots.tolist()]
        return PeriodicModel(self.geometry, self.images, spots, self.order, off, self.ripples, row_off)

    def periodic_parts(self, state: FitState) -> list[Floats]:
        """Return the periodic part of each image without levelling, in missing rows too.

        It has no wave with less than a period in the line: levelled rows do not determine its amplitude.

        Returns
        -------
        list of Floats
            In heights, shape (rows, columns) each.
        """
        rows = self._every_row(state.parameters)[0]
        slow = np.abs(self.spots @ self.q(state.parameters)) < _LEAST_PERIODS
        amplitudes = np.where(slow, 0.0, state.amplitudes)
        return [
            _real_product(rows.T * amplitudes, self._waves(state.parameters, forward)) for forward, _ in self.images
        ]

    def row_waves(self, state: FitState, spots: Ints) -> Complexes:
        """Return each spot's wave in each row of both images; its phase is the error of the polynomials.

        Parameters
        ----------
        spots
            Whole numbers of the base vectors, shape (n, bases).

        Returns
        -------
        Complexes
            Sums of heights over the columns, shape (n, rows).
        """
        other = self.with_spots([tuple(one) for one in spots.tolist()])
        row = np.conj(other._rows(state.parameters)[0])
        waves = np.zeros((len(spots), self.geometry.rows), dtype=np.complex128)
        for forward, heights in self.images:
            waves += row * (np.conj(other._columns(state.parameters, forward)[0]) @ heights.T)
        return self.geometry.bridged(waves.T).T

    def phase_slopes(self, state: FitState) -> list[Floats]:
        """Return the derivative of each image by the phase of each base vector.

        Returns
        -------
        list of Floats
            In heights per period, shape (bases, rows, columns) each.
        """
        rows = self._rows(state.parameters)[0]
        derivatives = []
        for forward, _ in self.images:
            column = self._columns(state.parameters, forward)[0]
            waves = 2j * pi * state.amplitudes[:, None] * self.spots
            derivatives.append(np.stack([np.real((rows.T * wave) @ column) for wave in waves.T]))
        return derivatives

    def divided(self, state: FitState, part: int) -> "tuple[PeriodicModel, FitState]":
        """Return the same model with base waves of one ``part`` of these."""
        spots = list(map(tuple, (self.spots * part).tolist()))
        parameters = state.parameters.copy()
        parameters[BASES : self.rippled_from] /= part
        model = PeriodicModel(self.geometry, self.images, spots, self.order, self.off, self.ripples)
        return model, replace(state, parameters=parameters)

    def scores_of(self, state: FitState, residuals: Sequence[Floats]) -> Floats:
        """Return ``FitState.scores`` for other residuals.

        Parameters
        ----------
        residuals
            One array for each image, shape (rows, columns).

        Returns
        -------
        Floats
            Shape (rows, parameters + 2 spots).
        """
        forward_terms, backward_terms = self._terms(state.parameters, state.amplitudes)
        rows = self._rows(state.parameters)
        scores = np.zeros((self.geometry.rows, len(forward_terms)))
        for (forward, _), image in zip(self.images, residuals, strict=True):
            laid = self._laid_out(rows, self._columns(state.parameters, forward))
            scores += _scores(forward_terms if forward else backward_terms, laid, image)
        return scores

    def _rows(self, parameters: Floats) -> Complexes:
        """Return each spot's row part, times the powers of y, 0 in missing rows: (order + 1, spots, rows)."""
        rows = self._every_row(parameters)
        return rows if self.geometry.row_weight is None else rows * self.geometry.row_weight

    def _every_row(self, parameters: Floats) -> Complexes:
        """Return each spot's row part, times the powers of y: (order + 1, spots, rows)."""
        phase = self.spots @ (self.s(parameters) @ self.y_powers[1:] + self.row_off)
        rows: Complexes = self.y_powers[:, None, :] * np.exp(2j * pi * phase)
        return rows

    def _columns(self, parameters: Floats, forward: bool) -> Complexes:
        """Return each spot's levelled column part, times the factors of its derivatives: (parts, spots, columns)."""
        column = self.columns(parameters, forward)
        time = column.time / self.geometry.rows
        wave = self._waves(parameters, forward)
        ripples = self.ripples[0 if forward else 1]
        parts = np.stack([np.ones_like(time), column.x, *column.slopes, time, *ripples])
        levelled: Complexes = np.asarray(self.geometry.levelled(parts[:, None, :] * wave), dtype=np.complex128)
        return levelled

    def _waves(self, parameters: Floats, forward: bool) -> Complexes:
        """Return each spot's column part: (spots, columns)."""
        column = self.columns(parameters, forward)
        time = column.time / self.geometry.rows
        along = self.q(parameters)[:, None] * column.x + float(parameters[LAG]) * self.s(parameters)[:, :1] * time
        wave: Complexes = np.exp(2j * pi * (self.spots @ along))
        return wave

    def _laid_out(self, rows: Complexes, columns: Complexes) -> tuple[Complexes, Complexes, tuple[Ints, Ints]]:
        """Return the parts as rows of two matrices, and the indices of each term: (1, each column part), (y^n, 1)."""
        count, terms = len(self.spots), _COLUMN_TERMS + len(self.ripples[0])
        spot = np.arange(count)
        row = [spot] * terms + [spot + n * count for n in range(1, self.order + 1)]
        column = [spot + b * count for b in range(terms)] + [spot] * self.order
        return (
            rows.reshape(-1, rows.shape[-1]),
            columns.reshape(-1, columns.shape[-1]),
            (np.concatenate(row), np.concatenate(column)),
        )

    def _terms(self, parameters: Floats, amplitudes: Complexes) -> tuple[Complexes, Complexes]:
        """Return the effect of each parameter on a forward and a backward image: (parameters, terms)."""
        count, order = len(self.spots), self.order
        tables = []
        waves = 2j * pi * amplitudes
        q, s = self.q(parameters), self.s(parameters)
        along, across = self.spots @ q, self.spots @ s[:, 0]
        rippled = len(self.ripples[0])
        terms = _COLUMN_TERMS + rippled
        for first in (0, 2):
            table = np.zeros((len(parameters) + 2 * count, terms + order, count), dtype=np.complex128)
            table[first, 2] = table[first + 1, 3] = waves * along
            table[LAG, 4] = waves * across
            for j in range(self.bases):
                at = BASES + j * (order + 1)
                share = waves * self.spots[:, j]
                table[at, 1] = share
                for n in range(1, order + 1):
                    table[at + n, terms + n - 1] = share
                table[at + 1, 4] = share * float(parameters[LAG])
            for k in range(rippled):
                table[self.rippled_from + first // 2 * rippled + k, _COLUMN_TERMS + k] = waves * along
            spot = np.arange(count)
            table[len(parameters) + spot, 0, spot] = 1.0
            table[len(parameters) + count + spot, 0, spot] = 1j
            tables.append(table.reshape(len(table), -1))
        return tables[0], tables[1]

    def strengths(self, state: FitState, spots: Ints) -> Floats:
        """Return the amplitudes of other spots in the residuals of both images, as far as levelling leaves them.

        Parameters
        ----------
        spots
            Whole numbers of the base vectors, shape (n, bases).

        Returns
        -------
        Floats
            In heights, shape (n,).
        """
        other = self.with_spots([tuple(spot) for spot in spots.tolist()])
        total = np.zeros(len(spots), dtype=np.complex128)
        power = np.zeros(len(spots))
        row = other._rows(state.parameters)[0]
        for (forward, _), residual in zip(self.images, state.residuals, strict=True):
            column = other._columns(state.parameters, forward)[0]
            total += np.sum(np.conj(row) * (np.conj(column) @ residual.T), axis=1)
            power += np.sum(np.abs(column) ** 2, axis=1) * self.geometry.lines
        pixels = self.geometry.lines * self.geometry.columns * len(self.images)
        amplitudes: Floats = 2.0 * np.abs(total) / np.sqrt(np.maximum(power, 1e-6 * pixels) * pixels)
        return amplitudes


def settle(model: PeriodicModel, start: Floats, free: Bools) -> FitState:
    """Minimise the sum of squares by Levenberg and Marquardt.

    Parameters
    ----------
    start
        Parameters, shape (parameters,).
    free
        Parameters that are fitted; the others stay, shape (parameters,).

    Raises
    ------
    Unphysical
        If the steps do not converge.
    """
    state = model.at(start)
    joint = np.concatenate([free, np.ones(2 * len(model.spots), bool)])
    damping = 1e-3
    for _ in range(_MAX_STEPS):
        hessian = state.hessian[np.ix_(joint, joint)]
        gradient = np.sum(state.scores[:, joint], axis=0)
        scale = np.sqrt(np.maximum(np.diag(hessian), 1e-300))
        scaled, target = hessian / np.outer(scale, scale), gradient / scale
        while True:
            step = np.linalg.solve(scaled + damping * np.eye(len(scaled)), target) / scale
            trial = start.copy()
            trial[free] += step[: int(np.sum(free))]
            trial_state = model.at(trial) if model.allowed(trial) else None
            if trial_state is not None and trial_state.cost <= state.cost:
                break
            damping = max(4.0 * damping, 1e-6)
            if damping > 1e8 or float(gradient @ step) <= 1e-11 * state.cost:  # less than rounding makes of the cost
                return state
        gained = state.cost - trial_state.cost
        start, state = trial, trial_state
        damping = damping / 10.0 if damping > 1e-14 else 0.0
        if gained <= 1e-11 * state.cost or float(np.max(np.abs(step[: int(np.sum(free))]))) < 1e-11:
            return state
    raise Unphysical("the fit does not converge; is the sample periodic, and are the images from one scan?")


def _products(
    rows: Complexes, columns: Complexes, places: tuple[Ints, Ints] | None = None
) -> tuple[Complexes, Complexes]:
    """Sum over pixels conj(F_m) F_n and F_m F_n, for F = row part times column part."""
    row, column = (np.conj(rows) @ rows.T, rows @ rows.T), (np.conj(columns) @ columns.T, columns @ columns.T)
    if places is not None:
        at, across = np.ix_(places[0], places[0]), np.ix_(places[1], places[1])
        row, column = (row[0][at], row[1][at]), (column[0][across], column[1][across])
    return row[0] * column[0], row[1] * column[1]


def _scores(
    coefficients: Complexes, laid_out: tuple[Complexes, Complexes, tuple[Ints, Ints]], residual: Floats
) -> Floats:
    """Return, for each row, the residual times each parameter's derivative, summed: (rows, parameters)."""
    row, column, (at, across) = laid_out
    return _real_product(coefficients, _with_real(column, residual.T)[across] * row[at]).T


def _real_product(one: Complexes, other: Complexes) -> Floats:
    """Return the real part of a product of matrices, without the imaginary one."""
    left, right = np.concatenate([one.real, -one.imag], axis=1), np.concatenate([other.real, other.imag])
    return np.asarray(left @ right)


def _with_real(one: Complexes, other: Floats) -> Complexes:
    """Return a complex matrix times a real one, which is not made complex first."""
    parts = np.concatenate([one.real, one.imag]) @ other
    product: Complexes = parts[: len(one)] + 1j * parts[len(one) :]
    return product


def _gram(coefficients: Complexes, products: tuple[Complexes, Complexes]) -> Floats:
    """Return the inner products of the images Re(sum of coefficients times terms)."""
    first, second = products
    total = np.conj(coefficients) @ first @ coefficients.T + coefficients @ second @ coefficients.T
    result: Floats = 0.5 * np.real(total)
    return result
