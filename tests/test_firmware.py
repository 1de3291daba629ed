"""The C sequencer on processors that it is for, emulated: unicorn in process, QEMU over its serial lines.

The scripts that the Verilog sequencer and the C one on this machine play are played by Cortex-M0+ to M7, by 64-bit
RISC-V and by 32-bit MIPS with the other byte order. The reference firmware boots, takes commands, and every sample
that it puts out is the model's. Interrupts land on every instruction of a main loop that swaps programs.
"""

import re
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from building import EXAMPLE, REMOVED, REPOSITORY, VARIANTS, Build, Variant, build, run, run_clean, write_variant
from c_benches import words_of
from c_scripts import IN_C, LONG, long_play, renderings, shape_in_c
from emulation import BOARDS, CmsdkBoard, Firmware, Pl011Board
from following import Differs, Follower, follow
from programs import random_dual
from qemu import Machine
from stream_scripts import sweep

from tablegen.config.load import load
from tablegen.fixedpoint.program import Program
from tablegen.plan import Plan, make_plan
from tablegen.resources import c_runtime
from tablegen.sequencer import DualProgram, Sequencer
from tablegen.verify.bench import Shape
from tablegen.verify.c_bench import OPTIONS, CBench, CPlayed
from tablegen.verify.emulate import TRAP, CortexMBench, Processor, compile_bare
from tablegen.verify.simulate import SimulationFailed
from tablegen.verify.stream import FLAGS, Script, compare, pack

FIRMWARE = REPOSITORY / "examples" / "firmware"
CORTEX_M = ("cortex-m0plus", "cortex-m3", "cortex-m4", "cortex-m7")
SHAPE = Shape(16, 1, 5, 16, 1, 4, 16)
SHAPES = (SHAPE, Shape(24, 1, 3, 8, 0, 4, 24))  # so many bits that tables and words are kept in 16, and in 32
FILL = 40
WITHOUT_FAULTS = (1 << 56) - 1


def zig(core: str) -> str:
    """The other compiler, for a Cortex-M; without -g it leaves no symbols."""
    return f"{sys.executable} -m ziglang cc -g -target thumb-freestanding-eabi -mcpu={core.replace('-', '_')}"


def options(level: str) -> tuple[str, ...]:
    return tuple(level if option == "-O2" else option for option in OPTIONS)


def hold(played: CPlayed, script: Script, fill: int) -> None:
    """Every tick and every count as the model has them; a fill tells faults at its end."""
    expected = [word & WITHOUT_FAULTS for word in script.expected] if fill else script.expected
    mismatch = compare(expected, played.record)
    assert mismatch is None, mismatch
    assert played.counts == [*script.counts, 0, 0]


# Scripts.


@pytest.fixture(scope="module")
def sweeps() -> dict[Shape, Script]:
    """Everything that a host may ask, the same for all processors."""
    return {shape: sweep(np.random.default_rng(7), shape, 1500) for shape in SHAPES}


@pytest.mark.parametrize("fill", [0, FILL], ids=["step", "fill"])
@pytest.mark.parametrize("level", ["-O2", "-Os"])
@pytest.mark.parametrize("compiler", ["gcc", "zig"])
@pytest.mark.parametrize("core", CORTEX_M)
def test_cortex_m_plays_everything_that_a_host_may_ask(
    sweeps: dict[Shape, Script], core: str, compiler: str, level: str, fill: int, tmp_path: Path
) -> None:
    for shape in SHAPES:
        script = sweeps[shape]
        bench = CortexMBench(
            shape, tmp_path, zig(core) if compiler == "zig" else None, options(level), fill=fill, core=core
        )
        hold(bench.run(words_of(script, shape)), script, fill)


@pytest.mark.parametrize("name", IN_C)
def test_cortex_m_plays_the_random_programs_of_the_other_sequencers(name: str, tmp_path: Path) -> None:
    configuration = IN_C[name]
    script = configuration.script(name)
    words = words_of(script, configuration.shape)
    for core, fill in (("cortex-m0plus", 0), ("cortex-m4", FILL)):
        hold(CortexMBench(configuration.shape, tmp_path, fill=fill, core=core).run(words), script, fill)


