"""From a checked configuration to integers: the immutable plan that everything downstream reads."""

from fractions import Fraction
from typing import Literal

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from tablegen.compensation.dynamics import capped_inverse
from tablegen.compensation.hold import hold_inverse
from tablegen.config.load import Setup
from tablegen.config.schema import DEFAULT_FORMATS, BandLimit, FastAxis, Limits, SlowAxis
from tablegen.device.dual_program import DualProgram
from tablegen.device.schedule import Schedule
from tablegen.figures import at_least
from tablegen.fixedpoint.converter import Converter, make_output
from tablegen.fixedpoint.phase import RationalPhase
from tablegen.fixedpoint.program import Program
from tablegen.fixedpoint.synthesis import FourierWords
from tablegen.numerics.arrays import Floats, Ints
from tablegen.planning.allowed_error import chosen_by_build
from tablegen.planning.band_limit import band_limited, gently_limited
from tablegen.planning.drive import Drive, compensate
from tablegen.planning.feasibility import DEFAULT_HARMONICS, Feasibility
from tablegen.planning.refinement_layer import learnt_layer
from tablegen.planning.settling import settle_lines
from tablegen.planning.shaping_choice import chosen_shaping
from tablegen.planning.table_choice import TableChoice, asked_of, choose, possible_shapes, written_shape
from tablegen.planning.table_maker import TableMaker
from tablegen.planning.timing import make_schedule
from tablegen.problems import Problems
from tablegen.waveform.allowed_error import AllowedError
from tablegen.waveform.series import FourierSeries


class LinePlan(Struct, frozen=True, eq=False):
    """One axis: what was asked for in volts, the waveform, and the integers that play it.

    ``target`` is the band-limited w that the piezo is to follow. ``drive_series`` is the w that has to arrive at the
    piezo for that: each harmonic divided by the dynamics; ``held_harmonics`` are those at which the boost limit held
    that back. ``series`` is the w that is played, ahead of that by the converter's hold: the code of advance k of N is
    that of ``series`` at k / N. ``layer`` is what of the target was learnt from a measurement, and lies over the
    model's shape. ``kept_percent`` is the scaling error for which the target has the least acceleration, None where it
    has another band limit. ``asked_table`` is what was asked of a table that the build chose, None where it is written.
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
    asked_table: TableChoice | None = None

    def __repr__(self) -> str:
        table = f"{self.program.mode} table of {len(self.program.words)} x {self.program.bits} bits"
        volts = f"{self.drive.v_amplitude:.6g} V about {self.drive.v_offset:.6g} V"
        if self.drive.resting:
            return f"{self.axis}: rests at {self.drive.v_offset:.6g} V"
        return f"{self.axis}: {volts}, {self.series.harmonics} harmonics, {table}"

    @property
    def described(self) -> FourierSeries:
        """The target without the layer: what the scanner's model describes."""
        return self.target if self.layer is None else self.target.less(self.layer)

    def float_codes(self, w: Floats) -> Floats:
        """The codes, unrounded, that values of w ask for: V(t) = V_offset + m g V_scan (w - 1/2)."""
        return self.converter.code(self.drive.v_offset) + self.codes_per_unit * (w - 0.5)

    @property
    def codes_per_unit(self) -> float:
        """Codes that w = 0 and w = 1 are apart; negative where the amplifier or the codes are inverted."""
        return self.drive.v_amplitude / self.converter.v_per_code

    def codes(self, start: int, stop: int) -> Ints:
        """The emitted codes at ticks [start, stop) since the program began."""
        return self.program.played(start, stop)


class Plan(Struct, frozen=True, eq=False):
    """A whole build: both axes and the one schedule they share."""

    name: str
    scanner: str
    schedule: Schedule
    x: LinePlan
    y: LinePlan
    limits: Limits
    header_only: bool
    formats: tuple[str, ...] = DEFAULT_FORMATS

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
        """The axes that move: of a line scan x alone."""
        return tuple(line for line in self.lines if not line.drive.resting)

    @property
    def program(self) -> DualProgram:
        """What a bank of the device holds of it: the programs of both axes and their schedule."""
        return DualProgram(self.x.program, self.y.program, self.schedule)


