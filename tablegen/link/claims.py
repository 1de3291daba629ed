"""Checks of a device's claims: a value that no device can have raises ``NotUnderstood`` with field and value.

HELLO and STATUS decide how much memory a host takes and how long it waits, so that every field is checked first.
The ranges are those of docs/protocol.md.
"""

from dataclasses import fields

from tablegen.link.errors import NotUnderstood
from tablegen.link.messages import (
    DATA_BYTES,
    NO_SLOT,
    VERSION,
    AxisLimits,
    AxisShape,
    DeviceInfo,
    DeviceStatus,
    Listing,
    More,
    SlotContent,
    StoreStatus,
)

PROGRAM_BYTES = 192  # as in tablegen.link.program_image, which imports numpy
MAXIMUM_INDEX_BITS = 16
MAXIMUM_HARMONICS = 4096
MAXIMUM_LINE = (1 << 31) - 1
MAXIMUM_SLOTS = 15
MAXIMUM_NUMBERS = 0xFFFF
_WORD_BITS = range(8, 25)  # of table words and of codes
_CONVERTER_BITS = 63  # mask of the word's bits in AxisShape.converter
_MAXIMUM_CONVERTER_BITS = 32
_FOURIER_BYTES = 4
_MAXIMUM_WORD_BYTES = 3
MAXIMUM_IMAGE_BYTES = PROGRAM_BYTES + 2 * (_MAXIMUM_WORD_BYTES << MAXIMUM_INDEX_BITS)
MAXIMUM_KNOTS = 65  # as in tablegen.fixedpoint.frame_program
_SLOW_INDEX_BITS = range(3, 15)
_SLOW_PART_BYTES = (112, 176)  # where an image has the words slow_part of x and y
_KNOT_BYTES = 3 + 2  # a gain and a ratio
_PRINTABLE = range(0x20, 0x7F)  # characters of a name
_PIXEL_BYTES = 2 * 2  # the ticks of a pixel in trace and retrace
MAXIMUM_TABLE_PIXELS = 65535
# Of both axes: a word more for each of the table, the slow table and the knots.
MAXIMUM_SLOW_BYTES = 2 * (
    (1 << MAXIMUM_INDEX_BITS) + (_MAXIMUM_WORD_BYTES << _SLOW_INDEX_BITS[-1]) + _KNOT_BYTES * MAXIMUM_KNOTS
)


def most_bytes(info: DeviceInfo) -> int:
    """Return the bytes that no image of a device exceeds, by the widths that it announced.

    ``image_bytes`` may be more, where its memory is; and less, where tables are longer than what was uploaded for them.
    """
    fourier = _FOURIER_BYTES * (2 * info.harmonics + 1)
    tables = sum(max(_table_bytes(axis, info), fourier) for axis in (info.x, info.y))
    of_z = 0 if info.z is None else most_bytes(info.of_z)
    return PROGRAM_BYTES + tables + _PIXEL_BYTES * info.table_pixels + of_z


def _table_bytes(axis: AxisShape, info: DeviceInfo) -> int:
    table = axis.word_bytes << axis.index_bits
    if More.SLOW_PARTS not in info.more:
        return table
    slow_table = axis.word_bytes << info.slow_index_bits
    return table + (1 << axis.index_bits) + slow_table + _KNOT_BYTES * info.slow_knots


def has_slow_parts(image: bytes) -> bool:
    """Return True if an axis of an image has a slow part, by its program words."""
    return any(any(image[at : at + 4]) for at in _SLOW_PART_BYTES)


def check_device(info: DeviceInfo) -> None:
    """Check every field of HELLO.

    Raises
    ------
    NotUnderstood
        For the first field that no device of this version can have.
    """
    _check("HELLO", "version", info.version, VERSION, VERSION)
    _check("HELLO", "window", info.window, 1, 255)
    _check("HELLO", "data_bytes", info.data_bytes, 1, DATA_BYTES)
    _check("HELLO", "harmonics", info.harmonics, 0, MAXIMUM_HARMONICS)
    _check_parts(info, ("x", "y"))
    if info.z is not None:
        _check_parts(info.of_z, ("z", "the axis beside z"))


def _check_parts(info: DeviceInfo, names: tuple[str, str]) -> None:
    """Check what a sequencer of a device has: shapes and limits of its axes, slow parts, pixels, and bytes."""
    for name, shape, limits in zip(names, (info.x, info.y), (info.x_limits, info.y_limits), strict=True):
        _check_shape(name, shape)
        _check("HELLO", f"{name} code_max", limits.code_max, limits.code_min, (1 << shape.dac_bits) - 1)
        _check("HELLO", f"{name} max_step", limits.max_step, 1, (1 << 32) - 1)
    further_bytes = 0
    if More.SLOW_PARTS in info.more:
        _check("HELLO", "knots of a slow part", info.slow_knots, 2, MAXIMUM_KNOTS)
        bits = _SLOW_INDEX_BITS
        _check("HELLO", "index_bits of a slow table", info.slow_index_bits, bits[0], bits[-1])
        further_bytes += MAXIMUM_SLOW_BYTES
    if More.PIXEL_TABLES in info.more:
        _check("HELLO", "pixels of a table", info.table_pixels, 1, MAXIMUM_TABLE_PIXELS)
        further_bytes += _PIXEL_BYTES * MAXIMUM_TABLE_PIXELS
    _check("HELLO", "image_bytes", info.image_bytes, 0, MAXIMUM_IMAGE_BYTES + further_bytes)


