"""A section of benchmarks/results.md: rows that were measured together, where, and with which versions."""

import os
import platform
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
HELPERS = ROOT / "tests" / "helpers"
EXAMPLE = ROOT / "examples" / "annexin_200nm.toml"


@dataclass(frozen=True)
class Section:
    """``text`` says what a row is; ``notes`` say where we are behind, and where what is slow goes."""

    title: str
    text: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    notes: Sequence[str]
    versions: Mapping[str, str]

    def markdown(self, name: str) -> str:
        """The section as it stands in the page, between the marks of its name."""
        for row in self.rows:
            if len(row) != len(self.head) or any("|" in cell for cell in row):
                raise ValueError(f"{name}: {row} does not fit under {self.head}")
        table = [self.head, ["---"] * len(self.head), *self.rows]
        lines = [
            f"## {self.title}",
            "",
            *wrapped(self.text),
            "",
            *("| " + " | ".join(row) + " |" if at != 1 else "|" + "---|" * len(row) for at, row in enumerate(table)),
            "",
            *(line for note in self.notes for line in wrapped(note, "- ")),
            *([""] if self.notes else []),
            f"Run: `python benchmarks/results.py --only {name}`.",
            *wrapped(f"On {machine()}; {', '.join(f'{tool} {version}' for tool, version in self.versions.items())}."),
        ]
        return "\n".join([f"<!-- {name} -->", *lines, f"<!-- /{name} -->"]) + "\n"


def wrapped(text: str, first: str = "", width: int = 120) -> list[str]:
    """Lines of Markdown of at most ``width`` characters; what stands between backquotes stays on one."""
    lines = [first]
    for word in re.findall(r"(?:`[^`]*`|\S)+", text):
        added = lines[-1] + ("" if lines[-1] in (first, " " * len(first)) else " ") + word
        if len(added) > width:
            lines.append(" " * len(first) + word)
        else:
            lines[-1] = added
    return lines


def machine() -> str:
    """The kind of this machine's processor, and how many cores there are."""
    kind = platform.machine()
    try:
        found = re.search(r"^model name\s*: (.*)$", Path("/proc/cpuinfo").read_text("utf-8"), re.MULTILINE)
    except OSError:
        found = None
    cores = os.cpu_count() or 1
    return f"{kind}{f' ({found[1].strip()})' if found else ''} with {cores} core{'s' if cores > 1 else ''}"
