"""The gentlest waveform that keeps a scaling error on an operator.

Turns decide what the loop of an operator is, and the loop decides what is straight. So a waveform is learnt, then one
of less acceleration is found that is the same in the windows but for the error that is allowed; another is learnt from
that on, whose turns are nearly those, and from it the gentlest again.
"""

from tablegen.compensation.line import WholeLine
from tablegen.compensation.operator.operator import Operator
from tablegen.compensation.operator.scan_line import Found, Linear, ThroughInverse, Wanted, find_waveform
from tablegen.waveform.gentle_fit import Straightness, gentlest
from tablegen.waveform.series import FourierSeries

_ROUNDS = 2  # a third changes nothing that shows


def gentlest_waveform(
    operator: Operator, wanted: Wanted, found: Found, percent: float, inverse: ThroughInverse, dynamics: Linear | None
) -> tuple[Found, FourierSeries]:
    """The waveform of least acceleration in place of the learnt ``found``, ``percent`` of scaling error beside that.

    The second is the learnt one beside which it is.

    Raises ``Unreachable`` where the harmonics cannot be so straight, ``Unphysical`` as ``find_waveform`` does.
    """
    for _ in range(_ROUNDS):
        gentle = _gentle(wanted, found.series, percent)
        found = find_waveform(operator, wanted, gentle, inverse, dynamics)
    gentle = _gentle(wanted, found.series, percent)
    return find_waveform(operator, wanted, gentle, inverse, dynamics, learn=False), found.series


def _gentle(wanted: Wanted, learnt: FourierSeries, percent: float) -> FourierSeries:
    line = WholeLine.of(learnt, wanted.turn)
    return gentlest(Straightness(line, line, wanted.window, wanted.both), learnt.harmonics, percent)
