"""Faults put into the Verilog of the sequencer, each of which the bench has to find; run as a program it lists them.

A mutant is played the scripts that the module itself plays equal to the model.
"""

import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import mutants
import numpy as np
from building import BENCHES as BENCHES_FOLDER
from building import run_clean, tool
from limits import ENDED, within
from mutants import Verdict
from pair_play import ALTERNATE, PAIR_PACES, pair_script, pair_sources
from pixel_scripts import PIXEL_TABLE, PixelScript, full_lines, refuse_tables
from programs import random_dual
from slow_scripts import SLOW_PART, SlowScript, slow_modes, slow_play, slow_sources
from stream_benches import with_sine
from stream_scripts import (
    counted_frames,
    counts_after_a_clear,
    imaging_program,
    modes,
    play,
    random_play,
    random_renderings,
    refusals,
    sweep,
    within_limits,
)

from tablegen.base.resources import verilog_runtime
from tablegen.verification.failures import SimulationFailed
from tablegen.verification.play.placement import Placement
from tablegen.verification.play.sequencer_shape import SequencerShape
from tablegen.verification.play.stream import Script, read_capture, read_states
from tablegen.verification.verilog.sequencer_bench import STREAM_BENCH, SequencerBench

HARMONICS = 4
PLAY_S = 60  # of CPU time: what does not hang takes two seconds
LEAST_PACE = Placement("serial").tick_clocks
Y_AXIS_AFTER_LOADS = """
                .runnings(runnings_now[LATENCY-4:0]),
                .bank(bank), .restart(frame_0)"""

SHAPES = {
    "digits": SequencerShape(16, 1, 4, 16, 1, 3, 16),
    "plain": SequencerShape(20, 1, 3, 24, 1, 4, 18),
    "direct": SequencerShape(12, 0, 6, 12, 0, 6, 20),
    "low area": SequencerShape(22, 1, 4, 24, 0, 4, 16),
    "fourier": SequencerShape(16, 1, 4, 16, 1, 3, 14),
    "long table": SequencerShape(24, 1, 12, 24, 1, 2, 24),  # in which every bit of the phase counts
    "second": SequencerShape(16, 1, 4, 16, 1, 3, 16),
    "scanner": SequencerShape(18, 1, 3, 16, 1, 3, 18),
    "low area scanner": SequencerShape(16, 1, 3, 16, 0, 4, 12),
    "cubic": SequencerShape(20, 3, 3, 14, 1, 3, 16),
    "cubic low area": SequencerShape(24, 3, 3, 12, 1, 3, 12),
    "modes": SequencerShape(16, 1, 2, 16, 1, 2, 16),
    "slow": SequencerShape(24, 3, 3, 8, 1, 2, 9),
    "slow modes": SequencerShape(16, 1, 2, 16, 1, 2, 16),
    "slow scanner": SequencerShape(16, 1, 2, 16, 1, 2, 16),
    "pair": SequencerShape(16, 1, 4, 16, 1, 3, 16),
    "pair direct": SequencerShape(8, 0, 6, 8, 1, 2, 8),
    "pair long table": SequencerShape(20, 1, 12, 20, 1, 2, 20),
    "pair sweep": SequencerShape(16, 1, 3, 16, 1, 2, 16),
    "pixels": SequencerShape(16, 1, 3, 16, 1, 2, 16),
    "pixel tables": SequencerShape(16, 1, 3, 16, 1, 2, 16),
}
SHAPED = {  # parameters, paces, samples
    "second": ({"SHAPING": 2}, (1, 3), 5000),
    "scanner": ({"SHAPING": 3, "PLAIN_MULTIPLIER": 1}, (Placement("blocks", shaping=3).tick_clocks,), 4000),
    "low area scanner": ({"SHAPING": 3, "LOW_AREA": 1}, (Placement("serial", shaping=3).tick_clocks,), 800),
}
SPLINES = {  # parameters, how it is placed, samples
    "cubic": ({}, Placement(spline=True), 1500),
    "cubic low area": ({"LOW_AREA": 1}, Placement("serial", spline=True), 300),
}
PIXELS = ("pixels", "pixel tables")
PAIRS = ("pair", "pair direct", "pair long table", "pair sweep")
BENCHES = tuple(SHAPES)
SLOW = ("slow", "slow modes", "slow scanner")
SLOW_SHAPING = {"slow scanner": 3}


@dataclass(frozen=True)
class Mutant(mutants.Mutant):
    """A fault in a module, by its name without .v; ``where`` is the bench in which it shows."""

    where: str = "plain"

    @property
    def path(self) -> Path:
        return next(path for path in (*slow_sources(), *pair_sources()) if path.stem == self.file)


def _pixel_script(rng: np.random.Generator, shape: SequencerShape, bench: str) -> Script:
    script = PixelScript()
    if bench == "pixel tables":
        refuse_tables(rng, script, shape)
    else:
        full_lines(rng, script, shape)
        random_play(rng, script, shape, 6000, (1, 2, 3), (8, 32), (1, 3), pixels=True)
    return script


def _slow_script(rng: np.random.Generator, shape: SequencerShape, bench: str) -> Script:
    script = SlowScript(shape=shape, shaping=SLOW_SHAPING.get(bench, 0))
    if bench == "slow modes":
        slow_modes(np.random.default_rng(5), script, 14)  # with a program that cannot keep the frame, on a middle line
    else:
        slow_play(rng, script, 400 if script.shaping else 700, 5)  # slow tables of both signs play by then
    return script


@cache
def script_of(bench: str) -> Script:
    """What a bench plays; the same every time."""
    shape, rng = SHAPES[bench], np.random.default_rng(4)
    script = Script()
    if bench == "fourier":
        random_renderings(rng, script, shape, 12, HARMONICS, 1)
    elif bench in SHAPED:
        parameters, paces, samples = SHAPED[bench]
        random_play(rng, script, shape, samples, paces, shaping=parameters["SHAPING"])
    elif bench in SPLINES:
        _, placement, samples = SPLINES[bench]
        script = Script(drain=placement.drain_clocks)
        random_play(rng, script, shape, samples, (placement.tick_clocks, placement.tick_clocks + 9), (8, 20))
    elif bench in PIXELS:
        script = _pixel_script(rng, shape, bench)
    elif bench == "modes":
        script.tick_every(1)
        modes(rng, script, shape)
    elif bench in ("pair", "pair direct"):
        script = pair_script()
        script.tick_every(PAIR_PACES[0])
        play(script, within_limits(random_dual(rng, shape, (40, 40), kind="tame", lines=(2, 2))))
        script.wait_ticks(90)
        random_play(rng, script, shape, 2500, PAIR_PACES, (8, 20))
    elif bench in SLOW:
        script = _slow_script(rng, shape, bench)
    elif bench == "low area":
        script.tick_every(LEAST_PACE)
        tame, smooth = imaging_program(rng, shape, "tame"), imaging_program(rng, shape, "smooth")
        counted_frames(script, tame)
        refusals(script, smooth, tame)
        counts_after_a_clear(script, tame)
        script.request("park")
        play(script, random_dual(rng, shape, (150, 160), kind="tame"))
        script.wait_ticks(150)
        random_play(rng, script, shape, len(script.expected) + 250, (LEAST_PACE,))
    elif bench in ("long table", "pair long table"):
        pace = 2 if bench in PAIRS else 1
        script = pair_script() if bench in PAIRS else script
        for _ in range(2):
            program = random_dual(rng, shape, (200, 220), kind="tame", lines=(3, 3))
            script.load(program)
            script.request("commit", program=program)
            script.tick_every(pace)
            script.wait_ticks(300)
            for ticks in (100, 330, 500):  # begins again in mid-line, and swaps at the end of one
                script.request("park")
                script.request("arm", "trigger")
                script.wait_ticks(ticks)
            script.tick_every(0)
    else:
        pace = 2 if bench in PAIRS else 1
        script = sweep(rng, shape, 500, pace, refused=bench in ("direct", "pair sweep"))
    return script


def design_of(bench: str, folder: Path, mutant: Mutant | None = None) -> tuple[list[Path], dict[str, int | str]]:
    """Return the sources of the bench of this name, with a mutant in them or with none, and its parameters."""
    sources = slow_sources() if bench in SLOW else pair_sources() if bench in PAIRS else list(verilog_runtime())
    folder.mkdir(parents=True, exist_ok=True)
    if mutant is not None:
        changed = folder / f"{mutant.file}.v"
        changed.write_text(mutant.source, "utf-8")
        sources[sources.index(mutant.path)] = changed
    parameters: dict[str, int | str] = {"PLAIN_MULTIPLIER": int(bench in ("plain", "fourier", "long table"))}
    parameters["LOW_AREA"] = int(bench == "low area")
    parameters["COMMIT_MODES"] = int(bench in ("modes", "slow modes"))
    if bench in SHAPED:
        parameters |= SHAPED[bench][0]
    if bench in SPLINES:
        parameters |= SPLINES[bench][0]
    if bench in PAIRS:
        parameters |= ALTERNATE
    if bench in SLOW:
        parameters |= SLOW_PART | {"SHAPING": SLOW_SHAPING.get(bench, 0)}
    if bench in PIXELS:
        parameters |= PIXEL_TABLE | {"PLAIN_MULTIPLIER": 1}
    if bench == "fourier":
        parameters |= with_sine(folder, SHAPES[bench], HARMONICS)
    return sources, parameters


