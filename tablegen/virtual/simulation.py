"""A scan on the virtual scanner: emitted integers in, displacement and its errors out, model by model."""

from dataclasses import dataclass, replace
from typing import Literal

import msgspec

from tablegen.config.load import Setup
from tablegen.config.schema import Hysteresis, ScannerAxis
from tablegen.numerics.arrays import Floats
from tablegen.plan import LinePlan, make_plan
from tablegen.virtual.measurement import LineError, line_error
from tablegen.virtual.played import Drive, intended, played
from tablegen.virtual.scanner import VirtualAxis, VirtualScanner

Model = Literal["triangle", "sinusoidal", "harmonic"]
MODELS: tuple[Model, ...] = ("triangle", "sinusoidal", "harmonic")


@dataclass(frozen=True, eq=False)
class AxisRun:
    """One axis of a scan: what was put out, and where the virtual scanner went, in nm above rest at 0 V."""

    axis: Literal["x", "y"]
    turn: float
    drive: Drive
    displacement_nm: Floats
    error: LineError
    nominal_nm: float
    directions: tuple[str, ...]

    @property
    def size_error_percent(self) -> float:
        """Of the line's size against what the scan file asks for."""
        return 100.0 * (self.error.size_nm / self.nominal_nm - 1.0)


@dataclass(frozen=True, eq=False)
class Run:
    """A scan with one hysteresis model. ``asked`` is whether it is that of the scanner file."""

    model: Model
    asked: tuple[str, ...]
    x: AxisRun
    y: AxisRun


def run_line(line: LinePlan, axis: VirtualAxis) -> AxisRun:
    """Play one axis until it has settled."""
    drive = played(line)
    displacement = axis.settled(drive.volts, drive.tick_s)
    error = line_error(displacement, line.drive.turn, line.band_limit.window, intended(line, drive))
    directions = ("forward", "backward") if line.band_limit.directions == "both" else ("forward",)
    return AxisRun(line.axis, line.drive.turn, drive, displacement, error, line.drive.size_nm, directions)


def with_model(setup: Setup, model: Model) -> Setup:
    """The same scan with another hysteresis model on both axes; one without calibrated branches stays a triangle."""

    def axis(scanner: ScannerAxis) -> ScannerAxis:
        h = scanner.hysteresis
        if h is None or (not h.branches and model != "triangle"):
            return scanner
        return msgspec.structs.replace(scanner, hysteresis=Hysteresis(model=model, branches=h.branches))

    scanner = setup.scanner
    return replace(setup, scanner=msgspec.structs.replace(scanner, x=axis(scanner.x), y=axis(scanner.y)))


def models_of(setup: Setup) -> tuple[Model, ...]:
    """Models for which the scanner file has parameters on at least one axis."""
    calibrated = [h for h in (setup.scanner.x.hysteresis, setup.scanner.y.hysteresis) if h is not None and h.branches]
    if not calibrated:
        return ("triangle",)
    peaks = all(b.u_peak is not None for h in calibrated for e in h.branches for b in (e.forward, e.backward))
    return MODELS if peaks else MODELS[:2]


def simulate(setup: Setup, scanner: VirtualScanner, model: Model) -> Run:
    """Plan a scan with a hysteresis model, and play it on both axes.

    Raises ``Rejected`` where it cannot be played so, and ``ValueError`` where it leaves the virtual scanner's range.
    """
    plan = make_plan(with_model(setup, model))
    asked = tuple(
        axis
        for axis, h in (("x", setup.scanner.x.hysteresis), ("y", setup.scanner.y.hysteresis))
        if (h.model if h is not None else "triangle") == model
    )
    return Run(model, asked, run_line(plan.x, scanner.x), run_line(plan.y, scanner.y))
