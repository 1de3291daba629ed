"""The contents of a page before they are HTML: sections of texts, tables, charts and pictures."""

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
class PagePicture:
    """A picture with the ideal positions of its features, in shares of width and height from the upper left."""

    title: str
    address: str
    alternative: str
    sites: tuple[tuple[float, float], ...]
    height: float = 1.0  # of the width


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
