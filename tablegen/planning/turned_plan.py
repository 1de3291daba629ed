"""Plan a scan at an angle: each axis follows a share of the line's motion and one of the frame's."""

import dataclasses
from collections.abc import Callable
from functools import cache
from math import ceil, floor
from typing import Literal

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from tablegen.base.figures import at_most
from tablegen.base.input_errors import Problems, Rejected, Unphysical
from tablegen.compensation.dynamics import capped_inverse
from tablegen.compensation.frequency import frequency_gain
from tablegen.compensation.hold import hold_inverse
from tablegen.compensation.operator.in_time import OperatorInTime
from tablegen.compensation.operator.operator import STROKE_REACH
from tablegen.compensation.operator.turned_frame import BeyondDriver, FrameDrive, FrameMotion, learn_frame
from tablegen.config.load import Setup
from tablegen.config.scanner import Coupling, ScannerAxis
from tablegen.config.schema import Cost, Limits, ProcessorName, Table, TiltName
from tablegen.device.beside import program_beside
from tablegen.device.dual_program import ScanProgram
from tablegen.device.schedule import Schedule
from tablegen.fixedpoint.converter import Converter, make_output
from tablegen.fixedpoint.frame_program import FrameProgram, played_extremes
from tablegen.fixedpoint.frame_words import FrameParts, FrameShape, quantise_frame
from tablegen.numerics.arrays import Floats, Ints
from tablegen.numerics.turns import sine_and_cosine_of
from tablegen.planning.cost_choice import remedy_for_runs
from tablegen.planning.frame_costs import frame_costs
from tablegen.planning.frame_motion import frame_motion
from tablegen.planning.frame_refinement import learnt_frame_layer
from tablegen.planning.frame_tables import (
    CostLimit,
    FrameTableChoice,
    FrameTableSearch,
    choose_frame_tables,
    is_chosen,
)
from tablegen.planning.known_axis import KnownAxis
from tablegen.planning.line_plan import LinePlan, Plan, SampleCost, make_plan, mixing_key
from tablegen.planning.played_table import PlayedTable, played_frame_table
from tablegen.planning.tilt import TiltedOutput, plan_tilt
from tablegen.waveform.series import FourierSeries

KNOTS = 16  # intervals of gain and ratio over a frame
_SAMPLES = 256  # of a line, at which the stroke of a drive is taken
_FIRST_GUESS = 0.85  # of the room by the first guess of a drive that cannot be learnt: it overshoots less in the turns


class TurnedAxis(Struct, frozen=True, eq=False):
    """One axis of a scan at an angle.

    ``motion`` has its shares of both motions. ``piezo`` is the axis in time, ``drive`` what was learnt on it, of v_max,
    without the lead over the hold of the converter that ``program`` has. ``choice`` says by what the build chose the
    tables, if the scan file asks for that. ``sample_cost`` is there if the scan file names a processor.
    """

    axis: Literal["x", "y"]
    converter: Converter
    motion: FrameMotion
    piezo: OperatorInTime
    known: KnownAxis
    drive: FrameDrive
    program: FrameProgram
    choice: str = ""
    sample_cost: SampleCost | None = None

    def share(self, codes: Ints) -> Floats:
        """Return codes as shares of v_max, of their shape."""
        volts = self.converter.v_zero + self.converter.v_per_code * codes
        share: Floats = self.known.driver.share(np.asarray(volts, dtype=np.float64))
        return share