def _check_shape(name: str, shape: AxisShape) -> None:
    _check("HELLO", f"{name} index_bits", shape.index_bits, 0, MAXIMUM_INDEX_BITS)
    for field, bits in (("word_bits", shape.word_bits), ("dac_bits", shape.dac_bits)):
        _check("HELLO", f"{name} {field}", bits, _WORD_BITS.start, _WORD_BITS.stop - 1)
    if shape.converter:  # 0 if the device does not state it
        _check(
            "HELLO",
            f"{name} converter (its bits)",
            shape.converter & _CONVERTER_BITS,
            shape.dac_bits,
            _MAXIMUM_CONVERTER_BITS,
        )


def check_unchanged(before: DeviceInfo, now: DeviceInfo) -> None:
    """Check that HELLO announces the device that was there before.

    Raises
    ------
    NotUnderstood
        If a field differs.
    """
    for field in (field.name for field in fields(DeviceInfo)):
        was, is_now = getattr(before, field), getattr(now, field)
        if was != is_now:
            raise NotUnderstood(
                f"HELLO: {field} was {was} and is {is_now} now", "is another device connected to the port now?"
            )


def has_restarted(before: DeviceStatus, now: DeviceStatus) -> bool:
    """Return True if the device restarted between two answers.

    Its boot count differs or, of a device without one, it has taken fewer programs than before.
    """
    return now.boot != before.boot or now.generation < before.generation


def check_status(status: DeviceStatus, info: DeviceInfo, source: str) -> None:
    """Raise ``NotUnderstood`` for the first field of a status that a device cannot have; ``source`` is its request."""
    _check(source, "line", status.line, 0, MAXIMUM_LINE)
    _check(source, "received", status.received, 0, info.whole_image_bytes)


def check_limits(limits: tuple[AxisLimits, AxisLimits], info: DeviceInfo) -> None:
    """Check that active limits are no wider than those of the device's build.

    Raises
    ------
    NotUnderstood
        If one is wider.
    """
    for name, active, build in (("x", limits[0], info.x_limits), ("y", limits[1], info.y_limits)):
        inner = active.within(build)
        for field in (field.name for field in fields(AxisLimits)):
            value = getattr(active, field)
            if value != getattr(inner, field):
                raise NotUnderstood(
                    f"LIMITS: {name} {field} is {value}, wider than {getattr(build, field)}, which HELLO announced"
                )


def check_store(status: StoreStatus) -> None:
    """Check what a device answers to SLOT.

    Raises
    ------
    NotUnderstood
        For the first field that no device can have.
    """
    _check("SLOT", "slots", status.slots, 1, MAXIMUM_SLOTS)
    for field in ("selected", "trial", "start"):
        value = getattr(status, field)
        if value != NO_SLOT:
            _check("SLOT", field, value, 0, MAXIMUM_SLOTS)
    _check("SLOT", "started", status.started, 0, 1)
    _check("SLOT", "content", status.content, 0, max(SlotContent))


def check_listing(listing: Listing, first: Listing | None) -> None:
    """Check what a device answers to LIST; ``first`` is what it said of another number before.

    Raises
    ------
    NotUnderstood
        For the first field that no device can have, or that differs from what it said before.
    """
    if first is None:
        _check("LIST", "numbers", listing.numbers, 1, MAXIMUM_NUMBERS)
        _check("LIST", "compiled", listing.compiled, 0, listing.numbers)
    else:
        _check("LIST", "numbers", listing.numbers, first.numbers, first.numbers)
        _check("LIST", "compiled", listing.compiled, first.compiled, first.compiled)
    _check("LIST", "content", listing.content, 0, 1)
    for character in listing.name:
        _check("LIST", "a character of the name", character, _PRINTABLE[0], _PRINTABLE[-1])


def check_length(source: str, payload: bytes, size: int) -> None:
    """Check that an answer is long enough; a longer one is of a later version.

    Raises
    ------
    NotUnderstood
        If it is shorter than ``size`` bytes.
    """
    if len(payload) < size:
        raise NotUnderstood(f"{source}: its answer has {len(payload)} bytes; at least {size} are needed")


def _check(source: str, field: str, value: int, least: int, most: int) -> None:
    if not least <= value <= most:
        span = str(least) if least == most else f"{least} to {most}"
        raise NotUnderstood(f"{source}: {field} is {value}; possible: {span}")
