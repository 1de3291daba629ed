"""Split tables into traces: one a file, or several that a column numbers or whose time starts again."""

import numpy as np

from tablegen.calibration.laws.hysteresis import Trace
from tablegen.calibration.tables.columns import DISPLACEMENT, DRIVE, TIME, TRACE
from tablegen.calibration.tables.table import MeasuredTable


def split_traces(table: MeasuredTable) -> list[Trace]:
    """Split a table into its traces, in order; named after the file, and by number where there are several."""
    time = table[TIME]
    if TRACE in table:
        numbers = table[TRACE]
        groups = [
            (f" trace {number:g}", np.flatnonzero(numbers == number)) for number in dict.fromkeys(numbers.tolist())
        ]
    else:
        begins = np.flatnonzero(np.diff(time) < 0.0) + 1
        groups = [(f" trace {i}", part) for i, part in enumerate(np.split(np.arange(len(time)), begins), 1)]
    several = len(groups) > 1
    name = table.source.name
    return [
        Trace(name + label if several else name, time[rows], table[DRIVE][rows], table[DISPLACEMENT][rows])
        for label, rows in groups
    ]


def trace_name(table: MeasuredTable, trace: Trace) -> str:
    """Return the name of a trace in messages: its file with the folder, and its number where there are several."""
    return table.file + trace.name.removeprefix(table.source.name)
