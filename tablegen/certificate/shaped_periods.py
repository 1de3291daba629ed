"""Periods of a shaped axis, and the part of their errors that arrives in the position.

Shaped codes err by more than rounded ones, at frequencies that the piezo does not follow. So they are judged behind the
response of the axis; where none is known, in the band of the harmonics that are played.
"""

from functools import cached_property
from math import sqrt

import numpy as np
from msgspec import Struct

from tablegen.compensation.dynamics import Measured, SecondOrder
from tablegen.fixedpoint.program import Program
from tablegen.numerics.arrays import Floats, Ints
from tablegen.planning.line_plan import LinePlan

MOST_TICKS = 1 << 20  # ticks of one period that are judged
_SEVERAL_TICKS = 1 << 18  # of several periods together
_PERIODS = 17  # at most; of several the first is left out, in which the response settles


class Passage(Struct, frozen=True):
    """The response that the position has: second order, measured, or a band from 0 Hz.

    Fields that do not apply are None.
    """

    band_hz: float | None = None
    frequency_hz: float | None = None
    quality: float | None = None
    delay_s: float | None = None
    response: Measured | None = None

    @classmethod
    def of(cls, line: LinePlan) -> "Passage":
        """Return the passage of an axis.

        Raises
        ------
        TypeError
            If the axis has a response of an unknown kind.
        """
        match line.drive.response:
            case None:
                return cls(band_hz=line.series.harmonics * float(line.rate))
            case SecondOrder() as second:
                return cls(frequency_hz=second.frequency_hz, quality=second.quality, delay_s=second.delay_s)
            case Measured() as measured:
                return cls(response=measured)
        raise TypeError(f"{type(line.drive.response)} is no response of a scanner file")  # pragma: no cover


class Changes(Struct, frozen=True):
    """The rate of changes of a converter's codes, in percent of the ticks, and their mean size in codes."""

    percent: float
    mean_step: float

    @classmethod
    def of(cls, codes: Ints) -> "Changes":
        """Return the changes of consecutive codes.

        Parameters
        ----------
        codes
            One a tick, shape (n,), n >= 1.

        Returns
        -------
        Changes
            Share of the n - 1 steps, and mean size of those that are not 0.
        """
        steps = np.abs(np.diff(codes))
        count = int(np.count_nonzero(steps))
        share = count / max(len(steps), 1)
        return cls(100.0 * share, float(np.sum(steps)) / count if count else 0.0)

    @property
    def travel(self) -> float:
        """The mean change of all ticks, in codes."""
        return 0.01 * self.percent * self.mean_step


class ShapedPeriods:
    """The periods of a shaped axis since its program began; ``codes`` has the shape (periods, ticks).

    ``target_codes`` are the unrounded codes of a period; of a period that is too long, both are its beginning.
    """

    def __init__(self, line: LinePlan, target_codes: Floats) -> None:
        program = line.program
        self._line, self._target_codes = line, target_codes
        ticks = len(target_codes)
        self.is_whole = ticks == program.ticks
        periods = max(1, min(_PERIODS, _SEVERAL_TICKS // ticks))
        self.codes = program.played(0, periods * ticks).reshape(periods, ticks)
        self._rounded = program.rounded.codes(np.arange(ticks, dtype=np.int64))
        self._counted = slice(1 if periods > 1 else 0, None)

    @classmethod
    def target_ticks(cls, program: Program) -> int:
        """Return the number of ticks of a period whose unrounded codes are needed."""
        return min(program.ticks, MOST_TICKS)

    @property
    def ticks(self) -> int:
        """The number of ticks of the judged periods."""
        return len(self.judged_codes)

    @property
    def code_errors(self) -> Floats:
        """The emitted less the unrounded codes of the judged periods.

        Returns
        -------
        Floats
            LSB of the converter, shape (periods, ticks).
        """
        return np.asarray(self.codes[self._counted] - self._target_codes)

    @cached_property
    def position_errors(self) -> Floats:
        """The errors of the position in the judged periods.

        Returns
        -------
        Floats
            LSB of the converter, shape (periods, ticks).
        """
        return self._arrived(self.codes)

    @cached_property
    def rounded_errors(self) -> Floats:
        """The errors of the position in the judged periods if codes were rounded instead of shaped.

        Returns
        -------
        Floats
            LSB of the converter, shape (periods, ticks).
        """
        return self._arrived(np.tile(self._rounded, (len(self.codes), 1)))

    @property
    def judged_codes(self) -> Ints:
        """The codes of the judged periods.

        Returns
        -------
        Ints
            One period after another, shape (periods * ticks,).
        """
        return self.codes[self._counted].reshape(-1)

    @property
    def changes(self) -> Changes:
        """The changes of the shaped codes."""
        return Changes.of(self.judged_codes)

    @property
    def rounded_changes(self) -> Changes:
        """The changes of the codes without shaping."""
        return Changes.of(np.tile(self._rounded, self.ticks // len(self._rounded)))

    def _arrived(self, codes: Ints) -> Floats:
        errors = (codes - self._target_codes).reshape(-1)
        return errors_behind_response(self._line, errors).reshape(codes.shape)[self._counted]


def errors_behind_response(line: LinePlan, errors: Floats) -> Floats:
    """Return the position errors of code errors that begin from rest.

    Parameters
    ----------
    errors
        LSB of the converter, one a tick, shape (n,).

    Returns
    -------
    Floats
        LSB of the converter, shape (n,).
    """
    size = 1 << (2 * len(errors) - 1).bit_length()
    f: Floats = np.arange(size // 2 + 1, dtype=np.float64) * (float(line.rate) * line.program.ticks / size)
    spectrum = np.fft.rfft(errors, size)
    response = line.drive.response
    if response is None:
        spectrum[f > line.series.harmonics * float(line.rate)] = 0.0
    else:
        known = f <= response.highest_hz
        real, imaginary = response.inverse(f[known])
        spectrum[known] /= real + 1j * imaginary
        spectrum[~known] = 0.0
    position: Floats = np.fft.irfft(spectrum, size)[: len(errors)]
    return position


def largest_and_rms(errors: Floats) -> tuple[float, float]:
    """Return the largest magnitude, and the root of the mean square.

    Parameters
    ----------
    errors
        Any shape, not empty.

    Returns
    -------
    largest, rms
        In the unit of ``errors``.
    """
    return float(np.max(np.abs(errors))), sqrt(float(np.mean(errors * errors)))
