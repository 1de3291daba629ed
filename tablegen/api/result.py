"""Results of the functions: three lines in a shell, charts in a notebook, text, a picture and JSON."""

import json
from abc import ABC, abstractmethod
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tablegen.base.input_errors import Problem, Rejected
from tablegen.emit.write import write_files

if TYPE_CHECKING:
    from tablegen.charts.picture_file import PlottedCharts


class Picture:
    """Charts of a result. A notebook shows them; ``write`` makes a file."""

    def __init__(self, charts: "PlottedCharts") -> None:
        self.charts = charts

    def write(self, path: str | Path) -> list[str]:
        """Write .svg, .png or .pdf, and return the name if the file changed; .png and .pdf need the extra ``plot``.

        Raises
        ------
        Rejected
            If the name has another ending.
        CannotWrite
            If the directory cannot be written.
        """
        from tablegen.charts.picture_file import KINDS, picture

        path = Path(path)
        kind = path.suffix.lower().removeprefix(".")
        if kind not in KINDS:
            raise Rejected([Problem(str(path), 0, "", "the name has to end in .svg, .png or .pdf")])
        content = picture(self.charts.charts, kind, self.charts.heading, self.charts.columns)
        return write_files(path.parent, {path.name: content})

    def __repr__(self) -> str:
        return f"<tablegen picture: {self.charts.heading}, {len(self.charts.charts)} charts>"

    def _repr_html_(self) -> str:
        return f"<p><b>{escape(self.charts.heading)}</b></p><div>{self.svg()}</div>"

    def svg(self) -> str:
        """Return all charts as one SVG drawing."""
        from tablegen.charts.svg import embedded

        return embedded(self.charts.charts, self.charts.columns)


class Result(ABC):
    """Result of a function: ``summary()``, ``plot()`` and ``to_json()``; a notebook shows text and charts."""

    @property
    @abstractmethod
    def record(self) -> Any:
        """The result as plain data, as ``--json`` of the command prints it."""

    @abstractmethod
    def summary(self) -> str:
        """Return the text that the command prints."""

    @abstractmethod
    def _lines(self) -> Sequence[str]:
        """Return the lines of ``repr``: at most three, the first of them the title."""

    @abstractmethod
    def charts(self) -> "PlottedCharts":
        """Return the charts that ``--plot`` of the command draws."""

    def plot(self, path: str | Path | None = None) -> Picture:
        """Draw the charts of ``--plot``; a notebook shows them, and with ``path`` they are written: .svg, .png, .pdf.

        Raises
        ------
        Rejected
            If the name has another ending.
        CannotWrite
            If the file cannot be written.
        """
        image = Picture(self.charts())
        if path is not None:
            image.write(path)
        return image

    def to_json(self) -> str:
        """Return the result as JSON, as ``--json`` of the command prints it."""
        return json.dumps(self.record, indent=2, allow_nan=False)

    def __repr__(self) -> str:
        return "<tablegen " + "\n  ".join(self._lines()) + ">"

    def _repr_html_(self) -> str:
        return f"<pre>{escape(repr(self)[1:-1])}</pre>{self.plot()._repr_html_()}<details><summary>all figures" + (
            f"</summary><pre>{escape(self.summary())}</pre></details>"
        )
