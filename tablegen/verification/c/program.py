"""The C program that plays a build: its own files, its runtime, and the file that gives them to the bench."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from tablegen.emit.constants import scan_constants
from tablegen.emit.content import Content
from tablegen.emit.formats.c import arrays_file
from tablegen.emit.stored import stored_content
from tablegen.fixedpoint.program import Program
from tablegen.manifest.read import StoredBuild
from tablegen.verification.c.bench import storage_bits
from tablegen.verification.checks.directory import copies

OPTIONS = ("-std=c99", "-O2")
MOST_FILLED = 600  # ticks a call of a fill


@dataclass(frozen=True)
class CProgram:
    """The files and macros of a program; the runtime has a folder of its own, so that it finds only its own headers.

    ``own`` are the header and the arrays of the build, with the file that hands them to the bench.
    """

    own: list[Path]
    runtime: list[Path]
    of_z: list[Path]  # of the second sequencer; empty without z
    choices: dict[str, int]  # of a firmware for this build, which the runtime is compiled with
    bench: dict[str, int]  # of the bench, beside them

    @property
    def sources(self) -> list[Path]:
        """The C files of the program."""
        return [*self.own, *self.runtime]

    @property
    def defines(self) -> dict[str, int]:
        """The macros of the program."""
        return self.choices | self.bench


def c_program(folder: Path, work: Path, stored: StoredBuild, fourier: bool) -> tuple[CProgram, list[str]]:
    """Return the C program of the build in ``folder``, copied to ``work``, and a list of what is missing."""
    names = stored.runtime(".c", ".h")
    own, absent = copies(folder, _own_files(stored), work / "c")
    runtime, missing = copies(folder, names, work / "runtime")
    absent += missing
    of_z, missing = copies(folder, _files_of_z(stored), work / "c")
    absent += missing
    if not names:
        absent.append("the build holds no dac_*.c")
    (work / "bench").mkdir(exist_ok=True)
    handed = work / "bench" / "bench_program.c"
    handed.write_text(_bench_program(stored, fourier), "ascii")
    return CProgram([*own, handed], runtime, of_z, _choices(stored), _bench_choices(stored, fourier)), absent


def header_constants(content: Content) -> dict[str, int]:
    """Return the values of the emitted header's macros by name; each character of the hash is a number."""
    own = {f"{content.name.upper()}_{key}": value for key, value in scan_constants(content).items()}
    digits = {f"{content.name.upper()}_HASH[{at}]": ord(digit) for at, digit in enumerate(content.hash)}
    return own | digits


def _own_files(stored: StoredBuild) -> list[str]:
    """Return the names of the C files that were made for this scan alone."""
    name = stored.manifest.name
    program = {f"{name}_program.h", f"{name}_program.c"} & set(stored.manifest.files)
    return sorted({f"{name}.h", arrays_file(stored_content(stored)), *program})


def _files_of_z(stored: StoredBuild) -> list[str]:
    """Return the names of the C files of the sequencer that plays the output z; empty without z."""
    name = f"{stored.manifest.name}_z"
    return [] if stored.z is None else [f"{name}{end}" for end in (".h", ".c", "_program.h", "_program.c")]


def library_choices(programs: Sequence[StoredBuild]) -> dict[str, int]:
    """Return the macros with which a firmware for all these builds is compiled."""
    every = [_choices(stored) for stored in programs]
    return {
        key: max(each.get(key, 0) for each in every) for key in dict.fromkeys(key for each in every for key in each)
    }


def _choices(stored: StoredBuild) -> dict[str, int]:
    """Return the macros with which a firmware for this build is compiled."""
    axes = [axis for _, axis in stored.axes]
    order = max(program.output.shaping.order for program in (stored.program.x, stored.program.y))
    outputs = [axis.output.word_bits for axis in axes] + [tilt.output.word_bits for tilt in stored.tilts.values()]
    cubic = stored.z is not None or any(axis.table.mode == "cubic" for axis in axes)
    return {
        "DAC_TABLE_STORAGE_BITS": storage_bits(max(axis.table.bits for axis in axes)),
        "DAC_OUTPUT_STORAGE_BITS": storage_bits(max(outputs)),
        **({"DAC_SPLINE": 1} if cubic else {}),
        **({} if stored.z is None else {"DAC_SLOW_PART": 1}),
        **({} if stored.program.schedule.pixel_table is None else {"DAC_PIXEL_TABLE": 1}),
        **({"DAC_SHAPING": order} if order else {}),
    }


def _bench_choices(stored: StoredBuild, fourier: bool) -> dict[str, int]:
    """Return the macros with which the bench for this build is compiled."""
    axes = [axis for _, axis in stored.axes]
    rendered = [len(axis.table.words) for axis in axes if fourier and axis.table.mode != "direct"]
    return {
        "BENCH_EMITTED": 1,
        "BENCH_TABLE_WORDS": max([*rendered, *map(_variation_words, (stored.program.x, stored.program.y))]),
        "BENCH_CONSTANTS": len(scan_constants(stored_content(stored))),
    }


def _macro(stored: StoredBuild) -> str:
    """Return the macro that makes the program of a build from its header."""
    return "DAC_PROGRAM" if stored.program.schedule.pixel_table is None else "DAC_PIXEL_PROGRAM"


def _variation_words(own: Program) -> int:
    """Return the words that the table of a variation may have."""
    return len(own.words) if own.mode != "direct" else max(len(own.words), 8)


def _bench_program(stored: StoredBuild, fourier: bool) -> str:
    """Return the C file that hands the emitted tables to the bench, by the names in their header."""
    name = stored.manifest.name
    capital = name.upper()
    lines = [
        "/* Hands what a build emitted to the bench of tablegen verify. */",
        f'#include "{name}.h"',
        '#include "stream_bench.h"',
        "",
        # The emitted objects; a header-only build has none.
        *(
            [f'#include "{name}_program.h"']
            if f"{name}_program.h" in stored.manifest.files
            else [
                f"static const dac_program {name}_program = {_macro(stored)}({capital}, {name});",
                f"static const dac_converter {name}_x_converter = DAC_CONVERTER({capital}_X, 0);",
                f"static const dac_converter {name}_y_converter = DAC_CONVERTER({capital}_Y, 0);",
            ]
        ),
        f"const dac_program *const bench_program = &{name}_program;",
    ]
    rendered = []
    for axis, content in stored.axes:
        rendered.append(fourier and content.table.mode != "direct")
        of = f"{capital}_{axis.upper()}"
        words = f"{name}_{axis}_fourier, {of}_HARMONICS" if rendered[-1] else "NULL, 0"
        lines += [
            f"const dac_converter *const bench_{axis}_converter = &{name}_{axis}_converter;",
            f"const bench_axis bench_{axis} = {{{words}}};",
        ]
    lines += [
        f"const int32_t *const bench_sine = {f'{name}_sine' if any(rendered) else 'NULL'};",
        f"const unsigned bench_sine_index_bits = {f'{capital}_SINE_INDEX_BITS' if any(rendered) else '0'};",
        "",
        "const int64_t bench_constants[BENCH_CONSTANTS] = {",
        *(f"    {capital}_{constant}," for constant in scan_constants(stored_content(stored))),
        "};",
        f"const char bench_hash[BENCH_HASH_DIGITS + 1] = {capital}_HASH;",
    ]
    return "\n".join(lines) + "\n"
