"""What the templates see: every number already text, every name already whole."""

from typing import Any

from tablegen import __version__
from tablegen.certificate.certificate import Certificate
from tablegen.certificate.summary import summary
from tablegen.emit.constants import axis_constants, sequence_constants
from tablegen.fixedpoint.output import GAIN_BITS
from tablegen.fixedpoint.phase import PHASE_BITS
from tablegen.fixedpoint.rounding import signed_limits
from tablegen.fixedpoint.synthesis import sine_periods
from tablegen.numerics.arrays import Ints
from tablegen.planning.line_plan import LinePlan, Plan

_WORDS_PER_ROW = 10


def template_context(plan: Plan, certificates: dict[str, Certificate], digest: str) -> dict[str, Any]:
    """The context of every template."""
    return {
        "version": __version__,
        "name": plan.name,
        "NAME": plan.name.upper(),
        "hash": digest,
        "header_only": plan.header_only,
        "scanner": comment_safe(plan.scanner),
        "summary": summary(plan, certificates),
        "sequence": {key: _Number(value) for key, value in sequence_constants(plan.schedule).items()},
        "phase_bits": PHASE_BITS,
        "least_gain": _Number(signed_limits(GAIN_BITS)[0]),
        "greatest_gain": _Number(signed_limits(GAIN_BITS)[1]),
        "program_memory": f"{plan.name}_program.mem",
        "sine_memory": f"{plan.name}_sine.mem",
        "sine": _sine(plan),
        "axes": [_axis(plan, line) for line in plan.lines],
    }


def comment_safe(text: str) -> str:
    """Text on one line of ASCII that can neither begin nor end a comment, nor continue a line."""
    plain = text.encode("unicode_escape").decode("ascii").replace("\\", "/")
    return plain.replace("*/", "* /").replace("/*", "/ *").replace("?", ".").rstrip()  # ??/ is a backslash in C99


class _Number:
    """An integer and its spellings."""

    def __init__(self, value: int) -> None:
        self.c = _c_literal(value)
        self.verilog = _verilog_literal(value)
        self.verilog_range = "[31:0]" if _verilog_width(value) == 32 else "[63:0]"


def _c_literal(value: int) -> str:
    if value > 0x7FFFFFFF or value < -0x7FFFFFFF:
        return f"UINT32_C({value})" if 0 <= value <= 0xFFFFFFFF else f"INT64_C({value})"
    if value > 32767 or value < -32767:  # an int has 16 bits on some microcontrollers
        return f"INT32_C({value})"
    return str(value) if value >= 0 else f"({value})"


def _verilog_width(value: int) -> int:
    return 32 if -0x7FFFFFFF <= value <= 0x7FFFFFFF else 64


def _verilog_literal(value: int) -> str:
    width = _verilog_width(value)
    return f"{width}'sd{value}" if value >= 0 else f"-{width}'sd{-value}"


def _axis(plan: Plan, line: LinePlan) -> dict[str, Any]:
    program = line.program
    prefix = f"{plan.name}_{line.axis}"
    constants = axis_constants(program, line.fourier.harmonics)
    return {
        "axis": line.axis,
        "prefix": prefix,
        "PREFIX": prefix.upper(),
        "constants": {key: _Number(value) for key, value in constants.items()},
        "word_type": _word_type(plan),
        "table_rows": _rows(program.words),
        "fourier_rows": _rows(line.fourier.in_order),
        "interpolated": program.mode == "interpolated",
        "table_memory": f"{prefix}.mem",
        "fourier_memory": f"{prefix}_fourier.mem",
        "lines_per_period": "1" if line.axis == "x" else f"{plan.name.upper()}_FRAME_LINES",
    }


def _word_type(plan: Plan) -> str:
    """That of both tables, since the C runtime is compiled for one."""
    return "int16_t" if max(line.program.bits for line in plan.lines) <= 16 else "int32_t"


def _sine(plan: Plan) -> dict[str, Any] | None:
    """The sine from which a device renders Fourier words, for the longest interpolated table; None without one."""
    index_bits = max(line.program.index_bits for line in plan.lines)
    if not index_bits:
        return None
    words = sine_periods(index_bits)
    constants = {"SINE_INDEX_BITS": index_bits, "SINE_LENGTH": len(words)}
    return {"constants": {key: _Number(value) for key, value in constants.items()}, "rows": _rows(words)}


def _rows(words: Ints) -> list[str]:
    values = [str(word) for word in words.tolist()]
    return [", ".join(values[i : i + _WORDS_PER_ROW]) for i in range(0, len(values), _WORDS_PER_ROW)]
