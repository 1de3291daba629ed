"""Begin the fit of a periodic sample: find its strongest spot, and roughly how each sweep bends it.

Hysteresis chirps a grating by several periods, which smears its spot. A family of branches undoes that until the spot
is sharp; then the shape is searched on the column's profile alone, which costs little.
"""

from dataclasses import dataclass
from functools import lru_cache
from itertools import product

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.base.remedies import REMEDIES
from tablegen.compensation.hysteresis import BranchShape
from tablegen.images.pair_checks import MAX_PERIODS_PER_COLUMN, MIN_PERIODS, FinePeriods
from tablegen.images.periodic_model import Geometry
from tablegen.numerics.arrays import Bools, Complexes, Floats

_MIN_SEARCHED_PERIODS = 1.4  # periods; slower waves are removed with the parabola of the rows
_MAX_BEND = 0.13  # first coordinate of a branch: a tenth of the scan, and what a skew peak adds
_MAX_SKEW = 0.2  # second coordinate
_COARSE_STEP = 0.02
_FINE_STEP_PERIODS = 0.25  # periods between neighbours of the search
_FINE_STEPS = 8  # to either side
_MIN_SECOND_AMPLITUDE = 0.1  # share of the strongest amplitude
_MIN_SIDE_DISTANCE = 0.12  # share of the frame: over it another wave of the same q, of another s, averages out
_MIN_SPOT_POWER = 25.0  # times the mean power: white noise does not reach it


@dataclass(frozen=True)
class Spot:
    """Periods in the line and in the frame, and the first coordinate of the branch with which it is sharpest."""

    q: float
    s: float
    sharpest: float


@dataclass(frozen=True)
class Bend:
    """One image's q and branch; ``match`` is how much of the spot follows it."""

    q: float
    shape: BranchShape
    match: float


def strongest(geometry: Geometry, heights: Floats) -> Spot:
    """Find the strongest spot of a forward image.

    Parameters
    ----------
    heights
        Levelled heights, shape (rows, columns).

    Raises
    ------
    Unphysical
        If no spot stands out, or its periods are too few or too fine.
    """
    weight = np.hanning(geometry.rows + 2)[1:-1, None] * np.hanning(geometry.columns + 2)[1:-1]
    best = (0.0, 0, 0, 0.0, 1.0)
    best_power = np.zeros((1, 1))
    for shape in np.arange(-6, 7) * _COARSE_STEP:
        straight, span = _straightened(geometry, heights, BranchShape.at(np.array([shape, 0.0])))
        power = np.abs(np.fft.rfft2(weight * straight)) ** 2
        first = int(np.ceil(_MIN_SEARCHED_PERIODS * span))
        power[:, :first] = 0.0
        # The wave of a lattice along x is the most significant; the harmonics of a grating fall faster than 1 / q.
        row, column = divmod(int(np.argmax(power * np.arange(power.shape[1]))), power.shape[1])
        if power[row, column] * column > best[0]:
            best = (float(power[row, column]) * column, row, column, float(shape), span)
            best_power = power
    _, row, column, sharpest, span = best
    # A rough surface has power at all frequencies: compared with its neighbours, none stands out. The median is the
    # mean of random power, by the factor 1.44, and ignores another spot of a lattice.
    beside = np.concatenate([np.arange(3, 13), -np.arange(3, 13)])
    near = best_power[
        np.ix_((row + beside) % geometry.rows, np.arange(max(column - 2, 0), min(column + 3, best_power.shape[1])))
    ]
    if not best_power[row, column] > _MIN_SPOT_POWER * max(float(np.mean(best_power)), 1.44 * float(np.median(near))):
        raise Unphysical("no period stands out in the trace; a grating or a lattice is needed, and its contrast")
    count = geometry.rows
    peak = np.log(np.maximum(best_power[[(row - 1) % count, row, (row + 1) % count], column], 1e-300))
    bend = float(peak[0] - 2.0 * peak[1] + peak[2])
    s = row + (0.5 * float(peak[0] - peak[2]) / bend if bend < 0.0 else 0.0)
    q = column / span
    if q * (geometry.window[1] - geometry.window[0]) > MAX_PERIODS_PER_COLUMN * geometry.columns:
        raise FinePeriods(f"{q:.3g} periods in {geometry.columns} columns are too fine; {REMEDIES['few-pixels']}")
    if q < MIN_PERIODS - 0.5:
        raise Unphysical(f"the line has about {q:.2g} periods; at least {MIN_PERIODS:g} are needed: scan more of them")
    return Spot(q, s - count if s > count / 2 else s, sharpest)


