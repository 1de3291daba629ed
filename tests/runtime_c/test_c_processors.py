"""The C sequencer on processors that it is for, emulated: by unicorn in process, MIPS by QEMU.

The scripts that the Verilog sequencer and the C one on this machine play are played by Cortex-M0+ to M33, by RISC-V of
32 and 64 bits, and by 32-bit MIPS with the other byte order.
"""

import sys
from collections.abc import Callable
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from building import run_clean
from c_benches import words_of
from c_faults import Mutant
from c_mutants import runtime_with
from c_scripts import IN_C, LONG, long_play, renderings, shape_in_c
from programs import random_dual
from sets import long, one_of
from stream_scripts import sweep

from tablegen.verification.c.bench import OPTIONS, CBench, CRecord, defines
from tablegen.verification.c.emulate import CortexMBench, Processor, compile_bare
from tablegen.verification.failures import SimulationFailed
from tablegen.verification.play.sequencer_shape import SequencerShape
from tablegen.verification.play.stream import Script, compare

pytestmark = pytest.mark.rest

CORTEX_M = ("cortex-m0plus", "cortex-m3", "cortex-m4", "cortex-m7", "cortex-m33")
RISC_V = ("riscv32", "riscv64")
SHAPE = SequencerShape(16, 1, 5, 16, 1, 4, 16)
SHAPES = (SHAPE, SequencerShape(24, 1, 3, 8, 0, 4, 24))  # so many bits that tables and words are kept in 16, and in 32
FILL = 40
Compile = Callable[..., CortexMBench]
WITHOUT_FAULTS = (1 << 56) - 1


def zig(core: str) -> str:
    """The other compiler, for a Cortex-M; without -g it leaves no symbols."""
    return f"{sys.executable} -m ziglang cc -g -target thumb-freestanding-eabi -mcpu={core.replace('-', '_')}"


def options(level: str) -> tuple[str, ...]:
    return tuple(level if option == "-O2" else option for option in OPTIONS)


def hold(played: CRecord, script: Script, fill: int) -> None:
    """Every tick and every count as the model has them; a fill tells faults at its end."""
    expected = [word & WITHOUT_FAULTS for word in script.expected] if fill else script.expected
    mismatch = compare(expected, played.capture)
    assert mismatch is None, mismatch
    assert played.counts == [*script.counts, 0, 0]


@pytest.fixture(scope="module")
def benches(tmp_path_factory: pytest.TempPathFactory) -> Compile:
    """Compile a bench for a processor; one that was compiled serves all shapes of the same storage."""
    compiled: dict[object, CortexMBench] = {}

    def bench(
        shape: SequencerShape, core: str, fill: int = 0, options: tuple[str, ...] = OPTIONS, compiler: str = "gcc"
    ) -> CortexMBench:
        key = core, options, compiler, tuple(defines(shape, fill).items())
        if key not in compiled:
            command = zig(core) if compiler == "zig" else None
            folder = tmp_path_factory.mktemp("bench")
            compiled[key] = CortexMBench(shape, folder, command, options, fill=fill, core=core)
        return compiled[key]

    return bench


# Every pair of a level and a way of playing; the other compiler, which takes ten seconds, on one core. The others are
# of test-long.
WAYS = [("gcc", "-O2", FILL), ("gcc", "-Os", 0)]
CORES_AND_WAYS = [
    *product(("cortex-m0plus", "cortex-m4", "cortex-m33"), WAYS),
    ("cortex-m33", ("zig", "-O2", FILL)),
]


@pytest.fixture(scope="module")
def sweeps() -> dict[SequencerShape, Script]:
    """Everything that a host may ask, the same for all processors."""
    return {shape: sweep(np.random.default_rng(7), shape, 1500) for shape in SHAPES}


@pytest.mark.parametrize(
    "core_and_way",
    long(CORES_AND_WAYS, product(CORTEX_M, product(("gcc", "zig"), ("-O2", "-Os"), (0, FILL)))),
    ids=lambda pair: "-".join(map(str, (pair[0], *pair[1]))),
)
def test_cortex_m_plays_everything_that_a_host_may_ask(
    sweeps: dict[SequencerShape, Script], benches: Compile, core_and_way: tuple[str, tuple[str, str, int]]
) -> None:
    core, (compiler, level, fill) = core_and_way
    for shape in SHAPES:
        script = sweeps[shape]
        bench = benches(shape, core, fill, options(level), compiler)
        hold(bench.run(words_of(script, shape)), script, fill)


