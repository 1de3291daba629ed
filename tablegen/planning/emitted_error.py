"""The worst error of a program over every tick of its period, the same whole number on every machine.

For a shaped axis it is the error before the rounding that is shaped, which is the part that the table causes.

It is what the certificate measures, from sums in a fixed order, rounded to 2^-16 of a code: the choice of the emitted
table must not depend on the last bits of a transform.
"""

import numpy as np

from tablegen.fixedpoint.program import Program
from tablegen.fixedpoint.rounding import round_half_up, shift_round
from tablegen.fixedpoint.runs import long_runs
from tablegen.fixedpoint.shaping import remainder_bits
from tablegen.numerics.arrays import Floats, Ints
from tablegen.planning.table_maker import TableMaker
from tablegen.waveform.extremes import extreme_points, extreme_ticks
from tablegen.waveform.sampler import Sampler, slow_grid
from tablegen.waveform.series import values

FRACTION_BITS = 16
_SAMPLE_TICKS = 1 << 12
_CHUNK_TICKS = 1 << 20  # computed at a time, to bound memory


class IdealCodes:
    """The unrounded codes of a waveform at its ticks, and the errors of programs against them, in 2^-16 of a code."""

    def __init__(self, maker: TableMaker) -> None:
        self._maker = maker
        series, period, ticks = maker.series, maker.phase.ticks, maker.phase.ticks * maker.hold
        self._sampler = Sampler(series, period, slow_grid)
        grid = slow_grid(series, extreme_points(series))

        def slope_and_bend(t: Floats) -> tuple[Floats, ...]:
            """Return the first and the second derivative of the waveform.

            Returns
            -------
            tuple of Floats
                Per period and per period^2, each of the shape of ``t``.
            """
            return values(t, (series, 1), (series, 2))

        self._extremes = extreme_ticks(grid, slope_and_bend, ticks)
        count = min(period, _SAMPLE_TICKS)
        self._sample = np.arange(count, dtype=np.int64) * period // count * maker.hold
        self._sample_codes = self._at(self._sample)

    def _at(self, k: Ints) -> Ints:
        maker = self._maker
        w = self._sampler.at(k // maker.hold)
        codes: Floats = maker.offset + 2.0 * maker.amplitude * (w - 0.5)
        return round_half_up(codes * float(1 << FRACTION_BITS))

    def least_error(self, program: Program) -> int:
        """Return the worst error over a sample of ticks, a lower bound of ``worst_error``."""
        return _largest(_played(program, self._sample), self._sample_codes)

    def worst_error(self, program: Program) -> int:
        """Return the worst error over all ticks."""
        runs = None if program.output.shaping.order else long_runs(program)
        if runs is not None:
            runs = runs.split_at(self._extremes)
            codes = runs.codes << FRACTION_BITS
            return max(_largest(codes, self._at(runs.starts)), _largest(codes, self._at(runs.lasts)))
        advances, worst = program.phase.ticks, 0
        for first in range(0, advances, _CHUNK_TICKS):
            k = np.arange(first, min(first + _CHUNK_TICKS, advances), dtype=np.int64) * program.hold
            worst = max(worst, _largest(_played(program, k), self._at(k)))
        return worst


def _played(program: Program, k: Ints) -> Ints:
    """Return what a program plays at ticks k, in 2^-16 of a code; for a shaped one before the code is rounded."""
    output = program.output
    if not output.shaping.order:
        return program.codes(k) << FRACTION_BITS
    bits = remainder_bits(output.dac_bits)
    fine = output.shaping_input(program.samples(k)) - (1 << (bits - 1))
    return fine << (FRACTION_BITS - bits) if bits <= FRACTION_BITS else shift_round(fine, bits - FRACTION_BITS)


def _largest(played: Ints, ideal: Ints) -> int:
    """Return the largest distance from the ideal codes."""
    return int(np.max(np.abs(played - ideal)))
