"""Correctly rounded exp and log10.

The C library's differ in the last place between versions and processors; integers and the decimal module do not. Of
many numbers exp is computed with pairs of doubles, by additions and products alone, which every processor rounds alike;
a number that these do not decide goes to the integers.
"""

from decimal import Context, Decimal
from functools import cache

import numpy as np

from tablegen.numerics.arrays import Floats

_CONTEXT = Context(prec=40)
# exp is computed in units of 2^-160: the result is right to 2^-145 of itself, and no exp of a double is nearer than
# 2^-120 to the middle between two doubles.
_BITS = 160
_ONE = 1 << _BITS
_LN2 = 1013035739299659071135698605846798551586536899366  # ln 2 in these units, rounded down
_HALVINGS = 8
_LEAST, _MOST = -750.0, 710.0  # beyond these the result is 0, or larger than any double

_STEPS = 64  # of a doubling, for which the table of pairs has powers
_MOST_OF_PAIRS = 700.0  # beyond it a result may be subnormal or too large
_PARTS_OF_STEP = 36  # bits of the first parts of a step's logarithm: a product with a whole number of steps is exact
_PAIR_ERROR = 2.0**-70  # of a result, more than a pair is wrong by: the products leave 2^-80
_SPLIT = 134217729.0  # 2^27 + 1
Pair = tuple[Floats, Floats]  # a number as the sum of a double and one below its last place


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


def exps(x: Floats) -> Floats:
    """Return ``exp`` of many numbers, with every bit of it.

    Parameters
    ----------
    x
        Finite numbers, any shape.

    Returns
    -------
    Floats
        Shape of ``x``.

    Raises
    ------
    OverflowError
        As ``exp``.
    """
    flat = np.ravel(np.asarray(x, dtype=np.float64))
    inside = np.clip(flat, -_MOST_OF_PAIRS, _MOST_OF_PAIRS)
    first, second, third, high, low = _step_parts()
    steps = np.rint(inside * (1.0 / (first + second)))
    # The rest of the step: |r| < 0.0055.
    rest = _sum_of(inside, -steps * first)
    more = _sum_of(rest[0], -steps * second)
    r = _sum_of(more[0], more[1] + rest[1] - steps * third)
    # 1 + r + r^2 / 2 + r^3 / 6 in pairs, and r^4 / 24 + ... + r^10 / 10!, of which the error is below 2^-83.
    square = _product_of(r, r)
    cube = _product_of(_product_of(square, r), _sixth(flat))
    tail = np.full_like(flat, 1.0 / 10.0)
    for n in range(9, 4, -1):
        tail = (1.0 + r[0] * tail) / n
    tail = (1.0 + r[0] * tail) * (square[0] * square[0]) / 24.0
    total = _sum_of(cube[0], tail)
    total = _sum_of(0.5 * square[0], total[0] + (total[1] + cube[1] + 0.5 * square[1]))
    total = _added(r, total)
    total = _added((np.ones_like(flat), np.zeros_like(flat)), total)
    whole, index = np.divmod(steps.astype(np.int64), _STEPS)
    value, below = _product_of((high[index], low[index]), total)
    out = np.ldexp(value + below, whole.astype(np.int32))
    room = _PAIR_ERROR * value
    known = (value + (below + room) == value + (below - room)) & (inside == flat)
    for at in np.flatnonzero(~known).tolist():
        out[at] = exp(float(flat[at]))
    return np.asarray(out.reshape(np.shape(x)))


@cache
def _step_parts() -> tuple[float, float, float, Floats, Floats]:
    """Return the logarithm of a step in three parts, and the pairs of its powers up to a doubling."""
    context, parts = Context(prec=60), []
    rest = context.divide(Decimal(_LN2), Decimal(_STEPS * _ONE))
    for _ in range(2):
        bits = _PARTS_OF_STEP - rest.adjusted() * 10 // 3
        part = int(context.multiply(rest, Decimal(1 << bits))) / (1 << bits)
        parts.append(part)
        rest = context.subtract(rest, Decimal(part))
    powers = [context.power(Decimal(2), context.divide(Decimal(n), Decimal(_STEPS))) for n in range(_STEPS)]
    high = [float(power) for power in powers]
    low = [float(context.subtract(power, Decimal(one))) for power, one in zip(powers, high, strict=True)]
    return parts[0], parts[1], float(rest), np.array(high), np.array(low)


def _sixth(like: Floats) -> Pair:
    sixth = 1.0 / 6.0
    return np.full_like(like, sixth), np.full_like(like, sixth / (1 << 54))  # 1/6 is periodic in its bits: 2^-54 of it


def _sum_of(a: Floats, b: Floats) -> Pair:
    """Return a sum, and what its rounding has lost (Knuth)."""
    total = a + b
    part = total - a
    return total, (a - (total - part)) + (b - part)


def _added(a: Pair, b: Pair) -> Pair:
    total, lost = _sum_of(a[0], b[0])
    return _sum_of(total, lost + (a[1] + b[1]))


def _product_of(a: Pair, b: Pair) -> Pair:
    """Return the product of pairs (Dekker)."""
    scaled_a, scaled_b = _SPLIT * a[0], _SPLIT * b[0]
    high_a, high_b = scaled_a - (scaled_a - a[0]), scaled_b - (scaled_b - b[0])
    low_a, low_b = a[0] - high_a, b[0] - high_b
    product = a[0] * b[0]
    lost = low_a * low_b - (((product - high_a * high_b) - low_a * high_b) - high_a * low_b)
    return _sum_of(product, lost + (a[0] * b[1] + a[1] * b[0]))
