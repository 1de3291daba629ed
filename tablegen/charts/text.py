"""A chart in characters, for a terminal: the same axes, units, legend and bands as in a picture.

Curves are drawn in dots, 2 by 4 in a character, with marks that distinguish them without colour: ``>`` is forward and
``<`` is backward. Without Unicode only the marks are drawn.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from tablegen.charts.chart import Chart, DrawnCurve, Mark, Raster, runs, ticks
from tablegen.numerics.arrays import Floats

Span = tuple[str, str]  # a text and its style, as terminal.py has them
_MARKS = {"forward": ">", "backward": "<", "before": ".", "other": "+", "limit": "#"}
_FAINT_MARKS = {"forward": ")", "backward": "(", "before": ",", "other": "-", "limit": "%"}
_POINTS = {"forward": ">", "backward": "<", "before": "o", "other": "o", "limit": "#"}
_BRAILLE = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))
_UNICODE_RAMP, _ASCII_RAMP = "\u00b7\u2591\u2592\u2593\u2588", ".:-=+*%@"
_EVERY = 9  # characters from mark to mark
_LEAST, _MOST = 40, 200  # characters of a line


def text_plot(chart: Chart, width: int, unicode: bool) -> list[list[Span]]:
    """Return lines of at most ``width`` characters, each in spans with a style."""
    return _TextPlot(chart, min(max(width, _LEAST), _MOST), unicode).lines()


class _TextPlot:
    """The characters of a plot, row by row from above, and the style of each."""

    def __init__(self, chart: Chart, width: int, unicode: bool) -> None:
        self.chart, self.total, self.unicode = chart, width, unicode
        (self.x0, self.x1), (self.y0, self.y1) = chart.x_limits, chart.y_limits
        rows = round(width / 7)
        self.height = min(max(rows, 9), 16)
        if chart.raster is not None:
            self.height = min(max(round(width / 4.5), 12), 26)
        self.y_ticks = ticks(min(self.y0, self.y1), max(self.y0, self.y1), count=1 + self.height // 3)
        self.margin = max((len(text) for _, text in self.y_ticks), default=1) + 1
        self.width = width - self.margin - 2
        if chart.equal:
            self.width = min(self.width, round(2 * self.height * abs((self.x1 - self.x0) / (self.y1 - self.y0))))
        self.cells = [[" "] * self.width for _ in range(self.height)]
        self.styles = [[""] * self.width for _ in range(self.height)]

    def lines(self) -> list[list[Span]]:
        """Return all lines of the plot."""
        self._draw()
        chart, blank = self.chart, " " * self.margin
        at_row = {self._row(value): text for value, text in self.y_ticks}
        edge, tick = ("\u2502", "\u2524") if self.unicode else ("|", "+")
        rows: list[list[Span]] = [[(_cut(chart.title, self.total), "title")]]
        rows += self._legend()
        rows.append([(f"{blank}{chart.y_label}", "")])
        for row in range(self.height):
            label = at_row.get(row, "")
            start = f"{label:>{self.margin - 1}} {tick if label else edge}"
            rows.append([(start, ""), *_spans(self.cells[row], self.styles[row])])
        rows.append([(blank, ""), *self._axis()])
        rows.append([(blank + " " + self._x_texts(), "")])
        rows.append([(blank + " " + chart.x_label.center(self.width).rstrip(), "")])
        return rows

    def _draw(self) -> None:
        if self.chart.raster is not None:
            self._shade(self.chart.raster)
        for mark in self.chart.marks:
            self._rule(mark)
        for mark in self.chart.marks:
            self._name(mark)
        lines = [curve for curve in self.chart.curves if curve.kind != "points"]
        lines.sort(key=lambda curve: curve.role != "before")  # the reference curve lies below
        if self.unicode:
            for curve in lines:
                self._dots(curve)
        for number, curve in enumerate(lines):
            self._marks(curve, number * _EVERY // max(len(lines), 1))
        for curve in self.chart.curves:
            if curve.kind == "points":
                self._points(curve)

    def _x(self, values: Floats | float) -> Floats:
        """Return the position from left to right, 0 to 1."""
        low, high, at = self.x0, self.x1, np.asarray(values, dtype=np.float64)
        if self.chart.log_x:
            low, high, at = np.log10(low), np.log10(high), np.log10(np.maximum(at, 1e-300))
        fraction: Floats = (at - low) / (high - low)
        return fraction

    def _y(self, values: Floats | float) -> Floats:
        """Return the position from above, 0 to 1."""
        fraction: Floats = (self.y1 - np.asarray(values, dtype=np.float64)) / (self.y1 - self.y0)
        return fraction

    def _row(self, value: float) -> int:
        return min(max(int(float(self._y(value)) * self.height), 0), self.height - 1)

    def _column(self, value: float) -> int:
        return min(max(int(float(self._x(value)) * self.width), 0), self.width - 1)

    def _put(self, row: int, column: int, text: str, style: str) -> None:
        if 0 <= row < self.height and 0 <= column < self.width:
            self.cells[row][column], self.styles[row][column] = text, style

    def _shade(self, raster: Raster) -> None:
        """Draw in each character the value at its middle."""
        ramp = _UNICODE_RAMP if self.unicode else _ASCII_RAMP
        (x_low, x_high), (below, above), (rows, columns) = raster.x, raster.y, raster.values.shape
        for row in range(self.height):
            y = self.y1 - (self.y1 - self.y0) * (row + 0.5) / self.height
            for column in range(self.width):
                x = self.x0 + (self.x1 - self.x0) * (column + 0.5) / self.width
                i, j = int((above - y) / (above - below) * rows), int((x - x_low) / (x_high - x_low) * columns)
                if 0 <= i < rows and 0 <= j < columns and np.isfinite(raster.values[i, j]):
                    share = (raster.values[i, j] - raster.low) / ((raster.high - raster.low) or 1.0)
                    text = ramp[int(min(max(share, 0.0), 0.999) * len(ramp))]
                    self._put(row, column, text, "")

    def _rule(self, mark: Mark) -> None:
        """Draw a thin line at a value."""
        if mark.of == "y" and min(self.y0, self.y1) <= mark.at <= max(self.y0, self.y1):
            for column in range(self.width):
                self._put(self._row(mark.at), column, "\u2504" if self.unicode else "-", "faint")
        if mark.of == "x" and min(self.x0, self.x1) <= mark.at <= max(self.x0, self.x1):
            for row in range(self.height):
                self._put(row, self._column(mark.at), "\u250a" if self.unicode else ":", "faint")

    def _name(self, mark: Mark) -> None:
        """Write the label of a line: at its right end, or beside it in the first row that is free there."""
        if mark.of == "y":
            self._word(self._row(mark.at), self.width - len(mark.name), mark.name)
            return
        column = self._column(mark.at)
        fits = column + 2 + len(mark.name) <= self.width
        row = next((row for row in range(self.height) if self._free(row, column, len(mark.name), fits)), 0)
        self._word(row, column + 2 if fits else column - 1 - len(mark.name), mark.name)

    def _free(self, row: int, column: int, count: int, right: bool) -> bool:
        cells = self.cells[row][column + 1 : column + 3 + count]
        if not right:
            cells = self.cells[row][max(column - 2 - count, 0) : column]
        return not any(cell.isalnum() for cell in cells)

    def _word(self, row: int, column: int, text: str) -> None:
        for i, letter in enumerate(text):
            self._put(row, column + i, letter, "faint")

    def _cells_of(self, curve: DrawnCurve, fine: tuple[int, int]) -> Iterator[tuple[int, int]]:
        """Yield row and column of each step along a curve, on a grid of so many to a character."""
        tall, wide = self.height * fine[0], self.width * fine[1]
        for x, y in runs(curve):
            across, down = self._x(x) * wide, self._y(y) * tall
            if curve.kind == "stems":
                for column, top in zip(across.tolist(), down.tolist(), strict=True):
                    yield from ((row, int(column)) for row in range(int(max(top, 0.0)), tall))
                continue
            steps = np.maximum(np.abs(np.diff(across)), np.abs(np.diff(down)))
            count = np.minimum(np.ceil(steps), 4.0 * (tall + wide)).astype(np.int64) + 1
            at = np.concatenate([i + np.arange(n) / n for i, n in enumerate(count.tolist())] + [[len(x) - 1.0]])
            places = np.arange(len(x))
            columns, rows = np.interp(at, places, across), np.interp(at, places, down)
            for row, column in zip(np.floor(rows).tolist(), np.floor(columns).tolist(), strict=True):
                yield (
                    (min(int(row), tall - 1) if row <= tall else int(row)),
                    (min(int(column), wide - 1) if column <= wide else int(column)),
                )

    def _dots(self, curve: DrawnCurve) -> None:
        for row, column in self._cells_of(curve, (4, 2)):
            if 0 <= row < 4 * self.height and 0 <= column < 2 * self.width:
                old = ord(self.cells[row // 4][column // 2])
                dots = old if 0x2800 < old < 0x2900 else 0x2800
                self._put(row // 4, column // 2, chr(dots | _BRAILLE[row % 4][column % 2]), _style(curve))

    def _marks(self, curve: DrawnCurve, first: int) -> None:
        """Draw the marks of a line: at every position without dots, at some with them."""
        steps = list(dict.fromkeys(self._cells_of(curve, (1, 1))))
        if curve.kind == "stems" and self.unicode:
            return
        every = _EVERY if self.unicode else 1
        for row, column in steps[first if self.unicode else 0 :: every]:
            occupied = not self.unicode and 0 <= row < self.height and 0 <= column < self.width
            if occupied and self.cells[row][column] not in " -:" and column % 2:
                continue  # where two curves coincide, both stay visible
            self._put(row, column, mark_of(curve), _style(curve))

    def _points(self, curve: DrawnCurve) -> None:
        for x, y in runs(curve):
            for a, b in zip(self._x(x).tolist(), self._y(y).tolist(), strict=True):
                if 0.0 <= a <= 1.0 and 0.0 <= b <= 1.0:
                    row, column = (min(int(one * n), n - 1) for one, n in ((b, self.height), (a, self.width)))
                    self._put(row, column, mark_of(curve), _style(curve))

    def _legend(self) -> list[list[Span]]:
        """List marks with their names, in as many lines as needed; also of bands, and of shades."""
        entries: list[Span] = []
        entries += [(f"{mark_of(curve)} {curve.name}", _style(curve)) for curve in self.chart.needed_legend]
        entries += [
            (f"{self._band} {name}", "") for name in dict.fromkeys(band.name for band in self.chart.bands) if name
        ]
        raster = self.chart.raster
        if raster is not None:
            ramp = _UNICODE_RAMP if self.unicode else _ASCII_RAMP
            label = f" {raster.label}" if raster.label else ""
            entries.append((f"{ramp[0]} {raster.low:.3g} to {ramp[-1]} {raster.high:.3g}{label}", ""))
        lines: list[list[Span]] = []
        used = self.total
        for text, style in entries:
            if used + 3 + len(text) > self.total:
                lines.append([(" " * self.margin, "")])
                used = self.margin
            else:
                lines[-1].append(("   ", ""))
                used += 3
            entry = _cut(text, self.total - self.margin)
            lines[-1].append((entry, style))
            used += len(entry)
        return lines

    @property
    def _band(self) -> str:
        return "\u2550" if self.unicode else "="

    def _axis(self) -> list[Span]:
        """Draw the horizontal axis with its ticks, and bands as double lines."""
        line, corner, tick = ("\u2500", "\u2514", "\u252c") if self.unicode else ("-", "+", "+")
        cells = [line] * self.width
        for band in self.chart.bands:
            for column in range(self.width):
                value = (column + 0.5) / self.width
                if float(self._x(band.low)) <= value <= float(self._x(band.high)):
                    cells[column] = self._band
        for value, _ in self._x_ticks():
            cells[self._column(value)] = tick
        return [(corner + "".join(cells), "")]

    def _x_ticks(self) -> list[tuple[float, str]]:
        low, high = sorted((self.x0, self.x1))
        return ticks(low, high, log=self.chart.log_x, count=max(2, self.width // 14))

    def _x_texts(self) -> str:
        row = [" "] * self.width
        for value, text in self._x_ticks():
            first = min(max(self._column(value) - len(text) // 2, 0), self.width - len(text))
            if first >= 0 and all(cell == " " for cell in row[max(first - 1, 0) : first + len(text) + 1]):
                row[first : first + len(text)] = list(text)
        return "".join(row).rstrip()


def mark_of(curve: DrawnCurve) -> str:
    """Return the character that stands for a curve."""
    if curve.kind == "points":
        return _POINTS[curve.role]
    return (_FAINT_MARKS if curve.faint else _MARKS)[curve.role]


def _style(curve: DrawnCurve) -> str:
    return curve.role


def _cut(text: str, most: int) -> str:
    return text if len(text) <= most else f"{text[: most - 3]}..."


def _spans(cells: Sequence[str], styles: Sequence[str]) -> list[Span]:
    """Join characters of one style, without trailing blanks."""
    last = max((i for i, cell in enumerate(cells) if cell != " "), default=-1)
    spans: list[Span] = []
    for cell, style in zip(cells[: last + 1], styles, strict=False):
        if spans and spans[-1][1] == style:
            spans[-1] = (spans[-1][0] + cell, style)
        else:
            spans.append((cell, style))
    return spans
