"""Words of another width in memory than the runtime was compiled for: refused, by the compiler or on loading."""

import ctypes
from pathlib import Path

import pytest
from building import NAME, VARIANTS, build, run
from c_devices import device_for, flat
from c_library import OTHER_STORAGE, Library, compile_library
from sets import by_tool

from tablegen.base.resources import c_runtime

UNIT = f"""#include "dac_sequencer.h"
#include "{NAME}.h"
extern const dac_program scan;
const dac_program scan = DAC_PROGRAM({NAME.upper()}, {NAME});
"""
# As a firmware might be compiled; gcc 12 does no more than warn of a pointer to words of another width.
COMPILERS = {"gcc": ["gcc", "-std=c99"], "clang": ["clang", "-std=c99"], "gcc-c11": ["gcc", "-std=c11"]}
INCLUDES = [f"-I{folder}" for folder in sorted({str(path.parent) for path in c_runtime()})]


@pytest.mark.common
@pytest.mark.parametrize("compiler", by_tool(COMPILERS))
def test_a_program_of_another_width_does_not_compile(tmp_path: Path, compiler: str) -> None:
    """Narrow words take the width of the runtime; those of a header that was read before its width was known do not."""
    unit = tmp_path / "unit.c"
    for bits, scan in ((16, VARIANTS["example"]), (32, VARIANTS["bits_18"])):
        build(tmp_path / str(bits), scan)
    late = f'#include "{NAME}.h"\n#define DAC_TABLE_STORAGE_BITS 32\n'
    for bits, compiled, before, compiles in (
        (16, 16, "", True),
        (16, 32, "", True),
        (16, None, late, False),
        (32, 16, "", False),
        (32, 32, "", True),
    ):
        unit.write_text(before + UNIT, "ascii")
        width = [] if compiled is None else [f"-DDAC_TABLE_STORAGE_BITS={compiled}"]
        options = [*width, "-DDAC_OUTPUT_STORAGE_BITS=32", *INCLUDES, f"-I{tmp_path / str(bits) / 'out'}"]
        done = run([*COMPILERS[compiler], *options, "-fsyntax-only", unit])
        assert (done.returncode == 0) == compiles, done.stderr
        assert compiles or "compile_with_the_DAC_TABLE_STORAGE_BITS_of_the_table" in done.stderr


@pytest.mark.common
def test_a_runtime_of_another_width_refuses_the_program(tmp_path: Path) -> None:
    """The file with the program was compiled with one width, the runtime with the other."""
    for bits in (16, 32):
        library = Library(compile_library(tmp_path / f"{bits}.so", bits, 32))
        program, axes = library.program(flat(1))
        device = device_for(library, flat(1))
        program.x.storage_bits = program.y.storage_bits = 48 - bits
        assert device.load(program) == OTHER_STORAGE
        assert not device.commit()
        assert ctypes.sizeof(axes[0].words) == 9 * bits // 8
