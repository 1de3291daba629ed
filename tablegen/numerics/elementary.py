"""Correctly rounded exp and log10 of single numbers.

The C library's differ in the last place between versions and processors; integers and the decimal module do not.
"""

from decimal import Context, Decimal

_CONTEXT = Context(prec=40)
# exp is computed in units of 2^-160: the result is right to 2^-145 of itself, and no exp of a double is nearer than
# 2^-120 to the middle between two doubles.
_BITS = 160
_ONE = 1 << _BITS
_LN2 = 1013035739299659071135698605846798551586536899366  # ln 2 in these units, rounded down
_HALVINGS = 8
_LEAST, _MOST = -750.0, 710.0  # beyond these the result is 0, or larger than any double


def exp(x: float) -> float:
    """Return e to the power x.

    Raises
    ------
    OverflowError
        If the result is larger than any double.
    """
    if x < _LEAST:
        return 0.0
    if x > _MOST:
        raise OverflowError(f"exp({x:g}) is larger than any double")
    numerator, denominator = x.as_integer_ratio()
    doublings, rest = divmod((numerator << _BITS) // denominator, _LN2)
    rest >>= _HALVINGS
    total = term = _ONE
    n = 1
    while term:  # the Taylor series
        term = (term * rest >> _BITS) // n
        total += term
        n += 1
    for _ in range(_HALVINGS):
        total = total * total >> _BITS
    # One division of integers, which rounds once, for subnormal results too.
    return (total << doublings) / _ONE if doublings >= 0 else total / (_ONE << -doublings)


def log10(x: float) -> float:
    """Return the decimal logarithm of x > 0."""
    return float(Decimal(x).log10(_CONTEXT))
