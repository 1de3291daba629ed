"""Scans at an angle on piezos that the project does not contain, identified from ten traces an axis."""

from functools import cache
from pathlib import Path

import numpy as np
from editing import SCAN, SCANNER, edited, write_pair
from foreign_plants import BIAS, TEN, V_MAX, BoucWen, Core, Floats, ForeignPlant, JilesAtherton, ManyPlays, record
from msgspec.structs import replace
from operator_files import operator_file as operator_file_of_plays
from stepped_plants import play_of

from tablegen.calibration.laws.hysteresis import Trace
from tablegen.calibration.operator.file_of_fit import operator_file
from tablegen.calibration.operator.fit import fit_operator
from tablegen.calibration.operator.periodic_line import periodic_line
from tablegen.certificate.turned_errors import frame_codes, frame_errors
from tablegen.compensation.operator.file import operator_text
from tablegen.config.load import Setup, load
from tablegen.numerics.arrays import Ints
from tablegen.planning.turned_plan import TurnedPlan
from tablegen.virtual.preisach import Preisach

# Traces beside the ten, for a scan at an angle: two at the rate of a frame, two of what an axis takes of a line. Centre
# and stroke in shares of the range, and Hz.
FURTHER = ((0.5, 0.45, 2.0), (0.5, 0.97, 2.0), (0.5, 0.35, 100.0), (0.5, 0.17, 100.0))
Further = tuple[tuple[float, float, float], ...]
SIMPLE = "simple"  # an operator that no fit has made
UNCOUPLED = 0.0, 0.0
SAMPLES = 320  # of a line, on which foreign piezos are stepped


class Everett:
    """A Preisach operator of another density than those of the virtual scanners, settled."""

    def __init__(self, seed: int) -> None:
        random = np.random.default_rng(seed)
        rows = [tuple((400.0 * random.uniform(0.2, 1.0, 4 - i)).tolist()) for i in range(4)]
        self.operator = Preisach((760.0, 900.0, 840.0), tuple(rows))

    def settled(self, u: Floats) -> Floats:
        """The second of two periods."""
        memory = None
        for _ in range(2):
            moved, memory = self.operator.play(u, memory)
        return moved


PIEZOS: dict[str, tuple[Core, Core]] = {
    "plays": (ManyPlays(1), ManyPlays(5)),
    "preisach": (Everett(1), Everett(2)),
    "other plays": (ManyPlays(9), ManyPlays(12)),
    "bouc-wen": (BoucWen(), BoucWen(depth=0.5, asymmetry=0.2)),
    "jiles-atherton": (JilesAtherton(), JilesAtherton(pinning=0.45)),
}
EDITS = (
    "timing.line_rate_hz = 100", "x.band_limit.harmonics = 24", "y.band_limit.harmonics = 16", "- [limits]",
)  # fmt: skip
OPERATORS = (
    *(f"{axis}.hysteresis.{key}" for axis in "xy" for key in ("model = 'operator'", f"file = 'operator_{axis}.toml'")),
    *(f"- [{table}]" for table in ("x.resonance", "x.frequency", "y.frequency", "x.offset", "y.offset")),
)


@cache
def operator_bytes(piezo: str, axis: str, further: Further = ()) -> bytes:
    """The operator's file of one axis of a piezo, from ten traces and further, or of plays nobody measured."""
    if piezo == SIMPLE:
        return operator_text(operator_file_of_plays(axis), []).encode("utf-8")
    plant = ForeignPlant(PIEZOS[piezo]["xy".index(axis)])
    traces = [Trace(f"{k}", *record(plant, at, stroke, seed=k)) for k, (at, stroke) in enumerate(TEN)]
    traces += [Trace(f"{k}", *record(plant, *one, seed=k)) for k, one in enumerate(further, len(TEN))]
    fit = fit_operator([periodic_line(trace, V_MAX) for trace in traces], None, lambda _: 1.0)
    return operator_file(fit, "x" if axis == "x" else "y", V_MAX)


