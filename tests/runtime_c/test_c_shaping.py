"""Shaped output in C against the integer model, tick for tick: all orders, steps and runs, 64 and 32 bits."""

import ctypes
from pathlib import Path

import numpy as np
import pytest
from building import NAME, Variant, build, run, run_clean
from c_benches import COMPILERS, FILL, SANITIZED, Benches
from c_devices import device_for, flat
from c_library import BAD_SHAPING, LOADED, Library, compile_library
from c_scripts import LONG, every_tick, long_play, refused_by_y, shaped, shaped_short_lines
from c_shaped_waves import WAVES, shaped_waves
from replacing import replace
from sets import long

from tablegen.base.resources import c_runtime
from tablegen.device.dual_program import DualProgram
from tablegen.fixedpoint.shaping import Shaping
from tablegen.verification.play.sequencer_shape import SequencerShape
from tablegen.verification.play.stream import Script

SHORT = {
    "bits_16": SequencerShape(16, 1, 4, 16, 1, 3, 16),
    "bits_12": SequencerShape(12, 1, 4, 10, 0, 4, 14),
    "bits_24": SequencerShape(24, 1, 3, 24, 1, 4, 20),
    "bits_8": SequencerShape(8, 0, 5, 8, 1, 3, 8),
}


@pytest.fixture(scope="module")
def benches(tmp_path_factory: pytest.TempPathFactory) -> dict[int, Benches]:
    """By the highest order."""
    folder = tmp_path_factory.mktemp("benches")
    return {order: Benches(folder / str(order), (*SANITIZED, f"-DDAC_SHAPING={order}")) for order in (1, 2, 3)}


def everywhere(benches: Benches, script: Script, shape: SequencerShape) -> None:
    """With both compilers, of which one runs with 64 bits and one with 32; by fills and by steps."""
    for compiler in COMPILERS:
        for fill in (FILL, 0):
            benches.play(script, shape, compiler, fill)


@pytest.mark.rest
@pytest.mark.parametrize("name", long(("bits_16", "bits_24", "cubic"), LONG))
def test_long_lines(name: str, benches: dict[int, Benches]) -> None:
    script = long_play(name, 30_000, 1, 3)
    everywhere(benches[3], script, LONG[name][0])
    assert any(axis.output.shaping.order == 3 for program in script.swapped_programs for axis in (program.x, program.y))


@pytest.mark.rest
@pytest.mark.parametrize("order", [1, 2])
def test_a_runtime_of_a_lower_order(order: int, benches: dict[int, Benches]) -> None:
    everywhere(benches[order], long_play("bits_16", 20_000, order, order), LONG["bits_16"][0])


@pytest.mark.rest
@pytest.mark.parametrize("name", SHORT)
def test_short_lines_that_clamp_are_held_back_and_take_each_other_s_place(
    name: str, benches: dict[int, Benches]
) -> None:
    script = shaped_short_lines(SHORT[name], 8000)
    everywhere(benches[3], script, SHORT[name])
    assert script.swaps > 10


@pytest.mark.rest
@pytest.mark.parametrize("name", WAVES)
def test_slow_waves_of_other_converters(name: str, benches: dict[int, Benches]) -> None:
    everywhere(benches[3], shaped_waves(WAVES[name]), WAVES[name])


@pytest.mark.common
def test_x_takes_back_what_y_refused(benches: dict[int, Benches]) -> None:
    everywhere(benches[3], refused_by_y(20_000), LONG["many_lines"][0])


@pytest.mark.common
def test_a_runtime_that_shapes_plays_what_is_not_shaped(benches: dict[int, Benches]) -> None:
    shape = LONG["bits_16"][0]
    everywhere(benches[3], long_play("bits_16", 20_000), shape)
    everywhere(benches[3], every_tick(shape), shape)


# The functions.


@pytest.fixture(scope="module")
def libraries(tmp_path_factory: pytest.TempPathFactory) -> dict[int, Library]:
    folder = tmp_path_factory.mktemp("libraries")
    return {
        order: Library(compile_library(folder / f"{order}.so", more=[f"-DDAC_SHAPING={order}"])) for order in (1, 2, 3)
    }


def with_shaping(program: DualProgram, axis: str, order: int, zero: int) -> DualProgram:
    own = getattr(program, axis)
    return replace(program, **{axis: replace(own, output=replace(own.output, shaping=Shaping(order, zero)))})


