"""Read measurements that scripts give: the path of a CSV file, or arrays by the names of its columns."""

from collections.abc import Mapping, Sequence
from hashlib import sha256
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from tablegen.base.data_files import Source
from tablegen.base.input_errors import Problem, Rejected
from tablegen.calibration.tables.columns import Column
from tablegen.calibration.tables.table import MeasuredTable, read_table
from tablegen.numerics.arrays import Floats

Measured = str | Path | Mapping[str, ArrayLike]
VALUES = "values"  # name in messages and comments of arrays that are of no file


def measured_list(data: Measured | Sequence[Measured]) -> list[Measured]:
    """Return one table, or several, as a list."""
    return list(data) if isinstance(data, Sequence) and not isinstance(data, str) else [data]


def table_of(data: Measured, needed: Sequence[Column], optional: Sequence[Column] = ()) -> MeasuredTable:
    """Return the columns that are needed, and the optional ones that are there; of arrays in the first unit of each.

    Raises
    ------
    Rejected
        If a column is missing, has another shape than (n,), or a value out of range.
    """
    if isinstance(data, str | Path):
        return read_table(Path(data), needed, optional)
    columns: dict[str, Floats] = {}
    problems = [Problem(VALUES, 0, column.name, "missing") for column in needed if column.name not in data]
    for column in [column for column in (*needed, *optional) if column.name in data]:
        values = np.asarray(data[column.name], dtype=np.float64)
        if values.ndim != 1 or not len(values):
            problems.append(Problem(VALUES, 0, column.name, f"has the shape {values.shape}; it takes (n,)"))
        elif not np.all((values > column.above) & (values < column.below)):
            wrong = int(np.argmin((values > column.above) & (values < column.below)))
            problems.append(Problem(VALUES, 0, f"{column.name}[{wrong}]", f"{values[wrong]:g} is no {column.quantity}"))
        columns[column.name] = values
    lengths = {len(values) for values in columns.values()}
    if not problems and len(lengths) > 1:
        problems.append(Problem(VALUES, 0, "", f"columns of different lengths: {', '.join(map(str, sorted(lengths)))}"))
    if problems:
        raise Rejected(problems)
    content = b"".join(name.encode() + values.tobytes() for name, values in sorted(columns.items()))
    source = Source(VALUES, sha256(content).hexdigest()[:16])
    return MeasuredTable(VALUES, source, columns, np.arange(1, max(lengths) + 1))
