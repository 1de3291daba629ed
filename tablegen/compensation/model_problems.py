"""The problems of a hysteresis model: at keys of its table, or of the scan file."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from tablegen.base.input_errors import Document, Problem, Problems


class ModelProblems:
    """The problems of one axis' model, each at its key; ``count`` shows a model whether there are new ones."""

    __slots__ = ("_axis", "_problems", "scan_file", "scanner_file")

    def __init__(self, axis: str, scan_file: Document, scanner_file: Document, problems: Problems) -> None:
        self._axis = axis
        self._problems = problems
        self.scan_file = scan_file
        self.scanner_file = scanner_file

    @classmethod
    def without_files(cls, axis: str, problems: Problems) -> "ModelProblems":
        """Return an instance whose problems are discarded, to test whether a model serves at all."""
        return cls(axis, Document("scan"), Document("scanner"), problems)

    @property
    def count(self) -> int:
        """The number of problems so far."""
        return len(self._problems.entries)

    @contextmanager
    def at(self, key: str) -> Iterator[None]:
        """Turn an ``Unphysical`` raised inside into a problem of this key of the hysteresis table."""
        with self._problems.at(self.scanner_file, f"{self._axis}.hysteresis.{key}"):
            yield

    def add(self, key: str, why: str) -> None:
        """Add a problem of a key of the hysteresis table."""
        self._problems.add(self.scanner_file, f"{self._axis}.hysteresis.{key}", why)

    def add_to_scan(self, key: str, why: str) -> None:
        """Add a problem of a key of the axis in the scan file, such as ``turn``."""
        self._problems.add(self.scan_file, f"{self._axis}.{key}", why)

    def extend(self, problems: Sequence[Problem]) -> None:
        """Add problems of a file of the model's own."""
        for problem in problems:
            self._problems.note(problem)
