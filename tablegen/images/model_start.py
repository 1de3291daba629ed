"""Begin the fit of a trace and a retrace image: level, find the strongest spot, check left and right, add spots."""

from math import sqrt

import numpy as np
from scipy.optimize import least_squares

from tablegen.base.input_errors import Unphysical
from tablegen.compensation.hysteresis import BranchShape
from tablegen.images.missing import completed
from tablegen.images.pair_checks import ALIASING_HINT, check_heights, check_lines, check_pair
from tablegen.images.periodic_model import BASES, LAG, Columns, FitState, FramePart, Geometry, PeriodicModel, settle
from tablegen.images.spots import Bend, Spot, bend_of, column_phase, row_polynomial, second_base, strongest
from tablegen.numerics.arrays import Bools, Floats, Ints

_ROW_POLYNOMIAL_ORDER = 3  # order of the polynomial over rows: drift, and hysteresis of the slow axis
_MAX_SPOTS = 14
_MAX_SPOT_INDEX = {1: 12, 2: 3}  # largest index of a spot, by number of bases
_MIN_SPOT_ERRORS = 6.0  # standard errors of an amplitude
_MIN_SPOT_AMPLITUDE = 0.003  # share of the strongest amplitude
_MAX_DELAY = 0.1  # share of the line
_MIN_TRACKED_PERIODS = 8.0  # periods
_PHASE_TOLERANCE = 0.01  # periods, rms
_SAME_WAVE = 0.5  # periods: waves nearer than this are one
_MIN_MISFIT_RATIO = 1.5  # how much worse another count of periods has to be


def prepare_heights(
    trace: Floats, retrace: Floats | None, turn: float, window: tuple[float, float], delay: float
) -> tuple[Geometry, list[Floats]]:
    """Check the images, level their rows and scale them to unit variance.

    Parameters
    ----------
    trace, retrace
        Heights in any unit, shape (rows, columns) each, NaN where a pixel is missing; no retrace is None.
    turn
        Share of the period in which the drive rises.
    window
        First and last share of each sweep that the columns span.
    delay
        Columns by which the image is late.

    Returns
    -------
    tuple
        The geometry, and the heights of the trace and of the retrace if there is one, dimensionless, each of shape
        (rows, columns). Missing rows at either end are left out; others have the weight 0, and heights of 0.

    Raises
    ------
    Unphysical
        If an image has too few pixels, too few with data, or no contrast, or the turn, the window or the delay is out
        of range.
    """
    if retrace is None:
        check_heights("trace", trace)
    else:
        check_pair(trace, retrace)
    if not 0.0 < turn < 1.0:
        raise Unphysical(f"a turn of {turn:g} is outside 0..1")
    if not (window[0] >= 0.0 and window[1] <= 1.0 and window[1] - window[0] >= 0.3):
        raise Unphysical(f"a window of {window[0]:g}..{window[1]:g} is not a large part of the sweep, 0..1")
    if not abs(delay) <= _MAX_DELAY * trace.shape[1]:
        raise Unphysical(f"a delay of {delay:g} pixels is too large for a line of {trace.shape[1]}")
    whole = completed([trace] if retrace is None else [trace, retrace])
    count, first = whole.heights[0].shape[0], whole.rows.start
    geometry = Geometry(
        count, trace.shape[1], turn, window, delay, whole.weight, FramePart(first, trace.shape[0] / count)
    )
    there = np.arange(count) if whole.weight is None else np.flatnonzero(whole.weight)
    images = []
    for name, image in zip(("trace", "retrace"), whole.heights, strict=False):
        image = image - np.mean(image)
        largest = float(np.max(np.abs(image)))
        level = np.asarray(geometry.levelled(image), dtype=np.float64)
        check_lines(name, level[there], largest, there + first)
        images.append(geometry.weighted(level))
    spread = sqrt(sum(float(np.var(image)) for image in images) / len(images))
    return geometry, [image / spread for image in images]


