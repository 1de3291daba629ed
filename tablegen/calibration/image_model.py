"""From a trace and a retrace image to a settled model: levelled, begun, checked for left and right, and grown."""

from math import sqrt

import numpy as np
from scipy.optimize import least_squares

from tablegen.calibration.periodic import BASES, LAG, Columns, FitState, Geometry, PeriodicModel, settle
from tablegen.calibration.spots import Bend, Spot, bend_of, column_phase, row_polynomial, second_base, strongest
from tablegen.compensation.hysteresis import BranchShape
from tablegen.numerics.arrays import Bools, Floats, Ints
from tablegen.problems import Unphysical

_MIN_PIXELS = 32  # along and across
ROW_POLYNOMIAL_ORDER = 3  # order of the polynomial over rows: drift, and hysteresis of the slow axis
_MAX_SPOTS = 14
_MAX_SPOT_INDEX = {1: 12, 2: 3}  # largest index of a spot, by number of bases
_MIN_SPOT_ERRORS = 6.0  # standard errors of an amplitude
_MIN_SPOT_AMPLITUDE = 0.003  # share of the strongest amplitude
_MAX_LINE_POWER = 100.0  # times the usual power of a line
_FLAT, _MANY_FLAT = 1e-9, 0.02  # share of the largest power of a line; share of all lines
_MAX_DELAY = 0.1  # share of the line
_MIN_TRACKED_PERIODS = 8.0  # periods
_PHASE_TOLERANCE = 0.01  # periods, rms
_MIN_MISFIT_RATIO = 1.5  # how much worse another count of periods has to be
_ALIASING_HINT = " (periods finer than two pixels look like that too)"


def prepared(
    trace: Floats, retrace: Floats, turn: float, window: tuple[float, float], delay: float
) -> tuple[Geometry, list[Floats]]:
    """Levelled heights of unit variance."""
    if trace.shape != retrace.shape:
        sizes = " and ".join(f"{image.shape[0]} x {image.shape[1]}" for image in (trace, retrace))
        raise Unphysical(f"trace and retrace have {sizes} pixels; both must be from one scan")
    if trace.ndim != 2 or min(trace.shape) < _MIN_PIXELS:
        raise Unphysical(f"{' x '.join(map(str, trace.shape))} pixels are too few; {_MIN_PIXELS} rows and columns do")
    if not 0.0 < turn < 1.0:
        raise Unphysical(f"a turn of {turn:g} is outside 0..1")
    if not (window[0] >= 0.0 and window[1] <= 1.0 and window[1] - window[0] >= 0.3):
        raise Unphysical(f"a window of {window[0]:g}..{window[1]:g} is not a large part of the sweep, 0..1")
    if not abs(delay) <= _MAX_DELAY * trace.shape[1]:
        raise Unphysical(f"a delay of {delay:g} pixels is too large for a line of {trace.shape[1]}")
    if np.array_equal(trace, retrace) or np.array_equal(trace, retrace[:, ::-1]):
        raise Unphysical(
            "trace and retrace are the same image; both directions are needed, since the scanner file has a branch for "
            "each"
        )
    geometry = Geometry(trace.shape[0], trace.shape[1], turn, window, delay)
    images = []
    for name, image in (("trace", trace), ("retrace", retrace)):
        if not np.all(np.isfinite(image)):
            raise Unphysical(f"the {name} has {int(np.sum(~np.isfinite(image)))} pixels that are not numbers; crop it")
        image = image - np.mean(image)
        largest = float(np.max(np.abs(image)))
        level = np.asarray(geometry.levelled(image), dtype=np.float64)
        if not np.max(np.abs(level)) > 1e-12 * largest:
            raise Unphysical(f"the {name} has no contrast along its lines")
        power = np.sum(level**2, axis=1)
        flat = np.flatnonzero(power <= _FLAT * np.max(power))
        if len(flat) > _MANY_FLAT * len(power):
            raise Unphysical(
                f"{len(flat)} rows of the {name}, from {flat[0] + 1} to {flat[-1] + 1}, have no contrast, as of a scan "
                f"that was stopped; crop both images"
            )
        loud = np.flatnonzero(power > _MAX_LINE_POWER * np.median(power))
        if np.sum(power[loud]) > 0.5 * np.sum(power):
            raise Unphysical(f"rows {loud[0] + 1} to {loud[-1] + 1} have most of the {name}'s contrast; crop them")
        images.append(level)
    spread = sqrt(0.5 * sum(float(np.var(image)) for image in images))
    return geometry, [image / spread for image in images]