def bend_of(geometry: Geometry, heights: Floats, forward: bool, spot: Spot, around: float | None = None) -> Bend:
    """Return the branch with which a spot of this s is sharpest.

    Parameters
    ----------
    heights
        Levelled heights, shape (rows, columns).
    forward
        True for the trace.
    around
        First coordinate of the branch near which to search; everywhere by default.
    """
    weight = np.hanning(geometry.rows + 2)[1:-1]
    profile = (weight * np.exp(-2j * np.pi * spot.s * geometry.y)) @ heights
    step = min(0.01, _FINE_STEP_PERIODS / spot.q)
    reach = _MAX_BEND if around is None else 1.5 * _COARSE_STEP
    centre = 0.0 if around is None else around
    count = int(np.ceil(reach / step))
    skew_count = int(
        np.ceil(_MAX_SKEW / (2.4 * step))
    )  # skew moves the line by a fifth of what bend does, at two places
    q = spot.q + np.arange(-_FINE_STEPS, _FINE_STEPS + 1) * _FINE_STEP_PERIODS
    best = Bend(spot.q, BranchShape(), 0.0)
    u = geometry.sweep(forward)
    for bend, skew in product(
        centre + np.arange(-count, count + 1) * step, np.arange(-skew_count, skew_count + 1) * (2.4 * step)
    ):
        coordinates = np.array([bend, skew])
        tau = _inverse(coordinates, u)
        if tau is None:
            continue
        x = tau if forward else 1.0 - tau
        match = _matches(spot.q, x, profile)
        at = int(np.argmax(match))
        if match[at] > best.match:
            best = Bend(float(q[at]), BranchShape.at(coordinates), float(match[at]))
    return best


def _matches(q: float, x: Floats, profile: Complexes) -> Floats:
    """Return the amplitudes of the waves of q and its neighbours, which are q's times powers of one step."""
    wave, step = np.exp(-2j * np.pi * np.outer([q, _FINE_STEP_PERIODS], x))
    powers = np.ones((_FINE_STEPS + 1, len(x)), dtype=np.complex128)
    for number in range(_FINE_STEPS):
        np.multiply(powers[number], step, out=powers[number + 1])
    product = wave * profile
    faster, slower = np.abs(powers @ np.stack([product, np.conj(product)], axis=1)).T
    return np.concatenate([slower[:0:-1], faster])


def row_polynomial(
    geometry: Geometry, heights: Floats, bend: Bend, spot: Spot, order: int, smoothed: float = 0.01
) -> Floats:
    """Fit a polynomial in y to the phase of the spot along the rows of a forward image.

    Parameters
    ----------
    heights
        Levelled heights, shape (rows, columns).
    order
        Order of the polynomial.
    smoothed
        Share of the frame over which the phase is averaged.

    Returns
    -------
    Floats
        s_1, s_2, ... in periods, shape (order,).

    Raises
    ------
    Unphysical
        If the branch runs backwards.
    """
    tau = _required(_inverse(bend.shape.coordinates, geometry.sweep(True)))
    wave = (heights @ np.exp(-2j * np.pi * bend.q * tau)) * np.exp(-2j * np.pi * spot.s * geometry.y)
    wave = geometry.bridged(wave[:, None])[:, 0]
    box = np.ones(max(round(smoothed * geometry.rows), 1) | 1)
    smooth = np.convolve(np.convolve(wave, box, "same"), box, "same")
    phase = np.unwrap(np.angle(smooth)) / (2.0 * np.pi)
    coefficients = np.polynomial.polynomial.polyfit(geometry.y, phase, order, w=np.abs(smooth))[1:]
    coefficients[0] += spot.s
    return np.asarray(coefficients, dtype=np.float64)


