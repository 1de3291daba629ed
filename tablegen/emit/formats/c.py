"""C99 tables and constants, with the C sequencer and the device's end of the serial link."""

import re
from pathlib import Path
from typing import Any

import numpy as np
from msgspec.structs import replace

from tablegen.base.reading import BUILD_FILE, read_text
from tablegen.base.resources import c_link, c_runtime, c_store, resource_folder
from tablegen.emit.banner import different_files
from tablegen.emit.c_text import beyond_defaults, literal
from tablegen.emit.constants import (
    LEAST_STORAGE_BITS,
    axis_constants,
    scan_constants,
    sequence_constants,
    shaping_constants,
    storage_bits,
)
from tablegen.emit.content import AxisContent, Content
from tablegen.emit.format import Comparison, Format, differing
from tablegen.emit.package import CPackage
from tablegen.emit.templates import comment_safe, rows, template
from tablegen.emit.turned_content import content_beside
from tablegen.fixedpoint.output import GAIN_BITS
from tablegen.fixedpoint.phase import PHASE_BITS
from tablegen.fixedpoint.program import Program
from tablegen.fixedpoint.rounding import signed_limits
from tablegen.fixedpoint.spline import WORDS_BEHIND
from tablegen.fixedpoint.synthesis import sine_periods
from tablegen.numerics.arrays import Ints

# Patterns of checks are compiled on first use, since a build needs none.
_NUMBER = r"(?:U?INT(?:32|64)_C)?\(?(-?\d{1,40})\)?"
_ARRAY = r"(?s)\b(\w+)\[\w*\] = \{(.*?)\};"


class C(Format):
    """The format c: ``NAME.h``, ``NAME.c`` and the objects ``NAME_program``; or the header alone."""

    name = "c"
    purpose = "C99 for firmware: tables, constants, and the sequencer dac_*.c that plays them"
    file_names = "NAME.h, NAME.c, NAME_program.* (unless header_only), dac_*.h, dac_*.c"

    def files(self, content: Content) -> dict[str, bytes]:
        """Render the header; unless the build is header-only, the arrays and the program in files of their own."""
        context = _context(content)
        files = {f"{content.name}.h": template("c/tables.h.j2", context, literal)}
        if not content.header_only:
            files[f"{content.name}.c"] = template("c/tables.c.j2", context, literal)
            files |= _program_files(context)
        return files if content.z is None else files | _files_of_z(content)

    def runtime(self) -> list[Path]:
        """List the files of the C sequencer and its link."""
        return [*c_runtime(), *c_link(), *c_store()]

    def sources(self) -> list[Path]:
        """Return the runtime and the templates."""
        return [*self.runtime(), *(resource_folder("firmware_templates") / "c").glob("*.j2")]

    def check(self, folder: Path, content: Content) -> list[Comparison]:
        """Compare the constants of the header, the words of the arrays, and the text of the program's files."""
        constants, different = wrong_constants(folder, content)
        words, flipped = wrong_arrays(folder, content)
        comparisons = [
            Comparison("header", f"{constants} constants", different),
            Comparison("arrays", f"{words} words", flipped),
        ]
        if not content.header_only:
            comparisons.append(Comparison("program", "2 files", wrong_program(folder, content)))
        if content.z is not None:
            files = _files_of_z(content)
            comparisons.append(Comparison("z", f"{len(files)} files", different_files(folder, files)))
        return comparisons


FORMAT = C()


def arrays_file(content: Content) -> str:
    """Return the file of the arrays: the header if the build has no other C file of its own."""
    return f"{content.name}.h" if content.header_only else f"{content.name}.c"


def c_package(content: Content) -> CPackage:
    """Return the C of a build as a package names it."""
    return CPackage(
        content.name,
        content.version,
        content.hash,
        sorted([*FORMAT.files(content), *(path.name for path in FORMAT.runtime())]),
        public_headers(content.name, header_only=content.header_only, with_z=content.z is not None),
        runtime_options(content),
        scan_constants(content),
        content.header_only,
        content.z is not None,
    )


