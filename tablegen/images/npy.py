"""Read an array from the bytes of a ``.npy`` file: its header is compared with the bytes, and nothing is unpickled."""

from io import BytesIO
from math import prod
from typing import Any

import numpy as np

AnyArray = np.ndarray[tuple[int, ...], Any]  # of any type of element


def npy_array(content: bytes) -> tuple[AnyArray, int]:
    """Return the array, without a copy, and how many bytes follow it.

    Raises
    ------
    ValueError
        If the content is no .npy file; the message has the reason.
    """
    file = BytesIO(content)
    try:
        version = np.lib.format.read_magic(file)
        read_header = {
            (1, 0): np.lib.format.read_array_header_1_0,
            (2, 0): np.lib.format.read_array_header_2_0,
        }[version]
        shape, by_columns, kind = read_header(file)
        if kind.hasobject or kind.itemsize == 0 or len(shape) > 3 or min(shape, default=0) < 0:
            raise ValueError("no array of numbers in up to three dimensions")
        remaining = len(content) - file.tell() - prod(shape) * kind.itemsize
        if remaining < 0:
            raise ValueError(f"{len(content) - file.tell()} bytes are fewer than those of {prod(shape)} values")
        flat = np.frombuffer(content, kind, prod(shape), file.tell())
        return flat.reshape(shape, order="F" if by_columns else "C"), remaining
    except Exception as error:  # the header is read by the parser of Python, which raises whatever it meets
        why = str(error).splitlines()
        raise ValueError(
            f"is not a complete .npy file of numbers ({why[0] if why else type(error).__name__})"
        ) from None
