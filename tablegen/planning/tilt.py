"""Plan an output beside x and y that is linear in both: a share of both motions, on a piezo that is taken as linear."""

from dataclasses import fields
from functools import cached_property
from math import floor

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from tablegen.base.figures import at_most
from tablegen.base.input_errors import Problems
from tablegen.compensation.operator.turned_frame import FrameMotion
from tablegen.config.load import Setup
from tablegen.config.schema import Tilt, TiltName
from tablegen.device.schedule import Schedule
from tablegen.fixedpoint.converter import Converter, code_limits, make_output
from tablegen.fixedpoint.frame_program import FrameProgram, played_extremes
from tablegen.fixedpoint.frame_words import FrameParts, quantise_frame
from tablegen.fixedpoint.output import Output
from tablegen.numerics.arrays import Floats, Ints
from tablegen.numerics.driver import Driver
from tablegen.planning.frame_motion import frame_motion
from tablegen.planning.tilt_drive import TiltDrive, tilt_drive
from tablegen.planning.tilt_motion import TiltMotion
from tablegen.waveform.series import FourierSeries

_SAMPLES = 512  # of a line, at which the reach of the output is taken
_LEAST_STEPS = 0.5  # of a code a tick, where a slew rate allows fewer than two


class CodeRange(Struct, frozen=True):
    """The range of an output's codes in a frame, and the largest step of a tick, with what shaping can add."""

    least: int
    most: int
    steepest: int


class TiltErrors(Struct, frozen=True):
    """The largest distance of a code from the wanted height at the imaged ticks, in LSB and in nm.

    ``codes`` are those of a frame.
    """

    error_lsb: float
    error_nm: float
    codes: CodeRange


class TiltedOutput(Struct, frozen=True, eq=False, dict=True):
    """An output beside x and y: its slopes on the sample, its share of both motions, and its integers.

    ``name`` is "z" or "aux", ``offset`` the code in the centre of the scan, as a real number.
    """

    name: TiltName
    slope_x: float
    slope_y: float
    nm_per_v: float
    converter: Converter
    motion: FrameMotion
    offset: float
    program: FrameProgram

    def wanted_codes(self, lines: Ints, t: Floats) -> Floats:
        """Return the codes, as real numbers, of the wanted heights at phases of lines, broadcast."""
        return np.asarray(self.offset + self.motion.wanted_nm(lines, t) / (self.nm_per_v * self.converter.v_per_code))

    @cached_property
    def errors(self) -> TiltErrors:
        """The errors of its integers at all imaged ticks of a frame."""
        program, ticks = self.program, self.program.fast.phase.ticks
        t = (np.arange(ticks) + 0.5) / ticks
        inside, worst = np.flatnonzero(self.motion.inside(t)), 0.0
        for line in np.flatnonzero(self.motion.imaged).tolist():
            codes = program.output.clamp(program.at(line, inside))
            worst = max(worst, float(np.max(np.abs(codes - self.wanted_codes(np.array(line), t[inside])))))
        in_nm = worst * abs(self.converter.v_per_code * self.nm_per_v)
        return TiltErrors(worst, in_nm, CodeRange(*played_extremes(program)))


def plan_tilt(
    setup: Setup,
    name: TiltName,
    schedule: Schedule,
    harmonics: int,
    shares: tuple[float, float],
    problems: Problems,
    place: FourierSeries | None = None,
) -> TiltedOutput | None:
    """Plan an output beside x and y; None where ``problems`` grew.

    Parameters
    ----------
    setup
        A scan and a scanner that both have this output.
    name
        Its name, which is that of its table in both files.
    harmonics
        Those of its line.
    shares
        The nm that it moves along the line and along the frame, from x = 0 to 1 of each.
    place
        The predicted position over a line where x moves as a sine.
    """
    tilt, piezo, hardware = setup.scan.tilts[name], getattr(setup.scanner, name), setup.hardware(name)
    assert piezo is not None
    driver, converter = piezo.driver, Converter.of(hardware.dac, hardware.amplifier)
    before = len(problems.entries)
    _check_rest(setup, name, converter, driver, problems)
    if len(problems.entries) > before:
        return None
    centre, offset = driver.share(tilt.offset_v), converter.code(tilt.offset_v)
    motion = frame_motion(setup, schedule, harmonics, centre, *shares)
    if place is not None or setup.scan.y.motion == "step":
        shared = {each.name: getattr(motion, each.name) for each in fields(motion)}
        motion = TiltMotion(**shared, schedule=schedule, place=place, steps=setup.scan.y.motion == "step")
    drive = None
    with problems.at(setup.scan_file, "y.motion"):
        drive = tilt_drive(name, motion, piezo.nm_per_v * driver.span, schedule, driver.span / converter.v_per_code)
    if drive is None:
        return None
    park_v = tilt.offset_v if tilt.park_v is None else tilt.park_v
    output = make_output(replace(hardware.dac, output=None), converter, driver, park_v)
    volts = driver.volts(_on_grid(drive.slow, drive.fast, motion.lines))
    ends: tuple[float, float] = _sorted(converter.code(float(np.min(volts))), converter.code(float(np.max(volts))))
    program = None
    if _fits(output, ends):
        program = _quantised(output, converter, driver, drive, schedule)
        ends = played_extremes(program)[:2]
    if program is None or not _fits(output, ends):
        problems.add(setup.scan_file, _key(name, tilt), _what_fits(name, tilt, converter, output, offset, ends))
        return None
    program = _guarded(setup, name, converter, program, float(schedule.line_rate), problems)
    return TiltedOutput(name, tilt.slope_x, tilt.slope_y, piezo.nm_per_v, converter, motion, offset, program)


