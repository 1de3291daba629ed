"""A scan on the virtual scanner: emitted integers in, displacement and its errors out, model by model."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import msgspec
from msgspec.structs import replace

from tablegen.compensation import models
from tablegen.compensation.identification import SettledAxis
from tablegen.compensation.model import Hysteresis
from tablegen.config.load import Setup
from tablegen.config.scanner import ScannerAxis
from tablegen.device.schedule import Schedule
from tablegen.numerics.arrays import Floats
from tablegen.planning.line_plan import LinePlan, Plan, make_plan
from tablegen.virtual.line_error import LineError, about_window_line, line_error
from tablegen.virtual.pixel_line_error import pixel_line_error
from tablegen.virtual.played import MAX_TICKS, PlayedDrive, intended, played
from tablegen.virtual.scanner import VirtualScanner


@dataclass(frozen=True, eq=False)
class AxisRun:
    """One axis of a scan: the drive, and ``displacement_nm`` of the virtual scanner, (ticks,), above rest at 0 V.

    ``error`` takes the line's ends for exact, as the paper does; ``imaged`` is about the best line through the windows
    that are imaged. ``pixels`` is the schedule of a sine, whose errors are those of its pixels; else None.
    """

    axis: Literal["x", "y"]
    turn: float
    drive: PlayedDrive
    displacement_nm: Floats
    error: LineError
    imaged: LineError
    nominal_nm: float
    directions: tuple[str, ...]
    refined: bool
    pixels: Schedule | None = None

    @property
    def size_error_percent(self) -> float:
        """Error of the size in the image against the request of the scan file."""
        return 100.0 * (self.imaged.size_nm / self.nominal_nm - 1.0)


@dataclass(frozen=True, eq=False)
class Run:
    """A scan with one hysteresis model. ``configured`` are the axes on which it is that of the scanner file."""

    model: str
    configured: tuple[str, ...]
    x: AxisRun
    y: AxisRun


def run_line(line: LinePlan, axis: SettledAxis) -> AxisRun:
    """Play one axis until it has settled.

    Raises
    ------
    ValueError
        If the line leaves the range of the axis.
    """
    return run_on_each(line, [axis])[0]


def run_of_axis(plan: Plan, line: LinePlan, axis: SettledAxis) -> AxisRun:
    """Play one axis of a plan until it has settled; the errors of a sine are those of its pixels.

    Raises
    ------
    ValueError
        If the line leaves the range of the axis.
    """
    return run_on_each(line, [axis], pixels=plan.schedule)[0]


def run_on_each(
    line: LinePlan, axes: Sequence[SettledAxis], most_ticks: int = MAX_TICKS, pixels: Schedule | None = None
) -> list[AxisRun]:
    """Play the same line on several axes, with at most ``most_ticks`` ticks per period.

    ``pixels`` is the schedule of a line that is a sine: the errors are then those of its pixels.

    Raises
    ------
    ValueError
        If the line leaves the range of an axis.
    """
    drive = played(line, most_ticks)
    settled = [axis.settled(drive.volts, drive.tick_s) for axis in axes]
    if pixels is not None and line.imaged is not None:
        errors = [pixel_line_error(each, pixels, line.imaged) for each in settled]
    else:
        pixels = None
        requested, turn, window = intended(line, drive), line.drive.turn, line.band_limit.window
        errors = [line_error(each, turn, window, requested, 0.5) for each in settled]
    return [_axis_run(line, drive, *each, pixels) for each in zip(settled, errors, strict=True)]


def _axis_run(
    line: LinePlan, drive: PlayedDrive, displacement: Floats, error: LineError, pixels: Schedule | None
) -> AxisRun:
    directions = ("forward", "backward") if line.band_limit.directions == "both" else ("forward",)
    return AxisRun(
        axis=line.axis,
        turn=line.drive.turn,
        drive=drive,
        displacement_nm=displacement,
        error=error,
        imaged=about_window_line(error, directions),
        nominal_nm=line.drive.size_nm,
        directions=directions,
        refined=line.layer is not None,
        pixels=pixels,
    )


def with_model(setup: Setup, model: str, axes: Sequence[str] = ("x", "y")) -> Setup:
    """Return the scan with another hysteresis model on ``axes``, unless an axis has no parameters for it.

    A refinement was learnt over the scanner file's own model, and stays on axes that keep it.
    """
    scan, scanner = setup.scan, setup.scanner
    for name in axes:
        axis: ScannerAxis = getattr(scanner, name)
        h = axis.hysteresis
        other = None if h is None or h.model() == model else models.get(model).like(h)
        if other is None:
            continue
        axis = msgspec.structs.replace(axis, hysteresis=other)
        scanner = msgspec.structs.replace(scanner, **{name: axis})
        scan = msgspec.structs.replace(scan, **{name: msgspec.structs.replace(getattr(scan, name), refinement=None)})
    return replace(setup, scan=scan, scanner=scanner)


def models_of(setup: Setup) -> tuple[str, ...]:
    """Return the models that can be compared, the simplest first.

    These are the models for which all calibrated axes have parameters, and those of the scanner file itself.
    """
    both = (setup.scanner.x.hysteresis, setup.scanner.y.hysteresis)
    calibrated = [h for h in both if h is not None and h.calibrated]
    kinds: set[type[Hysteresis]] = {models.get(models.UNCOMPENSATED), *map(type, calibrated)}
    if calibrated:
        kinds |= {kind for kind in models.own() if all(kind.like(h) is not None for h in calibrated)}
    return tuple(kind.model() for kind in sorted(kinds, key=lambda kind: (kind.order, kind.model())))


def simulate(setup: Setup, scanner: VirtualScanner, model: str) -> Run:
    """Plan a scan with a hysteresis model, and play it on both axes.

    Raises
    ------
    Rejected
        If the scan cannot be built with this model.
    ValueError
        If it leaves the virtual scanner's range.
    """
    plan = make_plan(with_model(setup, model))
    configured = tuple(
        axis
        for axis, h in (("x", setup.scanner.x.hysteresis), ("y", setup.scanner.y.hysteresis))
        if (h.model() if h is not None else models.UNCOMPENSATED) == model
    )
    return Run(model, configured, run_line(plan.x, scanner.x), run_line(plan.y, scanner.y))
