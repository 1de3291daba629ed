"""A measured frequency response, read from a CSV file beside the scanner file."""

from math import isfinite
from pathlib import Path

import numpy as np

from tablegen.compensation.dynamics import Measured
from tablegen.problems import Unphysical


def read_response(path: Path) -> Measured:
    """A CSV file with a header ``hz, gain, phase_deg``; the gain is taken relative to that of the first row."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError, ValueError) as error:
        raise Unphysical(f"response {path} cannot be read: {getattr(error, 'strerror', None) or error}") from None
    rows = [(n, line) for n, line in enumerate(lines, 1) if line.strip() and not line.lstrip().startswith("#")]
    header = [name.strip().lower() for name in rows[0][1].split(",")] if rows else []
    if header != ["hz", "gain", "phase_deg"]:
        raise Unphysical(f"{path}: the first line has to read hz,gain,phase_deg")
    values: list[tuple[float, float, float]] = []
    for n, line in rows[1:]:
        try:
            f, gain, phase = map(float, line.split(","))
        except ValueError:
            raise Unphysical(f"{path}:{n}: {line.strip()[:60]!r} is not three numbers") from None
        if not (isfinite(f) and isfinite(phase) and 0.0 < gain < 1e6 and abs(phase) < 1e6):
            raise Unphysical(f"{path}:{n}: {line.strip()[:60]!r} needs finite numbers and a gain above 0")
        if f <= (values[-1][0] if values else 0.0):
            raise Unphysical(f"{path}:{n}: {f:g} Hz does not ascend from above 0")
        values.append((f, gain, phase))
    if len(values) < 2:
        raise Unphysical(f"{path}: {len(values)} points; at least 2 are needed")
    table = np.array(values)
    return Measured(table[:, 0], table[:, 1] / table[0, 1], table[:, 2] / 360.0)
