"""Fit the position of the fast axis at each column of an image of a periodic sample, whatever its hysteresis.

(17) begins the fit. Then each sweep's position gets a polynomial that vanishes at both turns, of as high a degree as
the image supports (Akaike's criterion), so that periods are counted from turn to turn on any piezo.
"""

from dataclasses import dataclass, replace
from math import sqrt

import numpy as np
from numpy.polynomial.legendre import legval
from scipy.special import chdtrc

from tablegen.base.input_errors import Unphysical
from tablegen.compensation.hysteresis import BranchShape
from tablegen.fitting.measured_branch import BINS
from tablegen.images.cell_start import fit_sample_spots
from tablegen.images.model_start import prepare_heights
from tablegen.images.pair_checks import ALIASING_HINT, MIN_PERIODS
from tablegen.images.periodic_model import BASES, FitState, Geometry, PeriodicModel, settle
from tablegen.images.position_errors import BinnedResidual, covariance, loud_rows, pixel_noise
from tablegen.numerics.arrays import Bools, Floats, Ints

_MOST_RIPPLES = 12  # of each sweep
_RIPPLES_PER_PERIOD = 0.6
_LEAST_RIPPLES = 2
_WHOLE = 0.02  # share of the sweep that a window may leave out and still show the turns
_HOPELESS, _AS_GOOD = 300.0, 60.0  # how much worse Akaike's criterion may be
_NEIGHBOURS = 3  # degrees: the fits whose spread is the error of choosing a degree
_UNSEEN_GAP = 5e-4  # share of the line: assumed gap at the turns where there is no retrace
_RIPPLES_OF_A_WINDOW = 8  # where the turns are not in the image: higher degrees extrapolate badly
_UNSEEN_TURNS = 0.02  # share of what a window leaves out of the sweep: error of its extrapolated ends
_MIN_EXPLAINED = 0.03  # share of an image's variance
_MISFIT_SIGNIFICANCE = 1e-3  # probability that noise alone is taken for misfit
_MIN_OPENING = 0.004  # share of the line: least opening of a loop that has a sign
_LARGEST_GAP, _GAP_ERRORS = 0.01, 4.0  # of the line, and in standard errors
_LARGEST_CROP, _CROP_ERRORS, _CROP_RIPPLES = 0.008, 6.0, 6  # share of the line, standard errors, degrees
_NEAR_TURN, _LEAST_WIDTH = (0.1, 0.9), 1e-3  # of the line
_LAG_GAP = 0.004  # share of the line: gap that dynamics and creep may cause; more where one sweep is fast


@dataclass(frozen=True, eq=False)
class ImageLine:
    """A fitted trace, and its retrace if there is one, of a triangle's scan; positions are 0..1 between the turns.

    ``waves`` has a row of q and s for each base wave, periods in the line and in the frame; ``waves_covariance`` is of
    q_1, s_1, q_2, s_2. ``spots`` are the visible waves, whole numbers of the base waves, with their ``amplitudes``.
    ``gap`` is how far trace and retrace are apart at the left and the right turn, shares of the line, (2,), and
    ``gap_error``; nan where there is no retrace, or where the window leaves the turns out. ``explained`` is the share
    of the heights' variance that is periodic, ``noise_percent`` that of a pixel, of the contrast. ``indexed`` is True
    if the base waves are those of the indexer's cell, since the strongest spots are those of another one.
    """

    geometry: Geometry
    model: PeriodicModel
    state: FitState
    free: Bools
    covariance: Floats
    degrees: int
    gap: Floats
    gap_error: Floats
    explained: float
    noise_percent: float
    widened: float
    strays: tuple[int, ...]
    indexed: bool = False

    @property
    def waves(self) -> Floats:
        """Base waves of the image.

        Returns
        -------
        Floats
            q and s of each base wave, periods in the line and in the frame, shape (bases, 2).
        """
        x = self.state.parameters
        return np.stack([self.model.q(x), self.model.s(x)[:, 0]], axis=1)

    @property
    def waves_covariance(self) -> Floats:
        """Covariance of q_1, s_1, q_2, s_2.

        Returns
        -------
        Floats
            In squared periods, shape (2 bases, 2 bases).
        """
        step = self.model.order + 1
        at = [
            self.model.rippled_from - (self.model.bases - j) * step + k for j in range(self.model.bases) for k in (0, 1)
        ]
        part: Floats = self.covariance[np.ix_(at, at)]
        return part

    @property
    def spots(self) -> Ints:
        """Waves of the fit, as whole numbers of the base waves.

        Returns
        -------
        Ints
            Shape (spots, bases).
        """
        return self.model.spots

    @property
    def amplitudes(self) -> Floats:
        """Amplitudes of the spots, for heights of unit variance.

        Returns
        -------
        Floats
            Magnitudes, dimensionless, shape (spots,).
        """
        magnitudes: Floats = np.abs(self.state.amplitudes)
        return magnitudes

    @property
    def both(self) -> bool:
        """True if there is a retrace."""
        return len(self.model.images) == 2

    def position(self, drive: Floats, forward: bool) -> Floats:
        """Return the positions along the line at these drives.

        Parameters
        ----------
        drive
            Normalised drive, 0..1 between the turns, shape (n,).
        forward
            True on the way up.

        Returns
        -------
        Floats
            Positions, 0..1 between the turns, shape (n,).
        """
        i = 0 if forward else 2
        along = drive if forward else 1.0 - drive
        tau = BranchShape.at(self.state.parameters[i : i + 2]).inverse(along)
        more = self._coefficients(forward) @ bubbles(along, self.degrees)
        place: Floats = tau + more if forward else 1.0 - tau + more
        return place

    def position_error(self, drive: Floats, forward: bool) -> Floats:
        """Return the standard errors of ``position`` that come from the polynomials.

        Parameters
        ----------
        drive
            Normalised drive, 0..1 between the turns, shape (n,).
        forward
            True on the way up.

        Returns
        -------
        Floats
            Shares of the line, shape (n,).
        """
        first = self.model.rippled_from + (0 if forward else self.degrees)
        part = self.covariance[first : first + self.degrees, first : first + self.degrees]
        polynomials = bubbles(drive if forward else 1.0 - drive, self.degrees)
        errors: Floats = np.sqrt(np.einsum("ic,ij,jc->c", polynomials, part, polynomials))
        return errors

    def _coefficients(self, forward: bool) -> Floats:
        ripples: Floats = self.state.parameters[self.model.rippled_from :].reshape(2, -1)[0 if forward else 1]
        return ripples


