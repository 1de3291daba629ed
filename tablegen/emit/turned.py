"""The files of a scan at an angle by format: C99 and Verilog for the sequencers with a slow part."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.base.reading import BUILD_FILE, read_bytes
from tablegen.base.resources import c_link, c_runtime, c_store
from tablegen.device.dual_program import ScanProgram
from tablegen.emit.constants import LEAST_STORAGE_BITS, axis_constants, sequence_constants, storage_bits
from tablegen.emit.formats.c import beyond_defaults, literal
from tablegen.emit.templates import comment_safe, rows, template
from tablegen.emit.turned_content import TurnedContent
from tablegen.emit.turned_verilog import turned_verilog_files, turned_verilog_runtime
from tablegen.fixedpoint.interpolation import index_bits_of
from tablegen.fixedpoint.spline import WORDS_BEHIND
from tablegen.numerics.arrays import Ints

TURNED_FORMATS = ("c", "verilog")


def require_format(format_name: str, program: ScanProgram) -> None:
    """Check that a format of ``TURNED_FORMATS`` can hold a scan at an angle.

    Raises
    ------
    Unphysical
        If it is Verilog, and the output is shaped.
    """
    if format_name == "verilog" and max(axis.output.shaping.order for axis in (program.x, program.y)):
        raise Unphysical(
            "the Verilog sequencer shapes no scan at an angle; take the format c, or leave shaping out of the dac"
        )


def turned_files(content: TurnedContent, formats: Iterable[str]) -> dict[str, bytes]:
    """Render the files that were made for a scan at an angle in some of ``TURNED_FORMATS``, by name."""
    makers = {"c": _c_files, "verilog": turned_verilog_files}
    return {name: text for each in formats for name, text in makers[each](content).items()}


def turned_runtime(formats: Iterable[str]) -> dict[str, bytes]:
    """Read the files of the sequencers in these formats, by name."""
    runtimes = {"c": lambda: (*c_runtime(), *c_link(), *c_store()), "verilog": turned_verilog_runtime}
    return {path.name: read_bytes(path, BUILD_FILE) for each in formats for path in runtimes[each]()}


def _c_files(content: TurnedContent) -> dict[str, bytes]:
    storage = _storage(content.program, content.z)
    files: dict[str, bytes] = {}
    for each in (content, content.content_of_z):
        if each is not None:
            context = _context(each, storage)
            sources = {
                f"{each.name}.h": "c/turned.h.j2",
                f"{each.name}.c": "c/turned.c.j2",
                f"{each.name}_program.h": "c/program.h.j2",
                f"{each.name}_program.c": "c/turned_program.c.j2",
            }
            files |= {name: template(source, context, literal) for name, source in sources.items()}
    return files


def turned_options(program: ScanProgram, z: ScanProgram | None = None) -> dict[str, int]:
    """Return the macros that the runtime and an application are compiled with; ``z`` is what plays beside a scan."""
    return {f"DAC_{key}": value for key, value in _storage(program, z).items()}


def _storage(program: ScanProgram, z: ScanProgram | None) -> dict[str, int]:
    outputs = [axis.output for each in (program, z) if each is not None for axis in (each.x, each.y)]
    widest, order = max(each.word_bits for each in outputs), max(each.shaping.order for each in outputs)
    widths = {"TABLE_STORAGE_BITS": LEAST_STORAGE_BITS, "OUTPUT_STORAGE_BITS": storage_bits(widest)}
    options = widths | {"SPLINE": 1, "SLOW_PART": 1}
    return options | ({"SHAPING": order} if order else {})


def _context(content: TurnedContent, storage: dict[str, int]) -> dict[str, Any]:
    return {
        "version": content.version,
        "name": content.name,
        "NAME": content.name.upper(),
        "hash": content.hash,
        "scanner": comment_safe(content.scanner),
        "summary": content.summary,
        "sequence": sequence_constants(content.program.schedule),
        "storage": storage,
        "needs": beyond_defaults(storage),
        "axes": [_axis(content, axis) for axis in "xy"],
    }


def _axis(content: TurnedContent, axis: str) -> dict[str, Any]:
    program = content.axes["xy".index(axis)]
    prefix = f"{content.name}_{axis}"
    constants = {
        key: value
        for key, value in axis_constants(program.fast, 0).items()
        if not key.startswith("FOURIER") and key != "HARMONICS"
    }
    arrays = {
        "table": (f"{content.name}_word", _with_first_again(program.fast.words)),
        "second": ("int8_t", program.second),
        "gains": ("int32_t", program.gains.words),
        "ratios": ("int16_t", program.ratios.words),
        "slow": (f"{content.name}_word", _with_first_again(program.slow.words)),
    }
    return {
        "axis": axis,
        "prefix": prefix,
        "PREFIX": prefix.upper(),
        "constants": constants,
        "shaped": bool(program.output.shaping.order),
        "arrays": [
            {"name": f"{prefix}_{key}", "type": kind, "length": len(words), "rows": rows(words)}
            for key, (kind, words) in arrays.items()
        ],
        "gain_spacing": program.gains.spacing,
        "ratio_spacing": program.ratios.spacing,
        "gain_knots": len(program.gains.words),
        "ratio_knots": len(program.ratios.words),
        "slow_index_bits": index_bits_of(len(program.slow.words)),
        "slow_gain_word": program.slow.gain_word,
        "slow_offset_word": program.slow.offset_word,
    }


def _with_first_again(words: Ints) -> Ints:
    return np.append(words, words[:WORDS_BEHIND])
