"""Cells and clock rates of the Verilog on an iCE40 HX8K, beside the plain arithmetic of one axis."""

import re
import tempfile
from pathlib import Path

import resources

from sections.chains import planned
from sections.processes import python_version, tool_version
from sections.section import EXAMPLE, ROOT, Section

TITLE = "Cells and clock rates"
TEXT = """One axis of 16-bit words and codes on an iCE40 HX8K, by yosys and nextpnr: the most cells and the lowest
rate of three seeds. The plain axis is `examples/verilog/play.v`, phase, interpolation, gain, offset and clamp with
`*` as the language has it, whose table and constants are those of the example for good. Ours play any program from
registers, with slew guard, faults, and a change of programs. [Cells and clock rates](../docs/resources.md) has all
modules."""
HEAD = ("axis", "cells", "LUT", "FF", "RAM", "MHz", "clocks a sample", "million samples a second", "run")
PLAIN = "a plain axis, constants fixed"
OURS = {  # name: case of benchmarks/resources.py, clocks a sample
    "ours, a sample a clock": ("axis", 1),
    "ours, low area": ("axis_serial", 41),
}


def plain_axis(folder: Path) -> resources.Case:
    """``play.v`` with the example's constants in it, in ``folder / "plain"``."""
    plan = planned(EXAMPLE, folder)
    constants = (folder / f"{plan.name}.vh").read_text("ascii")
    table = folder / f"{plan.name}_x.mem"
    constants = re.sub(rf'\[8\*\d+-1:0\] (\w+ = )"{table.name}"', rf'[8*{len(str(table))}-1:0] \1"{table}"', constants)
    text = (ROOT / "examples" / "verilog" / "play.v").read_text("ascii")
    text = text.replace(f'`include "{plan.name}.vh"', constants)
    (folder / "plain").mkdir()
    (folder / "plain" / "play.v").write_text(text, "ascii")
    return resources.Case("plain axis", "play", "HX8K")


def row(what: str, result: resources.Result, clocks: int, run: str) -> list[str]:
    """The row of an axis that takes so many clocks a sample."""
    assert result.mhz is not None
    counts = [str(result.counts[kind]) for kind in ("LUT", "FF", "RAM")]
    return [
        what,
        str(result.cells),
        *counts,
        f"{result.mhz:.0f}",
        str(clocks),
        f"{result.mhz / clocks:.1f}",
        f"`{run}`",
    ]


def measure() -> Section:
    """Place and route, the same on every machine with these versions."""
    versions = {"yosys": tool_version("yosys", "-V"), "nextpnr-ice40": tool_version("nextpnr-ice40", "-V")}
    only = "python benchmarks/results.py --only cells"
    with tempfile.TemporaryDirectory() as name:
        case = plain_axis(Path(name))
        plain = resources.measure(case, modules=Path(name, "plain"))
    results = {what: resources.measure(resources.CASES[case]) for what, (case, _) in OURS.items()}
    rows = [row(what, result, OURS[what][1], "python benchmarks/resources.py") for what, result in results.items()]
    rows.append(row(PLAIN, plain, 1, only))
    return Section(TITLE, TEXT, HEAD, rows, notes(results, plain), python_version() | versions)


def notes(results: dict[str, resources.Result], plain: resources.Result) -> list[str]:
    """Where the cells go."""
    assert plain.cells is not None
    more = [
        f"{what}: {(result.cells or 0) / plain.cells:.2f} of the plain axis' cells" for what, result in results.items()
    ]
    return [
        f"{'; '.join(more)}. The plain axis makes each product in one clock, and a factor of one is a constant; "
        "ours has all factors in registers, and a sample a clock takes a pipeline of two bits a stage.",
    ]