def make_plan(setup: Setup) -> Plan:
    """Compensate, shape and quantise a scan.

    Raises ``Rejected`` with every contradiction that was found on both axes.
    """
    problems = Problems()
    schedule = make_schedule(setup, problems)
    if schedule is None:
        # The rest is examined at the rates asked for, so that its problems are reported in the same run.
        line_rate = setup.scan.timing.line_rate_hz
        compensate(setup, "x", line_rate, lambda _: DEFAULT_HARMONICS, problems)
        compensate(setup, "y", line_rate / setup.scan.timing.lines, lambda _: DEFAULT_HARMONICS, problems)
        problems.stop_if_any()
        raise AssertionError("a schedule fails with a problem")  # pragma: no cover
    x = _line_plan(setup, "x", schedule, problems)
    y = _line_plan(setup, "y", schedule, problems)
    problems.stop_if_any()
    assert x is not None
    assert y is not None
    schedule = replace(schedule, settle_lines=settle_lines(setup, {"x": x.drive, "y": y.drive}, schedule, problems))
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
    )


def _line_plan(setup: Setup, axis: Literal["x", "y"], schedule: Schedule, problems: Problems) -> LinePlan | None:
    scan: FastAxis = getattr(setup.scan, axis)
    file = setup.scan_file
    rate = schedule.line_rate if axis == "x" else schedule.frame_rate
    requested = schedule.requested_hz if axis == "x" else schedule.requested_hz / schedule.lines
    hold = schedule.ticks if isinstance(scan, SlowAxis) and scan.motion == "step" else 1
    period = (schedule.ticks if axis == "x" else schedule.frame_ticks) // hold

    before = len(problems.found)
    feasible = Feasibility(setup, axis, problems)
    harmonics = feasible.harmonics(rate, period)
    feasible.check_table(period)
    limit, most = scan.band_limit, feasible.most_harmonics(period)
    key = f"{axis}.band_limit.{'harmonics' if limit.max_scaling_error_percent is None else 'max_scaling_error_percent'}"
    learnt = 1 if scan.refinement is None else len(scan.refinement.a)
    choice = None
    if chosen_by_build(limit):
        from tablegen.planning.enough_harmonics import EnoughHarmonics, plain_line, straightness  # as in ``_gentle``

        choice = EnoughHarmonics(limit, harmonics, min(learnt, most), most)

    def for_straight_line(allowed: AllowedError | None) -> int:
        with problems.at(file, key):
            if choice is not None and allowed is not None:
                return choice.of(straightness(plain_line(scan.turn), limit), allowed)
        return harmonics

    drive = compensate(setup, axis, float(rate), for_straight_line, problems)
    if drive is None or len(problems.found) > before:
        return None
    harmonics = drive.harmonics
    if choice is not None and drive.allowed is not None and drive.shape.waveform is None:
        with problems.at(file, key):
            harmonics = choice.of(straightness(drive.shape, limit), drive.allowed)

    layer = learnt_layer(setup, axis, drive, float(rate), harmonics, problems)
    if len(problems.found) > before:
        return None
    target, kept = None, None
    with problems.at(file, key):
        target, kept = _target(drive, limit, harmonics, layer, most, float(rate))
    if target is None:
        return None
    at_piezo: FourierSeries = target
    held: tuple[int, ...] = ()
    if drive.response is not None:
        with problems.at(setup.scanner_file, f"{axis}.resonance.response"):
            at_piezo, held = _through_inverse(target, drive, float(rate))
    series = at_piezo.times(*hold_inverse(harmonics, period, steps=hold > 1))

    hardware = setup.hardware(axis)
    converter = Converter.of(hardware.dac, hardware.amplifier)
    park_v = drive.v_offset if scan.park_v is None else scan.park_v
    shaping = chosen_shaping(setup, axis, drive, problems)
    maker = TableMaker(
        series=series,
        amplitude=0.5 * drive.v_amplitude / converter.v_per_code,
        offset=converter.code(drive.v_offset),
        phase=RationalPhase(period),
        hold=hold,
        output=make_output(hardware.dac, converter, drive.driver, park_v, shaping),
    )
    feasible.check_words(maker.as_asked)
    feasible.check_range(drive, converter, *maker.as_asked.reach, shaping)
    shape, asked = written_shape(scan.table, period), asked_of(scan.table, setup.scan.limits, shaping.order > 0)
    if asked is not None and len(problems.found) == before:
        from tablegen.planning.table_search import TableSearch  # here: most tables are written

        with problems.at(file, f"{axis}.table.{'mode' if scan.table.max_error_lsb is None else 'max_error_lsb'}"):
            possible = possible_shapes(scan.table, period, harmonics)
            shapes = feasible.fitting(possible, drive, converter, maker)
            shape = choose(TableSearch(maker), shapes, asked.max_error_lsb)
    stored = maker.stored(shape)
    if shape.mode == "cubic" and len(problems.found) == before:
        feasible.check_words(stored)
        feasible.check_gain(maker.gain(shape)[0])
    max_step = feasible.max_step(drive, converter, stored, float(rate), period, shape, shaping)
    if len(problems.found) > before:
        return None
    table = maker.limited(max_step).made(shape)
    return LinePlan(
        axis=axis,
        rate=rate,
        requested_hz=requested,
        drive=drive,
        converter=converter,
        band_limit=scan.band_limit,
        target=target,
        drive_series=at_piezo,
        series=series,
        held_harmonics=held,
        scale=table.scale,
        fourier=table.fourier,
        program=table.program,
        layer=layer,
        kept_percent=kept,
        asked_table=asked,
    )


