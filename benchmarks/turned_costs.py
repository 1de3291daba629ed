"""Emitted scans, counted whole in emulation beside what `[cost]` says of them, for docs/tables.md.

``python benchmarks/turned_costs.py`` prints a row for each scan at an angle, and for some at 0 degrees: instructions
for a sample of an axis, the mean of a frame and of both axes, by processor, and those that the build is told.
``--write`` puts them into the page.
"""

import argparse
import os
import re
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

sys.path.insert(0, str(Path(__file__).parent.parent / "tests" / "helpers"))

import firmware
from editing import SCAN, edited, write_pair
from mode_costs import sequencer
from turned_scans import turned_setup

from tablegen.api.build import Build, build
from tablegen.api.turned import TurnedBuild, build_turned
from tablegen.planning.frame_costs import frame_costs
from tablegen.planning.played_table import PROCESSORS
from tablegen.planning.turned_plan import played_frame
from tablegen.verification.c.emulate import Processor, compile_bare

HERE = Path(__file__).parent
PAGE = HERE.parent / "docs" / "tables.md"
COUNTED = HERE / "turned_count.c"
SKIPPED_LINES = 2  # until the output has reached the scan
FRAME = ("timing.lines = 16", "x.band_limit.harmonics = 12", "timing.line_rate_hz = 400")
NARROW = (
    *(f"{axis}.table.{key}" for axis in "xy" for key in ("mode = 'auto'", "bits = 11")),
    *(f"- {axis}.table.length" for axis in "xy"),
)
SHORT = ("timing.line_rate_hz = 1600", "timing.pixels = 100")
SCANS: dict[str, tuple[str, ...]] = {
    "300 nm, 64 words of 16 bits, lines of 1,250 ticks": (),
    "lines of 313 ticks, of 60 nm": (*SHORT, "x.size_nm = 60", "y.size_nm = 60"),
    "lines of 313 ticks, of 300 nm": SHORT,
    "128 words over the line": ("x.band_limit.harmonics = 24",),
    "words of 11 bits": NARROW,
    "a converter in two's complement": ("dac.coding = 'twos-complement'",),
    "a converter of 18 bits": ("dac.bits = 18",),
    "shaped `second`": ("dac.shaping = 'second'",),
    "no `max_slew_v_per_s`": ("- amplifier.max_slew_v_per_s",),
}


STRAIGHT_FRAME = ("timing.lines = 16",)
STRAIGHT: dict[str, tuple[str, ...]] = {
    "the example": (),
    "words of 10 bits for x": ("x.table.bits = 10", "- [limits]"),
    "lines of 313 ticks": ("timing.line_rate_hz = 1600", "timing.pixels = 50"),
    "no `max_slew_v_per_s`": ("- amplifier.max_slew_v_per_s",),
}


def straight(edits: Sequence[str], core: str) -> Build:
    """Return a build of the example at 0 degrees, which is told what it takes on a processor."""
    text = edited(SCAN, *STRAIGHT_FRAME, *edits, f'+ [cost]\nprocessor = "{core}"')
    with tempfile.TemporaryDirectory() as folder:
        return build(write_pair(Path(folder), text))


def built(edits: Sequence[str]) -> TurnedBuild:
    """Return a build of the example at 30 degrees."""
    with tempfile.TemporaryDirectory() as folder:
        return build_turned(turned_setup(Path(folder), 30.0, *FRAME, *edits))


def counted(build: Build | TurnedBuild, core: str) -> float:
    """Count a sample of an axis of the emitted C, the mean of both axes over a frame."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for file, content in build.files.items():
            (folder / file).write_bytes(content)
        own = [folder / f"{build.name}{end}" for end in (".c", ".h", "_program.c", "_program.h")]
        macro_values = options_of(own[1].read_text("ascii"))
        sources = [*sequencer(), COUNTED, *own, firmware.MEMORY]
        program = compile_bare(folder / "count.elf", sources, core, None, ("-std=c99", "-O2"), macro_values)
    machine = Processor(program, core)
    machine.call("count_start")
    if machine.word("refused"):
        raise RuntimeError(f"the runtime refuses the program: {machine.word('refused')}")
    schedule = build.plan.schedule
    for _ in range(SKIPPED_LINES * schedule.ticks // firmware.TICKS):
        machine.call("count_fill")
    fills = round(schedule.frame_ticks / firmware.TICKS)
    return sum(machine.call("count_fill").instructions for _ in range(fills)) / fills / firmware.TICKS / 2.0


def options_of(header: str) -> dict[str, int]:
    """Return the options of the runtime that a header of a scan names."""
    part = "".join(header.split("The options DAC_", 1)[1:]).split("\n\n", 1)[0]
    return {f"DAC_{key}": int(value) for key, value in re.findall(r"#define ANNEXIN_200NM_(\w+) (\d+)", part)}


def told_straight(build: Build) -> float:
    """Return what a build at 0 degrees is told of a sample, the mean of both axes."""
    costs = [line.sample_cost for line in build.plan.lines]
    return sum(cost.instructions for cost in costs if cost is not None) / len(costs)


def told(build: TurnedBuild, core: str) -> float:
    """Return what the build is told of a sample, the mean of both axes."""
    axes = [played_frame(build.setup, build.plan.straight, axis) for axis in build.plan.axes]
    return sum(frame_costs(axes, next(name for name in PROCESSORS if name == core))) / len(axes)


def turned_table() -> str:
    """Return the table of the page, of scans at an angle."""

    def cells(edits: Sequence[str]) -> list[tuple[float, float]]:
        build = built(edits)
        return [(counted(build, core), told(build, core)) for core in PROCESSORS]

    return _table("scan at 30 degrees", SCANS, cells)


def straight_table() -> str:
    """Return the table of the page, of scans at 0 degrees."""

    def cells(edits: Sequence[str]) -> list[tuple[float, float]]:
        builds = {core: straight(edits, core) for core in PROCESSORS}
        return [(counted(build, core), told_straight(build)) for core, build in builds.items()]

    return _table("scan at 0 degrees", STRAIGHT, cells)


def _table(
    title: str, scans: Mapping[str, Sequence[str]], cells: Callable[[Sequence[str]], list[tuple[float, float]]]
) -> str:
    head = " | ".join(f"{core}: counted, told" for core in PROCESSORS)
    lines = [f"| {title} | {head} |", f"|---|{'---|' * len(PROCESSORS)}"]
    for name, edits in scans.items():
        row = " | ".join(f"{count:.1f}, {said:.1f}" for count, said in cells(edits))
        lines.append(f"| {name} | {row} |")
        print(lines[-1], flush=True)
    return "\n".join([*lines, ""])


def main() -> None:
    """Print, or write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help=f"put the table into {PAGE.name}")
    write, found = parser.parse_args().write, {"straight": straight_table(), "whole": turned_table()}
    if write:
        page = PAGE.read_text("utf-8")
        for mark, text in found.items():
            marked = re.compile(rf"(?<=<!-- {mark} -->\n).*?(?=<!-- /{mark} -->)", re.DOTALL)
            page = marked.sub(lambda _, text=text: text, page, count=1)
        PAGE.write_text(page, "utf-8")


if __name__ == "__main__":
    main()