@pytest.mark.parametrize("name", LONG)
def test_cortex_m_plays_long_lines(name: str, tmp_path: Path) -> None:
    """Those that are played many ticks at once."""
    shape, script = LONG[name][0], long_play(name, 8000)
    words = words_of(script, shape)
    for core in ("cortex-m0plus", "cortex-m4"):
        hold(CortexMBench(shape, tmp_path, fill=200, core=core).run(words), script, 200)


@pytest.mark.parametrize("core", [*CORTEX_M, "riscv64"])
def test_tables_are_rendered_from_fourier_words(core: str, tmp_path: Path) -> None:
    shape = shape_in_c(SHAPE)
    script = renderings(shape, 12, 9)
    hold(CortexMBench(shape, tmp_path, core=core).run(words_of(script, shape, fourier=True)), script, 0)


@pytest.mark.parametrize("fill", [0, FILL], ids=["step", "fill"])
@pytest.mark.parametrize("level", ["-O2", "-Os"])
def test_64_bit_risc_v(sweeps: dict[Shape, Script], level: str, fill: int, tmp_path: Path) -> None:
    for shape, script in sweeps.items():
        bench = CortexMBench(shape, tmp_path, options=options(level), fill=fill, core="riscv64")
        hold(bench.run(words_of(script, shape)), script, fill)


@pytest.mark.parametrize("fill", [0, FILL], ids=["step", "fill"])
def test_big_endian_mips(sweeps: dict[Shape, Script], fill: int, tmp_path: Path) -> None:
    for shape, script in sweeps.items():
        bench = CBench(shape, tmp_path, "mips-linux-gnu-gcc", (*OPTIONS, "-static"), fill=fill)
        assert bench.program.read_bytes()[5] == 2, "the executable's bytes are in the other order"
        executable = bench.program.rename(tmp_path / "bench.elf")
        run_clean(["qemu-mips", "-version"])
        bench.program.write_text(f'#!/bin/sh\nexec qemu-mips "{executable}"\n')
        bench.program.chmod(0o755)
        hold(bench.run(words_of(script, shape)), script, fill)


# A sum rounded down, which few programs show; a swap that does not wait for the end of a line.
BREAKS = {
    "half an LSB": ("dac_program.c", "p->offset_word + ((int64_t)1 << (p->gain_q - 1))", "p->offset_word"),
    "mid-line": ("dac_sequencer.c", "(s->running && s->tick != 0)", "false"),
}


def broken(folder: Path, file: str, old: str, new: str) -> list[Path]:
    """The runtime with one change."""
    folder.mkdir()
    copies = []
    for path in c_runtime():
        text = path.read_text("utf-8")
        if path.name == file:
            assert text.count(old) == 1, f"{file} has {text.count(old)} times: {old}"
            text = text.replace(old, new)
        copies.append(folder / path.name)
        copies[-1].write_text(text, "utf-8")
    return copies


@pytest.mark.parametrize("name", BREAKS)
def test_a_broken_sequencer_is_found(sweeps: dict[Shape, Script], name: str, tmp_path: Path) -> None:
    """A negative control of all of the above."""
    bench = CortexMBench(SHAPE, tmp_path, sources=broken(tmp_path / "broken", *BREAKS[name]))
    with pytest.raises((AssertionError, SimulationFailed)):
        hold(bench.run(words_of(sweeps[SHAPE], SHAPE)), sweeps[SHAPE], 0)


def test_a_bench_that_is_refused_says_what(tmp_path: Path) -> None:
    script = Script()
    script.request("commit", program=random_dual(np.random.default_rng(1), SHAPE))
    with pytest.raises(SimulationFailed, match="load"):
        CortexMBench(SHAPE, tmp_path).play(script)


# Instructions and stack.


