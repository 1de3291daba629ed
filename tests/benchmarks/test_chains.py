"""Chains in C that the sequencer is compared with do the same task: their codes are the model's, and are counted."""

import ctypes
import subprocess
from pathlib import Path

import numpy as np
import pytest
from building import EXAMPLE, tool
from result_rows import BENCHMARKS, tables
from sections import chains

from tablegen.planning.line_plan import Plan

WORST = {"plain": 0, "library": 1, "float": 1}  # LSB
WARNINGS = ("-Wall", "-Wextra", "-Wpedantic", "-Werror")


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> tuple[Plan, Path]:
    folder = tmp_path_factory.mktemp("chains")
    return chains.planned(EXAMPLE, folder), folder


def played(plan: Plan, folder: Path, *options: str) -> dict[str, int]:
    """The error of each chain over a line, compiled for this machine."""
    library = folder / "chains.so"
    sources = [*chains.SOURCES, folder / f"{plan.name}.c"]
    command = [tool("gcc"), "-std=gnu99", "-O2", *WARNINGS, *options, "-shared", "-fPIC", f"-I{folder}", *sources]
    subprocess.run([str(word) for word in (*command, "-o", library)], check=True)
    loaded = ctypes.CDLL(str(library))
    codes = np.ctypeslib.as_array((ctypes.c_uint16 * chains.TICKS).in_dll(loaded, "chain_codes"))
    errors = {}
    for chain in chains.CHAINS:
        loaded.chain_start()
        line = []
        for _ in range(plan.schedule.ticks // chains.TICKS):
            getattr(loaded, f"chain_{chain}")()
            line += codes.tolist()
        errors[chain] = chains.error(plan, chain, line)
    library.unlink()
    return errors


def test_all_chains_make_the_codes_of_the_model(built: tuple[Plan, Path]) -> None:
    assert played(*built) == WORST


def test_a_wrong_gain_is_seen(built: tuple[Plan, Path], tmp_path: Path) -> None:
    """The control: a gain that is 0.1 % off moves the ends by some LSB."""
    plan, folder = built
    for name in (f"{plan.name}.c", f"{plan.name}.h"):
        text = (folder / name).read_text("ascii")
        (tmp_path / name).write_text(text.replace("X_GAIN_WORD 13349", "X_GAIN_WORD 13362"), "ascii")
    assert min(played(plan, tmp_path).values()) >= 5


@pytest.mark.rest
@pytest.mark.parametrize("core", ["cortex-m4", "riscv32"])
def test_the_page_has_what_a_core_counts(core: str, built: tuple[Plan, Path]) -> None:
    from sections.instructions import CORES, NAMES

    counted = chains.counted(*built[:1], core, built[1])
    assert {name: chain.error for name, chain in counted.items()} == WORST
    shown = {row["chain"]: row for row in tables("instructions") if row["processor"] == CORES[core]}
    for name, chain in counted.items():
        assert shown[NAMES[name]]["instructions"] == f"{chain.instructions:.1f}"


@pytest.mark.rest
def test_the_page_has_what_an_avr_counts(tmp_path: Path) -> None:
    from editing import SCAN, edited, write_pair
    from sections.instructions import NAMES, SMALL

    plan = chains.planned(write_pair(tmp_path, edited(SCAN, *SMALL)), tmp_path)
    counted = chains.counted_on_avr(plan, tmp_path)
    assert {name: chain.error for name, chain in counted.items() if name in WORST} == WORST
    shown = {row["chain"]: row for row in tables("instructions") if row["processor"] == "ATmega2560"}
    for name, chain in counted.items():
        row = shown[NAMES[name]]
        assert (row["instructions"], row["cycles"]) == (f"{chain.instructions:.1f}", f"{chain.cycles:.0f}")


def test_lines_of_the_simulator_are_read(built: tuple[Plan, Path]) -> None:
    """Five blocks of each chain; one that lost a block is refused."""
    plan, _ = built
    codes = plan.x.program.codes(np.arange(plan.schedule.ticks)).astype("<u2").tobytes()
    size = 2 * chains.TICKS
    library = (np.frombuffer(codes, "<u2") ^ chains.SIGN).astype("<u2").tobytes()
    lines = [""]
    for name in (1, 2, 3, 4):
        told = library if name == 3 else codes
        lines += [f"{name} 1000 2500 {told[at : at + size].hex()}" for at in range(0, len(told), size)]
    found = chains.avr_chains(plan, lines)
    assert found["plain"] == chains.Chain(1000 / chains.TICKS, 0, 2500 / chains.TICKS)
    assert found[chains.OURS] == chains.Chain(1000 / chains.TICKS / 2, None, 2500 / chains.TICKS / 2)
    with pytest.raises(RuntimeError, match="1000 codes of plain"):
        chains.avr_chains(plan, lines[2:])


def test_the_sources_are_those_of_the_benchmarks() -> None:
    assert all(source.parent == BENCHMARKS and source.is_file() for source in chains.SOURCES)