def column_phase(
    geometry: Geometry, heights: Floats, forward: bool, bend: Bend, polynomial: Floats
) -> tuple[Floats, Bools]:
    """Return a spot's phase along a levelled image, and where it is measured.

    Of every column it is the mean over one period. Over a whole period of x the harmonics, and the spot's other half,
    cancel. Within half a period of the ends the phase is that of the last whole one.

    Parameters
    ----------
    heights
        Levelled heights, shape (rows, columns).
    polynomial
        s_1, s_2, ... in periods, shape (order,).

    Returns
    -------
    tuple
        The phase in periods, and True where it is measured, shape (columns,) each.

    Raises
    ------
    Unphysical
        If the branch runs backwards.
    """
    tau = _required(_inverse(bend.shape.coordinates, geometry.sweep(forward)))
    x = tau if forward else 1.0 - tau
    turns = np.polynomial.polynomial.polyval(geometry.y, np.append(0.0, polynomial))
    wave = (np.exp(-2j * np.pi * turns) @ heights) * np.exp(-2j * np.pi * bend.q * x)
    steps = 0.5 * (wave[1:] + wave[:-1]) * np.diff(x)
    total = np.append(0.0, np.cumsum(steps))
    half = 0.5 / bend.q
    middle = np.clip(x, x[0] + half, x[-1] - half)
    mean = np.interp(middle + half, x, total) - np.interp(middle - half, x, total)
    return bend.q * x + np.unwrap(np.angle(mean)) / (2.0 * np.pi), np.abs(x - middle) < 1e-9


def _straightened(geometry: Geometry, heights: Floats, branch: BranchShape) -> tuple[Floats, float]:
    """Resample a forward image at even steps of x; return it, and how much of the line they span."""
    low, high = (float(edge) for edge in branch.inverse(geometry.place[[0, -1]]))
    count = geometry.columns
    at = (branch.value(np.linspace(low, high, count)) - geometry.place[0]) / (geometry.place[1] - geometry.place[0])
    before = np.clip(at.astype(np.int64), 0, count - 2)
    part = at - before
    return heights[:, before] * (1.0 - part) + heights[:, before + 1] * part, (high - low) * count / (count - 1)


@lru_cache(maxsize=1)
def _grid() -> tuple[Floats, Floats, Floats]:
    tau = np.linspace(0.0, 1.0, 513)
    return tau, *BranchShape.basis(tau)


def _inverse(coordinates: Floats, u: Floats) -> Floats | None:
    """Return tau(u), near enough to begin with; None where the branch runs backwards."""
    tau, first, second = _grid()
    value = tau + coordinates[0] * first + coordinates[1] * second
    if np.min(np.diff(value)) < 0.1 / 512:
        return None
    return np.interp(u, value, tau)


def _required(tau: Floats | None) -> Floats:
    """Raise ``Unphysical`` where the branch that fits best runs backwards: no scanner has such a branch."""
    if tau is None:
        raise Unphysical(
            "the branch that fits best runs backwards; are rows that jump, steps or debris in the image? Crop it, or "
            "choose another --channel"
        )
    return tau


def second_base(
    geometry: Geometry, heights: Floats, shape: Floats, harmonics: Floats, amplitude: float, order: int
) -> tuple[Spot, Floats] | None:
    """Find another spot in the residual of a forward image, beside the first one and its harmonics.

    Parameters
    ----------
    heights
        Residual heights, shape (rows, columns).
    shape
        Coordinates of the branch, shape (2,).
    harmonics
        q and s of the first wave and its harmonics, in periods, shape (n, 2).
    amplitude
        Amplitude of the first wave, in heights.
    order
        Order of the polynomial in the rows.

    Returns
    -------
    tuple or None
        The spot, and its polynomial in the rows, in periods, shape (order,); None where no spot has a tenth of
        ``amplitude``.
    """
    branch = BranchShape.at(shape)
    straight, span = _straightened(geometry, heights, branch)
    weight = np.hanning(geometry.rows + 2)[1:-1, None] * np.hanning(geometry.columns + 2)[1:-1]
    power = np.abs(np.fft.rfft2(weight * straight)) ** 2
    q, s = np.arange(power.shape[1]) / span, np.arange(geometry.rows)
    power[:, q < 1.0] = 0.0
    for one_q, one_s in harmonics:
        away = (s - one_s + 0.5 * geometry.rows) % geometry.rows - 0.5 * geometry.rows
        power[np.ix_(np.abs(away) < 2.5, np.abs(q - one_q) < 2.5)] = 0.0
    row, column = divmod(int(np.argmax(power)), power.shape[1])
    least = max(
        _MIN_SPOT_POWER * float(np.mean(power)), (_MIN_SECOND_AMPLITUDE * 0.5 * amplitude * float(np.sum(weight))) ** 2
    )
    if not power[row, column] > least:
        return None
    spot = Spot(float(q[column]), float(row if row <= geometry.rows / 2 else row - geometry.rows), float(shape[0]))
    bend = Bend(spot.q, branch, 0.0)
    return spot, row_polynomial(geometry, heights, bend, spot, order, _MIN_SIDE_DISTANCE)