def test_instructions_and_stack_of_a_call_are_counted(tmp_path: Path) -> None:
    """Held against a function whose assembly is known."""
    source = tmp_path / "known.c"
    source.write_text(
        "void bench_main(void);\nvoid bench_main(void) { }\n"
        "unsigned __attribute__((naked, used)) loop(unsigned n);\n"
        "unsigned __attribute__((naked, used)) loop(unsigned n)\n{\n"
        '    __asm__("push {r4, r5, r6, lr}\\n"\n'
        '            "1: subs r0, #1\\n"\n'
        '            "bne 1b\\n"\n'
        '            "pop {r4, r5, r6, pc}\\n");\n'
        "}\n"
    )
    executable = compile_bare(tmp_path / "known.elf", [source], "cortex-m4", options=("-O2",))
    processor = Processor(executable, "cortex-m4")
    for times in (1, 2, 50):
        called = processor.call("loop", times)
        assert (called.result, called.instructions, called.stack) == (0, 2 + 2 * times, 16)


# Interrupts on every instruction.

PRODUCER = ("dac_sequencer_load", "dac_sequencer_commit", "dac_sequencer_withdraw", "dac_sequencer_trigger")


def c_axis(program: Program, table: str) -> str:
    """A program of an axis as C initialises it."""
    output = program.output
    values = [
        table, len(program.words), program.bits,
        (len(program.words) - 1).bit_length() if program.mode == "interpolated" else 0,
        program.phase.ticks, program.hold, output.gain_word, f"INT64_C({output.offset_word})", output.gain_q,
        output.code_min, output.code_max, output.park_code, output.max_step, output.dac_bits, output.word_bits, 0, 0,
    ]  # fmt: skip
    return "{" + ", ".join(map(str, values)) + "}"


def c_programs(programs: Sequence[DualProgram], rounds: int) -> str:
    """A header with programs of 16 bits."""
    lines = [f"enum {{ PROGRAMS = {len(programs)}, ROUNDS = {rounds} }};"]
    rows = []
    for number, program in enumerate(programs):
        for axis in ("x", "y"):
            words = ", ".join(map(str, getattr(program, axis).words.tolist()))
            lines.append(f"static const dac_word {axis}_{number}[] = {{{words}}};")
        s = program.schedule
        windows = [f"{{{w.first}, {w.count}}}" for w in (s.forward, s.backward, s.up, s.down)]
        counts = [s.ticks, s.lines, s.pixels, s.settle_lines, s.turn_tick]
        axes = [c_axis(program.x, f"x_{number}"), c_axis(program.y, f"y_{number}")]
        schedule = "{" + ", ".join([*map(str, counts), *windows]) + "}"
        rows.append("{" + ", ".join([schedule, *axes]) + "}")
    lines.append("static const dac_program programs[] = {" + ",\n    ".join(rows) + "};")
    lines.append("static const dac_converter x_converter = {16, 16, 0, 0, 0}, y_converter = {16, 16, 0, 0, 0};")
    return "\n".join(lines) + "\n"