def begin(geometry: Geometry, heights: list[Floats], mirrored: bool) -> tuple[Spot, tuple[Bend, Bend]]:
    """The strongest spot and each image's shape; whether the retrace is the trace's retrace."""
    spot = strongest(geometry, heights[0])
    forward = bend_of(geometry, heights[0], True, spot, spot.sharpest)
    backward = bend_of(geometry, heights[1], False, spot)
    turned = bend_of(geometry, heights[1][:, ::-1], False, spot)
    advice = "leave --retrace-mirrored out" if mirrored else "it needs --retrace-mirrored"
    if turned.match > 1.5 * max(backward.match, 0.2 * forward.match):
        raise Unphysical(f"the retrace shows the trace's pattern only when it is mirrored; {advice}{_ALIASING_HINT}")
    if backward.match < 0.3 * forward.match:
        raise Unphysical("the retrace does not show the trace's pattern; are they from one scan?")
    # A grating square to the lines looks the same mirrored; then the bend tells.
    signs = [bend.shape.peak()[0] for bend in (forward, backward)]
    check_signs(signs[0], signs[1], 0.02, advice)
    return spot, (forward, backward)


def check_signs(forward: float, backward: float, least: float, advice: str) -> None:
    """Each sweep has to lag."""
    if forward < -least and backward < -least:
        raise Unphysical(
            f"both sweeps lead the drive; trace and retrace are exchanged, or both mirrored{_ALIASING_HINT}"
        )
    if forward > 0.0 and backward < -least:
        raise Unphysical(f"the retrace bends the wrong way, as one that is mirrored; {advice}{_ALIASING_HINT}")
    if forward < -least and backward > 0.0:
        raise Unphysical("the trace bends the wrong way; is it mirrored? The left end must be where the trace begins")


def grown(
    geometry: Geometry, heights: list[Floats], spot: Spot, bends: tuple[Bend, Bend]
) -> tuple[PeriodicModel, FitState, Bools]:
    """The fit, first of the strongest spot, then of all."""
    images = list(zip((True, False), heights, strict=True))
    start = np.zeros(BASES + 1 + ROW_POLYNOMIAL_ORDER)
    start[:4] = np.concatenate([bend.shape.coordinates for bend in bends])
    start[LAG] = 1.0
    start[BASES] = 0.5 * (bends[0].q + bends[1].q)
    start[BASES + 1 :] = row_polynomial(geometry, heights[0], bends[0], spot, ROW_POLYNOMIAL_ORDER)
    free = np.ones(len(start), bool)
    free[LAG] = False
    nowhere = np.zeros(geometry.columns)
    off = nowhere, nowhere
    if start[BASES] > _MIN_TRACKED_PERIODS:
        start[:4], start[BASES], off = _tracked(geometry, heights, bends, start[BASES + 1 :])
    else:
        for i in (0, 1):  # each image by itself
            alone = free.copy()
            alone[[2, 3] if i == 0 else [0, 1]] = False
            start[:4] = settle(
                PeriodicModel(geometry, [images[i]], [(1,)], ROW_POLYNOMIAL_ORDER, off), start, alone
            ).parameters[:4]
    return described(geometry, images, start, free, off)


def described(
    geometry: Geometry, images: list[tuple[bool, Floats]], start: Floats, free: Bools, off: tuple[Floats, Floats]
) -> tuple[PeriodicModel, FitState, Bools]:
    """The fit from parameters of one base vector: with another one if there is one, and all spots seen."""
    model = PeriodicModel(geometry, images, [(1,)], ROW_POLYNOMIAL_ORDER, off)
    state = settle(model, start, free)
    model = _with_spots(model, state)
    state = settle(model, state.parameters, free)
    other = second_base(
        geometry,
        state.left[0],
        state.parameters[:2],
        _multiples(model, state.parameters),
        float(np.max(np.abs(state.amplitudes))),
        ROW_POLYNOMIAL_ORDER,
    )
    if other is not None:
        found, polynomial = other
        start = np.concatenate([state.parameters, [found.q], polynomial])
        free = np.append(free, np.ones(1 + ROW_POLYNOMIAL_ORDER, bool))
        pairs = [(*spot, 0) for spot in model.spots.tolist()]
        model = PeriodicModel(geometry, images, [*pairs, (0, 1)], ROW_POLYNOMIAL_ORDER, off)
        state = settle(model, start, free)
        free = free.copy()
        free[LAG] = True  # two directions tell a shift in y from one in x
        model = _with_spots(model, state)
        state = settle(model, state.parameters, free)
    model = _with_spots(model, state)
    return model, settle(model, state.parameters, free), free


