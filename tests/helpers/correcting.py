"""Uncompensated frames of piezos with where each pixel was, their operators, and how far a correction is off."""

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from calibrating import Scanner as Measured
from calibrating import branch, grown, inverse
from foreign_plants import SIX, BoucWen, ForeignPlant, ManyPlays, record
from scipy.ndimage import map_coordinates

from tablegen.calibration.laws.hysteresis import Trace
from tablegen.calibration.operator.file_of_fit import operator_file
from tablegen.calibration.operator.fit import OperatorFit, fit_operator
from tablegen.calibration.operator.periodic_line import periodic_line
from tablegen.compensation.dynamics import SecondOrder
from tablegen.compensation.identification import SettledAxis
from tablegen.correction.distortion import Distortion
from tablegen.numerics.arrays import Floats
from tablegen.virtual.experiments import sensor_trace
from tablegen.virtual.imaging import Conditions, FrameImages, Surface, hexagonal, triangle_frame
from tablegen.virtual.parameters import load_truth
from tablegen.virtual.scanner import VirtualScanner
from tablegen.virtual.sensor import Sensor

_SAMPLES = 2000  # of a period, on which foreign piezos are integrated
BUILT_IN = ("default", "duhem")
FOREIGN = {"plays": ManyPlays, "bouc-wen": BoucWen}
PLANTS = (*BUILT_IN, *FOREIGN)
LATTICE = hexagonal(60.0)
V, OFFSET_V, RATE_HZ = 90.0, 50.0, 100.0
LAWS = """name = "old"
v_max = 100.0
""" + "".join(
    f"""[{axis}.size]
k_nm_per_v = 12.0
[[{axis}.hysteresis.branches]]
turn = 0.5
forward = {{beta_max = 0.037, rho = 4.0, u_peak = 0.37}}
backward = {{beta_max = 0.080, rho = 1.5, u_peak = 0.48}}
"""
    for axis in "xy"
)
SCANNER = """name = "old"
v_max = 100.0
[x.size]
k_nm_per_v = 12.0
[x.hysteresis]
model = "operator"
file = "x.toml"
[y.size]
k_nm_per_v = 12.0
[y.hysteresis]
model = "operator"
file = "y.toml"
"""


# What `calibrate resonance` would say of the foreign piezos, as docs/operator.md takes it.
MODE = SecondOrder(60e3, 14.0, 2e-6)
RESONANCES = "".join(f"[{axis}.resonance]\nfrequency_hz = 60e3\nquality = 14.0\ndelay_s = 2e-6\n" for axis in "xy")


@dataclass(frozen=True)
class Foreign:
    """A foreign piezo as an axis."""

    plant: ForeignPlant

    def settled(self, volts: Floats, tick_s: float) -> Floats:
        """nm of a period of volts."""
        ticks = np.arange(len(volts)) / len(volts)
        at = np.arange(_SAMPLES) / _SAMPLES
        moved = self.plant.settled(np.interp(at, ticks, volts, period=1.0), 1.0 / (len(volts) * tick_s))
        return np.interp(ticks, at, moved, period=1.0)


class Printed:
    """An axis that obeys the paper's equations as printed, by bisection; 12 nm a volt."""

    def settled(self, volts: Floats, tick_s: float) -> Floats:
        """nm of a period of volts."""
        assert tick_s > 0.0
        low, high = float(np.min(volts)), float(np.max(volts))
        u = (volts - low) / (high - low)
        count, bottom, top = len(u), int(np.argmin(u)), int(np.argmax(u))
        rising = (np.arange(count) - bottom) % count < (top - bottom) % count
        forward, backward = (
            branch(grown(high - low, beta_max, rho), u_peak)
            for beta_max, rho, u_peak in (Measured.forward, Measured.backward)
        )
        moved = np.where(rising, inverse(forward, u), 1.0 - inverse(backward, 1.0 - u))
        return 12.0 * (high - low) * moved


def axes(plant: str) -> tuple[SettledAxis, SettledAxis]:
    """x and y; of "paper" what obeys its equations."""
    if plant == "paper":
        return Printed(), Printed()
    if plant in FOREIGN:
        both = Foreign(ForeignPlant(FOREIGN[plant]()))
        return both, both
    scanner = VirtualScanner.of(load_truth(plant))
    return scanner.x, scanner.y