def _check_rest(setup: Setup, name: TiltName, converter: Converter, driver: Driver, problems: Problems) -> None:
    """Check that offset and park voltage are in the range that the driver and the converter have in common."""
    tilt, (least, most) = setup.scan.tilts[name], code_limits(converter, driver)
    if least >= most:
        why = f"the driver of {name} has {driver}, and its converter reaches none of it; correct it, or "
        problems.add(setup.scanner_file, f"{name}.v_max", f"{why}[{name}.amplifier]")
        return
    for key, volts in (("offset_v", tilt.offset_v), ("park_v", tilt.park_v)):
        if volts is not None and not least - 0.5 <= converter.code(volts) <= most + 0.5:
            why = f"{volts:g} V is outside the {_volts(converter, least, most)} of {name}"
            problems.add(setup.scan_file, f"{name}.{key}", why)


def _on_grid(slow: FourierSeries, fast: FourierSeries, lines: int) -> Floats:
    """Return the drive of a frame, of v_max, shape (lines, samples of a line)."""
    start = slow.on_grid(lines)
    rise = np.roll(start, -1) - start
    return np.asarray(start[:, None] + rise[:, None] * (np.arange(_SAMPLES) / _SAMPLES) + fast.on_grid(_SAMPLES))


def _quantised(
    output: Output, converter: Converter, driver: Driver, drive: TiltDrive, schedule: Schedule
) -> FrameProgram:
    """Return the integers of the output, without a slew guard."""
    parts = FrameParts(
        fast=drive.fast,
        second=drive.second,
        slow=FourierSeries(0.0, drive.slow.a, drive.slow.b),
        gains=drive.gains,
        ratios=drive.ratios,
        spacing=drive.spacing,
        codes=driver.span / converter.v_per_code,
        offset=converter.code(driver.volts(drive.slow.a0)),
    )
    return quantise_frame(parts, output, schedule.ticks, schedule.lines)


def _fits(output: Output, ends: tuple[float, float]) -> bool:
    return output.code_min <= ends[0] and ends[1] <= output.code_max


def _what_fits(
    name: TiltName, tilt: Tilt, converter: Converter, output: Output, offset: float, ends: tuple[float, float]
) -> str:
    """Return the slopes that would fit the range, a code for the rounding left."""
    room = min(
        max(offset - output.code_min - 1.0, 0.0) / max(offset - ends[0], 1.0),
        max(output.code_max - offset - 1.0, 0.0) / max(ends[1] - offset, 1.0),
    )
    reach = _volts(converter, output.code_min, output.code_max)
    return f"the tilt leaves the {reach} of {name}; the largest that fits here is {_slopes(tilt, room)}"


def _guarded(
    setup: Setup, name: TiltName, converter: Converter, program: FrameProgram, line_rate_hz: float, problems: Problems
) -> FrameProgram:
    """Return the program with its slew guard; steps that are too large go to ``problems``."""
    tilt, hardware, (_, _, steepest) = setup.scan.tilts[name], setup.hardware(name), played_extremes(program)
    slew, last = hardware.amplifier.max_slew_v_per_s, (1 << hardware.dac.bits) - 1
    if slew is None:
        return program.guarded(min(2 * steepest, last))
    allowed = min(floor(slew / hardware.dac.update_rate_hz / abs(converter.v_per_code)), last)
    if steepest > allowed:
        share = max(allowed - 1.0, _LEAST_STEPS) / steepest  # a code for the rounding
        problems.add(
            setup.scan_file,
            _key(name, tilt),
            f"{name} steps by up to {steepest} codes a tick, {slew:.6g} V/s allow {allowed}; {_slopes(tilt, share)} "
            f"would fit, or lines at {at_most(line_rate_hz * share)} Hz",
        )
    return program.guarded(allowed)


def _key(name: TiltName, tilt: Tilt) -> str:
    """Return the key of the larger slope."""
    return f"{name}.slope_x" if abs(tilt.slope_x) >= abs(tilt.slope_y) else f"{name}.slope_y"


def _slopes(tilt: Tilt, share: float) -> str:
    """Return the slopes of a share of the tilt as they are written, rounded down in size."""
    return " and ".join(
        f"{name} = {'-' if slope < 0.0 else ''}{at_most(abs(slope) * share)}"
        for name, slope in (("slope_x", tilt.slope_x), ("slope_y", tilt.slope_y))
        if slope
    )


def _volts(converter: Converter, least: int, most: int) -> str:
    low, high = _sorted(*(converter.v_zero + converter.v_per_code * code for code in (least, most)))
    return f"{low:.6g}..{high:.6g} V"


def _sorted(first: float, second: float) -> tuple[float, float]:
    return (first, second) if first <= second else (second, first)
