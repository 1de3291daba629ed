"""The Verilog sequencer against the integer model on every tick, and against the float waveform.

A script is played by a bench in Verilog and by the model; codes, markers and faults of every tick have to be equal.
Where a program comes from a plan, each code is held against its float waveform as well, within the certificate; and
what a swap must never do is read off the capture by itself. Icarus plays every case, Verilator the long ones.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from building import BENCHES, Variant, write_variant
from programs import random_dual
from sets import LONG_TEST, common, quick
from spi_monitor import Converter, Wires, receive, updates
from stream_configurations import (
    CONFIGURATIONS,
    FEW,
    LEAST_PACE,
    LEAST_PACES,
    LOW_AREA,
    SMALL,
    SWAPS,
    SWAPS_SLOW,
    random_swaps,
)
from stream_laws import Broken, follow_their_programs, steps_are_limited
from stream_scripts import (
    FAULTS,
    codes,
    flag,
    in_any_order,
    occurrences,
    play,
    random_play,
    random_renderings,
    rendering_clocks,
    swaps_at_every_tick,
    sweep,
)

from tablegen.certificate.certificate import certify
from tablegen.config.load import load
from tablegen.emit.memory import memory_file
from tablegen.fixedpoint.synthesis import sine_quarter
from tablegen.numerics.arrays import Floats, Ints
from tablegen.planning.line_plan import LinePlan, Plan, make_plan
from tablegen.resources import verilog_runtime
from tablegen.verification.bench import BenchRun, SequencerBench, SequencerShape
from tablegen.verification.stream import FLAGS, Script, Words

SAMPLES_ON_ICARUS = 100_000
SAMPLES_ON_VERILATOR = 1_000_000


def equal(bench: SequencerBench, script: Script) -> BenchRun:
    """Play a script; all has to be as the model has it, and every step inside the limit of the program that plays."""
    played = bench.play(script)
    assert played.equal, played
    steps_are_limited(played.capture, script.taken)
    return played


# Programs from plans, whole frames.

TIMING = {"pixels": 40, "lines": 8, "line_rate_hz": 100.0, "ticks_per_line": 331, "settle_lines": 1}
SHORT: dict[str, object] = {
    "timing": TIMING,
    "dac.update_rate_hz": 50e3,
    "x.band_limit.harmonics": 16,
    "y.band_limit.harmonics": 8,
    "x.table.length": 256,
    "y.table.length": 128,
}


def _short(**changes: object) -> Variant:
    return Variant({**SHORT, **{key.replace("__", "."): value for key, value in changes.items()}})


def _bits(dac: int, x: int, y: int) -> Variant:
    return _short(dac__bits=dac, x__table__bits=x, y__table__bits=y)


def _turned(turn: float) -> Variant:
    forward = {"beta_max": 0.037, "rho": 4.0, "u_peak": 0.37}
    backward = {"beta_max": 0.03, "rho": 1.5, "u_peak": 0.48}
    branches = [{"turn": turn, "forward": forward, "backward": backward}]
    variant = _short(x__turn=turn, x__band_limit__directions="forward")
    return Variant(variant.scan, {"x.hysteresis.branches": branches})


def _settling(lines: int) -> Variant:
    return _short(timing={**TIMING, "settle_lines": lines})


PLANS: dict[str, Variant] = {
    "bits_8": _bits(8, 8, 8),
    "bits_12": _bits(12, 12, 12),
    "bits_16": _bits(16, 16, 16),
    "bits_18": _bits(18, 18, 18),
    "bits_20": _bits(20, 20, 20),
    "bits_24": _bits(24, 24, 24),
    "narrow_tables_wide_dac": _bits(24, 8, 12),
    "wide_tables_narrow_dac": _bits(8, 24, 20),
    "turn_0.7": _turned(0.7),
    "turn_0.95": _turned(0.95),
    "direct": _short(x__table={"mode": "direct", "bits": 16}, y__table={"mode": "direct", "bits": 12}),
    "direct_steps": _short(
        x__table={"mode": "direct", "bits": 24},
        y__table={"mode": "direct", "bits": 8},
        y__motion="step",
        y__band_limit__harmonics=3,
    ),
    "steps": _short(y__motion="step", y__band_limit__harmonics=3),
    "twos_complement": _short(dac__coding="twos-complement"),
    "inverting": _short(amplifier__gain=-10.0),
    "settle_0": _settling(0),
    "settle_5": _settling(5),
    "guarded": _short(amplifier__max_slew_v_per_s=40e3),
}
PLAIN = {"bits_12", "bits_18", "bits_24", "wide_tables_narrow_dac", "steps", "direct"}  # multiplier blocks


def planned(folder: Path, variant: Variant) -> Plan:
    return make_plan(load(write_variant(folder, variant)))


def asked(line: LinePlan, k: Ints) -> Floats:
    """The codes, unrounded, that the float waveform of an axis asks for at ticks k of its period."""
    program = line.program
    return line.float_codes(line.series.value(k % program.ticks // program.hold / program.phase.ticks))


def within_certificate(capture: Words, plan: Plan) -> None:
    """Every code of a scan, once it has caught up, is as near to the float waveform as the certificate says."""
    playing = capture[flag(capture, "playing")]
    k = np.arange(len(playing))
    certificates = certify(plan)
    caught_up = len(playing)
    for line in plan.lines:
        errors = np.abs(codes(playing, line.axis) - asked(line, k))
        close = errors <= certificates[line.axis].max_error_lsb + 1e-6
        first = int(np.argmax(close))
        assert np.all(close[first:])
        caught_up = min(caught_up, len(playing) - first)
    assert caught_up > 0.9 * len(playing) > 1000
    assert not np.any(playing >> np.uint64(56))  # no fault


def markers_of_a_scan(capture: Words, plan: Plan, frames: int) -> None:
    """Lines, frames, pixels and the valid windows of whole frames, counted off the capture."""
    schedule, seen = plan.schedule, occurrences(capture)
    assert seen["playing"] == frames * schedule.frame_ticks
    assert seen["line"] == frames * schedule.lines
    assert seen["frame"] == frames
    ways = 1 + bool(schedule.backward.count)
    assert seen["pixel"] == frames * schedule.lines * ways * schedule.pixels
    settled = [
        line
        for line in range(frames * schedule.lines)
        if line >= schedule.settle_lines
        and (line % schedule.lines in schedule.up or line % schedule.lines in schedule.down)
    ]
    playing = capture[flag(capture, "playing")]
    valid = flag(playing, "valid")
    assert sorted(set(np.flatnonzero(valid) // schedule.ticks)) == settled
    assert seen["valid"] == len(settled) * (schedule.forward.count + schedule.backward.count)
    assert seen["backward"] == frames * schedule.lines * (schedule.ticks - schedule.turn_tick)


@pytest.mark.common
@pytest.mark.parametrize("name", common(("bits_16", "turn_0.7", "direct_steps", "settle_5", "guarded"), PLANS))
def test_whole_frames_of_a_plan(name: str, tmp_path: Path) -> None:
    plan = planned(tmp_path, PLANS[name])
    program = plan.program
    bench = SequencerBench(
        "icarus",
        SequencerShape.of((program.x, program.y)),
        tmp_path / "bench",
        {"PLAIN_MULTIPLIER": int(name in PLAIN)},
    )
    park = plan.x.program.output.park_code, plan.y.program.output.park_code
    script = Script()
    script.load(program)
    script.tick_every(1)
    script.request("commit", program=program)
    script.wait_ticks(100)
    script.request("arm", "trigger", frames=2)
    script.wait_ticks(2 * plan.schedule.frame_ticks + 100)
    played = equal(bench, script)
    within_certificate(played.capture, plan)
    markers_of_a_scan(played.capture, plan, 2)
    assert flag(played.capture, "parked")[-1]
    assert tuple(codes(played.capture, axis)[-1] for axis in "xy") == park


@pytest.mark.rest
@pytest.mark.parametrize(("simulator", "lines"), [("icarus", 3), ("verilator", 200)])
def test_the_shipped_example(simulator: str, lines: int, tmp_path: Path) -> None:
    plan = planned(tmp_path, Variant())
    assert plan.schedule.lines == 200
    program = plan.program
    bench = SequencerBench(simulator, SequencerShape.of((program.x, program.y)), tmp_path / "bench")
    script = Script()
    script.load(program)
    script.tick_every(1)
    script.request("commit", program=program)
    script.wait_ticks(100)
    script.request("arm", "trigger", frames=1)
    script.wait_ticks(lines * plan.schedule.ticks + 20)
    played = equal(bench, script)
    within_certificate(played.capture, plan)
    if lines == plan.schedule.lines:
        markers_of_a_scan(played.capture, plan, 1)


@pytest.mark.common
def test_the_longest_table(tmp_path: Path) -> None:
    plan = planned(tmp_path, _short(x__table__length=65536, timing={**TIMING, "ticks_per_line": 1249}))
    program = plan.program
    bench = SequencerBench(
        "icarus", SequencerShape.of((program.x, program.y)), tmp_path / "bench", {"PLAIN_MULTIPLIER": 1}
    )
    script = Script()
    script.load(program)
    script.tick_every(1)
    script.request("commit", "arm", program=program)
    script.wait_ticks(2)
    script.request("trigger")
    script.wait_ticks(2 * plan.schedule.ticks)
    within_certificate(equal(bench, script).capture, plan)


# Random programs, back to back.


def test_enough_is_played_on_icarus() -> None:
    assert sum(configuration.samples for configuration in CONFIGURATIONS.values()) >= SAMPLES_ON_ICARUS


@pytest.mark.common
@pytest.mark.parametrize(
    "name",
    common(FEW, CONFIGURATIONS),
)
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


# Swaps.


@pytest.fixture(scope="module")
def small_on_verilator(tmp_path_factory: pytest.TempPathFactory) -> SequencerBench:
    return SequencerBench("verilator", SMALL, tmp_path_factory.mktemp("small"))


@pytest.mark.parametrize("pace", quick([1], [1, 3]))
def test_a_swap_is_requested_at_every_tick_and_taken_at_line_starts(pace: int, tmp_path: Path) -> None:
    shape = SequencerShape(16, 1, 3, 16, 1, 2, 16)
    rng = np.random.default_rng(pace)
    pair = tuple(random_dual(rng, shape, (20, 30), kind="smooth") for _ in range(2))
    script = Script()
    script.tick_every(pace)
    swaps_at_every_tick(script, (pair[0], pair[1]))
    capture = equal(SequencerBench("icarus", shape, tmp_path), script).capture
    swapped, line, playing = (flag(capture, name) for name in ("swapped", "line", "playing"))
    assert np.sum(swapped & playing) == max(program.schedule.ticks for program in pair)
    assert np.all(line[swapped & playing])
    starts = np.flatnonzero(line)
    for at in np.flatnonzero(swapped & playing):
        before = starts[starts < at][-1]
        assert at - before in {program.schedule.ticks for program in pair}  # the line before was whole
    follow_their_programs(capture, script.taken)


@pytest.mark.rest
@pytest.mark.parametrize("swaps", [SWAPS, pytest.param(SWAPS_SLOW, marks=LONG_TEST)])
def test_no_line_mixes_programs_and_no_step_is_above_the_limit(swaps: int, small_on_verilator: SequencerBench) -> None:
    rng = np.random.default_rng(swaps)
    samples = 0
    for _ in range(0, swaps, SWAPS):
        script, programs = random_swaps(rng, SWAPS)
        played = equal(small_on_verilator, script)
        samples += played.samples
        assert np.sum(flag(played.capture, "swapped")) == SWAPS == len(programs)
        follow_their_programs(played.capture, programs)
    assert samples >= SAMPLES_ON_VERILATOR * swaps // SWAPS


@pytest.mark.common
def test_laws_of_swaps_can_be_broken() -> None:
    script, programs = random_swaps(np.random.default_rng(0), 40)
    script.text()
    capture = np.array(script.expected, dtype=np.uint64)
    follow_their_programs(capture, programs)
    steps_are_limited(capture, programs)
    swapped = np.flatnonzero(flag(capture, "swapped"))
    at = int(swapped[20])

    one_axis_late = capture.copy()  # y plays the program before for one tick more
    before = programs[19]
    k = at - int(swapped[19])
    y_code = int(before.y.codes(np.array([k % before.schedule.frame_ticks]))[0])
    assert y_code != codes(capture, "y")[at]
    one_axis_late[at] = capture[at] & ~np.uint64(0xFFFFFF << 24) | np.uint64(y_code << 24)
    with pytest.raises(Broken):
        follow_their_programs(one_axis_late, programs)

    in_mid_line = np.delete(capture, at - 1)
    with pytest.raises(Broken):
        follow_their_programs(in_mid_line, programs)

    jumps = capture.copy()
    jumps[at] = capture[at] ^ np.uint64(0x8000)
    with pytest.raises(Broken):
        steps_are_limited(jumps, programs)


# Long runs on Verilator.


@pytest.mark.rest
@pytest.mark.parametrize(("ticks", "lines", "played_lines"), [(211, 1009, 1010), (65537, 5, 6)])
def test_no_line_drifts(ticks: int, lines: int, played_lines: int, small_on_verilator: SequencerBench) -> None:
    rng = np.random.default_rng(ticks)
    program = random_dual(rng, SMALL, (ticks, ticks), kind="tame", lines=(lines, lines))
    script = Script()
    script.tick_every(1)
    play(script, program)
    script.wait_ticks(played_lines * ticks + 1)
    capture = equal(small_on_verilator, script).capture
    playing = capture[flag(capture, "playing")][: played_lines * ticks]
    line_by_line = codes(playing, "x").reshape(played_lines, ticks)
    assert np.all(line_by_line == line_by_line[0])
    y = codes(playing, "y")
    frame = lines * ticks
    assert np.array_equal(y[frame:], y[: len(y) - frame])
    assert np.array_equal(np.flatnonzero(flag(playing, "line")), np.arange(played_lines) * ticks)
    assert np.array_equal(np.flatnonzero(flag(playing, "frame")), [0, frame])


@pytest.mark.rest
def test_random_programs_on_verilator(tmp_path: Path) -> None:
    shape = SequencerShape(20, 1, 4, 24, 0, 5, 18)
    script = Script((1 << 19, 3))
    random_play(np.random.default_rng(5), script, shape, 150_000, (1, 2, 5))
    bench = SequencerBench(
        "verilator", shape, tmp_path, {"PLAIN_MULTIPLIER": 1, "X_POWER_UP_CODE": 1 << 19, "Y_POWER_UP_CODE": 3}
    )
    assert equal(bench, script).samples >= 150_000


@pytest.mark.rest
def test_low_area_on_verilator(tmp_path: Path) -> None:
    shape = SequencerShape(20, 1, 4, 24, 0, 5, 16)
    script = Script()
    random_play(np.random.default_rng(11), script, shape, 20_000, LEAST_PACES)
    assert equal(SequencerBench("verilator", shape, tmp_path, LOW_AREA), script).samples >= 20_000


# Programs that are rendered from Fourier words.

HARMONICS = 5


def with_sine(folder: Path, shape: SequencerShape, harmonics: int = HARMONICS) -> dict[str, int | str]:
    """The parameters of a sequencer that renders, its sine written to a file."""
    sine = folder / "sine.mem"
    index_bits = [bits for axis in "xy" if (bits := getattr(shape, f"{axis}_index_bits"))]
    sine.write_bytes(memory_file(sine_quarter(max(index_bits)), 32))
    return {"FOURIER": 1, "HARMONICS": harmonics, "SINE_FILE": str(sine)}


@pytest.mark.common
@pytest.mark.parametrize("plain", [0, 1])
def test_tables_are_rendered_while_a_program_plays(plain: int, tmp_path: Path) -> None:
    shape = SequencerShape(16, 1, 4, 16, 1, 3, 14)
    script = Script()
    random_renderings(np.random.default_rng(3), script, shape, 24 if plain else 10, HARMONICS, plain)
    parameters = {**with_sine(tmp_path, shape), "PLAIN_MULTIPLIER": plain}
    equal(SequencerBench("icarus", shape, tmp_path, parameters), script)
    assert script.swaps >= 8


@pytest.mark.common
@pytest.mark.parametrize("low_area", [0, 1])
def test_a_plan_from_its_fourier_words(low_area: int, tmp_path: Path) -> None:
    """The swap is from the uploaded plan to the same, rendered from a fiftieth of the words: no code may differ."""
    plan = planned(tmp_path, PLANS["settle_0"])
    program = plan.program
    shape = SequencerShape.of((program.x, program.y))
    x, y = plan.x.fourier, plan.y.fourier
    parameters = {**with_sine(tmp_path, shape, x.harmonics), "PLAIN_MULTIPLIER": 1, "LOW_AREA": low_area}
    bench = SequencerBench("verilator" if low_area else "icarus", shape, tmp_path / "bench", parameters)
    clocks, pace = rendering_clocks(shape, x, y, 1), LEAST_PACE if low_area else 1
    script = Script()
    script.tick_every(pace)
    for frames in (1, 0):
        script.load(program, x, y) if frames == 0 else script.load(program)
        script.request("commit", program=program, commit_clocks=clocks if frames == 0 else 4)
        if frames:
            script.wait_ticks(50)
            script.request("arm", "trigger")
            script.wait_ticks(plan.schedule.ticks)
    script.wait(clocks)
    script.wait_ticks(5 * plan.schedule.ticks)
    assert script.swaps == 2
    capture = equal(bench, script).capture
    at = int(np.flatnonzero(flag(capture, "swapped"))[1])
    within_certificate(capture[at:], plan)


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


@pytest.mark.common
def test_a_tick_that_comes_too_early_is_a_fault(tmp_path: Path) -> None:
    """With a tick a clock earlier than the least pace every second one is refused, and the others go on as if alone."""
    plan = planned(tmp_path, PLANS["settle_0"])
    program = plan.program
    script = Script()
    script.tick_every(0)
    script.load(program)
    script.request("commit", program=program)
    script.wait(5)
    script.tick_every(2 * (LEAST_PACE - 1))
    script.wait(1)  # the program is taken
    script.request("arm", "trigger")
    script.wait_ticks(2 * plan.schedule.ticks)
    tick_every = script.commands.index(4 << 60 | 2 * (LEAST_PACE - 1))
    script.commands[tick_every] -= LEAST_PACE - 1
    bench = SequencerBench("icarus", SequencerShape.of((program.x, program.y)), tmp_path / "bench", LOW_AREA)
    played = bench.play(script)
    expected = np.array(script.expected, dtype=np.uint64)
    assert played.fault_counts == (0, 0, len(expected) - 1, 0)
    markers = ~np.uint64(1 << 48 + FLAGS.index("valid") | 1 << 56 + FAULTS.index("overrun"))
    assert np.array_equal(played.capture & markers, expected & markers)
    assert np.all(flag(played.capture, "overrun"))
    assert not np.any(flag(played.capture, "valid"))
    assert np.any(flag(expected, "valid"))


# From a plan to the wires of a converter, and back to volts.


@dataclass(frozen=True)
class Chip:
    """A converter behind two parallel wires."""

    bits: int
    frame_bits: int
    prefix: int
    twos_complement: bool


CHIPS = {"bits_16": Chip(16, 16, 0, False), "bits_20": Chip(20, 24, 0x100000, True)}


@pytest.mark.common
@pytest.mark.parametrize("name", CHIPS)
def test_volts_at_the_piezo(name: str, tmp_path: Path) -> None:
    chip = CHIPS[name]
    coding = "twos-complement" if chip.twos_complement else "offset-binary"
    variant = _short(dac__bits=chip.bits, dac__coding=coding, x__table__bits=chip.bits, y__table__bits=chip.bits)
    plan = planned(tmp_path, variant)
    program = plan.program
    levels = tmp_path / "levels.txt"
    parameters = {
        "LEVELS": str(levels),
        "WORD_BITS": chip.bits,
        "TWOS_COMPLEMENT": int(chip.twos_complement),
        "FRAME_BITS": chip.frame_bits,
        "PREFIX": chip.prefix,
    }
    sources = [*verilog_runtime(), BENCHES / "stream_spi_bench.v"]
    shape = SequencerShape.of((program.x, program.y))
    bench = SequencerBench("icarus", shape, tmp_path / "bench", parameters, sources, top="stream_spi_bench")
    script = Script()
    script.load(program)
    script.tick_every(2 * chip.frame_bits + 12)
    script.request("commit", program=program)
    script.wait_ticks(20)
    script.request("arm", "trigger")
    script.wait_ticks(plan.schedule.ticks + 20)
    script.tick_every(0)
    script.wait(200)
    played = equal(bench, script)

    digits = np.frombuffer(bytes.fromhex(levels.read_text("ascii")), dtype=np.uint8)
    sclk, mosi_x, mosi_y, cs_n, ldac_n = (digits >> bit & 1 for bit in range(5))
    playing = np.flatnonzero(flag(played.capture, "playing"))
    caught_up = 30
    for line, mosi in ((plan.x, mosi_x), (plan.y, mosi_y)):
        converter = Converter(chip.frame_bits, cpol=0, cpha=0)
        wires = Wires(sclk, cs_n, mosi, ldac_n)
        frames = receive(wires, converter)
        _, latest = updates(wires, converter, frames)
        words = frames.values[latest, 0]
        assert len(words) == played.samples
        assert np.all(words >> chip.bits == chip.prefix >> chip.bits)
        words &= (1 << chip.bits) - 1
        if chip.twos_complement:  # as the converter reads it: 0 in the middle
            signed = np.where(words >= 1 << chip.bits - 1, words - (1 << chip.bits), words)
            at_converter = 10.0 * signed / (1 << chip.bits)
        else:
            at_converter = -5.0 + 10.0 * words / (1 << chip.bits)
        at_piezo = 10.0 * at_converter + 50.0
        k = np.arange(len(playing))
        w = line.series.value(k % line.program.ticks / line.program.ticks)
        wanted = line.drive.v_offset + line.drive.v_amplitude * (w - 0.5)
        lsb = 10.0 * 10.0 / (1 << chip.bits)
        errors = np.abs(at_piezo[playing] - wanted)[caught_up:] / lsb
        assert np.max(errors) <= certify(plan)[line.axis].max_error_lsb + 1e-6
        assert len(errors) > 300
