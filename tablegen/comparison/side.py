"""One side of a comparison: a scan file, a directory of a build, a scanner file, or an operator file."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from tablegen.base.input_errors import Problem, Rejected
from tablegen.base.toml import read_toml
from tablegen.base.warnings import Finding
from tablegen.comparison.operators import ComparedOperator
from tablegen.comparison.quantity import ComparedQuantity
from tablegen.comparison.scanners import scanner_quantities
from tablegen.comparison.scans import scan_quantities
from tablegen.comparison.tilt import tilt_quantities
from tablegen.comparison.turned import turned_quantities
from tablegen.config.load import load, load_scanner
from tablegen.config.scanner import Scanner
from tablegen.html_report.planned_scan import planned_scan
from tablegen.html_report.subject import Subject, of_directory
from tablegen.html_report.turned_subject import TurnedSubject, turned_directory, turned_scan
from tablegen.manifest.format import MANIFEST
from tablegen.manifest.turned import is_turned

Kind = Literal["scan", "build", "scanner", "operator"]
WORDS: dict[Kind, str] = {
    "scan": "a scan file",
    "build": "a directory of a build",
    "scanner": "a scanner file",
    "operator": "an operator file",
}
_NAMES = 4  # of damaged files that are named
_TOGETHER = ({"scan", "build"}, {"scanner"}, {"operator"})


@dataclass(frozen=True, eq=False)
class ComparedSide:
    """One side: ``subject`` of a scan or build, ``scanner`` of a scanner file, and ``operators``.

    ``operators`` has those of a scanner file by axis, that of an operator file as "".
    """

    path: Path
    kind: Kind
    quantities: list[ComparedQuantity]
    findings: tuple[Finding, ...] = ()
    subject: Subject | TurnedSubject | None = None
    scanner: Scanner | None = None
    operators: dict[str, ComparedOperator] = field(default_factory=dict)

    @property
    def damaged(self) -> bool:
        """True if a file of a build does not agree with its manifest."""
        return self.subject is not None and any(state.wrong for state in self.subject.files)

    @property
    def title(self) -> str:
        """The name within the file, or the file's."""
        if self.subject is not None:
            return self.subject.manifest.name
        return self.scanner.name if self.scanner is not None else self.path.name


def kind_of(path: Path) -> Kind:
    """Return the kind of a path, by its content.

    Raises
    ------
    Rejected
        If the file cannot be read, or is of none of the kinds.
    """
    if path.is_dir():
        return "build"
    values, file = read_toml(path, str(path))
    if "plays" in values and "lines" in values:
        return "operator"
    if "scanner" in values or "timing" in values:
        return "scan"
    if "v_max" in values:
        return "scanner"
    why = "is none of these: a scan file, a scanner file, an operator file, a directory of a build"
    raise Rejected([Problem(file.name, 0, "", why)])


def folder_of(path: Path) -> Path:
    """Return the directory of a build, for which its manifest stands too."""
    return path.parent if path.name == MANIFEST else path


def comparable(a: Kind, b: Kind) -> bool:
    """Return true if two kinds can be compared."""
    return any({a, b} <= kinds for kinds in _TOGETHER)


def read_side(path: Path, kind: Kind, tell: Callable[[str], object] = lambda _: None) -> ComparedSide:
    """Read one side; a scan is planned and certified.

    Raises
    ------
    Rejected
        If a file is faulty.
    NotABuild
        If a directory is not a build.
    """
    subject: Subject | TurnedSubject
    if kind == "build":
        subject = turned_directory(path) if is_turned(path) else of_directory(path)
        wrong = [state.name for state in subject.files if state.wrong]
        names = ", ".join(wrong[:_NAMES]) + (" and others" if len(wrong) > _NAMES else "")
        text = f"{path.name or path}: does not agree with its manifest: {names}"
        damage = (Finding("note", 0.0, text, code="damaged-build"),) if wrong else ()
        return ComparedSide(path, kind, _quantities(subject), damage, subject)
    if kind == "scan":
        setup = load(path)
        if setup.mixes_motions:
            subject = turned_scan(setup, progress=tell)
        else:
            subject = planned_scan(setup, progress=tell, remedies=False)
        assert subject.planned is not None
        findings = tuple(
            Finding("note", 0.0, str(problem), code=problem.code, axis=problem.axis)
            for problem in subject.planned.broken
        )
        return ComparedSide(path, kind, _quantities(subject), findings, subject)
    if kind == "operator":
        return ComparedSide(path, kind, [], operators={"": ComparedOperator.read(path)})
    scanner, file = load_scanner(path)
    operators = {}
    for axis in ("x", "y"):
        table = getattr(scanner, axis).hysteresis
        if table is not None and table.operator_file is not None:
            operators[axis] = ComparedOperator.read(path.parent / table.operator_file)
    return ComparedSide(path, kind, scanner_quantities(file, scanner), (), None, scanner, operators)


def _quantities(subject: Subject | TurnedSubject) -> list[ComparedQuantity]:
    if isinstance(subject, TurnedSubject):
        return turned_quantities(subject)
    return [*scan_quantities(subject), *tilt_quantities(subject)]
