"""Contradictions between a request and what the driver, the converter, the amplifier and the table can do.

Each is reported at its key, with its size and with what would fit.
"""

from fractions import Fraction
from math import ceil, copysign, floor

import numpy as np

from tablegen.base.figures import at_least, at_most
from tablegen.base.input_errors import Problems, Unphysical
from tablegen.config.hardware import AxisAmplifier, AxisDac
from tablegen.config.load import Setup
from tablegen.config.schema import FastAxis
from tablegen.fixedpoint.converter import Converter, code_limits
from tablegen.fixedpoint.interpolation import guard_bits
from tablegen.fixedpoint.output import GAIN_BITS
from tablegen.fixedpoint.shaping import Shaping
from tablegen.fixedpoint.spline import SPLINE_UNIT
from tablegen.fixedpoint.table_shape import MOST_LENGTH, TableShape
from tablegen.numerics.arrays import Floats
from tablegen.numerics.driver import Driver
from tablegen.planning.allowed_error import MOST_HARMONICS, chosen_by_build
from tablegen.planning.drive import Drive
from tablegen.planning.laws import outside_driver
from tablegen.planning.table_maker import StoredWave, TableMaker
from tablegen.waveform.series import FourierSeries

DEFAULT_HARMONICS = 32
MAXIMUM_HARMONICS = 512
DEFAULT_LENGTH = {"interpolated": 2048, "cubic": 256}
MAXIMUM_DIRECT_WORDS = 1 << 20
ACCUMULATOR_LIMIT = 4  # limit of the synthesis, in units of the table's full scale
_FULL = 0.999 * ACCUMULATOR_LIMIT
_GAINS = 1 << (GAIN_BITS - 1)
_LONGEST = max(MOST_LENGTH.values())


