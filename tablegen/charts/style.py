"""Colours that people with any colour vision can distinguish, line styles for print without colour, shades of images.

Colours are for a white page; report/page.css has those of the page, which may be dark.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from tablegen.charts.chart import DrawnCurve, Raster, Role
from tablegen.numerics.arrays import Floats


@dataclass(frozen=True)
class Look:
    """The style of lines (colour, width in pixels, dashes), of areas (``fill``) and of texts (``size``, ``fill``)."""

    stroke: str = ""
    width: float = 1.0
    dashes: tuple[float, ...] = ()
    fill: str = ""
    opacity: float = 1.0
    size: float = 13.0
    bold: bool = False


ROLES: dict[Role, Look] = {
    "forward": Look("#0072b2", 1.8),
    "backward": Look("#c44e00", 1.8, (6.0, 3.0)),
    "before": Look("#6f7681", 1.8, (2.0, 3.0)),
    "other": Look("#00795c", 1.8),
    "limit": Look("#b00040", 1.8),
}
_FAINT: dict[Role, Look] = {
    "forward": Look("#8cc4e4", 1.2),
    "backward": Look("#eeb48c", 1.2, (6.0, 3.0)),
    "before": Look("#b9bec6", 1.2, (2.0, 3.0)),
    "other": Look("#86c7b6", 1.2),
    "limit": Look("#e09ab3", 1.2),
}
LOOKS = {
    "plot": Look("#999999"),
    "tick": Look("#e3e3e3", fill="#555555"),
    "label": Look(fill="#1a1c20"),
    "legend": Look(fill="#1a1c20"),
    "title": Look(fill="#1a1c20", size=15.0, bold=True),
    "heading": Look(fill="#1a1c20", size=17.0, bold=True),
    "word": Look(fill="#555555", size=12.0),
    "band": Look(fill="#5b7fb5", opacity=0.13),
    "area": Look(fill="#5b7fb5", opacity=0.16),
    "mark": Look("#6f7681", 1.2, (2.0, 3.0)),
    "arrow": Look("#ffffff", 1.4),
}
SPOT, SMALL_SPOT = 8.0, 4.0  # pixels across


def look_of(curve: DrawnCurve) -> Look:
    """Return colour and line style of a curve."""
    return (_FAINT if curve.faint else ROLES)[curve.role]


def spot_of(curve: DrawnCurve) -> tuple[float, Literal["round", "square"]]:
    """Return the size in pixels of the points of a curve, and their form: squares are backward."""
    small = curve.role == "before" or curve.faint
    return SMALL_SPOT if small else SPOT, "square" if curve.role == "backward" else "round"


_ENDS = {
    "grey": ("#000000", "#ffffff"),
    "heat": ("#1b0b3b", "#6a176e", "#bc3754", "#f37819", "#fcffa4"),
    "signed": ("#2166ac", "#92c5de", "#f7f7f7", "#f4a582", "#b2182b"),
}
LEFT_OUT = 255  # the shade of missing values
_MISSING = "#ffd9d0"


def palette(shades: str) -> np.typing.NDArray[np.uint8]:
    """Return the colours of the shades 0..254 and of missing values.

    Returns
    -------
    RGB, shape (256, 3).
    """
    ends = np.array([[int(one[i : i + 2], 16) for i in (1, 3, 5)] for one in _ENDS[shades]], dtype=np.float64)
    at = np.linspace(0.0, len(ends) - 1.0, LEFT_OUT)
    colours = np.stack([np.interp(at, np.arange(len(ends)), ends[:, i]) for i in range(3)], axis=1)
    missing = [int(_MISSING[i : i + 2], 16) if shades == "grey" else 255 for i in (1, 3, 5)]
    return np.vstack([np.rint(colours), missing]).astype(np.uint8)


def shades_of(raster: Raster) -> np.typing.NDArray[np.uint8]:
    """Return the shade of each value of an image.

    Returns
    -------
    Shades 0..254, ``LEFT_OUT`` for NaN, shape (rows, columns).
    """
    share = (raster.values - raster.low) / ((raster.high - raster.low) or 1.0)
    whole: Floats = np.rint(np.clip(np.nan_to_num(share), 0.0, 1.0) * (LEFT_OUT - 1))
    return np.where(np.isfinite(raster.values), whole, LEFT_OUT).astype(np.uint8)
