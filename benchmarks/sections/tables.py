"""Bits of a table against its error: each mode of the build at several bounds, and Fourier words."""

import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import get_args, get_type_hints

from editing import SCAN, edited, write_pair

from sections.processes import python_version
from sections.section import Section
from tablegen.base.input_errors import Rejected
from tablegen.certificate.certificate import certify
from tablegen.config.load import load
from tablegen.config.schema import Table
from tablegen.planning.line_plan import LinePlan, make_plan

TITLE = "Bits of a table"
TEXT = """The example, 16-bit codes: the smallest table of each mode, length (powers of two) and word (8 to 20 bits)
whose largest error over all ticks is within a bound, in LSB of the converter. Half of an LSB is the rounding of the
code, which every table has. Bits are those of the words; C keeps words of up to 16 bits in 16. Fourier words are what
an upload or an FPGA's memory holds: the device renders the table of the same line from them, into memory."""
HEAD = ("axis", "error at most [LSB]", "mode", "words", "bits a word", "bits", "bits in C", "error [LSB]")
BOUNDS = (2.0, 1.0, 0.75, 0.6)
LENGTHS = tuple(1 << power for power in range(4, 14))
BITS = range(8, 21)


def modes() -> list[str]:
    """Those of the build, as the scan file names them, without the one that leaves the choice to the build."""

    def words(kind: object) -> Iterator[str]:
        for one in get_args(kind):
            yield from [one] if isinstance(one, str) else words(one)

    return [mode for mode in words(get_type_hints(Table)["mode"]) if mode != "auto"]


def candidates(mode: str, ticks: int) -> Iterator[tuple[int, int, int]]:
    """Bits, words and bits a word of the tables of a mode, the smallest first."""
    lengths = (ticks,) if mode == "direct" else LENGTHS
    yield from sorted((length * bits, length, bits) for length in lengths for bits in BITS)


def planned(folder: Path, axis: str, mode: str, length: int, bits: int) -> tuple[LinePlan, float] | None:
    """The plan of an axis and the error of its table; None where the build refuses it."""
    edits = [f"{axis}.table.mode = '{mode}'", f"{axis}.table.bits = {bits}"]
    edits.append(f"- {axis}.table.length" if mode == "direct" else f"{axis}.table.length = {length}")
    try:
        plan = make_plan(load(write_pair(folder, edited(SCAN, "- [limits]", *edits))))
    except Rejected:
        return None
    return getattr(plan, axis), certify(plan)[axis].max_error_lsb


def smallest(folder: Path, axis: str, mode: str, ticks: int) -> dict[float, tuple[LinePlan, float]]:
    """The smallest table of a mode within each bound; one that no table keeps is left out."""
    found: dict[float, tuple[LinePlan, float]] = {}
    for _, length, bits in candidates(mode, ticks):
        if all(bound in found for bound in BOUNDS):
            break
        tried = planned(folder, axis, mode, length, bits)
        if tried is None:
            continue
        for bound in BOUNDS:
            if tried[1] <= bound and bound not in found:
                found[bound] = tried
    return found


def row(axis: str, bound: float, line: LinePlan, error: float) -> list[str]:
    """Of the smallest table."""
    words, bits = len(line.program.words), line.program.bits
    in_c = words * (16 if bits <= 16 else 32)
    return [axis, f"{bound:g}", line.program.mode, str(words), str(bits), str(words * bits), str(in_c), f"{error:.3f}"]


def fourier_row(axis: str, line: LinePlan, error: float) -> list[str]:
    """Of the Fourier words of the example's line."""
    count, bits = 2 * line.series.harmonics + 1, 32
    rendered = f"Fourier words, rendered to {len(line.program.words)} x {line.program.bits}"
    return [axis, "", rendered, str(count), str(bits), str(count * bits), str(count * bits), f"{error:.3f}"]


def measure() -> Section:
    """The same on every machine."""
    rows = []
    with tempfile.TemporaryDirectory() as name:
        plan = make_plan(load(write_pair(Path(name), edited(SCAN, "- [limits]"))))
        certificates = certify(plan)
        for line in plan.lines:
            axis = line.axis
            rows.append(fourier_row(axis, line, certificates[axis].max_error_lsb))
            for mode in modes():
                if mode == "direct" and line.program.ticks > max(LENGTHS):
                    continue  # a word for each of the ticks of a frame
                found = smallest(Path(name), axis, mode, line.program.ticks)
                for bound in BOUNDS:
                    if bound in found:
                        rows.append(row(axis, bound, *found[bound]))
                    else:
                        rows.append([axis, f"{bound:g}", mode, "none", *[""] * 4])
    return Section(TITLE, TEXT, HEAD, rows, notes(rows), python_version())


def notes(rows: list[list[str]]) -> list[str]:
    """What the example has more than it needs."""
    shown = []
    for axis in "xy":
        least = min((row for row in rows if row[:2] == [axis, "1"] and row[5]), key=lambda row: int(row[5]))
        shown.append(f"{axis} {least[5]} ({least[2]}, {least[3]} x {least[4]})")
    return [
        f"The example's tables are 32768 bits each, of 2048 words of 16; least below 1 LSB: {', '.join(shown)}.",
        "y in `direct` mode would have a word for each tick of a frame, 250,000, and is left out.",
    ]
