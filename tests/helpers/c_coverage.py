"""Which lines of the C runtime a run went through, and how often: gcc's ``--coverage`` read by ``gcov``."""

import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from building import run_clean

COVERAGE = ("-std=c99", "-O0", "--coverage")


@dataclass(frozen=True)
class Coverage:
    """How often each line of a file was run, and each branch taken; lines and branches of several runs added up."""

    lines: dict[tuple[str, int], int]
    branches: dict[tuple[str, int], list[int]]

    def of(self, file: Path, text: str) -> int:
        """How often the line of a file was run that has this text in it; there has to be just one."""
        found = [number for number, line in enumerate(file.read_text("utf-8").splitlines(), 1) if text in line]
        assert len(found) == 1, f"{file.name} has {len(found)} lines with: {text}"
        return self.lines[file.name, found[0]]

    def missed(self) -> list[str]:
        """Lines that no run went through."""
        return [f"{name}:{line}" for (name, line), count in sorted(self.lines.items()) if not count]

    def missed_branches(self) -> list[str]:
        """Branches that were never taken, or always, by line."""
        return [f"{name}:{line}" for (name, line), counts in sorted(self.branches.items()) if not all(counts)]

    @property
    def share_of_branches(self) -> float:
        """Branches taken, of all."""
        counts = [count for each in self.branches.values() for count in each]
        return sum(map(bool, counts)) / len(counts)


def coverage(folders: Iterable[Path], names: Iterable[str]) -> Coverage:
    """What ran of the files of these names, by the data that programs have left in folders."""
    total, wanted = Coverage({}, {}), set(names)
    for data in sorted(path for folder in folders for path in folder.rglob("*.gcda")):
        text = run_clean(["gcov", "--json-format", "--stdout", "--branch-probabilities", data.name], data.parent)
        for document in text.splitlines():
            for file in json.loads(document)["files"]:
                name = Path(file["file"]).name
                if name in wanted:
                    _add(total, name, file["lines"])
    return total


def _add(total: Coverage, name: str, lines: list[dict]) -> None:  # type: ignore[type-arg]
    for line in lines:
        key = name, int(line["line_number"])
        total.lines[key] = total.lines.get(key, 0) + int(line["count"])
        counts = [int(branch["count"]) for branch in line["branches"]]
        if counts:
            before = total.branches.get(key, [0] * len(counts))
            # An inline function has branches in each of its copies.
            total.branches[key] = [a + b for a, b in zip(before, counts, strict=False)]
