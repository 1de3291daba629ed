"""The files of a build against its manifest: their digests, the constants of the Verilog header, the memory files."""

import re
import shutil
from collections.abc import Mapping
from hashlib import sha256
from pathlib import Path

from tablegen.emit.constants import axis_constants, sequence_constants
from tablegen.emit.memory import memory_files
from tablegen.manifest.read import StoredBuild

_LOCALPARAM = re.compile(r"^localparam\s[^=]*?(\w+)\s*=\s*(.*?)\s*;", re.MULTILINE)
_NUMBER = re.compile(r"(-?)(?:\d+'s?([dh]))?([0-9a-fA-F]+)")
_MAX_SHOWN = 5


def wrong_files(folder: Path, stored: StoredBuild) -> list[str]:
    """What is wrong with the files that the manifest lists."""
    wrong = []
    for name, digest in stored.manifest.files.items():
        try:
            content = (folder / name).read_bytes()
        except OSError as error:
            wrong.append(f"{name}: {'missing' if isinstance(error, FileNotFoundError) else error.strerror or error}")
            continue
        if sha256(content).hexdigest() != digest:
            wrong.append(f"{name}: stale or edited: its SHA-256 is not that of the manifest")
    return wrong


def wrong_constants(folder: Path, stored: StoredBuild) -> tuple[int, list[str]]:
    """How many constants the Verilog header is to have, and those that it has not, or not so."""
    name = f"{stored.manifest.name}.vh"
    wanted = expected_constants(stored)
    try:
        text = (folder / name).read_text("utf-8", "replace")
    except OSError as error:
        return len(wanted), [f"{name}: cannot be read: {error.strerror or error}"]
    found: dict[str, int | str] = {key: _value(value) for key, value in _LOCALPARAM.findall(text)}
    return len(wanted), differing(name, found, wanted)


def differing(name: str, found: Mapping[str, int | str], wanted: Mapping[str, int | str]) -> list[str]:
    """The constants that a header has not, has otherwise, or has beyond those that it is to have."""
    wrong = []
    for key, value in wanted.items():
        if key not in found:
            wrong.append(f"{name}: {key} is missing, it is {_shown(value)} in the manifest")
        elif found[key] != value:
            wrong.append(f"{name}: {key} is {_shown(found[key])}, it is {_shown(value)} in the manifest")
    return wrong + [f"{name}: {key} is not in the manifest" for key in found if key not in wanted]


def expected_constants(stored: StoredBuild) -> dict[str, int | str]:
    """Every localparam of the Verilog header: numbers, and names of files."""
    name, program = stored.manifest.name, stored.program
    constants: dict[str, int | str] = {
        "HASH": int(stored.manifest.hash, 16),
        **sequence_constants(program.schedule),
        "PROGRAM_FILE": f"{name}_program.mem",
    }
    if program.x.index_bits or program.y.index_bits:
        constants["SINE_FILE"] = f"{name}_sine.mem"
    for axis, content in stored.axes:
        files = {"TABLE_FILE": f"{name}_{axis}.mem", "FOURIER_FILE": f"{name}_{axis}_fourier.mem"}
        own = axis_constants(getattr(program, axis), content.fourier.harmonics) | files
        constants |= {f"{axis.upper()}_{key}": value for key, value in own.items()}
    return {f"{name.upper()}_{key}": value for key, value in constants.items()}


def _value(text: str) -> int | str:
    """A number, the content of a string, or what is neither as it stands."""
    if len(text) > 1 and text[0] == text[-1] == '"':
        return text[1:-1]
    number = _NUMBER.fullmatch(text)
    if number is None:
        return text
    sign, base, digits = number.groups()
    try:
        return int(digits, 16 if base == "h" else 10) * (-1 if sign else 1)
    except ValueError:
        return text


def _shown(value: int | str) -> str:
    return repr(value) if isinstance(value, str) else f"{value:x}" if abs(value) >= 1 << 64 else str(value)


def expected_memories(stored: StoredBuild) -> dict[str, bytes]:
    """What the memory files have to hold, by name: made again from the manifest."""
    program = stored.program
    fourier = {axis: content.fourier_words for axis, content in stored.axes}
    return memory_files(stored.manifest.name, program.schedule, program.x, program.y, fourier)


def wrong_memories(folder: Path, stored: StoredBuild) -> tuple[int, list[str]]:
    """How many words the memory files are to have, and in which of them the first wrong one stands."""
    count, wrong = 0, []
    for name, content in expected_memories(stored).items():
        wanted = content.decode("ascii").split()
        count += len(wanted)
        try:
            found = (folder / name).read_text("ascii", "replace").split()
        except OSError as error:
            wrong.append(f"{name}: cannot be read: {error.strerror or error}")
            continue
        if len(found) != len(wanted):
            wrong.append(f"{name}: has {len(found)} words, the manifest {len(wanted)}")
        elif found != wanted:
            at = next(i for i, (word, right) in enumerate(zip(found, wanted, strict=True)) if word != right)
            wrong.append(f"{name}: word {at} is {found[at][:16]}, it is {wanted[at]} in the manifest")
    return count, wrong


def memory_words(path: Path, count: int) -> list[int]:
    """The words of a memory file as a device gets them; ``ValueError`` says what is wrong with it."""
    try:
        lines = path.read_text("ascii").split()
        words = [int(line, 16) for line in lines]
    except FileNotFoundError:
        raise ValueError(f"{path.name} is missing") from None
    except OSError as error:
        raise ValueError(f"{path.name} cannot be read: {error.strerror or error}") from None
    except ValueError:
        raise ValueError(f"{path.name} does not hold one hexadecimal word a line") from None
    if len(words) != count:
        raise ValueError(f"{path.name} has {len(words)} words in place of {count}")
    return words


def copies(folder: Path, names: list[str], into: Path) -> tuple[list[Path], list[str]]:
    """Copies of files of a build, and what is wrong where there are none.

    They are copied since make, and with it Verilator, does not like every path.
    """
    into.mkdir(exist_ok=True)
    wrong = []
    for name in names:
        try:
            shutil.copyfile(folder / name, into / name)
        except FileNotFoundError:
            wrong.append(f"{name} is missing")
        except OSError as error:
            wrong.append(f"{name} cannot be read: {error.strerror or error}")
    return [into / name for name in names], wrong


def some(wrong: list[str]) -> str:
    """A few of many."""
    more = [f"... and {len(wrong) - _MAX_SHOWN} more"] if len(wrong) > _MAX_SHOWN else []
    return "\n".join(wrong[:_MAX_SHOWN] + more)