@lru_cache
def old_frame(
    plant: str,
    surface: Surface = LATTICE,
    size_v: float = V,
    pixels: int = 256,
    lines: int = 128,
    noise: float = 0.05,
    drift: tuple[float, float] = (0.0, 0.0),
    tilt: tuple[float, float] = (0.0, 0.0),
    turn: tuple[float, float] = (0.5, 0.5),
    window: tuple[float, float] = (0.0, 1.0),
    rate_hz: float = RATE_HZ,
    seed: int = 1,
) -> FrameImages:
    """A triangle on each axis, no correction."""
    conditions = Conditions(noise=noise, drift=drift, tilt=tilt, seed=seed)
    sizes, offsets = (size_v, size_v), (OFFSET_V, OFFSET_V)
    return triangle_frame(*axes(plant), surface, sizes, offsets, rate_hz, conditions, pixels, lines, turn, window)


def save_pair(frame: FrameImages, folder: Path, name: str = "") -> tuple[Path, Path]:
    """As .npy files."""
    paths = folder / f"{name}trace.npy", folder / f"{name}retrace.npy"
    for path, image in zip(paths, (frame.trace, frame.retrace), strict=True):
        np.save(path, image.heights)
    return paths


def scanner_file(plant: str, folder: Path) -> Path:
    """A scanner file with an operator for each axis, of six traces with 0.1 % of noise, in a folder."""
    for axis in "xy":
        fit = _identified(plant, "x" if plant in FOREIGN else axis)  # of a foreign piezo both are the same
        (folder / f"{axis}.toml").write_bytes(operator_file(fit, "x" if axis == "x" else "y", 100.0))
    path = folder / "scanner.toml"
    path.write_text(SCANNER + (RESONANCES if plant in FOREIGN else ""), "utf-8")
    return path


@lru_cache
def _identified(plant: str, axis: str) -> OperatorFit:
    traces = []
    for seed, (centre, stroke) in enumerate(SIX):
        if plant in FOREIGN:
            traces.append(Trace(f"{stroke:g}", *record(ForeignPlant(FOREIGN[plant]()), centre, stroke, seed=seed)))
            continue
        its = axes(plant)["xy".index(axis)]
        sensor = Sensor(noise_nm=1.2 * stroke, seed=seed)
        columns = sensor_trace(its, 100.0 * stroke, 100.0 * centre, RATE_HZ, periods=5, sensor=sensor)
        traces.append(Trace(f"{stroke:g}", columns["time_s"], columns["drive_v"], columns["displacement_nm"]))
    response = MODE if plant in FOREIGN else None
    return fit_operator([periodic_line(trace, 100.0) for trace in traces], response, lambda _: 1.0)


@dataclass(frozen=True)
class Off:
    """How far a straight picture is off, in percent of the width, x and y of each direction; sizes off in percent."""

    trace: tuple[float, float]
    retrace: tuple[float, float]
    size: tuple[float, float]

    @property
    def x(self) -> float:
        """The worse direction."""
        return max(self.trace[0], self.retrace[0])

    @property
    def y(self) -> float:
        """The worse direction."""
        return max(self.trace[1], self.retrace[1])


def off(distortion: Distortion, frame: FrameImages, sheared: bool = False) -> Off:
    """About the line through both directions that fits best; with ``sheared`` about the best plane.

    The truth is where each pixel was on the sample, at the place that it comes from. Outermost half pixels aside.
    """
    places, truths = [], []
    for forward, image in ((True, frame.trace), (False, frame.retrace)):
        row, column, inside = distortion.sources(forward)
        inside &= (row > 0) & (row < distortion.rows - 1) & (column > 0) & (column < distortion.columns - 1)
        x, y = np.meshgrid(*distortion.grid)
        places.append(np.stack([np.ones(np.sum(inside)), x[inside], y[inside]], axis=1))
        true = (image.x_nm + image.drift_nm[0], image.y_nm + image.drift_nm[1])
        truths.append(np.stack([map_coordinates(one, [row, column], order=1)[inside] for one in true], axis=1))
    place, truth = np.concatenate(places), np.concatenate(truths)
    error, sizes = np.empty_like(truth), []
    for axis in (0, 1):
        terms = place if sheared else place[:, [0, axis + 1]]
        found = np.linalg.lstsq(terms, truth[:, axis], rcond=None)[0]
        error[:, axis] = truth[:, axis] - terms @ found
        sizes.append(100.0 * (1.0 / float(found[axis + 1 if sheared else 1]) - 1.0))
    percent = 100.0 * np.abs(error) / np.ptp(truth, axis=0)
    count = len(places[0])
    ways = [tuple(float(value) for value in np.max(part, axis=0)) for part in (percent[:count], percent[count:])]
    return Off(*ways, (sizes[0], sizes[1]))  # type: ignore[arg-type]