def bubbles(u: Floats, count: int) -> Floats:
    """Return polynomials that vanish at 0 and 1, of the degrees from 2 on: integrals of Legendre's.

    Parameters
    ----------
    u
        Arguments in 0..1, shape (n,).
    count
        Number of polynomials.

    Returns
    -------
    Floats
        Values, shape (count, n).
    """
    coefficients = np.zeros((count + 2, count))
    for j in range(count):
        coefficients[[j, j + 2], j] = -1.0, 1.0
    return np.asarray(legval(2.0 * u - 1.0, coefficients), dtype=np.float64)


def fit_line(
    trace: Floats,
    retrace: Floats | None = None,
    turn: float = 0.5,
    window: tuple[float, float] = (0.0, 1.0),
    retrace_mirrored: bool = False,
    delay_pixels: float = 0.0,
) -> ImageLine:
    """Fit positions and periods to an image of a triangle's scan.

    Columns are evenly spread in time over ``window`` of each sweep; the rest is as in ``fit_pair``.

    Parameters
    ----------
    trace, retrace
        Heights in any unit, shape (rows, columns) each, rows in the order of time.
    turn
        Share of the period in which the drive rises.
    window
        First and last share of each sweep that the columns span.
    retrace_mirrored
        True if the retrace is stored in the order of time, its right end first.
    delay_pixels
        Columns by which the image is late.

    Raises
    ------
    Unphysical
        If the image does not support the fit.
    """
    if retrace is not None and retrace_mirrored:
        retrace = np.ascontiguousarray(retrace[:, ::-1])
    geometry, heights = prepare_heights(trace, retrace, turn, window, delay_pixels)
    model, state, free, indexed = fit_sample_spots(geometry, heights, retrace_mirrored, trace, retrace)
    fits = _rippled(model, state, free)
    best = min(fits, key=lambda fit: fit.loss)
    _check(best.model, best.state)
    gap, gap_error = _gap(best)
    return replace(_result(best, fits, gap, gap_error), indexed=indexed)


def shows_turns(geometry: Geometry) -> bool:
    """Return True if the columns reach to both turns."""
    return geometry.window[0] <= _WHOLE and geometry.window[1] >= 1.0 - _WHOLE


@dataclass(frozen=True, eq=False)
class _Degree:
    """The fit with a number of polynomials on each sweep, and its value of Akaike's criterion."""

    model: PeriodicModel
    state: FitState
    free: Bools
    loss: float


