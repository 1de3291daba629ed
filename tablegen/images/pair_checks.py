"""Checks of the images of a scan, before and after a fit; shared by every reader of images.

Each check raises ``Unphysical``, whose message says what to do. Names are those of the images: "trace", "retrace".
"""

from typing import Literal

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.base.remedies import REMEDIES
from tablegen.images.missing import valid_pixels
from tablegen.numerics.arrays import Floats, Ints

MIN_PIXELS = 32  # rows and columns
MIN_PERIODS = 3.0  # in the line
MAX_PERIODS_PER_COLUMN = 0.33  # where a branch may compress them by a third
ALIASING_HINT = " (periods finer than two pixels look like that too)"
_MAX_CLIPPED = 0.04  # share of the pixels that may have the least height, or the largest
_CLIPPED_STEP = 0.01  # share of the heights' range: heights this near to a limit are compared with it
_CLIPPED_SPIKE = 4.0  # times the pixels next to it
_MAX_LINE_POWER = 100.0  # times the usual power of a line
_FLAT, _MANY_FLAT = 1e-9, 0.02  # share of the largest power of a line; share of all lines
# Of the measured and the nominal size: below the root of two and of three. Drift changes the height, not the width.
_MAX_SIZE_RATIO = {"line": 1.4, "frame": 1.6}
_STRIPS = 8  # of the columns, in each of which trace and retrace are matched
_REACH = 0.12  # share of the columns: largest distance of trace and retrace in the search
_MIRRORED = 1.5, 0.25  # ratio to the straight match, and least correlation, of a mirrored retrace
_LEAST_POWER = 1e-12  # of unit variance: what has less is a constant


class FinePeriods(Unphysical):
    """Periods finer than the columns resolve: no other cell of the sample is searched for them."""


def check_pair(trace: Floats, retrace: Floats) -> None:
    """Check that two images can be of one scan: they have one shape, and are not the same image.

    Parameters
    ----------
    trace, retrace
        Heights in any unit, shape (rows, columns) each.

    Raises
    ------
    Unphysical
        If the shapes differ, the images are equal, or one of them fails ``check_heights``.
    """
    if trace.shape != retrace.shape:
        sizes = " and ".join(f"{image.shape[0]} x {image.shape[1]}" for image in (trace, retrace))
        raise Unphysical(f"trace and retrace have {sizes} pixels; both must be from one scan")
    for name, image in (("trace", trace), ("retrace", retrace)):
        check_heights(name, image)
    if any(np.array_equal(trace, one, equal_nan=True) for one in (retrace, retrace[:, ::-1])):
        raise Unphysical(
            "trace and retrace are the same image; both directions are needed, since the scanner file has a branch for "
            "each"
        )


def check_heights(name: str, image: Floats) -> None:
    """Check an image: enough rows and columns, contrast, no saturation at the end of a range.

    Parameters
    ----------
    name
        Name of the image in a message.
    image
        Heights in any unit, shape (rows, columns); NaN where a pixel is missing.

    Raises
    ------
    Unphysical
        If the image fails a check.
    """
    if image.ndim != 2 or min(image.shape) < MIN_PIXELS:
        raise Unphysical(f"{' x '.join(map(str, image.shape))} pixels are too few; {MIN_PIXELS} rows and columns do")
    there = image[np.isfinite(image)]
    if not len(there):
        raise Unphysical(f"the {name} has no pixel with a height; was a different channel saved?")
    low, high = float(np.min(there)), float(np.max(there))
    if not high > low:
        raise Unphysical(f"the {name} has no contrast: all its pixels are {low:g}; was a different channel saved?")
    moving = image[valid_pixels(image)]  # lines of a scan that was stopped are another matter
    if not len(moving):
        raise Unphysical(f"the {name} has no contrast along its lines")
    low, high = float(np.min(moving)), float(np.max(moving))
    step = _CLIPPED_STEP * (high - low)
    for limit, inward in ((low, 1.0), (high, -1.0)):
        at = int(np.sum(moving == limit))
        beside = int(np.sum((moving != limit) & ((moving - limit) * inward <= step)))
        if at > max(_MAX_CLIPPED * moving.size, _CLIPPED_SPIKE * beside):
            raise Unphysical(
                f"the {name} is saturated: {100.0 * at / moving.size:.2g} % of its pixels are {limit:g}, the "
                f"{'largest' if inward < 0.0 else 'least'} height; scan again with more range, or save heights "
                f"without a clipped colour scale"
            )


