"""The cost of a sample of an axis with a slow part, as of a scan at an angle: measured, and mapped to a program here.

A line of such an axis begins with work that the words of its table take, so a sample takes more where lines are short.
``python benchmarks/tables.py --costs`` measures samples of one line and one table, and what lines and words take;
``frame_costs.json`` has both, of what a build has: cubic tables of up to 16 bits.
"""

import json
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from tablegen.config.schema import ProcessorName
from tablegen.planning.played_table import PROCESSORS, MeasuredRun, PlayedTable
from tablegen.planning.table_costs import SampleCount, played_together

FILE = Path(__file__).with_name("frame_costs.json")
TICKS, WORDS = 1250, 64  # of the line and of the tables whose samples are measured


class LineCost(NamedTuple):
    """Instructions of an axis for a line with a second table, and for each word of its tables.

    Those of runs have the ends of runs and the segments of a spline too. ``second`` is the part of a line that a
    program without a second table leaves out, and ``word_by_tick`` the part of a word.
    """

    line: float
    word: float
    line_by_tick: float
    word_by_tick: float
    second: float

    def of(self, words: int, in_runs: bool, second: bool = True) -> float:
        """Return the instructions for a line whose table has so many words."""
        whole = self.line + words * self.word if in_runs else self.line_by_tick + words * self.word_by_tick
        return whole if second else whole - self.second - words * self.word_by_tick


def frame_costs(axes: Sequence[PlayedTable], processor: ProcessorName) -> list[float]:
    """Return the instructions for a sample of each of the axes that are played together, with their slow parts."""
    lines, costs = line_costs()[processor], []
    for axis, played in zip(axes, played_together(axes, processor), strict=True):
        here = lines.of(axis.shape.length, played.in_runs) / axis.period - lines.of(WORDS, played.in_runs) / TICKS
        costs.append(round(played.instructions(slow_counts()[played.run][processor]) + here, 1))
    return costs


@cache
def slow_counts() -> dict[MeasuredRun, dict[ProcessorName, SampleCount]]:
    """Return the instructions for a sample of an axis with cubic tables of 64 words over 1,250 ticks, gcc -O2."""
    return {
        MeasuredRun(*(row[name] for name in MeasuredRun._fields)): {
            name: SampleCount(*row[name]) for name in PROCESSORS
        }
        for row in measured()["samples"]
    }


@cache
def line_costs() -> dict[ProcessorName, LineCost]:
    """Return the instructions of an axis for a line."""
    lines = measured()["lines"]
    return {name: LineCost(*lines[name]) for name in PROCESSORS}


def worst_percent() -> dict[ProcessorName, float]:
    """Return by how much samples of short lines, of one other table, differ from what these counts give, at most."""
    worst: dict[ProcessorName, float] = measured()["worst_percent"]
    return worst


@cache
def measured() -> dict[str, Any]:
    """Return the content of the file: compilers, a digest of the C, lines and samples."""
    content: dict[str, Any] = json.loads(FILE.read_text("utf-8"))
    return content
