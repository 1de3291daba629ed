"""How far trace and retrace agree, before and after: what a user can check without knowing the sample."""

from dataclasses import dataclass
from math import sqrt

import numpy as np

from tablegen.correction.distortion import Distortion
from tablegen.numerics.arrays import Bools, Floats

_STRIPS = 16  # parts of the line that are registered by themselves, each as wide as two of them
_MIN_STRIP = 12  # pixels
_REACH = 6  # pixels: how far a strip is searched
_STEPS = 8  # of Newton's way to the best shift
_LEAST_CONTRAST = 0.25  # of the variance of a strip that has to be the same in both images


@dataclass(frozen=True, eq=False)
class Agreement:
    """Trace against retrace.

    ``difference`` is the rms of their difference over that of both, levelled by lines, before and after: 1 where they
    have nothing in common, and never less than their noise. ``place`` and ``apart`` are the columns of the straight
    image at which they were registered, and by how many pixels the retrace shows things further right: before, after.
    """

    difference: tuple[float, float]
    place: Floats
    apart: tuple[Floats, Floats]

    @property
    def worst(self) -> tuple[float, float] | None:
        """The largest distance in pixels, before and after; None where nothing could be registered."""
        if not len(self.place):
            return None
        before, after = (float(np.max(np.abs(one))) for one in self.apart)
        return before, after


def agreement(raw: tuple[Floats, Floats], straight: tuple[Floats, Floats], distortion: Distortion) -> Agreement:
    """Of one channel, trace and retrace, as taken and straight, each rows x columns; NaN where nothing was imaged.

    What was apart before is what is apart afterwards and what both were moved by: a period too far, as a lattice
    allows it, is not taken for a match.
    """
    trace, retrace = straight
    place, after = _registered(trace, retrace)
    columns = np.arange(trace.shape[1])
    with np.errstate(invalid="ignore"):
        moved = [_mean_of_columns(distortion.moved(forward)[0]) for forward in (True, False)]
    known = np.isfinite(moved[0]) & np.isfinite(moved[1])
    by = np.interp(place, columns[known], (moved[1] - moved[0])[known])
    return Agreement((difference(*raw), difference(*straight)), place, (after + by, after))


def _mean_of_columns(values: Floats) -> Floats:
    seen = np.isfinite(values)
    count = np.sum(seen, axis=0)
    total = np.sum(np.where(seen, values, 0.0), axis=0)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def difference(one: Floats, other: Floats) -> float:
    """Compute the rms of the difference of two images over that of both, each line less its mean.

    Pixels that are NaN in either image do not count.
    """
    both: Bools = np.isfinite(one) & np.isfinite(other)
    first, second = (levelled(np.where(both, image, np.nan)) for image in (one, other))
    power = float(np.sum(first**2) + np.sum(second**2))
    return sqrt(float(np.sum((first - second) ** 2)) / power) if power > 0.0 else 0.0


def levelled(image: Floats) -> Floats:
    """Each line less its mean; 0 where nothing was imaged, which is NaN."""
    seen = np.isfinite(image)
    count = np.maximum(np.sum(seen, axis=1, keepdims=True), 1)
    mean = np.sum(np.where(seen, image, 0.0), axis=1, keepdims=True) / count
    return np.where(seen, image - mean, 0.0)


def _registered(trace: Floats, retrace: Floats) -> tuple[Floats, Floats]:
    """Columns, and by how much the retrace shows what is there further right."""
    columns = trace.shape[1]
    width = max(columns // _STRIPS * 2, _MIN_STRIP)
    places, shifts = [], []
    for first in range(_REACH + 1, columns - width - _REACH, max(width // 2, 1)):
        part = slice(first - _REACH - 1, first + width + _REACH + 1)
        rows = np.all(np.isfinite(trace[:, part]) & np.isfinite(retrace[:, part]), axis=1)
        if int(np.sum(rows)) < max(8, trace.shape[0] // 8):
            continue
        shift = _shift(trace[rows, part], retrace[rows, part])
        if shift is not None:
            places.append(first + 0.5 * (width - 1))
            shifts.append(shift)
    return np.array(places), np.array(shifts)


def _shift(trace: Floats, retrace: Floats) -> float | None:
    """Pixels, within ``_REACH``, for a strip with as many more columns on either side; None where nothing is alike."""
    margin = _REACH + 1
    inner = trace.shape[1] - 2 * margin
    seen = trace[:, margin : margin + inner]
    seen = seen - np.mean(seen, axis=1, keepdims=True)

    def left(by: float) -> Floats:
        at = margin + by + np.arange(inner)
        low = np.floor(at).astype(np.int64)
        low = np.minimum(low, retrace.shape[1] - 2)
        there = retrace[:, low] + (at - low) * (retrace[:, low + 1] - retrace[:, low])
        return np.asarray(seen - (there - np.mean(there, axis=1, keepdims=True)), dtype=np.float64)

    costs = np.array([float(np.mean(left(by) ** 2)) for by in range(-_REACH, _REACH + 1)])
    dips = [i for i in range(1, len(costs) - 1) if costs[i] <= min(costs[i - 1], costs[i + 1])]
    low = float(np.min(costs))
    near = [i for i in dips if costs[i] <= 1.2 * low]
    if not near:
        return None
    shift = float(min(near, key=lambda i: abs(i - _REACH)) - _REACH)
    alike = 1.0 - 0.5 * low / max(float(np.mean(seen**2)), 1e-300)
    if alike < _LEAST_CONTRAST:
        return None
    slope = np.gradient(seen, axis=1)
    power = float(np.sum(slope**2))
    for _ in range(_STEPS):
        step = float(np.sum(slope * left(shift))) / max(power, 1e-300)
        shift = float(np.clip(shift + step, -_REACH, _REACH))
    return shift
