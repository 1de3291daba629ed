"""Contradictions between what is asked and what the driver, the converter, the amplifier and the table can do.

Each is reported at its key, with by how much and with what would fit.
"""

from fractions import Fraction
from math import ceil, floor

from tablegen.compensation.drive import Drive
from tablegen.config.load import Setup
from tablegen.config.schema import FastAxis
from tablegen.fixedpoint.converter import Converter
from tablegen.problems import Problems
from tablegen.waveform.series import FourierSeries

DEFAULT_HARMONICS = 32
MAXIMUM_HARMONICS = 512
DEFAULT_LENGTH = 2048
MAXIMUM_DIRECT_WORDS = 1 << 20


class Feasibility:
    """The checks of one axis ("x" or "y"); what they find goes to ``problems``."""

    def __init__(self, setup: Setup, axis: str, problems: Problems) -> None:
        self._setup = setup
        self._axis = axis
        self._problems = problems
        self._scan: FastAxis = getattr(setup.scan, axis)
        self._steps = getattr(self._scan, "motion", "ramp") == "step"

    def _add(self, key: str, why: str) -> None:
        self._problems.add(self._setup.scan_file, key, why)

    def harmonics(self, rate: Fraction, period: int) -> int:
        """The highest harmonic to play of a rate in Hz, where the table advances ``period`` times a period."""
        limit = self._scan.band_limit
        key = f"{self._axis}.band_limit.harmonics"
        harmonics = DEFAULT_HARMONICS if limit.harmonics is None else limit.harmonics
        if limit.cutoff_hz is not None:
            key = f"{self._axis}.band_limit.cutoff_hz"
            harmonics = floor(Fraction(repr(limit.cutoff_hz)) / rate)
            if not 1 <= harmonics <= MAXIMUM_HARMONICS:
                low, high = float(rate), MAXIMUM_HARMONICS * float(rate)
                self._add(
                    key,
                    f"{limit.cutoff_hz:g} Hz passes {harmonics} harmonics of {low:g} Hz; "
                    f"{low:g} to {high:g} Hz pass 1 to {MAXIMUM_HARMONICS}",
                )
                return 1
        if harmonics > (period - 1) // 2:
            unit = "lines" if self._steps else "ticks"
            self._add(
                key, f"{harmonics} harmonics are too many; a period of {period} {unit} carries {(period - 1) // 2}"
            )
        length = self._scan.table.length or DEFAULT_LENGTH
        if self._scan.table.mode == "interpolated" and harmonics > length // 2 - 1:
            self._add(key, f"{harmonics} harmonics are too many; a table of {length} words carries {length // 2 - 1}")
        return harmonics

    def table_length(self, period: int) -> int:
        """Words of the table."""
        table = self._scan.table
        if table.mode == "interpolated":
            return table.length or DEFAULT_LENGTH
        if table.length not in (None, period):
            self._add(
                f"{self._axis}.table.length",
                f"{table.length} is not the {period} words, one a tick, that mode = 'direct' takes; leave it out",
            )
        if period > MAXIMUM_DIRECT_WORDS:
            self._add(
                f"{self._axis}.table.mode",
                f"'direct' takes {period} words, above {MAXIMUM_DIRECT_WORDS}; use 'interpolated'",
            )
        return period

    def check_range(self, drive: Drive, converter: Converter, low: float, high: float) -> None:
        """The drive, for w from ``low`` to ``high``, has to stay inside the driver and inside the converter."""
        if self._scan.park_v is not None and not 0.0 <= self._scan.park_v <= drive.v_max:
            self._add(f"{self._axis}.park_v", f"{self._scan.park_v:g} V is outside the driver's 0..{drive.v_max:g} V")
        down, up = drive.v_amplitude * (0.5 - low), drive.v_amplitude * (high - 0.5)
        bottom, top = drive.v_offset - down, drive.v_offset + up
        outside = max(-bottom, top - drive.v_max)
        if outside > 1e-9 * drive.v_max:
            key = f"{self._axis}.{'size_v' if self._scan.size_v is not None else 'size_nm'}"
            share = min(drive.v_offset / down, (drive.v_max - drive.v_offset) / up)
            size = drive.size_law.size_nm(drive.v_scan_normalised * share)
            if down + up <= drive.v_max:
                fits = f"an offset of {down:.4f} to {drive.v_max - up:.4f} V fits"
            else:
                fits = f"no offset fits, since it takes {down + up:.4g} V"
            self._add(
                key,
                f"the drive spans {bottom:.4f}..{top:.4f} V, {outside:.4f} V outside the driver's "
                f"0..{drive.v_max:g} V; {fits}, or at this offset a line of about {size:.4g} nm",
            )
            return
        ends = sorted((converter.code(bottom), converter.code(top)))
        last = (1 << converter.bits) - 1
        if ends[0] < -0.5 or ends[1] >= last + 0.5:
            dac, amplifier = self._setup.scan.dac, self._setup.scan.amplifier
            volts = sorted((v - amplifier.bias_v) / amplifier.gain for v in (bottom, top))
            highest = dac.v_max - (dac.v_max - dac.v_min) / float(last + 1)
            beyond = max(dac.v_min - volts[0], volts[1] - highest)
            self._add(
                "amplifier.gain",
                f"the {self._axis} drive of {bottom:.4f}..{top:.4f} V needs {volts[0]:.4f}..{volts[1]:.4f} V of the "
                f"converter, {beyond:.4g} V beyond its {dac.v_min:g}..{highest:.6g} V; "
                f"change gain or bias_v, or scan less",
            )
        if abs(ends[1] - ends[0]) < 2.0:
            self._add(
                f"{self._axis}.{'size_v' if self._scan.size_v is not None else 'size_nm'}",
                f"the drive of {down + up:.4g} V is {ends[1] - ends[0]:.3g} codes of the converter, which cannot "
                f"draw a line; scan more, or use more dac.bits or less amplifier.gain",
            )

    def max_step(self, drive: Drive, converter: Converter, series: FourierSeries, rate_hz: float, period: int) -> int:
        """The slew guard in codes a tick: the amplifier's slew rate, or twice the steepest step of the line."""
        slope = drive.v_amplitude * series.peak_slope()
        # Rounding can add one code, and the chord of a step is never steeper than the steepest slope.
        steepest = ceil(slope / abs(converter.v_per_code) / period) + 1
        last = (1 << converter.bits) - 1
        amplifier, timing = self._setup.scan.amplifier, self._setup.scan.timing
        slew = amplifier.max_slew_v_per_s
        if slew is None:
            return min(2 * steepest, last)
        allowed = min(floor(slew / self._setup.scan.dac.update_rate_hz / abs(converter.v_per_code)), last)
        asked = slope * rate_hz
        if not self._steps and asked > slew:
            times = asked / slew
            self._add(
                "timing.line_rate_hz",
                f"the {self._axis} drive slews at {asked:.4g} V/s, {times:.3g} times the amplifier's {slew:.4g} V/s; "
                f"about {timing.line_rate_hz / times:.4g} Hz or {drive.size_nm / times:.4g} nm would fit",
            )
        elif steepest > allowed:
            self._add(
                "y.motion" if self._steps else "amplifier.max_slew_v_per_s",
                f"the {self._axis} axis steps by up to {steepest} codes in one tick, {slew:.4g} V/s allow {allowed}; "
                + ("use motion = 'ramp'" if self._steps else "raise update_rate_hz, or scan less or slower"),
            )
        return max(allowed, 1)
