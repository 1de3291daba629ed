"""Fit both branches of the model to one trace and one retrace image of a periodic sample."""

from collections.abc import Callable
from dataclasses import dataclass
from math import sqrt

import numpy as np
from scipy.special import chdtrc

from tablegen.base.input_errors import Unphysical
from tablegen.compensation.hysteresis import BranchShape
from tablegen.fitting.estimate import Curve, Estimate
from tablegen.fitting.measured_branch import BINS, WINDOW, AmplitudeFit, measured_branch
from tablegen.images.cell_start import SeveralCells, fit_sample_spots
from tablegen.images.missing import completed
from tablegen.images.model_start import check_signs, prepare_heights
from tablegen.images.pair_checks import MIN_PERIODS
from tablegen.images.periodic_model import FitState, Geometry, PeriodicModel
from tablegen.images.position_errors import BinnedResidual, covariance, loud_rows, pixel_noise
from tablegen.images.stepless_fit import Fit, fit_without_steps, have_terraces
from tablegen.numerics.arrays import Bools, Floats

_MIN_EXPLAINED_VARIANCE = 0.03  # share of the variance
_MAX_MISFIT_PERCENT = 3.0  # percent of the line that the model may leave
_MAX_SHAPE_ERROR = 0.05  # largest standard error of the first coordinate of a branch
_MISFIT_SIGNIFICANCE = 1e-3  # probability that noise alone is taken for misfit
_MIN_SIGNED_BETA = 0.004  # least |beta| that is a sign


@dataclass(frozen=True, kw_only=True)
class ImageFit(AmplitudeFit):
    """Fit of a pair of images; see ``AmplitudeFit``.

    ``periods`` in the line of the spot that carries most, ``spots`` how many were fitted; ``explained`` the share of
    the heights' variance that is periodic; ``registration_percent`` the largest distance of trace and retrace, of the
    line. ``widened`` is the factor on standard errors; ``strays`` are rows unlike the others, counted from 0.
    """

    periods: float
    pixels_a_period: float
    spots: int
    explained: float
    registration_percent: float
    widened: float
    strays: tuple[int, ...]


def fit_pair(
    trace: Floats,
    retrace: Floats,
    v_scan: float,
    turn: float = 0.5,
    window: tuple[float, float] = (0.0, 1.0),
    retrace_mirrored: bool = False,
    delay_pixels: float = 0.0,
) -> ImageFit:
    """Fit both branches to a pair of images.

    Columns are evenly spread in time over ``window`` of each sweep.

    Parameters
    ----------
    trace, retrace
        Heights in any unit, shape (rows, columns) each, rows in the order of time.
    v_scan
        Drive peak to peak in V.
    turn
        Share of the period in which the drive rises.
    window
        First and last share of each sweep that the columns span.
    retrace_mirrored
        True if the retrace is stored in the order of time; otherwise its left end is at the left.
    delay_pixels
        Columns by which the images are late, as of a feedback.

    Raises
    ------
    Unphysical
        If the images do not support the fit.
    """
    if retrace_mirrored:
        retrace = np.ascontiguousarray(retrace[:, ::-1])
    geometry, heights = prepare_heights(trace, retrace, turn, window, delay_pixels)

    def fit(level: list[Floats]) -> Fit:
        return fit_sample_spots(geometry, level, retrace_mirrored, trace, retrace, sizes=False)[:3]

    reason: Unphysical | None = None
    try:
        model, state, free = fit(heights)
        check_fit(model, state, free)
    except SeveralCells:
        raise
    except Unphysical as refused:
        reason = refused
    stepless = None if reason is None and model.bases < 2 else _stepless(geometry, trace, retrace, fit)
    if stepless is not None:
        model, state, free = stepless
    elif reason is not None:
        raise reason
    return _result(model, state, free, v_scan)


