"""Simulation of both axes on the scanner of the scanner file, with and without correction.

The scanner is the operator of an axis that has one. Otherwise it is the law: (17) at the stroke that is really played,
which is smaller than the corrected line, since turnarounds are rounded. Trace and retrace therefore do not meet
although each branch was inverted; their distance is the one that the certificate expects.

A sine is not bent by a correction: its drive is the same without one, and its pixels are where a piezo without
hysteresis would be.
"""

from dataclasses import dataclass
from typing import Literal

import msgspec
import numpy as np
from msgspec.structs import replace

from tablegen.base.input_errors import Rejected, Unphysical
from tablegen.compensation import models
from tablegen.compensation.identification import SettledAxis
from tablegen.compensation.line import LineShape
from tablegen.config.load import Setup
from tablegen.device.schedule import Schedule
from tablegen.html_report.subject import PlannedScan
from tablegen.numerics.arrays import Floats
from tablegen.planning.line_plan import LinePlan, make_plan
from tablegen.planning.pixel_table import with_pixel_table
from tablegen.planning.sine_setup import with_motion
from tablegen.virtual.own_run import own_piezo
from tablegen.virtual.simulation import AxisRun, run_on_each, with_model
from tablegen.waveform.series import FourierSeries

MOST_TICKS = 1 << 13  # of a period that are played