def begin(
    geometry: Geometry, heights: list[Floats], mirrored: bool, spot: Spot | None = None
) -> tuple[Spot, tuple[Bend, ...]]:
    """Find the strongest spot and each image's branch; check that the retrace, if any, belongs to the trace.

    Parameters
    ----------
    heights
        Levelled heights of the trace, and of the retrace if there is one, shape (rows, columns) each.
    mirrored
        True if the retrace was mirrored before.
    spot
        A spot of the sample's lattice; the strongest one by default.

    Raises
    ------
    Unphysical
        If no spot stands out, the retrace does not show the trace's pattern, or a sweep leads the drive.
    """
    if spot is None:
        spot = strongest(geometry, heights[0])
        forward = bend_of(geometry, heights[0], True, spot, spot.sharpest)
    else:
        forward = bend_of(geometry, heights[0], True, spot)
    if len(heights) == 1:
        check_signs(forward.shape.lag, 0.0, 0.02, "")
        return spot, (forward,)
    backward = bend_of(geometry, heights[1], False, spot)
    turned = bend_of(geometry, heights[1][:, ::-1], False, spot)
    advice = "leave --retrace-mirrored out" if mirrored else "it needs --retrace-mirrored"
    if turned.match > 1.5 * max(backward.match, 0.2 * forward.match):
        raise Unphysical(f"the retrace shows the trace's pattern only when it is mirrored; {advice}{ALIASING_HINT}")
    if backward.match < 0.3 * forward.match:
        raise Unphysical("the retrace does not show the trace's pattern; are they from one scan?")
    # A grating square to the lines looks the same mirrored; then the bend decides.
    check_signs(forward.shape.lag, backward.shape.lag, 0.02, advice)
    return spot, (forward, backward)


def check_signs(forward: float, backward: float, least: float, advice: str) -> None:
    """Check that each sweep lags the drive; the lag of a sweep that is not there is 0.

    Raises
    ------
    Unphysical
        If a sweep leads the drive by more than ``least``.
    """
    if forward < -least and backward < -least:
        raise Unphysical(
            f"both sweeps lead the drive; trace and retrace are exchanged, or both mirrored{ALIASING_HINT}"
        )
    if forward > 0.0 and backward < -least:
        raise Unphysical(f"the retrace bends the wrong way, as one that is mirrored; {advice}{ALIASING_HINT}")
    if forward < -least and backward >= 0.0:
        raise Unphysical(
            "the trace bends the wrong way: it is mirrored (the left end must be where the trace begins), or its lines"
            " were straightened already, by the controller or a closed loop"
        )


def row_order() -> int:
    """Return the order of the polynomial over rows."""
    return _ROW_POLYNOMIAL_ORDER


def fit_spots(
    geometry: Geometry, heights: list[Floats], spot: Spot, bends: tuple[Bend, ...]
) -> tuple[PeriodicModel, FitState, Bools]:
    """Fit the strongest spot, then another base vector if there is one, and all visible spots.

    The branch of a retrace that is not there stays straight.

    Parameters
    ----------
    heights
        Levelled heights, shape (rows, columns) each.

    Returns
    -------
    tuple
        The model, its state at the fitted parameters, and the parameters that are free, shape (parameters,).
    """
    images, start, free, off = first_wave(geometry, heights, spot, bends)
    return fit_from_start(geometry, images, start, free, off)


def first_wave(
    geometry: Geometry, heights: list[Floats], spot: Spot, bends: tuple[Bend, ...]
) -> tuple[list[tuple[bool, Floats]], Floats, Bools, tuple[Floats, Floats]]:
    """Return the images, parameters of one wave, which of them are free, and offsets of x; see ``fit_from_start``."""
    images = list(zip((True, False), heights, strict=False))
    start = np.zeros(BASES + 1 + _ROW_POLYNOMIAL_ORDER)
    start[: 2 * len(bends)] = np.concatenate([bend.shape.coordinates for bend in bends])
    start[LAG] = 1.0
    start[BASES] = sum(bend.q for bend in bends) / len(bends)
    start[BASES + 1 :] = row_polynomial(geometry, heights[0], bends[0], spot, _ROW_POLYNOMIAL_ORDER)
    free = np.ones(len(start), bool)
    free[LAG] = False
    free[2 * len(bends) : 4] = False
    nowhere = np.zeros(geometry.columns)
    off = nowhere, nowhere
    if start[BASES] > _MIN_TRACKED_PERIODS:
        start[: 2 * len(bends)], start[BASES], off = _tracked(geometry, heights, bends, start[BASES + 1 :])
    elif len(images) == 2:
        for i in (0, 1):  # each image by itself
            alone = free.copy()
            alone[[2, 3] if i == 0 else [0, 1]] = False
            start[:4] = settle(
                PeriodicModel(geometry, [images[i]], [(1,)], _ROW_POLYNOMIAL_ORDER, off), start, alone
            ).parameters[:4]
    return images, start, free, off