class FrameGeometry(Struct, frozen=True):
    """The linear map from the motions of the line and of the frame to both axes.

    ``size_nm`` are those of the line and of the frame, from x = 0 to 1 of each. ``x_per_y`` and ``y_per_x`` are the
    coupling of the axes; ``drift_nm_per_s`` is that of the sample along x and y, of which the frame follows
    ``rise_s`` while it goes up once.
    """

    angle_deg: float
    size_nm: tuple[float, float]
    x_per_y: float
    y_per_x: float
    drift_nm_per_s: tuple[float, float]
    rise_s: float

    @classmethod
    def of(cls, setup: Setup, schedule: Schedule, size_nm: tuple[float, float]) -> "FrameGeometry":
        """Return the geometry of a scan with a schedule, and the sizes of its line and its frame at 0 degrees."""
        coupling, (along_x, along_y) = setup.scanner.coupling, setup.scan.drift_nm_per_s
        rise_s = setup.scan.y.turn / float(schedule.frame_rate)
        return cls(setup.scan.angle_deg, size_nm, coupling.x_per_y, coupling.y_per_x, (along_x, along_y), rise_s)

    @property
    def shares(self) -> dict[str, tuple[float, float]]:
        """The nm of the line and of the frame that each axis moves: the wanted ones through the inverse coupling."""
        sine, cosine = sine_and_cosine_of(self.angle_deg / 360.0)
        (fast_nm, slow_nm), (drift_x, drift_y) = self.size_nm, self.drift_nm_per_s
        fast = cosine * fast_nm, sine * fast_nm
        slow = drift_x * self.rise_s - sine * slow_nm, drift_y * self.rise_s + cosine * slow_nm
        whole = 1.0 - self.x_per_y * self.y_per_x  # above 0: neither is above 1/2
        x = tuple((u - self.x_per_y * v) / whole for u, v in (fast, slow))
        y = tuple((v - self.y_per_x * u) / whole for u, v in (fast, slow))
        return {"x": (x[0], x[1]), "y": (y[0], y[1])}

    def on_a_plane(self, slope_x: float, slope_y: float) -> tuple[float, float]:
        """Return the nm of the line and of the frame that an output with these slopes moves.

        It follows the wanted position on the sample: coupling moves the axes alone, and drift the sample with its tilt.

        Parameters
        ----------
        slope_x, slope_y
            nm of the output for each nm along x and along y.
        """
        sine, cosine = sine_and_cosine_of(self.angle_deg / 360.0)
        fast_nm, slow_nm = self.size_nm
        return (slope_x * cosine + slope_y * sine) * fast_nm, (slope_y * cosine - slope_x * sine) * slow_nm

    def on_the_sample(self, x_nm: Floats, y_nm: Floats, time_s: Floats) -> tuple[Floats, Floats]:
        """Return where positions of the axes are along the lines and across them, on a sample that drifts.

        Parameters
        ----------
        x_nm, y_nm
            Positions of the axes, of one shape.
        time_s
            Times from the start of the frame, of a shape that broadcasts.
        """
        drift_x, drift_y = self.drift_nm_per_s
        x = x_nm + self.x_per_y * y_nm - drift_x * time_s
        y = y_nm + self.y_per_x * x_nm - drift_y * time_s
        sine, cosine = sine_and_cosine_of(self.angle_deg / 360.0)
        return cosine * x + sine * y, cosine * y - sine * x


class TurnedPlan(Struct, frozen=True, eq=False):
    """A scan at an angle: both axes and their schedule. ``straight`` is the same scan at 0 degrees.

    ``z`` and ``aux`` are outputs beside both axes, where the scan has them.
    """

    name: str
    scanner: str
    geometry: FrameGeometry
    schedule: Schedule
    x: TurnedAxis
    y: TurnedAxis
    limits: Limits
    straight: Plan
    z: TiltedOutput | None = None
    aux: TiltedOutput | None = None

    @property
    def axes(self) -> tuple[TurnedAxis, TurnedAxis]:
        """Both axes, x first."""
        return self.x, self.y

    @property
    def program(self) -> ScanProgram:
        """The content of a bank of the device: the programs of both axes and their schedule."""
        return ScanProgram(self.x.program, self.y.program, self.schedule)

    @property
    def tilts(self) -> tuple[TiltedOutput, ...]:
        """The outputs beside both axes: z, then aux."""
        return tuple(each for each in (self.z, self.aux) if each is not None)

    @property
    def program_of_z(self) -> ScanProgram | None:
        """What a second sequencer plays, whose x is z, and whose y aux; None without z."""
        return program_beside(self.schedule, *(each.program for each in self.tilts)) if self.tilts else None


