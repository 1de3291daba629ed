"""The contents of a page before they are HTML: sections of texts, tables, charts and pictures."""

import math
from dataclasses import dataclass, field
from typing import Literal

from tablegen.base.warnings import Tone
from tablegen.charts.chart import Chart


@dataclass(frozen=True)
class TableCell:
    """A cell of a table; ``tone`` is the colour of a state that its text has too."""

    text: str
    tone: Tone = ""


@dataclass(frozen=True)
class Paragraph:
    """A paragraph of plain text."""

    text: str
    tone: Tone = ""
    kind: Literal["paragraph"] = "paragraph"


@dataclass(frozen=True)
class Bullets:
    """A list of short texts."""

    items: tuple[TableCell, ...]
    kind: Literal["bullets"] = "bullets"


@dataclass(frozen=True)
class Grid:
    """A table: the first cell of each row is its name."""

    caption: str
    head: tuple[str, ...]
    rows: tuple[tuple[TableCell, ...], ...]
    folded: bool = False
    kind: Literal["table"] = "table"


@dataclass(frozen=True, eq=False)
class Charts:
    """Charts side by side where there is room."""

    charts: tuple[Chart, ...]
    kind: Literal["charts"] = "charts"


@dataclass(frozen=True)
class ScaleBar:
    """A length in the lower left of a picture: its share of the width, and its text with a unit."""

    share: float
    text: str

    @classmethod
    def of(cls, width_nm: float) -> "ScaleBar":
        """Choose 1, 2 or 5 times a power of ten, at most three tenths of a width in nm."""
        most = 0.3 * width_nm
        power = 10.0 ** math.floor(math.log10(most))
        length_nm = power * max(step for step in (1, 2, 5) if step * power <= most)
        text = f"{length_nm / 1000:g} um" if length_nm >= 1000 else f"{length_nm:g} nm"
        return cls(round(length_nm / width_nm, 4), text)


@dataclass(frozen=True)
class HeightScale:
    """The heights of black and white in a picture, their unit, and the address of the bar of all shades."""

    low: float
    high: float
    unit: str
    address: str

    @property
    def ends(self) -> tuple[str, str]:
        """Both heights as texts, the higher one with the unit."""
        return f"{self.low:.3g}", f"{self.high:.3g} {self.unit}"


@dataclass(frozen=True)
class PagePicture:
    """A picture with the ideal positions of its features, in shares of width and height from the upper left.

    ``size_nm`` is its width and height, and ``heights`` what its shades mean, both for the values under the pointer.
    """

    title: str
    address: str
    alternative: str
    sites: tuple[tuple[float, float], ...]
    height: float  # of the width
    bar: ScaleBar | None
    size_nm: tuple[float, float] | None = None
    heights: HeightScale | None = None


@dataclass(frozen=True)
class Pictures:
    """Pictures side by side."""

    pictures: tuple[PagePicture, ...]
    kind: Literal["pictures"] = "pictures"


Block = Paragraph | Bullets | Grid | Charts | Pictures


@dataclass(frozen=True)
class Section:
    """A heading, and the blocks below it."""

    key: str
    title: str
    blocks: tuple[Block, ...] = field(default_factory=tuple)
    lead: str = ""


def row(name: str, *cells: TableCell | str) -> tuple[TableCell, ...]:
    """Return a row of a table; texts become cells without a tone."""
    return (TableCell(name), *(cell if isinstance(cell, TableCell) else TableCell(cell) for cell in cells))
