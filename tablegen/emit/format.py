"""The interface of a format of a build: a file in ``tablegen/emit/formats/``, or an entry point.

A format declares its name, its purpose and its files; it renders integers that were computed before, and compares its
files with a manifest. Everything else (the writer, ``--check``, dependency files, removal of outdated files,
``tablegen verify``) goes through all formats of a build alike.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar

from msgspec import Struct

from tablegen.base.input_errors import Unphysical
from tablegen.base.reading import BUILD_FILE, read_bytes
from tablegen.emit.content import Content


class Comparison(Struct, frozen=True):
    """The comparison of files of a build with its manifest: what was compared, and every difference in a sentence."""

    subject: str
    compared: str
    wrong: list[str]


class Format(ABC):
    """A format of a build; a subclass sets ``name``, ``purpose`` and ``file_names``, and renders."""

    name: ClassVar[str]
    """How ``[emit] formats`` and ``--format`` call it: lower-case letters, digits and hyphens."""
    purpose: ClassVar[str]
    """What it is for, in one line."""
    file_names: ClassVar[str]
    """Its files in words, with NAME for the scan's name."""
    needs: ClassVar[tuple[str, ...]] = ()
    """Formats whose files it names: a build with it has these too."""
    comment: ClassVar[str | None] = None
    """How a line of comment begins, where the files begin with such lines; they are not compared with a manifest."""

    @abstractmethod
    def files(self, content: Content) -> dict[str, bytes]:
        """Render the files of a build by name, without the runtime.

        Raises
        ------
        Unphysical
            If the format cannot hold the build.
        """

    def runtime(self) -> list[Path]:
        """Return the files that go with the format unchanged, such as a sequencer."""
        return []

    def runtime_of_z(self) -> list[Path]:
        """Return the files that go with it unchanged beside those of ``runtime`` where a build has the output z."""
        return []

    def sources(self) -> list[Path]:
        """Return the files beside its module that decide what it writes: templates, and the runtime."""
        return self.runtime()

    def check(self, folder: Path, content: Content) -> list[Comparison]:
        """Compare the files in a folder with the content of a manifest; unless overridden, by rendering them again."""
        expected, wrong = self.files(content), []
        for name, right in expected.items():
            try:
                content_read = read_bytes(folder / name, BUILD_FILE)
            except OSError as error:
                wrong.append(f"{name}: cannot be read: {error.strerror or error}")
                continue
            if difference := self._first_difference(content_read, right):
                wrong.append(f"{name}: {difference}")
        count = len(expected)
        return [Comparison("files", f"{count} file{'s' if count != 1 else ''}", wrong)]

    def _first_difference(self, stored: bytes, right: bytes) -> str | None:
        """Describe the first difference of a file from the manifest's, but for the comment at the beginning."""
        skipped, body = self._after_comment(stored)
        expected = self._after_comment(right)[1]
        if body == expected:
            return None
        try:
            ours, others = body.decode("ascii").splitlines(), expected.decode("ascii").splitlines()
        except UnicodeDecodeError:
            pairs = enumerate(zip(body, expected, strict=False))
            at = next((i for i, (a, b) in pairs if a != b), min(len(body), len(expected)))
            return f"byte {at} is not as the manifest has it; {len(body)} bytes, {len(expected)} by the manifest"
        for at, (line, other) in enumerate(zip(ours, others, strict=False)):
            if line != other:
                ours_there, others_there = _at_difference(line.strip(), other.strip())
                return f"line {skipped + at + 1} is {ours_there!r}, it is {others_there!r} by the manifest"
        return f"has {skipped + len(ours)} lines, {skipped + len(others)} by the manifest"

    def _after_comment(self, content: bytes) -> tuple[int, bytes]:
        """Count the lines of comment at the beginning of a file, which no manifest has, and return those after them."""
        lines, skipped = content.splitlines(keepends=True), 0
        if self.comment is not None:
            mark = self.comment.encode("ascii")
            while skipped < len(lines) and (lines[skipped].startswith(mark) or not lines[skipped].strip()):
                skipped += 1
        return skipped, b"".join(lines[skipped:])


def _at_difference(line: str, other: str) -> tuple[str, str]:
    """Cut two lines to 40 characters with the first one that differs, and what stands before it."""
    pairs = enumerate(zip(line, other, strict=False))
    start = max(next((at for at, (ours, theirs) in pairs if ours != theirs), min(len(line), len(other))) - 20, 0)
    return line[start : start + 40], other[start : start + 40]


def differing(name: str, stored: Mapping[str, int | str], expected: Mapping[str, int | str]) -> list[str]:
    """List the constants that a header lacks, has with another value, or has beyond those that are expected."""
    wrong = []
    for key, value in expected.items():
        if key not in stored:
            wrong.append(f"{name}: {key} is missing, it is {_display(value)} in the manifest")
        elif stored[key] != value:
            wrong.append(f"{name}: {key} is {_display(stored[key])}, it is {_display(value)} in the manifest")
    return wrong + [f"{name}: {key} is not in the manifest" for key in stored if key not in expected]


def _display(value: int | str) -> str:
    return repr(value) if isinstance(value, str) else f"{value:x}" if abs(value) >= 1 << 64 else str(value)


__all__ = ["Comparison", "Content", "Format", "Unphysical", "differing"]
