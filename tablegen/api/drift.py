"""Measure the drift between images of one place, in nm/s with standard errors."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tablegen.api.build import Source, setup_of
from tablegen.api.image_input import ImageSource, read_trace_and_perhaps_retrace
from tablegen.api.result import Result
from tablegen.base.blas_threads import one_blas_thread
from tablegen.base.input_errors import Problem, Rejected
from tablegen.charts.chart import Chart, DrawnCurve
from tablegen.charts.picture_file import PlottedCharts
from tablegen.fitting.estimate import Estimate
from tablegen.images.files import ScanImage
from tablegen.images.frame_drift import DriftInterval, drift_intervals, image_name, pixel_size
from tablegen.images.scan_angle import is_turned
from tablegen.numerics.arrays import Floats
from tablegen.numerics.turns import sine_and_cosine_of

_AXES = ("x", "y")


@one_blas_thread
def drift(
    *images: ImageSource,
    frames: tuple[int, int] | None = None,
    seconds_apart: float | None = None,
    within_nm: float | None = None,
    channel: str | int | None = None,
    retrace_channel: str | int | None = None,
    scan: Source | None = None,
) -> "ImageDrift":
    """Measure the drift between images of one place, by registration. Write nothing.

    Parameters
    ----------
    *images : str, Path, array or Image
        Two or more images in the order of time, or one movie. Where a file has both directions, both count.
    frames : tuple of int, optional
        First frame of a movie and the one after the last; each is compared with the one before.
    seconds_apart : float, optional
        Time from the start of an image to the start of the next, in s; by default that of the frames of a movie.
    within_nm : float, optional
        Largest shift from an image to the next, in nm: below half a cell it makes that of a lattice unambiguous.
    channel, retrace_channel : str or int, optional
        Title or number of the channel, and of its retrace.
    scan : str, Path or Setup, optional
        Scan that took the images, in frames that go up: the result has ``drift_nm_per_s``, which lets it follow the
        sample.

    Returns
    -------
    ImageDrift
        ``x`` and ``y`` have the drift with its standard error in ``unit``.

    Raises
    ------
    Rejected
        A file cannot be read, or the images do not show the same place, were not scanned alike, or have a shift that
        is ambiguous; ``problems`` has the code. With ``scan`` also if it has an error, or the images no size in nm.

    Examples
    --------
    >>> drift = tablegen.drift("first.npy", "second.npy", seconds_apart=10.0)
    >>> drift.unit
    'pixels/s'
    """
    for name, value in (("seconds_apart", seconds_apart), ("within_nm", within_nm)):
        if value is not None and not 0.0 < value < np.inf:
            raise TypeError(f"{name} is {value}; it takes a number above 0")
    how: dict[str, Any] = {
        "channel": None if channel is None else str(channel),
        "retrace_channel": None if retrace_channel is None else str(retrace_channel),
    }
    if frames is None:
        scans = [read_trace_and_perhaps_retrace(image, None, how) for image in images]
    else:
        scans = _movie(images, frames, how)
    if len(scans) < 2:
        raise Rejected([Problem(scans[0][0].file if scans else "images", 0, "", "drift needs two images or more")])
    setup = None if scan is None else setup_of(scan, None, None)
    if setup is not None and pixel_size(scans[0][0]) is None:
        raise Rejected([Problem(scans[0][0].file, 0, "", "has no size in nm, which the drift of a scan file needs")])
    return ImageDrift(
        tuple(one[0] for one in scans),
        min(map(len, scans)),
        tuple(drift_intervals(scans, seconds_apart, within_nm)),
        seconds_apart is not None,
        within_nm,
        None if setup is None else Followed(setup.scan.angle_deg, setup.scan.drift_nm_per_s),
    )


def _movie(images: Sequence[ImageSource], frames: tuple[int, int], how: dict[str, Any]) -> list[list[ScanImage]]:
    first, stop = frames
    if len(images) != 1 or not isinstance(images[0], str | Path):
        raise TypeError("frames are those of one file")
    if not 0 <= first < stop - 1:
        why = f"{first}:{stop} is not two frames or more; give the first, and one after the last"
        raise Rejected([Problem(str(images[0]), 0, "frames", why)])
    return [read_trace_and_perhaps_retrace(images[0], None, {**how, "frame": one}) for one in range(first, stop)]


@dataclass(frozen=True)
class Followed:
    """The angle of the scan that took the images, and the drift that it followed already."""

    angle_deg: float
    drift_nm_per_s: tuple[float, float]


@dataclass(frozen=True, eq=False, repr=False)
class ImageDrift(Result):
    """Drift of the sample in the images: x along the lines to the right, y along the slow axis in the order of rows.

    ``scans`` are the images, ``directions`` is 2 where trace and retrace count, ``intervals`` has the shift and the
    time from each image to the next. ``stated_time`` is true if the time was given, and not that of the file.
    ``scan`` is known where the drift for a scan file was asked for.
    """

    scans: tuple[ScanImage, ...]
    directions: int
    intervals: tuple[DriftInterval, ...]
    stated_time: bool
    within_nm: float | None
    scan: Followed | None = None

    @property
    def drift_nm_per_s(self) -> tuple[float, float] | None:
        """Value of the key of the scan file: what the scan followed and what was left, along the scanner's x and y."""
        if self.scan is None:
            return None
        sine, cosine = sine_and_cosine_of(self.scan.angle_deg / 360.0)
        before_x, before_y = self.scan.drift_nm_per_s
        along, across = self.x.value, self.y.value
        return before_x + cosine * along - sine * across, before_y + sine * along + cosine * across

    @property
    def unit(self) -> str:
        """Unit of the drift: "nm/s", or "pixels/s" where the file has no size."""
        return "pixels/s" if pixel_size(self.scans[0]) is None else "nm/s"

    @property
    def rates(self) -> Floats:
        """Drift x, y of each interval in ``unit``, shape (intervals, 2)."""
        return np.array([one.shift.pixels / one.seconds for one in self.intervals]) * self._pixel

    @property
    def rate_errors(self) -> Floats:
        """Standard errors of ``rates``."""
        return np.array([one.shift.errors / one.seconds for one in self.intervals]) * self._pixel

    @property
    def x(self) -> Estimate:
        """The mean drift along the lines."""
        return self._mean(0)

    @property
    def y(self) -> Estimate:
        """The mean drift along the slow axis, in the order of rows."""
        return self._mean(1)

    @property
    def seconds(self) -> float:
        """The time from the first image to the last, at the same place of the sample."""
        return sum(one.seconds for one in self.intervals)

    @property
    def record(self) -> dict[str, Any]:
        """The drift as plain data, as ``tablegen drift --json`` prints it."""
        return {
            "images": [{"file": one.file, "sha256": one.source.sha256, "frame": one.frame} for one in self.scans],
            "channel": self.scans[0].channel,
            "directions": self.directions,
            "scan_angle_deg": self.scans[0].angle_deg,
            "unit": self.unit,
            "drift": {axis: _number(getattr(self, axis)) for axis in _AXES},
            "drift_nm_per_s": self.drift_nm_per_s,
            "seconds": self.seconds,
            "time": "given" if self.stated_time else "file",
            "within_nm": self.within_nm,
            "intervals": [
                {
                    "seconds": one.seconds,
                    "shift_pixels": one.shift.pixels.tolist(),
                    "standard_errors_pixels": one.shift.errors.tolist(),
                    "shift_pixels_of_directions": one.shift.directions.tolist(),
                    "correlation": one.shift.correlation,
                }
                for one in self.intervals
            ],
        }

    def summary(self) -> str:
        """Return the text that ``tablegen drift`` prints."""
        time = "as given" if self.stated_time else "by the file"
        ways = "trace and retrace" if self.directions > 1 else "one direction"
        lines = [
            self._title(),
            f"drift: {self._text()}",
            f"over {self.seconds:.5g} s {time}, by {ways}; correlation "
            f"{min(one.shift.correlation for one in self.intervals):.2f} or more",
        ]
        for axis, name in enumerate(_AXES):
            shift = sum(float(one.shift.pixels[axis]) for one in self.intervals)
            lines.append(f"{name}: {shift:.4g} pixels from the first image to the last")
        if is_turned(self.scans[0]):
            lines.append(f"scan angle {self.scans[0].angle_deg:.4g} degrees: x and y are those of the image")
        if self.drift_nm_per_s is not None:
            x, y = self.drift_nm_per_s
            lines.append(f"for the scan file, if its frames went up: drift_nm_per_s = [{x:.4g}, {y:.4g}]")
        return "\n".join(lines)

    def charts(self) -> PlottedCharts:
        """Return the drift of each interval over time, along each axis."""
        ends = np.cumsum([one.seconds for one in self.intervals])
        middle = ends - 0.5 * np.array([one.seconds for one in self.intervals])
        charts = []
        for axis, name in enumerate(_AXES):
            rate, error = self.rates[:, axis], self.rate_errors[:, axis]
            bars = DrawnCurve(
                "standard error", "other",
                np.ravel(np.column_stack([middle, middle, middle])),
                np.ravel(np.column_stack([rate - error, rate + error, np.full(len(rate), np.nan)])),
            )  # fmt: skip
            mean = getattr(self, name).value
            charts.append(
                Chart(
                    f"drift_{name}", f"drift along {name}", "time [s]", f"drift [{self.unit}]",
                    (bars, DrawnCurve("each interval", "other", middle, rate, "points"),
                     DrawnCurve("mean", "before", np.array([0.0, ends[-1]]), np.full(2, mean))),
                )
            )  # fmt: skip
        return PlottedCharts(self._title(), tuple(charts), 2)

    @property
    def _pixel(self) -> Floats:
        size = pixel_size(self.scans[0])
        return np.ones(2) if size is None else size

    def _mean(self, axis: int) -> Estimate:
        """Return the mean over the whole time; its error is that of the shifts, or of uneven drift if that is more."""
        weights = np.array([one.seconds for one in self.intervals]) / self.seconds
        rates = self.rates[:, axis]
        mean = float(weights @ rates)
        error = float(np.hypot.reduce(weights * self.rate_errors[:, axis]))
        if len(rates) > 2:
            error = max(error, float(np.std(rates, ddof=1) / np.sqrt(len(rates))))
        return Estimate(mean, error)

    def _text(self) -> str:
        return ", ".join(f"{axis} {_shown(getattr(self, axis))}" for axis in _AXES) + f" {self.unit}"

    def _title(self) -> str:
        return f"{image_name(self.scans[0])} to {image_name(self.scans[-1])}, {len(self.scans)} images"

    def _lines(self) -> Sequence[str]:
        return f"drift of {self._title()}", self._text(), f"over {self.seconds:.5g} s"


def _shown(estimate: Estimate) -> str:
    return f"{estimate.value:.4g} +- {estimate.standard_error:.2g}"


def _number(estimate: Estimate) -> dict[str, float]:
    return {"value": estimate.value, "standard_error": estimate.standard_error}
