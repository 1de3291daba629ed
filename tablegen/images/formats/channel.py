"""A channel of an image file: its title, shape and units, and the choice of one channel among several."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import degrees, isfinite, pi
from typing import Literal

import numpy as np
import numpy.typing as npt

from tablegen.base.input_errors import shortened

Matrix = npt.NDArray[np.generic]
Direction = Literal["trace", "retrace"]
FirstRow = Literal["top", "bottom"]

MAX_PIXELS = 1 << 25  # 5792 x 5792; more than that in floating point would be most of a computer's memory
LENGTHS_NM = {  # spellings of units of length
    **{"m": 1e9, "cm": 1e7, "mm": 1e6, "um": 1e3, "µm": 1e3, "\u03bcm": 1e3, "micron": 1e3, "microns": 1e3, "nm": 1.0},
    **{"pm": 1e-3, "Å": 0.1, "A": 0.1, "Angstrom": 0.1},
}
_MAX_LISTED = 12  # channels in a message
_MAX_TITLE = 60  # characters of a channel in a message
_MAX_SPLIT = 1000  # characters of a title that is searched for a direction
_DIRECTION = re.compile(r"(.+?)[\s_\-\[(]*(retrace|trace|forward|backward)\s*[\])]*", re.IGNORECASE | re.DOTALL)
_HEIGHTS = ("height", "z", "topography", "topo", "tp")  # names of a height; the last is that of high-speed AFM
_HEIGHT_WORDS = ("height", "topo", "zsensor", "z sensor")  # in longer names
_MEANT: dict[str, Direction] = {"trace": "trace", "forward": "trace", "retrace": "retrace", "backward": "retrace"}


@dataclass(frozen=True, eq=False)
class Channel:
    """One image of a file: its title, its shape by the file, and its reader, which is there once the bytes fit.

    ``load`` returns rows x columns of a frame, counted from 0: row 0 is the first in time where the file states it, and
    the left end of the line is at the left in both directions. It raises ``ValueError`` with the reason.
    """

    number: int
    title: str
    shape: tuple[int, ...]
    load: Callable[[int], Matrix]
    signal: str = ""  # the title without the direction
    direction: Direction | None = None  # None where the file does not say
    unit: str = ""  # of the values; empty where the file does not say
    width_nm: float | None = None  # of the line, all pixels
    height_nm: float | None = None
    line_rate_hz: float | None = None  # lines in one direction per second
    first_row: FirstRow | None = None  # where row 0 is in the picture; None where that is not known
    frames: int = 1
    angle_deg: float | None = None  # of the fast axis against the scanner's x; None where the file does not say
    turn: float | None = None  # share of the line period that is forward; None where the file does not say
    window: tuple[float, float] | None = None  # part of each sweep that the columns span, likewise


def channel_of_array(number: int, title: str, matrix: Matrix) -> Channel:
    """Return a channel whose values are in memory, of a file that states nothing else about it.

    Parameters
    ----------
    number
        Number of the channel in the file.
    title
        Its title, which may contain the direction.
    matrix
        Values, of the shape that the file has.
    """
    signal, direction = split_direction(title)
    return Channel(number, title, matrix.shape, lambda _: matrix, signal, direction)


def split_direction(title: str) -> tuple[str, Direction | None]:
    """Split ``HeightRetrace``, ``Height (Retrace)`` or ``Height backward`` into ``Height`` and its direction."""
    if len(title) > _MAX_SPLIT or title.strip().lower() in _MEANT:  # "Retrace" is no trace of "Re"
        return title, None
    match = _DIRECTION.fullmatch(title)
    return (match[1], _MEANT[match[2].lower()]) if match else (title, None)


def choose(channels: Sequence[Channel], name: str | None, direction: Direction | None) -> Channel:
    """Choose the channel that a title, a signal or a number names, and ``direction`` of a signal with both.

    Without a name it is the only channel, or the only height among several.

    Raises
    ------
    ValueError
        If there is no such channel; the message lists the channels that there are.
    """
    if not channels:
        raise ValueError("contains no image")
    there = channel_list(channels)
    if name is None:
        matches = _heights(channels) if len({one.signal for one in channels}) > 1 else list(channels)
        if len({one.signal for one in matches}) == 1:
            matches = _of_direction(matches, direction)
        if len(matches) > 1:
            raise ValueError(f"has several channels, {there}; choose with --channel")
        return matches[0]
    matches = (
        _of_direction([one for one in channels if one.title == name], direction)
        or _of_direction([one for one in channels if one.signal == name], direction)
        or [one for one in channels if str(one.number) == name]
    )
    if not matches:
        raise ValueError(f"has no channel {quote(name)}; there is {there}")
    if len(matches) > 1:
        of_name = channel_list(matches)
        raise ValueError(f"has more than one channel {quote(name)}: {of_name}; choose one by its number")
    return matches[0]


def is_height(channel: Channel) -> bool:
    """Return True if the title of a channel calls it a height."""
    signal = channel.signal.strip().lower()
    return signal in _HEIGHTS or any(word in channel.title.lower() for word in _HEIGHT_WORDS)


def _heights(channels: Sequence[Channel]) -> list[Channel]:
    """Return the channels named exactly as a height, or else all that are heights by a longer name, or else all."""
    exact = [one for one in channels if one.signal.strip().lower() in _HEIGHTS]
    return exact or [one for one in channels if is_height(one)] or list(channels)


def partner(channels: Sequence[Channel], trace: Channel) -> Channel | None:
    """Return the retrace of the same signal; None if there is none.

    Of a signal that a file has several times, the traces and the retraces belong together in their order.

    Raises
    ------
    ValueError
        If there are several retraces, and not as many traces; the message lists them.
    """
    if trace.direction != "trace":
        return None
    traces, retraces = (
        [one for one in channels if one.signal == trace.signal and one.direction == direction]
        for direction in ("trace", "retrace")
    )
    if len(retraces) == 1:
        return retraces[0]
    if not retraces or trace not in traces:
        return None
    if len(traces) != len(retraces):
        what = f"has {len(traces)} x the trace and {len(retraces)} x the retrace of {quote(trace.signal)}"
        raise ValueError(f"{what}: {channel_list(retraces)}; choose one by its number, with --retrace-channel")
    return retraces[traces.index(trace)]


def _of_direction(channels: Sequence[Channel], direction: Direction | None) -> list[Channel]:
    """Return the channels of the direction where the file states directions; all where it does not."""
    matches = [one for one in channels if one.direction == direction]
    return matches if direction is not None and matches else list(channels)


def channel_list(channels: Sequence[Channel]) -> str:
    """Return numbers and titles of channels for a message."""
    there = ", ".join(
        f"{one.number} ({shortened(one.title, _MAX_TITLE)})" if one.title else f"{one.number}"
        for one in channels[:_MAX_LISTED]
    )
    return there + (", ..." if len(channels) > _MAX_LISTED else "")


def quote(title: str) -> str:
    """Quote a title for a message."""
    return f"'{shortened(title, _MAX_TITLE)}'"


def positive(value: object, unit: float = 1.0) -> float | None:
    """Convert a number, or the text of one, to another unit; None unless it is a positive number."""
    positive_number = number(value, unit)
    return positive_number if positive_number is not None and positive_number > 0.0 else None


def length_nm(value: object, unit: str) -> float | None:
    """Convert a positive number, or the text of one, in a unit of length to nm; None for anything else."""
    return positive(value, LENGTHS_NM[unit]) if unit in LENGTHS_NM else None


def quantity_nm(text: str) -> float | None:
    """Convert a text such as ``5 um`` to nm; None unless it is a positive length."""
    value, _, unit = text.strip().partition(" ")
    return length_nm(value, unit.strip())


def whole_number(text: str, what: str) -> int:
    """Convert a text to a whole number that is not negative.

    Raises
    ------
    ValueError
        If it is none, or has more than ten digits; the message has ``what`` it is.
    """
    word = text.strip()
    if not (word.isascii() and word.isdecimal()) or len(word) > 10:
        raise ValueError(f"has no whole number as {what}, but {quote(word)}")
    return int(word)


def check_pixels(columns: int, rows: int) -> None:
    """Check the size of an image that a header states.

    Raises
    ------
    ValueError
        If a side is 0, or there are more pixels than are read.
    """
    if min(columns, rows) < 1 or columns * rows > MAX_PIXELS:
        raise ValueError(f"has an image of {columns} x {rows} pixels by its header, at most 2^25 are read; damaged?")


def number(value: object, unit: float = 1.0) -> float | None:
    """Convert a finite number, or the text of one, to another unit; None for anything else."""
    try:
        finite = float(value) * unit  # type: ignore[arg-type]
    except (TypeError, ValueError):
        return None
    return finite if isfinite(finite) else None


def rotation_deg(text: str) -> float | None:
    """Convert the ``Rotate Ang.`` of Nanoscope to degrees; None unless it is a number.

    Files of Nanoscope 9 have it in radians, without a unit: 1.5708 is a right angle. A number above a turn can only be
    in degrees.
    """
    word, _, unit = text.strip().partition(" ")
    value = number(word.rstrip("°"))
    if value is None or unit.strip() or word.endswith("°") or abs(value) > 2.001 * pi:
        return value
    return degrees(value)


def complete_lines(values: Matrix) -> int:
    """Count the complete lines of a stopped scan, whose missing lines are NaN.

    All lines count unless the missing ones are the last: NaN elsewhere is a defect of the image.

    Parameters
    ----------
    values
        Values of all channels, shape (channels, lines, columns).
    """
    lines = values.shape[1]
    finite = np.isfinite(values)
    whole: list[bool] = np.all(finite, axis=(0, 2)).tolist()
    some: list[bool] = np.any(finite, axis=(0, 2)).tolist()
    complete = whole.index(False) if False in whole else lines
    return complete if complete and not any(some[complete + 1 :]) else lines


def first_line(error: BaseException) -> str:
    """Return the first line of a library's error, for a message."""
    return shortened((str(error).strip() or type(error).__name__).splitlines()[0], 100)