def write_turned(
    folder: Path,
    angle_deg: float,
    *edits: str,
    piezo: str = SIMPLE,
    size_nm: float = 300.0,
    coupling: tuple[float, float] = UNCOUPLED,
    further: Further = (),
) -> Path:
    """The example at an angle, of so many lines, with an operator on both axes; coupling is ``x_per_y, y_per_x``."""
    for axis in "xy":
        (folder / f"operator_{axis}.toml").write_bytes(operator_bytes(piezo, axis, further))
    sizes = (f"x.size_nm = {size_nm}", f"y.size_nm = {size_nm}", "timing.lines = 48")
    scan = f"angle_deg = {angle_deg}\n" + edited(SCAN, *EDITS, *sizes, *edits)
    coupled = f"+ [coupling]\nx_per_y = {coupling[0]}\ny_per_x = {coupling[1]}"
    return write_pair(folder, scan, edited(SCANNER, *OPERATORS, *([] if coupling == UNCOUPLED else [coupled])))


def turned_setup(
    folder: Path,
    angle_deg: float,
    *edits: str,
    piezo: str = SIMPLE,
    size_nm: float = 300.0,
    coupling: tuple[float, float] = UNCOUPLED,
    further: Further = (),
) -> Setup:
    """The setup of it."""
    return load(
        write_turned(folder, angle_deg, *edits, piezo=piezo, size_nm=size_nm, coupling=coupling, further=further)
    )


def on_the_piezo(plan: TurnedPlan, piezo: str, coupling: tuple[float, float] = UNCOUPLED) -> dict[str, float]:
    """Errors of the emitted integers on the piezo itself: stepped over the frame, with its creep and dynamics.

    Its axes are coupled by ``x_per_y, y_per_x``, whatever the plan knows of it.
    """
    x, y = (moved(plan, piezo, axis) for axis in "xy")
    sample = x + coupling[0] * y, y + coupling[1] * x
    return frame_errors(plan, *sample, _phases(plan), replace(plan.geometry, x_per_y=0.0, y_per_x=0.0))


def moved(plan: TurnedPlan, piezo: str, axis: str) -> Floats:
    """Position in nm of an axis over a frame, shape (lines, samples)."""
    number = "xy".index(axis)
    u = plan.axes[number].share(frame_codes(plan.axes[number], _ticks(plan)))
    return moved_by(PIEZOS[piezo][number], u, plan.x.motion.line_rate_hz)


def sensor_trace(
    plan: TurnedPlan, piezo: str, axis: str, frames: int = 4, noise_nm: float = 0.3, drift_nm: float = 2.0
) -> tuple[Floats, Floats]:
    """Times and displacements of frames, read by a sensor with noise, a drift a frame, and an origin of its own."""
    every = (np.arange(plan.schedule.lines)[:, None] + _phases(plan)).ravel() / plan.x.motion.line_rate_hz
    period_s = plan.schedule.lines / plan.x.motion.line_rate_hz
    time_s = np.concatenate([every + k * period_s for k in range(frames)])
    noise = np.random.default_rng("xy".index(axis)).normal(0.0, noise_nm, len(time_s))
    return time_s, np.tile(moved(plan, piezo, axis).ravel(), frames) + noise + drift_nm * time_s / period_s + 500.0


def _ticks(plan: TurnedPlan) -> Ints:
    return np.arange(0, plan.schedule.ticks, max(plan.schedule.ticks // SAMPLES, 1))


def _phases(plan: TurnedPlan) -> Floats:
    return np.asarray((_ticks(plan) + 0.5) / plan.schedule.ticks)


def moved_by(core: Core, u: Floats, line_rate_hz: float) -> Floats:
    """Position in nm of a frame of normalised drives that has been repeated, shape of ``u``."""
    frame = u.ravel()
    parts = [np.linspace(0.0, frame[0], 200), frame, frame]
    played = play_of(core.operator if isinstance(core, Everett) else core)(parts)[2]  # type: ignore[arg-type]
    mean = 2.0 * float(np.mean(frame)) - 1.0
    moved = played * (1.0 + BIAS[0] * mean + BIAS[1] * mean * mean)
    plant = ForeignPlant(core)
    f_hz = line_rate_hz / len(u) * np.arange(len(frame) // 2 + 1)
    return np.fft.irfft(np.fft.rfft(moved) * plant.dynamics(f_hz) * plant.crept(f_hz), len(frame)).reshape(u.shape)
