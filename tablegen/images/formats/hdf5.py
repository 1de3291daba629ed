"""Groups, attributes and arrays of an HDF5 file, of the layout that HDF5 1.6 introduced and JPK's program writes.

The library of HDF5 is not used: a damaged file may crash the process that calls it. Every address, size and count is
compared with the length of the file, every node of a tree is read once, and a packed part is unpacked as far as its
shape says. Of other layouts (superblock 2 and later, layout 4), and of filters other than deflate, shuffle and the
checksum, the reader says that it does not know them.
"""

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from math import prod

import numpy as np

from tablegen.images.formats.channel import MAX_PIXELS, Matrix

MAGIC = b"\x89HDF\r\n\x1a\n"
_MAX_BLOCKS = 1000  # of one header, and levels of a tree
_MAX_MESSAGES = 4096  # of one header
_MAX_NAME = 1000  # bytes of a member's
_MAX_RANK = 32
_MAX_UNPACKED = 4 * MAX_PIXELS  # elements of the chunks of one image
_DATASPACE, _DATATYPE, _LAYOUT, _FILTERS, _ATTRIBUTE, _CONTINUATION, _SYMBOLS = 0x01, 0x03, 0x08, 0x0B, 0x0C, 0x10, 0x11
_INTEGER, _FLOAT, _STRING = 0, 1, 3  # classes of a datatype
_DEFLATE, _SHUFFLE, _CHECKSUM = 1, 2, 3
_SHARED = 2  # flag of a message
_SYMBOLIC_LINK = 2
Attribute = int | float | str


@dataclass(frozen=True)
class Hdf5Object:
    """The messages of an object header: kind and content, in the order of the file."""

    messages: tuple[tuple[int, bytes], ...]

    def first(self, kind: int) -> bytes | None:
        """Return the content of the first message of a kind; None if there is none."""
        return next((body for own, body in self.messages if own == kind), None)

    def attributes(self) -> dict[str, Attribute]:
        """Return the attributes that are one number or one text; others are left out."""
        values: dict[str, Attribute] = {}
        for kind, body in self.messages:
            if kind == _ATTRIBUTE:
                name, value = _attribute(body)
                if value is not None:
                    values[name] = value
        return values


