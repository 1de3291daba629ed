"""The number of harmonics that an allowed scaling error needs, and the remedies where there are too few."""

from collections.abc import Callable
from dataclasses import dataclass

from tablegen.base.figures import at_least
from tablegen.base.input_errors import Unphysical
from tablegen.compensation.hysteresis import BranchShape
from tablegen.compensation.line import LineShape
from tablegen.config.schema import BandLimit
from tablegen.waveform.error_allowance import AllowedError
from tablegen.waveform.minimum_acceleration import Straightness, Unreachable, fewest_harmonics, least_percent
from tablegen.waveform.refined import RefinedShape
from tablegen.waveform.series import FourierSeries


def straightness(shape: LineShape, limit: BandLimit, layer: FourierSeries | None = None) -> Straightness:
    """Return where a line has to be straight."""
    target = shape if layer is None else RefinedShape(shape, layer)
    return Straightness(shape, target, limit.window, limit.directions == "both")


def plain_line(turn: float) -> LineShape:
    """Return a straight line, which the line of every model is near."""
    return LineShape(turn, BranchShape(), BranchShape())


@dataclass(frozen=True)
class EnoughHarmonics:
    """The choice for one axis: ``usual`` unless more are needed, or the fewest; from ``least`` to ``most``."""

    limit: BandLimit
    usual: int
    least: int
    most: int

    def of(self, straight: Straightness, allowed: AllowedError) -> int:
        """Return how many harmonics keep the error.

        Raises
        ------
        Unphysical
            If ``most`` harmonics do not keep it.
        """
        percent, count = allowed.percent, None
        if self.limit.harmonics == "fewest":
            count = fewest_harmonics(straight, percent, self.least, self.most)
        elif keeps(straight, self.usual, percent):
            count = self.usual
        elif self.usual < self.most:
            count = fewest_harmonics(straight, percent, self.usual + 1, self.most)
        if count is None:
            if straight.up_to_its_turns:
                raise Unphysical("an end of the line is imaged, where it turns; image a narrower window")
            least = least_percent(straight, self.most)
            raise Unphysical(f"{self.most} harmonics, the most there can be here, {_leave(least)}")
        return count


def keeps(straight: Straightness, harmonics: int, percent: float) -> bool:
    """Return True if that many harmonics keep an error."""
    try:
        return least_percent(straight, harmonics, percent) <= percent
    except Unphysical:
        return False


def with_remedies(
    reason: Unreachable, straight: Straightness, percent: float, harmonics: int, most: int, named: Callable[[int], str]
) -> Unphysical:
    """Return the reason why that many harmonics do not keep an error, with the remedies.

    Parameters
    ----------
    named
        Returns how the scan file asks for a number of harmonics.
    """
    if reason.least_percent is None:
        return reason
    needed = fewest_harmonics(straight, percent, harmonics + 1, most) if harmonics < most else None
    more = "" if needed is None else f", or take {named(needed)}"
    return Unphysical(f"{harmonics} harmonics {_leave(reason.least_percent)}{more}")


def _leave(percent: float) -> str:
    text = f"leave {at_least(percent, 3)} % of scaling error in this window; allow that much"
    return text if percent <= 10.0 else f"{text.rsplit(';', 1)[0]}; image a narrower one"
