"""Tables and plots for the terminal."""

from collections.abc import Iterator, Sequence

import numpy as np

from tablegen.certificate.certificate import Certificate
from tablegen.certificate.summary import expected_lines, rate
from tablegen.numerics.arrays import Floats
from tablegen.planning.line_plan import LinePlan, Plan

_WIDTH, _HEIGHT = 64, 8  # characters; a braille character is 2 by 4 dots
_BRAILLE = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))


def certificate_table(plan: Plan, certificates: dict[str, Certificate]) -> list[str]:
    """The certificate of both axes, a line an axis."""
    schedule = plan.schedule
    lines = [
        f"{plan.name} on {plan.scanner!r}: {rate(schedule.line_rate)} lines of {schedule.ticks} ticks, "
        f"{schedule.lines} lines a frame, {rate(schedule.frame_rate)} frames",
        "",
        "                      error [LSB]   scaling error in the window [%, peak to peak]",
        "axis  drive [V p-p]    max    rms   direction  uncompensated  emitted  band limit  size   step/limit",
    ]
    for line in plan.lines:
        certificate = certificates[line.axis]
        for i, (side, error) in enumerate(certificate.scaling.items()):
            start = f"{line.axis:<4}  {line.drive.v_amplitude:13.4f}  {certificate.max_error_lsb:5.3f}  "
            start += f"{certificate.rms_error_lsb:5.3f}"
            step = f"{certificate.largest_step}/{certificate.max_step}"
            if i:
                start, step = " " * len(start), ""
            lines.append(
                f"{start}   {side:<9}  {error.uncompensated:13.2f}  {error.total:7.3f}  {error.band_limit:10.4f}  "
                f"{error.size:+.3f}  {step}".rstrip()
            )
        if line.drive.resting:
            step = f"{certificate.largest_step}/{certificate.max_step}"
            lines.append(
                f"{line.axis:<4}  rests at {line.drive.v_offset:.6g} V, code {certificate.lowest_code}; {step}"
            )
    for line in plan.lines:
        for side, moved in (certificates[line.axis].refinement or {}).items():
            lines.append(
                f"{line.axis:<4}  refinement, {side}: moves up to {moved.position:.3g} % of the line and takes away "
                f"{moved.scaling:.3g} % of scaling error, peak to peak"
            )
        expected = certificates[line.axis].expected
        if expected is not None and expected.basis == "traces":
            told = expected_lines(expected)
            lines += [
                f"{line.axis if i == 0 else '':<4}  {'' if i else 'on the scanner':<14}  {text}"
                for i, text in enumerate(told)
            ]
    return lines


def plots(line: LinePlan, unicode: bool) -> list[str]:
    """The drive of one period, and what the compensation adds to the uncompensated line."""
    count = 4 * _WIDTH
    t = np.arange(count) / count
    w = line.series.value(t)
    volts = line.drive.v_offset + line.drive.v_amplitude * (w - 0.5)
    turn = line.drive.turn
    triangle = np.where(t <= turn, t / turn, (1.0 - t) / (1.0 - turn))
    marks = _window_marks(line)
    imaged = np.array([mark != "-" for mark in marks]).repeat(count // _WIDTH)
    if not imaged.any():  # a window narrower than a column
        imaged[:] = True
    added = np.where(imaged, 100.0 * (w - triangle), np.nan)
    return [
        f"{line.axis} drive [V]",
        *_plot(volts, marks, unicode),
        f"{line.axis} drive less the uncompensated line, where it images [% of the scan]",
        *_plot(added, marks, unicode),
    ]


def _window_marks(line: LinePlan) -> str:
    """A character for each column: where the image is taken."""
    low, high = line.band_limit.window
    turn, marks = line.drive.turn, []
    for column in range(_WIDTH):
        t = (column + 0.5) / _WIDTH
        forward = t <= turn
        position = t / turn if forward else (1.0 - t) / (1.0 - turn)
        images = low <= position <= high and (forward or line.band_limit.directions == "both")
        marks.append((">" if forward else "<") if images else "-")
    return "".join(marks)


def _plot(values: Floats, marks: str, unicode: bool) -> list[str]:
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    span = high - low or 1.0
    rows = _dots(values, low, span) if unicode else _stars(values, low, span)
    labels = {0: f"{high:10.4g}", _HEIGHT - 1: f"{low:10.4g}"}
    lines = [f"{labels.get(i, ''):>10} |{row}".rstrip() for i, row in enumerate(rows)]
    return [*lines, " " * 11 + "+" + marks]


def _levels(values: Floats, low: float, span: float, height: int) -> Iterator[tuple[int, int]]:
    """Index and row, from the top, of every value that is a number."""
    for i, value in enumerate(values.tolist()):
        if value == value:
            yield i, round((1.0 - (value - low) / span) * (height - 1))


def _dots(values: Floats, low: float, span: float) -> Sequence[str]:
    cells = np.zeros((_HEIGHT, _WIDTH), dtype=np.int64)
    tall, wide = 4 * _HEIGHT, 2 * _WIDTH
    for i, level in _levels(values, low, span, tall):
        column = i * wide // len(values)
        cells[level // 4, column // 2] |= _BRAILLE[level % 4][column % 2]
    return ["".join(chr(0x2800 + cell) if cell else " " for cell in row) for row in cells]


def _stars(values: Floats, low: float, span: float) -> Sequence[str]:
    grid = [[" "] * _WIDTH for _ in range(_HEIGHT)]
    for i, level in _levels(values, low, span, _HEIGHT):
        grid[level][i * _WIDTH // len(values)] = "*"
    return ["".join(row) for row in grid]