def _tracked(
    geometry: Geometry, heights: list[Floats], bends: tuple[Bend, Bend], polynomial: Floats
) -> tuple[Floats, float, tuple[Floats, Floats]]:
    """Both shapes and q from the phase along each image, and what they leave of it, where that is much of a period.

    Many periods tell the phase at every column, so that the start does not depend on the model.
    """
    found = [
        column_phase(geometry, image, forward, bend, polynomial)
        for image, forward, bend in zip(heights, (True, False), bends, strict=True)
    ]
    whole = found[0][1] & found[1][1]
    q = 0.5 * (bends[0].q + bends[1].q)
    turns = _turns(geometry.place[whole], found[0][0][whole] - found[1][0][whole], q)
    phases = found[0][0], found[1][0] + turns

    def left(x: Floats) -> Floats:
        if min(BranchShape.at(x[i : i + 2]).least_slope() for i in (0, 2)) < 0.1:
            return np.full(2 * geometry.columns, 1e3)
        columns = [Columns.of(geometry, forward, x[i : i + 2]) for i, forward in ((0, True), (2, False))]
        return np.concatenate([phase - x[4] * column.x - x[5] for phase, column in zip(phases, columns, strict=True)])

    start = [*bends[0].shape.coordinates, *bends[1].shape.coordinates, q, float(phases[0][0])]
    best: Floats = least_squares(left, start, x_scale=[0.05, 0.1, 0.05, 0.1, 1.0, 0.3]).x
    off = left(best)
    if float(np.sqrt(np.mean(off**2))) < _PHASE_TOLERANCE:
        off = np.zeros_like(off)
    first, second = np.split(off / best[4], 2)
    return best[:4], float(best[4]), (first, second)


def _turns(place: Floats, apart: Floats, q: float) -> int:
    """The whole number of periods between the phases of trace and retrace: they meet where the drive turns.

    Raises ``Unphysical`` where one number does as well as another.
    """
    loop = (place * (1.0 - place))[:, None] * np.vander(place, 4)
    across = np.linalg.qr(loop)[0]
    centre = round(float(np.median(apart)))
    reach = int(np.ceil(0.3 * q)) + 1
    tried = []
    for turns in range(centre - reach, centre + reach + 1):
        left = apart - turns
        left = left - across @ (across.T @ left)
        tried.append((float(np.sqrt(np.mean(left**2))), turns))
    tried.sort()
    if tried[1][0] < _MIN_MISFIT_RATIO * tried[0][0]:
        raise Unphysical(
            f"the retrace may be one of the {q:.3g} periods further left or right; scan fewer of them, or take images "
            f"of more of the sweep, with a --window near 0 1"
        )
    return tried[0][1]


def _multiples(model: PeriodicModel, parameters: Floats) -> Floats:
    """(n, 2): q and s of the harmonics of the first base vector."""
    n = np.arange(1, 41)[:, None]
    found: Floats = n * np.array([model.q(parameters)[0], model.s(parameters)[0, 0]])
    return found


def _with_spots(model: PeriodicModel, state: FitState) -> PeriodicModel:
    """With the spots that can be seen in what is left, the strongest first."""
    geometry, highest = model.geometry, _MAX_SPOT_INDEX[model.bases]
    ranges = [np.arange(0, highest + 1), *[np.arange(-highest, highest + 1)] * (model.bases - 1)]
    spots: Ints = np.stack(np.meshgrid(*ranges, indexing="ij"), axis=-1).reshape(-1, model.bases)
    along, across = spots @ model.q(state.parameters), spots @ model.s(state.parameters)[:, 0]
    known = model.spots
    span = geometry.window[1] - geometry.window[0]
    seen = np.abs(along) * span < 0.45 * geometry.columns
    seen &= np.abs(across) < 0.45 * geometry.rows
    seen &= np.hypot(along * span, across) > 1.2  # the rest goes with the parabolas of the lines
    for q, s in zip(known @ model.q(state.parameters), known @ model.s(state.parameters)[:, 0], strict=True):
        for sign in (1.0, -1.0):
            seen &= np.hypot(sign * along - q, sign * across - s) > 1.2
    leading = spots[np.arange(len(spots)), np.argmax(spots != 0, axis=1)]
    spots = spots[seen & (leading > 0)]
    room = _MAX_SPOTS - len(known)
    if not len(spots) or room < 1:
        return model
    strength = model.strengths(state, spots)
    noise = sqrt(2.0 * state.cost / (geometry.rows * geometry.columns * len(model.images)))
    least = max(
        _MIN_SPOT_ERRORS * noise / sqrt(geometry.rows * geometry.columns),
        _MIN_SPOT_AMPLITUDE * float(np.max(np.abs(state.amplitudes))),
    )
    best = [i for i in np.argsort(-strength)[:room] if strength[i] > least]
    return model.with_spots([*map(tuple, known.tolist()), *map(tuple, spots[best].tolist())])
