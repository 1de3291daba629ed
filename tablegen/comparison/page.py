"""A comparison as one HTML page."""

from collections.abc import Sequence

from tablegen.charts.chart import Chart
from tablegen.comparison.cells import HEAD, cells
from tablegen.comparison.charts import chart_section
from tablegen.comparison.comparison import SideBySide
from tablegen.comparison.difference import ComparedPair
from tablegen.comparison.side import WORDS
from tablegen.html_report.blocks import Grid, Section, TableCell, row
from tablegen.html_report.document import document
from tablegen.version import __version__


def comparison_page(both: SideBySide, charts: Sequence[Chart]) -> bytes:
    """Render the differences, the charts, and, folded, everything that was compared."""
    sides = tuple(
        row(name, f"{side.title}: {WORDS[side.kind]}", side.path.name or str(side.path))
        for name, side in (("A", both.a), ("B", both.b))
    )
    sections = [
        Section("sides", "A and B", (Grid("", ("", "what", "file"), sides),)),
        Section("differences", "What differs", tuple(_grids(both.differing))),
        *([chart_section(charts)] if charts else []),
        Section("all", "Everything that was compared", tuple(_grids(both.pairs, folded=True))),
    ]
    verdict = TableCell(f"{both.verdict}.", "good" if both.same else "quiet")
    title = "{} and {}".format(*both.titles)
    foot = f"Made by tablegen {__version__}. All is computed from the files."
    return document(title, verdict, both.findings, sections, "", foot)


def _grids(pairs: Sequence[ComparedPair], folded: bool = False) -> list[Grid]:
    """Return a table for each section."""
    return [
        Grid(
            section,
            ("", *HEAD),
            tuple(row(pair.label, *cells(pair)) for pair in pairs if pair.section == section),
            folded=folded,
        )
        for section in dict.fromkeys(pair.section for pair in pairs)
    ]
