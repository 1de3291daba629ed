"""Verilog-2005 constants, memory files for ``$readmemh`` and an instance, with the Verilog sequencer and its loader."""

import re
from pathlib import Path
from typing import Any

from tablegen.base.reading import BUILD_FILE, read_text
from tablegen.base.resources import resource_folder, verilog_by_turns, verilog_runtime, verilog_slow_part
from tablegen.device.widths import least_widths
from tablegen.emit.banner import different_files
from tablegen.emit.constants import (
    pixel_constants,
    sequence_constants,
    shaping_constants,
    verilog_axis_constants,
    verilog_constants,
)
from tablegen.emit.content import AxisContent, Content
from tablegen.emit.format import Comparison, Format, differing
from tablegen.emit.memory import memory_files
from tablegen.emit.package import VerilogPackage
from tablegen.emit.templates import comment_safe, template
from tablegen.emit.verilog_text import literal, value_range
from tablegen.emit.verilog_top import pixel_memory, sine_memory, top_file, top_parameters

# Patterns of checks are compiled on first use, since a build needs none.
_LOCALPARAM = r"(?m)^localparam\s[^=]*?(\w+)\s*=\s*(.*?)\s*;"
_NUMBER = r"(-?)(?:\d+'s?([dh]))?([0-9a-fA-F]+)"


class Verilog(Format):
    """The format verilog: ``NAME.vh``, ``NAME_top.v`` and one ``.mem`` a table."""

    name = "verilog"
    purpose = "Verilog-2005 for an FPGA: constants, memory files, and the sequencer dac_*.v with an instance"
    file_names = "NAME.vh, NAME_top.v, NAME_*.mem, dac_*.v, program_loader.v"

    def files(self, content: Content) -> dict[str, bytes]:
        """Render the header and the memory files."""
        header = template("verilog/tables.vh.j2", _context(content), literal, range=value_range)
        return {f"{content.name}.vh": header, **top_file(content), **_memories(content), **_files_of_z(content)}

    def runtime(self) -> list[Path]:
        """List the files of the Verilog sequencer, with those of ``ALTERNATE``, and the loader."""
        return [*verilog_runtime(), *verilog_by_turns()]

    def runtime_of_z(self) -> list[Path]:
        """List the modules of a slow part, which the sequencer of z has."""
        return verilog_slow_part()

    def sources(self) -> list[Path]:
        """Return the runtime, also that of a scan at an angle, and the templates."""
        templates = (resource_folder("firmware_templates") / "verilog").glob("*.j2")
        return [*self.runtime(), *self.runtime_of_z(), *templates]

    def check(self, folder: Path, content: Content) -> list[Comparison]:
        """Compare the constants of the header, the words of the memory files, and the text of the files of z."""
        constants, different = wrong_constants(folder, content)
        words, flipped = wrong_memories(folder, content)
        comparisons = [
            Comparison("header", f"{constants} constants", different),
            Comparison("memories", f"{words} words", flipped),
        ]
        if files := _files_of_z(content):
            comparisons.append(Comparison("z", f"{len(files)} files", different_files(folder, files)))
        return comparisons


FORMAT = Verilog()


def verilog_package(content: Content) -> VerilogPackage:
    """Return the Verilog of a build as a package names it."""
    modules = [*FORMAT.runtime(), *(FORMAT.runtime_of_z() if content.z is not None else ())]
    return VerilogPackage(
        content.name,
        content.version,
        content.hash,
        sorted(FORMAT.files(content)),
        sorted(path.name for path in modules),
        content.clocks_per_tick,
        content.schedule.update_rate_hz,
        top_parameters(content),
        content.x.program.output.dac_bits,
        (content.x.program.output.word_bits, content.y.program.output.word_bits),
    )


def wrong_constants(folder: Path, content: Content) -> tuple[int, list[str]]:
    """Return the number of constants of the Verilog header, and those that are missing or wrong in it."""
    name, expected = f"{content.name}.vh", _constants(content)
    try:
        text = read_text(folder / name, BUILD_FILE, errors="replace")
    except OSError as error:
        return len(expected), [f"{name}: cannot be read: {error.strerror or error}"]
    constants: dict[str, int | str] = {key: _value(value) for key, value in re.findall(_LOCALPARAM, text)}
    return len(expected), differing(name, constants, expected)