def make_turned_plan(setup: Setup, progress: Callable[[str], object] = lambda _: None) -> TurnedPlan:
    """Plan a scan at an angle.

    Parameters
    ----------
    progress
        Called with each stage, in words.

    Raises
    ------
    Rejected
        With every contradiction between the scan, the scanner and the hardware.
    """
    scan = setup.scan
    problems = Problems()
    if scan.y.motion != "ramp":
        problems.add(setup.scan_file, "y.motion", "a scan at an angle moves y on every tick; leave this out")
    if scan.x.motion == "auto" and mixing_key(setup)[1] == "z":
        why = "a line with z is planned as one at an angle, and a sine is not, so no build compares them; take one"
        problems.add(setup.scan_file, "x.motion", why)
    for axis in ("x", "y"):
        if getattr(scan, axis).refinement is not None:
            problems.add(setup.scan_file, f"{axis}.refinement", "was learnt at 0 degrees, and does not serve an angle")
    known = {}
    for axis in ("x", "y"):
        try:
            known[axis] = KnownAxis.of(setup.scanner, setup.scanner_file, setup.scanner_folder, axis)
        except Rejected as rejected:
            problems.entries.extend(rejected.problems)
    problems.stop_if_any()
    progress("planning the scan at 0 degrees")
    straight = make_plan(at_0_degrees(setup))
    schedule = straight.schedule
    geometry = FrameGeometry.of(setup, schedule, (straight.x.drive.size_nm, straight.y.drive.size_nm))
    if any(geometry.drift_nm_per_s) and schedule.down.count:
        problems.add(
            setup.scan_file, "drift_nm_per_s", "is followed in frames that go up alone; take timing.frame = 'flyback'"
        )
    shares = geometry.shares
    tilts = plan_tilts(setup, schedule, straight.x.series.harmonics, geometry, problems)
    problems.stop_if_any()
    axes = {}
    for line in straight.lines:
        progress(f"learning a frame of {schedule.lines} lines on the operator of {line.axis}")
        centre = line.drive.driver.share(line.drive.v_offset)
        motion = frame_motion(setup, schedule, straight.x.series.harmonics, centre, *shares[line.axis])
        motion = dataclasses.replace(motion, layer=learnt_frame_layer(setup, line, motion, problems))
        problems.stop_if_any()
        axes[line.axis] = _axis(setup, straight, line, known[line.axis], motion, problems)
    problems.stop_if_any()
    x, y = axes["x"], axes["y"]
    assert x is not None
    assert y is not None
    if scan.cost is not None:
        x, y = _within_cost(setup, straight, scan.cost, x, y, problems)
    return TurnedPlan(scan.name, setup.scanner.name, geometry, schedule, x, y, scan.limits, straight, **tilts)


def _within_cost(
    setup: Setup, straight: Plan, cost: Cost, x: TurnedAxis, y: TurnedAxis, problems: Problems
) -> tuple[TurnedAxis, TurnedAxis]:
    """Count what a sample of both axes takes; chosen tables that take too much beside the others are chosen again.

    Raises
    ------
    Rejected
        If no tables of this axis keep the limit beside those.
    """
    axes = {"x": x, "y": y}
    for line in straight.lines:
        axis = axes[line.axis]
        beside = played_frame(setup, straight, axes["y" if line.axis == "x" else "x"])
        takes = frame_costs([played_frame(setup, straight, axis), beside], cost.processor)[0]
        if axis.choice and cost.max_instructions is not None and takes > cost.max_instructions:
            axes[line.axis] = _chosen_beside(setup, straight, line, axis, beside, problems)
    played = {name: played_frame(setup, straight, axis) for name, axis in axes.items()}
    counts, remedy = frame_costs([*played.values()], cost.processor), remedy_for_runs(setup, played)
    x, y = (
        replace(axis, sample_cost=SampleCost(cost.processor, takes, cost.max_instructions, remedy))
        for axis, takes in zip(axes.values(), counts, strict=True)
    )
    return x, y


