"""Build the plan: quantise a validated configuration into the immutable integers that everything downstream reads."""

from fractions import Fraction
from math import hypot, inf
from typing import TYPE_CHECKING, Literal

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from tablegen.base.input_errors import Document, Problems, Rejected
from tablegen.compensation.line import SineLine
from tablegen.config.load import Setup
from tablegen.config.schema import DEFAULT_FORMATS, BandLimit, Limits, ProcessorName
from tablegen.device.dual_program import DualProgram
from tablegen.device.schedule import Schedule
from tablegen.fixedpoint.converter import Converter
from tablegen.fixedpoint.program import Program
from tablegen.fixedpoint.synthesis import FourierWords
from tablegen.numerics.arrays import Floats, Ints
from tablegen.planning.axis_request import AxisRequest
from tablegen.planning.axis_table import make_table
from tablegen.planning.clock import clocks_per_tick
from tablegen.planning.drive import Drive, make_drive
from tablegen.planning.feasibility import DEFAULT_HARMONICS
from tablegen.planning.pixel_errors import PixelErrors, pixel_errors
from tablegen.planning.pixel_table import passages, with_pixel_table
from tablegen.planning.settling import settle_lines
from tablegen.planning.sine_setup import SINE, default_formats, sine_setup, with_motion
from tablegen.planning.table_choice import TableRequest
from tablegen.planning.table_maker import steepest_step
from tablegen.planning.timing import make_schedule
from tablegen.planning.voltages import axis_voltages
from tablegen.planning.waveforms import make_waveforms
from tablegen.waveform.series import FourierSeries

if TYPE_CHECKING:
    from tablegen.device.dual_program import ScanProgram
    from tablegen.planning.played_table import PlayedTable
    from tablegen.planning.tilt import TiltedOutput

MIXED = (
    "a scan at an angle, on coupled axes or with drift is for `check`, `show`, `build` with the formats c and "
    "verilog, `verify`, `tables`, `upload`, `readback`, `live`, `simulate`, `report`, `compare`, `correct` and "
    "`refine`; leave this out for anything else"
)

TILTED = (
    "a scan with the output z whose axes have operators is for `check`, `show`, `build` with the formats c and "
    "verilog, `verify`, `tables`, `simulate`, `report`, `correct` and `refine`; leave [z] out for anything else"
)


class SampleCost(Struct, frozen=True):
    """The instructions for a sample of an axis in C on a processor, and the limit of the scan file.

    ``remedy`` says why the axes have no runs and what gives them some, where one of them moves too far.
    """

    processor: ProcessorName
    instructions: float
    max_instructions: float | None
    remedy: str = ""

    def __str__(self) -> str:
        return f"{self.instructions:g} instructions for a sample on {self.processor}"


class LinePlan(Struct, frozen=True, eq=False):
    """One axis: the request in volts, the waveform, and the integers that play it.

    ``target`` is the band-limited w that the piezo is to follow. ``drive_series`` is the w that has to arrive at the
    piezo for that: each harmonic divided by the dynamics; ``held_harmonics`` are those that the boost limit reduces.
    ``series`` is the w that is played, ahead of that by the half tick of the converter's zero-order hold: the code of
    advance k of N is that of ``series`` at k / N. ``layer`` is the part of the target that was learnt from a
    measurement, added to the model's shape. ``kept_percent`` is the scaling error for which the target has minimum
    acceleration, None where it has another band limit. ``table_request`` is the request for a
    table that the build chose, None where the scan file gives the table. ``sample_cost`` is there if the scan
    file names a processor. ``imaged`` is the part of the line that the
    pixels of a sine are in; the window of its ``band_limit`` is then in shares of the time of a sweep.
    """

    axis: Literal["x", "y"]
    rate: Fraction
    requested_hz: float
    drive: Drive
    converter: Converter
    band_limit: BandLimit
    target: FourierSeries
    drive_series: FourierSeries
    series: FourierSeries
    held_harmonics: tuple[int, ...]
    scale: float
    fourier: FourierWords
    program: Program
    layer: FourierSeries | None = None
    kept_percent: float | None = None
    table_request: TableRequest | None = None
    sample_cost: SampleCost | None = None
    imaged: tuple[float, float] | None = None

    def __repr__(self) -> str:
        table = f"{self.program.mode} table of {len(self.program.words)} x {self.program.bits} bits"
        volts = f"{self.drive.v_amplitude:.6g} V about {self.drive.v_offset:.6g} V"
        if self.drive.resting:
            return f"{self.axis}: rests at {self.drive.v_offset:.6g} V"
        return f"{self.axis}: {volts}, {self.series.harmonics} harmonics, {table}"

    @property
    def described(self) -> FourierSeries:
        """The target without the layer: the part that the scanner's model describes."""
        return self.target if self.layer is None else self.target.less(self.layer)

    def float_codes(self, w: Floats) -> Floats:
        """Return the unrounded codes of values of w: V(t) = V_offset + m g V_scan (w - 1/2).

        Parameters
        ----------
        w
            Normalised waveform, any shape.

        Returns
        -------
        Codes of the shape of ``w``.
        """
        return self.converter.code(self.drive.v_offset) + self.codes_per_unit * (w - 0.5)

    @property
    def codes_per_unit(self) -> float:
        """The distance in codes of w = 1 from w = 0; negative where the amplifier or the codes are inverted."""
        return self.drive.v_amplitude / self.converter.v_per_code

    @property
    def steepest(self) -> float:
        """The largest step of a tick in codes, without rounding; 0 where an advance takes several ticks."""
        return steepest_step(self.codes_per_unit, self.series, self.program.phase.ticks, self.program.hold)

    def codes(self, start: int, stop: int) -> Ints:
        """Return the emitted codes at ticks [start, stop) since the program began.

        Returns
        -------
        Ints
            Shape (stop - start,).
        """
        return self.program.played(start, stop)


