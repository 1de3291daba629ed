"""The Verilog sequencer against the integer model on every tick: random programs, and whatever a host may ask.

A script is played by a bench in Verilog and by the model; codes, markers and faults of every tick have to be equal.
Icarus plays every case, Verilator the long ones. Programs of plans are in ``test_stream_plans.py``, swaps in
``test_stream_swaps.py``.
"""

from pathlib import Path

import numpy as np
import pytest
from programs import extreme, random_dual, shaped
from replacing import replace
from sets import LONG_TEST, common, common_and_rest, long
from stream_benches import HARMONICS, equal, with_sine
from stream_configurations import (
    CONFIGURATIONS,
    FEW,
    LEAST_PACE,
    LEAST_PACES,
    LOW_AREA,
    SCANNER,
    SCANNER_PACE,
    SMALL,
    SPLINE_LOW_AREA_PACES,
    SPLINE_PACE,
)
from stream_plans import PLANS, planned
from stream_scripts import (
    FAULTS,
    flag,
    in_any_order,
    occurrences,
    play,
    random_play,
    random_renderings,
    swaps_at_every_tick,
    sweep,
)

from tablegen.verification.play.sequencer_shape import SequencerShape
from tablegen.verification.play.stream import FLAGS, Script
from tablegen.verification.verilog.sequencer_bench import SequencerBench

SAMPLES_ON_ICARUS = 100_000
# Each kind of sequencer and of table; the others are of `make test-long`.
OF_THE_REST = (
    "bits_12",
    "dac_8_words_24_plain",
    "small_counters",
    "shortest_lines",
    "low_area_dac_24",
    "first",
    "second_low_area_dac_8",
    "scanner_dac_23_words_24_plain",
    "cubic_x",
    "cubic_low_area",
    "power_up_codes",
)


# Random programs, back to back.


def test_enough_is_played_on_icarus() -> None:
    assert sum(configuration.samples for configuration in CONFIGURATIONS.values()) >= SAMPLES_ON_ICARUS


@pytest.mark.common
@pytest.mark.parametrize("name", common_and_rest(FEW[:2], OF_THE_REST, CONFIGURATIONS))
def test_random_programs(name: str, tmp_path: Path) -> None:
    configuration = CONFIGURATIONS[name]
    script = configuration.script(name)
    bench = SequencerBench("icarus", configuration.shape, tmp_path, dict(configuration.parameters))
    played = equal(bench, script)
    assert played.samples >= configuration.samples
    assert script.swaps > configuration.samples // 400
    seen = occurrences(played.capture)
    if configuration.samples > 5000:
        assert all(seen[name] for name in (*FLAGS, *FAULTS[:2])), seen


@pytest.mark.common
@pytest.mark.parametrize(
    "variant", common(["digits", "FOURIER"], ["PLAIN_MULTIPLIER", "LOW_AREA", "FOURIER", "digits"])
)
def test_everything_that_a_host_may_ask(variant: str, tmp_path: Path) -> None:
    shape = SequencerShape(16, 1, 4, 16, 1, 3, 16)
    parameters: dict[str, int | str] = {"COUNT_BITS": 4}
    if variant != "digits":
        parameters[variant] = 1
    if variant == "FOURIER":
        parameters |= with_sine(tmp_path, shape)
    simulator, pace = ("verilator", LEAST_PACE) if variant == "LOW_AREA" else ("icarus", 1)
    bench = SequencerBench(simulator, shape, tmp_path, parameters)
    rng = np.random.default_rng(len(variant))
    # A rendering that has nothing to render takes three clocks.
    script = sweep(rng, shape, 1000, pace, commit_clocks=4 if variant == "FOURIER" else 1)
    while script.counts[0] <= 15:
        script.request("withdraw", "park")
        play(script, random_dual(rng, shape, kind="held"))
        script.wait_ticks(200)
    played = equal(bench, script)
    assert played.fault_counts[0] == 15 < script.counts[0]  # a counter stays at its highest count