def _chosen_beside(
    setup: Setup, straight: Plan, line: LinePlan, axis: TurnedAxis, beside: PlayedTable, problems: Problems
) -> TurnedAxis:
    """Return an axis with tables that are chosen beside the other axis; raise ``Rejected`` where none keep a limit."""
    choice = _chosen_tables(setup, straight, line, axis.known, axis.drive, problems, beside)
    problems.stop_if_any()
    assert choice is not None
    program = _quantised(setup, straight, line, axis.known, axis.drive, choice.shape)
    program = within_range(setup, straight, line, program, problems)
    problems.stop_if_any()
    return replace(axis, program=program, choice=choice.reason)


def played_frame(setup: Setup, straight: Plan, axis: TurnedAxis) -> PlayedTable:
    """Return what decides the cost of a planned axis; ``straight`` is the plan of the scan at 0 degrees."""
    line = straight.x if axis.axis == "x" else straight.y
    steepest = _search(setup, straight, line, axis.known, axis.drive).steepest
    return played_frame_table(axis.program, axis.program.output.max_step, steepest)


def shape_costs(
    setup: Setup,
    line: LinePlan,
    search: FrameTableSearch,
    shapes: list[FrameShape],
    processor: ProcessorName,
    beside: PlayedTable | None,
) -> dict[FrameShape, float]:
    """Return the instructions for a sample of an axis with tables of each shape that holds its drive.

    ``beside`` is the other axis, which may have wider words of its converter, or no runs. With None it takes nothing.
    """
    programs = {shape: program for shape in shapes if (program := search.program(shape)) is not None}
    guard, last = allowed_step(setup, line.axis, line.converter), (1 << line.program.output.dac_bits) - 1
    others = [] if beside is None else [beside]
    max_step = min(2 * ceil(search.steepest), last) if guard is None else guard
    return {
        shape: frame_costs([played_frame_table(program, max_step, search.steepest), *others], processor)[0]
        for shape, program in programs.items()
    }


def plan_tilts(
    setup: Setup, schedule: Schedule, harmonics: int, geometry: FrameGeometry, problems: Problems
) -> dict[TiltName, TiltedOutput]:
    """Plan the outputs beside x and y of a scan whose line has so many harmonics; fewer where ``problems`` grew."""
    planned = {}
    for name, tilt in setup.scan.tilts.items():
        with problems.at(setup.scan_file, name):
            shares = geometry.on_a_plane(tilt.slope_x, tilt.slope_y)
            planned[name] = plan_tilt(setup, name, schedule, harmonics, shares, problems)
    return {name: output for name, output in planned.items() if output is not None}


def at_0_degrees(setup: Setup) -> Setup:
    """Return the setup without angle, coupling, drift, z, aux, and the clock, of which a slow part takes others.

    Tables that a build chooses are not looked for, and nothing is counted: none of them plays.
    """
    tables = (axis.table for axis in (setup.scan.x, setup.scan.y))
    x_table, y_table = (Table() if table.chosen_by_build else table for table in tables)
    scan = replace(
        setup.scan,
        angle_deg=0.0,
        drift_nm_per_s=(0.0, 0.0),
        z=None,
        aux=None,
        cost=None,
        emit=replace(setup.scan.emit, clock_hz=None),
        x=replace(setup.scan.x, frame_refinement=None, table=x_table),
        y=replace(setup.scan.y, frame_refinement=None, table=y_table),
    )
    return replace(setup, scan=scan, scanner=replace(setup.scanner, coupling=Coupling()))