@pytest.mark.parametrize("name", one_of(10, IN_C))
def test_cortex_m_plays_the_random_programs_of_the_other_sequencers(name: str, benches: Compile) -> None:
    configuration = IN_C[name]
    script = configuration.script(name)
    words, shaping = words_of(script, configuration.shape), (*OPTIONS, f"-DDAC_SHAPING={configuration.shaping}")
    for core, fill in (("cortex-m0plus", 0), ("cortex-m4", FILL)):
        hold(benches(configuration.shape, core, fill, shaping).run(words), script, fill)


@pytest.mark.parametrize("name", one_of(5, LONG))
def test_cortex_m_plays_long_lines(name: str, benches: Compile) -> None:
    """Those that are played many ticks at once."""
    shape, script = LONG[name][0], long_play(name, 8000)
    words = words_of(script, shape)
    for core in ("cortex-m0plus", "cortex-m4", "riscv32"):
        hold(benches(shape, core, 200).run(words), script, 200)


@pytest.mark.parametrize("fills", long(["by turns"], ["by turns", "both"]))
@pytest.mark.parametrize("level", long(["-O2"], ["-O2", "-Os"]))
@pytest.mark.parametrize("core", long(["cortex-m0plus", "cortex-m4", "riscv32"], [*CORTEX_M, *RISC_V]))
def test_shaped_output(core: str, level: str, fills: str, benches: Compile) -> None:
    """By turns half of the converters are played by fills and half by steps; at the other level the other half."""
    for index, name in enumerate(("bits_16", "bits_12", "bits_8", "bits_20")):
        shape, script = LONG[name][0], long_play(name, 6000, 0, 3)
        words = words_of(script, shape)
        in_turn = 200 if (index % 2 == 0) == (level == "-O2") else 0
        for fill in (in_turn,) if fills == "by turns" else (200, 0):
            bench = benches(shape, core, fill, (*options(level), "-DDAC_SHAPING=3"))
            hold(bench.run(words), script, fill)


@pytest.mark.parametrize("core", [*CORTEX_M, *RISC_V])
def test_tables_are_rendered_from_fourier_words(core: str, benches: Compile) -> None:
    shape = shape_in_c(SHAPE)
    script = renderings(shape, 12, 9)
    hold(benches(shape, core).run(words_of(script, shape, fourier=True)), script, 0)


@pytest.mark.parametrize(
    "how",
    long(
        [("riscv32", "-O2", 0), ("riscv32", "-Os", FILL), ("riscv64", "-O2", FILL), ("riscv64", "-Os", 0)],
        product(RISC_V, ("-O2", "-Os"), (0, FILL)),
    ),
    ids=lambda how: "-".join(map(str, how)),
)
def test_risc_v(sweeps: dict[SequencerShape, Script], how: tuple[str, str, int], benches: Compile) -> None:
    core, level, fill = how
    for shape, script in sweeps.items():
        bench = benches(shape, core, fill, options(level))
        hold(bench.run(words_of(script, shape)), script, fill)


@pytest.mark.parametrize("fill", [0, FILL], ids=["step", "fill"])
def test_big_endian_mips(sweeps: dict[SequencerShape, Script], fill: int, tmp_path: Path) -> None:
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


@pytest.mark.parametrize("name", BREAKS)
def test_a_broken_sequencer_is_found(sweeps: dict[SequencerShape, Script], name: str, tmp_path: Path) -> None:
    """A negative control of all of the above."""
    bench = CortexMBench(SHAPE, tmp_path, sources=runtime_with(Mutant(name, *BREAKS[name]), tmp_path / "broken"))
    with pytest.raises((AssertionError, SimulationFailed)):
        hold(bench.run(words_of(sweeps[SHAPE], SHAPE)), sweeps[SHAPE], 0)


def test_a_bench_that_is_refused_says_what(tmp_path: Path) -> None:
    script = Script()
    script.request("commit", program=random_dual(np.random.default_rng(1), SHAPE))
    with pytest.raises(SimulationFailed, match="load"):
        CortexMBench(SHAPE, tmp_path).play(script)


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
