"""The memory that an error takes, for docs/tables.md, and what modes take on devices, for `tablegen tables`.

``python benchmarks/tables.py`` prints the memory, ``--write`` puts it into the page and draws its figure. ``--costs``
measures what each mode takes: instructions in emulation as ``firmware.py`` does, cells by yosys and nextpnr as
``resources.py`` does, and writes them where the command reads them.
"""

import argparse
import os
import re
import tempfile
from dataclasses import replace
from functools import cache
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import firmware
import resources
from msgspec import structs

from tablegen.base.resources import c_runtime
from tablegen.certificate.certificate import certify
from tablegen.certificate.line_errors import EmittedPeriod
from tablegen.charts.picture_file import picture
from tablegen.config.load import from_values, load
from tablegen.config.schema import Table
from tablegen.emit.render import render
from tablegen.fixedpoint.program import Mode
from tablegen.fixedpoint.table_shape import MODES, TableShape
from tablegen.html_report.table_charts import table_charts
from tablegen.html_report.table_costs import CELLS, COUNTS, MeasuredRun
from tablegen.html_report.table_rows import axis_tables
from tablegen.html_report.tables_text import tables_text
from tablegen.planning.line_plan import LinePlan, make_plan
from tablegen.planning.other_table import maker_of, with_table
from tablegen.planning.table_choice import possible_shapes
from tablegen.planning.table_search import TableSearch
from tablegen.verification.c.emulate import Processor, compile_bare

HERE = Path(__file__).parent
EXAMPLE = HERE.parent / "examples" / "annexin_200nm.toml"
PAGE = HERE.parent / "docs" / "tables.md"
FIGURE = HERE.parent / "docs" / "figures" / "tables.svg"
COSTS = HERE.parent / "tablegen" / "html_report" / "table_costs.py"
CORES = ("cortex-m4", "cortex-m0plus", "riscv32")
ERRORS = (2.0, 1.0, 0.75, 0.6, 0.55)
SINES = ((16, 1000, 1.0), (16, 65536, 1.0), (18, 1000, 0.6), (18, 65536, 0.6))
NARROW = MeasuredRun(16, 16, False)
_WORDS = {16: "to 16 bits", 32: "above"}
# Words of the tables that are counted: how many changes nothing.
_LENGTHS: dict[Mode, int | None] = {"direct": None, "interpolated": 512, "cubic": 128}


def sine(bits: int, ticks: int) -> LinePlan:
    """A plain sine over 79 % of a converter's range, whose period is so many ticks."""
    axis = {"size_v": 98.0, "offset_v": 50.0, "band_limit": {"method": "truncate", "harmonics": 1}}
    scan = {
        "dac": {"bits": bits, "v_min": 0.0, "v_max": 100.0, "update_rate_hz": 1e6},
        "amplifier": {"gain": 1.0},
        "timing": {"pixels": 64, "lines": 4, "line_rate_hz": 1e6 / ticks},
        "x": axis,
        "y": {"motion": "off", "offset_v": 50.0},
    }
    size = {"size": {"k_nm_per_v": 10.0, "beta": 0.0}}
    return make_plan(from_values(scan, {"name": "plain", "v_max": 100.0, "x": size, "y": size})).x


def smallest(line: LinePlan, error: float) -> dict[Mode, TableShape | None]:
    """The least memory of each mode that keeps an error."""
    search = TableSearch(maker_of(line))
    possible = possible_shapes(Table(), line.program.phase.ticks, line.series.harmonics)
    return {mode: search.smallest([one for one in possible if one.mode == mode], error) for mode in MODES}


def row(name: str, line: LinePlan, error: float) -> str:
    """The least memory of each mode, and what it errs by."""
    cells = []
    for shape in smallest(line, error).values():
        if shape is None:
            cells.append("")
            continue
        found = EmittedPeriod(with_table(line, shape)).largest_error()
        cells.append(f"{shape.memory_bits}: {shape.length} x {shape.bits}, {found:.3f}")
    return f"| {name} | {error:g} | {' | '.join(cells)} |"


def memory() -> str:
    """Both tables of the page."""
    head = f"| | error [LSB] | {' | '.join(MODES)} |\n|---|---|{'---|' * len(MODES)}"
    plan = make_plan(load(EXAMPLE))
    example = [row(line.axis, line, error) for line in plan.lines for error in ERRORS]
    sines = [row(f"{bits} bits, {ticks} ticks", sine(bits, ticks), error) for bits, ticks, error in SINES]
    return "\n".join([head, *example, "", head.replace("| |", "| sine |"), *sines, ""])


def costs() -> str:
    """What the modes take, as a table of the page."""
    head = "| mode | words | converter's word | " + " | ".join(f"instructions, {core}" for core in CORES)
    rows = [
        f"| `{mode}` | {_WORDS[run.table_storage_bits]} | {_WORDS[run.output_storage_bits]}"
        f"{', coded' if run.coded else ''} | {' | '.join(f'{COUNTS[run][mode][core]:g}' for core in CORES)} "
        f"| {CELLS[mode]} |"
        for mode in MODES
        for run in COUNTS
    ]
    return "\n".join([f"{head} | cells, HX8K |", f"|{'---|' * (len(CORES) + 4)}", *rows, ""])