def _axis(
    setup: Setup, plan: Plan, line: LinePlan, known: KnownAxis, motion: FrameMotion, problems: Problems
) -> TurnedAxis | None:
    axis, rate_hz = line.axis, motion.line_rate_hz
    scanner = setup.scanner.x if axis == "x" else setup.scanner.y
    piezo = piezo_in_time(known, scanner, rate_hz, float(plan.schedule.frame_rate))
    n = np.arange(1.0, motion.harmonics + 1.0)
    response, boost_db = line.drive.response, line.drive.max_boost_db

    @cache
    def factors() -> tuple[Floats, Floats]:
        assert response is not None
        real, imaginary, _ = capped_inverse(response, n * rate_hz, boost_db)
        return real, imaginary

    def inverse(series: FourierSeries) -> FourierSeries:
        return series if response is None else series.times(*factors())

    with problems.at(*mixing_key(setup)):
        try:
            drive = learn_frame(piezo, motion, inverse, KNOTS)
        except BeyondDriver as beyond:
            centre = motion.centre
            room = min(centre / max(centre - beyond.least, 1e-9), (1.0 - centre) / max(beyond.most - centre, 1e-9))
            raise Unphysical(_what_fits(plan, setup.scan.angle_deg, line, _FIRST_GUESS * room)) from None
        check_reach(known, drive, plan.schedule.lines)
        choice = _chosen_tables(setup, plan, line, known, drive, problems)
        shape = None if choice is None else choice.shape
        program = within_range(setup, plan, line, _quantised(setup, plan, line, known, drive, shape), problems)
        reason = "" if choice is None else choice.reason
        return TurnedAxis(axis, line.converter, motion, piezo, known, drive, program, reason)
    return None


def frame_table_search(setup: Setup, plan: TurnedPlan, axis: TurnedAxis) -> FrameTableSearch:
    """Return the tables that an axis of a plan could have."""
    line = plan.straight.x if axis.axis == "x" else plan.straight.y
    return _search(setup, plan.straight, line, axis.known, axis.drive)


def _search(setup: Setup, plan: Plan, line: LinePlan, known: KnownAxis, drive: FrameDrive) -> FrameTableSearch:
    schedule = plan.schedule

    def quantise(shape: FrameShape) -> FrameProgram:
        return _quantised(setup, plan, line, known, drive, shape)

    return FrameTableSearch(drive, line.converter, known.driver, schedule.ticks, schedule.lines, quantise)


def _chosen_tables(
    setup: Setup,
    plan: Plan,
    line: LinePlan,
    known: KnownAxis,
    drive: FrameDrive,
    problems: Problems,
    beside: PlayedTable | None = None,
) -> FrameTableChoice | None:
    """Return the tables that the scan file lets the build choose; None if it does not, or ``problems`` grew."""
    table = setup.scan.x.table if line.axis == "x" else setup.scan.y.table
    if not is_chosen(table, line.program.output.shaping.order > 0):
        return None
    key = f"{line.axis}.table.{'mode' if table.max_error_lsb is None else 'max_error_lsb'}"
    search, cost, limit = _search(setup, plan, line, known, drive), setup.scan.cost, None
    if cost is not None and cost.max_instructions is not None:
        costs = shape_costs(setup, line, search, search.shapes(table), cost.processor, beside)
        limit = CostLimit(cost.processor, cost.max_instructions, costs)
    with problems.at(setup.scan_file, key):
        return choose_frame_tables(search, table, setup.scan.limits, limit)
    return None


def piezo_in_time(known: KnownAxis, scanner: ScannerAxis, line_hz: float, frame_hz: float) -> OperatorInTime:
    """Return an axis of a scanner file in time, at the rates of the lines and of the frames."""
    operator = known.at_rates(line_hz, frame_hz)
    rate = 1.0
    if scanner.frequency is not None and not operator.knows_rates:  # (23), as for a line
        law = scanner.frequency
        rate = frequency_gain(line_hz, law.alpha, law.reference_hz)
        rate /= frequency_gain(operator.creep.reference_hz, law.alpha, law.reference_hz)
    return OperatorInTime(operator, lambda mean: rate * known.factor(mean), known.response)


def check_reach(known: KnownAxis, drive: FrameDrive, lines: int) -> None:
    """Check that the operator was identified for strokes of this length."""
    u = drive.on_grid(lines, _SAMPLES)
    stroke, most = float(np.ptp(u)), max(line.stroke for line in known.operator.lines)
    if stroke > most + STROKE_REACH:
        span = known.driver.span
        raise Unphysical(
            f"the frame takes {stroke * span:.4g} V, and the largest trace of the operator has {most * span:.4g} V; a "
            "smaller scan or a larger trace would do"
        )


