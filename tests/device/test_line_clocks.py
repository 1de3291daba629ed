"""The firmware of ``examples/firmware/soft_core`` reckons the clocks of a line as the model does.

It refuses lines that are shorter than the working-out of the next one, by a formula of its own in C.
"""

from ctypes import CDLL, c_uint32
from pathlib import Path

import numpy as np
from building import REPOSITORY, run_clean
from frame_programs import scan_program
from programs import random_schedule
from replacing import replace

from tablegen.base.resources import c_runtime
from tablegen.device.clocks import slow_line_clocks
from tablegen.device.dual_program import ScanProgram
from tablegen.fixedpoint.frame_program import FrameProgram, Knots
from tablegen.fixedpoint.interpolation import index_bits_of
from tablegen.verification.play.sequencer_shape import SequencerShape

FIRMWARE = REPOSITORY / "examples" / "firmware"
BUS = REPOSITORY / "firmware_templates" / "verilog" / "bus"
HOST = """
#include "sequencer_registers.c"

dac_loaded __real_dac_sequencer_load(dac_sequencer *s, const dac_program *program)
{
    (void)s;
    (void)program;
    return DAC_BUSY;
}

uint32_t clocks(uint32_t length, uint32_t knots, uint32_t slow_bits)
{
    const dac_slow_part slow = {.gain_knots = (uint8_t)knots, .index_bits = (uint8_t)slow_bits};
    const dac_axis_program axis = {.length = length, .slow = &slow};
    return line_clocks(&axis);
}

uint32_t long_enough(uint32_t line_ticks, uint32_t length, uint32_t knots, uint32_t slow_bits)
{
    const dac_slow_part slow = {.gain_knots = (uint8_t)knots, .index_bits = (uint8_t)slow_bits};
    const dac_axis_program axis = {.length = length, .slow = &slow};
    const dac_program program = {.schedule = {.line_ticks = line_ticks}, .x = axis, .y = axis};
    return line_is_long_enough(&program);
}
"""
CLOCKS_PER_TICK = 100
OPTIONS = ("-DDAC_SLOW_PART=1", "-DDAC_SPLINE=1", "-DDAC_COMMIT_MODES=1", f"-DCLOCKS_PER_TICK={CLOCKS_PER_TICK}",
           "-DSCAN=scan", "-DSCAN_UPPER=SCAN")  # fmt: skip


def compiled(folder: Path, right: str = "", wrong: str = "") -> CDLL:
    """Compile the firmware's side of the registers for the host, with a text of it replaced."""
    folder.mkdir()
    text = (FIRMWARE / "soft_core" / "sequencer_registers.c").read_text("utf-8")
    assert not right or text.count(right) == 1
    (folder / "sequencer_registers.c").write_text(text.replace(right, wrong) if right else text, "utf-8")
    (folder / "host.c").write_text(HOST, "utf-8")
    folders = [folder, FIRMWARE / "soft_core", FIRMWARE / "common", BUS, c_runtime()[0].parent]
    library = folder / "host.so"
    includes = [f"-I{each}" for each in folders]
    run_clean(["gcc", "-shared", "-fPIC", "-O1", "-w", *OPTIONS, *includes, folder / "host.c", "-o", library])
    return CDLL(str(library))


def random_program(rng: np.random.Generator) -> ScanProgram:
    """A program with slow parts of any sizes on both axes."""
    bits = [int(each) for each in rng.integers(3, 8, 2)]
    shape = SequencerShape(16, 3, bits[0], 16, 3, bits[1], 16)
    program = scan_program(rng, shape, replace(random_schedule(rng, 20, 1), lines=2))

    def resized(axis: object) -> FrameProgram:
        assert isinstance(axis, FrameProgram)
        knots = Knots(np.zeros(int(rng.integers(2, 66)), dtype=np.int64), 2)
        slow = np.zeros(1 << int(rng.integers(3, 15)), dtype=np.int64)
        return replace(axis, gains=knots, slow=replace(axis.slow, words=slow))

    return replace(program, x=resized(program.x), y=resized(program.y))


def differences(library: CDLL, seed: int = 1, programs: int = 100) -> int:
    """Return of how many random programs the clocks are not the model's."""
    library.clocks.restype = c_uint32
    rng = np.random.default_rng(seed)
    differing = 0
    for _ in range(programs):
        program = random_program(rng)
        clocks = 0
        for axis in (program.x, program.y):
            assert isinstance(axis, FrameProgram)
            sizes = len(axis.fast.words), len(axis.gains.words), index_bits_of(len(axis.slow.words))
            clocks += library.clocks(*map(c_uint32, sizes))
        differing += clocks != slow_line_clocks(program)
    return differing


def test_the_clocks_of_a_line_are_those_of_the_model(tmp_path: Path) -> None:
    library = compiled(tmp_path / "as_it_is")
    assert differences(library) == 0
    # The next line is worked out in all clocks but two of each tick.
    least = -(-2 * library.clocks(64, 17, 6) // (CLOCKS_PER_TICK - 2))
    assert [library.long_enough(ticks, 64, 17, 6) for ticks in (least - 1, least)] == [0, 1]


def test_other_clocks_are_found(tmp_path: Path) -> None:
    """A control: four terms of the formula, each a little wrong."""
    wrong = {
        "467 + 2": "466 + 2",
        "2 * (p->slow->gain_knots - UINT32_C(2))": "2 * (p->slow->gain_knots - UINT32_C(1))",
        "2u * p->slow->index_bits": "1u * p->slow->index_bits",
        "11 * p->length": "10 * p->length",
    }
    for number, (right, other) in enumerate(wrong.items()):
        assert differences(compiled(tmp_path / f"{number}", right, other), programs=10) == 10, right
