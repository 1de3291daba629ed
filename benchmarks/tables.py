"""The memory that an error takes, for docs/tables.md, and what modes take on devices, for `tablegen tables`.

``python benchmarks/tables.py`` prints the memory, ``--write`` puts it into the page and draws its figure. ``--costs``
measures what each mode takes: instructions in emulation by ``mode_costs.py`` and ``slow_costs.py``, cells by yosys and
nextpnr as ``resources.py`` does, and writes them where the package reads them.
"""

import argparse
import os
import re
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import mode_costs
import resources
import slow_costs
from mode_costs import MEASURED

from tablegen.certificate.line_errors import EmittedPeriod
from tablegen.charts.picture_file import picture
from tablegen.config.load import from_values, load
from tablegen.config.schema import Table
from tablegen.fixedpoint.program import Mode
from tablegen.fixedpoint.table_shape import MODES, TableShape
from tablegen.html_report.table_charts import table_charts
from tablegen.html_report.table_rows import axis_tables
from tablegen.html_report.tables_text import tables_text
from tablegen.planning import frame_costs
from tablegen.planning.line_plan import LinePlan, make_plan
from tablegen.planning.other_table import maker_of, with_table
from tablegen.planning.played_table import PROCESSORS, MeasuredRun
from tablegen.planning.table_choice import possible_shapes
from tablegen.planning.table_costs import FILE, counts
from tablegen.planning.table_search import TableSearch

HERE = Path(__file__).parent
EXAMPLE = HERE.parent / "examples" / "annexin_200nm.toml"
PAGE = HERE.parent / "docs" / "tables.md"
FIGURE = HERE.parent / "docs" / "figures" / "tables.svg"
ERRORS = (2.0, 1.0, 0.75, 0.6, 0.55)
SINES = ((16, 1000, 1.0), (16, 65536, 1.0), (18, 1000, 0.6), (18, 65536, 0.6))
_WORDS = {16: "to 16 bits", 32: "above"}
_SHAPING = {1: "first", 2: "second", 3: "scanner"}
_PARTS = {
    "line": "a line, in runs",
    "word": "a word of a line, in runs",
    "line_by_tick": "a line, tick by tick",
    "word_by_tick": "a word of a line, tick by tick: mixing",
    "second": "of the line, for the ratio of the second table",
}
_MODE = {"interpolated": "`direct`, `interpolated`", "cubic": "`cubic`"}


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
    """What the modes take, as tables of the page: by words and coding, and what shaping takes."""
    cores, blank = " | ".join(f"instructions, {core}" for core in PROCESSORS), "---|"
    plain = [
        f"| {_MODE[mode]} | {_WORDS[run.table_storage_bits]} | {_WORDS[run.output_storage_bits]}"
        f"{', coded' if run.coded else ''} | {_takes(run, mode)} |"
        for mode in MEASURED
        for run in counts()
        if not run.shaping_order
    ]
    shaped = [
        f"| {_MODE[mode]} | `{_SHAPING[run.shaping_order]}` | {_WORDS[run.table_storage_bits]} "
        f"| {'16 bits' if run.output_storage_bits == 16 else 'other'} | {_takes(run, mode)} |"
        for mode in MEASURED
        for run in counts()
        if run.shaping_order and not run.coded
    ]
    return "\n".join(
        [
            f"| mode | words | converter's word | {cores} |",
            f"|{blank * (len(PROCESSORS) + 3)}",
            *plain,
            "",
            f"| mode | shaping | words | converter | {cores} |",
            f"|{blank * (len(PROCESSORS) + 4)}",
            *shaped,
            "",
        ]
    )


def slow() -> str:
    """What samples at an angle take, and what lines do, as tables of the page."""
    counts_of, lines = frame_costs.slow_counts(), frame_costs.line_costs()
    rows = [
        f"| {_WORDS[run.output_storage_bits] if not run.shaping_order else _shaped_bits(run)}"
        f"{', coded' if run.coded else ''} | {f'`{_SHAPING[run.shaping_order]}`' if run.shaping_order else ''} | "
        f"{' | '.join(', '.join(f'{count:g}' for count in counts_of[run][core]) for core in PROCESSORS)} |"
        for run in counts_of
        if not (run.shaping_order and run.coded)
    ]
    parts = [
        f"| {name} | {' | '.join(f'{getattr(lines[core], key):g}' for core in PROCESSORS)} |"
        for key, name in _PARTS.items()
    ]
    off = " | ".join(f"{frame_costs.worst_percent()[core]:g} %" for core in PROCESSORS)
    cores, blank = " | ".join(PROCESSORS), "---|"
    return "\n".join(
        [
            f"| converter's word | shaping | {cores} |",
            f"|{blank * (len(PROCESSORS) + 2)}",
            *rows,
            "",
            f"| | {cores} |",
            f"|{blank * (len(PROCESSORS) + 1)}",
            *parts,
            f"| worst difference of other lines and tables | {off} |",
            "",
        ]
    )


def _shaped_bits(run: MeasuredRun) -> str:
    return "16 bits" if run.output_storage_bits == 16 else "other"


def _takes(run: MeasuredRun, mode: Mode) -> str:
    return " | ".join("{:g}, {:g}, {:g}".format(*counts()[run][mode][core]) for core in PROCESSORS)


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


def cells() -> dict[Mode, int]:
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


def main() -> None:
    """Print, or write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help=f"put the table into {PAGE.name}, and draw {FIGURE.name}")
    parser.add_argument("--costs", action="store_true", help=f"measure what the modes take, and write {FILE.name}")
    given = parser.parse_args()
    if given.costs:
        mode_costs.write(cells())
        slow_costs.write()
        return
    found = {"memory": memory(), "costs": costs(), "slow": slow(), "output": output()}
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
