"""The files of a build compared with those of its manifest, but for the comment that they begin with."""

from collections.abc import Mapping
from itertools import dropwhile, zip_longest
from pathlib import Path

from tablegen.base.reading import BUILD_FILE, read_text

_SHOWN = 60  # characters of a line
_NO_LINE = "\n"  # which no line is


def different_files(folder: Path, expected: Mapping[str, bytes]) -> list[str]:
    """List the files of a folder that differ from these behind the comment at their beginning, with the first line."""
    wrong = []
    for name, right in expected.items():
        try:
            text = read_text(folder / name, BUILD_FILE, errors="replace")
        except OSError as error:
            wrong.append(f"{name}: cannot be read: {error.strerror or error}")
            continue
        lines, others = (_behind_banner(name, each) for each in (text, right.decode("ascii")))
        if lines != others:
            line, other = next(pair for pair in zip_longest(lines, others, fillvalue=_NO_LINE) if pair[0] != pair[1])
            ours, theirs = (each.strip()[:_SHOWN] for each in (line, other))
            wrong.append(f"{name}: a line is {ours!r}, it is {theirs!r} by the manifest")
    return wrong


def _behind_banner(name: str, text: str) -> list[str]:
    if name.endswith((".c", ".h")):
        return text.partition("*/")[2].splitlines()
    return list(dropwhile(lambda line: line.startswith("//"), text.splitlines()))