class Landings:
    """A main loop that is interrupted on every instruction that it executes, once each, and at random."""

    def __init__(self, folder: Path, programs: list[DualProgram], sources: Sequence[Path], rounds: int) -> None:
        import unicorn

        folder.mkdir(exist_ok=True)
        (folder / "programs.h").write_text(c_programs(programs, rounds))
        source = folder / "landings.c"
        source.write_text((REPOSITORY / "tests" / "landings.c").read_text("utf-8"), "utf-8")
        support = folder / "support.c"  # the processor has no C library
        memory = (REPOSITORY / "tablegen" / "verify" / "stream_bench_memory.c").read_text("utf-8")
        start = memory.index("/* The barriers")
        support.write_text("#include <stddef.h>\nvoid bench_main(void);\nvoid bench_main(void) { }\n" + memory[start:])
        self.programs = programs
        self.processor = Processor(compile_bare(folder / "landings.elf", [*sources, source, support]))
        self.landed: set[int] = set()
        self.landings = 0
        self._unicorn = unicorn

    def share_of(self, address: int, size: int) -> float:
        """Of the instructions of a function, how many were landed on; literals after its code count too."""
        code = np.frombuffer(bytes(self.processor.uc.mem_read(address, size)), dtype="<u2")
        at = instructions = landed = 0
        while at < len(code):
            instructions += 1
            landed += address + 2 * at in self.landed
            at += 2 if code[at] >> 11 >= 0b11101 else 1
        return landed / instructions

    def play(self, seed: int, share: float) -> Follower:
        """Run the main loop to its end; each landing is a tick, held against the model."""
        from unicorn import arm_const

        uc, processor = self.processor.uc, self.processor
        processor.call("power_up")
        rng = np.random.default_rng(seed)
        low, high = 0x10000, 0x10000 + (1 << 24)
        state = {"main": True, "resumed": -1}

        def code(uc: object, address: int, size: int, data: object) -> None:
            if not state["main"]:
                return
            again, state["resumed"] = address == state["resumed"], -1
            if again:
                return
            if address not in self.landed or rng.random() < share:
                self.landed.add(address)
                processor.uc.emu_stop()

        follower = Follower(Sequencer(None))
        uc.reg_write(arm_const.UC_ARM_REG_SP, processor.stack_top)
        pc, end = processor.symbol("main_loop"), processor.symbol("landing_end")
        hook = uc.hook_add(self._unicorn.UC_HOOK_CODE, code, begin=low, end=high)
        while True:
            uc.emu_start(pc | 1, end)
            pc = uc.reg_read(arm_const.UC_ARM_REG_PC)
            if pc == end:
                uc.hook_del(hook)
                return follower
            state["main"] = False
            self.landings += 1
            before = uc.context_save()
            top = processor.stack_top
            processor.stack_top = (uc.reg_read(arm_const.UC_ARM_REG_SP) - 32) & ~7
            uc.reg_write(arm_const.UC_ARM_REG_XPSR, 0x01000000)
            self._interrupt(follower)
            processor.stack_top = top
            uc.context_restore(before)
            state |= {"main": True, "resumed": pc}

    def _interrupt(self, follower: Follower) -> None:
        processor = self.processor
        uc = processor.uc
        from unicorn import arm_const

        uc.reg_write(arm_const.UC_ARM_REG_SP, processor.stack_top)
        uc.reg_write(arm_const.UC_ARM_REG_LR, TRAP | 1)
        processor.run(processor.symbol("interrupt"), TRAP)
        word = int.from_bytes(processor.read("ticked"), "little")
        tick = follower.hear(word >> 48 & 255, lambda: self.programs[processor.word("loaded")])
        if pack(tick) != word:
            raise Differs(f"tick {follower.ticks}: {word:#018x} is not {pack(tick):#018x}")


def landing_programs() -> list[DualProgram]:
    rng = np.random.default_rng(11)
    return [random_dual(rng, SHAPE, (8, 12), kind="smooth", lines=(2, 3)) for _ in range(5)]


def test_an_interrupt_may_land_on_any_instruction(tmp_path: Path) -> None:
    landings = Landings(tmp_path, landing_programs(), c_runtime(), 40)
    swaps = 0
    for seed in range(3):
        follower = landings.play(seed, 0.05)
        swaps += follower.swaps
    assert landings.landings > 3000
    assert swaps > 50
    symbols, sizes = landings.processor.executable.symbols, landings.processor.executable.sizes
    for name in PRODUCER:
        first = symbols[name] & ~1
        share = landings.share_of(first, sizes[name])
        assert share > 0.7, (name, share)  # the rest refuses programs, and is not executed


# The bank is offered before it is written; it is written although it waits.
PROTOCOL_BREAKS = {
    "offered first": (
        "dac_program.c",
        "    dac_bank *const bank = &s->bank[dac_sequencer_idle(s)];\n",
        "    dac_bank *const bank = &s->bank[dac_sequencer_idle(s)];\n"
        "    s->loaded = 1;\n    s->loaded_after = s->swaps;\n    (void)dac_sequencer_commit(s);\n",
    ),
    "written while it waits": (
        "dac_sequencer.c",
        "    if (s->commits_answered != s->commits)\n        return false;",
        "    if (s->commits_answered != s->commits + 1u)\n        return true;",
    ),
}


@pytest.mark.parametrize("name", PROTOCOL_BREAKS)
def test_a_broken_protocol_is_found(name: str, tmp_path: Path) -> None:
    sources = broken(tmp_path / "broken", *PROTOCOL_BREAKS[name])
    landings = Landings(tmp_path / "landings", landing_programs(), sources, 120)
    with pytest.raises(Differs):
        landings.play(0, 0.05)


# The reference firmware.

