"""A lattice as the scan would image it, before and after: a simulation on the scanner of the scanner file."""

import numpy as np

from tablegen.charts.png import data_address, grey_png
from tablegen.device.schedule import Schedule
from tablegen.html_report.blocks import PagePicture, Paragraph, Pictures, ScaleBar, Section
from tablegen.html_report.playing import PlayedAxis
from tablegen.html_report.scan_errors import pixel_times
from tablegen.html_report.subject import PlannedScan
from tablegen.numerics.arrays import Floats
from tablegen.planning.line_plan import LinePlan
from tablegen.planning.windows import pixel_places
from tablegen.virtual.simulation import AxisRun

_MOST_PIXELS = 192  # of a side of a picture
_ROWS = 9.0  # of the lattice across the picture
_CONTRAST = 1.35


def lattice(planned: PlannedScan, axes: tuple[PlayedAxis, ...]) -> Section | None:
    """Return trace and retrace, without and with the corrections; None if none could be played."""
    if len(axes) < 2:  # a line scan makes no image
        return None
    x, y = axes
    pairs = [
        (name, one, other)
        for name, one, other in (("without", x.before, y.before), ("with", x.emitted, y.emitted))
        if one is not None and other is not None
    ]
    if not pairs:
        return None
    pictures, worst = [], []
    ratio = round(min(max(_size(planned.plan.y) / _size(planned.plan.x), 0.5), 2.0), 4)
    sizes = _size(planned.plan.x), _size(planned.plan.y)
    bar = ScaleBar.of(sizes[0])
    for name, one, other in pairs:
        images, error_percent = _images(planned, one, other, ratio)
        for side, image in images:
            alternative = f"{side} image of a lattice, {name} the correction of hysteresis"
            title = f"{name} correction, {side} (simulation)"
            pictures.append(PagePicture(title, data_address(image[0]), alternative, image[1], ratio, bar, sizes))
        worst.append(f"{name} it by up to {error_percent:.3g} % of the image")
    grounds = [f"{'the operator' if one.on_operator else 'the laws of the scanner file'}" for one in axes]
    where = f"x on {grounds[0]}, y on {grounds[1]}" if grounds[0] != grounds[1] else f"both axes on {grounds[0]}"
    text = (
        f"Simulation, not a measurement: {where}. Rings are where the lattice is; a straight image has a bright spot "
        f"in each. Without the correction of hysteresis the image is off {worst[0].removeprefix('without it ')}"
    )
    text = f"{text}, {worst[1]}." if len(worst) > 1 else f"{text}."
    return Section(
        "lattice",
        "A lattice, before and after (simulation)",
        (Pictures(tuple(pictures)), Paragraph(_remark(planned, axes), "quiet")),
        text,
    )


def _remark(planned: PlannedScan, axes: tuple[PlayedAxis, ...]) -> str:
    both = " All simulated pictures have the corrections of offset, size and rate."
    if planned.plan.schedule.pixel_table is not None:
        both += " x is a sine in all: without correction its pixels are where a piezo without hysteresis would be."
    refined = [line.axis for line in planned.plan.moving if line.layer is not None]
    if refined:
        both += (
            f" None of them has what `refine` learnt of {' and '.join(refined)}, nor the errors that it corrects: the "
            "first lines of the page say what the image has."
        )
    if all(one.on_operator for one in axes):
        return "The operator's own error is not in the picture; the certificate has it as uncertainty." + both
    return "The picture is as right as the scanner file. `tablegen simulate` plays the scan on another scanner." + both


Image = tuple[bytes, tuple[tuple[float, float], ...]]