def _rippled(model: PeriodicModel, state: FitState, free: Bools) -> list[_Degree]:
    """Fit polynomials on both sweeps, of every degree from the highest that such an image may show."""
    geometry = model.geometry
    along = np.abs(model.spots @ model.q(state.parameters))
    magnitudes = np.abs(state.amplitudes)
    most = _MOST_RIPPLES if shows_turns(geometry) else _RIPPLES_OF_A_WINDOW
    most = min(
        most, int(_LEAST_RIPPLES + _RIPPLES_PER_PERIOD * float(np.max(along[magnitudes > 0.3 * np.max(magnitudes)])))
    )
    plain = np.zeros(geometry.columns), np.zeros(geometry.columns)
    base = state.parameters
    starts = [
        np.linalg.lstsq(ripple.T, off, rcond=None)[0]
        for ripple, off in zip(_ripples(geometry, most), model.off, strict=True)
    ]
    pixels = geometry.lines * geometry.columns * len(model.images)
    spots = list(map(tuple, model.spots.tolist()))
    fits: list[_Degree] = []
    for count in range(most, 0, -1):
        start = np.concatenate([base, *(coefficients[:count] for coefficients in starts)])
        loose = np.concatenate([free, np.ones(count, bool), np.full(count, len(model.images) == 2)])
        loose[:4] = False  # the polynomials contain the shapes of (17)
        one = PeriodicModel(geometry, model.images, spots, model.order, plain, _ripples(geometry, count))
        settled = settle(one, start, loose)
        loss = pixels * float(np.log(2.0 * settled.cost / pixels)) + 2.0 * float(np.sum(loose))
        fits.append(_Degree(one, settled, loose, loss))
        if loss > min(fit.loss for fit in fits) + _HOPELESS:
            break
        base = settled.parameters[: one.rippled_from]
        starts = list(settled.parameters[one.rippled_from :].reshape(2, -1))
    return fits


def _ripples(geometry: Geometry, count: int) -> tuple[Floats, Floats]:
    return bubbles(geometry.sweep(True), count), bubbles(geometry.sweep(False), count)


def _check(model: PeriodicModel, state: FitState) -> None:
    """Raise ``Unphysical`` unless the fit explains the image, and trace and retrace are of one scan."""
    for name, (_, image), residual in zip(("trace", "retrace"), model.images, state.residuals, strict=False):
        share = 1.0 - float(np.mean(residual**2)) / float(np.mean(image**2))
        if share < _MIN_EXPLAINED:
            raise Unphysical(
                f"{100.0 * max(share, 0.0):.0f} % of the {name}'s contrast is a periodic sample; the rest is "
                f"something else, or trace and retrace are not of one scan"
            )
    along = np.abs(model.spots @ model.q(state.parameters))
    periods = max(
        float(along[np.argmax(along * np.abs(state.amplitudes))]), float(np.max(np.abs(model.q(state.parameters))))
    )
    if periods < MIN_PERIODS - 0.2:
        raise Unphysical(f"the line has {periods:.2g} periods; at least {MIN_PERIODS:g} are needed: scan more of them")
    places = [model.columns(state.parameters, forward).x for forward, _ in model.images]
    if any(np.min(np.diff(x)) <= 0.0 for x in places):
        raise Unphysical(
            "a sweep would run backwards; if columns were cropped, or kept of a part of each sweep, give --window; was "
            "the drive a triangle, and are both images of one scan?"
        )
    opening = float(np.mean(_opening(model, state))) if len(places) == 2 else 0.0
    if opening < -_MIN_OPENING:
        raise Unphysical(
            f"both sweeps lead the drive; trace and retrace are exchanged, or both mirrored{ALIASING_HINT}"
        )


def _opening(model: PeriodicModel, state: FitState) -> Floats:
    """Return by how much the retrace is to the right of the trace at each column, a share of the line."""
    gap: Floats = model.columns(state.parameters, False).x - model.columns(state.parameters, True).x
    return gap


def _cropped(model: PeriodicModel, state: FitState, gap: Floats) -> Floats:
    """Return how much of the line is missing at each end, (2,), if cropping explains the gap there."""
    width = np.abs(np.interp(_NEAR_TURN, model.geometry.place, _opening(model, state)))
    size: Floats = np.abs(gap) / np.maximum(width, _LEAST_WIDTH) * _NEAR_TURN[0]
    return size