def _target(
    drive: Drive, limit: BandLimit, harmonics: int, layer: FourierSeries | None, most: int, rate_hz: float
) -> tuple[FourierSeries, float | None]:
    """Return the waveform that the piezo is to get, and the scaling error in percent that it keeps, None for none."""
    if drive.resting:
        return FourierSeries(0.5, np.zeros(1), np.zeros(1)), None
    if drive.allowed is None:
        return band_limited(drive.shape, limit, harmonics, layer), None
    return _gentle(drive, limit, harmonics, layer, most, rate_hz)


def _gentle(
    drive: Drive, limit: BandLimit, harmonics: int, layer: FourierSeries | None, most: int, rate_hz: float
) -> tuple[FourierSeries, float | None]:
    """Least acceleration at the allowed error. Raises ``Unphysical`` with what would fit."""
    from tablegen.planning.enough_harmonics import straightness, with_remedies  # here: most lines do without the search
    from tablegen.waveform.gentle_fit import Unreachable

    assert drive.allowed is not None
    try:
        return gently_limited(drive.shape, limit, harmonics, layer, drive.allowed)
    except Unreachable as reason:

        def named(n: int) -> str:
            return f"{n} harmonics" if limit.cutoff_hz is None else f"cutoff_hz = {at_least(n * rate_hz, 6)}"

        straight = straightness(drive.shape, limit, layer)
        raise with_remedies(reason, straight, drive.allowed.percent, harmonics, most, named) from None


def _through_inverse(target: FourierSeries, drive: Drive, rate_hz: float) -> tuple[FourierSeries, tuple[int, ...]]:
    """Each harmonic divided by the response at its frequency, with the boost limited."""
    assert drive.response is not None
    n = np.arange(1.0, target.harmonics + 1.0)
    real, imaginary, held = capped_inverse(drive.response, n * rate_hz, drive.max_boost_db)
    return target.times(real, imaginary), tuple(int(h) for h in n[held])
