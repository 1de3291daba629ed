"""Images of JPK (.jpk, .jpk-qi-image): a TIFF file with a page for each channel, after one with a small picture.

Tags of its own say what a page is. The first row is the bottom one, unless the grid is reflected.
"""

from functools import partial
from math import degrees, isfinite

import numpy as np

from tablegen.images.formats.channel import Channel, Direction, Matrix, number, positive
from tablegen.images.formats.tiff import TiffImage, TiffTags, tiff_pages, tiff_tags

_WIDTH, _HEIGHT, _ANGLE, _REFLECTED, _COLUMNS, _ROWS = range(0x8042, 0x8048)  # the grid, of the first page; radians
_LINE_RATE = 0x8049
_PREVIEW = "thumbnail"
_NAME, _RETRACE, _SHOWN_AS = 0x8050, 0x8051, 0x8052
_SLOTS, _DEFAULT_SLOT = 0x8080, 0x8081
_SLOT_NAME, _UNIT, _SCALING, _FACTOR, _OFFSET = 0x8090, 0x80A2, 0x80A3, 0x80A4, 0x80A5  # of the first slot
_BETWEEN_SLOTS = 0x30
_MAX_SLOTS = 64


def jpk_channels(content: bytes, _: str) -> list[Channel]:
    """Return the channels of a JPK image.

    Raises
    ------
    ValueError
        If the content is damaged; the message has the reason.
    """
    if content[:2] == b"PK":
        raise ValueError("is an archive of curves, not of images; export the image as .jpk or .jpk-qi-image")
    pages, tags = tiff_pages(content), tiff_tags(content)
    channels: list[Channel] = []
    for at, (page, own) in enumerate(zip(pages, tags, strict=False)):
        title = own.get(_NAME) or own.get(_SHOWN_AS)
        if len(page.shape) == 2 and title and not _is_preview(at, page, own, tags[0]):
            channels.append(_channel(len(channels), page, own, tags[0]))
    return channels


def _is_preview(at: int, page: TiffImage, own: TiffTags, grid: TiffTags) -> bool:
    """Test for a small picture of the scan, which comes first and has other pixels than the grid."""
    if own.get(_NAME) == _PREVIEW:
        return True
    return at == 0 and _COLUMNS in grid and page.shape[1] != grid[_COLUMNS]


def _channel(at: int, page: TiffImage, own: TiffTags, grid: TiffTags) -> Channel:
    signal = str(own.get(_NAME) or own.get(_SHOWN_AS))
    direction: Direction = "retrace" if own.get(_RETRACE) else "trace"
    factor, offset, unit = _scale(own)
    height, planned = positive(grid.get(_HEIGHT), 1e9), positive(grid.get(_ROWS))
    if height is not None and planned is not None and page.shape[0] < planned:  # stopped; the grid is the whole scan's
        height *= page.shape[0] / planned
    angle = number(grid.get(_ANGLE))
    return Channel(
        at,
        f"{signal} {direction}",
        page.shape,
        partial(_load, page, factor, offset),
        signal,
        direction,
        unit,
        positive(grid.get(_WIDTH), 1e9),
        height,
        positive(grid.get(_LINE_RATE), 1.0),
        "top" if grid.get(_REFLECTED) else "bottom",
        angle_deg=None if angle is None else degrees(angle),
    )


def _load(page: TiffImage, factor: float, offset: float, _: int) -> Matrix:
    matrix = page.load()
    return matrix.astype(np.float64) * factor + offset if matrix.dtype.kind in "iuf" else matrix


def _scale(own: TiffTags) -> tuple[float, float, str]:
    """Return the size of a step, the offset, and the unit, of the slot that the instrument shows."""
    default, count = own.get(_DEFAULT_SLOT), own.get(_SLOTS)
    for slot in range(min(int(count), _MAX_SLOTS) if isinstance(count, int) else 0):
        at = slot * _BETWEEN_SLOTS
        if default is None or own.get(_SLOT_NAME + at) != default:
            continue
        unit = own.get(_UNIT + at)
        unit_name = unit if isinstance(unit, str) else ""
        factor, offset = own.get(_FACTOR + at), own.get(_OFFSET + at)
        scaling = own.get(_SCALING + at)
        if scaling == "NullScaling":
            return 1.0, 0.0, unit_name
        if scaling == "LinearScaling" and isinstance(factor, float) and isinstance(offset, float):
            return (factor or 1.0, offset, unit_name) if isfinite(factor) and isfinite(offset) else (1.0, 0.0, "LSB")
    return 1.0, 0.0, "LSB"
