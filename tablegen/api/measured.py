"""Read measurements that scripts give: the path of a CSV file, or arrays by the names of its columns."""

from collections.abc import Mapping, Sequence
from hashlib import sha256
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from tablegen.base.data_files import Source
from tablegen.base.input_errors import Problem, Rejected
from tablegen.calibration.tables.columns import Column, Times
from tablegen.calibration.tables.header import Header
from tablegen.calibration.tables.recorder import AS_WRITTEN, Recorder
from tablegen.calibration.tables.table import MeasuredTable
from tablegen.numerics.arrays import Floats

Measured = str | Path | Mapping[str, ArrayLike]
VALUES = "values"  # name in messages and comments of arrays that are of no file


def measured_list(data: Measured | Sequence[Measured]) -> list[Measured]:
    """Return one table, or several, as a list."""
    return list(data) if isinstance(data, Sequence) and not isinstance(data, str) else [data]


def table_of(
    data: Measured,
    needed: Sequence[Column],
    optional: Sequence[Column] = (),
    recorder: Recorder = AS_WRITTEN,
    peak_to_peak: bool = False,
) -> MeasuredTable:
    """Return the columns that are needed, and the optional ones that are there, with voltages at the piezo.

    Arrays have the names of columns in a file, or those of ``recorder.columns``; drives may be peak to peak.

    Raises
    ------
    Rejected
        If a column is missing, has another shape than (n,), or a value out of range.
    """
    if isinstance(data, str | Path):
        return recorder.read(Path(data), needed, optional, peak_to_peak)
    names = list(data)
    expected = [*needed, *optional]
    places, remarks = Header(VALUES, 0, names).places(expected, needed, recorder.choice(expected))
    columns: dict[str, Floats] = {}
    problems: list[Problem] = []
    for at, column, convert, spelt in places:
        written = np.asarray(data[names[at]], dtype=np.float64)
        if written.ndim != 1 or not len(written):
            problems.append(Problem(VALUES, 0, spelt, f"has the shape {written.shape}; it takes (n,)"))
            continue
        values = written * convert.factor if isinstance(convert, Times) else np.array([*map(convert, written.tolist())])
        if not np.all((values > column.above) & (values < column.below)):
            wrong = int(np.argmin((values > column.above) & (values < column.below)))
            problems.append(Problem(VALUES, 0, f"{spelt}[{wrong}]", f"{written[wrong]:g} is no {column.quantity}"))
        columns[column.name] = values
    lengths = {len(values) for values in columns.values()}
    if not problems and len(lengths) > 1:
        problems.append(Problem(VALUES, 0, "", f"columns of different lengths: {', '.join(map(str, sorted(lengths)))}"))
    if problems:
        raise Rejected(problems)
    content = b"".join(name.encode() + values.tobytes() for name, values in sorted(columns.items()))
    source = Source(VALUES, sha256(content).hexdigest()[:16])
    table = MeasuredTable(VALUES, source, columns, np.arange(1, max(lengths) + 1), tuple(remarks))
    return recorder.at_piezo(table, peak_to_peak)
