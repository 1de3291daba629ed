"""The band-limited waveform that is straight where the image is taken, and of low acceleration where it is not.

Minimised over the coefficients c::

    J(c) = sum_j [ (w'(t_j) - u'(t_j))^2 / u'(t_j)^2 + VALUE_WEIGHT (w(t_j) - u(t_j))^2 ] / N
         + SMOOTHNESS sum_n (2 pi n)^4 (a_n^2 + b_n^2) / 2

subject to 0 <= w <= 1. The t_j are the Gauss-Chebyshev nodes of each imaging window: equal weights there are the
weight 1 / sqrt(x (1 - x)) of the near-minimax approximation, so that the error does not pile up at the
edges of the window, where it would cost image. The last term is the mean square acceleration: it picks, of all
waveforms that are as straight, the one that excites the scanner least. Derivation: docs/waveform.md.
"""

from collections.abc import Sequence
from functools import lru_cache
from math import tau

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.numerics.arrays import Floats, freeze, tree_sum, tree_sum_down
from tablegen.numerics.linear import Cholesky
from tablegen.numerics.turns import cosine, sine_and_cosine
from tablegen.waveform.refined import WaveformShape
from tablegen.waveform.series import FourierSeries

# Keeps the fit on the line, not only parallel to it, where the harmonics are too few for both.
VALUE_WEIGHT = 100.0
# Small enough to cost nothing inside the window (0.005 % at H = 32), large enough to keep the system regular.
SMOOTHNESS = 1e-12
# Where the fit would leave [0, 1] its extremes are held this far inside.
_RANGE_MARGIN = 1e-3
_MAX_RANGE_ROUNDS = 40
_BLOCK = 1 << 17  # sines and cosines that are computed at a time, and cached where they are all of a window: 2 MB


def fit_window(shape: WaveformShape, harmonics: int, window: tuple[float, float], both: bool) -> FourierSeries:
    """Fit harmonics 1..``harmonics`` to the line inside ``window`` (normalised position) of the imaging branches.

    Raises
    ------
    Unphysical
        If that many harmonics leave the range [0, 1].
    """
    times = _nodes(shape.turn, harmonics, window, both)
    return _fitted(times.tobytes(), shape.value(times).tobytes(), shape.slope(times).tobytes(), harmonics)


@lru_cache(maxsize=4)  # a sweep and the remedies of a warning change one axis, or what no waveform depends on
def _fitted(at: bytes, values: bytes, slopes: bytes, harmonics: int) -> FourierSeries:
    """Return the fit to values and slopes at times, which are all that it depends on; each is the bytes of float64."""
    times, value, slope = (np.frombuffer(each) for each in (at, values, slopes))
    slope_weight = 1.0 / (slope * slope)
    value_weight = np.full_like(times, VALUE_WEIGHT)
    normal, right = normal_equations(times, value, slope, value_weight, slope_weight, harmonics, SMOOTHNESS)
    try:
        factor = Cholesky(normal)
    except ArithmeticError:  # pragma: no cover - the smoothness term keeps every pivot positive
        raise Unphysical("the window fit is singular; ask for fewer harmonics or a wider window") from None
    free = factor.solve(right)
    return _within_range(free, factor, harmonics)


def _nodes(turn: float, harmonics: int, window: tuple[float, float], both: bool) -> Floats:
    position = window[0] + (window[1] - window[0]) * _chebyshev(4 * harmonics + 32)
    forward = turn * position
    if not both:
        return forward
    return np.concatenate([forward, turn + (1.0 - turn) * (1.0 - position)])


@lru_cache(maxsize=4)  # for the harmonics of both axes
def _chebyshev(count: int) -> Floats:
    """Return the Gauss-Chebyshev nodes of (0, 1)."""
    x = 0.5 - 0.5 * cosine((np.arange(count) + 0.5) / (2 * count))
    freeze(x)
    return x


def normal_equations(
    times: Floats,
    value: Floats,
    slope: Floats,
    value_weight: Floats,
    slope_weight: Floats,
    harmonics: int,
    smoothness: float,
) -> tuple[Floats, Floats]:
    """Return Gram matrix and right side of a fit to values and slopes, in the basis 1, cos 1..H, sin 1..H.

    Products of two harmonics depend on the sum and the difference of their numbers alone, so that 4 H + 2 sums
    over the nodes give all (2 H + 1)^2 entries.

    Parameters
    ----------
    times, value, slope, value_weight, slope_weight
        Nodes in periods, what is fitted there, and its weights; each (m,).

    Returns
    -------
    normal, right
        Shapes (2 H + 1, 2 H + 1) and (2 H + 1,).
    """
    weights = (value_weight, slope_weight, value_weight * value, slope_weight * slope)
    by_value, by_slope, right_value, right_slope = _sums(times, weights, 2 * harmonics)
    order = np.arange(harmonics + 1)
    minus, plus = order[:, None] - order[None, :], order[:, None] + order[None, :]
    sign = np.sign(minus)
    normal = np.zeros((2 * harmonics + 1, 2 * harmonics + 1))
    for (cosines, sines), derivative in ((by_value, False), (by_slope, True)):
        cos_cos = 0.5 * (cosines[np.abs(minus)] + cosines[plus])
        sin_sin = 0.5 * (cosines[np.abs(minus)] - cosines[plus])
        sin_cos = 0.5 * (sines[plus] + sign * sines[np.abs(minus)])  # sin of the row, cosine of the column
        if derivative:  # cos -> -2 pi n sin, sin -> +2 pi n cos
            rate = tau * order
            scale = rate[:, None] * rate[None, :]
            cos_cos, sin_sin, sin_cos = scale * sin_sin, scale * cos_cos, -scale * sin_cos.T
        normal[: harmonics + 1, : harmonics + 1] += cos_cos
        normal[harmonics + 1 :, harmonics + 1 :] += sin_sin[1:, 1:]
        normal[harmonics + 1 :, : harmonics + 1] += sin_cos[1:, :]
        normal[: harmonics + 1, harmonics + 1 :] += sin_cos[1:, :].T

    value_c, value_s, slope_c, slope_s = (part[: harmonics + 1] for part in (*right_value, *right_slope))
    rate = tau * order
    right = np.concatenate([value_c - rate * slope_s, (value_s + rate * slope_c)[1:]])

    square = rate * rate  # not rate**4: the power function's last bit is the processor's
    energy = 0.5 * smoothness * square * square
    diagonal = np.arange(2 * harmonics + 1)
    normal[diagonal, diagonal] += np.concatenate([energy, energy[1:]])
    return normal, right


