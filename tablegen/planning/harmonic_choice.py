"""The number of harmonics of an axis: as written, as a cutoff passes, or as an allowed scaling error needs."""

from fractions import Fraction
from typing import TYPE_CHECKING

from tablegen.base.figures import at_least
from tablegen.base.input_errors import Problems, Unphysical
from tablegen.config.load import Setup
from tablegen.config.schema import FastAxis
from tablegen.planning.allowed_error import chosen_by_build
from tablegen.planning.drive import Drive
from tablegen.planning.feasibility import Feasibility
from tablegen.waveform.error_allowance import AllowedError
from tablegen.waveform.series import FourierSeries

if TYPE_CHECKING:
    from tablegen.waveform.minimum_acceleration import Straightness


class HarmonicChoice:
    """The choice for one axis ("x" or "y") that advances ``period`` times a period of a rate in Hz.

    ``usual`` is the highest harmonic as written or by default, ``most`` the highest that a build may choose.
    """

    def __init__(
        self, setup: Setup, axis: str, rate: Fraction, period: int, feasible: Feasibility, problems: Problems
    ) -> None:
        scan: FastAxis = getattr(setup.scan, axis)
        self._limit, self._turn, self._rate = scan.band_limit, scan.turn, rate
        self._file, self._problems = setup.scan_file, problems
        self.usual = feasible.harmonics(rate, period)
        self.most = feasible.most_harmonics(period)
        layer = 1 if scan.refinement is None else len(scan.refinement.a)
        self._least = min(layer, self.most)
        written = "harmonics" if self._limit.max_scaling_error_percent is None else "max_scaling_error_percent"
        self.key = f"{axis}.band_limit.{written}"

    def for_straight_line(self, allowed: AllowedError | None) -> int:
        """Return the highest harmonic for a model that makes the whole waveform itself."""
        if allowed is not None and chosen_by_build(self._limit):
            from tablegen.planning.enough_harmonics import plain_line, straightness  # here: few builds search

            with self._problems.at(self._file, self.key):
                return self._enough(straightness(plain_line(self._turn), self._limit), allowed)
        return self.usual

    def for_drive(self, drive: Drive, straight: int) -> int:
        """Return the highest harmonic for the shape of a drive, where ``straight`` is enough for a straight line."""
        if drive.allowed is not None and drive.shape.whole is None and chosen_by_build(self._limit):
            from tablegen.planning.enough_harmonics import straightness

            with self._problems.at(self._file, self.key):
                return self._enough(straightness(drive.shape, self._limit), drive.allowed)
        return straight

    def with_advice(self, drive: Drive, harmonics: int, layer: FourierSeries | None, reason: Unphysical) -> Unphysical:
        """Return the reason why that many harmonics do not keep the allowed error, with the number that does."""
        from tablegen.planning.enough_harmonics import straightness, with_remedies
        from tablegen.waveform.minimum_acceleration import Unreachable

        if not isinstance(reason, Unreachable) or drive.allowed is None:
            return reason

        def named(n: int) -> str:
            by_count = self._limit.cutoff_hz is None
            return f"{n} harmonics" if by_count else f"cutoff_hz = {at_least(n * float(self._rate), 6)}"

        straight = straightness(drive.shape, self._limit, layer)
        return with_remedies(reason, straight, drive.allowed.percent, harmonics, self.most, named)

    def _enough(self, straight: "Straightness", allowed: AllowedError) -> int:
        from tablegen.planning.enough_harmonics import EnoughHarmonics

        return EnoughHarmonics(self._limit, self.usual, self._least, self.most).of(straight, allowed)
