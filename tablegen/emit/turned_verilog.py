"""The Verilog of a scan at an angle: constants, memory files, and an instance of the sequencer with a slow part."""

from pathlib import Path
from typing import Any

from tablegen.base.resources import verilog_runtime, verilog_slow_part
from tablegen.device.clocks import least_slow_clocks
from tablegen.device.registers import program_words
from tablegen.device.widths import least_widths
from tablegen.emit.constants import sequence_constants, verilog_axis_constants
from tablegen.emit.memory import Memory, memory_file
from tablegen.emit.templates import comment_safe, template
from tablegen.emit.turned_content import TurnedContent
from tablegen.emit.verilog_text import literal, value_range
from tablegen.emit.verilog_top import COUNTERS, port_range
from tablegen.fixedpoint.frame_program import FrameProgram
from tablegen.fixedpoint.interpolation import index_bits_of
from tablegen.fixedpoint.output import GAIN_BITS
from tablegen.fixedpoint.synthesis import WORD_BITS

# Of a table that is rendered, or is without a slow part; GAIN_WORD and OFFSET_WORD are those of the slow table here.
_LEFT_OUT = frozenset({"HARMONICS", "FOURIER_LENGTH", "FOURIER_FRACTION_BITS", "HOLD_TICKS"})


def turned_verilog_files(content: TurnedContent) -> dict[str, bytes]:
    """Render ``NAME.vh``, ``NAME_top.v`` and the memory files, by name, and those of ``NAME_z`` where there is z."""
    contents = [each for each in (content, content.content_of_z) if each is not None]
    return {name: text for each in contents for name, text in slow_verilog_files(each).items()}


def slow_verilog_files(content: TurnedContent) -> dict[str, bytes]:
    """Render constants, top and memory files of one sequencer whose axes have a slow part, by name."""
    context = _context(content)
    files = {
        f"{content.name}.vh": template("verilog/turned.vh.j2", context, literal, range=value_range),
        f"{content.name}_top.v": template("verilog/turned_top.v.j2", context, str),
    }
    memories = {f"{content.name}_{one.name}.mem": memory_file(one.words, one.bits) for one in turned_memories(content)}
    return files | memories


def turned_verilog_runtime() -> list[Path]:
    """List the files of the Verilog sequencer with those of its slow part."""
    return [*verilog_runtime(), *verilog_slow_part()]


def turned_memories(content: TurnedContent) -> list[Memory]:
    """Return the tables of a build: those of x and y, the words of the slow parts, and the registers."""
    program = content.program
    x, y = content.axes
    slow = [int(word) for axis in (x, y) for words in slow_parts(axis) for word in words]
    bits = max(GAIN_BITS, x.fast.bits, y.fast.bits)
    return [
        Memory("x", x.fast.words.tolist(), x.fast.bits, "table of x"),
        Memory("y", y.fast.words.tolist(), y.fast.bits, "table of y"),
        Memory("slow", slow, bits, "slow parts of x and y"),
        Memory("program", program_words(program.schedule, x, y), WORD_BITS, "registers of the program"),
    ]


def slow_parts(axis: FrameProgram) -> tuple[list[int], list[int], list[int], list[int]]:
    """Return the words of region 5 or 6 in the order of their addresses: second and slow table, gains, ratios."""
    parts = axis.second, axis.slow.words, axis.gains.words, axis.ratios.words
    second, slow, gains, ratios = (part.tolist() for part in parts)
    return second, slow, gains, ratios


def turned_constants(content: TurnedContent) -> dict[str, int]:
    """Return all numbers of the header by their names without the scan's."""
    constants = sequence_constants(content.program.schedule) | _device(content)
    for letter, axis in zip("XY", content.axes, strict=True):
        constants |= {f"{letter}_{key}": value for key, value in _constants(axis).items()}
    return constants


def _device(content: TurnedContent) -> dict[str, int]:
    """Return the parameters of a sequencer that plays the scan, and its clocks."""
    y = content.axes[1].fast
    return {
        "SLOW_PART": 1,
        "LOW_AREA": 1,
        "SLOW_INDEX_BITS": _slow_index_bits(content),
        "SHAPING": content.program.shaping_order,
        **least_widths(content.program.schedule, y),
        "CLOCKS": least_slow_clocks(content.program),
        "CLOCKS_PER_TICK": content.clocks_per_tick,
    }


def turned_top_parameters(content: TurnedContent) -> dict[str, int]:
    """Return the parameters of ``NAME_top`` with their defaults, in order."""
    return {
        "CLOCKS_PER_TICK": content.clocks_per_tick,
        "SLOW_INDEX_BITS": _slow_index_bits(content),
        "SHAPING": content.program.shaping_order,
        "COMMIT_MODES": 0,
        **COUNTERS,
    }


def _slow_index_bits(content: TurnedContent) -> int:
    return max(index_bits_of(len(axis.slow.words)) for axis in content.axes)


def _constants(axis: FrameProgram) -> dict[str, int]:
    own = {key: value for key, value in verilog_axis_constants(axis.fast, 0).items() if key not in _LEFT_OUT}
    return own | {
        "GAIN_WORD": axis.slow.gain_word,
        "OFFSET_WORD": axis.slow.offset_word,
        "SLOW_LENGTH": len(axis.slow.words),
        "KNOTS": len(axis.gains.words),
        "KNOT_LINES": axis.gains.spacing,
    }


def _context(content: TurnedContent) -> dict[str, Any]:
    """Return the variables of both templates."""
    name, dac_bits = content.name, content.axes[0].output.dac_bits
    files = {
        "PROGRAM_FILE": f"{name}_program.mem",
        "X_TABLE_FILE": f"{name}_x.mem",
        "Y_TABLE_FILE": f"{name}_y.mem",
        "SLOW_FILE": f"{name}_slow.mem",
    }
    return {
        "version": content.version,
        "name": name,
        "NAME": name.upper(),
        "hash": content.hash,
        "scanner": comment_safe(content.scanner),
        "summary": content.summary,
        "sequence": sequence_constants(content.program.schedule),
        "device": _device(content),
        "widths": least_widths(content.program.schedule, content.axes[1].fast),
        "clocks_per_tick": content.clocks_per_tick,
        "least_clocks": least_slow_clocks(content.program),
        "shaping_clocks": least_slow_clocks(content.program, shaping=True),
        "shaping": content.program.shaping_order,
        "slow_index_bits": _slow_index_bits(content),
        "slow_word_bits": turned_memories(content)[2].bits,
        "files": files,
        "program_memory": files["PROGRAM_FILE"],
        "slow_memory": files["SLOW_FILE"],
        "dac_bits": dac_bits,
        "code_range": port_range(dac_bits),
        "pins": (),
        "axes": [_axis(content, axis) for axis in "xy"],
    }


def _axis(content: TurnedContent, axis: str) -> dict[str, Any]:
    program = content.axes["xy".index(axis)]
    constants, prefix = _constants(program), f"{content.name}_{axis}"
    return {
        "axis": axis,
        "letter": axis.upper(),
        "PREFIX": prefix.upper(),
        "constants": constants,
        "degree": constants["INTERPOLATED"],
        "index_bits": constants["INDEX_BITS"],
        "bits": program.fast.bits,
        "table_words": len(program.fast.words),
        "table_memory": f"{prefix}.mem",
        "slow_words": len(program.slow.words),
        "knots": len(program.gains.words),
        "word_range": port_range(program.output.word_bits),
        "word_bits": program.output.word_bits,
        "twos_complement": constants["DAC_TWOS_COMPLEMENT"],
        "left_aligned": constants["DAC_LEFT_ALIGNED"],
    }
