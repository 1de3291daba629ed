"""The choice of the shaping of an axis: the one that ``dac.shaping`` names, or the one that leaves the least error.

The error of a rounding is taken as white; behind the noise filter and the response it leaves a mean square that is a
sum over frequencies. Only basic operations are used, since the choice decides emitted codes.
"""

from itertools import pairwise

import numpy as np

from tablegen.base.input_errors import Problems
from tablegen.compensation.dynamics import Response
from tablegen.config.load import Setup
from tablegen.fixedpoint.shaping import MAXIMUM_ZERO, OFF, ZERO_BITS, Shaping
from tablegen.numerics.arrays import Floats, tree_sum
from tablegen.numerics.turns import cosine
from tablegen.planning.drive import Drive

_NAMED = {"off": OFF, "first": Shaping(1), "second": Shaping(2)}
_CANDIDATES = (Shaping(1), Shaping(2), *(Shaping(3, zero) for zero in range(MAXIMUM_ZERO + 1)))
_POINTS = 512  # of a stretch of frequencies
_NEAR = 8.0  # half widths of the resonance that the first stretches are long; each further one is 4 times as long
_WIDER = 4.0


def chosen_shaping(setup: Setup, axis: str, drive: Drive, problems: Problems) -> Shaping:
    """Return the shaping of one axis ("x" or "y"); off, and a problem, where it needs a response that is not known.

    An axis at rest is not shaped: its code would change for ever to represent a value between two codes.
    """
    dac = setup.hardware(axis).dac
    if drive.resting:
        return OFF
    if dac.shaping != "scanner":
        return _NAMED[dac.shaping]
    if drive.response is None:
        problems.note(
            setup.hardware_problem(
                axis,
                "dac.shaping",
                f"'scanner' goes by the response of the {axis} axis, and the scanner file has no [{axis}.resonance]: "
                f"calibrate it (`tablegen calibrate resonance --axis {axis}`); or take 'first' or 'second', which need "
                f"none, for {axis} alone as the shaping of [{axis}.dac] in the scanner file",
            )
        )
        return OFF
    return best_shaping(drive.response, dac.update_rate_hz)


def best_shaping(response: Response, update_rate_hz: float) -> Shaping:
    """Return the order and the zero that leave the least mean square behind a response; the lowest of equal orders."""
    power, c = _transmitted(response, update_rate_hz)
    # |1 - z^-1|^2 = 2 - 2 cos, and |1 - a z^-1 + z^-2|^2 = (2 cos - a)^2 on the unit circle.
    at_rest = power * (2.0 - 2.0 * c)

    def mean_square(shaping: Shaping) -> float:
        if shaping.order == 1:
            return float(tree_sum(at_rest))
        if shaping.order == 2:
            return float(tree_sum(at_rest * (2.0 - 2.0 * c)))
        pair = 2.0 * c - shaping.zero / (1 << ZERO_BITS)
        return float(tree_sum(at_rest * (pair * pair)))

    return min(_CANDIDATES, key=mean_square)


def _transmitted(response: Response, update_rate_hz: float) -> tuple[Floats, Floats]:
    """Return the power that a response passes at frequencies up to half the update rate, and the cosine of their angle.

    The power is weighted by the width of its stretch; stretches are short about the resonance, so as not to miss it.
    Frequencies at which the response is not known count as not passed.
    """
    highest = min(0.5 * update_rate_hz, response.highest_hz)
    edges = {0.0, highest}
    away = _NEAR * response.half_width_hz
    while away < highest:
        edges |= {edge for edge in (response.resonance_hz - away, response.resonance_hz + away) if 0.0 < edge < highest}
        away *= _WIDER
    ends = sorted(edges)
    steps = [(stop - first) / _POINTS for first, stop in pairwise(ends)]
    middles = np.arange(_POINTS) + 0.5
    f = np.concatenate([first + step * middles for first, step in zip(ends[:-1], steps, strict=True)])
    real, imaginary = response.inverse(f)
    return np.repeat(np.array(steps), _POINTS) / (real * real + imaginary * imaginary), cosine(f / update_rate_hz)
