"""Charts of the integers of a scan at an angle: the path of both drives, lines and a frame, and the tables."""

from typing import Literal

import numpy as np

from tablegen.charts.chart import Chart, DrawnCurve, Role
from tablegen.fixedpoint.frame_program import RATIO_FRACTION_BITS, FrameProgram
from tablegen.manifest.frame_fields import TurnedAxisFields
from tablegen.manifest.turned import StoredTurned
from tablegen.numerics.arrays import Floats

SAMPLES = 200  # of a line
_PATH_LINES = 12
_ROLES: tuple[Role, ...] = ("forward", "other", "backward")


def axes_of(stored: StoredTurned) -> tuple[tuple[Literal["x", "y"], TurnedAxisFields, FrameProgram], ...]:
    """Return both axes: the name, the fields of the manifest and the program."""
    axes, program = stored.manifest.turned.axes, stored.program
    x, y = program.x, program.y
    assert isinstance(x, FrameProgram)
    assert isinstance(y, FrameProgram)
    return ("x", axes.x, x), ("y", axes.y, y)


def frame_volts(fields: TurnedAxisFields, program: FrameProgram) -> Floats:
    """Return the volts of the codes of a frame, without shaping, shape (lines, samples)."""
    ticks = program.fast.phase.ticks
    count = min(SAMPLES, ticks)
    at = np.arange(count) * ticks // count
    codes = program.output.clamp(np.stack([program.at(line, at) for line in range(program.lines)]))
    return np.asarray(fields.output.v_zero + fields.output.v_per_code * codes)


def _imaged(stored: StoredTurned) -> list[int]:
    up, down = stored.manifest.sequence.up_lines, stored.manifest.sequence.down_lines
    first, count = up if up[1] else down
    return list(range(first, first + count))


def path_chart(stored: StoredTurned) -> Chart:
    """Draw the drive of y over that of x: some imaged lines, and the beginnings of all lines of the frame."""
    x, y = (frame_volts(fields, program) for _, fields, program in axes_of(stored))
    lines = _imaged(stored)
    places = np.unique(np.linspace(0, len(lines) - 1, min(_PATH_LINES, len(lines))).round())
    examples = [lines[i] for i in places.astype(np.int64).tolist()]
    both = [np.append(one, one[:1], axis=0) for one in (x, y)]
    curves = [DrawnCurve("beginnings of lines", "other", both[0][:, 0], both[1][:, 0])]
    for at in examples:
        name = "imaged lines" if at == examples[0] else ""
        x_line, y_line = (np.append(one[at], whole[at + 1, 0]) for one, whole in zip((x, y), both, strict=True))
        curves.append(DrawnCurve(name, "forward", x_line, y_line))
    caption = f"{len(examples)} of {len(lines)} imaged lines, forward and backward."
    return Chart(
        "path", "Path of both drives", "x at the piezo [V]", "y at the piezo [V]", tuple(curves), equal=True,
        caption=caption,
    )  # fmt: skip


def line_charts(stored: StoredTurned) -> list[Chart]:
    """Draw the first, a middle and the last imaged line of each axis over its time."""
    lines = _imaged(stored)
    line_ms = 1e3 / float(stored.program.schedule.line_rate)
    charts = []
    for axis, fields, program in axes_of(stored):
        volts = frame_volts(fields, program)
        t: Floats = np.linspace(0.0, line_ms, volts.shape[1], endpoint=False)
        some = dict.fromkeys((lines[0], lines[len(lines) // 2], lines[-1]))
        curves = tuple(DrawnCurve(f"line {at}", role, t, volts[at]) for at, role in zip(some, _ROLES, strict=False))
        charts.append(Chart(f"line-{axis}", f"{axis} drive, lines", "time [ms]", "drive at the piezo [V]", curves))
    return charts


def frame_charts(stored: StoredTurned) -> list[Chart]:
    """Draw the frame of each axis over its lines."""
    charts = []
    for axis, fields, program in axes_of(stored):
        volts = frame_volts(fields, program)
        t: Floats = np.linspace(0.0, len(volts), volts.size, endpoint=False)
        curve = DrawnCurve(axis, "forward", t, volts.ravel())
        middles = np.asarray(np.arange(len(volts)) + 0.5, dtype=np.float64)
        middle = DrawnCurve("mean of a line", "other", middles, np.asarray(np.mean(volts, axis=1)))
        title = f"{axis} drive, one frame"
        charts.append(Chart(f"frame-{axis}", title, "line", "drive at the piezo [V]", (curve, middle)))
    return charts


def table_charts(stored: StoredTurned) -> tuple[Chart, ...]:
    """Draw what the tables give: the samples of a line and of the second table, the slow part, gains and ratios."""
    charts = []
    axes = axes_of(stored)
    for axis, fields, program in axes:
        at = np.arange(len(program.fast.words)) / len(program.fast.words)
        scale = 1.0 / (1 << (program.fast.bits - 1))
        ratio = float(np.max(np.abs(program.ratios.words))) / (1 << RATIO_FRACTION_BITS)
        second = np.asarray(scale * ratio * program.second, dtype=np.float64)
        curves = (
            DrawnCurve("table of a line", "forward", at, np.asarray(scale * program.fast.words, dtype=np.float64)),
            DrawnCurve("most of the second table", "backward", at, second),
        )
        charts.append(Chart(f"table-{axis}", f"{axis} tables of a line", "line period", "word, of full scale", curves))
        lines = np.arange(program.lines + 1)
        slow = program.slow.at(lines, program.lines) / (1 << program.output.gain_q)
        volts = fields.output.v_zero + fields.output.v_per_code * slow
        charts.append(
            Chart(f"slow-{axis}", f"{axis} slow part", "line", "drive at the piezo [V]", (
                DrawnCurve(axis, "other", lines.astype(np.float64), volts),
            ))
        )  # fmt: skip
    knots: tuple[Role, ...] = ("forward", "backward")
    lines = np.arange(stored.program.schedule.lines)
    gains, ratios = [], []
    for (axis, _, program), role in zip(axes, knots, strict=True):
        gain = program.gains.at(lines).astype(np.float64)
        gains.append(DrawnCurve(axis, role, lines.astype(np.float64), gain / (float(np.mean(gain)) or 1.0)))
        ratio_of = program.ratios.at(lines) / (1 << RATIO_FRACTION_BITS)
        ratios.append(DrawnCurve(axis, role, lines.astype(np.float64), ratio_of))
    charts.append(Chart("gains", "Gain of each line", "line", "gain, of its mean", tuple(gains)))
    charts.append(Chart("ratios", "Share of the second table", "line", "ratio", tuple(ratios)))
    return tuple(charts)
