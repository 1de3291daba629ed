"""Measure how long the line of each image of a sample of known constant was, in nm, to calibrate size and offset."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise
from math import isfinite

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.base.warnings import Remark, spoils
from tablegen.compensation.size import SizeLaw
from tablegen.fitting.estimate import ImageSize, LineSize
from tablegen.images.cell_start import strong_index
from tablegen.images.fast_axis_line import ImageLine, fit_line, shows_turns
from tablegen.images.line_length import ASPECT_ERROR, DRIFT_ERROR, Cell, Grating, size_of_line
from tablegen.images.missing import missing_text
from tablegen.numerics.arrays import Floats
from tablegen.numerics.driver import Driver

_MAX_STEP = 1.35  # between the nm per volt of neighbouring images: below the root of two
_MIN_PIXELS_PER_PERIOD = 4.0
_LOOSE_SHARE = 0.01  # relative error of a size that is remarked


@dataclass(frozen=True, eq=False)
class SampleImage:
    """A trace, and its retrace if there is one, of a scan of ``v_scan`` V peak to peak about ``v_offset``; and a name.

    Heights are in any unit, rows x columns; ``aspect`` is the frame's height over the line's length by the file.
    """

    name: str
    v_scan: float
    v_offset: float | None
    trace: Floats
    retrace: Floats | None
    aspect: float | None = None


@dataclass(frozen=True)
class KnownSample:
    """The sample: a lattice, a grating, or both on one instrument; two waves in an image are the lattice."""

    cell: Cell | None = None
    grating: Grating | None = None


@dataclass(frozen=True)
class Acquisition:
    """Timing of all images, as in ``fit_pair``; ``aspect`` where it is not that of the pixels, or of the file."""

    turn: float = 0.5
    window: tuple[float, float] = (0.0, 1.0)
    retrace_mirrored: bool = False
    delay_pixels: float = 0.0
    aspect: float | None = None


@dataclass(frozen=True, eq=False)
class ImageSizes:
    """Sizes of all images, in their order, in nm; ``shared`` is the relative error that they have in common."""

    images: tuple[ImageSize, ...]
    nm: Floats
    errors_nm: Floats
    shared: float
    remarks: tuple[Remark, ...]


def sizes_of(
    images: Sequence[SampleImage], v_max: Driver | float, sample: KnownSample, acquisition: Acquisition
) -> ImageSizes:
    """Fit each image's line from turn to turn.

    Raises
    ------
    Unphysical
        If an image shows no line; the message has its name.
    """
    sizes: list[ImageSize] = []
    remarks: list[Remark] = []
    for image in images:
        try:
            _check_drive(image, Driver.of(v_max))
            line = fit_line(
                image.trace,
                image.retrace,
                acquisition.turn,
                acquisition.window,
                acquisition.retrace_mirrored and image.retrace is not None,
                acquisition.delay_pixels,
            )
            size = size_of_line(line, sample.cell, sample.grating, acquisition.aspect or image.aspect)
        except Unphysical as reason:
            raise Unphysical(f"{image.name}: {reason}") from None
        gap = float(np.max(np.abs(line.gap))) if np.isfinite(line.gap).all() else float("nan")
        sizes.append(
            ImageSize(
                image.name,
                image.v_scan,
                image.v_offset,
                size,
                float(np.max(np.abs(line.waves[:, 0]))),
                line.noise_percent,
                100.0 * gap,
            )
        )
        if lacking := missing_text([one for one in (image.trace, image.retrace) if one is not None]):
            remarks.append(Remark(lacking, code="missing-pixels").under(image.name))
        remarks += [text.under(image.name) for text in _remarks(line, size)]
    for one, other in combinations(images, 2):
        if one.trace.shape == other.trace.shape and np.array_equal(one.trace, other.trace):
            raise Unphysical(f"{other.name}: the image is that of {one.name}; each drive needs one of its own")
    _check_steps(sizes)
    bars = any(not isfinite(one.size.aspect) for one in sizes)
    if bars and sample.grating is not None and sample.grating.angle_deg is None:
        remarks.append(
            Remark(
                f"the angle of the bars is that of the rows, for a frame as high as its pixels, its file or --aspect "
                f"say within {100.0 * ASPECT_ERROR:.0f} %, and a drift of some {100.0 * DRIFT_ERROR:.0f} % of the "
                f"line; --angle-deg gives it where it is known",
                code="assumed-value",
            )
        )
    nm = np.array([one.size.nm.value for one in sizes])
    errors = np.array([one.size.nm.standard_error for one in sizes])
    return ImageSizes(tuple(sizes), nm, errors, max(one.size.shared for one in sizes), tuple(remarks))


def apparent_of(sizes: ImageSizes, law: SizeLaw, driver: Driver | float, sample: KnownSample) -> tuple[Floats, Floats]:
    """Return how large the sample's constant appears if each line is as long as by the size law.

    With the right law it is the true constant, at the offset at which the law was measured.

    Returns
    -------
    tuple of Floats
        Apparent constants and their standard errors in nm, shape (images,) each.
    """
    constant = sample.cell.a_nm if sample.cell is not None else sample.grating.pitch_nm if sample.grating else 1.0
    lawful = np.array([law.size_nm(one.v_scan / Driver.of(driver).span) for one in sizes.images])
    apparent = constant * lawful / sizes.nm
    return apparent, apparent * sizes.errors_nm / sizes.nm


def _check_drive(image: SampleImage, driver: Driver) -> None:
    if not 0.0 < image.v_scan <= 1.02 * driver.span:
        raise Unphysical(f"a scan of {image.v_scan:g} V is outside the driver's {driver}")
    if image.v_offset is not None:
        low, high = image.v_offset - 0.5 * image.v_scan, image.v_offset + 0.5 * image.v_scan
        if driver.beyond(low, high) > 0.02 * driver.span:
            raise Unphysical(
                f"a scan of {image.v_scan:g} V about {image.v_offset:g} V is outside the driver's {driver}"
            )


def _check_steps(sizes: Sequence[ImageSize]) -> None:
    """Raise ``Unphysical`` unless neighbouring drives, or offsets, have about as many nm per volt."""
    for _, group in _groups(sizes):
        for less, more in pairwise(group):
            ratio = more.size.nm.value / more.v_scan / (less.size.nm.value / less.v_scan)
            if 1.0 / _MAX_STEP < ratio < _MAX_STEP:
                continue
            raise Unphysical(
                f"{less.name} has {less.size.nm.value / less.v_scan:.4g} nm per volt, and {more.name} "
                f"{more.size.nm.value / more.v_scan:.4g}: is each image of the stated voltage, of the sample "
                f"of this constant, and a period more than two pixels?"
            )


def _groups(sizes: Sequence[ImageSize]) -> list[tuple[float, list[ImageSize]]]:
    """Group by scan voltage, each by ascending offset, where offsets are given; else return all by scan voltage."""
    if all(one.v_offset is None for one in sizes):
        return [(0.0, sorted(sizes, key=lambda one: one.v_scan))]
    volts = sorted({one.v_scan for one in sizes})
    return [(v, sorted((one for one in sizes if one.v_scan == v), key=lambda one: one.v_offset or 0.0)) for v in volts]


def _remarks(line: ImageLine, size: LineSize) -> list[Remark]:
    remarks: list[Remark] = []
    if not shows_turns(line.geometry):
        remarks.append(
            spoils(
                "the turns are not in the image; the ends of the line are extrapolated", code="extrapolated-parameter"
            )
        )
    if not line.both:
        remarks.append(
            Remark("without a retrace nothing shows whether columns were cropped, or are late", code="image-timing")
        )
    index = strong_index(line.model, line.state) if line.indexed else 1
    if index > 1:
        remarks.append(
            Remark(
                f"the strong spots are those of a cell with 1/{index} of the area; the constant was taken for that of "
                f"the whole cell",
                code="assumed-value",
            )
        )
    if line.widened > 3.0:
        widened = f"standard errors were widened by a factor of {line.widened:.3g}"
        remarks.append(Remark(f"{widened}, for what is not only noise", code="widened-errors"))
    if line.explained < 0.5:
        remarks.append(
            Remark(
                f"{100.0 * line.explained:.0f} % of the contrast is periodic, the rest noise, debris or defects",
                code="aperiodic-contrast",
            )
        )
    if size.nm.standard_error > _LOOSE_SHARE * size.nm.value:
        percent = 100.0 * size.nm.standard_error / size.nm.value
        remarks.append(
            spoils(
                "the size is uncertain by more than a percent; scan more periods, or average",
                percent,
                code="undetermined-parameter",
            )
        )
    finest = (
        line.geometry.columns
        / (line.geometry.window[1] - line.geometry.window[0])
        / float(np.max(np.abs(line.waves[:, 0])))
    )
    if finest < _MIN_PIXELS_PER_PERIOD:
        remarks.append(Remark(f"a period has {finest:.2g} pixels", code="few-pixels"))
    if line.strays:
        numbers = ", ".join(str(i + 1) for i in line.strays[:5]) + (", ..." if len(line.strays) > 5 else "")
        remarks.append(
            Remark(
                f"{len(line.strays)} lines differ from the others (row {numbers}); they were used",
                code="outlying-samples",
            )
        )
    return remarks