def fit_from_start(
    geometry: Geometry, images: list[tuple[bool, Floats]], start: Floats, free: Bools, off: tuple[Floats, Floats]
) -> tuple[PeriodicModel, FitState, Bools]:
    """Fit from the parameters of one base vector: add another one if there is one, and all visible spots.

    Parameters
    ----------
    images
        True if forward, and the heights, shape (rows, columns), of each image.
    start
        Parameters, with a polynomial of ``row_order()`` in the rows, shape (parameters,).
    free
        Parameters that are fitted, shape (parameters,).
    off
        Offsets of x, forward and backward, shares of the line, shape (columns,) each.

    Returns
    -------
    tuple
        The model, its state at the fitted parameters, and the parameters that are free.
    """
    nowhere = np.zeros(geometry.columns)
    model = PeriodicModel(geometry, images, [(1,)], _ROW_POLYNOMIAL_ORDER, off)
    state = settle(model, start, free)
    model = with_spots(model, state)
    state = settle(model, state.parameters, free)
    if np.any(off):  # the rest of the phase may be an error of the phase itself
        plain = PeriodicModel(
            geometry, images, list(map(tuple, model.spots.tolist())), _ROW_POLYNOMIAL_ORDER, 2 * (nowhere,)
        )
        straight = settle(plain, state.parameters, free)
        if straight.cost < state.cost:
            model, state, off = plain, straight, (nowhere, nowhere)
    other = second_base(
        geometry,
        state.residuals[0],
        state.parameters[:2],
        _multiples(model, state.parameters),
        float(np.max(np.abs(state.amplitudes))),
        _ROW_POLYNOMIAL_ORDER,
    )
    part = 1 if other is None else _part_of(state, model, other[0], other[1])
    if part > 1:  # the strongest wave was a harmonic of the sample's period
        model, state = model.divided(state, part)
        model = with_spots(model, state)
        state = settle(model, state.parameters, free)
    elif other is not None:
        second, polynomial = other
        start = np.concatenate([state.parameters, [second.q], polynomial])
        free = np.append(free, np.ones(1 + _ROW_POLYNOMIAL_ORDER, bool))
        pairs = [(*spot, 0) for spot in model.spots.tolist()]
        model = PeriodicModel(geometry, images, [*pairs, (0, 1)], _ROW_POLYNOMIAL_ORDER, off)
        state = settle(model, start, free)
        free = free.copy()
        free[LAG] = True  # two directions tell a shift in y from one in x
        model = with_spots(model, state)
        state = settle(model, state.parameters, free)
    model = with_spots(model, state)
    return model, settle(model, state.parameters, free), free


def _tracked(
    geometry: Geometry, heights: list[Floats], bends: tuple[Bend, ...], polynomial: Floats
) -> tuple[Floats, float, tuple[Floats, Floats]]:
    """Estimate the shapes and q from the phase along each image, and the rest, if it is much of a period.

    Many periods tell the phase at every column, so that the start does not depend on the model.
    """
    sides = list(zip(heights, (True, False), bends, strict=False))
    tracks = [column_phase(geometry, image, forward, bend, polynomial) for image, forward, bend in sides]
    phases = [phase for phase, _ in tracks]
    q = sum(bend.q for bend in bends) / len(bends)
    if len(sides) == 2:
        whole = tracks[0][1] & tracks[1][1]
        phases[1] = phases[1] + _turns(geometry.place[whole], phases[0][whole] - phases[1][whole], q)
    count = 2 * len(sides)

    def residuals(x: Floats) -> Floats:
        """Compute the phases less those of the branches.

        Returns
        -------
        Floats
            In periods, shape (images x columns,).
        """
        if min(BranchShape.at(x[i : i + 2]).least_slope() for i in range(0, count, 2)) < 0.1:
            return np.full(len(sides) * geometry.columns, 1e3)
        columns = [Columns.of(geometry, side[1], x[2 * i : 2 * i + 2]) for i, side in enumerate(sides)]
        pairs = zip(phases, columns, strict=True)
        return np.concatenate([phase - x[count] * column.x - x[count + 1] for phase, column in pairs])

    start = [*np.concatenate([bend.shape.coordinates for bend in bends]), q, float(phases[0][0])]
    best: Floats = least_squares(residuals, start, x_scale=[*[0.05, 0.1] * len(sides), 1.0, 0.3]).x
    off = residuals(best)
    if float(np.sqrt(np.mean(off**2))) < _PHASE_TOLERANCE:
        off = np.zeros_like(off)
    first, second = np.split(off / best[count], 2) if len(sides) == 2 else (off / best[count], np.zeros_like(off))
    return best[:count], float(best[count]), (first, second)