@pytest.mark.rest
@pytest.mark.parametrize(("order", "pace"), [(1, 1), (2, 1), (3, SCANNER_PACE)])
def test_remainders_begin_anew_with_every_program(order: int, pace: int, tmp_path: Path) -> None:
    """Programs of different orders take turns, each begun in every tick of the other's line."""
    rng, script = np.random.default_rng(order), Script()
    programs = [random_dual(rng, SMALL, (8, 12), kind="tame", lines=(1, 2)) for _ in range(2)]
    first, second = programs[0], shaped(rng, programs[1], order)
    while second.x.output.shaping.order != order:
        second = shaped(rng, programs[1], order)
    script.tick_every(pace)
    swaps_at_every_tick(script, (first, second))
    swaps_at_every_tick(script, (second, shaped(rng, first, order)))
    equal(SequencerBench("icarus", SMALL, tmp_path, {"SHAPING": order}), script)
    assert script.swaps > 16


@pytest.mark.rest
@pytest.mark.parametrize(
    "name", long(("cubic_x", "cubic_y_lines_plain"), ("cubic_x", "cubic_y_lines_plain", "cubic_low_area"))
)
def test_splines_of_extreme_words(name: str, tmp_path: Path) -> None:
    """Only the least word and the greatest one, so that the sums are as large as they can be."""
    configuration = CONFIGURATIONS[name]
    rng, script = np.random.default_rng(7), Script(drain=configuration.placement.drain_clocks)
    for _ in range(6):
        program = random_dual(rng, configuration.shape, (16, 24), kind="tame", lines=(3, 5))
        program = replace(program, x=extreme(rng, program.x), y=extreme(rng, program.y))
        script.load(program)
        script.pace(configuration.placement.tick_clocks, configuration.placement.tick_clocks)
        script.request("commit", "arm", program=program)
        script.wait_ticks(3)
        script.request("trigger")
        script.wait_ticks(80)
        script.request("park")
        script.wait_ticks(3)
    equal(SequencerBench("icarus", configuration.shape, tmp_path, dict(configuration.parameters)), script)
    assert script.swaps == 6


# Long runs on Verilator.


@pytest.mark.rest
def test_random_programs_on_verilator(tmp_path: Path) -> None:
    shape = SequencerShape(20, 1, 4, 24, 0, 5, 18)
    script = Script((1 << 19, 3))
    random_play(np.random.default_rng(5), script, shape, 150_000, (1, 2, 5))
    bench = SequencerBench(
        "verilator", shape, tmp_path, {"PLAIN_MULTIPLIER": 1, "X_POWER_UP_CODE": 1 << 19, "Y_POWER_UP_CODE": 3}
    )
    assert equal(bench, script).samples >= 150_000


@pytest.mark.long
@pytest.mark.timeout(86_400)
def test_low_area_on_verilator(tmp_path: Path) -> None:
    shape = SequencerShape(20, 1, 4, 24, 0, 5, 16)
    script = Script()
    random_play(np.random.default_rng(11), script, shape, 20_000, LEAST_PACES)
    assert equal(SequencerBench("verilator", shape, tmp_path, LOW_AREA), script).samples >= 20_000


# Programs that are rendered from Fourier words.


@pytest.mark.rest
@pytest.mark.parametrize("plain", long([1], [0, 1]))
def test_tables_are_rendered_while_a_program_plays(plain: int, tmp_path: Path) -> None:
    shape = SequencerShape(16, 1, 4, 16, 1, 3, 14)
    script = Script()
    random_renderings(np.random.default_rng(3), script, shape, 24 if plain else 10, HARMONICS, plain)
    parameters = {**with_sine(tmp_path, shape), "PLAIN_MULTIPLIER": plain}
    equal(SequencerBench("icarus", shape, tmp_path, parameters), script)
    assert script.swaps >= 8


# Writes and faults.


