"""What a fault put into the C sequencer is, and how the lists of them are written."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import mutants

from tablegen.base.resources import c_runtime


@dataclass(frozen=True)
class Mutant(mutants.Mutant):
    """A fault in a file, by its whole name; ``where`` is one of ``c_mutants.PLACES``."""

    where: str = "fill"

    @property
    def path(self) -> Path:
        return next(path for path in c_runtime() if path.name == self.file)


def changed(file: str, where: str, faults: Mapping[str, tuple[str, str]]) -> Iterator[Mutant]:
    """Faults by what they break: the text of the file, and what stands in its place."""
    for breaks, (old, new) in faults.items():
        yield Mutant(breaks, file, old, new, where)


def removed(file: str, where: str, faults: Mapping[str, str]) -> Iterator[Mutant]:
    """Faults by what they break: the text that is taken out of the file."""
    return changed(file, where, {breaks: (old, "") for breaks, old in faults.items()})