def bench_of(bench: str, folder: Path, mutant: Mutant | None = None) -> SequencerBench:
    """Return the bench of this name, with a mutant in it or with none."""
    sources, parameters = design_of(bench, folder, mutant)
    return SequencerBench("icarus", SHAPES[bench], folder / "bench", parameters, sources)


def judge(mutant: Mutant | None, folder: Path, bench: str = "") -> Verdict:
    """Play a mutant up to its first sample that differs from the model; ``bench`` plays the Verilog as it is.

    The bench is that of ``SequencerBench`` without cocotb, whose start takes longer than most mutants play.
    """
    bench = bench if mutant is None else mutant.where
    script = script_of(bench)
    sources, parameters = design_of(bench, folder, mutant)
    files = {name: folder / f"{name.lower()}.hex" for name in ("SCRIPT", "EXPECTED")}
    files["SCRIPT"].write_text(script.text(), "ascii")
    files["EXPECTED"].write_text("".join(f"{word:016x}\n" for word in script.expected), "ascii")
    parameters |= SHAPES[bench].parameters()
    parameters |= {"SCRIPT": str(files["SCRIPT"]), "CAPTURE": str(folder / "capture.hex")}
    states = folder / "states.hex"
    parameters |= {"STATES": str(states)} if script.states else {}
    watched = {"EXPECTED": str(files["EXPECTED"]), "SAMPLES": len(script.expected)}
    given = [
        f"-P{top}.{name}=" + (f'"{value}"' if isinstance(value, str) else str(value))
        for top, values in (("stream_bench", parameters), ("mutant_watch", watched))
        for name, value in values.items()
    ]
    program = folder / "watched"
    run_clean(
        [
            "iverilog", "-g2005", "-Wall", "-Wno-timescale", "-s", "stream_bench", "-s", "mutant_watch", *given,
            "-o", program, *sources, STREAM_BENCH, BENCHES_FOLDER / "mutant_watch.v",
        ]
    )  # fmt: skip
    done = subprocess.run(within(PLAY_S, [tool("vvp"), "-n", program]), capture_output=True, text=True, check=False)
    if done.returncode == ENDED:
        return Verdict(True, "hangs")
    words = done.stdout.split()
    if done.returncode == 0 and words[:1] == ["tick"]:
        return Verdict(True, f"tick {words[1]}")
    if done.returncode or words[:1] != ["end"]:
        raise SimulationFailed(f"the bench did not play its script to the end\n{done.stdout}{done.stderr}")
    samples, refused, jitter, counts = words[1:]
    if int(samples) != len(script.expected):
        return Verdict(True, f"tick {samples}")
    if jitter != "0":
        return Verdict(True, "latency")
    if script.states:
        stored = read_states([int(word) for word in read_capture(states)])
        for (when, expected), state in zip(script.states, stored, strict=True):
            if state.flags != expected.flags:
                return Verdict(True, when)
    if refused != str(int(script.refused)):
        return Verdict(True, "refused writes")
    differs = counts[-16:] != f"{script.counts[1]:08x}{script.counts[0]:08x}"
    return Verdict(differs, "fault counts" if differs else "")


def _axis() -> Iterator[Mutant]:
    """Phase, table, interpolation, and what of a new program meets which sample."""
    yield Mutant(
        "interpolation rounds down", "dac_interpolator",
        "{GUARD_BITS{1'b0}}, 1'b1} + step", "{GUARD_BITS{1'b0}}, 1'b0} + step",
        "long table",
    )  # fmt: skip
    yield Mutant(
        "half a digit of the fraction is lost", "dac_axis", "phase[FRACTION_AT +: 15]", "phase[FRACTION_AT-1 +: 15]"
    )
    yield Mutant(
        "the fraction is a clock early",
        "dac_axis",
        "dac_delay #(.BITS(15), .CLOCKS(3))",
        "dac_delay #(.BITS(15), .CLOCKS(2))",
    )
    yield Mutant("no table word after an odd one", "dac_table", "{{ROW_BITS-1{1'b0}}, index[0]}", "{ROW_BITS{1'b0}}")
    yield Mutant(
        "the table does not wrap to its first word",
        "dac_table",
        ".address({read_bank, next_row})",
        ".address({read_bank, next_row == 0 && index[0] ? {ROW_BITS{1'b1}} : next_row})",
    )
    yield Mutant(
        "the other bank is read",
        "dac_axis",
        ".read_bank(read_bank), .index(phase",
        ".read_bank(!read_bank), .index(phase",
    )
    yield Mutant("the other bank is written", "dac_table", "{write_bank, write_index", "{!write_bank, write_index")
    yield Mutant("odd words are written to both", "dac_table", "write && !write_index[0]", "write")
    yield Mutant("a word is read a clock early", "dac_memory", "word <= words[row]", "word <= words[address]")
    yield Mutant(
        "the bank is read a clock early",
        "dac_axis",
        "dac_delay #(.BITS(1), .CLOCKS(WAIT + 2)) with_phase",
        "dac_delay #(.BITS(1), .CLOCKS(WAIT + 1)) with_phase",
    )
    yield Mutant(
        "the bank is read a clock late",
        "dac_axis",
        "dac_delay #(.BITS(1), .CLOCKS(WAIT + 2)) with_phase",
        "dac_delay #(.BITS(1), .CLOCKS(WAIT + 3)) with_phase",
    )
    yield Mutant(
        "a direct table changes bank a clock early", "dac_axis", ".CLOCKS(WAIT + 1)", ".CLOCKS(WAIT)", "direct"
    )
    yield Mutant(
        "a direct table changes bank a clock late", "dac_axis", ".CLOCKS(WAIT + 1)", ".CLOCKS(WAIT + 2)", "direct"
    )
    yield Mutant(
        "a direct table begins at its second word",
        "dac_axis",
        "restarts ? {INDEX_BITS{1'b0}}",
        "restarts ? {{INDEX_BITS-1{1'b0}}, 1'b1}",
        "direct",
    )
    yield Mutant(
        "a direct table is written in the other bank",
        "dac_direct_table",
        "memory[{write_bank,",
        "memory[{!write_bank,",
        "direct",
    )
    yield Mutant(
        "the phase has no remainder",
        "dac_phase",
        "wraps <= !restart && !over[PERIOD_BITS]",
        "wraps <= 1'b0",
        "long table",
    )
    yield Mutant(
        "the remainder wraps an advance late",
        "dac_phase",
        "restart || !over[PERIOD_BITS] ? less",
        "!over[PERIOD_BITS] ? less",
        "long table",
    )
    yield Mutant(
        "the remainder of the last period goes on",
        "dac_phase",
        "restart ? {PERIOD_BITS+1{1'b0}} : over",
        "over",
        "long table",
    )
    yield Mutant("the phase begins one advance late", "dac_phase", "phase <= 32'd0", "phase <= step")
    yield Mutant(
        "the phase step comes a clock early", "dac_phase", ".load(load), .value(step)", ".load(take), .value(step)"
    )
    yield Mutant(
        "the phase remainder comes a clock late", "dac_phase", "if (take) begin", "if (load) begin", "long table"
    )
    yield Mutant(
        "all of the output stage's program comes a clock early",
        "dac_axis",
        "loads[TARGET_AT:SAMPLE_AT-1]",
        "loads[TARGET_AT-1:SAMPLE_AT-2]",
    )
    yield Mutant("parking comes a clock early", "dac_axis", "runnings[TARGET_AT-2]", "runnings[TARGET_AT-3]")
    yield Mutant("parking comes a clock late", "dac_axis", "runnings[TARGET_AT-2]", "runnings[TARGET_AT-1]")
    yield Mutant("a target comes a clock early", "dac_axis", ".valid(ticks[TARGET_AT])", ".valid(ticks[TARGET_AT-1])")
    yield Mutant("the clamp's verdict is a clock early", "dac_axis", ".CLOCKS(4)) with_code", ".CLOCKS(3)) with_code")