def _turns(place: Floats, difference: Floats, q: float) -> int:
    """Return the whole number of periods between the phases of trace and retrace: they meet where the drive turns.

    Raises ``Unphysical`` where one number does as well as another.
    """
    loop = (place * (1.0 - place))[:, None] * np.vander(place, 4)
    across = np.linalg.qr(loop)[0]
    centre = round(float(np.median(difference)))
    reach = int(np.ceil(0.3 * q)) + 1
    misfits = []
    for turns in range(centre - reach, centre + reach + 1):
        misfit = difference - turns
        misfit = misfit - across @ (across.T @ misfit)
        misfits.append((float(np.sqrt(np.mean(misfit**2))), turns))
    misfits.sort()
    if misfits[1][0] < _MIN_MISFIT_RATIO * misfits[0][0]:
        raise Unphysical(
            f"the retrace may be one of the {q:.3g} periods further left or right; scan fewer of them, or take images "
            f"of more of the sweep, with a --window near 0 1"
        )
    return misfits[0][1]


def _part_of(state: FitState, model: PeriodicModel, other: Spot, polynomial: Floats) -> int:
    """Return 2 or 3 where the other wave is halves or thirds of the first, of one grating then; 1 otherwise."""
    q, s = float(model.q(state.parameters)[0]), float(model.s(state.parameters)[0, 0])
    other_s = float(polynomial[0])
    for part in (2, 3):
        times = round(part * other.q / q)
        if times % part and np.hypot(other.q - times * q / part, other_s - times * s / part) < _SAME_WAVE:
            return part
    return 1


def _multiples(model: PeriodicModel, parameters: Floats) -> Floats:
    """Return q and s of the harmonics of the first base vector, (n, 2)."""
    n = np.arange(1, 41)[:, None]
    start: Floats = n * np.array([model.q(parameters)[0], model.s(parameters)[0, 0]])
    return start


def with_spots(model: PeriodicModel, state: FitState, highest: int | None = None) -> PeriodicModel:
    """Add the spots that stand out of the residuals, the strongest first."""
    geometry, highest = model.geometry, highest or _MAX_SPOT_INDEX[model.bases]
    ranges = [np.arange(0, highest + 1), *[np.arange(-highest, highest + 1)] * (model.bases - 1)]
    spots: Ints = np.stack(np.meshgrid(*ranges, indexing="ij"), axis=-1).reshape(-1, model.bases)
    along, across = spots @ model.q(state.parameters), spots @ model.s(state.parameters)[:, 0]
    fitted = model.spots
    span = geometry.window[1] - geometry.window[0]
    visible = np.abs(along) * span < 0.45 * geometry.columns
    visible &= np.abs(across) < 0.45 * geometry.rows
    visible &= np.hypot(along * span, across) > 1.2  # slower waves are removed with the parabolas of the rows
    for q, s in zip(fitted @ model.q(state.parameters), fitted @ model.s(state.parameters)[:, 0], strict=True):
        for sign in (1.0, -1.0):
            visible &= np.hypot(sign * along - q, sign * across - s) > 1.2
    leading = spots[np.arange(len(spots)), np.argmax(spots != 0, axis=1)]
    spots = spots[visible & (leading > 0)]
    room = _MAX_SPOTS - len(fitted)
    if not len(spots) or room < 1:
        return model
    strength = model.strengths(state, spots)
    noise = sqrt(2.0 * state.cost / (geometry.lines * geometry.columns * len(model.images)))
    least = max(
        _MIN_SPOT_ERRORS * noise / sqrt(geometry.lines * geometry.columns),
        _MIN_SPOT_AMPLITUDE * float(np.max(np.abs(state.amplitudes))),
    )
    best = [i for i in np.argsort(-strength)[:room] if strength[i] > least]
    return model.with_spots([*map(tuple, fitted.tolist()), *map(tuple, spots[best].tolist())])