class Plan(Struct, frozen=True, eq=False):
    """A whole build: both axes and their common schedule; ``z`` and ``aux`` are the outputs beside them."""

    name: str
    scanner: str
    schedule: Schedule
    x: LinePlan
    y: LinePlan
    limits: Limits
    header_only: bool
    formats: tuple[str, ...] = DEFAULT_FORMATS
    clocks_per_tick: int = 0  # of an FPGA; 0: not known
    z: "TiltedOutput | None" = None
    aux: "TiltedOutput | None" = None

    def __repr__(self) -> str:
        ticks, rate = self.schedule.ticks, float(self.schedule.line_rate)
        head = f"<tablegen plan {self.name!r} on {self.scanner!r}: {rate:.6g} Hz lines of {ticks} ticks"
        return f"{head}, {self.schedule.lines} a frame\n  {self.x!r}\n  {self.y!r}>"

    @property
    def lines(self) -> tuple[LinePlan, LinePlan]:
        """Both axes, fast first."""
        return self.x, self.y

    @property
    def moving(self) -> tuple[LinePlan, ...]:
        """The axes that move; x alone for a line scan."""
        return tuple(line for line in self.lines if not line.drive.resting)

    @property
    def pixel_errors(self) -> PixelErrors | None:
        """The errors of pixels that are taken where the piezo is; None where they have equal lengths."""
        shape, imaged = self.x.drive.shape, self.x.imaged
        if imaged is None or not isinstance(shape, SineLine):
            return None
        return pixel_errors(shape.place, self.schedule, imaged)

    @property
    def program(self) -> DualProgram:
        """The content of a bank of the device: the programs of both axes and their schedule."""
        return DualProgram(self.x.program, self.y.program, self.schedule)

    @property
    def tilts(self) -> "tuple[TiltedOutput, ...]":
        """The outputs beside both axes: z, then aux."""
        return tuple(each for each in (self.z, self.aux) if each is not None)

    @property
    def program_of_z(self) -> "ScanProgram | None":
        """What a second sequencer plays, whose x is z, and whose y aux; None without z."""
        from tablegen.device.beside import program_beside  # here: most scans have no z

        return program_beside(self.schedule, *(each.program for each in self.tilts)) if self.tilts else None