def _output() -> Iterator[Mutant]:
    """Gain, offset, limits; each of their registers a clock early and a clock late."""
    yield Mutant("the code is rounded down", "dac_offset", "HALF != 0, {GAIN_Q-1{1'b0}}}", "1'b0, {GAIN_Q-1{1'b0}}}")
    yield Mutant(
        "nothing is held at code_min",
        "dac_output",
        "over_min[CODE_BITS-1] ? {CODE_BITS{1'b1}} : ~over_min",
        "~over_min",
    )
    yield Mutant(
        "nothing is held at code_max",
        "dac_output",
        "running && room[CODE_BITS-1] ? {DAC_BITS{1'b1}} : ~room_left",
        "~room_left",
    )
    yield Mutant(
        "no clamp is reported at code_min", "dac_output", "(was_low || room[CODE_BITS-1])", "room[CODE_BITS-1]"
    )
    yield Mutant("no clamp is reported at code_max", "dac_output", "(was_low || room[CODE_BITS-1])", "was_low")
    yield Mutant(
        "code_min is exceeded by one",
        "dac_output",
        "{CODE_BITS{1'b1}} : ~over_min",
        "{{CODE_BITS-1{1'b1}}, 1'b0} : ~over_min",
    )
    yield Mutant("the park code is not used", "dac_output", "running ? room : park_room", "room")
    for register, old, early, late in (
        ("span", "loads[LATENCY-3]", "loads[LATENCY-4]", "loads[LATENCY-2]"),
        ("park code", "loads[LATENCY-2]", "loads[LATENCY-3]", "loads[LATENCY-1]"),
        ("code_max", "loads[LATENCY-1]", "loads[LATENCY-2]", "loads[LATENCY]"),
        ("high offset", "SHAPING != 0 ? 6 : 5)", "SHAPING != 0 ? 7 : 6)", "SHAPING != 0 ? 5 : 4)"),
        (
            "gain digits",
            "data(recoded[2*i +: 2]), .load(loads[i])",
            "data(recoded[2*i +: 2]), .load(loads[i == 0 ? 0 : i - 1])",
            "data(recoded[2*i +: 2]), .load(loads[i+1])",
        ),
    ):
        bench = "digits" if "recoded" in old else "plain"
        yield Mutant(f"the {register} comes a clock early", "dac_output", old, early, bench)
        yield Mutant(f"the {register} comes a clock late", "dac_output", old, late, bench)
    yield Mutant("max_step comes a clock early", "dac_output", "loads[LATENCY+1]", "loads[LATENCY]")
    yield Mutant(
        "the low offset comes a clock late", "dac_output", "loads[PLAIN_MULTIPLIER ? 1 : 0]", "loads[1]", "digits"
    )
    yield Mutant(
        "the low offset comes a clock early (blocks)",
        "dac_output",
        "loads[PLAIN_MULTIPLIER ? 1 : 0]",
        "loads[0]",
        "plain",
    )
    yield Mutant(
        "the gain comes a clock late (blocks)",
        "dac_output",
        ".load(loads[0]),\n                .value(gain)",
        ".load(loads[1]),\n                .value(gain)",
        "plain",
    )
    yield Mutant(
        "the multiplier drops the low offset",
        "dac_multiply_digits",
        "assign so_far = {{A_BITS+1-LOW_BITS{1'b0}}, low}",
        "assign so_far = {A_BITS+1{1'b0}}",
        "digits",
    )
    yield Mutant("a negative digit has no carry", "dac_multiply_digits", "{term, minus}", "{term, 1'b0}", "digits")
    yield Mutant(
        "the multiplier drops the low offset (blocks)",
        "dac_multiply_plain",
        "{{PRODUCT_BITS-LOW_BITS{1'b0}}, low}",
        "{PRODUCT_BITS{1'b0}}",
        "plain",
    )
    yield Mutant(
        "the multiplier drops the low bits (blocks)",
        "dac_multiply_plain",
        "rows[i] + (a[i] ? wide <<< i : {PRODUCT_BITS{1'b0}})",
        "rows[i]",
        "plain",
    )
    yield Mutant("a factor is a clock early (blocks)", "dac_product", "a_in * b_in", "a * b_in", "plain")
    yield Mutant(
        "the guard lets one code less pass upwards",
        "dac_slew",
        "{2'b11, step_inverse} + 1",
        "{2'b11, step_inverse} + 2",
    )
    yield Mutant(
        "the guard lets one code more pass upwards", "dac_slew", "{2'b11, step_inverse} + 1", "{2'b11, step_inverse}"
    )
    yield Mutant(
        "the guard lets one code more pass downwards", "dac_slew", "{2'b00, max_step};", "{2'b00, max_step} + 1;"
    )
    yield Mutant(
        "there is no guard",
        "dac_slew",
        "is_above ? above[BITS:0] : is_below ? below[BITS:0] : {BITS+1{1'b0}}",
        "{BITS+1{1'b0}}",
    )
    yield Mutant(
        "there is no guard downwards", "dac_slew", "is_below ? below[BITS:0] : {BITS+1{1'b0}}", "{BITS+1{1'b0}}"
    )
    yield Mutant("a held code counts as reached", "dac_slew", "reached <= behind == 0", "reached <= 1'b1")


def _scan() -> Iterator[Mutant]:
    """The counter, the requests, the banks."""
    yield Mutant("a swap in mid-line", "dac_scan", "tick && committed && (!running || first)", "tick && committed")
    yield Mutant(
        "a swap on the last tick of a line",
        "dac_scan",
        "committed && (!running || first)",
        "committed && (!running || last)",
    )
    yield Mutant(
        "no swap while nothing plays", "dac_scan", "committed && (!running || first)", "committed && running && first"
    )
    yield Mutant(
        "y changes banks a tick after x",
        "dac_sequencer",
        ".bank(bank), .restart(frame_0), .advance(y_advance_0), .code(y)",
        ".bank(bank ^ load_0), .restart(frame_0), .advance(y_advance_0), .code(y)",
    )
    yield Mutant(
        "y's registers miss the swap",
        "dac_sequencer",
        f".loads(loads_now[LATENCY-4:0]),{Y_AXIS_AFTER_LOADS}",
        f".loads({{LATENCY-3{{1'b0}}}}),{Y_AXIS_AFTER_LOADS}",
    )
    yield Mutant("a line is a tick longer", "dac_scan", "[TICK_BITS-1:0] - 2", "[TICK_BITS-1:0] - 1")
    yield Mutant("a line is a tick shorter", "dac_scan", "[TICK_BITS-1:0] - 2", "[TICK_BITS-1:0] - 3")
    yield Mutant("a frame is a line longer", "dac_scan", "[LINE_BITS-1:0] - 1;", "[LINE_BITS-1:0];")
    yield Mutant(
        "a swap does not begin", "dac_scan", "begins <= plays && (starts || take)", "begins <= plays && starts"
    )
    yield Mutant("a swap does not begin a frame", "dac_scan", "first && (fresh || top)", "first && (starts || top)")
    yield Mutant(
        "a swap goes on in the line it met",
        "dac_scan",
        "wire fresh = starts || (take && !(keep && can_keep));",
        "wire fresh = starts;",
    )
    yield Mutant(
        "the windows of y see the line before",
        "dac_scan",
        "line_number <= fresh ? {LINE_BITS{1'b0}} : at_line",
        "line_number <= at_line",
    )
    yield Mutant("a frame too few", "dac_scan", "frames_left == 1 &&", "frames_left == 2 &&")
    yield Mutant("frames are not counted", "dac_scan", "if (frame_ends) frames_left", "if (1'b0) frames_left")
    yield Mutant("frames without end do end", "dac_scan", "frames_left == 1 && !endless", "frames_left <= 1")
    yield Mutant(
        "arming changes the count of the scan that plays",
        "dac_scan",
        "            armed_frames <= arm_frames;\n",
        "            armed_frames <= arm_frames;\n            frames_left <= arm_frames;\n",
    )
    yield Mutant("a trigger is taken unarmed", "dac_scan", "trigger && (armed || arm)", "trigger")
    yield Mutant(
        "a trigger is not taken on the clock of its arm", "dac_scan", "trigger && (armed || arm)", "trigger && armed"
    )
    yield Mutant(
        "a trigger is taken with nothing to play", "dac_scan", "(loaded || (committed && (tick || !withdraw))) && ", ""
    )
    yield Mutant(
        "a trigger is lost before the first program is taken",
        "dac_scan",
        "(loaded || (committed && (tick || !withdraw)))",
        "(loaded || (tick && committed))",
    )
    yield Mutant(
        "a trigger is taken though the first program is withdrawn",
        "dac_scan",
        "(committed && (tick || !withdraw))",
        "committed",
    )
    yield Mutant("the first program is withdrawn, and its scan runs", "dac_scan", "(plays_on && !unloads)", "plays_on")
    yield Mutant(
        "a withdrawal stops the first program as it is taken",
        "dac_scan",
        "!loaded && !(tick && committed);",
        "!loaded;",
    )
    yield Mutant("a trigger is taken while a scan plays", "dac_scan", " && !plays_on;", ";")
    yield Mutant(
        "a trigger does not disarm",
        "dac_scan",
        "        if (go) begin\n            armed <= 1'b0;",
        "        if (go) begin",
    )
    yield Mutant("park does not disarm", "dac_scan", "if (park || reset) armed", "if (reset) armed")
    yield Mutant(
        "park is ignored", "dac_scan", "((plays_on && !unloads) || go) && !park", "((plays_on && !unloads) || go)"
    )
    yield Mutant(
        "park does not come before a trigger",
        "dac_scan",
        "((plays_on && !unloads) || go) && !park && !reset",
        "(plays_on && !unloads && !park && !reset) || go",
    )
    yield Mutant("reset is ignored by the scan", "dac_scan", "!park && !reset", "!park")
    yield Mutant(
        "the last count of arm is used",
        "dac_scan",
        "frames_left <= arm ? arm_frames : armed_frames",
        "frames_left <= armed_frames",
    )
    yield Mutant("y steps on every tick", "dac_scan", "plays && (first || !y_steps)", "plays")
    yield Mutant("y never ramps", "dac_scan", "plays && (first || !y_steps)", "plays && first")
    yield Mutant("reset does not empty the idle bank", "dac_bank", "reset || withdraw || take", "withdraw || take")
    yield Mutant("withdraw is ignored", "dac_bank", "reset || withdraw || take", "reset || take")
    yield Mutant(
        "a program that was taken is taken again",
        "dac_bank",
        "if (reset || withdraw || take)\n",
        "if (reset || withdraw)\n",
    )
    yield Mutant("a program that waits can be written", "dac_bank", "!committed && !draining", "!draining")
    yield Mutant("a program on its way out can be written", "dac_bank", "!committed && !draining", "!committed")
    yield Mutant(
        "the way out is too short",
        "dac_sequencer",
        "assign drained = loads_now[LATENCY];",
        "assign drained = loads_now[0];",
    )
    yield Mutant(
        "refused writes have an effect",
        "dac_sequencer",
        "accepted_write = write && writable && exists;",
        "accepted_write = write && exists;",
    )
    yield Mutant(
        "refused writes are not reported", "dac_sequencer", "((write && !(writable && exists)) ||", "(", "direct"
    )
    yield Mutant(
        "refused writes are reported for ever",
        "dac_sequencer",
        "else if (clear_faults || reset)\n            refused",
        "else if (1'b0)\n            refused",
    )
    yield Mutant(
        "a commit comes a clock early",
        "dac_sequencer",
        "{trigger, 1'b0, sound_commit, 1'b0}",
        "{trigger, 1'b0, commit && writable, 1'b0}",
    )
    yield Mutant(
        "a commit comes in spite of a withdrawal", "dac_sequencer", "|| waits) && !withdraw && !reset", "|| waits)"
    )
    yield Mutant("y's words go to x as well", "dac_sequencer", "address[15:4] == X_PAGE", "address[15:4] != SCAN_PAGE")


