"""Memory files for ``$readmemh``: one full-width two's complement word a line, in hexadecimal."""

from tablegen.numerics.arrays import Ints


def memory_file(words: Ints, bits: int) -> bytes:
    """The words, each in as many hexadecimal digits as ``bits`` take."""
    digits, mask = -(-bits // 4), (1 << bits) - 1
    return "".join(f"{word & mask:0{digits}x}\n" for word in words.tolist()).encode("ascii")