def make_plan(setup: Setup, sines: bool = False) -> Plan:
    """Compensate, shape and quantise a scan.

    Parameters
    ----------
    sines
        True where the fast axis may have another motion than a straight line.

    Raises
    ------
    Rejected
        With every contradiction on both axes.
    """
    if sines and setup.scan.x.motion == "auto":
        return _better_motion(setup)
    problems = Problems()
    if setup.mixes_motions:
        if setup.scan.z is None:
            problems.add(*mixing_key(setup), MIXED)
        else:
            problems.add(setup.scan_file, "z", TILTED)
    for axis in ("x", "y"):
        if getattr(setup.scan, axis).frame_refinement is not None:
            problems.add(
                setup.scan_file, f"{axis}.frame_refinement", "was learnt at an angle, and does not serve 0 degrees"
            )
    if setup.scan.x.motion != "line":
        if not sines:
            problems.add(setup.scan_file, "x.motion", SINE)
            problems.stop_if_any()
        setup = sine_setup(setup, problems)
    schedule = make_schedule(setup, problems)
    if schedule is None:
        line_rate = setup.scan.timing.line_rate_hz
        _examine(setup, "x", line_rate, problems)
        _examine(setup, "y", line_rate / setup.scan.timing.lines, problems)
        problems.stop_if_any()
        raise AssertionError("a schedule fails with a problem")  # pragma: no cover
    x = _line_plan(setup, "x", schedule, problems)
    y = _line_plan(setup, "y", schedule, problems)
    problems.stop_if_any()
    assert x is not None
    assert y is not None
    if setup.scan.cost is not None:
        x, y = _within_cost(setup, x, y, schedule, problems)
    if isinstance(x.drive.shape, SineLine) and x.imaged is not None:
        with problems.at(setup.scan_file, "timing.pixels"):
            schedule = with_pixel_table(schedule, x.drive.shape.place, x.imaged)
        problems.stop_if_any()
    schedule = replace(schedule, settle_lines=settle_lines(setup, {"x": x.drive, "y": y.drive}, schedule, problems))
    clocks = clocks_per_tick(setup, schedule, (x.program, y.program), problems)
    problems.stop_if_any()
    scan = setup.scan
    plan = Plan(
        scan.name,
        setup.scanner.name,
        schedule,
        x,
        y,
        scan.limits,
        scan.emit.header_only,
        default_formats(scan),
        clocks,
    )
    if scan.tilts:
        from tablegen.planning.straight_tilt import plan_straight_tilts  # here: most scans have no z

        sizes_nm = x.drive.size_nm, y.drive.size_nm
        place = x.drive.shape.place if isinstance(x.drive.shape, SineLine) else None
        plan = replace(plan, **plan_straight_tilts(setup, schedule, sizes_nm, x.series.harmonics, place))
    return plan


def make_straight_plan(setup: Setup, why: str) -> Plan:
    """Plan a scan whose fast axis has to be straight in time, also where "auto" makes it so; a sine is refused.

    Parameters
    ----------
    why
        Why a sine will not do, and what to use in its place.

    Raises
    ------
    Rejected
        With every contradiction on both axes, or at ``x.motion`` if the plan is a sine.
    """
    plan = make_plan(setup, sines=True)
    if plan.schedule.pixel_table is not None:
        raise Rejected([setup.scan_file.problem("x.motion", why)])
    return plan


def _within_cost(
    setup: Setup, x: LinePlan, y: LinePlan, schedule: Schedule, problems: Problems
) -> tuple[LinePlan, LinePlan]:
    """Count what a sample of both axes takes.

    A chosen table that takes more than its limit beside the one of the other axis, which has wide words or no runs, is
    chosen again.

    Raises
    ------
    Rejected
        If no table of this axis keeps its limit beside that one.
    """
    from tablegen.planning.cost_choice import played_table, remedy_for_runs  # here: most scans have no limit
    from tablegen.planning.table_costs import sample_costs

    cost = setup.scan.cost
    assert cost is not None
    lines = {"x": x, "y": y}
    for line in (x, y):
        its_other = lines["y" if line.axis == "x" else "x"]
        other = played_table(its_other.program, its_other.steepest)
        alone = sample_costs([played_table(line.program, line.steepest), other], cost.processor)[0]
        if line.table_request is not None and cost.max_instructions is not None and alone > cost.max_instructions:
            again = _line_plan(setup, line.axis, schedule, problems, other)
            problems.stop_if_any()
            assert again is not None
            lines[line.axis] = again
    played = {axis: played_table(line.program, line.steepest) for axis, line in lines.items()}
    takes, remedy = sample_costs([*played.values()], cost.processor), remedy_for_runs(setup, played)
    x, y = (
        replace(line, sample_cost=SampleCost(cost.processor, its, cost.max_instructions, remedy))
        for line, its in zip(lines.values(), takes, strict=True)
    )
    return x, y