def _modes() -> Iterator[Mutant]:
    """What a mode of a commit says of the swap."""
    for breaks, file, old, new in (
        ("keep begins", "dac_scan", "!(keep && can_keep)", "1'b1"),
        ("keep goes on in any frame", "dac_scan", "!(keep && can_keep)", "!keep"),
        ("every mode goes on", "dac_scan", "!(keep && can_keep)", "!can_keep"),
        ("keep goes on in other lines", "dac_scan", "idle_next_to_last == next_to_last_tick && ", ""),
        ("keep goes on in another frame", "dac_scan", "idle_last_line == last_line_number &&", ""),
        ("keep goes on with other steps of y", "dac_scan", " &&\n                      idle_y_steps == y_steps;", ";"),
        ("frame does not wait", "dac_scan", "running && at_frame && !top && !starts", "1'b0"),
        ("every mode waits for a frame", "dac_scan", "at_frame && !top", "!top"),
        ("frame waits for ever where a scan begins", "dac_scan", "!top && !starts;", "1'b1;"),
        ("a frame that goes on does not settle", "dac_scan", "plays && (starts || take)", "plays && fresh"),
        ("keep is frame", "dac_sequencer", "keep = mode == KEEP", "keep = mode == FRAME"),
        ("frame is keep", "dac_sequencer", "at_frame = mode == FRAME", "at_frame = mode == KEEP"),
        ("the mode is that of the last clock", "dac_sequencer", "if (commit && writable) mode", "mode"),
        ("the mode of the first commit holds", "dac_sequencer", "commit && writable) mode", "commit && !loaded) mode"),
        ("a window is not compared in a frame that goes on", "dac_markers",
         ".JUMPS(COMMIT_MODES)) up", ".JUMPS(0)) up"),
        ("nor is the one on the way down", "dac_markers", ".JUMPS(COMMIT_MODES)) down", ".JUMPS(0)) down"),
        ("a window of lines begins a line late", "dac_window", "{1'b1, first} + 1;", "{1'b1, first};"),
        ("a window of lines ends a line late", "dac_window", "{1'b1, stop} + 1;", "{1'b1, stop};"),
        ("a window of the last program goes on", "dac_window", "(JUMPS == 0 && imaging", "(imaging"),
    ):  # fmt: skip
        yield Mutant(breaks, file, old, new, "modes")


def _markers() -> Iterator[Mutant]:
    """Windows, pixels, settling."""
    yield Mutant("markers are a tick late", "dac_sequencer", "LATENCY - MARKERS_AT", "LATENCY - MARKERS_AT + 1")
    yield Mutant("markers are a tick early", "dac_sequencer", "LATENCY - MARKERS_AT", "LATENCY - MARKERS_AT - 1")
    yield Mutant(
        "the swap marker is a tick early",
        "dac_sequencer",
        "assign swapped_done = loads_now[LATENCY]",
        "assign swapped_done = loads_now[LATENCY-1]",
    )
    yield Mutant("a window ends a tick late", "dac_window", "idle_first + idle_count", "idle_first + idle_count + 1")
    yield Mutant("a window begins a tick late", "dac_window", "first <= idle_first ^", "first <= (idle_first + 1) ^")
    yield Mutant("a window does not end with its line", "dac_window", "imaging && !is_zero)", "imaging)")
    yield Mutant(
        "an empty window opens", "dac_window", "imaging <= !is_stop && (", "imaging <= (is_first || !is_stop) && ("
    )
    yield Mutant(
        "the turn is a tick late",
        "dac_markers",
        "{1'b0, tick_number} == turn_tick",
        "{1'b0, tick_number} == turn_tick + 1",
    )
    yield Mutant("the backward sweep does not last", "dac_markers", "turn_1 || (backward_2 && !line_1)", "turn_1")
    yield Mutant(
        "the turn of the program before is used",
        "dac_markers",
        ".data(write_data[TICK_BITS:0]), .load(take),\n        .value(turn_tick)",
        ".data(write_data[TICK_BITS:0]), .load(load_1),\n        .value(turn_tick)",
    )
    yield Mutant(
        "a settle line is dropped", "dac_markers", "settled_2 <= settle_left <= 1", "settled_2 <= settle_left <= 2"
    )
    yield Mutant(
        "a settle line too many", "dac_markers", "settled_2 <= settle_left <= 1", "settled_2 <= settle_left == 0"
    )
    yield Mutant("a new program does not settle", "dac_markers", "if (begins_1) begin", "if (1'b0) begin")
    yield Mutant(
        "the settle lines of the program before are used",
        "dac_markers",
        ".data(write_data[7:0]), .load(load)",
        ".data(write_data[7:0]), .load(load_1)",
    )
    yield Mutant(
        "lines of the way down do not image", "dac_markers", "&& (up_imaging || down_imaging)", "&& up_imaging"
    )
    yield Mutant("every line images", "dac_markers", "&& (up_imaging || down_imaging)", "")
    yield Mutant(
        "the way back does not image",
        "dac_markers",
        "(forward_imaging || backward_imaging) && (up",
        "forward_imaging && (up",
    )
    yield Mutant("a scan that does not play images", "dac_markers", "images <= runs_2 && ", "images <= ")
    yield Mutant(
        "pixels start where nothing plays",
        "dac_markers",
        "images_pixels = runs_2 && (forward_imaging || backward_imaging)",
        "images_pixels = forward_imaging || backward_imaging",
    )
    yield Mutant("the backward marker stays", "dac_markers", "runs_2 && backward_2", "backward_2")
    yield Mutant(
        "pixels of the way back have the width of the way forth",
        "dac_markers",
        "forward_imaging ? forward_less : backward_less",
        "forward_less",
    )
    yield Mutant(
        "the width of a pixel is a clock late", "dac_markers", "if (load_1) begin", "if (tick_2 && line_2) begin"
    )
    yield Mutant("the pixel accumulator is not begun anew", "dac_pixels", "opens ? {BITS+2{1'b0}} : behind", "behind")
    yield Mutant(
        "the pixel accumulator starts a pixel too early",
        "dac_pixels",
        "opens || !behind[BITS+1]",
        "opens || behind[BITS+1] == 0 || behind == -1",
    )
    yield Mutant("no pixel at the opening of a window", "dac_pixels", "opens || !behind[BITS+1]", "!behind[BITS+1]")
    for breaks, file, old, new in (
        ("more pixels than ticks of the trace fit", "dac_markers", "(idle_forward_less[TICK_BITS+1] ||", "(1'b1 ||"),
        ("more pixels than ticks of the retrace fit", "dac_markers", "(idle_backward_less[TICK_BITS+1] ||", "(1'b1 ||"),
        ("pixels do not fit a trace without ticks", "dac_markers", "|| !forward_has_ticks)", "|| 1'b0)"),
        ("pixels do not fit a retrace without ticks", "dac_markers", "|| !backward_has_ticks)", "|| 1'b0)"),
        ("a pixel a tick is too many", "dac_markers", "{1'b1, ~backward_count};", "{1'b1, ~backward_count} + 1;"),
        ("pixels are not looked at", "dac_sequencer", "&& slow_fits && pixels_fit", "&& slow_fits"),
        ("a commit does not wait for its write", "dac_sequencer", "host_commit && !scan_write &&", "host_commit &&"),
        ("a commit does not wait for the write before it", "dac_sequencer", "!scan_write && !scan_written;",
         "!scan_write;"),
        ("a commit that waits is lost", "dac_sequencer", "((commit && writable) || waits)", "(commit && writable)"),
    ):  # fmt: skip
        yield Mutant(breaks, file, old, new, "direct")


