"""The C files of a sequencer whose axes have a slow part: of a scan at an angle, or of the output z."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from tablegen.device.dual_program import ScanProgram
from tablegen.emit.c_text import beyond_defaults, literal
from tablegen.emit.constants import LEAST_STORAGE_BITS, axis_constants, sequence_constants, storage_bits
from tablegen.emit.templates import comment_safe, rows, template
from tablegen.emit.turned_content import TurnedContent
from tablegen.fixedpoint.frame_program import FrameProgram
from tablegen.fixedpoint.interpolation import index_bits_of
from tablegen.fixedpoint.spline import WORDS_BEHIND
from tablegen.numerics.arrays import Ints


def slow_c_files(content: TurnedContent, storage: dict[str, int]) -> dict[str, bytes]:
    """Render the tables and the program of a sequencer; ``storage`` is what its runtime is compiled for."""
    context = _context(content, storage)
    sources = {
        f"{content.name}.h": "c/turned.h.j2",
        f"{content.name}.c": "c/turned.c.j2",
        f"{content.name}_program.h": "c/program.h.j2",
        f"{content.name}_program.c": "c/turned_program.c.j2",
    }
    return {name: template(source, context, literal) for name, source in sources.items()}


def slow_constants(content: TurnedContent) -> dict[str, int]:
    """Return all numbers of the header of a scan, those of its schedule and of both axes, without the scan's name."""
    constants = sequence_constants(content.program.schedule)
    for letter, axis in zip("XY", content.axes, strict=True):
        constants |= {f"{letter}_{key}": value for key, value in _axis_constants(axis).items()}
    return constants


def slow_storage(programs: Sequence[ScanProgram]) -> dict[str, int]:
    """Return the options of a runtime that plays programs with a slow part, by their names without ``DAC_``."""
    outputs = [axis.output for each in programs for axis in (each.x, each.y)]
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
        "constants": _axis_constants(program),
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


def _axis_constants(axis: FrameProgram) -> dict[str, int]:
    constants = axis_constants(axis.fast, 0)
    return {key: value for key, value in constants.items() if not key.startswith("FOURIER") and key != "HARMONICS"}


def _with_first_again(words: Ints) -> Ints:
    return np.append(words, words[:WORDS_BEHIND])