def output() -> str:
    """What the command prints of x of the example."""
    setup = load(EXAMPLE)
    text = tables_text(axis_tables(setup, make_plan(setup).x))
    return "\n".join(
        ["```text", "$ tablegen tables examples/annexin_200nm.toml --axis x", *map(str.rstrip, text), "```", ""]
    )


def figure() -> bytes:
    """The front of both axes of the example, as a picture."""
    setup = load(EXAMPLE)
    charts = table_charts("annexin_200nm", [axis_tables(setup, line) for line in make_plan(setup).lines])
    return picture(charts.charts, "svg", "", charts.columns)


def instructions(core: str, run: MeasuredRun = NARROW) -> dict[Mode, float]:
    """Count an axis sample of ``fill`` by mode: of x alone, since y keeps lines between its words."""
    counts: dict[Mode, float] = {}
    for mode in MODES:
        spline = mode == "cubic"  # the runtime plays it only if it is compiled for it
        counts[mode] = round(2.0 * _fill(core, mode, spline, run) - _fill(core, "interpolated", spline, run), 1)
    return counts


@cache
def _fill(core: str, mode: Mode, spline: bool, run: MeasuredRun) -> float:
    """Mean of a frame of the example, of samples of both axes."""
    setup, wide = load(EXAMPLE), run.table_storage_bits > 16
    x = structs.replace(setup.scan.x, table=Table(mode=mode, length=_LENGTHS[mode], bits=18 if wide else 16))
    assert setup.scan.dac is not None
    dac = structs.replace(setup.scan.dac, coding="twos-complement" if run.coded else "offset-binary")
    plan = make_plan(structs.replace(setup, scan=structs.replace(setup.scan, x=x, dac=dac)))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for file, content in render(plan, certify(plan), ["c"]).items():
            (folder / file).write_bytes(content)
        sources = [HERE / "table_count.c", firmware.MEMORY, folder / f"{plan.name}.c", folder / f"{plan.name}.h"]
        options = ("-std=c99", "-O2", f"-DDAC_SPLINE={int(spline)}")
        widths = {
            "DAC_TABLE_STORAGE_BITS": run.table_storage_bits,
            "DAC_OUTPUT_STORAGE_BITS": run.output_storage_bits,
        }
        program = compile_bare(folder / "count.elf", [*c_runtime(), *sources], core, None, options, widths)
        machine = Processor(program, core)
        machine.call("count_start")
        if int.from_bytes(machine.read("refused", 4), "little"):
            raise RuntimeError(f"the runtime refuses the program with a {mode} table")
        fills = plan.schedule.frame_ticks // firmware.TICKS
        return sum(machine.call("count_fill").instructions for _ in range(fills)) / fills / firmware.TICKS / 2.0


def cells() -> dict[Mode, int | None]:
    """Return the cells of one axis on an HX8K, by mode: a sample a clock, of a cubic table one in 11.

    A direct table is measured, the others are rows of docs/resources.md.
    """
    axis = resources.CASES["axis"]
    direct = replace(axis, parameters={**axis.parameters, "INTERPOLATED": 0})
    rows = resources.page_rows()
    measured = {
        "direct": resources.measure(direct).cells,
        "interpolated": int(rows["axis"][4]),
        "cubic": int(rows["axis_cubic"][4]),
    }
    return {mode: measured[mode] for mode in MODES}


def write_costs() -> None:
    """Measure what the modes take, and put it where the command reads it."""
    lines = ["COUNTS: dict[MeasuredRun, dict[Mode, dict[str, float]]] = {"]
    for run in COUNTS:
        by_core = {core: instructions(core, run) for core in CORES}
        lines.append(f"    MeasuredRun({run.table_storage_bits}, {run.output_storage_bits}, {run.coded}): {{")
        for mode in MODES:
            counts = ", ".join(f'"{core}": {by_core[core][mode]}' for core in CORES)
            lines.append(f'        "{mode}": {{{counts}}},')
        lines.append("    },")
    lines += ["}", "INSTRUCTIONS = COUNTS[MeasuredRun(16, 16, False)]"]
    lines += ["# Cells of one axis in Verilog on an iCE40 HX8K, a sample a clock, of a cubic table one in 11."]
    lines += [
        "CELLS: dict[Mode, int] = {",
        *(f'    "{mode}": {count},' for mode, count in cells().items()),
        "}",
        "",
    ]
    before = COSTS.read_text("utf-8").partition("COUNTS: ")[0]
    COSTS.write_text(before + "\n".join(lines), "utf-8")


def main() -> None:
    """Print, or write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help=f"put the table into {PAGE.name}, and draw {FIGURE.name}")
    parser.add_argument("--costs", action="store_true", help=f"measure what the modes take, and write {COSTS.name}")
    given = parser.parse_args()
    if given.costs:
        write_costs()
        return
    found = {"memory": memory(), "costs": costs(), "output": output()}
    print(*found.values(), sep="\n")
    if given.write:
        page = PAGE.read_text("utf-8")
        for mark, text in found.items():
            marked = re.compile(rf"(?<=<!-- {mark} -->\n).*?(?=<!-- /{mark} -->)", re.DOTALL)
            page = marked.sub(lambda _, text=text: text, page, count=1)
        PAGE.write_text(page, "utf-8")
        FIGURE.write_bytes(figure())


if __name__ == "__main__":
    main()
