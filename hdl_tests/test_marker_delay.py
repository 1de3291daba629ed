"""``dac_marker_delay`` on every clock equal to its integer model, at delays that change, with mutants."""

import random
from pathlib import Path

import pytest
from building import BENCHES
from sets import one_of
from test_lint import ADC

from tablegen.device.marker_delay import MarkerDelay
from tablegen.verification.verilog.simulate import Design, compile_design

MODULE = ADC / "dac_marker_delay.v"
CLOCKS = 4_000
SHAPES = [(1, 2), (5, 3), (8, 6), (3, 10)]  # signals and bits of their delays
Stimulus = list[tuple[list[int], list[int]]]  # levels and delays of each clock


def stimulus(signals: int, bits: int, seed: int = 1) -> Stimulus:
    """Pulses, on many clocks in a row too, and levels; every delay of few bits, and the two ends of those of many."""
    generator, clocks = random.Random(seed), []
    delays, often = [2] * signals, [0.5] * signals
    for clock in range(CLOCKS):
        if clock % 100 == 50:
            signal = generator.randrange(signals)
            delays = list(delays)
            delays[signal] = generator.choice((0, 1, 2, 3, generator.randrange(2**bits), 2**bits - 1))
            often[signal] = generator.choice((0.01, 0.1, 0.5, 0.9))
        clocks.append(([int(generator.random() < one) for one in often], delays))
    return clocks


def captured(folder: Path, simulator: str, bits: int, clocks: Stimulus, module: Path = MODULE) -> list[list[int]]:
    signals = len(clocks[0][0])
    parameters = {"CLOCKS": len(clocks), "SIGNALS": signals, "DELAY_BITS": bits}
    design = Design([BENCHES / "marker_delay_bench.v", module], "marker_delay_bench", parameters)
    compiled = compile_design(simulator, design, folder)
    lines = []
    for levels, delays in clocks:
        value = sum(level << signal for signal, level in enumerate(levels))
        value |= sum(delay << signals + bits * signal for signal, delay in enumerate(delays))
        lines.append(f"{value:x}\n")
    (folder / "stimulus.hex").write_text("".join(lines), "ascii")
    assert compiled.run("cocotb_outputs") == (1, 0)
    return [[int(bit) for bit in line[::-1]] for line in (folder / "capture.txt").read_text("ascii").split()]


def wanted(clocks: Stimulus) -> list[list[int]]:
    model = MarkerDelay(len(clocks[0][0]))
    return [model.step(levels, delays) for levels, delays in clocks]


@pytest.mark.common
@pytest.mark.parametrize(("signals", "bits"), one_of(2, SHAPES, 2))
def test_every_clock_is_that_of_the_model(signals: int, bits: int, tmp_path: Path) -> None:
    clocks = stimulus(signals, bits)
    assert captured(tmp_path, "icarus", bits, clocks) == wanted(clocks)


@pytest.mark.long
@pytest.mark.timeout(86_400)
def test_verilator_has_the_same_clocks(tmp_path: Path) -> None:
    clocks = stimulus(8, 6, seed=2)
    assert captured(tmp_path, "verilator", 6, clocks) == wanted(clocks)


@pytest.mark.common
def test_pulses_that_are_closer_than_the_delay_all_arrive(tmp_path: Path) -> None:
    """Three clocks apart, 1000 clocks later: without the model."""
    clocks: Stimulus = [([int(clock % 3 == 0 and clock < 1500)], [1000]) for clock in range(CLOCKS)]
    seen = [clock for clock, (level,) in enumerate(captured(tmp_path, "icarus", 10, clocks)) if level]
    assert seen == [1000 + 3 * pulse for pulse in range(500)]


MUTANTS = {
    "a clock late": ("now + 1'b1 - delay", "now - delay"),
    "a clock early": ("now + 1'b1 - delay", "now + 2'd2 - delay"),
    "one delay for all": ("delays[i*DELAY_BITS +: DELAY_BITS]", "delays[DELAY_BITS-1:0]"),
    "first signal for all": ("past[now] <= in[i]", "past[now] <= in[0]"),
    "no bypass of 1": ("is_1 <= delay == 1", "is_1 <= 1'b0"),
    "no bypass of 0": ("is_0 <= delay == 0", "is_0 <= 1'b0"),
    "a bypass of the next delay": ("is_0 ? in[i]", "delay == 0 ? in[i]"),
    "levels go on after power-up": ("past[k] = 1'b0", "past[k] = 1'b1"),
    "half the memory": ("past[now] <= in[i]", "past[now & ~(1 << DELAY_BITS - 1)] <= in[i]"),
}


@pytest.mark.rest
@pytest.mark.parametrize("name", one_of(2, MUTANTS))
def test_a_mutant_is_found(name: str, tmp_path: Path) -> None:
    old, new = MUTANTS[name]
    text = MODULE.read_text("utf-8")
    assert text.count(old) == 1
    changed = tmp_path / MODULE.name
    changed.write_text(text.replace(old, new), "utf-8")
    clocks = stimulus(5, 3)
    clocks[:50] = [(levels, [7] * 5) for levels, _ in clocks[:50]]
    assert captured(tmp_path / "bench", "icarus", 3, clocks, changed) != wanted(clocks)
