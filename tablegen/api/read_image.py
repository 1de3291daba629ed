"""Read image files of instruments: their channels, and an image with its retrace."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, overload

import numpy as np

from tablegen.api.result import Result
from tablegen.base.input_errors import shortened
from tablegen.charts.picture_file import PlottedCharts
from tablegen.images.files import ScanImage, channels_of, read_pair
from tablegen.images.files import read_image as read_one
from tablegen.images.formats.channel import Channel, choose, partner
from tablegen.images.missing import count_missing
from tablegen.numerics.arrays import Floats

_ANGLE, _TURN, _WINDOW = "angle [deg]", "turn", "window"
_EVEN = 5e-4  # of the line period: forward and backward take the same time
_HEAD = ("", "channel", "direction", "pixels", "size [nm]", "unit", "lines [Hz]", "frames", "first row")


def channels(path: str | Path) -> "Channels":
    """List the channels of an image file, without reading their heights.

    Parameters
    ----------
    path : str or Path
        Image file; .tif, .png and .jpk need the extra ``images``.

    Returns
    -------
    Channels
        A sequence. Each has ``number``, ``title``, ``direction``, ``shape`` (rows, columns), ``width_nm``,
        ``height_nm``, ``unit``, ``line_rate_hz``, ``frames``, ``angle_deg`` (of the scan), ``turn`` (forward share of
        the line period) and ``window`` (part of the sweep that is imaged), None or empty where the file does not say.

    Raises
    ------
    Rejected
        The file cannot be read; the problem has the file and the reason.

    Examples
    --------
    >>> [one.shape for one in tablegen.channels("trace.npy")]
    [(96, 96)]
    """
    path = Path(path)
    return Channels(path, tuple(channels_of(path)))


def read_image(
    path: str | Path,
    channel: str | int | None = None,
    *,
    retrace: str | Path | None = None,
    retrace_channel: str | int | None = None,
    frame: int | None = None,
) -> "Image":
    """Read an image of heights, and its retrace where the file has one or a second file is given.

    Parameters
    ----------
    path : str or Path
        Image file; ``channels`` lists its channels.
    channel : str or int, optional
        Title or number of the channel; a title without the direction, such as "Height", has both directions.
    retrace, retrace_channel : optional
        File and channel of the retrace, where they are not those that belong to the trace.
    frame : int, optional
        Image of a movie, from 0.

    Returns
    -------
    Image
        ``heights`` of shape (rows, columns) in ``unit``, and ``retrace``, an ``Image`` or None.

    Raises
    ------
    Rejected
        A file cannot be read; or ``channel`` is no channel of it; or it is None, and not one channel alone is a height.

    Examples
    --------
    >>> image = tablegen.read_image("trace.npy", retrace="retrace.npy")
    >>> image.heights.shape, image.retrace.heights.shape
    ((96, 96), (96, 96))
    """
    path, name, other = Path(path), _name(channel), _name(retrace_channel)
    if retrace is None and other is None and not _has_both(path, name):
        return Image(read_one(path, name, None, frame))
    trace, back = read_pair(path, None if retrace is None else Path(retrace), name, other, frame)
    return Image(trace, Image(back))


def _name(channel: str | int | None) -> str | None:
    return None if channel is None else str(channel)


def _has_both(path: Path, channel: str | None) -> bool:
    all_channels = channels_of(path)
    try:
        return partner(all_channels, choose(all_channels, channel, "trace")) is not None
    except ValueError:
        return True  # the reader of pairs reports the fault


@dataclass(frozen=True, eq=False, repr=False)
class Image(Result):
    """An image of heights as its file has it, NaN where a pixel is missing, and its ``retrace``, or None.

    Row 0 is the first in time as far as the file states it, and the left end of the line is at the left.
    """

    scan: ScanImage
    retrace: "Image | None" = None

    @property
    def heights(self) -> Floats:
        """Heights in ``unit``, (rows, columns).

        Returns
        -------
        Floats
            Shape (rows, columns), row 0 the first in time as far as the file states it.
        """
        return self.scan.heights

    @property
    def unit(self) -> str:
        """Unit of the heights, such as "m", "nm" or "V"; empty where the file does not say."""
        return self.scan.unit

    @property
    def direction(self) -> str | None:
        """Direction of the fast axis, "trace" or "retrace"; None where the file does not say."""
        return self.scan.direction

    @property
    def width_nm(self) -> float | None:
        """Width of all columns in nm; None where the file does not say."""
        return self.scan.width_nm

    @property
    def height_nm(self) -> float | None:
        """Height of all rows in nm; None where the file does not say."""
        return self.scan.height_nm

    @property
    def line_rate_hz(self) -> float | None:
        """Lines in one direction per second; None where the file does not say."""
        return self.scan.line_rate_hz

    @property
    def record(self) -> dict[str, Any]:
        """The data of the file about the image, without its heights."""
        one, rows, columns = self.scan, *self.heights.shape
        return {
            "file": one.file,
            "sha256": one.source.sha256,
            "channel": one.channel,
            "direction": one.direction,
            "rows_columns": [rows, columns],
            "width_nm": one.width_nm,
            "height_nm": one.height_nm,
            "unit": one.unit,
            "line_rate_hz": one.line_rate_hz,
            "scan_angle_deg": one.angle_deg,
            "turn": one.turn,
            "window": None if one.window is None else list(one.window),
            "frame": one.frame,
            "missing": count_missing(one.heights).record,
            "retrace": None if self.retrace is None else self.retrace.record,
        }

    def summary(self) -> str:
        """Return a line on the image, and one on its retrace."""
        both = [self] if self.retrace is None else [self, self.retrace]
        return "\n".join(f"{one.scan.file}: {one._title()}, {one._range()}" for one in both)

    def _title(self) -> str:
        rows, columns = self.heights.shape
        sides = (self.width_nm, self.height_nm)
        size = ", {:.6g} x {:.6g} nm".format(*sides) if None not in sides else ""
        name = shortened(self.scan.channel, 40)
        return f"{name or 'image'}, {columns} x {rows} pixels{size}"

    def _range(self) -> str:
        low, high = float(np.nanmin(self.heights)), float(np.nanmax(self.heights))
        count = count_missing(self.heights)
        missing = f"; {count} missing" if count else ""
        return f"heights {low:.4g} to {high:.4g} {self.unit or 'in units of the file'}{missing}"

    def _lines(self) -> Sequence[str]:
        back = "without a retrace" if self.retrace is None else f"retrace of {self.retrace.scan.file}"
        return f"image of {self.scan.file}: {self._title()}", self._range(), back

    def charts(self) -> PlottedCharts:
        """Return a chart of the heights, and one of the retrace's."""
        from tablegen.correction.straight import ScanPicture
        from tablegen.html_report.corrected import height_chart

        both = [("trace", self)] if self.retrace is None else [("trace", self), ("retrace", self.retrace)]
        charts = []
        for key, image in both:
            one = image.scan
            picture = ScanPicture(one.channel, key == "trace", one.heights, one.unit, one.first_row == "bottom")
            size = (one.width_nm, one.height_nm) if one.width_nm and one.height_nm else None
            charts.append(height_chart(key, picture, size, f"{one.channel or key}, levelled line by line"))
        return PlottedCharts(self.scan.file, tuple(charts))