def _images(planned: PlannedScan, x: AxisRun, y: AxisRun, ratio: float) -> tuple[list[tuple[str, Image]], float]:
    """Return each direction with its picture, and the largest position error of a pixel in percent.

    The lattice is regular in the picture, whose height is ``ratio`` of its width whatever that of the window is.
    """
    schedule = planned.plan.schedule
    line: LinePlan = planned.plan.x
    nominal = _size(planned.plan.x), _size(planned.plan.y)
    rows = np.unique(np.linspace(0, schedule.up.count - 1, min(schedule.up.count, _MOST_PIXELS)).astype(np.int64))
    columns = np.unique(np.linspace(0, schedule.pixels - 1, min(schedule.pixels, _MOST_PIXELS)).astype(np.int64))
    images, error_percent = [], 0.0
    at_ys = _about_window(y, planned.plan.y)
    sides = _line_pixels(schedule, x, line) if x.pixels is None else _sine_pixels(x.pixels, x, line)
    for name, *of_pixels in sides:
        time, at_x, ideal_x = (each[columns] for each in of_pixels)
        frame = (schedule.up.first + rows[:, None] + time) / schedule.lines
        at_y = np.interp(frame, y.drive.turns, at_ys, period=1.0)
        slow = planned.plan.y
        ideal_y = (frame / slow.drive.turn - float(np.mean(slow.band_limit.window))) * slow.drive.size_nm
        error_percent = max(
            error_percent,
            100.0 * float(np.max(np.abs(at_x - ideal_x))) / nominal[0],
            100.0 * float(np.max(np.abs(at_y - ideal_y))) / nominal[1],
        )
        image_x, image_y = at_x / nominal[0], at_y / nominal[1] * ratio
        heights = _heights(np.broadcast_to(image_x, image_y.shape), image_y, 1.0 / _ROWS)
        sites = _sites((1.0, ratio), 1.0 / _ROWS)
        images.append((name, (grey_png(heights[::-1], -_CONTRAST, 3.0), sites)))
    return images, error_percent


def _line_pixels(schedule: Schedule, x: AxisRun, line: LinePlan) -> list[tuple[str, Floats, Floats, Floats]]:
    """Return trace and retrace of a straight line: times of pixels in lines, where they are and should be in nm."""
    turn, about, sides = line.drive.turn, _about_window(x, line), []
    for name, tau in zip(("trace", "retrace"), pixel_places(schedule, turn), strict=True):
        if len(tau):
            time = turn * tau if name == "trace" else turn + (1.0 - turn) * (1.0 - tau)
            ideal_nm = (tau - float(np.mean(line.band_limit.window))) * line.drive.size_nm
            sides.append((name, time, np.interp(time, x.drive.turns, about, period=1.0), ideal_nm))
    return sides


def _sine_pixels(pixels: Schedule, x: AxisRun, line: LinePlan) -> list[tuple[str, Floats, Floats, Floats]]:
    """Return the same of a sine, whose pixels are the means over their ticks."""
    assert line.imaged is not None
    middle, times, sides = float(np.mean(line.imaged)), pixel_times(pixels), []
    for name, side in (("trace", "forward"), ("retrace", "backward")):
        branch = getattr(x.imaged, side)
        at_nm = x.imaged.size_nm * (branch.position + 0.01 * branch.residual - middle)
        sides.append((name, times[side], at_nm, (branch.position - middle) * line.drive.size_nm))
    return sides


def _size(line: LinePlan) -> float:
    """Return the size of the imaged window in nm."""
    return line.drive.window_nm


def _about_window(run: AxisRun, line: LinePlan) -> Floats:
    """Return the displacement about its mean inside the window, over both imaged directions."""
    sides = [getattr(run.imaged, side) for side in run.directions]
    low, high = line.band_limit.window
    middle = 0.5 * (low + high)
    offsets = []
    for side, name in zip(sides, run.directions, strict=True):
        x = side.position[(side.position >= low) & (side.position <= high)]
        times = line.drive.shape.times(name, x)
        offsets.append(
            float(
                np.mean(
                    np.interp(times, run.drive.turns, run.displacement_nm, period=1.0)
                    - (x - middle) * line.drive.size_nm
                )
            )
        )
    return run.displacement_nm - float(np.mean(offsets))


def _heights(x: Floats, y: Floats, constant: float) -> Floats:
    """Compute a hexagonal lattice with a spot at the origin."""
    wave = 4.0 * np.pi / (np.sqrt(3.0) * constant)
    total = np.zeros(np.broadcast(x, y).shape)
    for turned in (0.0, 60.0, 120.0):
        a = np.radians(turned + 90.0)
        total = total + np.cos(wave * (x * np.cos(a) + y * np.sin(a)))
    return total


def _sites(nominal: tuple[float, float], constant: float) -> tuple[tuple[float, float], ...]:
    """Return the positions of the spots, in shares of width and height from the upper left."""
    width, height = nominal
    sites = []
    rows = int(height / (constant * np.sqrt(0.75))) + 2
    columns = int(width / constant) + 2
    for j in range(-rows, rows + 1):
        for i in range(-2 * columns, 2 * columns + 1):
            x, y = constant * (i + 0.5 * (j % 2)), constant * np.sqrt(0.75) * j
            if abs(x) < 0.48 * width and abs(y) < 0.48 * height:
                sites.append((round(0.5 + x / width, 4), round(0.5 - y / height, 4)))
    return tuple(sites)
