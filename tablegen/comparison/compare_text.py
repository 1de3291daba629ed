"""A comparison as lines of text."""

from collections.abc import Iterator

from tablegen.comparison.cells import HEAD, cells
from tablegen.comparison.comparison import SideBySide
from tablegen.comparison.side import WORDS

_WORD = 20  # characters; longer words are cut


def compare_text(both: SideBySide, everything: bool) -> list[str]:
    """Format both names, a table of the differences or of everything, the notes and the verdict."""
    lines = [f"{name}  {side.path}, {WORDS[side.kind]}" for name, side in (("A", both.a), ("B", both.b))]
    return [*lines, *_table(both, everything), "", *(f"note: {note}" for note in both.notes), both.verdict]


def _table(both: SideBySide, everything: bool) -> Iterator[str]:
    pairs = both.pairs if everything else both.differing
    if not pairs:
        return
    rows = [(pair, [_cut(cell) for cell in cells(pair)]) for pair in pairs]
    widths = [max(len(HEAD[i]), *(len(row[i]) for _, row in rows)) for i in range(3)]
    width = 2 + max(len(pair.label) for pair in pairs)
    yield ""
    yield _line(" " * width, [*HEAD], widths)
    section = ""
    for pair, row in rows:
        if pair.section != section:
            section = pair.section
            yield section
        yield _line(f"  {pair.label}".ljust(width), row, widths)


def _line(name: str, row: list[str], widths: list[int]) -> str:
    figures = "  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=False))
    return f"{name}  {figures}  {row[3]}".rstrip()


def _cut(cell: str) -> str:
    return cell if len(cell) <= _WORD or "standard errors" in cell else f"{cell[: _WORD - 3]}..."
