"""Programs in C++ and Zig that include the emitted headers as they are, and play what the model plays."""

import sys
from pathlib import Path

import pytest
from building import NAME, Build, run_clean
from packed_library import MAIN, TICKS, plays_the_model, run_offline
from short_scans import short

WARNINGS = [
    "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wsign-conversion", "-Wshadow", "-Wcast-qual", "-Wundef",
    "-Wdouble-promotion", "-Werror",
]  # fmt: skip
# It has the names of C from a file that Zig has made of the header.
ZIG = f"""
const scan = @import("scan.zig");
extern fn printf(format: [*:0]const u8, ...) c_int;
var sequencer: scan.dac_sequencer = undefined;

pub export fn main() c_int {{
    var now: scan.dac_tick = undefined;
    if (!scan.dac_sequencer_init(&sequencer, &scan.{NAME}_x_converter, &scan.{NAME}_y_converter) or
        scan.dac_sequencer_load(&sequencer, &scan.{NAME}_program) != scan.DAC_LOADED or
        !scan.dac_sequencer_commit(&sequencer)) return 1;
    scan.dac_sequencer_step(&sequencer, &now);
    if (!scan.dac_sequencer_arm(&sequencer, 0) or !scan.dac_sequencer_trigger(&sequencer)) return 1;
    for (0..{TICKS}) |_| {{
        scan.dac_sequencer_step(&sequencer, &now);
        _ = printf("%ld %ld\\n", @as(c_long, now.x), @as(c_long, now.y));
    }}
    return 0;
}}
"""


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Build:
    return short(tmp_path_factory.mktemp("c"), {"emit.formats": ["c"]})


def linked(built: Build, folder: Path, main: Path) -> Path:
    """Compile the C of the build as C, and link it with the object of a main program."""
    sources = sorted(built.folder.glob("*.c"))
    command = ["gcc", "-std=c99", "-Wall", "-Wextra", "-Werror", main, *sources, "-o", folder / "play"]
    run_clean([*command, "-Wl,-z,noexecstack"])  # objects of Zig do not say that they need no such stack
    return folder / "play"


@pytest.mark.common
@pytest.mark.parametrize("compiler", ["g++", "clang++"])
def test_a_program_in_cplusplus_plays_the_model(compiler: str, built: Build, tmp_path: Path) -> None:
    """Included from C++17 the headers have C linkage, and nothing to warn of."""
    main = tmp_path / "main.cpp"
    main.write_text(MAIN, "ascii")
    run_clean([compiler, "-std=c++17", *WARNINGS, f"-I{built.folder}", "-c", main, "-o", tmp_path / "main.o"])
    assert plays_the_model(linked(built, tmp_path, tmp_path / "main.o"), built.plan.program)


@pytest.mark.long
def test_a_program_in_zig_plays_the_model(built: Build, tmp_path: Path) -> None:
    """Zig 0.17 has no ``@cImport`` any more: a command translates the header.

    Zig compiles this command when it is called first: in its debug mode, which takes 15 s in place of two minutes.
    """
    zig = [sys.executable, "-m", "ziglang"]
    header = built.folder / f"{NAME}_program.h"
    done = run_offline([*zig, "translate-c", "-lc", f"-I{built.folder}", header], tmp_path, ZIG_DEBUG_CMD="1")
    assert (done.returncode, done.stderr) == (0, "")
    (tmp_path / "scan.zig").write_text(done.stdout, "utf-8")
    (tmp_path / "main.zig").write_text(ZIG, "ascii")
    done = run_offline([*zig, "build-obj", "main.zig", "-lc", "-femit-bin=main.o"], tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert plays_the_model(linked(built, tmp_path, tmp_path / "main.o"), built.plan.program)
