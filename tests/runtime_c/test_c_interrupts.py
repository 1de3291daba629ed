"""Interrupts of the C sequencer's consumer on every instruction of a main loop that swaps programs, emulated."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from building import REPOSITORY
from c_faults import Mutant
from c_mutants import runtime_with
from following import Differs, Follower
from programs import random_dual

from tablegen.base.resources import c_runtime
from tablegen.device.dual_program import DualProgram
from tablegen.device.sequencer import Sequencer
from tablegen.fixedpoint.program import Program
from tablegen.verification.c.emulate import TRAP, Processor, compile_bare
from tablegen.verification.play.sequencer_shape import SequencerShape
from tablegen.verification.play.stream import pack

pytestmark = pytest.mark.rest

SHAPE = SequencerShape(16, 1, 5, 16, 1, 4, 16)
PRODUCER = ("dac_sequencer_load", "dac_sequencer_commit", "dac_sequencer_withdraw", "dac_sequencer_trigger")


def c_axis(program: Program, table: str) -> str:
    """A program of an axis as C initialises it."""
    output = program.output
    values = [
        table, len(program.words), 16, program.bits,
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
            table = getattr(program, axis).words.tolist()
            words = ", ".join(map(str, [*table, table[0]]))
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
        source.write_text((REPOSITORY / "tests" / "helpers" / "landings.c").read_text("utf-8"), "utf-8")
        support = folder / "support.c"  # the processor has no C library
        memory = (REPOSITORY / "tablegen" / "verification" / "c" / "stream_bench_memory.c").read_text("utf-8")
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
    sources = runtime_with(Mutant(name, *PROTOCOL_BREAKS[name]), tmp_path / "broken")
    landings = Landings(tmp_path / "landings", landing_programs(), sources, 120)
    with pytest.raises(Differs):
        landings.play(0, 0.05)