def _better_motion(setup: Setup) -> Plan:
    """Plan a line and a sine; return what leaves less by the operator, the line where both leave the same.

    Raises
    ------
    Rejected
        If neither can be planned; with the contradictions of the line.
    """
    line, sine = (_planned_or_fault(with_motion(setup, motion)) for motion in ("line", "sine"))
    if isinstance(line, Rejected):
        if isinstance(sine, Rejected):
            raise line
        return sine
    return line if isinstance(sine, Rejected) or _left(line) <= _left(sine) else sine


def _planned_or_fault(setup: Setup) -> Plan | Rejected:
    try:
        return make_plan(setup, sines=True)
    except Rejected as rejected:
        return rejected


def _left(plan: Plan) -> float:
    """Return the rms error of the fast axis that its operator expects, with its uncertainty, in percent of the line."""
    expectation, pixels = plan.x.drive.shape.identification.expectation, plan.pixel_errors
    if expectation is None:
        return inf
    rounding = 0.0 if pixels is None else max(pixels.rms.values())
    return max(hypot(one.value, one.uncertainty or 0.0, rounding) for one in expectation.rms.values())


def mixing_key(setup: Setup) -> tuple[Document, str]:
    """Return the place of what makes an output follow both motions."""
    if setup.scan.angle_deg % 360.0:
        return setup.scan_file, "angle_deg"
    if setup.scanner.coupling:
        return setup.scanner_file, "coupling"
    return setup.scan_file, "drift_nm_per_s" if any(setup.scan.drift_nm_per_s) else "z"


def _line_plan(
    setup: Setup,
    axis: Literal["x", "y"],
    schedule: Schedule,
    problems: Problems,
    beside: "PlayedTable | None" = None,
) -> LinePlan | None:
    """Plan one axis: clock, voltages, harmonics, shape, waveform, table; None where ``problems`` grew.

    ``beside`` is the table of the other axis, where a limit of instructions has to count with it.
    """
    before = len(problems.entries)
    request = AxisRequest.of(setup, axis, schedule, problems)
    timing, feasible, choice, straight = request.timing, request.feasible, request.choice, request.harmonics
    drive = make_drive(setup, axis, float(timing.rate), request.voltages, straight, problems)
    if drive is None or len(problems.entries) > before:
        return None
    harmonics = choice.for_drive(drive, straight)
    waveforms = make_waveforms(setup, axis, timing, drive, choice, harmonics, problems)
    if waveforms is None:
        return None
    table = make_table(setup, axis, timing, drive, waveforms.series, feasible, problems, beside)
    if table is None or len(problems.entries) > before:
        return None
    return LinePlan(
        axis=axis,
        rate=timing.rate,
        requested_hz=timing.requested_hz,
        drive=drive,
        converter=table.converter,
        band_limit=_judged(getattr(setup.scan, axis).band_limit, drive),
        target=waveforms.target,
        drive_series=waveforms.drive_series,
        series=waveforms.series,
        held_harmonics=waveforms.held_harmonics,
        scale=table.scale,
        fourier=table.fourier,
        program=table.program,
        layer=waveforms.layer,
        kept_percent=waveforms.kept_percent,
        table_request=table.request,
        imaged=getattr(setup.scan, axis).band_limit.window if isinstance(drive.shape, SineLine) else None,
    )


def _judged(limit: BandLimit, drive: Drive) -> BandLimit:
    """Return the limit with the window of a line in shares of the time of a sweep, in which a sine is judged."""
    if not isinstance(drive.shape, SineLine):
        return limit
    rising, falling = passages(drive.shape.place, np.array(limit.window))
    low = min(2.0 * float(rising[0]), 2.0 - 2.0 * float(falling[0]))
    high = max(2.0 * float(rising[1]), 2.0 - 2.0 * float(falling[1]))
    return replace(limit, window=(max(low, 0.0), min(high, 1.0)))


def _examine(setup: Setup, axis: str, rate_hz: float, problems: Problems) -> None:
    """Check one axis at the requested rate where there is no schedule, to report its problems in the same run."""
    voltages = axis_voltages(setup, axis, rate_hz, problems)
    sine = getattr(getattr(setup.scan, axis), "motion", "line") == "sine"
    make_drive(setup, axis, rate_hz, voltages, 1 if sine else DEFAULT_HARMONICS, problems)
