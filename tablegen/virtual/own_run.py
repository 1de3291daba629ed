"""A scan on the scanner file's own operator: what its corrections gain, over several departures from the operator."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import msgspec
import numpy as np

from tablegen.base.input_errors import Rejected, Unphysical
from tablegen.compensation import models
from tablegen.compensation.identification import MeasuredLine, SettledAxis
from tablegen.compensation.model import Hysteresis
from tablegen.config.load import Setup
from tablegen.config.scanner import ScannerAxis
from tablegen.device.schedule import Schedule
from tablegen.planning.line_plan import LinePlan, Plan, make_plan
from tablegen.planning.sine_setup import with_motion
from tablegen.virtual.simulation import AxisRun, run_on_each, with_model

SEEDS = 20
_MOST_TICKS = 1 << 13  # of a period that are evaluated
MEASURES = ("rms", "scaling", "mismatch", "size")


@dataclass(frozen=True, slots=True)
class OwnRow:
    """One correction on one axis.

    ``errors`` has a row per seed and a column per measure, in percent of the line; mismatch is NaN where one direction
    images. ``rejected`` is the reason why it could not be played. ``example`` is the run of the first seed.
    """

    correction: str
    model: str
    errors: tuple[tuple[float, ...], ...] = ()
    rejected: str = ""
    example: AxisRun | None = field(default=None, compare=False, repr=False)

    def summary(self) -> dict[str, tuple[float, float]]:
        """Return the mean and the worst of each measure, the worst with its sign; no mismatch of one direction."""
        out = {}
        for name, column in zip(MEASURES, np.array(self.errors).T, strict=True):
            if not np.isnan(column[0]):
                out[name] = float(np.mean(column)), float(column[np.argmax(np.abs(column))])
        return out


@dataclass(frozen=True, slots=True)
class OwnRun:
    """One axis: the request, the traces on which the operator rests, and the corrections.

    ``distance`` is that of the offset to the nearest one of a trace, of v_max. ``refined``: the scan file has a
    refinement, which was learnt on the piezo itself and is left out.
    """

    axis: str
    nominal_nm: float
    traces: tuple[MeasuredLine, ...]
    distance: float
    refined: bool
    rows: tuple[OwnRow, ...]


def own_axes(setup: Setup) -> tuple[str, ...]:
    """Return the axes of which the scanner file has an operator."""
    tables = {name: _table(setup, name) for name in ("x", "y")}
    return tuple(name for name, table in tables.items() if table is not None and table.identified)


def simulate_own(setup: Setup, seed: int, tell: Callable[[str], object] = lambda _: None) -> list[OwnRun]:
    """Simulate every axis with an operator, with the models that the scanner file allows; without refinement.

    Raises
    ------
    Rejected
        If the scan cannot be built with the operator.
    Unphysical
        If a departure makes a branch run backwards.
    """
    scan = setup.scan
    plain = msgspec.structs.replace(
        setup,
        scan=msgspec.structs.replace(
            scan, **{name: msgspec.structs.replace(getattr(scan, name), refinement=None) for name in ("x", "y")}
        ),
    )
    tell("finding the waveform on the operator")
    plan = make_plan(plain, sines=True)
    if plan.schedule.pixel_table is not None:
        tell("the fast axis is a sine; its errors are those of its pixels")
    straight = plain if scan.x.motion == "line" else with_motion(plain, "line")
    runs = [_axis(straight, name, plan, seed, tell) for name in own_axes(setup)]
    return [replace(run, refined=getattr(scan, run.axis).refinement is not None) for run in runs]


def _axis(setup: Setup, name: str, plan: Plan, seed: int, tell: Callable[[str], object]) -> OwnRun:
    """Simulate an axis of a plan; other corrections move the fast axis straight, as ``setup`` says."""
    line: LinePlan = getattr(plan, name)
    pixels = plan.schedule if name == "x" and plan.schedule.pixel_table is not None else None
    table = _table(setup, name)
    assert table is not None
    traces, centre = line.drive.shape.identification.traces, line.drive.driver.share(line.drive.v_offset)
    plants = [piezo for k in range(SEEDS) if (piezo := own_piezo(line, (seed, k))) is not None]
    if not traces or not plants:
        raise Unphysical(f"{name}: the {table.model()} model gives neither traces nor a piezo to play a scan on")
    rows = []
    laws = models.laws_beside(table)
    by_laws = "" if laws is None else laws.model()
    for correction, model in (("uncompensated", models.UNCOMPENSATED), ("laws", by_laws), (table.model(),) * 2):
        tell(f"playing {name}, {correction}, on its own operator")
        if not model:
            why = "the scanner file has no branches for this axis, which the laws need"
            rows.append(OwnRow(correction, "", rejected=why))
            continue
        try:
            own = model == table.model()
            played = line if own else getattr(make_plan(with_model(setup, model)), name)
        except Rejected as faults:
            rows.append(OwnRow(correction, model, rejected="; ".join(map(str, faults.problems))))
            continue
        runs = _on_each(played, plants, pixels if own else None)
        rows.append(OwnRow(correction, model, tuple(map(image_errors, runs)), example=runs[0]))
    nearest = min(abs(one.centre - centre) for one in traces)
    return OwnRun(name, line.drive.size_nm, traces, nearest, False, tuple(rows))


def own_piezo(line: LinePlan, seed: tuple[int, ...] | None = None) -> SettledAxis | None:
    """Return the piezo by which a line was made, or none; with a ``seed``, one that departs from it."""
    drive = line.drive
    return drive.shape.identification.piezo(drive.driver, drive.response, seed)


def errors_on(line: LinePlan, plants: Sequence[SettledAxis]) -> tuple[tuple[float, ...], ...]:
    """Return the errors of a line that is played on several scanners: a row each, of ``MEASURES``.

    Raises
    ------
    Unphysical
        If a departure makes a branch run backwards.
    """
    return tuple(map(image_errors, _on_each(line, plants, None)))


def _on_each(line: LinePlan, plants: Sequence[SettledAxis], pixels: Schedule | None) -> list[AxisRun]:
    try:
        return run_on_each(line, plants, _MOST_TICKS, pixels)
    except Unphysical as reason:
        raise Unphysical(f"{line.axis}: with a random departure of its own uncertainty, {reason}") from None


def image_errors(run: AxisRun) -> tuple[float, float, float, float]:
    """Return rms and scaling error of the worse direction, mismatch (NaN of one direction), size error, in percent."""
    branches = [getattr(run.imaged, side) for side in run.directions]
    low, high = branches[0].window
    inside = (branches[0].position >= low) & (branches[0].position <= high)
    residuals = [branch.residual[inside] for branch in branches]
    rms = max(float(np.sqrt(np.mean(one * one))) for one in residuals)
    mismatch = float(np.max(np.abs(residuals[0] - residuals[1]))) if len(residuals) > 1 else float("nan")
    return rms, max(branch.scaling_peak_to_peak for branch in branches), mismatch, run.size_error_percent


def _table(setup: Setup, name: str) -> Hysteresis | None:
    axis: ScannerAxis = getattr(setup.scanner, name)
    return axis.hysteresis
