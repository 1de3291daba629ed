"""A scan at an angle on scanners: the integers of a whole frame of both axes, and the same frame without correction."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import msgspec
import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.certificate.turned_errors import ImagedFrame, errors_of, frame_codes
from tablegen.compensation.identification import SettledAxis
from tablegen.compensation.models import IDENTIFIED
from tablegen.compensation.operator.frame_layer import FrameLayer
from tablegen.compensation.operator.in_time import OperatorInTime
from tablegen.compensation.operator.piezo import departing
from tablegen.config.load import Setup
from tablegen.config.scanner import Coupling
from tablegen.numerics.arrays import Floats
from tablegen.numerics.driver import Driver
from tablegen.planning.laws import size_law_of
from tablegen.planning.turned_plan import FrameGeometry, TurnedAxis, TurnedPlan
from tablegen.virtual.played import MAX_TICKS

SEEDS = 10
OWN_SAMPLES = 256  # of a line on an operator, whose position is linear between them
MEASURES = ("rms", "worst_line", "mismatch", "scaling", "fast_size", "slow_size", "shear", "rotation_deg")
UNCOMPENSATED, BUILT = "uncompensated", IDENTIFIED


@dataclass(frozen=True, eq=False)
class TurnedPlant:
    """A scanner and its sample: both axes, which couple, and a drift in nm/s along x and y."""

    x: SettledAxis
    y: SettledAxis
    coupling: Coupling
    drift_nm_per_s: tuple[float, float]

    def geometry(self, plan: TurnedPlan) -> FrameGeometry:
        """Return the geometry of a plan with the coupling and the drift of this scanner."""
        return msgspec.structs.replace(
            plan.geometry,
            x_per_y=self.coupling.x_per_y,
            y_per_x=self.coupling.y_per_x,
            drift_nm_per_s=self.drift_nm_per_s,
        )


@dataclass(frozen=True, eq=False)
class FrameVolts:
    """Volts of both axes over a frame, shape (lines, samples) each, at the phases ``t`` of a line."""

    x: Floats
    y: Floats
    t: Floats


@dataclass(frozen=True, eq=False)
class FrameRun:
    """A frame on a scanner: volts, positions of the axes in nm without their coupling, and the errors in the image."""

    volts: FrameVolts
    x_nm: Floats
    y_nm: Floats
    imaged: ImagedFrame
    errors: tuple[float, ...]


@dataclass(frozen=True)
class FrameRow:
    """One correction: ``errors`` has a row per scanner and a column per measure; ``rejected`` why it has none.

    ``example`` is the run on the first scanner.
    """

    correction: str
    errors: tuple[tuple[float, ...], ...] = ()
    rejected: str = ""
    example: FrameRun | None = field(default=None, compare=False, repr=False)

    def summary(self) -> dict[str, tuple[float, float]]:
        """Return the mean and the worst of each measure, the worst with its sign."""
        out = {}
        for name, column in zip(MEASURES, np.array(self.errors).T, strict=True):
            out[name] = float(np.mean(column)), float(column[np.argmax(np.abs(column))])
        return out


@dataclass(frozen=True, eq=False)
class OwnFrameAxis:
    """The operator of an axis as a piezo, linear between the middles of ticks, and what was learnt of its frame."""

    piezo: OperatorInTime
    driver: Driver
    layer: FrameLayer | None = None
    lines: int = 1

    def settled(self, volts: Floats, tick_s: float) -> Floats:
        """Return the displacement in nm in the middle of each tick of a drive that repeats, shape (ticks,)."""
        time_s = np.asarray(np.arange(len(volts) + 1) * tick_s, dtype=np.float64)
        u: Floats = self.driver.share(np.asarray(volts, dtype=np.float64))
        position = self.piezo.position(time_s, np.append(u, u[0]))[:-1]
        if self.layer is None:
            return position
        count = len(volts) // self.lines
        return np.asarray(position + self.layer.at(self.lines, (np.arange(count) + 0.5) / count).ravel())


def emitted_volts(plan: TurnedPlan, most_samples: int = MAX_TICKS) -> FrameVolts:
    """Return the volts of the emitted integers of a frame, without shaping.

    Parameters
    ----------
    most_samples
        Most samples of a frame. Where it has more ticks, the codes are taken at fewer places of each line.
    """
    count, at = _samples(plan, most_samples)
    before = np.floor(at).astype(np.int64)
    after = np.minimum(before + 1, plan.schedule.ticks - 1)
    volts = []
    for axis in plan.axes:
        codes = frame_codes(axis, before).astype(np.float64)
        if count < plan.schedule.ticks:
            codes += (at - before) * (frame_codes(axis, after) - codes)
        volts.append(axis.converter.v_zero + axis.converter.v_per_code * codes)
    return FrameVolts(volts[0], volts[1], (np.arange(count) + 0.5) / count)


def uncompensated_volts(setup: Setup, plan: TurnedPlan, most_samples: int = MAX_TICKS) -> FrameVolts:
    """Return straight lines, with the size law of the scanner file at the longer motion of each axis.

    Raises
    ------
    Unphysical
        If they leave the driver's range.
    """
    count, _ = _samples(plan, most_samples)
    t = (np.arange(count) + 0.5) / count
    x, y = (_straight(setup, axis, t) for axis in plan.axes)
    return FrameVolts(x, y, t)


def _samples(plan: TurnedPlan, most_samples: int) -> tuple[int, Floats]:
    """Return how many samples a line has, and at which ticks they are: each the middle of those that it stands for."""
    ticks = plan.schedule.ticks
    count = min(ticks, max(most_samples // plan.schedule.lines, 1))
    return count, (np.arange(count) + 0.5) * ticks / count - 0.5


def _straight(setup: Setup, axis: TurnedAxis, t: Floats) -> Floats:
    motion, driver = axis.motion, axis.known.driver
    law = size_law_of((setup.scanner.x if axis.axis == "x" else setup.scanner.y).size, driver)
    try:
        per_nm = law.voltage(motion.longest_nm) / motion.longest_nm  # of the driver's span
    except Unphysical as reason:
        raise Unphysical(f"{axis.axis}: {reason}") from None
    phase = (np.arange(motion.lines)[:, None] + t) / motion.lines
    moved = motion.fast_nm * (motion.fast(t) - 0.5) + motion.slow_nm * (motion.slow(phase) - 0.5)
    volts = np.asarray(driver.volts(motion.centre) + driver.span * per_nm * moved)
    low, high = float(np.min(volts)), float(np.max(volts))
    if driver.beyond(low, high) > 0.0:
        raise Unphysical(f"{axis.axis}: straight lines take {low:.4g}..{high:.4g} V, outside the driver's {driver}")
    return volts


def play_frame(plan: TurnedPlan, volts: FrameVolts, plant: TurnedPlant) -> FrameRun:
    """Play a frame on a scanner until it has settled.

    Raises
    ------
    ValueError
        If the frame leaves the range of the scanner.
    """
    tick_s = 1.0 / (plan.x.motion.line_rate_hz * len(volts.t))
    x_nm, y_nm = (
        axis.settled(its.ravel(), tick_s).reshape(its.shape) for axis, its in ((plant.x, volts.x), (plant.y, volts.y))
    )
    imaged = ImagedFrame.of(plan, x_nm, y_nm, volts.t, plant.geometry(plan))
    errors = errors_of(plan, imaged)
    return FrameRun(volts, x_nm, y_nm, imaged, tuple(errors[name] for name in MEASURES))


def frame_rows(
    setup: Setup,
    plan: TurnedPlan,
    plants: Sequence[TurnedPlant],
    most_samples: int = MAX_TICKS,
    tell: Callable[[str], object] = lambda _: None,
) -> tuple[FrameRow, ...]:
    """Play straight lines and the emitted integers of a scan on the same scanners: a row each."""
    rows = []
    for name in (UNCOMPENSATED, BUILT):
        tell(f"playing the frame, {name}")
        try:
            if name == BUILT:
                volts = emitted_volts(plan, most_samples)
            else:
                volts = uncompensated_volts(setup, plan, most_samples)
            runs = [play_frame(plan, volts, plant) for plant in plants]
        except (Unphysical, ValueError) as reason:
            rows.append(FrameRow(name, rejected=str(reason)))
            continue
        rows.append(FrameRow(name, tuple(run.errors for run in runs), example=runs[0]))
    return tuple(rows)


def own_plants(setup: Setup, plan: TurnedPlan, seed: int) -> list[TurnedPlant]:
    """Return scanners that depart from the operators of both axes at random, by their uncertainty."""
    coupling, drift = setup.scanner.coupling, setup.scan.drift_nm_per_s
    return [
        TurnedPlant(_departing(plan.x, (seed, k, 0)), _departing(plan.y, (seed, k, 1)), coupling, drift)
        for k in range(SEEDS)
    ]


def own_samples(plan: TurnedPlan) -> int:
    """Return the most samples of a frame on an operator."""
    return OWN_SAMPLES * plan.schedule.lines


def _departing(axis: TurnedAxis, seed: tuple[int, ...]) -> OwnFrameAxis:
    piezo = replace(axis.piezo, operator=departing(axis.piezo.operator, seed))
    return OwnFrameAxis(piezo, axis.known.driver, axis.motion.layer, axis.motion.lines)