def _verdict() -> Iterator[Mutant]:
    """Catching up, faults, validity, and the codes that leave."""
    yield Mutant(
        "a reset reaches the codes",
        "dac_sequencer",
        ".x(x), .y(y), .reached",
        ".x(reset ? {DAC_BITS{1'b0}} : x), .y(y), .reached",
    )
    yield Mutant("valid before the codes are there", "dac_verdict", "images && reached && !faulty", "images && !faulty")
    yield Mutant("valid while faulty", "dac_verdict", "images && reached && !faulty", "images && reached")
    yield Mutant(
        "valid on the first faulty tick",
        "dac_verdict",
        "underrun || overrun || clamp_fault || (faults != 4'd0 && !clear)",
        "faults != 4'd0 && !clear",
    )
    yield Mutant("not valid on the tick of a clear", "dac_verdict", "(faults != 4'd0 && !clear)", "faults != 4'd0")
    yield Mutant("catching up is a fault", "dac_verdict", "!reached && !was_catching_up", "!reached")
    yield Mutant("the first tick of a program is a fault", "dac_verdict", "catching_up || begins", "catching_up")
    yield Mutant("a program catches up for ever", "dac_verdict", "was_catching_up && !reached", "was_catching_up")
    yield Mutant("parking is a slew fault", "dac_verdict", "tick && runs && !reached", "tick && !reached")
    yield Mutant("parked before the codes are there", "dac_verdict", "!runs && reached", "!runs")
    yield Mutant(
        "one axis is enough to be there",
        "dac_sequencer",
        ".reached(x_reached && y_reached)",
        ".reached(x_reached || y_reached)",
    )
    yield Mutant("clamps of y do not count", "dac_sequencer", ".clamped(x_clamped || y_clamped)", ".clamped(x_clamped)")
    yield Mutant("faults are not sticky", "dac_faults", "(clear ? {FAULTS{1'b0}} : faults) | happens", "happens")
    yield Mutant("a fault on the tick of a clear is lost", "dac_faults", "faults) | happens", "faults | happens)")
    yield Mutant(
        "a fault on the tick of a clear is not counted",
        "dac_faults",
        "{{COUNT_BITS-1{1'b0}}, happens[i]}",
        "{COUNT_BITS{1'b0}}",
    )
    yield Mutant("faults count twice", "dac_faults", "<= count + 1", "<= count + 2")
    yield Mutant(
        "the counts are not cleared", "dac_faults", "                if (clear)\n", "                if (1'b0)\n"
    )
    yield Mutant(
        "a clear comes a tick early",
        "dac_sequencer",
        "clears_0 <= clear_waits;",
        "clears_0 <= clear_waits || clear_faults;",
    )
    yield Mutant("a clear goes on for ever", "dac_sequencer", "(clear_waits && !accepted_tick)", "clear_waits")
    yield Mutant(
        "what goes with a tick is a clock late",
        "dac_sequencer",
        "CLOCKS(LATENCY)) with_tick",
        "CLOCKS(LATENCY + 1)) with_tick",
    )
    yield Mutant("a beginning is a clock late", "dac_sequencer", "CLOCKS(11)) from", "CLOCKS(12)) from")
    yield Mutant("a strobe without a tick", "dac_verdict", "strobe <= tick;", "strobe <= tick || strobe;")


def _low_area() -> Iterator[Mutant]:
    """The serial axis."""
    for breaks, old, new in (
        ("interpolation rounds down", "<< (15 - GUARD_BITS);", "<< 0;"),
        (
            "the low word of the offset has no half",
            "LOW_HALF = GAIN_Q < 19 && SHAPING == 0 ? 1 << (GAIN_Q - 1) : 0",
            "LOW_HALF = 0",
        ),
        (
            "the wide offset has no half",
            "HIGH_HALF = GAIN_Q < 19 || SHAPING != 0 ? 0 : {{BITS-1{1'b0}}, 1'b1} << (GAIN_Q - 1)",
            "HIGH_HALF = 0",
        ),
        ("the next table word is this one", "{{INDEX_BITS-1{1'b0}}, step == HERE}", "{INDEX_BITS{1'b0}}"),
        ("the phase has no remainder", "phase + word + {31'd0, wraps}", "phase + word"),
        ("the remainder of the last period goes on", "                        rest <= 0;\n", ""),
        ("the other bank of the program is read", "words[{bank, address}]", "words[{!bank, address}]"),
        (
            "the other bank of the table is written",
            "table_words[{!bank, table_address}]",
            "table_words[{bank, table_address}]",
        ),
        ("the park code is not used", "if (!running) a <= word_wide", "if (1'b0) a <= word_wide"),
        ("nothing is held at code_min", "if (beyond) a <= m;\n                is_low <= beyond;", "is_low <= beyond;"),
        (
            "nothing is held at code_max",
            "if (beyond) a <= m;\n                is_high <= beyond;",
            "is_high <= beyond;",
        ),
        ("there is no guard upwards", "if (beyond) a <= m;\n                limited <= beyond;", "limited <= beyond;"),
        (
            "there is no guard downwards",
            "if (beyond) a <= m;\n                limited <= limited || beyond;",
            "limited <= limited || beyond;",
        ),
        ("a code that was held upwards counts as reached", "limited <= limited || beyond", "limited <= beyond"),
        ("no clamp is reported at code_min", "running && (is_low || is_high)", "running && is_high"),
    ):
        yield Mutant(breaks, "dac_axis_serial", old, new, "low area")


def _shaping() -> Iterator[Mutant]:
    """What is fed back, and what of a new program meets which of its fractions."""
    for breaks, old, new in (
        ("no remainder is kept", "kept <= sum[BITS-1:0];", "kept <= HALF;"),
        ("remainders of the last program go on", "begins || order == 2'd0", "order == 2'd0"),
        ("what is off is shaped", "begins || order == 2'd0", "begins"),
        ("the carry is lost", "carry <= sum[BITS];", "carry <= 1'b0;"),
        ("whole codes that are fed back are lost", "more <= moved[BITS+2:BITS];", "more <= 3'd0;"),
        ("the order comes before its program", "if (load) order <=", "order <="),
        ("the difference of the last program goes on", "begins || !order[1]", "!order[1]"),
        ("first order is second", "begins || !order[1]", "begins"),
        (
            "the difference has no sign",
            "else if (tick)\n                        difference <= {sum[BITS],",
            "else if (tick)\n                        difference <= {1'b0,",
        ),
    ):
        yield Mutant(breaks, "dac_shaper", old, new, "second")
    for breaks, old, new in (
        (
            "the difference of the scanner's order has no sign",
            "(tick) difference <= {sum[BITS],",
            "(tick) difference <= {1'b0,",
        ),
        ("second order has no zero", "word[14] || word[1:0] == 2'd2", "word[14]"),
        ("the highest digit is that below it", ": digits[7:6]", ": digits[5:4]"),
        ("a negative digit has no carry", "{term, minus}", "{term, 1'b0}"),
        ("the last product goes on", "product <= 0;", "product <= product;"),
        ("products are not negative", "{2{product[BITS+2]}}", "2'b00"),
        ("a digit is missing", "step != 3'd0 && step != 3'd5", "step != 3'd0 && step < 3'd4"),
        ("the last difference is not subtracted", "product - {{2{last[BITS]}}, last}", "product"),
        ("the last difference of the last program goes on", "begins || order != 2'd3", "order != 2'd3"),
        ("second order subtracts, too", "begins || order != 2'd3", "begins"),
        ("the digits come before their program", "if (load) digits <=", "digits <="),
        (
            "what the last program feeds back goes on",
            "if (begins)\n                        fed_back <= 0;\n                    else if",
            "if",
        ),
    ):
        yield Mutant(breaks, "dac_shaper", old, new, "scanner")
    for breaks, file, old, new in (
        ("the shaper's tick comes a clock early", "dac_axis", "ticks[TARGET_AT-6]", "ticks[TARGET_AT-7]"),
        ("the shaper's tick comes a clock late", "dac_axis", "ticks[TARGET_AT-6]", "ticks[TARGET_AT-5]"),
        ("the shaper's word is two clocks early", "dac_output", ".load(loads[LATENCY-6])", ".load(loads[LATENCY-8])"),
        ("the shaper's word comes a clock late", "dac_output", ".load(loads[LATENCY-6])", ".load(loads[LATENCY-5])"),
        ("the half is added twice", "dac_output", "SHAPING != 0 ? 0 : 1)\n    ) offset", "1)\n    ) offset"),
        ("the beginning comes a clock early", "dac_sequencer", "CLOCKS(LATENCY - 11)", "CLOCKS(LATENCY - 12)"),
        ("the beginning comes a clock late", "dac_sequencer", "CLOCKS(LATENCY - 11)", "CLOCKS(LATENCY - 10)"),
    ):
        yield Mutant(breaks, file, old, new, "second")
    for breaks, old, new in (
        ("remainders do not begin", "begins(step == WAIT && tick && begins)", "begins(1'b0)"),
        ("the shaping of the word before", "WITH_SHAPING = 6'd4", "WITH_SHAPING = 6'd3"),
        ("the carry is lost", "{BITS-1{1'b0}}, carried}", "{BITS-1{1'b0}}, 1'b0}"),
        ("the half is added twice", "LOW_HALF = GAIN_Q < 19 && SHAPING == 0", "LOW_HALF = GAIN_Q < 19"),
        (
            "the half is added twice, above the low word",
            "HIGH_HALF = GAIN_Q < 19 || SHAPING != 0",
            "HIGH_HALF = GAIN_Q < 19",
        ),
        ("code_min is not read again", "shapes && step == MORE ? CODE_MIN", "shapes && step == MORE ? CODE_MAX"),
    ):
        yield Mutant(breaks, "dac_axis_serial", old, new, "low area scanner")