@dataclass(frozen=True, eq=False)
class LawAxis:
    """An axis that follows the laws of the scanner file at the played stroke; nm from its lower turn.

    A layer of ``tablegen refine`` corrects what the laws do not describe, and is left out.
    """

    line: LinePlan

    def settled(self, volts: Floats, tick_s: float) -> Floats:
        """Return the settled position in the middle of each tick of a period.

        Parameters
        ----------
        volts
            One period in V, held tick by tick, shape (ticks,).
        tick_s
            Length of a tick in s.

        Returns
        -------
        Position in nm, shape (ticks,).
        """
        line, count = self.line, len(volts)
        drive = line.drive
        w = self._behind_dynamics((volts - drive.v_offset) / drive.v_amplitude + 0.5, tick_s)
        if line.layer is not None:
            w = w - line.layer.value((np.arange(count) + 0.5) / count)
        bottom, top = int(np.argmin(w)), int(np.argmax(w))
        low, high = float(w[bottom]), float(w[top])
        shape: LineShape | None = drive.line_at(drive.v_scan_normalised * (high - low))
        shape = drive.shape if shape is None else shape
        rising = (np.arange(count) - bottom) % count < (top - bottom) % count
        u = (w - low) / (high - low)
        place = np.where(rising, shape.forward.inverse(u), 1.0 - shape.backward.inverse(1.0 - u))
        return drive.size_law.size_nm(drive.v_scan_normalised * (high - low)) * place

    def _behind_dynamics(self, w: Floats, tick_s: float) -> Floats:
        response, count = self.line.drive.response, len(w)
        if response is None:
            return w
        spectrum = np.fft.rfft(w)
        n = np.arange(1, min(self.line.series.harmonics, (count - 1) // 2) + 1)
        real, imaginary = response.inverse(n / (count * tick_s))
        spectrum[n] /= real + 1j * imaginary
        return np.fft.irfft(spectrum, count)


@dataclass(frozen=True)
class PlayedCorrection:
    """One correction of an axis on the scanner of the scanner file: "uncompensated", "laws", "operator"."""

    name: str
    run: AxisRun

    @property
    def title(self) -> str:
        """The words for headings."""
        return "without correction" if self.name == "uncompensated" else f"with the {self.name}"


@dataclass(frozen=True)
class PlayedAxis:
    """An axis with all of its corrections, the emitted one last; ``rejected`` says why others are missing."""

    axis: Literal["x", "y"]
    on_operator: bool
    corrections: tuple[PlayedCorrection, ...]
    rejected: tuple[str, ...]

    @property
    def emitted(self) -> AxisRun | None:
        """The run of the emitted waveform."""
        last = self.corrections[-1] if self.corrections else None
        return last.run if last is not None and last.name != "uncompensated" else None

    @property
    def before(self) -> AxisRun | None:
        """The run without the correction of hysteresis."""
        first = self.corrections[0] if self.corrections else None
        return first.run if first is not None and first.name == "uncompensated" else None


def played_axes(planned: PlannedScan) -> tuple[PlayedAxis, ...]:
    """Play the axes that move."""
    bare = without_refinement(planned.setup)
    sine = planned.plan.schedule.pixel_table is not None
    motion: Literal["line", "sine"] = "sine" if sine else "line"
    setup = bare if bare.scan.x.motion == motion else with_motion(bare, motion)
    plain = planned.plan if bare is planned.setup else make_plan(setup, sines=sine)
    others = {model: _planned(setup, model, sine) for model in _models(planned)}
    return tuple(
        _played_sine(line, plain.schedule) if line.axis == "x" and sine else _played(line, unrefined, others)
        for line, unrefined in zip(planned.plan.moving, plain.moving, strict=True)
    )


def without_refinement(setup: Setup) -> Setup:
    """Return the same scan without its layers, which were learnt on the scanner itself."""
    scan = setup.scan
    if scan.x.refinement is None and scan.y.refinement is None:
        return setup
    bare = {name: msgspec.structs.replace(getattr(scan, name), refinement=None) for name in ("x", "y")}
    return replace(setup, scan=msgspec.structs.replace(scan, **bare))


def _models(planned: PlannedScan) -> list[str]:
    """Return the models to compare with: without correction, and beside an operator the laws."""
    names = [models.UNCOMPENSATED]
    for line in planned.plan.lines:
        if own_piezo(line) is not None:
            laws = models.laws_beside(line.drive.hysteresis)
            if laws is not None and laws.model() not in names:
                names.append(laws.model())
    return names


def _planned(setup: Setup, model: str, sine: bool) -> tuple[LinePlan, LinePlan] | str:
    """Plan the lines of another model, or return why there are none; a sine keeps its own model."""
    try:
        return make_plan(with_model(setup, model, ("y",) if sine else ("x", "y")), sines=sine).lines
    except Rejected as rejected:
        return f"{model}: {rejected.problems[0].why}"


def _played(line: LinePlan, plain: LinePlan, others: dict[str, tuple[LinePlan, LinePlan] | str]) -> PlayedAxis:
    piezo = own_piezo(plain)
    own = piezo is not None
    axis: SettledAxis = LawAxis(plain) if piezo is None else piezo
    corrections, rejected = [], []
    for model, lines in others.items():
        if isinstance(lines, str):
            rejected.append(lines)
        elif model == models.UNCOMPENSATED or own:
            name = "uncompensated" if model == models.UNCOMPENSATED else "laws"
            corrections.append((name, lines[0 if line.axis == "x" else 1]))
    if plain.drive.hysteresis.compensates:
        corrections.append((plain.drive.model if own else "laws", plain))
    played = []
    for name, one in corrections:
        try:
            played.append(PlayedCorrection(name, run_on_each(one, [axis], MOST_TICKS)[0]))
        except (Unphysical, ValueError) as reason:
            rejected.append(f"{name}: {reason}")
    return PlayedAxis(line.axis, own, tuple(played), tuple(rejected))


def _played_sine(line: LinePlan, schedule: Schedule) -> PlayedAxis:
    """Play a sine on its operator, once with its pixels where a piezo without hysteresis would be."""
    piezo = own_piezo(line)
    assert piezo is not None
    played, rejected = [], []
    for name in (models.UNCOMPENSATED, line.drive.model):
        try:
            pixels = schedule if name == line.drive.model else _pixels_without_hysteresis(line, schedule)
            (run,) = run_on_each(line, [piezo], MOST_TICKS, pixels)
        except (Unphysical, ValueError) as reason:
            rejected.append(f"{name}: {reason}")
            continue
        played.append(PlayedCorrection("uncompensated" if name == models.UNCOMPENSATED else name, run))
    return PlayedAxis(line.axis, True, tuple(played), tuple(rejected))


def _pixels_without_hysteresis(line: LinePlan, schedule: Schedule) -> Schedule:
    """Return the schedule of a sine with pixels at equal steps of what the piezo is to follow, which is a sine too."""
    assert line.imaged is not None
    wave = line.target
    height = 2.0 * float(np.hypot(wave.a[0], wave.b[0]))
    return with_pixel_table(schedule, FourierSeries(0.5, wave.a / height, wave.b / height), line.imaged)
