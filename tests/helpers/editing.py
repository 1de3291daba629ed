"""The shipped example pair with some lines changed, and the command line run on it in process."""

import io
import re
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn
from unittest.mock import patch

from tablegen.cli import _run, _unexpected

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
SCAN = (EXAMPLES / "annexin_200nm.toml").read_text(encoding="utf-8")
SCANNER = (EXAMPLES / "scanner.toml").read_text(encoding="utf-8")


def edited(text: str, *edits: str) -> str:
    """TOML text with edits, each one of:

    ``x.table.bits = 30`` replaces the line of a key, or adds one after the header of its table;
    ``- x.table.bits`` removes the line of a key, ``- [x.table]`` a table from its header to the next;
    ``+ [x.table]`` adds lines at the end.
    """
    lines = text.splitlines()
    for edit in edits:
        if edit.startswith("+ "):
            lines += edit[2:].splitlines()
        elif edit.startswith("- ["):
            first = _header(lines, edit[2:])
            del lines[first : _end(lines, first)]
        elif edit.startswith("- "):
            del lines[_line(lines, edit[2:])[1]]
        else:
            key, value = edit.split(" = ", 1)
            header, at = _line(lines, key)
            name = key.rpartition(".")[2]
            lines[at if at >= 0 else header + 1 : at + 1 if at >= 0 else header + 1] = [f"{name} = {value}"]
    return "\n".join(lines) + "\n"


def _header(lines: list[str], header: str) -> int:
    return next(i for i, line in enumerate(lines) if line.split("#")[0].strip() == header)


def _end(lines: list[str], header: int) -> int:
    return next((i for i in range(header + 1, len(lines)) if lines[i].startswith("[")), len(lines))


def _line(lines: list[str], key: str) -> tuple[int, int]:
    """Where the table of a key begins, and the line of the key or -1."""
    table, _, name = key.rpartition(".")
    header = -1
    if table:
        headers = (f"[{table}]", f"[[{table}]]")
        header = next(i for i, line in enumerate(lines) if line.split("#")[0].strip() in headers)
    stop = _end(lines, header)
    found = (i for i in range(header + 1, stop) if re.match(re.escape(name) + r"\s*=", lines[i]))
    return header, next(found, -1)


@dataclass(frozen=True)
class Outcome:
    """What a run of the command line left behind."""

    status: int
    out: str
    err: str

    @property
    def messages(self) -> list[str]:
        """The lines on stderr."""
        return self.err.splitlines()


def run(*arguments: str | Path, explains: bool = False) -> Outcome:
    """Run the command line in this process; an exception that no command expects is the test's, unless it ``explains``.

    With ``explains`` the handler at the top turns it into a message and a status, as it does for users.
    """
    out, err = _stream(), _stream()
    handler = _unexpected if explains else _raised
    with (
        patch.multiple(sys, stdout=out, stderr=err, argv=["tablegen", *map(str, arguments)]),
        patch("tablegen.cli._unexpected", handler),
    ):
        status = _run()
    return Outcome(status, *(stream.buffer.getvalue().decode("utf-8") for stream in (out, err)))


def _raised(error: BaseException) -> NoReturn:
    raise error


class _Stream(io.TextIOWrapper):
    buffer: io.BytesIO


def _stream() -> _Stream:
    return _Stream(io.BytesIO(), encoding="utf-8", newline="\n", write_through=True)


def write_pair(folder: Path, scan: str = SCAN, scanner: str = SCANNER) -> Path:
    """Write both files into a folder and return the path of the scan."""
    (folder / "scanner.toml").write_text(scanner, encoding="utf-8")
    path = folder / "scan.toml"
    path.write_text(scan, encoding="utf-8")
    return path
