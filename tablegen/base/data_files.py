"""Read files of measurements and images within their bounds: bytes, text and numbered lines."""

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from tablegen.base.input_errors import Problem, Rejected
from tablegen.base.reading import MEASUREMENT, Kind, read_bytes

_MAX_LINE = 1 << 20  # characters; a line of an image has a cell a pixel
_LINE = re.compile(r"([^\r\n]*)(\r\n|\r|\n|\Z)")  # as Unix, Windows or old Macintosh end them


@dataclass(frozen=True)
class Source:
    """The origin of numbers: the file's name without its folder, and the first 16 digits of its SHA-256."""

    name: str
    sha256: str


def file_content(path: Path, name: str, kind: Kind = MEASUREMENT) -> bytes:
    """Read the bytes of a measurement.

    Raises
    ------
    Rejected
        If it is not a file, is too large or cannot be read.
    """
    require_file(path, name)
    try:
        return read_bytes(path, kind)
    except OSError as error:
        raise unreadable(name, error) from None


def require_file(path: Path, name: str) -> None:
    """Check that a regular file stands at this path.

    Raises
    ------
    Rejected
        If there is none; the message has ``name``.
    """
    if not os.path.isfile(path):
        raise Rejected([Problem(name, 0, "", "is not a file")])


def unreadable(name: str, error: OSError) -> Rejected:
    """Return the rejection of a file that cannot be read."""
    return Rejected([Problem(name, 0, "", f"cannot be read: {error.strerror or error}")])


def file_text(content: bytes, name: str, line: int = 1) -> str:
    """Decode UTF-8 without its byte order mark; ``line`` is the number of the first line.

    Raises
    ------
    Rejected
        If the bytes are not UTF-8, at the line.
    """
    if line == 1 and content.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise Rejected([Problem(name, 1, "", "is UTF-16; save it as UTF-8")])
    try:
        return content.decode("utf-8-sig" if line == 1 else "utf-8")  # spreadsheets write a byte order mark
    except UnicodeDecodeError as error:
        line += content.count(b"\n", 0, error.start)
        why = f"byte 0x{content[error.start]:02x} is not UTF-8"
        raise Rejected([Problem(name, line, "", why)]) from None


def lines_of(text: str, name: str, first: int = 1) -> Iterator[tuple[int, str]]:
    """Yield the lines of a text, numbered from ``first``.

    Raises
    ------
    Rejected
        If a line is longer than 2^20 characters.
    """
    for number, match in enumerate(_LINE.finditer(text), first):
        if match.end(1) - match.start() > _MAX_LINE:
            why = f"a line of {match.end(1) - match.start()} characters; at most 2^20 are read"
            raise Rejected([Problem(name, number, "", why)])
        yield number, match[1]
