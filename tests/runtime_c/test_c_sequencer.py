"""The C sequencer on this machine against the integer model, tick for tick: codes, markers, faults, counts.

The scripts are those of the Verilog sequencer, and longer lines for the path on which C plays many ticks at once. All
are played with gcc and clang, step by step and by fills of random lengths, with the address and undefined behaviour
sanitizers. ``c_checks`` holds the functions against what the header promises of them.
"""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from building import HELPERS, NAME, VARIANTS, build, run_clean
from c_benches import COMPILERS, FILL, SANITIZED, Benches
from c_checks import CHECKS
from c_devices import Check, Libraries
from c_library import Converter, CProgram, Library, Twin, compile_both, compile_library, storage
from c_scripts import (
    IN_C,
    LONG,
    LONG_PERIODS,
    SMALL_IN_C,
    catching_up,
    every_tick,
    everything,
    long_dual,
    long_periods,
    long_play,
    renderings,
)
from replacing import replace
from resting import check_rest, rest_script
from sets import LONG_TEST, common_of, long
from stream_configurations import FEW, SWAPS, SWAPS_SLOW, random_swaps
from stream_laws import follow_their_programs
from stream_scripts import FAULTS, flag, in_any_order, occurrences

from tablegen.verification.play.sequencer_shape import SequencerShape
from tablegen.verification.play.stream import FLAGS, Script

HARMONICS = 6


@pytest.fixture(scope="module")
def benches(tmp_path_factory: pytest.TempPathFactory) -> Benches:
    return Benches(tmp_path_factory.mktemp("benches"))


def everywhere(benches: Benches, script: Script, shape: SequencerShape, fourier: bool = False) -> np.ndarray:
    """Play a script with all compilers, in both ways; returns the capture of one that has faults in it."""
    for compiler in COMPILERS:
        benches.play(script, shape, compiler, FILL, fourier)
        played = benches.play(script, shape, compiler, 0, fourier)
    return played.capture


# Random programs back to back.


@pytest.mark.common
@pytest.mark.parametrize("name", common_of(6, FEW[:2], IN_C))
def test_random_programs(name: str, benches: Benches, tmp_path: Path) -> None:
    configuration = IN_C[name]
    if configuration.shaping:
        benches = Benches(tmp_path, (*SANITIZED, f"-DDAC_SHAPING={configuration.shaping}"))
    capture = everywhere(benches, configuration.script(name), configuration.shape)
    assert len(capture) >= configuration.samples
    seen = occurrences(capture)
    if configuration.samples > 5000:
        assert all(seen[name] for name in (*FLAGS, *FAULTS[:2])), seen


@pytest.mark.rest
@pytest.mark.parametrize("name", long(("bits_16", "bits_24", "direct", "cubic"), LONG))
def test_long_lines(name: str, benches: Benches) -> None:
    script = long_play(name, 60_000)
    capture = everywhere(benches, script, LONG[name][0])
    assert len(capture) >= 60_000
    assert script.swaps > 8


@pytest.mark.common
@pytest.mark.parametrize(
    "shape",
    [
        SequencerShape(16, 1, 4, 16, 1, 3, 16),
        SequencerShape(20, 1, 3, 24, 1, 4, 18),
        SequencerShape(12, 0, 6, 12, 0, 6, 20),
    ],
)
def test_everything_that_a_host_may_ask(shape: SequencerShape, benches: Benches) -> None:
    everywhere(benches, everything(shape, 1), shape)


@pytest.mark.common
def test_lines_are_stopped_and_started_anywhere(benches: Benches) -> None:
    shape, script = LONG["bits_16"][0], Script()
    script.tick_every(1)
    for seed in range(3):
        catching_up(script, long_dual(np.random.default_rng(seed), shape, (200, 300)))
    everywhere(benches, script, shape)


@pytest.mark.common
@pytest.mark.parametrize("name", ["bits_16", "cubic", "direct"])
def test_x_rests_as_y_does(name: str, benches: Benches) -> None:
    """An image, a line along y, a point and a line along x in one scan, each held against its program too."""
    shape, script = LONG[name][0], Script()
    programs = rest_script(np.random.default_rng(7), script, shape, 1, (200, 300))
    check_rest(everywhere(benches, script, shape), programs)


@pytest.mark.common
@pytest.mark.parametrize("lines", [3640, 3641])
def test_the_longest_periods(lines: int, benches: Benches) -> None:
    """Around 2^32 / 18 ticks, where the fast path ends."""
    everywhere(benches, long_periods(1 << 16, lines), LONG_PERIODS)


@pytest.mark.common
def test_words_can_be_written_in_any_order(benches: Benches) -> None:
    shape, rng, script = SequencerShape(16, 1, 3, 16, 0, 3, 16), np.random.default_rng(3), Script()
    script.tick_every(1)
    for _ in range(4):
        program, other = (long_dual(rng, shape, (8, 8), lines=(1, 2)) for _ in range(2))
        in_any_order(rng, script, program, other)
        script.request("commit", "arm", program=program)
        script.wait_ticks(3)
        script.request("trigger")
        script.wait_ticks(100)
    everywhere(benches, script, shape)


# Swaps.


@pytest.mark.common
def test_a_swap_is_requested_at_every_tick(benches: Benches) -> None:
    shape = LONG["bits_16"][0]
    script = every_tick(shape)
    capture = everywhere(benches, script, shape)
    swapped = flag(capture, "swapped") & flag(capture, "playing")
    assert np.sum(swapped) == max(program.schedule.ticks for program in script.swapped_programs)
    assert np.all(flag(capture, "line")[swapped])