def _fourier() -> Iterator[Mutant]:
    """A commit that renders first."""
    yield Mutant(
        "a commit does not wait for its table",
        "dac_render",
        "default: if (!start && !busy) begin",
        "default: if (!start) begin",
        "fourier",
    )
    yield Mutant(
        "y is rendered before x is ready",
        "dac_render",
        "X: if (!start && !busy) begin",
        "X: if (!start) begin",
        "fourier",
    )
    yield Mutant(
        "a rendering cannot be called off",
        "dac_render",
        "if (cancel)\n            state",
        "if (1'b0)\n            state",
        "fourier",
    )
    yield Mutant(
        "y has the harmonics of x", "dac_render", "state == Y ? y_harmonics : x_harmonics", "x_harmonics", "fourier"
    )
    yield Mutant(
        "words can be written during a rendering",
        "dac_sequencer",
        "idle_writable && !rendering && !host_commit",
        "idle_writable && !host_commit",
        "fourier",
    )
    yield Mutant(
        "the rendered words go to the address of the host",
        "dac_sequencer",
        "rendering ? rendered_address : address",
        "address",
        "fourier",
    )


def _cubic() -> Iterator[Mutant]:
    """Splines: their words, coefficients and products, what waits for them, and their steps in low area."""
    thrice = "{{2{%s[%s]}}, %s} + {%s[%s], %s, 1'b0};"
    for breaks, old, new in (
        ("word 1 is not read again", "!(ticks[1] || ticks[3])", "ticks[0] || ticks[2]"),
        ("word 3 is word 2", "!(ticks[1] || ticks[3])", "!(ticks[0] || ticks[1] || ticks[3])"),
        ("there is no word 2", "{ticks[0] || ticks[1], ", "{ticks[0], "),
        ("the slope is that of a rise", "span <= rise_before + rise;", "span <= rise;"),
        ("b0 has no bend", "{bend[WORD_BITS+1], bend} + {thrice, 1'b0}", "{thrice, 1'b0}"),
        ("b3 is the bend before", "bend_before} - {bend[WORD_BITS+1], bend}", "bend_before}"),
        (
            "b1 is that of the next tick",
            "{2{b1_quarter_on[WORD_BITS+2]}}, b1_quarter_on,",
            "{2{b1_quarter[WORD_BITS+2]}}, b1_quarter,",
        ),
        ("b0 is that of the tick before", "if (ticks[THIRD]) b0_half_at_last", "if (ticks[SECOND]) b0_half_at_last"),
        ("b0 is that of the next tick", "b0_half_at_last <= b0_half_on;", "b0_half_at_last <= b0_half;"),
        ("digits begin a clock early", "ticks[FIRST-1] ? recoded", "ticks[FIRST-2] ? recoded"),
        ("digits come late to the second product", "CLOCKS(SPACING)) to_second", "CLOCKS(SPACING + 1)) to_second"),
        ("digits come early to the third product", "CLOCKS(SPACING)) to_third", "CLOCKS(SPACING - 1)) to_third"),
        ("the fraction has 17 bits", "{1'b0, phase[17:0], 1'b0}", "{2'b00, phase[16:0], 1'b0}"),
        ("the first product is rounded down", "3'd0, first_half}", "3'd0, 1'b0}"),
        ("the second product is rounded down", "2'd0, second_half}", "2'd0, 1'b0}"),
        ("the third product is rounded down", "1'b0, third_half}", "1'b0, 1'b0}"),
        ("b2 is taken once", thrice % (("bend", "WORD_BITS+1", "bend") * 2), "{{2{bend[WORD_BITS+1]}}, bend};"),
        ("b1 is taken once", thrice % (("span", "WORD_BITS", "span") * 2), "{{2{span[WORD_BITS]}}, span};"),
        ("word 1 is taken once", thrice % (("word", "WORD_BITS-1", "word") * 2), "{{2{word[WORD_BITS-1]}}, word};"),
    ):
        yield Mutant(breaks, "dac_spline", old, new, "cubic")
    for breaks, old, new in (
        ("a negative digit has no carry", "{term, minus}", "{term, 1'b0}"),
        (
            "the last product goes on",
            "if (load)\n            product <= 0;\n        else\n            product",
            "product",
        ),
        ("products are not negative", "{2{product[BITS-1]}}", "2'b00"),
        ("rounds by the bit below", "half <= total[2]", "half <= total[1]"),
        ("a digit of 2 is 1", "{factor[BITS-1], factor, 1'b0}", "{{2{factor[BITS-1]}}, factor}"),
        ("the factor is the next one", "if (load) factor <= sum;", "factor <= sum;"),
    ):
        yield Mutant(breaks, "dac_spline_step", old, new, "cubic")
    for breaks, old, new in (
        ("a spline reads the idle bank", ".read_bank(bank), .phase(", ".read_bank(!bank), .phase("),
        ("the step beside a spline comes early", ".load(loads[WAIT])", ".load(loads[0])"),
        ("the phase beside a spline does not wait", ".tick(ticks[WAIT])", ".tick(ticks[0])"),
        ("the bank beside a spline does not wait", "CLOCKS(WAIT + 2)) with_phase", "CLOCKS(2)) with_phase"),
    ):
        yield Mutant(breaks, "dac_axis", old, new, "cubic")
    yield Mutant("a spline takes a tick in 12 clocks", "dac_sequencer", "SPLINE ? 11", "SPLINE ? 12", "cubic")
    yield Mutant(
        "a sample is over before its spline", "dac_sequencer", "Y_INTERPOLATED == 3 ? y_done : x_done", "y_done",
        "cubic low area",
    )  # fmt: skip
    for breaks, old, new in (
        ("b3 has no word 3", ", {2'd3, 3'd7}: {twice", ": {twice"),
        ("b3 has word 1 once", "{2'd3, 3'd3}, {2'd3, 3'd6}: ", "{2'd3, 3'd6}: "),
        ("b2 has word 1 four times", "{2'd2, 3'd4}, ", ""),
        ("b1 has word 0 once", "{2'd1, 3'd1}, {2'd1, 3'd6}: ", "{2'd1, 3'd6}: "),
        ("b0 has word 1 twice", "{2'd0, 3'd2}, {2'd0, 3'd3}: ", "{2'd0, 3'd2}: "),
        ("b3 adds word 2", "of_c0 || of_c2 :", "of_c0 :"),
        ("b2 adds word 1", "degree == 2'd2 ? of_c1", "degree == 2'd2 ? 1'b0"),
        ("b1 adds word 0", "degree == 2'd1 && of_c0", "1'b0"),
    ):
        yield Mutant(breaks, "dac_spline_terms", old, new, "cubic low area")
    for breaks, old, new in (
        ("words are halved", "<< degree << 1;", "<< degree;"),
        ("b0 is left out", "step == LAST_TERM && degree == 2'd0", "step == LAST_TERM && degree == 2'd1"),
        ("the fraction of a spline is halved", "fraction, 2'b00};", "1'b0, fraction, 1'b0};"),
        ("products of a spline are rounded down", "1'b1} << 19;", "1'b0} << 19;"),
        ("the last sample goes on", "step == SPLINE ? {BITS{1'b0}} : sum", "sum"),
        ("word 3 is word 2", "step == TERMS + 2 || step == LAST_TERM}", "step == TERMS + 2}"),
        ("word 2 is word 0", "step == TERMS + 3 || step == TERMS + 4 || ", ""),
        ("word 0 is not read", "        if (CUBIC != 0 && step == PRODUCT_END) m <= term_word;\n", ""),
        ("a product has nine digits", "PRODUCT_END = 6'd50", "PRODUCT_END = 6'd49"),
        (
            "b0 goes on in the next step",
            "next == FROM_HERE || (next >= TERMS && !next_once)",
            "next >= TERMS && !next_once",
        ),
        ("the degree of the last sample goes on", "left <= 2'd3;", "left <= left;"),
    ):
        yield Mutant(breaks, "dac_axis_serial", old, new, "cubic low area")


