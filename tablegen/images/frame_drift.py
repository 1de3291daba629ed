"""Drift between images of one place: the shift from each to the next, over the time between them."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from tablegen.base.input_errors import Problem, Rejected
from tablegen.images.files import ScanImage
from tablegen.images.image_shift import ImagePair, ImageShift, image_shift
from tablegen.numerics.arrays import Floats

_LEAST_CORRELATION = 0.4  # images of other places have less, or several shifts that are as likely
_LEAST_SIGNIFICANCE = 4.0  # images with few features agree somewhere by chance
_SAME_ANGLE_DEG = 0.05
_SAME_SIZE = 1e-3  # of width and height
_MOST_SHOWN = 6  # shifts in a message


@dataclass(frozen=True, eq=False)
class DriftInterval:
    """From one image to the next: shift, and time in seconds between the same place in both."""

    shift: ImageShift
    seconds: float


def drift_intervals(
    images: Sequence[Sequence[ScanImage]], seconds_apart: float | None, within_nm: float | None
) -> list[DriftInterval]:
    """Register each image against the one before.

    Parameters
    ----------
    images
        Of each image one direction or both, in the order of time.
    seconds_apart
        Time from the start of an image to that of the next, in s; by default frames of a movie follow each other.
    within_nm
        Largest shift from an image to the next, in nm; without it, the shift has to be the only possible one.

    Raises
    ------
    Rejected
        If images do not show the same place, their shift is ambiguous, or their time or size is unknown.
    """
    intervals = []
    for one, other in pairwise(images):
        _check_alike(one[0], other[0])
        apart = _seconds_apart(one[0], other[0]) if seconds_apart is None else seconds_apart
        reach = None if within_nm is None else within_nm / _nm_per_pixel(one[0])
        pairs = [ImagePair(a.heights, b.heights) for a, b in zip(one, other, strict=False)]
        shift = image_shift(pairs, reach)
        _check_shift(shift, one[0], other[0], within_nm)
        rate = one[0].line_rate_hz
        intervals.append(DriftInterval(shift, apart + (float(shift.pixels[1]) / rate if rate else 0.0)))
    return intervals


def pixel_size(image: ScanImage) -> Floats | None:
    """Return width and height of a pixel in nm; None where the file has no size."""
    rows, columns = image.heights.shape
    if not image.width_nm or not image.height_nm:
        return None
    return np.array([image.width_nm / columns, image.height_nm / rows])


def image_name(image: ScanImage) -> str:
    """Return the file, and the frame of a movie."""
    return f"{image.file} frame {image.frame}" if image.frames > 1 else image.file


def _nm_per_pixel(image: ScanImage) -> Floats:
    size = pixel_size(image)
    if size is None:
        raise Rejected([Problem(image.file, 0, "", "has no size, which --within needs: it is in nm")])
    return size


def _seconds_apart(one: ScanImage, other: ScanImage) -> float:
    rate, frames = one.line_rate_hz, other.frame - one.frame
    if one.source != other.source or one.frames == 1 or frames < 1 or not rate:
        why = "the time between the images is unknown; give --seconds-apart, from start to start"
        raise Rejected([Problem(image_name(other), 0, "", why)])
    return frames * len(one.heights) / rate


def _check_alike(one: ScanImage, other: ScanImage) -> None:
    """Check that two images have the same pixels, size, angle and slow direction."""
    angles = one.angle_deg or 0.0, other.angle_deg or 0.0
    ends = one.first_row, other.first_row
    why = ""
    if one.heights.shape != other.heights.shape:
        why = "{1} x {0} pixels, and {3} x {2} in the image before".format(*other.heights.shape, *one.heights.shape)
    elif abs((angles[1] - angles[0] + 180.0) % 360.0 - 180.0) > _SAME_ANGLE_DEG:
        why = f"a scan angle of {angles[1]:.4g} degrees, and {angles[0]:.4g} in the image before"
    elif None not in ends and ends[0] != ends[1]:
        why = "its first row at the other end of the slow axis"
    else:
        sides = [(one.width_nm, other.width_nm), (one.height_nm, other.height_nm)]
        if different := [(a, b) for a, b in sides if a and b and abs(b - a) > _SAME_SIZE * a]:
            why = "a side of {1:.6g} nm, and {0:.6g} in the image before".format(*different[0])
    if why:
        reason = f"has {why}; drift needs images that were scanned alike"
        raise Rejected([Problem(image_name(other), 0, "", reason, "unlike-images")])


def _check_shift(shift: ImageShift, one: ScanImage, other: ScanImage, within_nm: float | None) -> None:
    """Check that the registration is significant, and the only one."""
    name = f"{image_name(one)} and {image_name(other)}"
    if shift.correlation < _LEAST_CORRELATION or not np.all(np.isfinite(shift.errors)):
        bound = "" if within_nm is None else f" within {within_nm:.4g} nm"
        why = (
            f"do not show the same place{bound}: the largest correlation is {shift.correlation:.2g}, "
            f"{_LEAST_CORRELATION:g} are needed; take them closer together, or choose another --channel"
        )
        raise Rejected([Problem(name, 0, "", why, "weak-registration")])
    if within_nm is not None:
        far, error = (
            float(np.hypot(*(shift_or_error * _nm_per_pixel(one)))) for shift_or_error in (shift.pixels, shift.errors)
        )
        if far > within_nm + 3.0 * error:
            why = f"are {far:.4g} nm apart, further than --within {within_nm:.4g}"
            raise Rejected([Problem(name, 0, "", why, "weak-registration")])
    if shift.open_ended or len(shift.rivals):
        likely = sorted([shift.pixels, *shift.rivals], key=lambda place: float(np.hypot(*place)))[:_MOST_SHOWN]
        size = pixel_size(one)
        unit = "pixels" if size is None else "nm"
        places = ", ".join("({:.4g}, {:.4g})".format(*(place if size is None else place * size)) for place in likely)
        more = " and more" if len(shift.rivals) >= _MOST_SHOWN or shift.open_ended else ""
        why = (
            f"the shift is ambiguous: {places} {unit}{more} are as likely. A lattice looks the same a cell further; "
            "bound the shift with --within, below half a cell; images closer in time allow a smaller bound"
        )
        raise Rejected([Problem(name, 0, "", why, "ambiguous-shift")])
    if within_nm is None and shift.significance < _LEAST_SIGNIFICANCE:
        why = (
            f"have too few features: images of other places would correlate by {1.0 / shift.significance:.2g} of this; "
            "take a larger image, or bound the shift with --within if they show the same place"
        )
        raise Rejected([Problem(name, 0, "", why, "weak-registration")])