SHORT = {**VARIANTS["short_frame"].scan, "limits": REMOVED}  # which coarse converters break
PLAYED: dict[str, Variant] = {
    "bits_16": Variant(SHORT),
    "bits_8": Variant({**SHORT, "x.table.bits": 8, "y.table.bits": 8, "dac.bits": 8}),
    "bits_18": Variant({**SHORT, "x.table.bits": 18, "y.table.bits": 18, "dac.bits": 18}),
    "bits_24": Variant({**SHORT, "x.table.bits": 24, "y.table.bits": 24, "dac.bits": 24, "x.table.length": 512}),
    "header_only": Variant({**SHORT, "emit.header_only": True}),
    "direct": Variant({**SHORT, "x.table": {"mode": "direct", "bits": 16}, "y.table": {"mode": "direct", "bits": 12}}),
    "steps": Variant(
        {
            **SHORT,
            "timing": {"pixels": 40, "lines": 8, "line_rate_hz": 100.0, "ticks_per_line": 331},
            "dac.update_rate_hz": 50e3,
            "y.motion": "step",
            "y.band_limit.harmonics": 3,
        }
    ),
    "twos_complement": Variant({**SHORT, "dac.coding": "twos-complement"}),
    "left_aligned": Variant(
        {**SHORT, "dac.bits": 18, "dac.word_bits": 24, "dac.align": "left", "dac.coding": "twos-complement"}
    ),
}


def make_firmware(folder: Path, scan: Path, board: str, player: str, *more: str) -> Path:
    """The firmware as its Makefile makes it."""
    target = folder / f"{board}-{player}"
    run_clean(
        ["make", "-C", FIRMWARE / "cortex_m", f"BOARD={board}", f"SCAN={scan}", f"PLAYER={player}", f"BUILD={target}",
         f"TABLEGEN={sys.executable} -m tablegen", *more]
    )  # fmt: skip
    return target / "firmware.elf"


def firmware(folder: Path, name: str, board: str, player: str) -> tuple[Path, Plan]:
    scan = write_variant(folder, PLAYED[name])
    return make_firmware(folder, scan, board, player), make_plan(load(scan))


def after_status(lines: Sequence[str]) -> dict[str, int]:
    """The counts of the last status."""
    words = next(line for line in reversed(lines) if " swaps " in line).split()[1:]
    return dict(zip(words[::2], map(int, words[1::2]), strict=True))