def _quantised(
    setup: Setup, plan: Plan, line: LinePlan, known: KnownAxis, drive: FrameDrive, shape: FrameShape | None = None
) -> FrameProgram:
    """Return the integers of a drive in tables of a shape, or those by default, without a slew guard."""
    schedule, converter = plan.schedule, line.converter
    dac = setup.hardware(line.axis).dac
    hold = hold_inverse(drive.fast.harmonics, schedule.ticks, steps=False)
    park_v = line.drive.v_offset if (its := getattr(setup.scan, line.axis).park_v) is None else its
    return quantise_frame(
        FrameParts(
            fast=drive.fast.times(*hold),
            second=drive.second.times(*hold),
            slow=FourierSeries(0.0, drive.slow.a, drive.slow.b),
            gains=drive.gains,
            ratios=drive.ratios,
            spacing=drive.spacing,
            codes=known.driver.span / converter.v_per_code,
            offset=converter.code(known.driver.volts(drive.slow.a0)),
        ),
        make_output(dac, converter, known.driver, park_v, line.program.output.shaping),
        schedule.ticks,
        schedule.lines,
        shape,
    )


def within_range(setup: Setup, plan: Plan, line: LinePlan, program: FrameProgram, problems: Problems) -> FrameProgram:
    """Return the program with its slew guard; what leaves the range or the slew rate goes to ``problems``."""
    output = program.output
    least, most, steepest = played_extremes(program)
    centre = output.offset_code
    if least < output.code_min or most > output.code_max:
        room = min(
            (centre - output.code_min) / max(centre - least, 1), (output.code_max - centre) / max(most - centre, 1)
        )
        problems.add(*mixing_key(setup), _what_fits(plan, setup.scan.angle_deg, line, room))
    allowed = allowed_step(setup, line.axis, line.converter)
    if allowed is None:
        return program.guarded(min(2 * steepest, (1 << output.dac_bits) - 1))
    if steepest > allowed:
        slew = setup.hardware(line.axis).amplifier.max_slew_v_per_s
        slower = at_most(float(plan.schedule.line_rate) * max(allowed - 1.0, 0.5) / steepest)  # a code for the rounding
        problems.add(
            setup.scan_file,
            "timing.line_rate_hz",
            f"at {setup.scan.angle_deg:g} degrees {line.axis} steps by up to {steepest} codes a tick, {slew:.6g} V/s "
            f"allow {allowed}; about {slower} Hz would fit",
        )
    return program.guarded(allowed)


def allowed_step(setup: Setup, axis: str, converter: Converter) -> int | None:
    """Return the codes that the amplifier of an axis allows in a tick; None if the scan file does not say."""
    hardware = setup.hardware(axis)
    if hardware.amplifier.max_slew_v_per_s is None:
        return None
    per_tick = hardware.amplifier.max_slew_v_per_s / hardware.dac.update_rate_hz / abs(converter.v_per_code)
    return min(floor(per_tick), (1 << converter.bits) - 1)


def _what_fits(plan: Plan, angle_deg: float, line: LinePlan, room: float) -> str:
    """Return what fits the range: the share of the size at this angle, and the nearest angle for the whole size."""
    sizes = plan.x.drive.size_nm, plan.y.drive.size_nm

    def reach(degrees: float) -> float:
        sine, cosine = (abs(one) for one in sine_and_cosine_of(degrees / 360.0))
        shares = (cosine, sine) if line.axis == "x" else (sine, cosine)
        return shares[0] * sizes[0] + shares[1] * sizes[1]

    most = reach(angle_deg) * room
    steps = np.arange(0.0, 180.5, 0.5)
    near = [a for step in steps.tolist() for a in (angle_deg - step, angle_deg + step) if reach(a) <= most]
    turned = f", or an angle of about {near[0]:.3g} degrees" if near else ""
    size = at_most(room * max(sizes))
    return f"{line.axis} leaves the range of the driver or the converter; a scan of about {size} nm would fit{turned}"
