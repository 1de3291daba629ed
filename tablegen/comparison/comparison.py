"""Two sides of a comparison: their quantities in pairs, the differences, and the findings."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from tablegen.base.input_errors import Problem, Rejected
from tablegen.base.warnings import Finding
from tablegen.comparison.difference import SURE, ComparedPair, pairs
from tablegen.comparison.operators import operator_quantities
from tablegen.comparison.side import WORDS, ComparedSide, comparable, folder_of, kind_of, read_side


@dataclass(frozen=True, eq=False)
class SideBySide:
    """Two sides that can be compared."""

    a: ComparedSide
    b: ComparedSide

    @cached_property
    def pairs(self) -> list[ComparedPair]:
        """Every quantity of either side."""
        both = [list(side.quantities) for side in (self.a, self.b)]
        for name in dict.fromkeys([*self.a.operators, *self.b.operators]):
            operators = [side.operators.get(name) for side in (self.a, self.b)]
            places = sorted({place for one in operators if one is not None for place in one.places})
            for one, quantities in zip(operators, both, strict=True):
                if one is not None:
                    quantities += operator_quantities(one, places, f"{name} " if name else "")
        return pairs(both[0], both[1], of_scan="build" not in (self.a.kind, self.b.kind))

    @cached_property
    def differing(self) -> list[ComparedPair]:
        """The quantities that differ."""
        return [pair for pair in self.pairs if not pair.same]

    @property
    def titles(self) -> tuple[str, str]:
        """The names of A and B in the files, or the names of the files where these are the same."""
        a, b = self.a.title, self.b.title
        return (a, b) if a != b else (self.a.path.name, self.b.path.name)

    @property
    def same(self) -> bool:
        """True if no quantity differs and every file of a build agrees with its manifest."""
        return not self.differing and not any(side.damaged for side in (self.a, self.b))

    @property
    def findings(self) -> list[Finding]:
        """Limits of the comparison: a sentence each, with its code and axis."""
        findings = [*self.a.findings, *(one for one in self.b.findings if one not in self.a.findings)]
        if "build" in (self.a.kind, self.b.kind):
            text = (
                "a build has neither the keys and limits of the scan file nor the scanner file: these are not compared"
            )
            findings.append(Finding("note", 0.0, text, code="uncompared-inputs"))
        with_errors = [pair for pair in self.pairs if pair.errors is not None]
        if with_errors:
            more = sum(pair.errors is not None and pair.errors > SURE for pair in with_errors)
            text = (
                f"{more} of {len(with_errors)} quantities with known standard errors differ by more than {SURE:g} of "
                f"them; by chance alone one of twenty does"
            )
            findings.append(Finding("note", 0.0, text, code="standard-errors"))
        elif self.a.kind == "scanner":
            text = "no standard errors are known of both: `tablegen calibrate --write` puts them into the scanner file"
            findings.append(Finding("note", 0.0, text, code="standard-errors"))
        return findings

    @property
    def notes(self) -> list[str]:
        """The sentences of the findings."""
        return [one.full_text for one in self.findings]

    @property
    def verdict(self) -> str:
        """The result in a sentence."""
        if not self.differing:
            damaged = "" if self.same else ", but files of a build do not agree with its manifest"
            return f"no difference in {len(self.pairs)} quantities{damaged}"
        return f"{len(self.differing)} of {len(self.pairs)} quantities differ"

    def record(self, everything: bool = False) -> dict[str, Any]:
        """Return the comparison as plain data: the differences, or everything."""
        sides = {name: {"path": str(side.path), "kind": side.kind} for name, side in (("a", self.a), ("b", self.b))}
        rows = [pair.record() for pair in (self.pairs if everything else self.differing)]
        findings = [one.record() for one in self.findings]
        return {
            **sides,
            "same": self.same,
            "compared": len(self.pairs),
            "notes": self.notes,
            "findings": findings,
            "quantities": rows,
        }


def compared(a: Path, b: Path, tell: Callable[[str], object] = lambda _: None) -> SideBySide:
    """Read and compare two files or directories.

    Raises
    ------
    Rejected
        If one of them cannot be read, or they are not of comparable kinds.
    NotABuild
        If a directory is not a build.
    """
    a, b = folder_of(a), folder_of(b)
    kinds = kind_of(a), kind_of(b)
    if not comparable(*kinds):
        why = (
            f"is {WORDS[kinds[1]]}, and {a} is {WORDS[kinds[0]]}; give two scans or builds, two scanner files, or two "
            f"operator files"
        )
        raise Rejected([Problem(str(b), 0, "", why)])
    return SideBySide(read_side(a, kinds[0], tell), read_side(b, kinds[1], tell))
