"""What all templates in C share: literals, and the options that a file needs beyond the defaults of the runtime."""

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
