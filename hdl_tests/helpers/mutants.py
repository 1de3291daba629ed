"""What the mutants of the C and of the Verilog share: a fault put into a file, the verdict on it, the list of them.

A mutant is a file of the runtime with one piece of text replaced. Text that is found no more, or found twice, is an
error: a mutant has to be of the source as it is.
"""

import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import TypeVar

WORKERS = 2


@dataclass(frozen=True)
class Mutant:
    """What is put in place of what in a file, what that breaks, and where it shows."""

    breaks: str
    file: str
    old: str
    new: str
    where: str

    @property
    def path(self) -> Path:
        """The file as it is."""
        raise NotImplementedError

    @property
    def source(self) -> str:
        """The text of the file with the fault in it."""
        text = self.path.read_text("utf-8")
        if text.count(self.old) != 1:
            raise ValueError(f"{self.file} has {text.count(self.old)} times: {self.old}")
        return text.replace(self.old, self.new)


@dataclass(frozen=True)
class Verdict:
    """How a mutant was found, or that it was not."""

    killed: bool
    by: str


M = TypeVar("M", bound=Mutant)
Judge = Callable[[M, Path], Verdict]  # tries a mutant in a folder of its own


def judge_all(judge: Judge[M], mutants: Sequence[M], folder: Path) -> Iterator[tuple[M, Verdict]]:
    """Verdicts on mutants, in order."""
    folders = [folder / str(number) for number in range(len(mutants))]
    # The simulators are found by variables of the process: one process tries one mutant at a time.
    with ProcessPoolExecutor(WORKERS, mp_context=get_context("spawn")) as pool:
        yield from zip(mutants, pool.map(judge, mutants, folders), strict=True)


def print_list(judge: Judge[M], mutants: Sequence[M], file: str, where: str) -> None:
    """Judge mutants and list them as Markdown, each as soon as it is judged; the names are heads of columns."""
    _print(f"| fault | {file} | {where} | found by |")
    _print("|---|---|---|---|")
    with tempfile.TemporaryDirectory() as scratch:
        for mutant, verdict in judge_all(judge, mutants, Path(scratch)):
            found = verdict.by or "**not found**"
            _print(f"| {mutant.breaks} | `{mutant.file}` | {mutant.where} | {found} |")


def _print(line: str) -> None:
    sys.stdout.write(line + "\n")
    sys.stdout.flush()
