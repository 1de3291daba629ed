"""Input errors: each fault with its file, line and key, all reported in one run."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import NamedTuple

from msgspec import Struct, field

from tablegen.base.remedies import FindingCode
from tablegen.base.warnings import Axis, axis_name

MOST_PROBLEMS = 50  # of one run; more are no help, and a file may have a million
_MOST_KEY, _MOST_WHY = 200, 1000  # characters


def shortened(text: str, most: int = 200) -> str:
    """Return a text on one line; of a long one its beginning and its end."""
    text = text if text.isprintable() else "".join(c if c.isprintable() else ascii(c)[1:-1] for c in _cut(text, most))
    return _cut(text, most)


def _cut(text: str, most: int) -> str:
    return text if len(text) <= most else f"{text[: most // 2]}...{text[len(text) - most // 2 + 3 :]}"


class Unphysical(ValueError):
    """A quantity that is physically or numerically impossible; the message says by how much, and what would fit."""


class Problem(NamedTuple):
    """One fault of the input, printed as ``scan.toml:14: x.table.bits: 30 is above 24``.

    ``code`` and ``axis`` are those of a finding of the certificate, for programs: "" for every other fault.
    """

    file: str
    line: int
    key: str
    why: str
    code: FindingCode = ""
    axis: Axis = ""

    def coded(self, code: FindingCode, axis: str) -> "Problem":
        """Return the problem with the code of its finding and the axis ("x", "y" or "")."""
        return self._replace(code=code, axis=axis_name(axis))

    def __str__(self) -> str:
        place = f"{self.file}:{self.line}" if self.line else self.file
        why = shortened(self.why, _MOST_WHY)
        return f"{place}: {shortened(self.key, _MOST_KEY)}: {why}" if self.key else f"{place}: {why}"


class Rejected(Exception):
    """The input was refused; ``problems`` has its faults in the order of the files, at most 50 and a note."""

    def __init__(self, problems: list[Problem]) -> None:
        self.problems = sorted(dict.fromkeys(problems), key=lambda p: (p.file, p.line))
        if len(self.problems) > MOST_PROBLEMS:
            self.problems = self.problems[:MOST_PROBLEMS]
            last = self.problems[-1]
            self.problems.append(Problem(last.file, last.line, "", f"more faults than these {MOST_PROBLEMS}; stopped"))
        super().__init__("\n".join(map(str, self.problems)))

    def __reduce__(self) -> tuple[type["Rejected"], tuple[list[Problem]]]:
        return type(self), (self.problems,)  # what was raised in another process arrives with its problems


class Document(Struct, frozen=True):
    """A TOML file as the user named it, and the line on which each of its keys stands.

    ``lines`` is None for values that stand in no file. ``written_keys`` has the keys that follow from others: the key
    that was written in place of each, and the factor from the one's value to the other's; ``inherited`` the keys that
    an axis takes from another one, each with the key that is written.
    """

    name: str
    lines: dict[str, int] | None = field(default_factory=dict)
    written_keys: Mapping[str, tuple[str, float]] = field(default_factory=dict)
    inherited: Mapping[str, str] = field(default_factory=dict)

    def line_of(self, key: str) -> int:
        """Return the line of a key such as ``x.hysteresis.branches[0].turn``; else of its table."""
        if self.lines is None:
            return 0
        while key:
            if key in self.lines:
                return self.lines[key]
            cut = max(key.rfind("."), key.rfind("["))
            key = key[:cut] if cut > 0 else ""
        return 1

    def problem(self, key: str, why: str) -> Problem:
        """Return a problem of this document's key, reported at the key that was written in its place."""
        requested, (key, _) = key, self.written_key(key)
        if requested[1:2] == "." and key[1:2] != ".":  # a key for both axes
            why = f"{requested[0]}: {why}"
        other = self.inherited.get(key)
        if other is not None:
            why = f"{why}; {key.split('.')[0]} has it from {other} by like"
        return Problem(self.name, self.line_of(other or key), key, why)

    def written_key(self, key: str) -> tuple[str, float]:
        """Return the key that was written in place of this one, and the factor to its value; itself if written."""
        return self.written_keys.get(key, (key, 1.0))


class Problems:
    """A collector of problems, so that one run reports them all; beyond ``MOST_PROBLEMS`` it raises ``Rejected``."""

    def __init__(self) -> None:
        self.entries: list[Problem] = []

    def add(self, document: Document, key: str, why: str) -> None:
        """Add a problem of a key, and go on.

        Raises
        ------
        Rejected
            If there are more than ``MOST_PROBLEMS``.
        """
        self.note(document.problem(key, why))

    def note(self, problem: Problem) -> None:
        """Add a problem that was made elsewhere.

        Raises
        ------
        Rejected
            If there are more than ``MOST_PROBLEMS``.
        """
        self.entries.append(problem)
        if len(self.entries) > MOST_PROBLEMS:
            raise Rejected(self.entries)

    @contextmanager
    def at(self, document: Document, key: str) -> Iterator[None]:
        """Turn an ``Unphysical`` raised inside into a problem of this key."""
        try:
            yield
        except Unphysical as reason:
            self.add(document, key, str(reason))

    def stop_if_any(self) -> None:
        """End the collection.

        Raises
        ------
        Rejected
            If there are problems.
        """
        if self.entries:
            raise Rejected(self.entries)