def _sums(times: Floats, weights: Sequence[Floats], highest: int) -> list[tuple[Floats, Floats]]:
    """Return the means over the times of cosine and of sine of harmonics 0..``highest``, times each of the weights."""
    count = len(times)
    sums = [(np.empty(highest + 1), np.empty(highest + 1)) for _ in weights]
    rows = max(_BLOCK // count, 1)
    waves = _cached_waves if count * highest <= _BLOCK else _waves
    for first in range(0, highest + 1, rows):
        block = slice(first, min(first + rows, highest + 1))
        s, c = waves(times.tobytes(), block.start, block.stop)
        products = np.empty_like(s)
        for weight, (cosines, sines) in zip(weights, sums, strict=True):
            cosines[block] = tree_sum_down(np.multiply(c, weight[:, None], out=products)) / count
            sines[block] = tree_sum_down(np.multiply(s, weight[:, None], out=products)) / count
    return sums


def _waves(times: bytes, first: int, stop: int) -> tuple[Floats, Floats]:
    """Return sine and cosine of harmonics [first, stop) at times, each (times, harmonics)."""
    n = np.arange(first, stop, dtype=np.float64)
    return sine_and_cosine(np.frombuffer(times)[:, None] * n[None, :])


_cached_waves = lru_cache(maxsize=4)(_waves)  # in a batch the windows of both axes are often the same


def _series(c: Floats, harmonics: int) -> FourierSeries:
    return FourierSeries(float(c[0]), c[1 : harmonics + 1], c[harmonics + 1 :])


def _within_range(free: Floats, factor: Cholesky, harmonics: int) -> FourierSeries:
    """Return the minimiser of the same J with its extremes held inside [0, 1], by equality at those that would leave.

    Active set on a grid of 32 points per period of the highest harmonic: add the worst offender of each excursion,
    drop constraints that are not active, solve again. With Z = A^-1 C^T the constrained minimum is free + Z multiplier.
    """
    points = 32 * harmonics
    grid = np.arange(points) / points
    active: list[tuple[int, float]] = []  # grid point, level
    columns: dict[int, Floats] = {}
    c = free
    swing = (0.0, 1.0)  # range of the free fit, for the message
    for attempt in range(_MAX_RANGE_ROUNDS):
        w = _series(c, harmonics).on_grid(points)
        swing = swing if attempt else (float(np.min(w)), float(np.max(w)))
        if float(np.min(w)) >= 0.0 and float(np.max(w)) <= 1.0:
            return _series(c, harmonics)
        active_points = {point for point, _ in active}
        for point in _excursions(w):
            if point not in active_points:
                active.append((point, 1.0 - _RANGE_MARGIN if w[point] > 0.5 else _RANGE_MARGIN))
        if len(active) > harmonics:
            break
        for point, _ in active:
            if point not in columns:
                columns[point] = _basis(float(grid[point]), harmonics)
        active, c = _hold(free, factor, active, columns)
    raise Unphysical(
        f"{harmonics} harmonics straight in this window swing over {swing[0]:.4f}..{swing[1]:.4f} of the line; "
        f"ask for more harmonics, a narrower window, or another method"
    )


def _excursions(w: Floats) -> list[int]:
    """Return the extreme point of every stretch outside [0, 1]; near neighbours are the same excursion."""
    beyond = np.maximum(w - 1.0, -w)
    peak = (beyond > 0.0) & (beyond >= np.roll(beyond, 1)) & (beyond > np.roll(beyond, -1))
    return [int(point) for point in np.flatnonzero(peak)]


def _basis(t: float, harmonics: int) -> Floats:
    s, c = sine_and_cosine(np.arange(harmonics + 1) * t)
    return np.concatenate([c, s[1:]])


def _hold(
    free: Floats, factor: Cholesky, active: list[tuple[int, float]], columns: dict[int, Floats]
) -> tuple[list[tuple[int, float]], Floats]:
    """Solve with equality at the active points, and release points whose multiplier pulls outwards."""
    while True:
        rows = np.stack([columns[point] for point, _ in active])
        responses = np.stack([factor.solve(row) for row in rows])
        levels = np.array([level for _, level in active])
        gram = tree_sum(rows[:, None, :] * responses[None, :, :])
        lack = levels - tree_sum(rows * free)
        try:
            multiplier = Cholesky(0.5 * (gram + gram.T)).solve(lack)
        except ArithmeticError:
            raise Unphysical("the range [0, 1] cannot be held with so few harmonics; ask for more") from None
        outward = [i for i, (_, level) in enumerate(active) if (multiplier[i] > 0.0) == (level > 0.5)]
        if not outward or len(active) == 1:
            c = free.copy()
            for i in range(len(active)):
                c = c + multiplier[i] * responses[i]
            return active, c
        worst = max(outward, key=lambda i: abs(multiplier[i]))
        active = [entry for i, entry in enumerate(active) if i != worst]
