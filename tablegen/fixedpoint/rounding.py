"""Rounding and saturation. Ties go up (towards plus infinity): floor(x + 1/2), one addition and a shift in hardware."""

from typing import TypeVar

import numpy as np

from tablegen.numerics.arrays import Floats, Ints

Integer = TypeVar("Integer", int, Ints)


def round_half_up(x: Floats) -> Ints:
    """Return the nearest integers, ties up.

    Parameters
    ----------
    x
        Finite numbers with |x| < 2^53, any shape.

    Returns
    -------
    Ints
        Shape of ``x``.
    """
    whole = np.floor(x)
    # Not floor(x + 0.5): that sum rounds by itself, up to 1 for 0.49999999999999994.
    return (whole + (x - whole >= 0.5)).astype(np.int64)


def round_number(x: float) -> int:
    """Return ``round_half_up`` of one number."""
    return int(round_half_up(np.asarray(x, dtype=np.float64)))


def shift_round(value: Integer, bits: int) -> Integer:
    """Return value / 2^bits, to the nearest integer, ties up; bits >= 1, |value| < 2^62. An arithmetic shift."""
    return (value + (1 << (bits - 1))) >> bits


def signed_limits(bits: int) -> tuple[int, int]:
    """Return the least and greatest two's complement number of ``bits`` bits."""
    return -(1 << (bits - 1)), (1 << (bits - 1)) - 1


def saturate(value: Ints, bits: int) -> Ints:
    """Return ``value`` limited to the signed range of ``bits`` bits.

    Parameters
    ----------
    value
        Integers of any size and shape.
    bits
        Word length, sign included.

    Returns
    -------
    Ints
        Shape of ``value``.
    """
    low, high = signed_limits(bits)
    return np.clip(value, low, high)
