"""The waveform of minimum acceleration that keeps a scaling error on an operator.

The turns decide the loop of an operator, and the loop decides what is straight. So a waveform is learnt, then one
of less acceleration is computed that is the same in the windows but for some error; another is learnt from that on,
whose turns are nearly those, and from it the one of minimum acceleration again. The error of a learnt waveform itself,
where the harmonics cannot make what the loop needs, counts as well.
"""

from dataclasses import dataclass
from math import ceil

from tablegen.base.figures import at_least
from tablegen.compensation.dynamics import Response
from tablegen.compensation.line import WholeLine
from tablegen.compensation.operator.operator import Operator
from tablegen.compensation.operator.scan_line import LearntWaveform, TargetLine, ThroughInverse, learn_waveform
from tablegen.waveform.minimum_acceleration import Straightness, Unreachable, least_percent, minimum_acceleration_series
from tablegen.waveform.series import FourierSeries

_ROUNDS = 2  # a third changes nothing that shows
_TRIALS = 3
_LEAST_SHARE = 0.1  # of the allowed error, left for the sake of acceleration
_ROUNDING = 2.0**20
_MARGIN = 1.2  # on the error that a message promises to be enough: another waveform makes another loop


@dataclass(frozen=True, eq=False)
class MinimumAccelerationLine:
    """The waveform, the ``straight_series`` one from which it departs, and its scaling error against that, percent."""

    waveform: LearntWaveform
    straight_series: FourierSeries
    beside_percent: float


def minimum_acceleration_waveform(
    operator: Operator,
    target: TargetLine,
    straight: LearntWaveform,
    percent: float,
    inverse: ThroughInverse,
    dynamics: Response | None,
) -> MinimumAccelerationLine:
    """Return the waveform of minimum acceleration, in place of the learnt one, within ``percent`` of scaling error.

    Raises
    ------
    Unreachable
        If the harmonics cannot be so straight.
    Unphysical
        As ``learn_waveform``.
    """
    for _ in range(_ROUNDS):
        share = percent - _scaling(target, straight)
        straight = learn_waveform(
            operator, target, _minimum_acceleration(target, straight, share, percent), inverse, dynamics
        )
    share = percent - _scaling(target, straight)
    for _ in range(_TRIALS):
        played = learn_waveform(
            operator, target, _minimum_acceleration(target, straight, share, percent), inverse, dynamics, learn=False
        )
        beyond = _scaling(target, played) - percent
        if beyond <= 0.0:
            return MinimumAccelerationLine(played, straight.series, share)
        share -= 1.5 * beyond
    raise _unreachable(target, straight)


def _minimum_acceleration(target: TargetLine, straight: LearntWaveform, share: float, percent: float) -> FourierSeries:
    """Return the minimum-acceleration waveform within ``share`` of a straight one, if that is enough of ``percent``."""
    if share < _LEAST_SHARE * percent:
        raise _unreachable(target, straight)
    try:
        return minimum_acceleration_series(_straightness(target, straight), straight.series.harmonics, share)
    except Unreachable:
        raise _unreachable(target, straight) from None


def _straightness(target: TargetLine, straight: LearntWaveform) -> Straightness:
    line = WholeLine.of(straight.series, target.turn)
    return Straightness(line, line, target.window, target.both)


def _scaling(target: TargetLine, straight: LearntWaveform) -> float:
    """Return the worse of the imaging directions, percent, rounded up so that last bits do not change emitted words."""
    worst = max(straight.expected.scaling) if target.both else straight.expected.scaling[0]
    return ceil(worst * _ROUNDING) / _ROUNDING


def _unreachable(target: TargetLine, straight: LearntWaveform) -> Unreachable:
    """Return the error that can be had: that of the learnt waveform, and what the harmonics reach against it."""
    remaining, harmonics = _scaling(target, straight), straight.series.harmonics
    percent = _MARGIN * (remaining + max(remaining, least_percent(_straightness(target, straight), harmonics)))
    allow = f"allow at least {at_least(percent, 2)} %, or " if percent <= 10.0 else ""
    why = f"{harmonics} harmonics do not keep this scaling error on the operator; {allow}take more harmonics"
    return Unreachable(why, percent)
