"""A measured frequency response, read from a CSV file beside the scanner file."""

import os
from math import isfinite
from pathlib import Path

import numpy as np

from tablegen.base.figures import shown_path
from tablegen.base.input_errors import Unphysical
from tablegen.base.reading import RESPONSE, read_bytes
from tablegen.compensation.dynamics import Measured


def read_response(path: Path) -> Measured:
    """Read a CSV file with a header ``hz, gain, phase_deg``; the gain is relative to that of the first row.

    Raises
    ------
    Unphysical
        With the file and the line, if it is not such a table or does not ascend in hz.
    """
    name = shown_path(path)
    if not os.path.isfile(path):  # a pipe would be waited for
        raise Unphysical(f"{name} is not a file; the path is relative to the scanner file")
    try:
        content = read_bytes(path, RESPONSE)
    except OSError as error:
        raise Unphysical(f"{name} cannot be read: {error.strerror or error}") from None
    try:
        text = content.decode("utf-8-sig")  # spreadsheets write a byte order mark
    except UnicodeDecodeError as error:
        n = content.count(b"\n", 0, error.start) + 1
        raise Unphysical(f"{name}:{n}: byte 0x{content[error.start]:02x} is not UTF-8") from None
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    rows = [(n, line) for n, line in enumerate(lines, 1) if line.strip() and not line.lstrip().startswith("#")]
    header = [name.strip().lower() for name in rows[0][1].split(",")] if rows else []
    if header != ["hz", "gain", "phase_deg"]:
        raise Unphysical(f"{name}:{rows[0][0] if rows else 1}: the first line has to read hz,gain,phase_deg")
    values: list[tuple[float, float, float]] = []
    for n, line in rows[1:]:
        try:
            f, gain, phase = map(float, line.split(","))
        except ValueError:
            raise Unphysical(f"{name}:{n}: {line.strip()[:60]!r} is not three numbers") from None
        if not (isfinite(f) and 1e-6 <= gain <= 1e6 and abs(phase) <= 1e6):
            raise Unphysical(
                f"{name}:{n}: {line.strip()[:60]!r} is outside the accepted range: "
                f"finite hz, a gain of 1e-6 to 1e6, phase_deg of -1e6 to 1e6"
            )
        before = values[-1][0] if values else 0.0
        if f <= before:
            raise Unphysical(f"{name}:{n}: {f:g} Hz is not above {before:g} Hz; hz has to ascend")
        values.append((f, gain, phase))
    if len(values) < 2:
        raise Unphysical(f"{name}: {len(values)} rows of numbers; at least 2 are needed")
    table = np.array(values)
    return Measured(table[:, 0], table[:, 1] / table[0, 1], table[:, 2] / 360.0)
