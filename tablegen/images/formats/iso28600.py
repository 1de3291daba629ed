"""Images in the SPM data transfer format of ISO 28600 (.spm): a header of 128 lines, then numbers as text.

Each line of the header has a meaning of its own. The rows of numbers begin at the top of the picture; which line was
first is taken from the slow scan direction where that is from top to bottom, and is not known otherwise.
"""

import warnings
from functools import partial

import numpy as np

from tablegen.images.formats.channel import (
    Channel,
    Matrix,
    check_pixels,
    length_nm,
    number,
    positive,
    quote,
    split_direction,
    whole_number,
)

ISO_MAGIC = b"ISO/TC 201 SPM data transfer format"
_END, _LAST = b"end of header", b"end of experiment"
_MAX_HEADER = 1 << 18  # bytes; files have some two thousand
_LINES = 128
_MAX_CHANNELS = 8
# Lines of the header, counted from 1 as the standard does.
_MODE, _SCAN, _FAST, _SLOW_DIRECTION, _COLUMNS, _ROWS = 8, 17, 20, 23, 24, 25
_X_UNIT, _Y_UNIT, _WIDTH, _HEIGHT, _ANGLE, _RATE_UNIT, _RATE = 26, 27, 28, 29, 34, 37, 38
_SINGLE, _COUNT, _MANY = 69, 94, 95  # title and unit of the channel; number of channels, the first of several


def iso_channels(content: bytes, _: str) -> list[Channel]:
    """Return the images of a file of ISO 28600.

    Raises
    ------
    ValueError
        If the content is damaged; the message has the reason.
    """
    if not content.startswith(ISO_MAGIC):
        raise ValueError("does not begin as a file of ISO 28600 does")
    end = content.find(_END, 0, _MAX_HEADER)
    header = content[: max(end, 0)].decode("latin-1").splitlines()
    if len(header) != _LINES - 1 or header[15].strip() != "scan information":
        raise ValueError(f"has no header of {_LINES} lines, as ISO 28600 has it; copy it again")

    def line(count: int) -> str:
        return header[count - 1].strip()

    if line(_MODE) not in ("MAP_SC", "MAP_MC") or line(_SCAN) != "REGULAR MAPPING":
        raise ValueError(f"holds {quote(line(_MODE))} with {quote(line(_SCAN))}; regular maps are read")
    if line(_FAST) not in ("X", ""):
        raise ValueError(f"has {quote(line(_FAST))} as its fast axis; export it with lines along X")
    columns, rows = whole_number(line(_COLUMNS), "line 24"), whole_number(line(_ROWS), "line 25")
    check_pixels(columns, rows)
    if line(_MODE) == "MAP_SC":
        names = [(line(_SINGLE), line(_SINGLE + 1))]
    else:
        count = whole_number(line(_COUNT), "line 94")
        if not 1 <= count <= _MAX_CHANNELS:
            raise ValueError(f"has {count} channels; a file of ISO 28600 has 1 to {_MAX_CHANNELS}")
        names = [(line(_MANY + 3 * at), line(_MANY + 3 * at + 1)) for at in range(count)]
    values = _values(content[end + len(_END) :], columns * rows, len(names)).reshape(rows, columns, len(names))
    channels = []
    for at, (title, unit) in enumerate(names):
        signal, direction = split_direction(title)
        channels.append(
            Channel(
                at,
                title,
                (rows, columns),
                partial(_load, values, at),
                signal,
                direction,
                "" if unit in ("n", "d") else unit,  # of none
                length_nm(line(_WIDTH), line(_X_UNIT)),
                length_nm(line(_HEIGHT), line(_Y_UNIT)),
                positive(line(_RATE)) if line(_RATE_UNIT) == "Hz" else None,
                "top" if line(_SLOW_DIRECTION) == "top to bottom" else None,
                angle_deg=number(line(_ANGLE)),
            )
        )
    return channels


def _load(values: Matrix, channel: int, _: int) -> Matrix:
    return values[..., channel]


def _values(body: bytes, pixels: int, channels: int) -> Matrix:
    """Return the numbers of all pixels, those of one pixel together."""
    last = body.find(_LAST)
    if last < 0:
        raise ValueError("has no end of its numbers; copy it again")
    text = body[:last].replace(b",", b" ")
    if text.count(b"\n") > pixels + 1:  # the end of the header's line, and one a pixel
        raise ValueError(f"has more lines of numbers than its {pixels} pixels; copy it again")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # older numpy only warns of what is no number
            values = np.fromstring(text.decode("latin-1"), np.float64, sep=" ")
    except (ValueError, DeprecationWarning):
        raise ValueError("has something else than numbers behind its header; copy it again") from None
    if values.size != pixels * channels:
        raise ValueError(f"has {values.size} numbers for {channels} images of {pixels} pixels; copy it again")
    return values
