"""Find the lattice of an image: its cell with errors, and the drift between its directions or frames."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from tablegen.api.image_input import ImageSource, read_trace_and_perhaps_retrace, read_trace_beside
from tablegen.api.result import Result
from tablegen.base.blas_threads import one_blas_thread
from tablegen.base.input_errors import Problem, Rejected, Unphysical
from tablegen.charts.chart import Arrows, Chart
from tablegen.charts.picture_file import PlottedCharts
from tablegen.fitting.estimate import Estimate
from tablegen.images.cell_spots import same_lattice
from tablegen.images.direction_shift import DirectionShift, direction_shift
from tablegen.images.files import ScanImage, read_image
from tablegen.images.frame_registration import registered
from tablegen.images.image_cell import ImageCell
from tablegen.images.image_grating import find_grating
from tablegen.images.indexer import find_cell
from tablegen.images.measured_cell import MeasuredCell, measured_cell, stretches
from tablegen.images.missing import count_missing
from tablegen.images.searched_part import SearchedPart
from tablegen.numerics.arrays import Floats

Kind = Literal["hexagonal", "square", "oblique", "grating"]
_MOST_STRETCHED = 1.6  # in one direction over the other: more is another kind of lattice
_MOST_PITCH_RATIO = 1.75


@one_blas_thread
def lattice(
    image: ImageSource,
    retrace: ImageSource | None = None,
    *,
    lattice: Kind | None = None,
    lattice_nm: float | None = None,
    channel: str | int | None = None,
    retrace_channel: str | int | None = None,
    frames: tuple[int, int] | None = None,
) -> "ImageLattice":
    """Find the lattice of an image: the smallest cell that explains all significant spots. Write nothing.

    Parameters
    ----------
    image, retrace : str, Path, array or Image
        Image, and its retrace; one file or one ``Image`` may have both. NaN in an array is a missing pixel.
    lattice : {"hexagonal", "square", "oblique", "grating"}, optional
        Kind of the lattice; any two-dimensional one by default.
    lattice_nm : float, optional
        Constant of the sample in nm: it decides where cells of several sizes are possible.
    channel, retrace_channel : str or int, optional
        Title or number of the channel, and of its retrace.
    frames : tuple of int, optional
        First frame of a movie and the one after the last: they are registered and averaged.

    Returns
    -------
    ImageLattice
        ``cell`` has sides and angle with standard errors, ``shift`` the retrace against the trace.

    Raises
    ------
    Rejected
        A file cannot be read.
    Unphysical
        The image has no lattice, too few periods of it, or more than one cell is possible.

    Examples
    --------
    >>> image = tablegen.lattice("trace.npy", "retrace.npy", lattice="hexagonal")
    >>> image.unit, round(image.cell.angle_deg.value / 10)
    ('pixels', 6)
    """
    how = {"channel": _name(channel), "retrace_channel": _name(retrace_channel)}
    shifts = None
    if frames is None:
        images = read_trace_and_perhaps_retrace(image, retrace, how)
    else:
        images, shifts = _movie(image, how["channel"], frames)
    scan, others = images[0], images[1:]
    pixel = _pixel(scan)
    if lattice == "grating":
        return _grating(scan, pixel, lattice_nm, shifts, frames)
    kind = "hexagonal" if lattice is None and lattice_nm is not None else lattice
    expected = _expected_area(kind, lattice_nm, pixel)
    other = others[0].heights if others else None
    reference = read_trace_beside(image, how["channel"]) if other is None and frames is None else None
    cell = find_cell(scan.heights, other if reference is None else reference.heights, expected)  # to tell hum
    second = shift = None
    if other is not None:
        second = find_cell(other, scan.heights, expected)
        if not same_lattice(cell.vectors, second.vectors):
            raise Unphysical(
                "trace and retrace show different cells; are both of one scan? Choose another --channel, or give the "
                "sample's --lattice-nm"
            )
        shift = direction_shift(scan.heights, other, cell)
    result = ImageLattice(scan, kind, lattice_nm, cell.part, cell, second, shift, frames, shifts)
    if kind in ("hexagonal", "square"):
        long, short = stretches(result.cell.vectors, kind)
        if long > _MOST_STRETCHED * short:
            raise Unphysical(
                f"the cell is stretched {long / short:.3g} times more in one direction than in the other, if the "
                f"lattice is {kind}; is it? Give --lattice oblique, or scan with less drift"
            )
    return result


def _name(channel: str | int | None) -> str | None:
    return None if channel is None else str(channel)


def _movie(image: ImageSource, channel: str | None, frames: tuple[int, int]) -> tuple[list[ScanImage], Floats]:
    """Return the mean of frames as an image, and their shifts."""
    first, stop = frames
    if not isinstance(image, str | Path):
        raise TypeError("frames are those of a file; average arrays yourself")
    if not 0 <= first < stop:
        raise Rejected(
            [Problem(str(image), 0, "frames", f"{first}:{stop} is empty; give the first, and one after the last")]
        )
    images = [read_image(Path(image), channel, "trace", number) for number in range(first, stop)]
    mean = registered([one.heights for one in images])
    return [replace(images[0], heights=mean.mean)], mean.shifts


def _pixel(scan: ScanImage) -> tuple[float, float] | None:
    rows, columns = scan.heights.shape
    if not scan.width_nm or not scan.height_nm:
        return None
    return scan.width_nm / columns, scan.height_nm / rows


def _expected_area(kind: Kind | None, constant: float | None, pixel: tuple[float, float] | None) -> float | None:
    """Return the area of the sample's cell in square pixels; None where it is unknown."""
    if constant is None or pixel is None:
        return None
    if kind == "oblique":
        raise TypeError("lattice_nm is the constant of a hexagonal or square lattice, or of a grating")
    return constant**2 * (1.0 if kind == "square" else 0.75**0.5) / (pixel[0] * pixel[1])