@pytest.mark.common
def test_words_can_be_written_in_any_order(tmp_path: Path) -> None:
    shape = SequencerShape(16, 1, 3, 16, 0, 3, 16)
    rng = np.random.default_rng(3)
    script = Script()
    script.tick_every(1)
    for _ in range(8):
        program, other = (random_dual(rng, shape, kind="tame") for _ in range(2))
        in_any_order(rng, script, program, other)
        script.wait_ticks(2)  # behind a word of the scan page a commit is two clocks later
        script.request("commit", "arm", program=program)
        script.wait_ticks(3)
        script.request("trigger")
        script.wait_ticks(100)
    equal(SequencerBench("icarus", shape, tmp_path), script)


@pytest.mark.common
def test_an_underrun_is_a_fault(tmp_path: Path) -> None:
    """The model has no clock and cannot have one: it adds a sticky fault to a scan, and `valid` is low from then on."""
    plan = planned(tmp_path, PLANS["settle_0"])
    program = plan.program
    script = Script()
    script.load(program)
    script.tick_every(1)
    script.request("commit", program=program)
    script.wait_ticks(50)
    script.request("arm", "trigger")
    script.wait_ticks(3 * plan.schedule.ticks)
    first = len(script.commands)
    for _ in range(3):
        script.request()
        script.wait_ticks(7)
    for at in range(first, first + 6, 2):
        assert script.commands[at] >> 60 == 3
        script.commands[at] |= 1 << 7 + 16
    script.wait_ticks(2 * plan.schedule.ticks)
    bench = SequencerBench(
        "icarus", SequencerShape.of((program.x, program.y)), tmp_path / "bench", {"PLAIN_MULTIPLIER": 1}
    )
    played = bench.play(script)
    assert played.fault_counts == (0, 0, 0, 3)
    expected = np.array(script.expected, dtype=np.uint64)
    fault = flag(played.capture, "underrun")
    at = int(np.argmax(fault))
    assert abs(at - 3 * plan.schedule.ticks - 50) < 64
    assert np.all(fault[at:])
    markers = ~np.uint64(1 << 48 + FLAGS.index("valid") | 1 << 56 + FAULTS.index("underrun"))
    assert np.array_equal(played.capture & markers, expected & markers)
    assert np.array_equal(flag(played.capture, "valid"), flag(expected, "valid") & ~fault)
    assert np.any(flag(expected, "valid")[at:])


@pytest.mark.rest
@pytest.mark.parametrize(
    ("least", "parameters", "name"),
    [
        (LEAST_PACE, LOW_AREA, "settle_0"),
        (SCANNER_PACE, SCANNER, "settle_0"),
        (SPLINE_PACE, {}, "cubic"),
        pytest.param(SPLINE_LOW_AREA_PACES[0], LOW_AREA, "cubic", marks=LONG_TEST),
    ],
    ids=["low_area", "scanner", "cubic", "cubic_low_area"],
)
def test_a_tick_that_comes_too_early_is_a_fault(
    least: int, parameters: dict[str, int], name: str, tmp_path: Path
) -> None:
    """With a tick a clock earlier than the least pace every second one is refused, and the others go on as if alone."""
    plan = planned(tmp_path, PLANS[name])
    program = plan.program
    script = Script()
    script.tick_every(0)
    script.load(program)
    script.request("commit", program=program)
    script.wait(5)
    script.tick_every(2 * (least - 1))
    script.wait(1)  # the program is taken
    script.request("arm", "trigger")
    script.wait_ticks(2 * plan.schedule.ticks)
    tick_every = script.commands.index(4 << 60 | 2 * (least - 1))
    script.commands[tick_every] -= least - 1
    bench = SequencerBench("icarus", SequencerShape.of((program.x, program.y)), tmp_path / "bench", parameters)
    played = bench.play(script)
    expected = np.array(script.expected, dtype=np.uint64)
    assert played.fault_counts == (0, 0, len(expected) - 1, 0)
    markers = ~np.uint64(1 << 48 + FLAGS.index("valid") | 1 << 56 + FAULTS.index("overrun"))
    assert np.array_equal(played.capture & markers, expected & markers)
    assert np.all(flag(played.capture, "overrun"))
    assert not np.any(flag(played.capture, "valid"))
    assert np.any(flag(expected, "valid"))