def public_headers(name: str, *, header_only: bool = False, with_z: bool = False) -> list[str]:
    """List the headers that an application includes: constants, and the objects of the program unless header-only."""
    headers = [f"{name}.h", "dac_sequencer.h" if header_only else f"{name}_program.h"]
    return [*headers, *([f"{name}_z.h", f"{name}_z_program.h"] if with_z else [])]


def runtime_options(content: Content) -> dict[str, int]:
    """Return the macros that the runtime and an application are compiled with, at the least values that will do."""
    return {f"DAC_{key}": value for key, value in (_storage(content) | shaping_constants(content)).items()}


def wrong_constants(folder: Path, content: Content) -> tuple[int, list[str]]:
    """Return the number of constants of the C header, and those that are missing or wrong in it."""
    name, expected = f"{content.name}.h", _constants(content)
    try:
        text = read_text(folder / name, BUILD_FILE, errors="replace")
    except OSError as error:
        return len(expected), [f"{name}: cannot be read: {error.strerror or error}"]
    prefix = f"{content.name.upper()}_"
    defined = re.findall(rf"^[ \t]*#[ \t]*define[ \t]+({prefix}\w+)[ \t]+(\S.*?)[ \t]*$", text, re.MULTILINE)
    return len(expected), differing(name, {key: _value(value) for key, value in defined}, expected)


def wrong_arrays(folder: Path, content: Content) -> tuple[int, list[str]]:
    """Return the number of words of the arrays, and the first wrong word of each."""
    name, expected = arrays_file(content), _arrays(content)
    count = sum(map(len, expected.values()))
    try:
        text = read_text(folder / name, BUILD_FILE, errors="replace")
    except OSError as error:
        return count, [f"{name}: cannot be read: {error.strerror or error}"]
    arrays = {array: values.split(",") for array, values in re.findall(_ARRAY, text)}
    wrong = []
    for array, words in expected.items():
        if array not in arrays:
            wrong.append(f"{name}: {array} is missing")
        elif len(arrays[array]) != len(words):
            wrong.append(f"{name}: {array} has {len(arrays[array])} words, it takes {len(words)}")
        else:
            pairs = zip(map(str.strip, arrays[array]), map(str, words.tolist()), strict=True)
            differs = [(at, word, right) for at, (word, right) in enumerate(pairs) if word != right]
            wrong += [
                f"{name}: {array}[{at}] is {word[:16]}, it is {right} in the manifest"
                for at, word, right in differs[:1]
            ]
    return count, wrong


def wrong_program(folder: Path, content: Content) -> list[str]:
    """Return where the files of the program differ from what a build of this content has, behind the banner."""
    return different_files(folder, _program_files(_context(content)))


def _program_files(context: dict[str, Any]) -> dict[str, bytes]:
    """Render the files that define the program and its converters as objects."""
    names = {f"{context['name']}_program.{suffix}": f"c/program.{suffix}.j2" for suffix in ("h", "c")}
    return {name: template(source, context, literal) for name, source in names.items()}


def _files_of_z(content: Content) -> dict[str, bytes]:
    """Render the files of the sequencer that plays the output z."""
    from tablegen.emit.slow_c import slow_c_files, slow_storage  # here: most scans have no z

    beside = content_beside(content)
    assert beside is not None
    return slow_c_files(beside, slow_storage([beside.program]))


def _context(content: Content) -> dict[str, Any]:
    """Return the variables of the templates."""
    sine, storage = _sine(content), _storage(content)
    return {
        "version": content.version,
        "name": content.name,
        "NAME": content.name.upper(),
        "hash": content.hash,
        "header_only": content.header_only,
        "scanner": comment_safe(content.scanner),
        "summary": content.summary,
        "sequence": sequence_constants(content.schedule),
        "phase_bits": PHASE_BITS,
        "least_gain": signed_limits(GAIN_BITS)[0],
        "greatest_gain": signed_limits(GAIN_BITS)[1],
        "storage": storage,
        "shaping": shaping_constants(content),
        "needs": beyond_defaults(storage | shaping_constants(content)),
        "narrow": storage["TABLE_STORAGE_BITS"] == LEAST_STORAGE_BITS,
        "word_type": f"{content.name}_word" if storage["TABLE_STORAGE_BITS"] == LEAST_STORAGE_BITS else "int32_t",
        "sine": {"constants": _sine_constants(content, sine), "rows": rows(sine)} if len(sine) else None,
        "axes": [_axis(content, axis) for axis in content.axes],
        "pixel_rows": rows(_pixel_ticks(content)),
    }