def _grating(
    scan: ScanImage,
    pixel: tuple[float, float] | None,
    pitch_nm: float | None,
    shifts: Floats | None,
    frames: tuple[int, int] | None,
) -> "ImageLattice":
    one = find_grating(scan.heights)
    result = ImageLattice(
        scan, "grating", pitch_nm, one.part, None, None, None, frames, shifts, one.wave, one.covariance
    )
    if pitch_nm and pixel and not 1.0 / _MOST_PITCH_RATIO < result.pitch.value / pitch_nm < _MOST_PITCH_RATIO:
        raise Unphysical(
            f"the pitch is {result.pitch.value:.4g} nm by the size in the file, and {pitch_nm:.4g} nm is given; is "
            f"this the sample?"
        )
    return result


@dataclass(frozen=True, eq=False, repr=False)
class ImageLattice(Result):
    """The lattice of an image.

    ``cell`` and ``retrace_cell`` have sides in ``unit`` and the angle, with standard errors; ``pitch`` is that of a
    grating. ``shift`` is that of the retrace against the trace, and ``frame_shifts`` those of frames against the first,
    in pixels. ``part`` is what of the image was searched: all of it, in blocks, or a region.
    """

    scan: ScanImage
    kind: Kind | None
    lattice_nm: float | None
    part: SearchedPart
    image_cell: ImageCell | None
    retrace_image_cell: ImageCell | None
    shift: DirectionShift | None
    frames: tuple[int, int] | None
    frame_shifts: Floats | None
    wave: Floats | None = None
    wave_covariance: Floats | None = None

    @property
    def unit(self) -> str:
        """Unit of lengths: "nm", or "pixels" where the file has no size."""
        return "pixels" if _pixel(self.scan) is None else "nm"

    @property
    def pixel(self) -> tuple[float, float]:
        """Width and height of a pixel in ``unit``."""
        return _pixel(self.scan) or (1.0, 1.0)

    @property
    def cell(self) -> MeasuredCell:
        """The reduced cell of the trace.

        Raises
        ------
        ValueError
            If the image is a grating.
        """
        if self.image_cell is None:
            raise ValueError("a grating has a pitch, and no cell")
        return measured_cell(self.image_cell.vectors, self.image_cell.covariance, self.pixel)

    @property
    def retrace_cell(self) -> MeasuredCell | None:
        """The reduced cell of the retrace; None without one."""
        one = self.retrace_image_cell
        return None if one is None else measured_cell(one.vectors, one.covariance, self.pixel)

    @property
    def pitch(self) -> Estimate:
        """The pitch of a grating.

        Raises
        ------
        ValueError
            If the image is a lattice.
        """
        if self.wave is None or self.wave_covariance is None:
            raise ValueError("a lattice has a cell, and no pitch")
        wave = self.wave / np.array(self.pixel)
        size = float(np.hypot(*wave))
        gradient = wave / size / np.array(self.pixel)
        error = float(np.sqrt(gradient @ self.wave_covariance @ gradient))
        return Estimate(1.0 / size, error / size**2)

    @property
    def record(self) -> dict[str, Any]:
        """The lattice as plain data, as ``tablegen lattice --json`` prints it."""
        rows, columns = self.scan.heights.shape
        record: dict[str, Any] = {
            "file": self.scan.file,
            "sha256": self.scan.source.sha256,
            "channel": self.scan.channel,
            "rows_columns": [rows, columns],
            "searched": {
                "rows": list(self.part.rows),
                "columns": list(self.part.columns),
                "block_pixels": self.part.block,
            },
            "width_nm": self.scan.width_nm,
            "height_nm": self.scan.height_nm,
            "missing": count_missing(self.scan.heights).record,
            "kind": self.kind,
            "unit": self.unit,
            "cell": None if self.image_cell is None else _cell_record(self.cell),
            "retrace_cell": None if self.retrace_cell is None else _cell_record(self.retrace_cell),
            "pitch": None if self.wave is None else _number(self.pitch),
            "cells": None if self.image_cell is None else self.image_cell.cells,
            "spots": None if self.image_cell is None else len(self.image_cell.explained),
            "explained_spots": None if self.image_cell is None else int(np.sum(self.image_cell.explained)),
            "retrace_shift_pixels": None,
            "frames": None if self.frames is None else list(self.frames),
            "frame_shifts_pixels": None if self.frame_shifts is None else self.frame_shifts.tolist(),
        }
        if self.shift is not None:
            record["retrace_shift_pixels"] = {
                "value": self.shift.pixels.tolist(),
                "standard_error": self.shift.errors.tolist(),
            }
        return record

    def summary(self) -> str:
        """Return the text that ``tablegen lattice`` prints."""
        part = [] if self.part.whole else [f"searched: {self.part}"]
        return "\n".join([self._title(), *part, *self._missing_lines(), *self._cell_lines(), *self._drift_lines()])

    def _title(self) -> str:
        rows, columns = self.scan.heights.shape
        size = f", {self.scan.width_nm:.6g} x {self.scan.height_nm:.6g} nm" if self.unit == "nm" else ", size unknown"
        frames = "" if self.frames is None else ", mean of frames {}:{}".format(*self.frames)
        return f"{self.scan.file}: {self.scan.channel or 'image'}{frames}, {columns} x {rows} pixels{size}"

    def _missing_lines(self) -> list[str]:
        count = count_missing(self.scan.heights)
        return [f"missing: {count}, without weight"] if count else []

    def _cell_lines(self) -> list[str]:
        if self.image_cell is None:
            return [f"pitch: {_shown(self.pitch)} {self.unit}"]
        one = self.image_cell
        lines = [f"cell: {self._cell_text(self.cell)}"]
        if self.retrace_cell is not None:
            lines.append(f"cell of the retrace: {self._cell_text(self.retrace_cell)}")
        lines.append(f"{one.cells:.0f} cells; {int(np.sum(one.explained))} of {len(one.explained)} spots are theirs")
        if self.kind in ("hexagonal", "square"):
            stretch = stretches(self.cell.vectors, self.kind)
            if self.lattice_nm is None or self.unit != "nm":
                lines.append(f"distortion: {stretch[0] / stretch[1]:.4g} times longer in one direction than across it")
            else:
                long, short = (one / self.lattice_nm for one in stretch)
                lines.append(f"scale: {long:.4g} and {short:.4g} times that of the file, along and across its stretch")
        return lines

    def _cell_text(self, cell: MeasuredCell) -> str:
        return f"{_shown(cell.a)} x {_shown(cell.b)} {self.unit}, angle {_shown(cell.angle_deg)} degrees"

    def _drift_lines(self) -> list[str]:
        lines = []
        if self.shift is not None:
            x, y = (Estimate(float(v), float(e)) for v, e in zip(self.shift.pixels, self.shift.errors, strict=True))
            lines.append(f"retrace against trace: x {_shown(x)}, y {_shown(y)} pixels")
        if self.frame_shifts is not None and len(self.frame_shifts) > 1:
            x, y = (self.frame_shifts[-1] - self.frame_shifts[0]).tolist()
            lines.append(f"drift from the first frame to the last: x {x:.3g}, y {y:.3g} pixels")
        return lines

    def _lines(self) -> Sequence[str]:
        return f"lattice of {self._title()}", self._cell_lines()[0], "; ".join(self._drift_lines()) or "one image"

    def charts(self) -> PlottedCharts:
        """Return the heights with the cell, the spectrum with its spots, and the autocorrelation with the cell."""
        from tablegen.correction.straight import ScanPicture
        from tablegen.html_report.corrected import height_chart
        from tablegen.html_report.image_spectrum import spectrum_chart
        from tablegen.images.autocorrelation import autocorrelation
        from tablegen.images.lattice_filters import filtered_images

        scan, one = self.scan, self.image_cell
        size = (scan.width_nm, scan.height_nm) if scan.width_nm and scan.height_nm else None
        bottom = scan.first_row == "bottom"
        title = f"{scan.channel or 'image'}, levelled line by line, with the cell"
        heights = height_chart("lattice", ScanPicture(scan.channel, True, scan.heights, scan.unit, bottom), size, title)
        view = filtered_images(self.part.of(scan.heights))[0 if one is None or one.filter_name == "heights" else 1]
        if one is None:
            assert self.wave is not None
            waves, explained, base = self.wave[None], np.array([True]), self.wave[None]
        else:
            waves, explained, base = (
                one.spots.waves,
                one.explained,
                np.linalg.inv(self.cell.vectors / np.array(self.pixel)).T,
            )
        block = self.part.block
        pixel = block * self.pixel[0], block * self.pixel[1]
        spectrum = spectrum_chart(view, block * waves, explained, block * base, pixel, self.unit, bottom)
        values = autocorrelation(view).values
        picture = ScanPicture("", True, values, "", bottom)
        reach = (values.shape[1] * pixel[0], values.shape[0] * pixel[1])
        title = "autocorrelation, with the cell"
        around = height_chart("autocorrelation", picture, reach if size else None, title)
        label = "correlation, levelled by lines [1]"
        if around.raster is not None:
            around = replace(around, raster=replace(around.raster, x=(0.0, reach[0]), y=(0.0, reach[1]), label=label))
        charts = self._with_cell(heights, bottom), spectrum, self._with_cell(around, bottom)
        return PlottedCharts(self._title(), charts, 3, charts[:2])

    def _with_cell(self, chart: Chart, bottom: bool) -> Chart:
        if self.wave is not None:
            sides = (self.wave / np.array(self.pixel) * self.pitch.value**2)[None]
        else:
            sides = self.cell.vectors
        (left, right), (low, high) = chart.x_limits, chart.y_limits
        count = len(sides)
        dy = sides[:, 1] if bottom else -sides[:, 1]
        middle = np.full(count, 0.5 * (left + right)), np.full(count, 0.5 * (low + high))
        return replace(chart, arrows=Arrows(*middle, sides[:, 0], dy))


def _shown(estimate: Estimate) -> str:
    return f"{estimate.value:.4g} +- {estimate.standard_error:.2g}"


def _number(estimate: Estimate) -> dict[str, float]:
    return {"value": estimate.value, "standard_error": estimate.standard_error}


def _cell_record(cell: MeasuredCell) -> dict[str, Any]:
    return {
        "a": _number(cell.a),
        "b": _number(cell.b),
        "angle_deg": _number(cell.angle_deg),
        "vectors": cell.vectors.tolist(),
    }