def _slow() -> Iterator[Mutant]:
    """What is worked out for a line, and which line of which program it is."""
    for file, faults in {
        "dac_slow_engine": (
            ("the ratio has no half", "fast_word, 12'h800}", "fast_word, 12'h000}"),
            ("a word does not saturate", "beyond ? limits ^ sign_bit : mixed", "mixed"),
            ("the second word has no sign",
             "                    bits_left <= 6'd7;\n                    is_signed <= 1'b1;",
             "                    bits_left <= 6'd7;\n                    is_signed <= 1'b0;"),
            ("the last word is not mixed", "if (word_ends) begin", "if (index[0] && &index[1:0]) begin"),
            ("the gain of the slow table has no sign", "bits_left <= 6'd17;\n                    is_signed <= 1'b1;",
             "bits_left <= 6'd17;\n                    is_signed <= 1'b0;"),
            ("a product of the spline is rounded down", "acc <= {{W-19{1'b0}}, 1'b1, 18'd0};", "acc <= {W{1'b0}};"),
            ("the spline goes on from the last one", "PLACE: acc <= {W{1'b0}};", "PLACE: acc <= acc;"),
            ("a ramp that falls is not cut off towards 0", "m[W-1] && q != 32'd0", "1'b0"),
            ("the ramp is that of the last line", "{{LINE_BITS{1'b0}}, state == SLOW_TAKE}", "{LINE_BITS+1{1'b0}}"),
            ("the offset is that of the next line", "state == SLOW_TAKE && !second_offset", "state == SLOW_TAKE"),
            ("the ratio is the gain", "   here <= of_ratio ?", "   here <= 1'b0 ?"),
            ("a word between knots is rounded down", "REDUCE: state <= count == 6'd17 ? HALF : DOUBLE;",
             "REDUCE: state <= count == 6'd17 ? BETWEEN : DOUBLE;"),
            ("there is one knot", "NEXT: begin\n                    knot <= knot + 1;", "NEXT: begin"),
            ("the gain is that of the last line", "state == BETWEEN && !of_ratio", "state == BETWEEN && of_ratio"),
            ("x is worked out twice", "axis <= 1'b1;", "axis <= axis;"),
            ("the slow table is not shorter", "~({SLOW_INDEX_BITS{1'b1}} << slow_bits)", "{SLOW_INDEX_BITS{1'b1}}"),
            ("the offset has no upper word", "SLOW_SUM: acc <= sum;", "SLOW_SUM: acc <= acc;"),
            ("the ramp has no last bit", "bits_left <= 6'd31;", "bits_left <= 6'd30;"),
        ),
        "dac_slow_divide": (
            ("a rest is not reduced after a sum", "else if (twice || reduce)", "else if (twice)"),
            ("both bits add nothing", "(add && here && there) || (reduce && reduces)", "reduce && reduces"),
            ("the words are swapped", "here ? whole_less_part : part", "here ? part : whole_less_part"),
            ("the rest of the search goes on", "rest <= {REST_BITS{1'b0}};", "rest <= rest;"),
        ),
        "dac_slow_axis": (
            ("the offset does not grow", "next_offset : at + by", "next_offset : at"),
            ("the ramp is the first one", "if (next) by <= next_ramp;", "if (next && !running) by <= next_ramp;"),
            ("the offset is written into the next line", "half ^ of_offset", "half"),
            ("a line goes on with the phase", ".restart(restarts)", ".restart(1'b0)"),
        ),
        "dac_slow_part": (
            ("the offset writes over the engine", "wire enable = ticks == 2'd0;", "wire enable = 1'b1;"),
            ("halves do not change", "half <= half ^ changes;", "half <= half;"),
            ("a program at rest leaves the half", "tick && (line || load)", "tick && line"),
            ("the lines are those of the other program", "bank ? lines_1 : lines_0;", "bank ? lines_0 : lines_1;"),
            ("the frame has no end", "line && after != playing_lines ?", "line ?"),
            ("the line of a commit is of the program that plays", "is_idle <= changes ? prepares : needs_idle;",
             "is_idle <= 1'b0;"),
            ("a new program begins with the line that is due", "changes ? preparing && from_0 : needs_first;", "1'b0;"),
            ("a scan begins with the line where the last one ended",
             "(needs_first != is_first && next_line != {LINE_BITS{1'b0}})", "1'b0"),
        ),
        "dac_slow_store": (
            ("the ratios are the gains", "part == RATIOS) ratios", "part == GAINS) ratios"),
            ("a table is written where it plays",
             "fast_words[{write_bank, write_axis,", "fast_words[{!write_bank, write_axis,"),
            ("both axes have one second table", "second <= second_words[{bank, axis, index}];",
             "second <= second_words[{bank, 1'b0, index}];"),
            ("words change while all stands still", "if (enable) begin", "begin"),
        ),
    }.items():  # fmt: skip
        for breaks, old, new in faults:
            yield Mutant(breaks, file, old, new, "slow")
    for breaks, file, old, new in (
        ("a frame goes on with the words of line 0", "dac_slow_part", "!keeps && !at_frame;", "!at_frame;"),
        ("a frame has words of the next scan", "dac_slow_part", "preparing && (!at_frame ||", "preparing && (1'b1 ||"),
        ("words are kept where the frame begins", "dac_sequencer", ".keeps(keep && same_frame)", ".keeps(keep)"),
        ("each mode begins a frame", "dac_sequencer", ".keeps(keep && same_frame)", ".keeps(1'b0)"),
    ):  # fmt: skip
        yield Mutant(breaks, file, old, new, "slow modes")
    for breaks, file, old, new in (
        ("remainders are lost with every line", "dac_slow_axis", ".begins(begin_waits)", ".begins(restarts)"),
        ("remainders of the last scan go on", "dac_slow_axis", ".begins(begin_waits)", ".begins(1'b0)"),
        ("the order of a line is not written", "dac_slow_engine", "state == COPY && count != 6'd0)",
         "state == COPY && count != 6'd0 && count != 6'd12)"),
        ("the sequencer has no order for x", "dac_slow_part", ".SHAPING(SHAPING), .POWER_UP_CODE(X_POWER_UP_CODE)",
         ".SHAPING(0), .POWER_UP_CODE(X_POWER_UP_CODE)"),
    ):  # fmt: skip
        yield Mutant(breaks, file, old, new, "slow scanner")


def _pair() -> Iterator[Mutant]:
    """Both axes by turns: whose flags, words and state are where, and the stages that are its own."""
    for file, faults in {
        "dac_pair": (
            ("a tick never waits for its turn", "waits <= tick && beat;", "waits <= 1'b0;"),
            ("y has the flags of another tick", "if (x_here) begin", "if (y_here) begin"),
            ("y reads the bank of the next tick", ".in(bank_0)", ".in(tick_bank)"),
            ("the bank is a clock early", ".CLOCKS(9)) with_phase", ".CLOCKS(8)) with_phase"),
            ("half a digit of a fraction is lost", "phase[17-Y_INDEX_BITS +: 15]", "phase[16-Y_INDEX_BITS +: 15]"),
            ("the code of x is not kept", "assign x = beat ? ~code_1 : ~code_2;", "assign x = ~code_1;"),
            ("the code of y is not kept", "assign y = beat ? ~code_inverse : ~code_1;", "assign y = ~code_inverse;"),
            ("x need not reach its target", "reached_1 && (beat ? code_reached : reached_2)", "reached_1"),
            ("codes move without a tick", "valid <= ticks;", "valid <= 1'b1;"),
            ("the park code comes a clock early", "RUNNING_AT = 37", "RUNNING_AT = 36"),
            ("x and y swap their gains", "load_hold <= is_gain;", "load_hold <= load_hold ^ is_gain;"),
        ),
        "dac_pair_words": (
            ("y has the high offset of x", "6'd30: {of_y, address} = {1'b1,", "6'd30: {of_y, address} = {1'b0,"),
            ("y parks with x", "6'd36: {of_y, address} = {1'b1,", "6'd36: {of_y, address} = {1'b0,"),
            ("the step is loaded a clock early", "assign is_step = was ==", "assign is_step = address =="),
            ("words of x and y are the same", "words[{write_y, write_address}]", "words[{1'b0, write_address}]"),
        ),
        "dac_pair_ring": (
            ("a loaded value does not stay", "other <= now;", "other <= load ? other : now;"),
        ),
        "dac_pair_delay": (("all is a clock late", "BEHIND = 65 -", "BEHIND = 64 -"),),
        "dac_pair_phase": (
            ("the remainder never wraps", "restart || !over[PERIOD_BITS] ? at_less", "restart ? at_less"),
            ("one more at every advance", "carry <= advances && wraps;", "carry <= advances;"),
            ("the rest grows without an advance", "by <= 0;", "by <= {1'b0, at_remainder};"),
            ("a line begins where the last one ended", "last <= restarts ? 32'd0 : phase;", "last <= phase;"),
            ("the phase goes on without an advance", "way <= advances ? at_step : 32'd0;", "way <= at_step;"),
        ),
        "dac_pair_table": (
            ("tables of x and y are the same", "{write_y, write_bank, write", "{1'b0, write_bank, write"),
            ("x reads the row of y", "read_y ? y_odd : x_odd", "y_odd"),
            ("even words are read from one bank", "{read_y, read_bank, next", "{read_y, 1'b0, next"),
        ),
        "dac_pair_interpolator": (
            ("interpolation rounds down", "{GUARD_BITS{1'b0}}, 1'b1} + step", "{GUARD_BITS{1'b0}}, 1'b0} + step"),
            ("the word is a clock early", ".CLOCKS(9)) start", ".CLOCKS(8)) start"),
        ),
        "dac_pair_output": (
            ("codes are rounded down", "half = {2'b01,", "half = {2'b00,"),
            ("odd digits of the gain are those of the other axis", "i % 2 == 0 ? held", "i % 2 != 2 ? held"),
            ("a low code is held at the other axis' limit", "is_low ? {1'b0, ~min_inverse_last}",
             "is_low ? {1'b0, ~min_inverse}"),
            ("a high code is held at the other axis' limit", "is_high ? ~max_inverse_last", "is_high ? ~max_inverse"),
            ("a low code clamps unseen", "clamps <= was_low_1 || is_high;", "clamps <= is_high;"),
        ),
        "dac_pair_slew": (
            ("a target comes without a tick", "target_1 <= valid ? ~target : target_2;", "target_1 <= ~target;"),
            ("the code goes on without a tick", "less <= 0;", "less <= less;"),
            ("the code goes back without a tick", "plus <= 0;", "plus <= plus;"),
            ("the code is of the other target", "target_4 <= target_3;", "target_4 <= target_2;"),
            ("it arrives a step early", "is_below = below[BITS+2];", "is_below = 1'b0;"),
        ),
    }.items():  # fmt: skip
        for breaks, old, new in faults:
            yield Mutant(breaks, file, old, new, "pair long table" if file == "dac_pair_phase" else "pair")
    yield Mutant(
        "one axis clamps unseen", "dac_pair", "clamped_1 || (beat ? code_clamped : clamped_2)",
        "(beat ? code_clamped : clamped_2)", "pair sweep",
    )  # fmt: skip
    yield Mutant(
        "the remainder is that of a clock before",
        "dac_pair",
        ".remainder(word_2[",
        ".remainder(word_3[",
        "pair long table",
    )
    for breaks, old, new in (
        ("the limit above is one lower", "{2'b11, max_inverse};", "{2'b11, max_inverse} + 1;"),
        ("the limit below is one higher", "{3'b111, min_inverse} + 1;", "{3'b111, min_inverse};"),
    ):
        yield Mutant(breaks, "dac_pair_output", old, new, "pair direct")
    for breaks, old, new in (
        ("the direct table is that of y", "beat ? X_INTERPOLATED == 0 : Y_INTERPOLATED == 0",
         "beat ? Y_INTERPOLATED == 0 : X_INTERPOLATED == 0"),
        ("a direct table has a word in two advances", "32'd1 << (32 - X_INDEX_BITS)", "32'd1 << (31 - X_INDEX_BITS)"),
    ):  # fmt: skip
        yield Mutant(breaks, "dac_pair", old, new, "pair direct")


