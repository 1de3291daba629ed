"""What the C sequencer takes on Cortex-M and RISC-V: instructions, code, memory, stack, for docs/instructions.md.

``python benchmarks/firmware.py`` prints the tables, ``--write`` puts them into the page. They are counted in emulation,
of the shipped example, compiled by gcc; another version of it gives other numbers. Instructions are not
cycles.
"""

import argparse
import re
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from tablegen.base.resources import c_runtime
from tablegen.certificate.certificate import certify
from tablegen.config.load import load
from tablegen.emit.render import render
from tablegen.planning.line_plan import make_plan
from tablegen.verification.c.emulate import COMPILERS, CORES, Processor, compile_bare

HERE = Path(__file__).parent
EXAMPLE = HERE.parent / "examples" / "annexin_200nm.toml"
MEMORY = HERE.parent / "examples" / "firmware" / "memory.c"
PAGE = HERE.parent / "docs" / "instructions.md"
TICKS = 256  # of a fill
CASES = [
    ("cortex-m0plus", "-O2"),
    ("cortex-m0plus", "-Os"),
    ("cortex-m3", "-O2"),
    ("cortex-m4", "-O2"),
    ("cortex-m4", "-Os"),
    ("cortex-m7", "-O2"),
    ("cortex-m33", "-O2"),
    ("riscv32", "-O2"),
]


@dataclass(frozen=True)
class Counts:
    """Of a processor and an optimisation; instructions, and bytes."""

    fill: float  # an axis sample, mean of a frame
    fill_line: float  # the same away from the ends of a line
    worst_fill: float  # a tick of both axes, of the call that took longest
    limited_fill: float  # the same of a program that is at a limit for half of each line
    markers: float  # a tick
    first: float  # an axis sample that is shaped, mean of a frame; by order
    second: float
    scanner: float
    step: float  # a tick, both axes, mean
    worst_step: int
    plain: float  # an axis sample
    linear: float  # a sample
    word: float  # of a table
    load: int
    code: Mapping[str, int]  # bytes of each source
    shaping_code: Sequence[int]  # bytes that each order takes more
    bank: int
    state: int  # besides the banks
    stack: Mapping[str, int]