def _axis(content: Content, axis: AxisContent) -> dict[str, Any]:
    prefix = f"{content.name}_{axis.axis}"
    return {
        "axis": axis.axis,
        "prefix": prefix,
        "PREFIX": prefix.upper(),
        "constants": axis_constants(axis.program, axis.harmonics),
        "words_behind": words_behind(axis.program),
        "table_rows": rows(_table(axis)),
        "fourier_rows": rows(axis.fourier_words),
        "mode": axis.program.mode,
        "shaped": axis.program.output.shaping.order != 0,
        "lines_per_period": "1" if axis.axis == "x" else f"{content.name.upper()}_FRAME_LINES",
    }


def _pixel_ticks(content: Content) -> Ints:
    """Return the ticks of each pixel, of trace and retrace; empty where pixels have equal lengths."""
    return np.array(content.schedule.pixel_table or ((), ()), dtype=np.int64).ravel()


def _table(axis: AxisContent) -> Ints:
    """Return the array of a table: its words, and behind the last the first ones again, for indices beyond it."""
    words = np.asarray(axis.program.words)
    return np.append(words, words[: words_behind(axis.program)])


def words_behind(program: Program) -> int:
    """Return the number of words behind the last one of a table."""
    return WORDS_BEHIND if program.mode == "cubic" else 1


def _storage(content: Content) -> dict[str, int]:
    """Return what the runtime is compiled for: bits of words of tables and converters in memory; splines; pixels.

    It plays the output z too, whose sequencer has a slow part.
    """
    if content.z is not None:
        from tablegen.emit.slow_c import slow_storage  # here: most scans have no z

        own, of_z = _storage(replace(content, z=None)), slow_storage([content.z])
        return {key: max(own.get(key, 0), of_z.get(key, 0)) for key in own | of_z}
    programs = [axis.program for axis in content.axes]
    return {
        "TABLE_STORAGE_BITS": storage_bits(max(program.bits for program in programs)),
        "OUTPUT_STORAGE_BITS": storage_bits(max(program.output.word_bits for program in programs)),
        **({"SPLINE": 1} if any(program.mode == "cubic" for program in programs) else {}),
        **({} if content.schedule.pixel_table is None else {"PIXEL_TABLE": 1}),
    }


def _sine(content: Content) -> Ints:
    """Return the sine from which a device renders tables; empty where no table is interpolated."""
    bits = content.sine_index_bits
    return sine_periods(bits) if bits else np.zeros(0, dtype=np.int64)


def _sine_constants(content: Content, sine: Ints) -> dict[str, int]:
    return {"SINE_INDEX_BITS": content.sine_index_bits, "SINE_LENGTH": len(sine)} if len(sine) else {}


def _constants(content: Content) -> dict[str, int | str]:
    """Return every constant of the header: numbers, and the hash."""
    own: dict[str, int | str] = {
        "HASH": content.hash,
        **scan_constants(content),
        **_storage(content),
        **_sine_constants(content, _sine(content)),
    }
    return {f"{content.name.upper()}_{key}": value for key, value in own.items()}


def _arrays(content: Content) -> dict[str, Ints]:
    """Return the contents of the arrays, by name."""
    arrays: dict[str, Ints] = {}
    for axis in content.axes:
        arrays[f"{axis.axis}_table"] = _table(axis)
        arrays[f"{axis.axis}_fourier"] = axis.fourier_words
    if content.sine_index_bits:
        arrays["sine"] = _sine(content)
    if content.schedule.pixel_table is not None:
        arrays["pixel_table"] = _pixel_ticks(content)
    return {f"{content.name}_{key}": words for key, words in arrays.items()}


def _value(text: str) -> int | str:
    """Read a number, the content of a string, or the text of anything else."""
    if len(text) > 1 and text[0] == text[-1] == '"':
        return text[1:-1]
    number = re.fullmatch(_NUMBER, text)
    return int(number[1]) if number else text
