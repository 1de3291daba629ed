"""Scans that run on the virtual scanner under a sensor, and rounds of refining them; for tests and a benchmark."""

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Literal

import msgspec
import numpy as np
from editing import SCAN, edited, write_pair
from replacing import replace

from tablegen.config.load import Setup, load
from tablegen.config.scanner import Scanner
from tablegen.planning.line_plan import LinePlan, make_plan
from tablegen.refinement.departure import Departure, departure
from tablegen.refinement.displacement import Displacement
from tablegen.refinement.image_round import refine_images, refine_mismatch
from tablegen.refinement.lattice_line import ImageOptions
from tablegen.refinement.round import Options, Round, refine
from tablegen.virtual.calibration_day import calibrate
from tablegen.virtual.imaging import Conditions, Surface, grating, hexagonal, rough, running_frame
from tablegen.virtual.parameters import load_truth
from tablegen.virtual.running import running_trace
from tablegen.virtual.scanner import VirtualAxis, VirtualScanner
from tablegen.virtual.sensor import Sensor
from tablegen.virtual.simulation import run_line
from tablegen.waveform.series import FourierSeries

ROUNDS = 4
NOISE = 0.002  # rms of a reading, of the line
PERIODS, SAMPLES = 11.3, 5000  # of a trace, and a period
FREE = ("- limits.max_scaling_error_percent", "- limits.max_error_lsb")


@dataclass(frozen=True)
class Scan:
    """A scan of the benchmark: what differs from the example."""

    name: str
    axis: Literal["x", "y"]
    edits: tuple[str, ...]


def _x(volts: float) -> Scan:
    return Scan(f"x, {volts:g} V at 100 Hz", "x", ("- x.size_nm", f"x.size_v = {volts}"))


SCANS = (
    *(_x(volts) for volts in (30.0, 60.0, 95.0)),
    Scan("y, 60 V at 0.5 Hz, turn 0.95", "y", ("- y.size_nm", "y.size_v = 60.0", "timing.lines = 200")),
)


@cache
def scanner(plant: str = "default") -> VirtualScanner:
    """One of those of the package."""
    return VirtualScanner.of(load_truth(plant))


def scan_text(*edits: str) -> str:
    """The example at 100 Hz, without limits."""
    return edited(SCAN, "timing.line_rate_hz = 100.0", "timing.lines = 20", *FREE, *edits)


def setup_of(*edits: str) -> Setup:
    """That scan, loaded, with edits."""
    with tempfile.TemporaryDirectory() as folder:
        return load(write_pair(Path(folder), scan_text(*edits)))


@cache
def _calibrated(plant: str) -> Scanner:
    """The virtual scanner from its own simulated data: x at 100 Hz, y at 0.5 Hz."""
    return calibrate(setup_of("timing.lines = 200"), scanner(plant)).setup.scanner


def calibrated(scan: Scan, plant: str = "default") -> Setup:
    """A scan on the virtual scanner as it was calibrated."""
    return replace(setup_of(*scan.edits), scanner=_calibrated(plant))


@dataclass(frozen=True, eq=False)
class Step:
    """A scan as it stands after some rounds: its true errors, those by the extremes, and what refining it says."""

    setup: Setup
    line: LinePlan
    true: Departure
    by_extremes: dict[str, float]
    round: Round | None