def check_lines(name: str, level: Floats, largest: float, rows: Ints | None = None) -> None:
    """Check that levelled lines have contrast, and all about as much.

    Parameters
    ----------
    name
        Name of the image in a message.
    level
        Levelled heights, shape (rows, columns).
    largest
        Largest height before levelling, in the unit of ``level``.
    rows
        Numbers of the rows in the image, counted from 0; all of them by default.

    Raises
    ------
    Unphysical
        If there is no contrast along the lines, many lines are flat, or a few have most of the contrast.
    """
    if not np.max(np.abs(level)) > 1e-12 * largest:
        raise Unphysical(f"the {name} has no contrast along its lines")
    numbers = np.arange(len(level)) + 1 if rows is None else rows + 1
    power = np.sum(level**2, axis=1)
    flat = np.flatnonzero(power <= _FLAT * np.max(power))
    if len(flat) > _MANY_FLAT * len(power):
        raise Unphysical(
            f"{len(flat)} rows of the {name}, from {numbers[flat[0]]} to {numbers[flat[-1]]}, have no contrast, as of "
            f"a scan that was stopped; crop both images"
        )
    loud = np.flatnonzero(power > _MAX_LINE_POWER * np.median(power))
    if np.sum(power[loud]) > 0.5 * np.sum(power):
        raise Unphysical(
            f"rows {numbers[loud[0]]} to {numbers[loud[-1]]} have most of the {name}'s contrast; crop them"
        )


def check_periods(periods: float, span: float, columns: int) -> None:
    """Check the number of periods in the line, of which the columns show ``span``.

    Raises
    ------
    FinePeriods
        If they are finer than the columns resolve.
    Unphysical
        If they are too few to fit.
    """
    if periods * span > MAX_PERIODS_PER_COLUMN * columns:
        raise FinePeriods(f"{periods:.3g} periods in {columns} columns are too fine; {REMEDIES['few-pixels']}")
    if periods < MIN_PERIODS - 0.2:
        raise Unphysical(
            f"the line has about {periods:.2g} periods; at least {MIN_PERIODS:g} are needed: scan more of them"
        )


def check_size(measured_nm: float, nominal_nm: float, source: str, side: Literal["line", "frame"] = "line") -> None:
    """Check the size in nm by the sample's constant against the nominal one, whose origin is ``source``.

    A constant of another direction of a lattice is wrong by the root of two or of three, an alias by more.

    Raises
    ------
    Unphysical
        If the lines differ by a factor of 1.4 or more, or the frames by one of 1.6.
    """
    ratio = measured_nm / nominal_nm
    long = "long" if side == "line" else "high"
    if not 1.0 / _MAX_SIZE_RATIO[side] < ratio < _MAX_SIZE_RATIO[side]:
        raise Unphysical(
            f"the {side} is {measured_nm:.4g} nm {long} by the sample's constant, and {nominal_nm:.4g} nm by "
            f"{source}; is the constant that of this sample, the lattice of this kind, and a period more than "
            f"two pixels?"
        )


def check_mirrored(trace: Floats, retrace: Floats, advice: str) -> None:
    """Check that the retrace, with its left end on the left, shows what the trace shows.

    It holds for any sample but its own mirror image. Strips of both images are matched by themselves, so that
    hysteresis does not hide the match.

    Parameters
    ----------
    trace, retrace
        Heights in any unit, shape (rows, columns) each.
    advice
        What the message suggests.

    Raises
    ------
    Unphysical
        If the mirrored retrace matches better.
    """
    straight, turned = _match(trace, retrace), _match(trace, retrace[:, ::-1])
    if turned > _MIRRORED[0] * max(straight, 0.0) and turned > _MIRRORED[1]:
        raise Unphysical(f"the retrace shows the trace's pattern only when it is mirrored; {advice}{ALIASING_HINT}")


def _match(one: Floats, other: Floats) -> float:
    """Return the median over strips of the best correlation of one's strip with the other's columns near by."""
    columns = one.shape[1]
    width, reach = max(columns // _STRIPS, 8), max(round(_REACH * columns), 2)
    lags = []
    for start in range(0, columns - width + 1, width):
        strip = _plain(one[:, start : start + width])
        best = -1.0
        for at in range(max(start - reach, 0), min(start + reach, columns - width) + 1):
            best = max(best, float(np.mean(strip * _plain(other[:, at : at + width]))))
        lags.append(best)
    return float(np.median(lags))


def _plain(strip: Floats) -> Floats:
    """Remove the rows' means and slopes, and scale to unit variance."""
    ramp = np.linspace(-1.0, 1.0, strip.shape[1])
    level = strip - strip.mean(axis=1, keepdims=True)
    level = level - np.outer(level @ ramp / (ramp @ ramp), ramp)
    power = float(np.sqrt(np.mean(level**2)))
    return level / power if power > _LEAST_POWER else np.zeros_like(level)
