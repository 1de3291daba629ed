"""Formats of numbers and words on the page."""

from markupsafe import Markup, escape


def figure(value: float, digits: int = 4, signed: bool = False) -> str:
    """Format a number in significant digits, without an exponent unless it is needed; 0.000 below 0.0005."""
    sign = "+" if signed and value >= 0.0005 else ""
    if abs(value) < 0.0005:
        return "0.000"
    if 10.0**digits <= abs(value) < 1e9:
        return f"{sign}{value:.0f}"
    return f"{sign}{value:.{digits}g}"


def hertz(value: float) -> str:
    """Format a frequency with its unit."""
    for least, unit in ((1e6, "MHz"), (1e3, "kHz")):
        if value >= least:
            return f"{value / least:.4g} {unit}"
    return f"{value:.4g} Hz"


def visible(text: str) -> str:
    """Escape control characters and those that change the direction of writing."""
    return text if text.isprintable() else "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


def coded(text: str) -> Markup:
    """Return text with parts between backticks as code; everything is escaped."""
    parts = visible(text).split("`")
    if len(parts) % 2 == 0:  # an odd one is no mark
        return escape(visible(text))
    return Markup("").join(
        Markup("<code>{}</code>").format(part) if i % 2 else escape(part) for i, part in enumerate(parts)
    )