def wrong_memories(folder: Path, content: Content) -> tuple[int, list[str]]:
    """Return the number of words of the memory files, and the first wrong word of each."""
    count, wrong = 0, []
    for name, right in _memories(content).items():
        expected = right.decode("ascii").split()
        count += len(expected)
        try:
            words = read_text(folder / name, BUILD_FILE, "ascii", "replace").split()
        except OSError as error:
            wrong.append(f"{name}: cannot be read: {error.strerror or error}")
            continue
        if len(words) != len(expected):
            wrong.append(f"{name}: has {len(words)} words, the manifest {len(expected)}")
        elif words != expected:
            at = next(i for i, (word, other) in enumerate(zip(words, expected, strict=True)) if word != other)
            wrong.append(f"{name}: word {at} is {words[at][:16]}, it is {expected[at]} in the manifest")
    return count, wrong


def _memories(content: Content) -> dict[str, bytes]:
    fourier = {axis.axis: axis.fourier_words for axis in content.axes}
    return memory_files(content.name, content.schedule, content.x.program, content.y.program, fourier)


def _files_of_z(content: Content) -> dict[str, bytes]:
    """Render the files of the sequencer that plays the output z; none without z."""
    if content.z is None:
        return {}
    from tablegen.emit.turned_content import content_beside  # here: most scans have no z
    from tablegen.emit.turned_verilog import slow_verilog_files

    beside = content_beside(content)
    assert beside is not None
    return slow_verilog_files(beside)


def _context(content: Content) -> dict[str, Any]:
    """Return the variables of the template."""
    return {
        "clocks_per_tick": content.clocks_per_tick,
        "version": content.version,
        "name": content.name,
        "NAME": content.name.upper(),
        "hash": content.hash,
        "scanner": comment_safe(content.scanner),
        "summary": content.summary,
        "sequence": sequence_constants(content.schedule),
        "widths": least_widths(content.schedule, content.y.program)
        | {"SHAPING": 0}
        | shaping_constants(content)
        | pixel_constants(content.schedule),
        "program_memory": f"{content.name}_program.mem",
        "sine_memory": sine_memory(content),
        "pixel_memory": pixel_memory(content),
        "axes": [_axis(content, axis) for axis in content.axes],
    }


def _axis(content: Content, axis: AxisContent) -> dict[str, Any]:
    prefix = f"{content.name}_{axis.axis}"
    return {
        "PREFIX": prefix.upper(),
        "constants": verilog_axis_constants(axis.program, axis.harmonics),
        "table_memory": f"{prefix}.mem",
        "fourier_memory": f"{prefix}_fourier.mem",
    }


def _constants(content: Content) -> dict[str, int | str]:
    """Return every localparam of the header: numbers, and names of files."""
    name = content.name
    own: dict[str, int | str] = {"HASH": int(content.hash, 16)}
    own |= verilog_constants(content)
    own |= least_widths(content.schedule, content.y.program)
    own |= {"CLOCKS_PER_TICK": content.clocks_per_tick}
    own |= {"PROGRAM_FILE": f"{name}_program.mem", "SINE_FILE": sine_memory(content)}
    own |= {"PIXEL_FILE": pixel_memory(content)} if content.schedule.pixel_table else {}
    for axis in "xy":
        own[f"{axis.upper()}_TABLE_FILE"] = f"{name}_{axis}.mem"
        own[f"{axis.upper()}_FOURIER_FILE"] = f"{name}_{axis}_fourier.mem"
    return {f"{name.upper()}_{key}": value for key, value in own.items()}


def _value(text: str) -> int | str:
    """Read a number, the content of a string, or the text of anything else."""
    if len(text) > 1 and text[0] == text[-1] == '"':
        return text[1:-1]
    number = re.fullmatch(_NUMBER, text)
    if number is None:
        return text
    sign, base, digits = number.groups()
    try:
        return int(digits, 16 if base == "h" else 10) * (-1 if sign else 1)
    except ValueError:
        return text