def _stepless(geometry: Geometry, trace: Floats, retrace: Floats, fit: Callable[[list[Floats]], Fit]) -> Fit | None:
    """Fit a lattice beside the steps of terraces; None if there are none, or no such fit. Bars would pass for steps."""
    recorded = completed([trace, retrace]).heights
    if not have_terraces(recorded):
        return None
    try:
        best = fit_without_steps(geometry, recorded, fit)
        check_fit(best.model, best.state, best.free)
    except Unphysical:
        return None
    return (best.model, best.state, best.free) if best.stepped and best.model.bases == 2 else None


def _carrying(model: PeriodicModel, state: FitState) -> float:
    """Return the periods in the line of the spot that determines x best."""
    along = np.abs(model.spots @ model.q(state.parameters))
    return float(along[np.argmax(along * np.abs(state.amplitudes))])


def check_fit(model: PeriodicModel, state: FitState, free: Bools) -> None:
    """Check that the model explains both images, with enough periods and sweeps that lag.

    Parameters
    ----------
    free
        Parameters that were fitted, shape (parameters,).

    Raises
    ------
    Unphysical
        If the fit fails a check.
    """
    shares = [
        1.0 - float(np.mean(residual**2)) / float(np.mean(image**2)) for (_, image), residual in _both(model, state)
    ]
    if min(shares) < _MIN_EXPLAINED_VARIANCE:
        name = ("trace", "retrace")[int(np.argmin(shares))]
        other = ", or trace and retrace are not of one scan" if len(shares) > 1 else ""
        raise Unphysical(
            f"{100.0 * max(min(shares), 0.0):.0f} % of the {name}'s contrast is a periodic sample; the rest is "
            f"something else{other}; crop the image to one terrace without debris, or choose another --channel"
        )
    first = float(model.q(state.parameters)[0])
    if max(_carrying(model, state), first) < MIN_PERIODS - 0.2:
        raise Unphysical(f"the line has {first:.2g} periods; at least {MIN_PERIODS:g} are needed: scan more of them")
    forward, backward = (BranchShape.at(state.parameters[i : i + 2]).peak()[0] for i in (0, 2))
    check_signs(forward, backward, _MIN_SIGNED_BETA, "try --retrace-mirrored")


def _both(model: PeriodicModel, state: FitState) -> list[tuple[tuple[bool, Floats], Floats]]:
    return list(zip(model.images, state.residuals, strict=True))


def _result(model: PeriodicModel, state: FitState, free: Bools, v_scan: float) -> ImageFit:
    geometry, x = model.geometry, state.parameters
    noise = pixel_noise(state)
    residual, scaling, curves, misfit, clean = _positions(model, state)
    worst = float(np.max(np.abs(residual)))
    if worst > _MAX_MISFIT_PERCENT:
        raise Unphysical(
            f"no branches of the harmonic model join these images: up to {worst:.2g} % of the line is left; are trace "
            f"and retrace of one scan, --window and --turn right, and the drive a triangle?"
        )
    shapes = np.arange(len(free)) < 4
    matrix, widened = covariance(model, state, free, shapes, misfit, clean)
    if float(np.sqrt(np.max(np.diag(matrix)[[0, 2]]))) > _MAX_SHAPE_ERROR:
        raise Unphysical("these images do not determine the shape of the branches; scan more periods, or average")
    forward, backward = (measured_branch(x[i : i + 2], matrix[i : i + 2, i : i + 2]) for i in (0, 2))
    line = np.linspace(0.0, 1.0, 201)
    lagging = [BranchShape.at(x[i : i + 2]) for i in (0, 2)]
    distance = lagging[0].value(line) - line + lagging[1].value(1.0 - line) - (1.0 - line)
    carrying = _carrying(model, state)
    slope = max(float(np.max(model.columns(x, side).steep)) for side in (True, False))
    span = geometry.window[1] - geometry.window[0]
    bent = model.s(x)[0, 1:] @ model.y_powers[2:]
    modelled = np.concatenate([image - rest for (_, image), rest in _both(model, state)])
    return ImageFit(
        turn=Estimate(geometry.turn),
        v_scan=v_scan,
        samples=2 * geometry.lines * geometry.columns,
        forward=forward,
        backward=backward,
        noise_percent=100.0 * noise / float(np.ptp(modelled)),
        drift_percent=100.0 * float(np.ptp(bent)) / max(carrying, 1.0),
        residual_percent=residual,
        scaling_percent=scaling,
        curves=curves,
        periods=carrying,
        pixels_a_period=geometry.columns / (span * slope * carrying),
        spots=len(model.spots),
        explained=1.0 - 2.0 * state.cost / sum(float(np.vdot(image, image)) for _, image in model.images),
        registration_percent=100.0 * float(distance[np.argmax(np.abs(distance))]),
        widened=sqrt(widened),
        strays=loud_rows(model.geometry, state),
    )