@pytest.mark.parametrize("player", ["step", "fill"])
@pytest.mark.parametrize("name", PLAYED)
def test_firmware_in_process_plays_two_frames_and_swaps_in_the_middle(name: str, player: str, tmp_path: Path) -> None:
    board = BOARDS[list(PLAYED).index(name) % 2]()
    executable, plan = firmware(tmp_path, name, board.name, player)
    machine = Firmware(board, executable, np.random.default_rng(3))
    machine.boot()
    for line in ("status", "arm 1", "trigger"):
        machine.send(line)
    frame, settled = plan.schedule.frame_ticks, 300
    for _ in range(settled + frame):
        machine.tick(700)
    machine.send("arm 2")
    machine.send("trigger")
    for _ in range(frame // 2):
        machine.tick(700)
    machine.send("swap")
    for _ in range(2 * frame + settled):
        machine.tick(700)
    machine.send("status")
    for _ in range(3000):
        machine.tick(700)
        if machine.console[-1].startswith("parked") and len(machine.samples) > 3 * frame:
            break
    follower = follow_two_scans(machine.samples, plan)
    assert machine.console[0] == "ready"
    assert [line for line in machine.console if line.startswith("error")] == []
    counts = after_status(machine.console)
    assert counts["swaps"] == follower.swaps == 2
    assert counts["faults"] == counts["slew"] == counts["clamp"] == counts["underrun"] == 0


def follow_two_scans(samples: Sequence[str], plan: Plan) -> Follower:
    """One frame, then another scan without a count that the model would know: the swap begins its frame again."""
    follower = follow(samples, plan, 0)
    playing = [int(sample.split()[2], 16) >> 6 & 1 for sample in samples]
    assert sum(playing) > 2 * plan.schedule.frame_ticks
    first = playing.index(1)
    assert playing[first : first + plan.schedule.frame_ticks + 1] == [1] * plan.schedule.frame_ticks + [0]
    return follower


DAC_SWAPPED, DAC_PLAYING, DAC_PARKED = (1 << FLAGS.index(name) for name in ("swapped", "playing", "parked"))


def markers(sample: str) -> int:
    """Those of a line of the log."""
    return int(sample.split()[2], 16)


def listen(machine: Machine, until: int, times: int = 1) -> list[str]:
    """The log until a marker was high so many times; what is read is behind what is played."""
    samples = []
    while times:
        samples.append(machine.sample())
        times -= bool(markers(samples[-1]) & until)
    return samples


@pytest.mark.parametrize("player", ["step", "fill"])
@pytest.mark.parametrize("board", BOARDS, ids=lambda board: board.name)
@pytest.mark.parametrize("name", ["bits_16", "left_aligned", "direct"])
def test_firmware_in_qemu_plays_two_frames_and_swaps_in_the_middle(
    name: str, board: type[Pl011Board | CmsdkBoard], player: str, tmp_path: Path
) -> None:
    executable, plan = firmware(tmp_path, name, board.name, player)
    frame = plan.schedule.frame_ticks
    with Machine(board.machine, executable) as machine:
        assert machine.console() == "ready"
        assert machine.ask("arm 1") == "ok"
        assert machine.ask("trigger") == "ok"
        samples = listen(machine, until=DAC_PLAYING, times=frame)
        samples += listen(machine, until=DAC_PARKED)
        assert machine.ask("arm 0") == "ok"
        assert machine.ask("trigger") == "ok"
        samples += listen(machine, until=DAC_PLAYING, times=frame // 2)
        assert machine.ask("swap") == "ok"
        samples += listen(machine, until=DAC_SWAPPED)
        samples += listen(machine, until=DAC_PLAYING, times=frame + frame // 3)
        assert machine.ask("park") == "ok"
        samples += listen(machine, until=DAC_PARKED)
        counts = after_status([machine.ask("status")])
    assert int(samples[[bool(markers(s) & DAC_SWAPPED) for s in samples].index(True, 10)].split()[2], 16) & DAC_PLAYING
    follower = follow_two_scans(samples, plan)
    assert counts["swaps"] == follower.swaps == 2
    assert counts["faults"] == counts["slew"] == counts["clamp"] == counts["underrun"] == 0


def test_the_console_says_what_is_wrong(tmp_path: Path) -> None:
    executable, _ = firmware(tmp_path, "bits_16", "lm3s6965evb", "step")
    with Machine("lm3s6965evb", executable) as machine:
        assert machine.console() == "ready"
        for line in ("arm", "arm x", "arm 1x", "arm 1234567890", "armed 1", "nonsense", "swapp"):
            assert machine.ask(line).startswith("error: "), line
        for line in ("arm 0", "park", "reset", "clear", "withdraw", "trigger"):
            assert machine.ask(line) == "ok"
        assert machine.ask("x" * 300).startswith("error: ")
        assert " swaps 1 " in machine.ask("status")


def test_a_log_with_one_wrong_code_is_found(tmp_path: Path) -> None:
    """A negative control of ``follow``."""
    board = Pl011Board()
    executable, plan = firmware(tmp_path, "bits_16", board.name, "step")
    machine = Firmware(board, executable, np.random.default_rng(3))
    machine.boot()
    for line in ("arm 1", "trigger"):
        machine.send(line)
    for _ in range(600):
        machine.tick(700)
    samples = machine.samples
    follow(samples, plan, 0)
    x, rest = samples[400].split(" ", 1)
    for wrong in (f"{int(x, 16) ^ 1:06x} {rest}", samples[400][:-2] + "f0"):
        with pytest.raises(Differs, match="tick 400"):
            follow([*samples[:400], wrong, *samples[401:]], plan, 0)


@pytest.mark.parametrize("level", ["-Os", "-O3"])
def test_the_firmware_compiles_at_other_levels(level: str, tmp_path: Path) -> None:
    make_firmware(tmp_path, EXAMPLE, "mps2_an386", "fill", f"CFLAGS={level}")


# Ports: compiled as far as there are compilers, and the AVR simulated.

WARNINGS = ("-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wsign-conversion", "-Werror")
SLOW_12_BITS = Variant(
    {
        "limits": REMOVED,
        "dac.bits": 12,
        "dac.update_rate_hz": 2000.0,
        "timing": {"pixels": 40, "lines": 8, "line_rate_hz": 2.0, "ticks_per_line": 1000},
        "x.table.length": 256,
        "y.table.length": 128,
        "y.band_limit.harmonics": 16,
    }
)
AVR_HZ, AVR_UPDATE_HZ = 16_000_000, 2000


@pytest.mark.parametrize("level", ["-O2", "-Os"])
@pytest.mark.parametrize("port", ["stm32", "rp2040"])
def test_a_port_compiles(port: str, level: str, tmp_path: Path) -> None:
    run_clean(
        ["make", "-C", FIRMWARE / port, f"BUILD={tmp_path / port}", f"CFLAGS={level}",
         f"TABLEGEN={sys.executable} -m tablegen"]
    )  # fmt: skip
    assert (tmp_path / port / "firmware.elf").is_file()


def test_the_scan_of_a_port_has_its_converter_checked(tmp_path: Path) -> None:
    """A negative control: 16 bits for the 12 of an STM32F4."""
    done = run(
        ["make", "-C", FIRMWARE / "stm32", f"BUILD={tmp_path / 'stm32'}", f"SCAN={EXAMPLE}",
         f"TABLEGEN={sys.executable} -m tablegen"]
    )  # fmt: skip
    assert done.returncode != 0
    assert "twelve_bits_right_aligned" in done.stderr


@pytest.fixture(scope="module")
def sketch(tmp_path_factory: pytest.TempPathFactory) -> Build:
    """The Arduino sketch with its build beside it."""
    folder = tmp_path_factory.mktemp("sketch")
    built = build(folder, SLOW_12_BITS)
    built.folder.rename(folder / "src")
    text = (FIRMWARE / "arduino" / "scan_player" / "scan_player.ino").read_text("utf-8")
    (folder / "scan_player.ino").write_text(text, "utf-8")
    return replace(built, folder=folder)


ARDUINOS = {
    "avr": ("avr-g++", "-std=gnu++11", "-mmcu=atmega2560", "-DF_CPU=16000000UL"),
    "teensy": ("arm-none-eabi-g++", "-std=gnu++17", "-mcpu=cortex-m7", "-mthumb", "-ffreestanding", "-D__IMXRT1062__"),
}


@pytest.mark.parametrize("board", ARDUINOS)
def test_the_arduino_sketch_compiles(sketch: Build, board: str, tmp_path: Path) -> None:
    headers = REPOSITORY / "tests" / "arduino"
    run_clean(
        [*ARDUINOS[board], *WARNINGS, "-O2", f"-I{headers}", "-x", "c++", "-c", sketch.folder / "scan_player.ino",
         "-o", tmp_path / "sketch.o"]
    )  # fmt: skip


def test_avr_plays_the_scan_in_time(sketch: Build, tmp_path: Path) -> None:
    """Every tick is the model's, and takes fewer cycles than there are between two interrupts."""
    ticks, executable = 2600, tmp_path / "avr.elf"
    source, sources = REPOSITORY / "tests" / "avr_step.c", sorted((sketch.folder / "src").glob("*.c"))
    run_clean(
        ["avr-gcc", "-std=c99", "-mmcu=atmega2560", "-O2", *WARNINGS, f"-DTICKS={ticks}",
         f"-I{sketch.folder / 'src'}", source, *sources, "-o", executable]
    )  # fmt: skip
    done = run(["simavr", "-m", "atmega2560", "-f", str(AVR_HZ), executable])
    shown = re.sub(r"\x1b\[[0-9;]*m", "", done.stdout + done.stderr)  # simavr colours, and cuts, what a UART sends
    lines = re.findall(r"[0-9a-f]{6} [0-9a-f]{6} [0-9a-f]{2} [0-9a-f]{4}", shown)
    assert len(lines) == ticks
    follow([line[:-5] for line in lines], sketch.plan, 1)
    assert max(int(line[-4:], 16) for line in lines) < AVR_HZ / AVR_UPDATE_HZ / 2
