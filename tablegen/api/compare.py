"""Compare two scans, builds or calibrations."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from tablegen.api.result import Result
from tablegen.charts.chart import Chart
from tablegen.charts.picture_file import PlottedCharts
from tablegen.comparison.compare_text import compare_text
from tablegen.comparison.comparison import SideBySide, compared
from tablegen.comparison.difference import ComparedPair

_IN_TERMINAL = 6  # charts


def compare(a: str | Path, b: str | Path, *, progress: Callable[[str], object] = lambda _: None) -> "Compared":
    """Compare two scan files, two directories of builds, a scan file and a build, two scanner or two operator files.

    Parameters
    ----------
    a, b : str or Path
        The two files or directories.
    progress : callable
        Called with a text for each stage.

    Returns
    -------
    Compared
        ``same``, and ``differing``, the quantities that differ, with both values.

    Raises
    ------
    Rejected
        A file cannot be read, or the two are not of a kind.
    NotABuild
        A directory holds no build.

    Examples
    --------
    >>> tablegen.compare("scan.toml", "scan.toml").same
    True
    """
    return Compared(compared(Path(a), Path(b), progress))


@dataclass(frozen=True, eq=False, repr=False)
class Compared(Result):
    """A and B together: ``both`` has the two sides, ``differing`` the quantities that are not the same."""

    both: SideBySide

    @property
    def same(self) -> bool:
        """True if nothing differs, and every file of a build agrees with its manifest."""
        return self.both.same

    @property
    def differing(self) -> list[ComparedPair]:
        """The quantities that differ."""
        return self.both.differing

    @property
    def record(self) -> dict[str, Any]:
        """The differences as plain data, as ``tablegen compare --json`` prints them."""
        return self.both.record()

    def summary(self, everything: bool = False) -> str:
        """Return what ``tablegen compare`` prints: the differences, or with ``everything`` also what is the same."""
        return "\n".join(compare_text(self.both, everything))

    @cached_property
    def _all_charts(self) -> list[Chart]:
        from tablegen.comparison.charts import comparison_charts

        return comparison_charts(self.both)

    def charts(self) -> PlottedCharts:
        """Return all charts, those that differ first; a terminal shows the first of these."""
        from tablegen.comparison.charts import differing_charts

        first = differing_charts(self._all_charts)
        rest = [chart for chart in self._all_charts if chart not in first]
        heading = "A: {}, B: {}".format(*self.both.titles)
        return PlottedCharts(heading, (*first, *rest), brief=tuple((first or self._all_charts)[:_IN_TERMINAL]))

    def page(self) -> bytes:
        """Return the HTML page that ``tablegen compare -o`` writes."""
        from tablegen.comparison.page import comparison_page

        return comparison_page(self.both, self._all_charts)

    def _lines(self) -> Sequence[str]:
        a, b = self.both.titles
        labels = [pair.label for pair in self.differing]
        more = f" and {len(labels) - 4} more" if len(labels) > 4 else ""
        return f"comparison of {a!r} and {b!r}", self.both.verdict, ", ".join(labels[:4]) + more or "nothing differs"
