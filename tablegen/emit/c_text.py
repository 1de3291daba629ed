"""What all C shares: literals, and the options that a file needs beyond the defaults of the runtime, or defines."""

from collections.abc import Mapping

from tablegen.emit.constants import LEAST_STORAGE_BITS


def literal(value: int) -> str:
    """Spell an integer in C, of a type that holds it on every machine."""
    if value > 0x7FFFFFFF or value < -0x7FFFFFFF:
        return f"UINT32_C({value})" if 0 <= value <= 0xFFFFFFFF else f"INT64_C({value})"
    if value > 32767 or value < -32767:  # an int has 16 bits on some microcontrollers
        return f"INT32_C({value})"
    return str(value) if value >= 0 else f"({value})"


def beyond_defaults(options: Mapping[str, int]) -> dict[str, int]:
    """Return the options above the defaults of a runtime, by their names without ``DAC_``."""
    return {key: value for key, value in options.items() if not key.endswith("_BITS") or value > LEAST_STORAGE_BITS}


def option_lines(options: Mapping[str, int]) -> list[str]:
    """Return lines that define each option of the runtime, unless it has a value already."""
    lines = ((f"#ifndef {name}", f"#define {name} {value}", "#endif") for name, value in options.items())
    return [line for three in lines for line in three]
