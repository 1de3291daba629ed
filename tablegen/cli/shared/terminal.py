"""Output to the terminal: control characters are shown as text, so that none takes effect.

Titles of images, versions of manifests, names of files, texts of devices and messages of libraries come from others. So
nothing of this package writes to stdout or stderr but through the streams of ``guard_streams``; only this module puts
control characters there, for a line that is drawn again and for bold text.
"""

import os
import sys
from collections.abc import Iterable
from io import TextIOWrapper
from typing import IO, Any

WAYS = ("up", "down", "right", "left")
# All control characters but tab and line end; marks that reorder or hide text; separators that some take for line ends.
_STEERING = {
    code: f"\\u{code:04x}"
    for first, last in (
        *((0x00, 0x08), (0x0B, 0x1F), (0x7F, 0x9F), (0x61C, 0x61C)),
        *((0x200B, 0x200F), (0x2028, 0x202E), (0x2060, 0x2069), (0xFEFF, 0xFEFF)),
    )
    for code in range(first, last + 1)
}
ARROWS = {  # what a key sends: a terminal, one in its mode for applications, and Windows
    **{f"\x1b{mode}{last}": way for mode in "[O" for last, way in zip("ABCD", WAYS, strict=True)},
    **{f"\xe0{last}": way for last, way in zip("HPMK", WAYS, strict=True)},
}
_BOLD, _PLAIN = "\x1b[1m", "\x1b[0m"
_STYLES = {  # colours of the table of 256 that are readable on black and on white, and for the colour-blind
    "title": _BOLD,
    "faint": "\x1b[38;5;245m",
    "before": "\x1b[38;5;245m",
    "forward": "\x1b[38;5;32m",
    "backward": "\x1b[38;5;172m",
    "other": "\x1b[38;5;35m",
    "limit": "\x1b[38;5;161m",
}


def visible(text: str) -> str:
    r"""Return the text with ``\u001b`` in place of an escape, and so on; as JSON writes it, so that JSON stays JSON."""
    return text.translate(_STEERING)


class GuardedStream:
    """A text stream that writes through ``visible``; its other attributes are those of the stream."""

    def __init__(self, stream: IO[str]) -> None:
        self.stream = stream

    def write(self, text: str) -> int:
        """Write the text with its control characters visible."""
        self.stream.write(visible(text))
        return len(text)

    def writelines(self, lines: list[str]) -> None:
        """Write several texts with their control characters visible."""
        for line in lines:
            self.write(line)

    @property
    def encoding(self) -> str:
        """Encoding of the stream; not ASCII, for which click would bypass this class."""
        name = getattr(self.stream, "encoding", None) or "utf-8"
        return "iso8859-1" if name.lower() in ("ascii", "us-ascii", "ansi_x3.4-1968", "646") else name

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stream, name)


def guard_streams() -> None:
    """Replace stdout and stderr by guarded streams, once."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None or isinstance(stream, GuardedStream):
            continue
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # a character that the terminal does not have must not fail
        setattr(sys, name, GuardedStream(stream))


def tell(text: str, bold: bool = False) -> None:
    """Print a line on stdout, in bold on a terminal with ``bold``."""
    stream = _behind(sys.stdout)
    if stream is None:
        return
    printable = visible(text)
    stream.write(f"{_BOLD}{printable}{_PLAIN}\n" if bold and stream.isatty() else f"{printable}\n")


def paint(spans: Iterable[tuple[str, str]]) -> None:
    """Print a line on stdout of texts with their styles; in colours on a terminal, unless NO_COLOR is set."""
    stream = _behind(sys.stdout)
    if stream is None:
        return
    coloured = stream.isatty() and not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"
    styled = ((visible(text), _STYLES.get(style, "") if coloured else "") for text, style in spans)
    stream.write("".join(f"{style}{text}{_PLAIN}" if style else text for text, style in styled) + "\n")


def redraw(text: str) -> None:
    """Write a text over the line of stderr in which the cursor is."""
    stream = _behind(sys.stderr)
    stream.write("\r" + visible(text))
    stream.flush()


def erase(width: int) -> None:
    """Clear what ``redraw`` has written."""
    redraw(" " * width)
    _behind(sys.stderr).write("\r")
    _behind(sys.stderr).flush()


def _behind(stream: Any) -> Any:
    return stream.stream if isinstance(stream, GuardedStream) else stream