class Channels(Result, Sequence[Channel]):
    """The channels of an image file, in the order of their numbers."""

    def __init__(self, path: Path, channels: tuple[Channel, ...]) -> None:
        self.path = path
        self._channels = channels

    def __len__(self) -> int:
        return len(self._channels)

    @overload
    def __getitem__(self, number: int) -> Channel: ...
    @overload
    def __getitem__(self, number: slice) -> tuple[Channel, ...]: ...
    def __getitem__(self, number: int | slice) -> Channel | tuple[Channel, ...]:
        return self._channels[number]

    @property
    def record(self) -> dict[str, Any]:
        """The file and its channels as plain data, as ``tablegen channels --json`` prints them."""
        return {"file": str(self.path), "channels": [_record(one) for one in self]}

    def summary(self) -> str:
        """Return the table that ``tablegen channels`` prints below the name of the file."""
        return "\n".join(self.rows())

    def rows(self) -> list[str]:
        """Return the lines of the table: its head, then one line a channel."""
        rows = [_HEAD, *(_row(one) for one in self)]
        for head, cells in self._columns_of_some():
            rows = [(*row, cell) for row, cell in zip(rows, [head, *cells], strict=True)]
        widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
        return ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]

    def _columns_of_some(self) -> Iterator[tuple[str, list[str]]]:
        """Yield head and cells of the columns that are shown only where they say something."""
        if any(one.angle_deg for one in self):
            yield _ANGLE, ["" if one.angle_deg is None else f"{one.angle_deg:.4g}" for one in self]
        if any(one.turn is not None and abs(one.turn - 0.5) > _EVEN for one in self):
            yield _TURN, ["" if one.turn is None else f"{one.turn:.4g}" for one in self]
        if any(one.window is not None and one.window != (0.0, 1.0) for one in self):
            yield _WINDOW, ["" if one.window is None else "{:.4g} to {:.4g}".format(*one.window) for one in self]

    def _lines(self) -> Sequence[str]:
        titles = ", ".join(shortened(one.title, 40) or "without a title" for one in self[:6])
        more = f" and {len(self) - 6} more" if len(self) > 6 else ""
        sizes = sorted({" x ".join(map(str, reversed(one.shape))) for one in self})
        return f"channels of {self.path}: {len(self)}", titles + more, f"pixels {', '.join(sizes[:4])}"

    def charts(self) -> PlottedCharts:
        """Return a chart of each channel."""
        from tablegen.images.files import read_channels

        first = 0 if any(one.frames > 1 for one in self) else None
        charts = [chart for image in read_channels(self.path, first) for chart in Image(image).charts().charts]
        return PlottedCharts(str(self.path), tuple(charts), 3)

    def _repr_html_(self) -> str:
        """Return the table alone: the channels of a file may be many, and their heights are not read for a list."""
        from html import escape

        return f"<pre>{escape(str(self.path))}\n{escape(self.summary())}</pre>"


def _record(channel: Channel) -> dict[str, Any]:
    """Return a channel as data."""
    return {
        "number": channel.number,
        "title": channel.title,
        "signal": channel.signal,
        "direction": channel.direction,
        "rows_columns": list(channel.shape),
        "width_nm": channel.width_nm,
        "height_nm": channel.height_nm,
        "unit": channel.unit,
        "line_rate_hz": channel.line_rate_hz,
        "frames": channel.frames,
        "first_row": channel.first_row,
        "scan_angle_deg": channel.angle_deg,
        "turn": channel.turn,
        "window": None if channel.window is None else list(channel.window),
    }


def _row(channel: Channel) -> tuple[str, ...]:
    """Return the cells of a channel: columns x rows, and width x height."""
    sides = [f"{side:.6g}" if side else "?" for side in (channel.width_nm, channel.height_nm)]
    return (
        str(channel.number),
        shortened(channel.title, 40),
        channel.direction or "",
        " x ".join(map(str, reversed(channel.shape))),
        " x ".join(sides) if sides != ["?", "?"] else "",
        shortened(channel.unit, 12),
        f"{channel.line_rate_hz:.4g}" if channel.line_rate_hz else "",
        str(channel.frames) if channel.frames > 1 else "",
        channel.first_row or "",
    )
