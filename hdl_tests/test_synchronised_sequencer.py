"""Trigger and park from pins of other clocks: dac_synchronise in front of the sequencer, which plays as the model does.

The model gets the levels that the pins have at the edges of the clock, two clocks later.
"""

import random
from bisect import bisect_left
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest
from building import BENCHES, NAME, Build, run_clean
from short_scans import short
from test_lint import CROSSINGS

from tablegen.device.sequencer import Sequencer

BENCH = BENCHES / "crossing_bench.v"
CLOCK_PS, FIRST_EDGE_PS, CLOCKS_PER_TICK = 10_000, 5_000, 11
TICKS, CHANGES = 5_000, 40
LATENCY = 2  # clocks from a pin to what the sequencer sees


def changes(seed: int, period_ps: int, low: tuple[int, int], high: tuple[int, int]) -> list[int]:
    """Return the times of rises and falls, some periods of another clock apart, none of them at an edge of ours."""
    generator, time, times = random.Random(seed), 0, []
    for change in range(CHANGES):
        time += period_ps * generator.randint(*(high if change % 2 else low))
        times.append(time + (time % CLOCK_PS == FIRST_EDGE_PS))
    return times


# Rises about a quarter of a frame apart, of a clock of 75 MHz; park is short and seldom, of one of 332 MHz.
TRIGGER = changes(1, 13_337, (300, 3_000), (1, 2_000))
PARK = changes(2, 3_011, (20_000, 60_000), (4, 4_000))


def level(times: Sequence[int], edge: int) -> bool:
    return bisect_left(times, FIRST_EDGE_PS + CLOCK_PS * edge) % 2 == 1


def captured(built: Build, folder: Path, **parameters: int) -> list[str]:
    """Return the lines of the bench."""
    for name, times in (("trigger", TRIGGER), ("park", PARK)):
        (built.folder / f"{name}.hex").write_text("".join(f"{time:x}\n" for time in times), "ascii")
    given = {"TICKS": TICKS, "CHANGES": CHANGES, "CLOCKS_PER_TICK": CLOCKS_PER_TICK, **parameters}
    sources = [built.folder / f"{NAME}_top.v", *sorted(built.folder.glob("dac_*.v")), CROSSINGS / "dac_synchronise.v"]
    simulation = folder / "crossing.vvp"
    command = ["iverilog", "-g2005", f"-I{built.folder}", "-s", BENCH.stem, "-o", simulation, BENCH, *sources]
    run_clean([*command, *(f"-P{BENCH.stem}.{name}={value}" for name, value in given.items())])
    return run_clean(["vvp", "-n", simulation], built.folder).splitlines()


def modelled(built: Build, first: int) -> Iterator[str]:
    """Yield the lines of the model, from the tick of this number on, with which it takes the program."""
    program = built.plan.program
    model = Sequencer(None)
    model.commit(program)
    for number in range(first, first + TICKS):
        edge = CLOCKS_PER_TICK * number
        tick = model.step()
        flags = (tick.swapped, tick.playing, tick.line, tick.frame, tick.parked)
        words = (program.x.output.word(tick.x), program.y.output.word(tick.y))
        yield f"{number} {words[0]} {words[1]} {''.join(f'{flag:b}' for flag in flags)}"
        for clock in range(edge, edge + CLOCKS_PER_TICK):
            model.arm(1)
            if level(TRIGGER, clock - LATENCY) and not level(TRIGGER, clock - LATENCY - 1):
                model.trigger()
            if level(PARK, clock - LATENCY):
                model.park()


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Build:
    return short(tmp_path_factory.mktemp("scan"), {"timing.lines": 4})


@pytest.mark.rest
def test_a_scan_is_triggered_and_parked_from_other_clocks(built: Build, tmp_path: Path) -> None:
    lines = captured(built, tmp_path)
    assert lines == list(modelled(built, int(lines[0].split()[0])))
    playing = "".join(line.split()[-1][1] for line in lines)
    frame = built.plan.schedule.ticks * built.plan.schedule.lines
    scans = [len(scan) for scan in playing.split("0") if scan][:-1]
    assert frame in scans  # that ended by itself
    assert min(scans) < frame  # parked


@pytest.mark.rest
def test_a_trigger_without_the_detector_of_rises_is_seen(built: Build, tmp_path: Path) -> None:
    """The control: a level would trigger again with the end of each frame."""
    lines = captured(built, tmp_path, TRIGGER_PULSE=0)
    assert lines != list(modelled(built, int(lines[0].split()[0])))
