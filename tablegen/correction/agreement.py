"""Agreement of trace and retrace, before and after: a check that needs no knowledge of the sample."""

from dataclasses import dataclass
from math import sqrt

import numpy as np

from tablegen.correction.distortion import Distortion
from tablegen.numerics.arrays import Bools, Floats

_STRIPS = 16  # steps of the overlapping strips that are registered, each two steps wide
_MIN_STRIP = 12  # pixels
_REACH = 6  # pixels: how far a strip is searched
_STEPS = 8  # of the Newton iteration to the best shift
_LEAST_CONTRAST = 0.25  # of the variance of a strip that has to be the same in both images


@dataclass(frozen=True, eq=False)
class Agreement:
    """Agreement of trace and retrace.

    ``difference`` is the rms of their difference over that of both, levelled by lines, before and after: 1 where they
    have nothing in common, and never less than their noise. ``place`` are the columns of the straight image at which
    they were registered, shape (strips,), and ``offsets`` the pixels by which the retrace shows the sample further
    right, before and after, shape (strips,) each.
    """

    difference: tuple[float, float]
    place: Floats
    offsets: tuple[Floats, Floats]

    @property
    def worst(self) -> tuple[float, float] | None:
        """The largest distance in pixels, before and after; None where no strip could be registered."""
        if not len(self.place):
            return None
        before, after = (float(np.max(np.abs(one))) for one in self.offsets)
        return before, after


def agreement(raw: tuple[Floats, Floats], straight: tuple[Floats, Floats], distortion: Distortion) -> Agreement:
    """Compare trace and retrace of one channel, before and after the correction.

    The offset before is computed from that after and the displacement of both: a whole period of a lattice is not taken
    for a match.

    Parameters
    ----------
    raw, straight
        Trace and retrace as recorded and corrected, shape (rows, columns) each; NaN where nothing was imaged.
    """
    trace, retrace = straight
    place, after = _registered(trace, retrace)
    columns = np.arange(trace.shape[1])
    with np.errstate(invalid="ignore"):
        displacements = [_mean_of_columns(distortion.displacement(forward)[0]) for forward in (True, False)]
    imaged = np.isfinite(displacements[0]) & np.isfinite(displacements[1])
    by = np.interp(place, columns[imaged], (displacements[1] - displacements[0])[imaged])
    return Agreement((difference(*raw), difference(*straight)), place, (after + by, after))


def _mean_of_columns(values: Floats) -> Floats:
    imaged = np.isfinite(values)
    count = np.sum(imaged, axis=0)
    total = np.sum(np.where(imaged, values, 0.0), axis=0)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def difference(one: Floats, other: Floats) -> float:
    """Compute the rms of the difference of two images over that of both, each line less its mean.

    Parameters
    ----------
    one, other
        Heights of the same unit, shape (rows, columns); pixels that are NaN in either image do not count.

    Returns
    -------
    The ratio; 0 if no pixel counts.
    """
    both: Bools = np.isfinite(one) & np.isfinite(other)
    first, second = (levelled(np.where(both, image, np.nan)) for image in (one, other))
    power = float(np.sum(first**2) + np.sum(second**2))
    return sqrt(float(np.sum((first - second) ** 2)) / power) if power > 0.0 else 0.0


def levelled(image: Floats) -> Floats:
    """Subtract its mean from each line.

    Parameters
    ----------
    image
        Heights, shape (rows, columns); NaN where nothing was imaged.

    Returns
    -------
    Levelled heights, of the same shape; 0 where nothing was imaged.
    """
    imaged = np.isfinite(image)
    count = np.maximum(np.sum(imaged, axis=1, keepdims=True), 1)
    mean = np.sum(np.where(imaged, image, 0.0), axis=1, keepdims=True) / count
    return np.where(imaged, image - mean, 0.0)


def _registered(trace: Floats, retrace: Floats) -> tuple[Floats, Floats]:
    """Return columns, and by how many pixels the retrace shows the same further right."""
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
    """Return the shift of a strip in pixels, with a margin for ``_REACH`` on either side; None without a match."""
    margin = _REACH + 1
    inner = trace.shape[1] - 2 * margin
    strip = trace[:, margin : margin + inner]
    strip = strip - np.mean(strip, axis=1, keepdims=True)

    def residual(by: float) -> Floats:
        first = int(np.floor(margin + by))
        there = retrace[:, first : first + inner]
        if share := margin + by - first:
            there = there + share * (retrace[:, first + 1 : first + 1 + inner] - there)
        return np.asarray(strip - (there - np.mean(there, axis=1, keepdims=True)), dtype=np.float64)

    costs = np.array([float(np.mean(residual(by) ** 2)) for by in range(-_REACH, _REACH + 1)])
    dips = [i for i in range(1, len(costs) - 1) if costs[i] <= min(costs[i - 1], costs[i + 1])]
    low = float(np.min(costs))
    near = [i for i in dips if costs[i] <= 1.2 * low]
    if not near:
        return None
    shift = float(min(near, key=lambda i: abs(i - _REACH)) - _REACH)
    alike = 1.0 - 0.5 * low / max(float(np.mean(strip**2)), 1e-300)
    if alike < _LEAST_CONTRAST:
        return None
    slope = np.gradient(strip, axis=1)
    power = float(np.sum(slope**2))
    for _ in range(_STEPS):
        step = float(np.sum(slope * residual(shift))) / max(power, 1e-300)
        shift = float(np.clip(shift + step, -_REACH, _REACH))
    return shift
