"""Converter words, turned back into codes."""

import numpy as np

from tablegen.fixedpoint.output import Output
from tablegen.manifest.read import StoredBuild
from tablegen.verification.play.stream import Words

_CHUNK_TICKS = 1 << 14  # ticks that are worked out together, in the cache


def pack_captures(words: Words, stored: StoredBuild) -> Words:
    """Return pairs of captured words as one word a tick, as models are stored: converter words turned back into codes.

    Parameters
    ----------
    words
        Converter words of both axes, then markers and faults, of each tick: shape (2 ticks,).

    Returns
    -------
    Words
        Shape (ticks,).
    """
    packed = np.empty(len(words) // 2, dtype=np.uint64)
    for first in range(0, len(packed), _CHUNK_TICKS):
        chunk = slice(2 * first, 2 * (first + _CHUNK_TICKS))
        sent, flags = words[: 2 * len(packed)][chunk].reshape(-1, 2).T
        x = codes_of(sent & np.uint64(0xFFFFFFFF), stored.program.x.output)
        y = codes_of(sent >> np.uint64(32), stored.program.y.output)
        flags = (flags & np.uint64(0xFFFF)) << np.uint64(48)  # faults above markers
        packed[first : first + _CHUNK_TICKS] = flags | y << np.uint64(24) | x
    return packed


def codes_of(words: Words, output: Output) -> Words:
    """Decode converter words by the manifest's coding.

    Parameters
    ----------
    words
        Words of one axis, shape (ticks,).

    Returns
    -------
    Words
        Codes of up to 24 bits, shape (ticks,).
    """
    shift = output.word_bits - output.dac_bits if output.align == "left" else 0
    flip = 1 << (output.dac_bits - 1) if output.coding == "twos-complement" else 0
    codes: Words = (words >> np.uint64(shift) ^ np.uint64(flip)) & np.uint64(0xFFFFFF)
    return codes