@pytest.mark.common
@pytest.mark.parametrize("axis", ["x", "y"])
def test_an_order_that_was_not_compiled_is_refused(libraries: dict[int, Library], axis: str) -> None:
    for highest, library in libraries.items():
        device = device_for(library, flat(30000))
        for order, zero in ((0, 0), (1, 0), (2, 0), (3, 0), (3, 128)):
            expected = LOADED if order <= highest else BAD_SHAPING
            assert device.load(with_shaping(flat(30000), axis, order, zero)) == expected
        for order, zero in ((0, 1), (1, 1), (2, 128), (3, 129), (4, 0)):
            program, axes = library.program(flat(30000))
            own = getattr(program, axis)
            own.shaping_order, own.shaping_zero = order, zero
            assert device.load(program) == BAD_SHAPING, (order, zero)
            device.alive.append(axes)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_runs_take_place(libraries: dict[int, Library], order: int) -> None:
    """A code that rests, and has no remainder, is one run; between two codes there are runs of several."""
    library = libraries[3]
    for rest, codes in ((0, {30000}), (1 << 18, set(range(29996, 30006)))):
        program = flat(30000, offset_word=(30000 << 20) + rest)
        program = with_shaping(with_shaping(program, "x", order, 0), "y", order, 0)
        device = device_for(library, program, 30000)
        assert device.load(program) == LOADED
        assert device.commit()
        device.steps(1)
        assert device.arm(0)
        assert device.trigger()
        device.steps(1)
        low, high, code = ctypes.c_uint64(0), ctypes.c_uint32(0), ctypes.c_int32(30000)
        out = np.zeros(64 * library.stride, library.output)
        done = library.dll.probe_run(
            device.state,
            0,
            *map(ctypes.byref, (low, high, code)),
            out.ctypes.data_as(ctypes.c_void_p),
            ctypes.c_uint32(64),
        )
        assert done == 64
        assert set(out[:: library.stride].tolist()) <= codes
        assert len(set(out[:: library.stride].tolist())) > 1 or rest == 0


# What a build emits.


@pytest.mark.common
def test_a_header_of_a_shaped_build_needs_its_order(tmp_path: Path) -> None:
    """By the compiler, in C99, C11 and C++; one that is not shaped needs none."""
    shaped_build = build(tmp_path / "shaped", Variant({"dac.shaping": "second"}))
    plain = build(tmp_path / "plain", Variant())
    unit = tmp_path / "unit.c"
    unit.write_text(
        f'#include "dac_sequencer.h"\n#include "{NAME}.h"\nextern const dac_program scan;\n'
        f"const dac_program scan = DAC_PROGRAM({NAME.upper()}, {NAME});\n"
    )
    folder = c_runtime()[0].parent
    for compiler in (["gcc", "-std=c99"], ["clang", "-std=c11"], ["g++", "-x", "c++", "-std=c++17"]):
        command = [*compiler, "-Wall", "-Wextra", "-Wpedantic", "-Werror", f"-I{folder}", "-c", unit, "-o", "/dev/null"]
        for built, order, compiles in (
            (shaped_build, 1, False),
            (shaped_build, 2, True),
            (plain, 0, True),
            (plain, 3, True),
        ):
            done = run([*command, f"-I{built.folder}", f"-DDAC_SHAPING={order}"])
            assert (done.returncode == 0) == compiles, done.stderr


def test_without_shaping_there_is_no_code_for_it(tmp_path: Path) -> None:
    """Its file is empty."""
    source = next(path for path in c_runtime() if path.name == "dac_shaping.c")
    run_clean(["gcc", "-std=c99", "-O2", "-c", source, "-o", tmp_path / "shaping.o"])
    symbols = run_clean(["nm", tmp_path / "shaping.o"]).splitlines()
    assert {line.split()[-2] for line in symbols} == {"A"}, "only the options, for the linker"


def test_shaping_changes_what_is_played() -> None:
    """A control of all of the above: the scripts have shaped programs in them whose codes are others."""
    rng = np.random.default_rng(4)
    script = long_play("bits_16", 3000)
    program = script.swapped_programs[0]
    changed = shaped(rng, program)
    while changed.x.output.shaping.order == 0:
        changed = shaped(rng, program)
    ticks = program.schedule.ticks
    assert not np.array_equal(changed.x.played(0, ticks), program.x.played(0, ticks))
