"""Build the plan: quantise a validated configuration into the immutable integers that everything downstream reads."""

from fractions import Fraction
from typing import Literal

from msgspec import Struct
from msgspec.structs import replace

from tablegen.base.input_errors import Document, Problems
from tablegen.config.load import Setup
from tablegen.config.schema import DEFAULT_FORMATS, BandLimit, Limits
from tablegen.device.dual_program import DualProgram
from tablegen.device.schedule import Schedule
from tablegen.fixedpoint.converter import Converter
from tablegen.fixedpoint.program import Program
from tablegen.fixedpoint.synthesis import FourierWords
from tablegen.numerics.arrays import Floats, Ints
from tablegen.planning.axis_table import make_table
from tablegen.planning.clock import clocks_per_tick
from tablegen.planning.drive import Drive, make_drive
from tablegen.planning.feasibility import DEFAULT_HARMONICS, Feasibility
from tablegen.planning.harmonic_choice import HarmonicChoice
from tablegen.planning.settling import settle_lines
from tablegen.planning.table_choice import TableRequest
from tablegen.planning.timing import AxisTiming, make_schedule
from tablegen.planning.voltages import axis_voltages
from tablegen.planning.waveforms import make_waveforms
from tablegen.waveform.series import FourierSeries

MIXED = (
    "a scan at an angle, on coupled axes or with drift is for `check`, `show`, `build` with the format c, "
    "`verify`, `upload` and `readback`; leave this out for anything else"
)


class LinePlan(Struct, frozen=True, eq=False):
    """One axis: the request in volts, the waveform, and the integers that play it.

    ``target`` is the band-limited w that the piezo is to follow. ``drive_series`` is the w that has to arrive at the
    piezo for that: each harmonic divided by the dynamics; ``held_harmonics`` are those that the boost limit reduces.
    ``series`` is the w that is played, ahead of that by the half tick of the converter's zero-order hold: the code of
    advance k of N is that of ``series`` at k / N. ``layer`` is the part of the target that was learnt from a
    measurement, added to the model's shape. ``kept_percent`` is the scaling error for which the target has minimum
    acceleration, None where it has another band limit. ``table_request`` is the request for a
    table that the build chose, None where the scan file gives the table.
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

    def codes(self, start: int, stop: int) -> Ints:
        """Return the emitted codes at ticks [start, stop) since the program began.

        Returns
        -------
        Ints
            Shape (stop - start,).
        """
        return self.program.played(start, stop)


class Plan(Struct, frozen=True, eq=False):
    """A whole build: both axes and their common schedule."""

    name: str
    scanner: str
    schedule: Schedule
    x: LinePlan
    y: LinePlan
    limits: Limits
    header_only: bool
    formats: tuple[str, ...] = DEFAULT_FORMATS
    clocks_per_tick: int = 0  # of an FPGA; 0: not known

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
    def program(self) -> DualProgram:
        """The content of a bank of the device: the programs of both axes and their schedule."""
        return DualProgram(self.x.program, self.y.program, self.schedule)


def make_plan(setup: Setup) -> Plan:
    """Compensate, shape and quantise a scan.

    Raises
    ------
    Rejected
        With every contradiction on both axes.
    """
    problems = Problems()
    if setup.mixes_motions:
        problems.add(*mixing_key(setup), MIXED)
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
    schedule = replace(schedule, settle_lines=settle_lines(setup, {"x": x.drive, "y": y.drive}, schedule, problems))
    clocks = clocks_per_tick(setup, schedule, (x.program, y.program), problems)
    problems.stop_if_any()
    scan = setup.scan
    return Plan(
        scan.name,
        setup.scanner.name,
        schedule,
        x,
        y,
        scan.limits,
        scan.emit.header_only,
        tuple(scan.emit.formats or DEFAULT_FORMATS),
        clocks,
    )


def mixing_key(setup: Setup) -> tuple[Document, str]:
    """Return the place of what makes an axis follow both motions."""
    if setup.scan.angle_deg % 360.0:
        return setup.scan_file, "angle_deg"
    return (setup.scanner_file, "coupling") if setup.scanner.coupling else (setup.scan_file, "drift_nm_per_s")


def _line_plan(setup: Setup, axis: Literal["x", "y"], schedule: Schedule, problems: Problems) -> LinePlan | None:
    """Plan one axis: clock, voltages, harmonics, shape, waveform, table; None where ``problems`` grew."""
    before = len(problems.entries)
    timing = AxisTiming.of(setup, axis, schedule)
    feasible = Feasibility(setup, axis, problems)
    choice = HarmonicChoice(setup, axis, timing.rate, timing.period, feasible, problems)
    feasible.check_table(timing.period)

    voltages = axis_voltages(setup, axis, float(timing.rate), problems)
    straight = choice.for_straight_line(voltages.allowed)
    drive = make_drive(setup, axis, float(timing.rate), voltages, straight, problems)
    if drive is None or len(problems.entries) > before:
        return None
    harmonics = choice.for_drive(drive, straight)
    waveforms = make_waveforms(setup, axis, timing, drive, choice, harmonics, problems)
    if waveforms is None:
        return None
    table = make_table(setup, axis, timing, drive, waveforms.series, feasible, problems)
    if table is None or len(problems.entries) > before:
        return None
    return LinePlan(
        axis=axis,
        rate=timing.rate,
        requested_hz=timing.requested_hz,
        drive=drive,
        converter=table.converter,
        band_limit=getattr(setup.scan, axis).band_limit,
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
    )


def _examine(setup: Setup, axis: str, rate_hz: float, problems: Problems) -> None:
    """Check one axis at the requested rate where there is no schedule, to report its problems in the same run."""
    voltages = axis_voltages(setup, axis, rate_hz, problems)
    make_drive(setup, axis, rate_hz, voltages, DEFAULT_HARMONICS, problems)
