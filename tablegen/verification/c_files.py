"""The C files of a build against its manifest: the constants of the header, the words of the arrays."""

import re
from pathlib import Path

import numpy as np

from tablegen.emit.constants import axis_constants, sequence_constants
from tablegen.fixedpoint.synthesis import sine_periods
from tablegen.manifest.read import StoredBuild
from tablegen.numerics.arrays import Ints
from tablegen.verification.directory import differing

_NUMBER = re.compile(r"(?:U?INT(?:32|64)_C)?\(?(-?\d{1,40})\)?")
_ARRAY = re.compile(r"\b(\w+)\[\w*\] = \{(.*?)\};", re.DOTALL)


def wrong_constants(folder: Path, stored: StoredBuild) -> tuple[int, list[str]]:
    """How many constants the C header is to have, and those that it has not, or not so."""
    name = f"{stored.manifest.name}.h"
    wanted = expected_constants(stored)
    try:
        text = (folder / name).read_text("utf-8", "replace")
    except OSError as error:
        return len(wanted), [f"{name}: cannot be read: {error.strerror or error}"]
    prefix = f"{stored.manifest.name.upper()}_"
    defined = re.findall(rf"^[ \t]*#[ \t]*define[ \t]+({prefix}\w+)[ \t]+(\S.*?)[ \t]*$", text, re.MULTILINE)
    return len(wanted), differing(name, {key: _value(value) for key, value in defined}, wanted)


def expected_constants(stored: StoredBuild) -> dict[str, int | str]:
    """Every constant of the C header: numbers, and the hash."""
    program = stored.program
    constants: dict[str, int | str] = {"HASH": stored.manifest.hash, **sequence_constants(program.schedule)}
    for axis, content in stored.axes:
        own = axis_constants(getattr(program, axis), content.fourier.harmonics)
        constants |= {f"{axis.upper()}_{key}": value for key, value in own.items()}
    if index_bits := sine_index_bits(stored):
        constants |= {"SINE_INDEX_BITS": index_bits, "SINE_LENGTH": len(sine_periods(index_bits))}
    return {f"{stored.manifest.name.upper()}_{key}": value for key, value in constants.items()}


def sine_index_bits(stored: StoredBuild) -> int:
    """Of the sine from which tables are rendered; 0 where no table is."""
    return max(stored.program.x.index_bits, stored.program.y.index_bits)


def expected_arrays(stored: StoredBuild) -> dict[str, Ints]:
    """What the arrays have to hold, by name."""
    arrays = {}
    for axis, content in stored.axes:
        arrays[f"{axis}_table"] = np.array(content.table.words, dtype=np.int64)
        arrays[f"{axis}_fourier"] = content.fourier_words
    if index_bits := sine_index_bits(stored):
        arrays["sine"] = sine_periods(index_bits)
    return {f"{stored.manifest.name}_{key}": words for key, words in arrays.items()}


def arrays_file(stored: StoredBuild) -> str:
    """Where the arrays stand: in the header if the build has no other C file of its own."""
    name = stored.manifest.name
    return f"{name}.c" if f"{name}.c" in stored.manifest.files else f"{name}.h"


def wrong_arrays(folder: Path, stored: StoredBuild) -> tuple[int, list[str]]:
    """How many words the arrays are to have, and in which of them the first wrong one stands."""
    name, wanted = arrays_file(stored), expected_arrays(stored)
    count = sum(map(len, wanted.values()))
    try:
        text = (folder / name).read_text("utf-8", "replace")
    except OSError as error:
        return count, [f"{name}: cannot be read: {error.strerror or error}"]
    found = {array: content.split(",") for array, content in _ARRAY.findall(text)}
    wrong = []
    for array, words in wanted.items():
        if array not in found:
            wrong.append(f"{name}: {array} is missing")
        elif len(found[array]) != len(words):
            wrong.append(f"{name}: {array} has {len(found[array])} words, the manifest {len(words)}")
        else:
            pairs = zip(map(str.strip, found[array]), map(str, words.tolist()), strict=True)
            differs = [(at, word, right) for at, (word, right) in enumerate(pairs) if word != right]
            wrong += [
                f"{name}: {array}[{at}] is {word[:16]}, it is {right} in the manifest"
                for at, word, right in differs[:1]
            ]
    return count, wrong


def _value(text: str) -> int | str:
    """A number, the content of a string, or what is neither as it stands."""
    if len(text) > 1 and text[0] == text[-1] == '"':
        return text[1:-1]
    number = _NUMBER.fullmatch(text)
    return int(number[1]) if number else text
