"""Correctly rounded exp and log10 of single numbers.

The C library's differ in the last place between versions and processors; the decimal module's do not.
"""

from decimal import Context, Decimal

_CONTEXT = Context(prec=40)


def exp(x: float) -> float:
    """Return e to the power x."""
    return float(Decimal(x).exp(_CONTEXT))


def log10(x: float) -> float:
    """Return the decimal logarithm of x > 0."""
    return float(Decimal(x).log10(_CONTEXT))