def period(nanometres: np.ndarray) -> Displacement:
    """One noiseless period, in the middle of every tick, as if it had been measured."""
    count = len(nanometres)
    c = np.fft.rfft(nanometres) / count * np.exp(-1j * np.pi * np.arange(count // 2 + 1) / count)
    few = min(512, count // 2 - 1)
    series = FourierSeries(float(c[0].real), 2.0 * c[1 : few + 1].real, -2.0 * c[1 : few + 1].imag)
    return Displacement(series, np.zeros((2 * few + 1,) * 2), 0.0, 0.0, 1.0, 1.0, count, 0)


def play(setup: Setup, name: Literal["x", "y"], axis: VirtualAxis) -> Step:
    """The true errors of the emitted integers, settled."""
    line: LinePlan = getattr(make_plan(setup), name)
    run = run_line(line, axis)
    extremes = {side: max(map(abs, getattr(run.error, side).residual_range)) for side in ("forward", "backward")}
    return Step(setup, line, departure(line, period(run.displacement_nm)), extremes, None)


def sensed(line: LinePlan, axis: VirtualAxis, seed: int, **others: Any) -> dict[str, np.ndarray]:
    """A trace with the sensor's noise, in mid-line from the start, by another clock and with drift."""
    size = line.drive.size_nm
    sensor = Sensor(NOISE * size, 0.002 * size * float(line.rate), seed)
    return running_trace(line, axis, **{"periods": PERIODS, "samples": SAMPLES, **others}, sensor=sensor, start=0.37)


def learnt(step: Step, axis: VirtualAxis, seed: int, options: Options | None = None, **others: Any) -> Round:
    """A round on a trace of a scan as it stands."""
    found = sensed(step.line, axis, seed, **{"clock": 5e-4, **others})
    columns = found["time_s"], found["displacement_nm"], found["drive_v"]
    return refine(step.setup, step.line.axis, *columns, options or Options())


def rounds(
    setup: Setup, name: Literal["x", "y"], count: int, options: Options | None = None, plant: str = "default"
) -> Iterator[Step]:
    """The scan before the first round and after each of ``count``."""
    axis: VirtualAxis = getattr(scanner(plant), name)
    for seed in range(count + 1):
        step = play(setup, name, axis)
        if seed == count:
            yield step
            return
        found = learnt(step, axis, seed, options)
        yield replace(step, round=found)
        setup = found.setup


_LITTERED = 2.0  # lines of 60 V: a square that has all places of the scanner
ON_TIME = ImageOptions(delay_pixels=0.0)  # the images are known not to be late
IMAGED = Conditions(noise=0.05, drift=(0.02, 0.01), tilt=(0.5, 0.3))


@dataclass(frozen=True)
class Sample:
    """A sample of so many periods, or grains, in a line, with ``debris`` per square of a line."""

    name: str
    periods: float
    angle_deg: float = 7.0
    debris: int = 0

    def of(self, size_nm: float) -> Surface:
        """On a line of this size."""
        if self.name == "rough":
            return rough(size_nm / self.periods)
        kind = grating if self.name == "grating" else hexagonal
        surface = kind(size_nm / self.periods, self.angle_deg)
        return littered(surface, size_nm, self.debris) if self.debris else surface


def littered(surface: Surface, size_nm: float, debris: int, seed: int = 0) -> Surface:
    """The surface with so many bumps per square of a line, some 2 % of the line wide and as high as its waves."""
    random = np.random.default_rng(seed)
    count = round(debris * _LITTERED**2)
    centres = random.uniform(0.0, _LITTERED * size_nm, (count, 2))
    widths, tops = 0.02 * size_nm * random.uniform(0.5, 1.5, count), random.uniform(0.5, 1.5, count)

    def height(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        bumps = zip(centres, widths, tops, strict=True)
        away = ((top, ((x - at[0]) ** 2 + (y - at[1]) ** 2) / (2.0 * wide**2)) for at, wide, top in bumps)
        return np.asarray(surface(x, y) + sum(top * np.exp(-square) for top, square in away))

    return height


GRATING, LATTICE, ROUGH = Sample("grating", 15.0, 3.0), Sample("lattice", 17.0), Sample("rough", 30.0)
SLOPING = Sample("grating", 20.0, 40.0)  # with periods along x and y


def imaged_scan(axis: Literal["x", "y"], volts: float, lines: int = 200, pixels: int = 200) -> Scan:
    """A square scan at 100 lines a second, both axes at so many volts."""
    sizes = ("- x.size_nm", f"x.size_v = {volts}", "- y.size_nm", f"y.size_v = {volts}")
    return Scan(f"{axis}, {volts:g} V", axis, (*sizes, f"timing.lines = {lines}", f"timing.pixels = {pixels}"))


def frames_of(
    setup: Setup, sample: Sample, count: int = 1, seed: int = 0, plant: str = "default", conditions: Conditions = IMAGED
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Trace and retrace of frames of the running scan that follow each other."""
    plan, truth = make_plan(setup), scanner(plant)
    surface, found = sample.of(plan.x.drive.size_nm), []
    for number in range(count):
        seen = replace(conditions, frame=number, seed=1000 * seed + number)
        frame = running_frame(plan, truth.x, truth.y, surface, seen)
        found.append((frame.trace.heights, frame.retrace.heights))
    return found


def image_rounds(
    setup: Setup,
    name: Literal["x", "y"],
    count: int,
    sample: Sample,
    plant: str = "default",
    frames: int | None = None,
) -> Iterator[Step]:
    """As ``rounds``, from images: by default one frame a round for x, two for y."""
    axis: VirtualAxis = getattr(scanner(plant), name)
    learn_from = refine_mismatch if sample.name == "rough" else refine_images
    for seed in range(count + 1):
        step = play(setup, name, axis)
        if seed == count:
            yield step
            return
        pairs = frames_of(setup, sample, frames or (1 if name == "x" else 2), seed, plant)
        found = learn_from(setup, name, pairs, Options(), ON_TIME)
        yield replace(step, round=found)
        setup = found.setup


def elsewhere(plant: str = "default") -> Iterator[tuple[str, Step, Step]]:
    """A layer at 60 V as learnt, and at the edges of what it serves; beside it the same scan without."""
    *_, last = rounds(calibrated(SCANS[1], plant), "x", 3, plant=plant)
    layer = last.setup.scan.x.refinement
    edges: tuple[tuple[str, dict[str, Any], dict[str, Any]], ...] = (
        ("as learnt, 60 V", {}, {}),
        ("amplitude + 5 %", {"size_v": 62.9}, {}),
        ("amplitude - 5 %", {"size_v": 57.1}, {}),
        ("offset + 5 % of v_max", {"offset_v": 54.9}, {}),
        ("offset - 5 % of v_max", {"offset_v": 45.1}, {}),
        ("rate + 20 %", {}, {"line_rate_hz": 119.0}),
        ("rate - 20 %", {}, {"line_rate_hz": 81.0}),
        ("turn + 0.02", {"turn": 0.52}, {}),
    )
    for what, axis, timing in edges:
        both = []
        for kept in (layer, None):
            scan = last.setup.scan
            x = msgspec.structs.replace(scan.x, refinement=kept, **axis)
            changed = msgspec.structs.replace(scan, x=x, timing=msgspec.structs.replace(scan.timing, **timing))
            both.append(play(replace(last.setup, scan=changed), "x", scanner(plant).x))
        yield what, both[0], both[1]