def _pixels() -> Iterator[Mutant]:
    """Tables of pixels: what is played of them, and which of them are refused."""
    table = "dac_pixel_table"
    for breaks, file, old, new in (
        ("the pixel comes a clock late", "dac_sequencer", "LATENCY - PIXELS_AT", "LATENCY - PIXELS_AT + 1"),
        ("every program has a table", table, "uses_table ? imaging_3", "1'b1 ? imaging_3"),
        ("none has a table", table, "uses_table ? imaging_3", "1'b0 ? imaging_3"),
        ("the last program has a table still", table, "if (load_3) uses_table", "if (load_3 && reading) uses_table"),
        ("the new program has a table a clock early", table, "if (load_3) uses_table", "if (load_2) uses_table"),
        ("a table is that of the idle program", table, "if (take) next_uses_table", "if (load) next_uses_table"),
        ("a table that was taken is one of the next program", table, "has_table_now && !take", "has_table_now"),
        ("the bank is read a clock late", table, "if (load_2) reading", "if (load_3) reading"),
        ("the bank that plays is written", table, "write_table && reading)", "write_table && !reading)"),
        ("a word is that of the other bank", table, "word = reading ? word_1", "word = reading ? word_0"),
        ("pixels begin outside windows", table, "imaging_3 && starts", "starts"),
        ("a window goes on with the pixel before it", table, "starts = opens_3 || ended", "starts = ended"),
        ("a pixel does not end", table, "starts = opens_3 || ended", "starts = opens_3"),
        ("a pixel is a tick longer", table, "ended <= now == 16'd1", "ended <= now == 16'd0"),
        ("a pixel of one tick has three", table, "now = starts ? word", "now = starts ? word | (word == 1) << 1"),
        ("the first word is not read", table, "(tick_2 && opens_2) || (tick_3 && starts)", "(tick_3 && starts)"),
        ("no word is read after it", table, "(tick_2 && opens_2) || (tick_3 && starts)", "(tick_2 && opens_2)"),
        ("a word is read on each tick", table, "(tick_3 && starts);", "tick_3;"),
        ("words are read without ticks", table, "(tick_3 && starts);", "starts;"),
        ("the retrace has the words of the trace", table, "forward_opens ? {INDEX_BITS{1'b0}} : wide_pixels",
         "1'b1 ? {INDEX_BITS{1'b0}} : wide_pixels"),
        ("the trace has the words of the retrace", table, "forward_opens ? {INDEX_BITS{1'b0}} : wide_pixels",
         "1'b0 ? {INDEX_BITS{1'b0}} : wide_pixels"),
        ("the same word is read again", table, "ahead <= ahead + 1'b1", "ahead <= ahead"),
        ("a pixel without a table is a clock late", table, "if (tick_2) begin", "if (tick_3) begin"),
        ("a program without a table waits", table, "(commit && !has_table_now) ||", "1'b0 ||"),
        ("the check is over at its start", table, "(commit && !has_table_now) ||", "commit ||"),
        ("each word is tested", table, "tests <= !discard && fetched && !reads", "tests <= !discard && fetched"),
    ):  # fmt: skip
        yield Mutant(breaks, file, old, new, "pixels")
    for breaks, file, old, new in (
        ("a withdrawal does not end the check", table, "loads <= !discard && (", "loads <= ("),
        ("a check goes on after a withdrawal", table, "reads <= !discard && (", "reads <= ("),
        ("no table is refused", table, "(ends && is_wrong);", "1'b0;"),
        ("a refused table is taken", table, "ends && !is_wrong)", "ends)"),
        ("a refusal is not said", "dac_sequencer", "|| misfilled ||", "||"),
        ("what is not complete is read", table, "(loads && !in_backward && !complete) ||", "1'b0 ||"),
        ("a word may be missing", table, "written >= {wide_idle_pixels[INDEX_BITS-1:0], 1'b0}",
         "written + 1'b1 >= {wide_idle_pixels[INDEX_BITS-1:0], 1'b0}"),
        ("words that were taken count", table, "if (take)\n            written", "if (1'b0)\n            written"),
        ("a program without pixels has a table", table, "idle_pixels != 0 && wide", "wide"),
        ("a window has more pixels than a bank", table, "wide_idle_pixels <= MOST_PIXELS", "1'b1"),
        ("a pixel may have no tick", table, "checked == 16'd0 || ", ""),
        ("the trace may be longer than its window", table, "is_wrong = wrong || room != 0",
         "is_wrong = wrong || (in_backward ? room != 0 : room > 0)"),
        ("the trace may be shorter than its window", table, "is_wrong = wrong || room != 0",
         "is_wrong = wrong || (in_backward ? room != 0 : room < 0)"),
        ("the retrace may be longer than its window", table, "is_wrong = wrong || room != 0",
         "is_wrong = wrong || (in_backward ? room > 0 : room != 0)"),
        ("the retrace may be shorter than its window", table, "is_wrong = wrong || room != 0",
         "is_wrong = wrong || (in_backward ? room < 0 : room != 0)"),
        ("the retrace has the window of the trace", table, "in_backward ? backward_count : forward_count",
         "1'b0 ? backward_count : forward_count"),
        ("what was wrong with the trace is forgotten", table, "            wrong <= is_wrong;\n", ""),
        ("the next table is wrong too", table, "            wrong <= 1'b0;\n", ""),
        ("the next table is read from the end of the last", table, "            at <= 0;\n", ""),
        ("ticks are cut to 16 bits", table, "(write_table && write_data[31:16] != 16'd0)", "1'b0"),
        ("any word 14 is a table", table, "(write_word && write_data[31:1] != 31'd0) ||", "1'b0 ||"),
        ("a spoilt table stays spoilt", table, "if (take || discard)", "if (1'b0)"),
        ("writes meet the check", "dac_sequencer", "!checking && idle_writable", "idle_writable"),
        ("no word has a place", "dac_sequencer", "write_address >> PIXEL_INDEX_BITS == 0", "1'b0"),
        ("a table has no end", "dac_sequencer", "write_address >> PIXEL_INDEX_BITS == 0", "1'b1"),
    ):  # fmt: skip
        yield Mutant(breaks, file, old, new, "pixel tables")


MUTANTS: tuple[Mutant, ...] = (
    *_axis(), *_output(), *_scan(), *_modes(), *_markers(), *_verdict(), *_low_area(), *_fourier(), *_shaping(),
    *_cubic(), *_slow(), *_pair(), *_pixels(),
)  # fmt: skip


if __name__ == "__main__":
    mutants.print_list(judge, MUTANTS, "module", "bench")