@dataclass(frozen=True, eq=False)
class Hdf5Array:
    """The shape of a stored array, and what is needed to read its columns."""

    content: bytes = field(repr=False)
    shape: tuple[int, ...]
    dtype: np.dtype[np.generic]
    layout: bytes
    filters: tuple[int, ...]

    def column(self, number: int) -> Matrix:
        """Read one column of an array of two axes.

        Raises
        ------
        ValueError
            If it is damaged or stored in an unknown way; the message has the reason.
        """
        rows, columns = self.shape
        _check(self.layout[:1] == b"\x03", "has an array of an unknown layout")
        kind = self.layout[1]
        if kind == 2:
            return self._of_chunks(number)
        if kind == 0:
            (size,) = _numbers("<H", self.layout, 2)
            stored = self.layout[4 : 4 + size]
        else:
            _check(kind == 1, "has an array of an unknown layout")
            at, size = _numbers("<QQ", self.layout, 2)
            stored = _part(self.content, at, size)
        _check(len(stored) == rows * columns * self.dtype.itemsize, "has an array of another size than its shape")
        return np.frombuffer(stored, self.dtype).reshape(rows, columns)[:, number]

    def _of_chunks(self, number: int) -> Matrix:
        rows = self.shape[0]
        (rank,) = _numbers("<B", self.layout, 2)
        _check(rank == 3, "has chunks of another rank than its array")
        tree, high, wide, itemsize = _numbers("<QIII", self.layout, 3)
        _check(min(high, wide) > 0 and high * wide <= MAX_PIXELS, f"has chunks of {high} x {wide} values; damaged?")
        _check(itemsize == self.dtype.itemsize, "has chunks of another type than its array")
        values = np.zeros(rows, self.dtype)
        missing = np.ones(-(-rows // high), np.bool_)
        _check(len(missing) * high * wide <= _MAX_UNPACKED, "has chunks far larger than its images; damaged?")
        for size, mask, row, column, at in _chunks(self.content, tree, 3):
            if not column <= number < column + wide or row % high or row >= rows or not missing[row // high]:
                continue
            missing[row // high] = False
            stored = self._unpacked(_part(self.content, at, size), mask, high * wide * itemsize)
            chunk = np.frombuffer(stored, self.dtype).reshape(high, wide)
            values[row : row + high] = chunk[: rows - row, number - column]
        first = int(np.argmax(missing)) * high
        _check(not np.any(missing), f"has no values from row {first} of its array on; was it all written?")
        return values

    def _unpacked(self, stored: bytes, mask: int, size: int) -> bytes:
        """Undo the filters of a chunk, last to first, except those that its mask leaves out."""
        for at in reversed(range(len(self.filters))):
            if mask >> at & 1:
                continue
            kind = self.filters[at]
            if kind == _DEFLATE:
                stored = _inflated(stored, size + 4)
            elif kind == _SHUFFLE:
                whole = len(stored) - len(stored) % self.dtype.itemsize
                planes = np.frombuffer(stored[:whole], np.uint8).reshape(self.dtype.itemsize, -1)
                stored = planes.T.tobytes() + stored[whole:]
            else:
                stored = stored[:-4]
        _check(len(stored) == size, f"has a chunk of {len(stored)} bytes, not {size}; copy it again")
        return stored


def hdf5_root(content: bytes) -> Hdf5Object:
    """Return the root group.

    Raises
    ------
    ValueError
        If the content is damaged, or of another layout; the message has the reason.
    """
    _check(content.startswith(MAGIC), "does not begin as an HDF5 file does")
    version, widths = _numbers("<B4xH", content, 8)
    if version > 1:
        raise ValueError(f"has a superblock of version {version}; 0 and 1 are read: export the image as .jpk or .gwy")
    _check(widths == 0x0808, "has addresses of another width than 8 bytes")
    base, _, end = _numbers("<3Q", content, 24 + 4 * version)
    _check(base == 0, f"begins at byte {base} by its header; is it damaged?")
    if end > len(content):
        raise ValueError(f"has {len(content)} bytes, {end} by its header; copy it again")
    (root,) = _numbers("<8xQ", content, 56 + 4 * version)
    return hdf5_object(content, root)


def hdf5_object(content: bytes, address: int) -> Hdf5Object:
    """Return the object whose header is at an address.

    Raises
    ------
    ValueError
        If the content is damaged, or of another layout; the message has the reason.
    """
    version, size = _numbers("<B7xI", content, address)
    _check(version == 1, "has an object header of an unknown version")
    blocks = [(address + 16, size)]
    messages: list[tuple[int, bytes]] = []
    count = 0
    visited: set[int] = set()
    while blocks:
        at, size = blocks.pop(0)
        _check(at not in visited and len(visited) < _MAX_BLOCKS, "has an object header that refers to itself")
        visited.add(at)
        block = _part(content, at, size)
        inside = 0
        while inside + 8 <= len(block):
            kind, length, flags = _numbers("<HHB", block, inside)
            body = _part(block, inside + 8, length)
            inside += 8 + length
            if kind == _CONTINUATION:
                start, length = _numbers("<QQ", body, 0)
                blocks.append((start, length))
            elif not flags & _SHARED:
                messages.append((kind, body))
            count += 1
            _check(count <= _MAX_MESSAGES, f"has an object header of more than {_MAX_MESSAGES} messages")
    return Hdf5Object(tuple(messages))


def hdf5_members(content: bytes, group: Hdf5Object) -> dict[str, int]:
    """Return the members of a group and the addresses of their headers; links to other places are left out.

    Raises
    ------
    ValueError
        If the content is damaged; the message has the reason.
    """
    symbols = group.first(_SYMBOLS)
    if symbols is None:
        return {}
    tree, heap = _numbers("<QQ", symbols, 0)
    _check(_part(content, heap, 4) == b"HEAP", "has a group without names; is it damaged?")
    size, _, start = _numbers("<3Q", content, heap + 8)
    names = _part(content, start, size)
    members: dict[str, int] = {}
    entry_bytes = 0
    for at in _leaves(content, tree):
        _check(_part(content, at, 4) == b"SNOD", "has a group without members; is it damaged?")
        (count,) = _numbers("<H", content, at + 6)
        entry_bytes += 40 * count
        _check(entry_bytes <= len(content), "has a group of more members than it has room for; is it damaged?")
        for entry in range(count):
            name, address, kind = _numbers("<QQI", content, at + 8 + 40 * entry)
            stop = names.find(b"\0", name, name + _MAX_NAME)
            _check(stop >= 0, "has a member without a name; is it damaged?")
            if kind != _SYMBOLIC_LINK:
                members[names[name:stop].decode("utf-8", "replace")] = address
    return members


def hdf5_array(content: bytes, one: Hdf5Object) -> Hdf5Array | None:
    """Return the array of numbers that an object is; None if it is none.

    Raises
    ------
    ValueError
        If the content is damaged, or packed in an unknown way; the message has the reason.
    """
    space, kind, layout = (one.first(message) for message in (_DATASPACE, _DATATYPE, _LAYOUT))
    if space is None or kind is None or layout is None:
        return None
    dtype = _dtype(kind)
    _check(dtype is not None and dtype.kind in "iuf", "has an array of something else than numbers")
    assert dtype is not None
    filters = one.first(_FILTERS)
    return Hdf5Array(content, _shape(space), dtype, layout, () if filters is None else _filters(filters))


def _leaves(content: bytes, tree: int) -> Iterator[int]:
    """Yield the addresses of the leaves of a tree of names, in their order."""
    for _, child in _children(content, tree, 0, 8):
        yield child


def _chunks(content: bytes, tree: int, rank: int) -> Iterator[tuple[int, int, int, int, int]]:
    """Yield bytes, filter mask, first row, first column and address of each chunk."""
    for key, child in _children(content, tree, 1, 8 + 8 * rank):
        size, mask, row, column = _numbers("<IIQQ", key, 0)
        yield size, mask, row, column, child


def _children(content: bytes, tree: int, kind: int, key_bytes: int) -> Iterator[tuple[bytes, int]]:
    """Yield key and address of what a tree has below its lowest nodes."""
    nodes: list[tuple[int, int | None]] = [(tree, None)]
    visited = set()
    entry_bytes = 0
    while nodes:
        at, expected = nodes.pop()
        _check(at not in visited, "has a tree that refers to itself; is it damaged?")
        visited.add(at)
        own, level, count = _numbers("<BBH", content, at + 4)
        _check(
            _part(content, at, 4) == b"TREE" and own == kind,
            "has a tree of another kind than its object; is it damaged?",
        )
        _check(expected is None or level == expected, "has a tree whose levels do not fit; is it damaged?")
        step = key_bytes + 8
        entry_bytes += count * step
        _check(entry_bytes <= len(content), "has a tree of more entries than it has room for; is it damaged?")
        entries = _part(content, at + 24, count * step)
        pairs = [
            (entries[i : i + key_bytes], int.from_bytes(entries[i + key_bytes : i + step], "little"))
            for i in range(0, len(entries), step)
        ]
        if level:
            nodes.extend((child, level - 1) for _, child in reversed(pairs))
        else:
            yield from pairs


def _attribute(body: bytes) -> tuple[str, Attribute | None]:
    version, name_bytes, type_bytes, space_bytes = _numbers("<BxHHH", body, 0)
    _check(version in (1, 2, 3), "has an attribute of an unknown version")
    at = 8 + (version == 3)
    parts = []
    for size in (name_bytes, type_bytes, space_bytes):
        parts.append(_part(body, at, size))
        at += size + (-size % 8 if version == 1 else 0)
    name = parts[0].partition(b"\0")[0].decode("utf-8", "replace")
    dtype = _dtype(parts[1])
    if dtype is None or prod(_shape(parts[2])) != 1:
        return name, None
    value = _part(body, at, dtype.itemsize)
    if dtype.kind == "S":
        return name, value.partition(b"\0")[0].decode("utf-8", "replace")
    one: int | float = np.frombuffer(value, dtype)[0].item()
    return name, one


def _dtype(body: bytes) -> np.dtype[np.generic] | None:
    """Return the type of numbers or of texts of a fixed length; None for other types."""
    kind, bits, size = _numbers("<BB2xI", body, 0)
    order = ">" if bits & 1 else "<"
    kind &= 0x0F
    if kind == _INTEGER and size in (1, 2, 4, 8):
        offset, precision = _numbers("<HH", body, 8)
        if (offset, precision) == (0, 8 * size):
            return np.dtype(f"{order}{'i' if bits & 8 else 'u'}{size}")
    if kind == _FLOAT and size in (4, 8) and not bits & 0x40:
        return np.dtype(f"{order}f{size}")
    if kind == _STRING and 0 < size < 1 << 16:
        return np.dtype(f"S{size}")
    return None


def _shape(body: bytes) -> tuple[int, ...]:
    version, rank = _numbers("<BB", body, 0)
    _check(version in (1, 2) and rank <= _MAX_RANK, "has a shape of an unknown version")
    return tuple(_numbers(f"<{rank}Q", body, 8 if version == 1 else 4))


def _filters(body: bytes) -> tuple[int, ...]:
    version, count = _numbers("<BB", body, 0)
    _check(version in (1, 2), "has filters of an unknown version")
    at = 8 if version == 1 else 2
    kinds = []
    for _ in range(count):
        (kind,) = _numbers("<H", body, at)
        if kind not in (_DEFLATE, _SHUFFLE, _CHECKSUM):
            raise ValueError(f"is packed by the filter {kind}, which is not read: export the image as .jpk or .gwy")
        kinds.append(kind)
        named = version == 1
        name_bytes = _numbers("<H", body, at + 2)[0] if named else 0
        (values,) = _numbers("<H", body, at + (6 if named else 4))
        at += (8 if named else 6) + name_bytes + 4 * (values + (values % 2 if named else 0))
    _check(kinds.count(_DEFLATE) <= 1, "is packed more than once; is it damaged?")
    return tuple(kinds)


def _inflated(packed: bytes, most: int) -> bytes:
    stream = zlib.decompressobj()
    try:
        unpacked = stream.decompress(packed, most)
    except zlib.error as error:
        raise ValueError(f"has a chunk that cannot be unpacked ({error}); copy it again") from None
    # The end has the checksum of the values.
    _check(stream.eof or len(unpacked) == most, "has a packed chunk without its end; copy it again")
    return unpacked


def _numbers(layout: str, content: bytes, at: int) -> tuple[int, ...]:
    size = struct.calcsize(layout)
    return struct.unpack(layout, _part(content, at, size))


def _part(content: bytes, at: int, size: int) -> bytes:
    _check(at + size <= len(content), "refers to a place behind its end; copy it again")
    return content[at : at + size]


def _check(condition: bool, reason: str) -> None:
    if not condition:
        raise ValueError(reason)