class Feasibility:
    """The checks of one axis ("x" or "y"); they report to ``problems``."""

    def __init__(self, setup: Setup, axis: str, problems: Problems) -> None:
        self._setup = setup
        self._axis = axis
        self._problems = problems
        self._scan: FastAxis = getattr(setup.scan, axis)
        self._hardware = setup.hardware(axis)
        self._steps = getattr(self._scan, "motion", "ramp") == "step"

    def _add(self, key: str, why: str) -> None:
        self._problems.add(self._setup.scan_file, key, why)

    def _add_hardware(self, key: str, why: str) -> None:
        """Add a problem at a key such as "amplifier.gain", in the file that defines it for this axis."""
        self._problems.note(self._setup.hardware_problem(self._axis, key, why))

    def _named(self, key: str) -> str:
        return self._setup.named(self._axis, key)

    def harmonics(self, rate: Fraction, period: int) -> int:
        """Return the highest harmonic to play, for a rate in Hz and a table that advances ``period`` times a period."""
        limit = self._scan.band_limit
        key = f"{self._axis}.band_limit.harmonics"
        harmonics = limit.harmonics if isinstance(limit.harmonics, int) else DEFAULT_HARMONICS
        if chosen_by_build(limit):
            harmonics = min(harmonics, self.most_harmonics(period))
        if limit.cutoff_hz is not None:
            key = f"{self._axis}.band_limit.cutoff_hz"
            harmonics = floor(Fraction(repr(limit.cutoff_hz)) / rate)
            if not 1 <= harmonics <= MAXIMUM_HARMONICS:
                low, high = float(rate), MAXIMUM_HARMONICS * float(rate)
                self._add(
                    key,
                    f"{limit.cutoff_hz:g} Hz passes {harmonics} harmonics of {low:g} Hz; "
                    f"{at_least(low, 6)} to {at_most(high, 6)} Hz pass 1 to {MAXIMUM_HARMONICS}",
                )
                return 1
        carried = (period - 1) // 2
        if harmonics > carried:
            unit = "lines" if self._steps else "ticks"
            fits = self._carried(carried, rate) if carried else "; take more timing.lines"
            self._add(key, f"{harmonics} harmonics are too many; a period of {period} {unit} carries {carried}{fits}")
        length = self._longest_table
        carried = length // 2 - 1
        if self._scan.table.mode != "direct" and harmonics > carried:
            fits = self._carried(carried, rate)
            self._add(key, f"{harmonics} harmonics are too many; a table of {length} words carries {carried}{fits}")
        return harmonics

    def most_harmonics(self, period: int) -> int:
        """Return the most harmonics that the build may choose itself; at least 1."""
        carried = min((period - 1) // 2, MOST_HARMONICS)
        if self._scan.table.mode != "direct":
            carried = min(carried, self._longest_table // 2 - 1)
        return max(carried, 1)

    @property
    def _longest_table(self) -> int:
        """The most words that a table with a phase can have."""
        table = self._scan.table
        if table.length is not None:
            return table.length
        return _LONGEST if table.chosen_by_build else DEFAULT_LENGTH.get(table.mode or "", _LONGEST)

    def _carried(self, harmonics: int, rate: Fraction) -> str:
        """Return which cutoff passes that many harmonics, where the scan gives a cutoff."""
        if self._scan.band_limit.cutoff_hz is None:
            return ""
        return f", which {at_most(float((harmonics + 1) * rate) * (1 - 1e-9), 6)} Hz pass"

    def check_table(self, period: int) -> None:
        """Check that a ``direct`` table has a word for each of ``period`` advances."""
        table = self._scan.table
        if table.mode != "direct":
            return
        if table.length not in (None, period):
            self._add(
                f"{self._axis}.table.length",
                f"{table.length} is not the {period} words, one a {'line' if self._steps else 'tick'}, "
                f"that mode = 'direct' takes; leave it out",
            )
        if period > MAXIMUM_DIRECT_WORDS:
            self._add(
                f"{self._axis}.table.mode",
                f"'direct' takes {period} words, above {MAXIMUM_DIRECT_WORDS}; use 'interpolated'",
            )

    def check_range(self, drive: Drive, converter: Converter, low: float, high: float, shaping: Shaping) -> None:
        """Check that the drive, for w from ``low`` to ``high``, stays inside the driver and inside the converter.

        What shaping adds to the codes counts as well.
        """
        self._check_park(drive.driver, converter)
        down, up = drive.v_amplitude * (0.5 - low), drive.v_amplitude * (high - 0.5)
        bottom, top = drive.v_offset - down, drive.v_offset + up
        outside = drive.driver.beyond(bottom, top)
        if outside > 1e-9 * drive.driver.span:
            self._add(
                self._size_key if not drive.resting else f"{self._axis}.offset_v",
                f"the drive spans {bottom:.4f}..{top:.4f} V, {outside:.4g} V outside the driver's "
                f"{drive.driver}; {_offsets_that_fit(drive, low, high)}, {self._size_that_fits(drive, down, up)}",
            )
            return
        ends = sorted((converter.code(bottom), converter.code(top)))
        last = (1 << converter.bits) - 1
        if ends[0] < -0.5 or ends[1] >= last + 0.5:
            dac, amplifier = self._hardware.dac, self._hardware.amplifier
            volts = sorted((v - amplifier.bias_v) / amplifier.gain for v in (bottom, top))
            beyond = max(dac.v_min - volts[0], volts[1] - dac.highest_v)
            self._add_hardware(
                "amplifier.gain",
                f"the {self._axis} drive of {bottom:.4f}..{top:.4f} V needs {volts[0]:.4f}..{volts[1]:.4f} V of the "
                f"converter, {beyond:.4g} V beyond its {dac.v_min:g}..{dac.highest_v:.6g} V; "
                f"{_amplifier_that_fits(dac, amplifier, bottom, top)} would carry it, or scan less",
            )
        if abs(ends[1] - ends[0]) < 2.0 and not drive.resting:
            self._add(
                self._size_key,
                f"the drive of {down + up:.4g} V is {ends[1] - ends[0]:.3g} codes of the converter, which cannot "
                f"draw a line; scan more, or use more {self._named('dac.bits')} or less "
                f"{self._named('amplifier.gain')}",
            )
        if shaping.order:
            self._check_room(drive, converter, ends, shaping)

    def _check_room(self, drive: Drive, converter: Converter, ends: list[float], shaping: Shaping) -> None:
        """Check that no shaped code is clamped: a clamp would drop the remainder that the next codes make up for."""
        first, last = code_limits(converter, drive.driver)
        room, available = shaping.excess, min(ends[0] - first, last - ends[1])
        if available >= room:
            return
        self._add_shaping(
            f"moves codes by up to {room:g}, and the {self._axis} drive comes to {max(available, 0.0):.3g} codes of an "
            f"end of converter or driver; an order that moves them less, a line that is smaller by "
            f"{at_least((room - available) * abs(converter.v_per_code))} V at that end, or shaping = 'off' would fit"
        )

    def _add_shaping(self, why: str) -> None:
        """Add a problem at the key of shaping, with its value."""
        self._add_hardware("dac.shaping", f"'{self._hardware.dac.shaping}' {why}")

    @property
    def _size_key(self) -> str:
        return f"{self._axis}.{'size_v' if self._scan.size_v is not None else 'size_nm'}"

    def _check_park(self, driver: Driver, converter: Converter) -> None:
        """Check that the driver and the converter reach the park voltage."""
        park_v, key = self._scan.park_v, f"{self._axis}.park_v"
        if park_v is None:
            return
        if driver.beyond(park_v, park_v) > 0.0:
            self._add(key, outside_driver(park_v, driver))
            return
        last = (1 << converter.bits) - 1
        if not -0.5 <= converter.code(park_v) < last + 0.5:
            reach = sorted(converter.v_zero + converter.v_per_code * code for code in (0, last))
            self._add(key, f"{park_v:.6g} V is outside the {reach[0]:.6g}..{reach[1]:.6g} V that the converter reaches")

    def _size_that_fits(self, drive: Drive, down: float, up: float) -> str:
        """Return the largest scan at this offset, in the unit of its key."""
        share = min((drive.v_offset - drive.driver.v_min) / down, (drive.driver.v_max - drive.v_offset) / up)
        if share < 1e-3:
            return "at this one nothing"
        v = 0.99 * share * drive.v_scan_normalised  # a smaller line has another shape, and overshoots a little more
        line_nm = drive.size_law.size_nm(v)
        if self._scan.size_v is not None:
            return f"or at this offset about {at_most(v * drive.driver.span, 3)} V"
        if self._scan.size_of == "window":
            return f"or at this offset a window of about {at_most(line_nm * drive.window_nm / drive.size_nm, 3)} nm"
        return f"or at this offset a line of about {at_most(line_nm, 3)} nm"

    def max_step(
        self,
        drive: Drive,
        converter: Converter,
        stored: StoredWave,
        rate_hz: float,
        period: int,
        shape: TableShape,
        shaping: Shaping,
    ) -> int:
        """Return the slew guard in codes a tick: the amplifier's slew rate, or twice the steepest step of the line."""
        slope = drive.v_amplitude * stored.series.peak_slope()
        v_per_code = abs(converter.v_per_code)
        words = _word_codes(drive, converter, stored.largest, period, shape)
        rounded = _steepest(drive, converter, stored.series, period, words)
        steepest = rounded + shaping.step_excess
        slew, allowed = self._hardware.amplifier.max_slew_v_per_s, self._allowed_step(converter)
        if slew is None:
            return min(2 * steepest, allowed)
        update_rate = self._hardware.dac.update_rate_hz
        requested = slope * rate_hz
        if steepest <= allowed and (self._steps or requested <= slew):
            return allowed
        if rounded <= allowed and (self._steps or requested <= slew):
            self._refuse_step(shaping, rounded, allowed, slew, v_per_code, requested / update_rate / v_per_code + words)
            return allowed
        finer = "" if words < 0.5 else f", more {self._axis}.table.bits"
        if self._steps:
            self._add(
                "y.motion",
                f"the y axis steps by up to {steepest} codes in one tick, {slew:.6g} V/s allow {allowed}; "
                f"use motion = 'ramp'",
            )
        elif allowed <= 1.0 + words and requested < 0.9 * slew:
            # Room to round both sides, and for the line rate, which moves a little with it.
            fits = at_most(0.95 * (slew - requested) / ((3.0 + words) * v_per_code))
            self._add_hardware(
                "amplifier.max_slew_v_per_s",
                f"{slew:.6g} V/s are {slew / update_rate / v_per_code:.3g} codes of the {self._axis} axis in a tick, "
                f"and a line needs {floor(words) + 2}; "
                f"an update_rate_hz of about {fits}{finer} or more {self._named('dac.bits')} would fit",
            )
        else:
            usable = (allowed - 1.0 - words) * v_per_code * update_rate if allowed > 1.0 + words else 0.5 * slew
            times = requested / min(slew, usable)
            line_nm = drive.size_law.size_nm(drive.v_scan_normalised / times)
            what = (
                f"slews at {requested:.6g} V/s, {requested / slew:.4g} times the amplifier's {slew:.6g} V/s"
                if requested > slew
                else f"steps by up to {steepest} codes a tick with rounding, {slew:.6g} V/s allow {allowed}"
            )
            key, slower = self._slower(times)
            fits = f"about {slower}{finer} or a line of {at_most(line_nm)} nm would fit"
            self._add(key, f"the {self._axis} drive {what}; {fits}")
        return max(allowed, 1)

    def _refuse_step(
        self, shaping: Shaping, rounded: int, allowed: int, slew: float, v_per_code: float, codes: float
    ) -> None:
        """Report that the amplifier carries the line but not what shaping adds; ``codes`` is the unrounded step."""
        update_rate = self._hardware.dac.update_rate_hz
        slower = update_rate * (slew / update_rate / v_per_code - codes) / (shaping.step_excess + 3.0)
        self._add_shaping(
            f"adds up to {shaping.step_excess} codes to a step of the {self._axis} axis, which are {rounded} without "
            f"it, and {slew:.6g} V/s allow {allowed} in a tick; an update_rate_hz of about {at_most(slower)}, an order "
            "that adds less, or shaping = 'off' would fit"
        )

    def fitting(
        self, shapes: list[TableShape], drive: Drive, converter: Converter, maker: TableMaker
    ) -> list[TableShape]:
        """Return the tables that a device holds, with their gain, and whose steps the amplifier follows.

        If it follows none of them, return all that a device holds, so that the steps of one of them are reported.

        Raises
        ------
        Unphysical
            If a device holds none of the tables.
        """
        slew, allowed = self._hardware.amplifier.max_slew_v_per_s, self._allowed_step(converter)

        def follows(shape: TableShape) -> bool:
            stored = maker.stored(shape)
            words = _word_codes(drive, converter, stored.largest, maker.phase.ticks, shape)
            steepest = _steepest(drive, converter, stored.series, maker.phase.ticks, words)
            return slew is None or steepest + maker.output.shaping.step_excess <= allowed

        storable = [shape for shape in shapes if _holds(maker, shape)]
        if not storable:
            raise Unphysical("no device holds a table of these words and this waveform; leave out its keys")
        return [shape for shape in storable if follows(shape)] or storable

    def _allowed_step(self, converter: Converter) -> int:
        """Return how many codes the amplifier follows in a tick; all, if its slew rate is not known."""
        last = (1 << converter.bits) - 1
        slew, v_per_code = self._hardware.amplifier.max_slew_v_per_s, abs(converter.v_per_code)
        return last if slew is None else min(floor(slew / self._hardware.dac.update_rate_hz / v_per_code), last)

    def expected_guard(self, drive: Drive, converter: Converter, series: FourierSeries, period: int) -> int:
        """Return the slew guard in codes a tick, as far as it is known before the words of a table."""
        allowed = self._allowed_step(converter)
        if self._hardware.amplifier.max_slew_v_per_s is not None:
            return allowed
        return min(2 * _steepest(drive, converter, series, period, 0.0), allowed)

    def check_words(self, stored: StoredWave) -> None:
        """Check that the accumulator of the device holds the sum of all Fourier words, whatever their signs."""
        series, largest, sums = stored.series, stored.largest, _sums(stored.series)
        if sums[-1] >= _FULL * largest:
            fits = int(np.searchsorted(sums, 0.99 * ACCUMULATOR_LIMIT * largest))
            self._add(
                f"{self._axis}.band_limit.harmonics",
                f"the {series.harmonics} harmonics sum to {sums[-1] / largest:.4g} of the scan, the accumulator of the "
                f"device holds {ACCUMULATOR_LIMIT}; about {fits} harmonics, or method = 'lanczos', fit",
            )

    def check_gain(self, gain_word: int) -> None:
        """Check that the gain makes up for the words of a spline, which exceed the waveform more the fewer they are."""
        if abs(gain_word) >= _GAINS:
            self._add(
                f"{self._axis}.table.length",
                "the coefficients of so few words exceed the waveform by more than the gain makes up for; take more",
            )

    def _slower(self, times: float) -> tuple[str, str]:
        """Return the key that sets the line rate, and its value for a rate lower by a factor."""
        timing = self._setup.scan.timing
        if timing.ticks_per_line is not None:
            return "timing.ticks_per_line", f"{ceil(times * timing.ticks_per_line)} ticks_per_line"
        if timing.ticks_per_pixel is not None:
            return "timing.ticks_per_pixel", f"{ceil(times * timing.ticks_per_pixel)} ticks_per_pixel"
        written, factor = self._setup.scan_file.written_key("timing.line_rate_hz")
        slower = at_most(factor * timing.line_rate_hz / times, 5)
        if factor == 1.0:
            return "timing.line_rate_hz", f"{slower} Hz"
        return "timing.line_rate_hz", f"{written.rpartition('.')[2]} = {slower}"


def _word_codes(drive: Drive, converter: Converter, largest: float, period: int, shape: TableShape) -> float:
    """Return by how many codes a step can be off since the words of the table are rounded."""
    full_scale = 0.51 * drive.v_amplitude / abs(converter.v_per_code) * largest + 2.0 ** (converter.bits - 17)
    share = 1.0 if shape.mode == "direct" else min(1.0, shape.length / period)
    # Of two samples: each is within half a unit, and of a spline, which rounds at each degree, within a whole one.
    rounded = 2.0 / SPLINE_UNIT if shape.mode == "cubic" else 2.0 ** -guard_bits(shape.bits)
    return full_scale * 2.0 ** (1 - shape.bits) * (share + rounded)


def _holds(maker: TableMaker, shape: TableShape) -> bool:
    """Return True if accumulator and gain of a device are wide enough."""
    stored = maker.stored(shape)
    return bool(_sums(stored.series)[-1] < _FULL * stored.largest) and abs(maker.gain(shape)[0]) < _GAINS


def _sums(series: FourierSeries) -> Floats:
    """Return the cumulative sums of the sizes of the Fourier words, harmonic by harmonic."""
    sums: Floats = abs(2.0 * series.a0 - 1.0) + 2.0 * np.cumsum(np.abs(series.a) + np.abs(series.b))
    return sums


def _steepest(drive: Drive, converter: Converter, series: FourierSeries, period: int, words: float) -> int:
    """Return the steepest step in codes: no chord is steeper than the steepest slope, and rounding adds to it."""
    return ceil(drive.v_amplitude * series.peak_slope() / abs(converter.v_per_code) / period + words) + 1


def _amplifier_that_fits(dac: AxisDac, amplifier: AxisAmplifier, bottom: float, top: float) -> str:
    """Return the amplifier that spreads the converter over a drive, and no further."""
    gain = copysign(float(at_least(1.0001 * (top - bottom) / (dac.highest_v - dac.v_min))), amplifier.gain)
    bias_v = 0.5 * (bottom + top) - gain * 0.5 * (dac.v_min + dac.highest_v)
    return f"a gain of {gain:g} with a bias_v of {bias_v:.6g} V"


def _offsets_that_fit(drive: Drive, low: float, high: float) -> str:
    """Return the offsets at which the drive stays inside the driver; its amplitude changes with the offset by (1)."""
    driver = drive.driver

    def fits(v_offset: float) -> bool:
        amplitude = drive.v_amplitude_at(v_offset)
        return driver.v_min + amplitude * (0.5 - low) <= v_offset <= driver.v_max - amplitude * (high - 0.5)

    grid = [driver.v_min + driver.span * i / 1000 for i in range(1001)]
    feasible = [v for v in grid if fits(v)]
    if not feasible:
        least = min(drive.v_amplitude_at(v) for v in grid) * (high - low)
        return (
            f"it takes at least {at_least(least)} V, so that no offset fits"
            if least > driver.span
            else "no offset fits"
        )
    # The nearest stretch of the grid without a gap.
    nearest = min(range(1001), key=lambda i: (not fits(grid[i]), abs(grid[i] - drive.v_offset)))
    first = last = nearest
    while first > 0 and fits(grid[first - 1]):
        first -= 1
    while last < 1000 and fits(grid[last + 1]):
        last += 1
    return f"an offset of {at_least(grid[first])} to {at_most(grid[last])} V fits"
