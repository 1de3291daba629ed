"""What all templates in Verilog share: literals, and the ranges that hold them."""


def literal(value: int) -> str:
    """Spell an integer in Verilog, of 32 or 64 bits."""
    width = _width(value)
    return f"{width}'sd{value}" if value >= 0 else f"-{width}'sd{-value}"


def value_range(value: int) -> str:
    """Return the range of a localparam that holds an integer."""
    return "[31:0]" if _width(value) == 32 else "[63:0]"


def _width(value: int) -> int:
    return 32 if -0x7FFFFFFF <= value <= 0x7FFFFFFF else 64