def _gap(fit: _Degree) -> tuple[Floats, Floats]:
    """Fit the gap of trace and retrace at the turns, where they meet if the columns are the whole sweep."""
    model, state, free = fit.model, fit.state, fit.free
    unknown = np.full(2, np.nan)
    if len(model.images) < 2 or not shows_turns(model.geometry):
        return unknown, unknown
    geometry, count = model.geometry, len(model.ripples[0])
    ends = np.stack([1.0 - geometry.place, geometry.place])
    ripples = np.concatenate([model.ripples[0], np.zeros_like(ends)]), np.concatenate([model.ripples[1], ends])
    wider = PeriodicModel(
        geometry, model.images, list(map(tuple, model.spots.tolist())), model.order, model.off, ripples
    )
    at = model.rippled_from
    start = np.concatenate([state.parameters[: at + count], np.zeros(2), state.parameters[at + count :], np.zeros(2)])
    loose = np.concatenate([free[: at + count], [False, False], free[at + count :], [True, True]])
    settled = settle(wider, start, loose)
    watched = np.arange(len(loose)) >= len(loose) - 2
    errors = covariance(wider, settled, loose, watched, 1.0, list(settled.residuals))[0]
    gap, error = settled.parameters[-2:], np.sqrt(np.diag(errors)[-2:])
    worst = int(np.argmax(np.abs(gap)))
    # With a narrow loop a large crop opens a small gap; the loop's width a tenth of the line further gives the crop.
    cropped = float(_cropped(model, state, gap)[worst])
    significance = abs(gap[worst]) / error[worst]
    fast = min(sqrt(0.5 / min(geometry.turn, 1.0 - geometry.turn)), 3.0)
    if (abs(gap[worst]) > fast * _LARGEST_GAP and significance > _GAP_ERRORS) or (
        cropped > _LARGEST_CROP
        and abs(gap[worst]) > fast * _LAG_GAP
        and significance > _CROP_ERRORS
        and count >= _CROP_RIPPLES
    ):
        raise Unphysical(
            f"trace and retrace are {100.0 * abs(gap[worst]):.2g} % of the line apart at its "
            f"{('left', 'right')[worst]} end, where the drive turns and they meet; if columns were cropped, or kept of "
            f"a part of each sweep, give --window; if the image is late, as of a feedback, --delay-pixels"
        )
    return gap, error


def _result(best: _Degree, fits: list[_Degree], gap: Floats, gap_error: Floats) -> ImageLine:
    model, state, free = best.model, best.state, best.free
    binned = [BinnedResidual.of(model.geometry, *pair) for pair in zip(state.residuals, state.steepness, strict=True)]
    beyond = sum(float(np.sum((one.off / one.error) ** 2)) for one in binned)
    expected = max(len(binned) * BINS - int(np.sum(free[model.rippled_from :])), 1)
    misfit = beyond / expected if chdtrc(expected, beyond) < _MISFIT_SIGNIFICANCE else 1.0
    indices = np.arange(len(free))
    watched = free & ((indices >= 5) & (indices < model.rippled_from) & ((indices - 5) % (model.order + 1) == 0))
    matrix, widened = covariance(model, state, free, watched, max(misfit, 1.0), [one.clean for one in binned])
    matrix = matrix + _model_choice_covariance(best, fits, gap, gap_error)
    power = sum(float(np.vdot(image, image)) for _, image in model.images)
    modelled = np.concatenate(
        [image - residual for (_, image), residual in zip(model.images, state.residuals, strict=True)]
    )
    return ImageLine(
        geometry=model.geometry,
        model=model,
        state=state,
        free=free,
        covariance=matrix,
        degrees=len(model.ripples[0]),
        gap=gap,
        gap_error=gap_error,
        explained=1.0 - 2.0 * state.cost / power,
        noise_percent=100.0 * pixel_noise(state) / float(np.ptp(modelled)),
        widened=sqrt(widened),
        strays=loud_rows(model.geometry, state),
    )


def _model_choice_covariance(best: _Degree, fits: list[_Degree], gap: Floats, gap_error: Floats) -> Floats:
    """Return the covariance of the base waves that comes from the choice of the polynomials, and from the gap.

    Fits of neighbouring degrees describe the image about as well.
    """
    end = best.model.rippled_from
    whole = np.zeros((len(best.free), len(best.free)))
    count = len(best.model.ripples[0])
    others = [fit for fit in fits if 0 < abs(len(fit.model.ripples[0]) - count) <= _NEIGHBOURS]
    shifts = [
        fit.state.parameters[:end] - best.state.parameters[:end] for fit in others if fit.loss < best.loss + _AS_GOOD
    ]
    if shifts:
        whole[:end, :end] = np.mean([np.outer(one, one) for one in shifts], axis=0)
    open_by = _UNSEEN_GAP
    if np.isfinite(gap).all():
        clear = np.abs(gap) > _GAP_ERRORS * gap_error
        open_by = 0.5 * float(np.mean(np.abs(gap))) + float(np.sum(_cropped(best.model, best.state, gap)[clear]))
    if not shows_turns(best.model.geometry):
        low, high = best.model.geometry.window
        open_by = _UNSEEN_TURNS * (low + 1.0 - high)
    step = best.model.order + 1
    longer = np.zeros(len(best.free))
    longer[BASES:end:step] = open_by * best.state.parameters[BASES:end:step]
    return whole + np.outer(longer, longer)
