"""How many harmonics an allowed scaling error takes, where the build finds that; and what to say of too few."""

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
    """Where a line has to be straight."""
    asked = shape if layer is None else RefinedShape(shape, layer)
    return Straightness(shape, asked, limit.window, limit.directions == "both")


def plain_line(turn: float) -> LineShape:
    """A straight line, which a model is near."""
    return LineShape(turn, BranchShape(), BranchShape())


@dataclass(frozen=True)
class EnoughHarmonics:
    """The choice for one axis: ``usual`` unless more are needed, or the fewest; from ``least`` to ``most``."""

    limit: BandLimit
    usual: int
    least: int
    most: int

    def of(self, straight: Straightness, allowed: AllowedError) -> int:
        """So many keep the error. Raises ``Unphysical`` where ``most`` do not."""
        percent, found = allowed.percent, None
        if self.limit.harmonics == "fewest":
            found = fewest_harmonics(straight, percent, self.least, self.most)
        elif keeps(straight, self.usual, percent):
            found = self.usual
        elif self.usual < self.most:
            found = fewest_harmonics(straight, percent, self.usual + 1, self.most)
        if found is None:
            if straight.up_to_its_turns:
                raise Unphysical("an end of the line is imaged, where it turns; image a narrower window")
            least = least_percent(straight, self.most)
            raise Unphysical(f"{self.most} harmonics, the most there can be here, {_leave(least)}")
        return found


def keeps(straight: Straightness, harmonics: int, percent: float) -> bool:
    """Whether so many harmonics keep an error."""
    try:
        return least_percent(straight, harmonics, percent) <= percent
    except Unphysical:
        return False


def with_remedies(
    reason: Unreachable, straight: Straightness, percent: float, harmonics: int, most: int, named: Callable[[int], str]
) -> Unphysical:
    """What to say where so many harmonics do not keep an error; ``named`` is how the scan file asks for more."""
    if reason.least_percent is None:
        return reason
    enough = fewest_harmonics(straight, percent, harmonics + 1, most) if harmonics < most else None
    more = "" if enough is None else f", or take {named(enough)}"
    return Unphysical(f"{harmonics} harmonics {_leave(reason.least_percent)}{more}")


def _leave(percent: float) -> str:
    text = f"leave {at_least(percent, 3)} % of scaling error in this window; allow that much"
    return text if percent <= 10.0 else f"{text.rsplit(';', 1)[0]}; image a narrower one"