def measure(core: str, optimisation: str, folder: Path, most_fills: int | None = None) -> Counts:
    """Build the example for a core and count, over a frame or its first ``most_fills`` calls of ``fill``."""
    plan = make_plan(load(EXAMPLE))
    for name, content in render(plan, certify(plan)).items():
        (folder / name).write_bytes(content)
    sources = [*c_runtime(), HERE / "firmware_count.c", MEMORY, folder / f"{plan.name}.c", folder / f"{plan.name}.h"]
    options = ("-std=c99", optimisation)
    machine = Processor(compile_bare(folder / "count.elf", sources, core, None, options), core)
    machine.call("count_init")
    loaded = machine.call("count_load")
    machine.call("count_start")
    steps = [machine.call("count_step") for _ in range(plan.schedule.ticks)]
    frame = range(plan.schedule.frame_ticks // TICKS)[:most_fills]
    fills = [machine.call("count_fill") for _ in frame]
    marked = [machine.call("count_fill_markers") for _ in fills]
    plain = [machine.call("count_plain").instructions for _ in fills]
    rendered = machine.call("count_synthesize")
    machine.call("count_init")
    machine.call("count_load_limited")
    machine.call("count_start")
    limited = [machine.call("count_fill").instructions for _ in fills]
    filled = sum(fill.instructions for fill in fills)
    shaped = [_shaped(core, sources, options, order, folder, len(fills)) for order in (1, 2, 3)]
    everything, bank = (int.from_bytes(machine.read("bytes", 4, at), "little") for at in (0, 4))
    return Counts(
        fill=filled / len(fills) / TICKS / 2,
        fill_line=min(fill.instructions for fill in fills) / TICKS / 2,
        worst_fill=max(fill.instructions for fill in fills) / TICKS,
        limited_fill=max(limited) / TICKS,
        markers=(sum(fill.instructions for fill in marked) - filled) / len(fills) / TICKS,
        first=shaped[0],
        second=shaped[1],
        scanner=shaped[2],
        step=sum(step.instructions for step in steps) / len(steps),
        worst_step=max(step.instructions for step in steps),
        plain=sum(plain) / len(plain) / TICKS / 2,
        linear=machine.call("count_linear").instructions / TICKS,
        word=rendered.instructions / len(plan.x.program.words),
        load=loaded.instructions,
        code=(code := _code(core, optimisation, folder)),
        shaping_code=[
            sum(_code(core, optimisation, folder, f"-DDAC_SHAPING={order}").values()) - sum(code.values())
            for order in (1, 2, 3)
        ],
        bank=bank,
        state=everything - 2 * bank,
        stack={
            "step": max(step.stack for step in steps),
            "fill": max(fill.stack for fill in (*fills, *marked)),
            "load": loaded.stack,
            "synthesize": rendered.stack,
        },
    )


def _shaped(core: str, sources: Sequence[Path], options: Sequence[str], order: int, folder: Path, fills: int) -> float:
    """Instructions for an axis sample of a runtime of this order; both axes have it."""
    chosen = {"DAC_SHAPING": order}
    machine = Processor(compile_bare(folder / f"shaped_{order}.elf", sources, core, None, options, chosen), core)
    for call in ("count_init", "count_load_shaped", "count_start"):
        machine.call(call)
    return sum(machine.call("count_fill").instructions for _ in range(fills)) / fills / TICKS / 2


def _code(core: str, optimisation: str, folder: Path, *more: str) -> dict[str, int]:
    """Bytes of each source that is not empty."""
    found = {}
    for source in c_runtime():
        if source.suffix == ".c":
            target = folder / f"{source.stem}.o"
            compiler = COMPILERS[CORES[core].architecture]
            options = [*CORES[core].options, "-std=c99", optimisation, "-ffreestanding", *more]
            _run(compiler, *options, "-c", str(source), "-o", str(target))
            size = int(_run(compiler.replace("gcc", "size"), str(target)).splitlines()[1].split()[0])
            if size:
                found[source.name] = size
    return found


def _run(*command: str) -> str:
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def tables(measured: Mapping[tuple[str, str], Counts]) -> str:
    """Both tables of the page."""
    cases = list(measured)
    head = "| | " + " | ".join(f"{core} `{optimisation}`" for core, optimisation in cases) + " |\n"
    head += "|---|" + "---|" * len(cases) + "\n"

    def row(what: str, values: list[str]) -> str:
        return f"| {what} | " + " | ".join(values) + " |\n"

    all_counts = list(measured.values())
    instructions = head + "".join(
        row(what, [shown.format(getattr(counts, name)) for counts in all_counts])
        for what, name, shown in (
            ("the longest `fill` of a frame, a tick of both axes", "worst_fill", "{:.0f}"),
            ("the longest at a limit, a tick of both axes", "limited_fill", "{:.0f}"),
            ("the longest `step`, a tick of both axes", "worst_step", "{:.0f}"),
            ("markers of `fill`, a tick", "markers", "{:.1f}"),
            ("`fill`, an axis sample, mean of a frame", "fill", "{:.1f}"),
            ("the same between the ends of a line", "fill_line", "{:.1f}"),
            ("`fill`, shaped `first`, an axis sample, mean of a frame", "first", "{:.1f}"),
            ("`fill`, shaped `second`", "second", "{:.1f}"),
            ("`fill`, shaped `scanner`", "scanner", "{:.1f}"),
            ("a plain loop, an axis sample, mean of a frame", "plain", "{:.1f}"),
            ("linear interpolation alone, a sample", "linear", "{:.1f}"),
            ("`step`, a tick of both axes, mean of a line", "step", "{:.0f}"),
            ("`dac_synthesize`, a word", "word", "{:.0f}"),
            ("`load`", "load", "{:.0f}"),
        )
    )
    memory = head + "".join(
        row(f"code of `{name}`", [str(counts.code[name]) for counts in all_counts]) for name in all_counts[0].code
    )
    memory += row("code, all", [str(sum(counts.code.values())) for counts in all_counts])
    for order in (1, 2, 3):
        more = [str(counts.shaping_code[order - 1]) for counts in all_counts]
        memory += row(f"code that `DAC_SHAPING={order}` takes more", more)
    memory += row("a bank, without tables", [str(counts.bank) for counts in all_counts])
    memory += row("state of both axes besides the banks", [str(counts.state) for counts in all_counts])
    for name in all_counts[0].stack:
        memory += row(f"stack of `{name}`", [str(counts.stack[name]) for counts in all_counts])
    return f"Instructions:\n\n{instructions}\nBytes:\n\n{memory}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help=f"put the tables into {PAGE.name}")
    write = parser.parse_args().write
    with tempfile.TemporaryDirectory() as folder:
        measured = {case: measure(*case, Path(folder)) for case in CASES}
    text = tables(measured)
    print(text)
    if write:
        page = PAGE.read_text("utf-8")
        changed = re.sub(
            r"(?<=<!-- measured -->\n).*(?=<!-- /measured -->)", lambda _: text, page, count=1, flags=re.DOTALL
        )
        PAGE.write_text(changed, "utf-8")


if __name__ == "__main__":
    main()
