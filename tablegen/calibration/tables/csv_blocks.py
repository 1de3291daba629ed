"""Read long CSV files a block at a time: plain numbers by numpy's parser, anything else by line, with its number."""

import io
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tablegen.base.reading import Kind, chunks_of
from tablegen.numerics.arrays import Floats

_NUMBERS = b"0123456789+-.eE \n"
_MAX_LINE = 1 << 20  # characters; longer lines are refused by the reader of single lines


@dataclass(frozen=True, slots=True)
class Block:
    """Whole lines of a file; ``line`` is the number of the first one, from 1. The last block may lack its newline."""

    line: int
    content: bytes


def blocks_of(path: Path, kind: Kind) -> Iterator[Block]:
    """Yield the lines of a file in blocks.

    Raises
    ------
    OSError
        If the file cannot be read.
    """
    line = 1
    parts: list[bytes] = []
    for chunk in chunks_of(path, kind):
        cut = chunk.rfind(b"\n") + 1
        if cut:
            content = b"".join([*parts, chunk[:cut]])
            yield Block(line, content)
            line += _count(content)
            parts = []
        parts.append(chunk[cut:])
    rest = b"".join(parts)
    if rest:
        yield Block(line, rest)


def plain_rows(content: bytes, separator: str, width: int) -> Floats | None:
    """Parse lines that are all rows of plain numbers.

    Between other separators than commas a comma is a decimal one, if all are.

    Returns
    -------
    Floats or None
        Shape (lines, width); None where a line is something else.
    """
    mark = separator.encode("ascii")
    content = content.replace(b"\r\n", b"\n")
    if mark != b"," and b"," in content:
        if b"." in content:
            return None
        content = content.replace(b",", b".")
    if not content or content.translate(None, _NUMBERS + mark):
        return None
    if not content.endswith(b"\n"):
        content += b"\n"
    ends = np.flatnonzero(np.frombuffer(content, np.uint8) == ord("\n"))
    if int(np.max(np.diff(ends, prepend=-1))) > _MAX_LINE:
        return None
    try:
        text = io.StringIO(content.decode("ascii"))
        rows: Floats = np.loadtxt(text, dtype=np.float64, comments=None, delimiter=separator, ndmin=2)
    except ValueError:
        return None
    return rows if rows.shape == (len(ends), width) and bool(np.all(np.isfinite(rows))) else None


def _count(content: bytes) -> int:
    """Count lines, as Unix, Windows and old Macintosh end them."""
    return content.count(b"\n") + content.count(b"\r") - content.count(b"\r\n")
