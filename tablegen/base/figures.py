"""Figures and paths in messages: figures are rounded to the side on which their promise still holds."""

from decimal import ROUND_CEILING, ROUND_FLOOR, Context
from pathlib import Path


def at_most(value: float, digits: int = 4) -> str:
    """Return a value in that many significant digits, rounded down."""
    return _rounded(value, digits, ROUND_FLOOR)


def at_least(value: float, digits: int = 4) -> str:
    """Return a value in that many significant digits, rounded up."""
    return _rounded(value, digits, ROUND_CEILING)


def _rounded(value: float, digits: int, rounding: str) -> str:
    return f"{float(Context(prec=digits, rounding=rounding).create_decimal(repr(value))):.{digits}g}"


def shown_path(path: Path) -> str:
    """Return a path on one line, shortened if it is very long."""
    text = str(path)
    text = text if text.isprintable() else ascii(text)
    return text if len(text) <= 200 else f"{text[:100]}...{text[-97:]}"
