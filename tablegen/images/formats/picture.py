"""Pictures in grey (.png)."""

import warnings
from io import BytesIO

import numpy as np

from tablegen.images.formats.channel import Channel, Matrix, first_line


def png_channels(content: bytes, _: str) -> list[Channel]:
    """Return the image of a .png file.

    Raises
    ------
    ValueError
        If the content is damaged; the message has the reason.
    """
    from PIL import Image as Pillow

    def damaged(error: Exception) -> ValueError:
        return ValueError(f"is not a complete PNG file ({first_line(error)})")

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            picture = Pillow.open(BytesIO(content), formats=("PNG",))
    except Exception as error:  # the library raises whatever a damaged structure leads to
        raise damaged(error) from None
    if picture.mode not in ("1", "L", "LA", "RGB", "RGBA", "P", "PA") and not picture.mode.startswith("I"):
        raise ValueError(f"has pixels of the kind {picture.mode}; export it in grey, 16 bits, or as numbers")

    def load(_: int) -> Matrix:
        """Read the pixels of the picture.

        Returns
        -------
        Matrix
            Grey levels, shape (rows, columns).

        Raises
        ------
        ValueError
            If the file is damaged, or in colour.
        """
        try:
            picture.load()
            if picture.mode in ("1", "L") or picture.mode.startswith("I"):
                return np.asarray(picture)
            colours = np.asarray(picture.convert("RGB"))
        except Exception as error:
            raise damaged(error) from None
        if np.array_equal(colours[..., 0], colours[..., 1]) and np.array_equal(colours[..., 0], colours[..., 2]):
            return colours[..., 0]
        raise ValueError("is in colour, not heights; export it in grey, 16 bits, or as numbers")

    return [Channel(0, "", picture.size[::-1], load)]
