"""The gentlest waveform that keeps a scaling error on an operator.

Turns decide what the loop of an operator is, and the loop decides what is straight. So a waveform is learnt, then one
of less acceleration is found that is the same in the windows but for some error; another is learnt from that on, whose
turns are nearly those, and from it the gentlest again. The error of a learnt waveform itself, where the harmonics do
not make what the loop needs, counts as well.
"""

from dataclasses import dataclass
from math import ceil

from tablegen.base.figures import at_least
from tablegen.compensation.line import WholeLine
from tablegen.compensation.operator.operator import Operator
from tablegen.compensation.operator.scan_line import Found, Linear, ThroughInverse, Wanted, find_waveform
from tablegen.waveform.minimum_acceleration import Straightness, Unreachable, least_percent, minimum_acceleration_series
from tablegen.waveform.series import FourierSeries

_ROUNDS = 2  # a third changes nothing that shows
_TRIALS = 3
_LEAST_SHARE = 0.1  # of the error that is asked for, left for the sake of acceleration
_ROUNDING = 2.0**20
_MARGIN = 1.2  # of an error that is said to be enough: another waveform makes another loop


@dataclass(frozen=True, eq=False)
class Gentle:
    """The waveform, the ``learnt`` one beside which it is, and its scaling error beside that, percent."""

    found: Found
    learnt: FourierSeries
    beside_percent: float


def gentlest_waveform(
    operator: Operator, wanted: Wanted, found: Found, percent: float, inverse: ThroughInverse, dynamics: Linear | None
) -> Gentle:
    """The waveform of least acceleration, in place of the learnt ``found``, with ``percent`` of scaling error at most.

    Raises ``Unreachable`` where the harmonics cannot be so straight, ``Unphysical`` as ``find_waveform`` does.
    """
    for _ in range(_ROUNDS):
        share = percent - _scaling(wanted, found)
        found = find_waveform(operator, wanted, _gentle(wanted, found, share, percent), inverse, dynamics)
    share = percent - _scaling(wanted, found)
    for _ in range(_TRIALS):
        played = find_waveform(operator, wanted, _gentle(wanted, found, share, percent), inverse, dynamics, learn=False)
        beyond = _scaling(wanted, played) - percent
        if beyond <= 0.0:
            return Gentle(played, found.series, share)
        share -= 1.5 * beyond
    raise _unreachable(wanted, found)


def _gentle(wanted: Wanted, learnt: Found, share: float, percent: float) -> FourierSeries:
    """The gentlest waveform that is ``share`` beside a learnt one, where that is enough of ``percent``."""
    if share < _LEAST_SHARE * percent:
        raise _unreachable(wanted, learnt)
    try:
        return minimum_acceleration_series(_straightness(wanted, learnt), learnt.series.harmonics, share)
    except Unreachable:
        raise _unreachable(wanted, learnt) from None


def _straightness(wanted: Wanted, learnt: Found) -> Straightness:
    line = WholeLine.of(learnt.series, wanted.turn)
    return Straightness(line, line, wanted.window, wanted.both)


def _scaling(wanted: Wanted, found: Found) -> float:
    """The worse of the directions that image, percent, rounded up: the last bits of a figure must not turn a word."""
    worst = max(found.expected.scaling) if wanted.both else found.expected.scaling[0]
    return ceil(worst * _ROUNDING) / _ROUNDING


def _unreachable(wanted: Wanted, learnt: Found) -> Unreachable:
    """What can be had: the error that was learnt, and beside it what there are harmonics for."""
    left, harmonics = _scaling(wanted, learnt), learnt.series.harmonics
    percent = _MARGIN * (left + max(left, least_percent(_straightness(wanted, learnt), harmonics)))
    allow = f"allow at least {at_least(percent, 2)} %, or " if percent <= 10.0 else ""
    why = f"{harmonics} harmonics do not keep this scaling error on the operator; {allow}take more harmonics"
    return Unreachable(why, percent)
