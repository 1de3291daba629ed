"""The instance of a scan in Verilog: the sequencer with its boot, its parameters and the words of its converters."""

from typing import Any

from tablegen.device.by_turns import LEAST_CLOCKS, not_by_turns
from tablegen.device.widths import least_widths
from tablegen.emit.constants import DEGREES, memory_index_bits, pixel_constants, shaping_constants
from tablegen.emit.content import MAX_RENDERED_HARMONICS, AxisContent, Content
from tablegen.emit.templates import template

COUNTERS = {"TICK_BITS": 24, "LINE_BITS": 16, "PERIOD_BITS": 31, "COUNT_BITS": 16, "START_CLOCKS": 4096}
"""Parameters of every top: widths of counters that serve every program, and the clocks before a boot."""
_PORT = len("[4*COUNT_BITS-1:0]")  # characters of the widest range of a port


def top_file(content: Content) -> dict[str, bytes]:
    """Render ``NAME_top.v``, by its name."""
    return {f"{content.name}_top.v": template("verilog/top.v.j2", _context(content), str)}


def sine_memory(content: Content) -> str:
    """Return the name of the file of the sine; empty where no table is rendered."""
    return f"{content.name}_sine.mem" if content.sine_index_bits else ""


def pixel_memory(content: Content) -> str:
    """Return the name of the file of the ticks of each pixel; empty where pixels are equal."""
    return f"{content.name}_pixels.mem" if content.schedule.pixel_table else ""


def top_parameters(content: Content) -> dict[str, int]:
    """Return the parameters of ``NAME_top`` with their defaults, in order."""
    pixels = {"PIXEL_INDEX_BITS": pixel_constants(content.schedule)["PIXEL_INDEX_BITS"]}
    return {
        "CLOCKS_PER_TICK": content.clocks_per_tick,
        "LOW_AREA": 0,
        "PLAIN_MULTIPLIER": 0,
        "ALTERNATE": 0,
        **({"HARMONICS": _most_harmonics(content)} if content.renders_tables else {}),
        "SHAPING": shaping_constants(content).get("SHAPING", 0),
        **(pixels if content.schedule.pixel_table else {}),
        "COMMIT_MODES": 0,
        **COUNTERS,
    }


def _most_harmonics(content: Content) -> int:
    """Return the number of harmonics that fills the memories of a rendering."""
    highest = max(axis.harmonics for axis in content.axes)
    return min((1 << highest.bit_length()) - 1, MAX_RENDERED_HARMONICS)


def _context(content: Content) -> dict[str, Any]:
    """Return the variables of the template."""
    highest = max(axis.harmonics for axis in content.axes)
    modes = {axis.program.mode for axis in content.axes}
    dac_bits = content.x.program.output.dac_bits
    obstacle = not_by_turns(content.x.program, content.y.program)
    return {
        "version": content.version,
        "name": content.name,
        "hash": content.hash,
        "clocks_per_tick": content.clocks_per_tick,
        "widths": least_widths(content.schedule, content.y.program),
        "shaping": shaping_constants(content).get("SHAPING", 0),
        "cubic": "cubic" in modes,
        "not_by_turns": obstacle and "_".join(obstacle).replace(" ", "_"),
        "clocks_by_turns": LEAST_CLOCKS,
        "fourier": int(content.renders_tables),
        "least_harmonics": highest,
        "harmonics": _most_harmonics(content),
        "program_memory": f"{content.name}_program.mem",
        "sine_memory": sine_memory(content),
        "pixels": content.schedule.pixels if content.schedule.pixel_table else 0,
        "pixel_index_bits": pixel_constants(content.schedule)["PIXEL_INDEX_BITS"],
        "pixel_memory": pixel_memory(content),
        "dac_bits": dac_bits,
        "code_range": port_range(dac_bits),
        "pins": (),
        "axes": [_axis(content, axis) for axis in content.axes],
    }


def _axis(content: Content, axis: AxisContent) -> dict[str, Any]:
    program, output, prefix = axis.program, axis.program.output, f"{content.name}_{axis.axis}"
    return {
        "axis": axis.axis,
        "letter": axis.axis.upper(),
        "degree": DEGREES[program.mode],
        "index_bits": memory_index_bits(program),
        "bits": program.bits,
        "table_words": len(program.words),
        "table_memory": f"{prefix}.mem",
        "harmonics": axis.harmonics,
        "fourier_memory": f"{prefix}_fourier.mem",
        "word_bits": output.word_bits,
        "word_range": port_range(output.word_bits),
        "twos_complement": int(output.coding == "twos-complement"),
        "left_aligned": int(output.align == "left"),
    }


def port_range(bits: int) -> str:
    """Return the range of a port of so many bits, as wide as the widest one."""
    return f"[{bits - 1}:0]".ljust(_PORT)