@pytest.mark.rest
@pytest.mark.parametrize("swaps", [SWAPS, pytest.param(SWAPS_SLOW, marks=LONG_TEST)])
def test_no_line_mixes_programs(swaps: int, benches: Benches) -> None:
    """By fills with one compiler and by steps with the other; with both in both ways where there are many."""
    rng = np.random.default_rng(swaps)
    for _ in range(0, swaps, SWAPS):
        script, programs = random_swaps(rng, SWAPS, SMALL_IN_C)
        if swaps > SWAPS:
            capture = everywhere(benches, script, SMALL_IN_C)
        else:
            benches.play(script, SMALL_IN_C, "gcc", FILL)
            capture = benches.play(script, SMALL_IN_C, "clang").capture
        assert np.sum(flag(capture, "swapped")) == SWAPS == len(programs)
        follow_their_programs(capture, programs)


@pytest.mark.common
def test_tables_are_rendered_while_a_program_plays(benches: Benches) -> None:
    shape = SequencerShape(16, 1, 4, 16, 1, 3, 14)
    script = renderings(shape, 40, HARMONICS)
    everywhere(benches, script, shape, fourier=True)
    assert script.swaps == 40


# The functions.


@pytest.fixture(scope="module")
def libraries(tmp_path_factory: pytest.TempPathFactory) -> Libraries:
    return Libraries(*map(Library, compile_both(tmp_path_factory.mktemp("libraries"))))


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.__name__)
def test_functions(check: Check, libraries: Libraries) -> None:
    check(libraries)


@pytest.mark.rest
@pytest.mark.parametrize("compiler", long(["clang"], ["gcc", "clang"]))
def test_functions_with_sanitizers(compiler: str, tmp_path: Path) -> None:
    """Tables are allocated with just the words that they need, so that a word too many is found."""
    shared = ("-shared-libasan",) if compiler == "clang" else ()
    options = ("-std=c99", "-O1", "-g", "-fsanitize=undefined,address", "-fno-sanitize-recover=all", *shared)
    paths = compile_both(tmp_path, compiler=(compiler,), options=options)
    name = "libasan.so" if compiler == "gcc" else "libclang_rt.asan-x86_64.so"
    runtime = run_clean([compiler, f"-print-file-name={name}"]).strip()
    environment = {
        **os.environ, "LD_PRELOAD": runtime, "ASAN_OPTIONS": "detect_leaks=0", "PYTHONMALLOC": "malloc",
        "PYTHONPATH": os.pathsep.join(sys.path),
    }  # fmt: skip
    command = [sys.executable, str(HELPERS / "c_checks.py"), *map(str, paths)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]


# What a build emits.


@pytest.mark.common
@pytest.mark.parametrize("name", common_of(4, ("short_frame",), VARIANTS))
def test_a_build_s_header_plays_a_frame_a_swap_and_parks(name: str, tmp_path: Path) -> None:
    """The words that the converter gets, by ``DAC_PROGRAM`` and ``DAC_CONVERTER`` of the emitted header."""
    built = build(tmp_path, VARIANTS[name])
    unit, upper = tmp_path / "unit.c", NAME.upper()
    unit.write_text(
        f'#include "dac_sequencer.h"\n#include "{NAME}.h"\n'
        f"extern const dac_program scan;\nconst dac_program scan = DAC_PROGRAM({upper}, {NAME});\n"
        f"extern const dac_converter x, y;\n"
        f"const dac_converter x = DAC_CONVERTER({upper}_X, 3), y = DAC_CONVERTER({upper}_Y, 5);\n"
    )
    program = built.plan.program
    emitted = [built.folder / file for file in built.files if file == f"{NAME}.c"]
    path = compile_library(
        tmp_path / "library.so",
        storage(max(program.x.bits, program.y.bits)),
        storage(program.x.output.word_bits),
        more=[unit, *emitted, f"-I{built.folder}"],
    )
    library = Library(path)
    twin = Twin(library, program, (3, 5))
    for axis, output in zip("xy", twin.outputs, strict=True):
        converter = Converter.in_dll(library.dll, axis)
        assert (converter.bits, converter.word_bits) == (output.dac_bits, output.word_bits)
        assert converter.twos_complement == (output.coding == "twos-complement")
        assert converter.left_aligned == (output.align == "left")
        assert converter.power_up_code == {"x": 3, "y": 5}[axis]
    schedule = program.schedule
    for by in ("fill", "step") if schedule.frame_ticks < 100_000 else ("fill",):
        twin.commit(program, CProgram.in_dll(library.dll, "scan"))
        twin.play(100)
        twin.ask("arm", "trigger", frames=1)
        twin.play(schedule.frame_ticks + 3, by)
    other = replace(
        program, x=replace(program.x, output=replace(program.x.output, gain_word=-program.x.output.gain_word))
    )
    twin.ask("arm", "trigger")
    twin.play(schedule.ticks + 7, "fill")
    twin.commit(other)
    twin.play(3 * schedule.ticks, "fill")
    twin.ask("park")
    while not twin.model.parked:
        twin.play(500, "fill")
    assert twin.swaps == (3 if schedule.frame_ticks < 100_000 else 2)
