"""Array types, and sums whose order does not depend on the processor."""

from collections.abc import Iterator, Sequence
from typing import Any, TypeAlias

import numpy as np

# ``numpy.typing.NDArray`` in full: importing numpy.typing is 0.3 % of a build.
Shape: TypeAlias = tuple[Any, ...]
Floats: TypeAlias = np.ndarray[Shape, np.dtype[np.float64]]
Ints: TypeAlias = np.ndarray[Shape, np.dtype[np.int64]]
Bools: TypeAlias = np.ndarray[Shape, np.dtype[np.bool_]]
Complexes: TypeAlias = np.ndarray[Shape, np.dtype[np.complex128]]
FloatsLike: TypeAlias = float | Sequence[float] | np.ndarray[Shape, np.dtype[np.floating]] | Ints

_BLOCK = 1 << 15  # values that are summed at a time, so that they fit the cache


def freeze(*arrays: np.ndarray[Shape, np.dtype[np.generic]]) -> None:
    """Make arrays read-only, so that the contents of a plan cannot change."""
    for array in arrays:
        array.setflags(write=False)


def tree_sum(values: Floats) -> Floats:
    """Sum along the last axis, in pairs at half the length, an order that every machine shares.

    Parameters
    ----------
    values
        Any shape (..., n); not changed.

    Returns
    -------
    Floats
        The sums, shape (...).
    """
    rows = max(_BLOCK // max(values.shape[-1], 1), 1)
    flat = values.reshape(-1, values.shape[-1])
    if len(flat) <= rows:
        return _tree_sum(values)
    sums = np.concatenate([_tree_sum(flat[first : first + rows]) for first in range(0, len(flat), rows)])
    return sums.reshape(values.shape[:-1])


def _tree_sum(values: Floats) -> Floats:
    count = values.shape[-1]
    half = (1 << max(count - 1, 0).bit_length()) // 2
    if not half:
        return values[..., 0].copy() if count else np.zeros(values.shape[:-1])
    sums = values[..., :half].copy()
    sums[..., : count - half] += values[..., half:]
    sums[..., count - half :] += 0.0  # as if zeros followed the values, so that -0.0 becomes 0.0
    while half > 1:
        half //= 2
        sums[..., :half] += sums[..., half : 2 * half]
    return sums[..., 0]


def tree_sum_down(values: Floats) -> Floats:
    """Sum along the first axis with every bit of ``tree_sum``: several times as fast with many columns.

    Parameters
    ----------
    values
        Shape (n, ...); not changed.

    Returns
    -------
    Floats
        The sums, shape (...).
    """
    count = len(values)
    half = (1 << max(count - 1, 0).bit_length()) // 2
    if not half:
        return values[0].copy() if count else np.zeros(values.shape[1:])
    sums = np.empty((half, *values.shape[1:]))
    np.add(values[: count - half], values[half:], out=sums[: count - half])
    np.add(values[count - half : half], 0.0, out=sums[count - half :])
    while half > 1:
        half //= 2
        sums[:half] += sums[half : 2 * half]
    total: Floats = sums[0]
    return total


def folded_sum(values: Floats) -> Floats:
    """Sum along the last axis in another fixed order than ``tree_sum``, in place: ``values`` is overwritten.

    Parameters
    ----------
    values
        Shape (..., n), n >= 1; its contents are undefined afterwards.

    Returns
    -------
    Floats
        The sums, shape (...).
    """
    count = values.shape[-1]
    while count > 1:
        half = (count + 1) // 2
        values[..., : count - half] += values[..., half:count]
        count = half
    return values[..., 0].copy()


def union_sorted(*ascending: Ints) -> Ints:
    """Return the values of ascending arrays, each once, ascending; numpy's union hashes, which is far slower here.

    Parameters
    ----------
    ascending
        At least one array, each of shape (n,) with an n of its own.

    Returns
    -------
    Ints
        The union, shape (m,) with m at most the sum of all n.
    """
    values = np.concatenate(ascending)
    values.sort(kind="stable")
    return values[np.append(True, values[1:] != values[:-1])] if len(values) else values


def distinct(k: Ints, count: int) -> Ints:
    """Return the values of ``k``, each once, ascending; 0 <= k < count.

    Parameters
    ----------
    k
        Shape (n,), in any order.

    Returns
    -------
    Ints
        Shape (m,), m <= n.
    """
    if count > 4 * len(k):
        return np.unique(k)
    present = np.zeros(count, dtype=np.bool_)  # faster than sorting
    present[k] = True
    return np.flatnonzero(present)


def multiples(k: Ints, count: int, most: int) -> Iterator[Ints]:
    """Yield n k modulo count for n = 1..most, in one array that is overwritten; 0 <= k < count.

    Parameters
    ----------
    k
        Any shape; not changed.

    Yields
    ------
    Ints
        Shape of ``k``; copy it to keep it beyond the next step.
    """
    at, step = np.zeros(k.shape, dtype=np.uint64), k.astype(np.uint64)
    less = np.empty_like(at)
    for _ in range(most):
        at += step
        np.subtract(at, np.uint64(count), out=less)  # wraps below 0, to more than anything else
        np.minimum(at, less, out=at)
        yield at.view(np.int64)
