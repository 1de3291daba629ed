"""What `tablegen verify` is compared with plays the example: its sum of all codes is that of the integer model."""

import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from building import EXAMPLE
from editing import run
from following import markers_of
from sections.verify import compiled_c, compiled_verilog

from tablegen.config.load import load
from tablegen.device.sequencer import Sequencer, Tick
from tablegen.planning.line_plan import Plan, make_plan

TICKS = 1024


@pytest.fixture(scope="module")
def plan() -> Plan:
    return make_plan(load(EXAMPLE))


@pytest.fixture(scope="module")
def build(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("build")
    assert run("build", EXAMPLE, "--quiet", "-o", folder).status == 0
    return folder


def played(plan: Plan, waiting: int = 0) -> Iterator[Tick]:
    """Ticks behind the one that takes the program; it starts after so many."""
    sequencer = Sequencer(None, codes=(0, 0))
    sequencer.commit(plan.program)
    assert sequencer.step().swapped
    for _ in range(waiting):
        yield sequencer.step()
    sequencer.arm()
    assert sequencer.trigger()
    while True:
        yield sequencer.step()


def shown(*command: str | Path) -> int:
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, check=True)
    return int(done.stdout.split()[0])


@pytest.mark.common
def test_in_c(plan: Plan, build: Path, tmp_path: Path) -> None:
    """Once by steps, and on from there by fills."""
    ticks = [tick for tick, _ in zip(played(plan), range(2 * TICKS), strict=False)]
    wanted = sum(tick.x + tick.y + markers_of(tick) for tick in ticks)
    assert shown(compiled_c(build, tmp_path), str(TICKS), "1") == wanted


@pytest.mark.common
def test_in_verilog(plan: Plan, build: Path, tmp_path: Path) -> None:
    """Some ticks pass until the sequencer is triggered."""
    found = shown(*compiled_verilog(build, tmp_path, TICKS))
    sums = [sum(t.x + t.y for t, _ in zip(played(plan, waiting), range(TICKS), strict=False)) for waiting in range(64)]
    assert sums.count(found) == 1
    assert sums.index(found) < 48, "the pipeline of a sample"
