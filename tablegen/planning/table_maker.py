"""Quantise a waveform into the integers of a table of given shape."""

from functools import cached_property
from math import ceil, sqrt

import numpy as np
from msgspec import Struct, field
from msgspec.structs import replace

from tablegen.fixedpoint.converter import fit_gain, scaled_output
from tablegen.fixedpoint.output import Output
from tablegen.fixedpoint.phase import RationalPhase
from tablegen.fixedpoint.program import Program, sample_gain
from tablegen.fixedpoint.spline_words import spline_factors
from tablegen.fixedpoint.synthesis import FourierWords, encode, synthesize
from tablegen.fixedpoint.table_shape import TableShape
from tablegen.waveform.series import FourierSeries

# Peaks are rounded up to this grid before they enter the scale: it then does not depend on the last bit of a maximum.
_PEAK_GRID = 1024


def steepest_step(codes_per_unit: float, series: FourierSeries, period: int, hold: int) -> float:
    """Return the largest step of a tick in codes, without rounding, of a waveform over a period of advances.

    It is 0 where an advance takes several ticks: such an axis moves in one of many.
    """
    return abs(codes_per_unit) * series.peak_slope() / period if hold == 1 else 0.0


class QuantisedTable(Struct, frozen=True, eq=False):
    """A program with its table, the Fourier words of the table, and the scale of both."""

    program: Program
    fourier: FourierWords
    scale: float


class StoredWave(Struct, frozen=True, eq=False, dict=True):
    """The waveform whose values are the words of a table."""

    series: FourierSeries

    @cached_property
    def reach(self) -> tuple[float, float]:
        """The least and the greatest value of the waveform."""
        if self.series.harmonics == 1:  # a grid of so few points misses the peaks of a sine by up to half a percent
            a, b = float(self.series.a[0]), float(self.series.b[0])
            peak = sqrt(a * a + b * b)
            return self.series.a0 - peak, self.series.a0 + peak
        w = self.series.on_grid(32 * self.series.harmonics)
        return float(np.min(w)), float(np.max(w))

    @property
    def largest(self) -> float:
        """The largest |2 w - 1|, at least 1: tables are scaled to it."""
        return max(1.0, *(abs(2.0 * w - 1.0) for w in self.reach))


class TableMaker(Struct, frozen=True, eq=False):
    """One axis without its table: what is the same for every shape of table.

    ``amplitude`` is in codes for 2 w - 1 = 1, negative where the axis is inverted; ``offset`` the code of w = 1/2,
    unrounded. ``output`` has the limits; its gain is not used.
    """

    series: FourierSeries
    amplitude: float
    offset: float
    phase: RationalPhase
    hold: int
    output: Output
    _stored: dict[int, StoredWave] = field(default_factory=dict)  # by the words of a spline, 0 for the waveform itself

    @property
    def original(self) -> StoredWave:
        """The waveform itself."""
        return self._stored_by(0)

    @property
    def steepest(self) -> float:
        """The largest step of a tick in codes, without rounding; 0 where an advance takes several ticks."""
        return steepest_step(2.0 * self.amplitude, self.series, self.phase.ticks, self.hold)

    def stored(self, shape: TableShape) -> StoredWave:
        """Return the wave whose values the words of a shape are: the waveform, or the spline nearest to it."""
        return self._stored_by(shape.length if shape.mode == "cubic" else 0)

    def _stored_by(self, length: int) -> StoredWave:
        if length not in self._stored:
            factors = spline_factors(self.series.harmonics, length) if length else None
            self._stored[length] = StoredWave(self.series if factors is None else self.series.times(*factors))
        return self._stored[length]

    def gain(self, shape: TableShape) -> tuple[int, float]:
        """Return the gain word of a shape, and the scale of its table."""
        peak = ceil(self.stored(shape).largest * _PEAK_GRID) / _PEAK_GRID
        return fit_gain(sample_gain(shape.mode) * self.amplitude, peak, shape.bits, self.output.dac_bits)

    def quantise(self, shape: TableShape) -> QuantisedTable:
        """Return the table of a shape."""
        scale = self.gain(shape)[1]
        stored = self.stored(shape).series
        fourier = encode(stored.a0, stored.a, stored.b, scale)
        words = synthesize(fourier, shape.length, shape.bits)
        program = Program(self.phase, self.hold, shape.mode, shape.bits, words, self.scaled(shape))
        return QuantisedTable(program, fourier, scale)

    def scaled(self, shape: TableShape) -> Output:
        """Return the output stage with the gain of a shape."""
        return scaled_output(self.output, self.offset, shape.bits, self.gain(shape)[0])

    def limited(self, max_step: int) -> "TableMaker":
        """Return the maker with another slew guard, in codes a tick."""
        return replace(self, output=replace(self.output, max_step=max_step))
