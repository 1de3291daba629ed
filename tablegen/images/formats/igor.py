"""Igor binary waves (.ibw) with images, as Asylum Research writes them: version 5 of the format.

A header of 64 bytes, one of the wave of 320, the values with x first, and texts: a note of ``key: value`` lines, and
a label for each channel, such as HeightTrace. The first row is the bottom one; it is the last in time, and rows are
turned, if the note has ``ScanDown: 1``. A scan that was stopped has fewer rows than its note says, or NaN in place of
those that are missing; the sizes in the note are those of the whole scan. The columns span a part of the sweep, which
the note states by the speed of the tip.
"""

import re
import struct
from functools import partial
from math import prod

import numpy as np

from tablegen.images.formats.channel import (
    Channel,
    FirstRow,
    Matrix,
    complete_lines,
    number,
    positive,
    split_direction,
)

_VERSION = 5
_HEADERS = 64 + 320  # bytes
_STEP_AT = 64 + 84  # bytes: the steps of all dimensions, in units of the wave
_LABEL = 32  # bytes
_MAX_NOTE = 1 << 20  # bytes; files have some ten thousand
_MAX_CHANNELS = 1000
_LEAST_IMAGED = 0.5  # of a sweep
_ROUNDED = 1e-3  # of it: notes round sizes, rates and speeds
_KINDS = {2: "f4", 4: "f8", 0x08: "i1", 0x10: "i2", 0x20: "i4", 0x48: "u1", 0x50: "u2", 0x60: "u4"}
_UNITS = ((r"Height|ZSensor|Deflection|Amplitude\d?", "m"), (r"Phase\d?", "deg"), (r"Frequency", "Hz"))


def ibw_channels(content: bytes, _: str) -> list[Channel]:
    """Return the layers of a wave of two or three dimensions (.ibw).

    Raises
    ------
    ValueError
        If the content is damaged; the message has the reason.
    """
    order = next((order for order in "<>" if content[:2] == struct.pack(f"{order}h", _VERSION)), None)
    if order is None:
        raise ValueError("does not begin as an Igor binary wave of version 5 does, which images are")
    if len(content) < _HEADERS:
        raise ValueError("ends in its header; copy it again")
    if int(np.frombuffer(content, f"{order}u2", _HEADERS // 2).sum()) & 0xFFFF:
        raise ValueError("has a header with a wrong checksum; copy it again")
    wave_bytes, formula, note_bytes, *lengths = struct.unpack_from(f"{order}12i", content, 4)
    kind = _KINDS.get(struct.unpack_from(f"{order}h", content, 64 + 16)[0])
    if kind is None:
        raise ValueError("is a wave of text or of complex numbers; images are real numbers")
    columns, rows, layers, fourth = struct.unpack_from(f"{order}4i", content, 64 + 68)
    layers = layers or 1
    if min(columns, rows, layers) < 1 or fourth:
        raise ValueError("is not a wave of columns, rows and channels; does it hold force curves?")
    if layers > _MAX_CHANNELS:
        raise ValueError(f"has {layers} channels; at most {_MAX_CHANNELS} are read")
    size = columns * rows * np.dtype(kind).itemsize
    if wave_bytes - 320 != size * layers or min(formula, note_bytes, *lengths) < 0:
        raise ValueError(f"says that {layers} images of {columns} x {rows} pixels have {wave_bytes - 320} bytes")
    texts = _HEADERS + size * layers
    labels_at = texts + formula + note_bytes + sum(lengths[:7])
    if labels_at + lengths[7] > len(content) or note_bytes > _MAX_NOTE:
        raise ValueError("ends in the middle of its images or texts; copy it again")
    note = _note(content[texts + formula : texts + formula + note_bytes])
    labels = _labels(content[labels_at : labels_at + lengths[7]], layers)
    unit = content[64 + 148 : 64 + 152].split(b"\0")[0].decode("latin-1") if layers == 1 else ""
    down = note.get("ScanDown")
    first: FirstRow = "top" if down == "1" else "bottom"
    shape = rows, columns
    complete = rows
    if kind in ("f4", "f8"):
        starts = range(_HEADERS, texts, size)
        complete = complete_lines(
            np.stack([_load(content, f"{order}{kind}", at, shape, first, rows, 0) for at in starts])
        )
    width, height = positive(note.get("FastScanSize"), 1e9), positive(note.get("SlowScanSize"), 1e9)
    step_m = struct.unpack_from(f"{order}d", content, _STEP_AT + 8)[0]
    planned = _planned_lines(note, rows, height, step_m * 1e9)
    channels = []
    for at, label in enumerate(labels):
        signal, direction = split_direction(label)
        load = partial(_load, content, f"{order}{kind}", _HEADERS + size * at, shape, first, complete)
        channels.append(
            Channel(
                at,
                label,
                (complete, columns),
                load,
                signal,
                direction,
                next((by_name for names, by_name in _UNITS if re.fullmatch(names, signal)), unit),
                width,
                None if height is None else height * complete / planned,
                positive(note.get("ScanRate"), 1.0),
                first,
                angle_deg=number(note.get("ScanAngle")),
                window=_window(note),
            )
        )
    return channels


def _load(content: bytes, kind: str, start: int, shape: tuple[int, int], first: FirstRow, lines: int, _: int) -> Matrix:
    values = np.frombuffer(content, kind, prod(shape), start).reshape(shape)
    return (values[::-1] if first == "top" else values)[:lines]


def _planned_lines(note: dict[str, str], rows: int, height_nm: float | None, step_nm: float) -> float:
    """Return the lines of the whole scan: by the note, else by the wave's scaling of N - 1 steps; at least ``rows``."""
    lines = positive(note.get("ScanLines"))
    if lines is None and height_nm is not None and 0.0 < step_nm < height_nm:
        lines = height_nm / step_nm + 1.0
        if abs(lines - rows) < 1.5:  # N or N - 1 steps in the height: a whole scan
            lines = None
    return max(lines or 0.0, float(rows))


def _window(note: dict[str, str]) -> tuple[float, float] | None:
    """Return the part of each sweep that is imaged; None where the note does not say, or says what no scan does.

    The tip is faster than two widths in a line period where it goes beyond both ends of the image.
    """
    width, rate, speed = (positive(note.get(key)) for key in ("FastScanSize", "ScanRate", "ScanSpeed"))
    if width is None or rate is None or speed is None:
        return None
    imaged = 2.0 * width * rate / speed
    if not _LEAST_IMAGED < imaged < 1.0 + _ROUNDED:
        return None
    rest = round(max(0.0, 0.5 * (1.0 - imaged)), 4)
    return rest, 1.0 - rest


def _note(text: bytes) -> dict[str, str]:
    """Return the keys of a note and their values; the first of a repeated key."""
    keys: dict[str, str] = {}
    for line in re.split(r"[\r\n]+", text.decode("latin-1")):
        key, colon, value = line.partition(":")
        if colon:
            keys.setdefault(key.strip(), value.strip())
    return keys


def _labels(text: bytes, layers: int) -> list[str]:
    """Return a label for each layer, after that of the dimension itself; empty if the file has none."""
    cells = [text[at : at + _LABEL].split(b"\0")[0].decode("latin-1") for at in range(_LABEL, len(text), _LABEL)]
    return [*cells, *[""] * layers][:layers]