def _positions(
    model: PeriodicModel, state: FitState
) -> tuple[Floats, tuple[float, float], tuple[Curve, ...], float, list[Floats]]:
    """Return the position error of each twentieth of the window, its effect on scaling, and curves.

    Then the factor by which it is larger than noise explains, at least 1, and the images less the model.
    """
    geometry = model.geometry
    residuals, scaling, lines, clean, beyond = [], [], [], [], 0.0
    span = geometry.window[1] - geometry.window[0]
    for forward, rest, steep in zip((True, False), state.residuals, state.steepness, strict=True):
        binned = BinnedResidual.of(geometry, rest, steep)
        clean.append(binned.clean)
        columns = model.columns(state.parameters, forward)
        place = binned.place
        count = np.bincount(place, minlength=BINS)
        # The model's own x is without what was added to it: that is a part of the error.
        offset = np.bincount(place, model.off[0 if forward else 1], minlength=BINS) / count
        off = offset + binned.off
        beyond += float(np.sum((off / binned.error) ** 2))
        at, x = (np.bincount(place, values, minlength=BINS) / count for values in (geometry.place, columns.x))
        x = x - offset
        stretch = np.diff(x + off) / np.diff(at)
        residuals.append(100.0 * off if forward else -100.0 * off)
        inside = np.diff(off)[WINDOW] / span * BINS
        scaling.append(100.0 * float(np.ptp(inside)))
        lines.append((geometry.place, columns, at, x + off, 0.5 * (at[1:] + at[:-1]), stretch))
    expected = 2 * BINS - 6
    misfit = beyond / expected if chdtrc(expected, beyond) < _MISFIT_SIGNIFICANCE else 1.0
    backward = len(lines[0][2]), len(lines[0][0])
    residual = Curve(
        "residual against the drive",
        "drive [share of the sweep]",
        "position less a straight line [% of the scan]",
        (
            np.concatenate([at for _, _, at, *_ in lines]),
            np.concatenate([100.0 * (x - at) for _, _, at, x, *_ in lines]),
        ),
        (
            np.concatenate([place for place, *_ in lines]),
            np.concatenate([100.0 * (c.x - o - p) for o, (p, c, *_) in zip(model.off, lines, strict=True)]),
        ),
        backward,
    )
    period = Curve(
        "local period less that of an undistorted image",
        "x of the image [share]",
        "stretch of the period [%]",
        (
            np.concatenate([middle for *_, middle, _ in lines]),
            np.concatenate([100.0 * (1.0 / stretch - 1.0) for *_, stretch in lines]),
        ),
        (
            np.concatenate([place for place, *_ in lines]),
            np.concatenate([100.0 * (1.0 / c.steep - 1.0) for _, c, *_ in lines]),
        ),
        (len(lines[0][4]), backward[1]),
    )
    return np.concatenate(residuals), (scaling[0], scaling[1]), (residual, period), max(misfit, 1.0), clean
