"""The possible errors of a prediction in time, sweep by sweep, by the errors of settled lines and the loops in between.

A sweep is as uncertain as a settled line of its stroke and centre, and as the widest line of the record, on whose
branches it lies. An operator of settled traces does not know how a piezo goes from one line to another, which families
do differently: a share of the widest loop's own deviation from a line is possible, more so inside that loop. Records in
time have such ways, and their misfit contains them.

The shares were chosen on simulated piezos; ``benchmarks/expected_of_predictions.py`` checks them on others.
"""

from itertools import pairwise
from math import sqrt

import numpy as np

from tablegen.compensation.operator.in_time import Start, turns_of
from tablegen.compensation.operator.operator import Operator
from tablegen.compensation.operator.uncertainty import loop_shape, possible_errors
from tablegen.numerics.arrays import Floats

_STEP = 0.01  # of the driver's range, to which strokes and centres are rounded; smaller sweeps count as the widest line
_INSIDE = 0.97  # of the widest stroke, below which a sweep is one inside it
_RECORDS_LEVEL = 0.9  # of the errors of lines, for records that are no settled lines
_FROM_REST, _INNER = 0.1, 0.3  # shares of the widest loop's deviation from a line, of an operator of settled traces
_SIZE_SHARE = 0.25  # mean square of a position about its middle, where the size is wrong, over the square of the size


def possible_prediction_errors(operator: Operator, u: Floats, position_nm: Floats, start: Start = Start.REST) -> Floats:
    """Return the rms error in nm of each sweep, for its samples, below which 90 % of predictions stay.

    Parameters
    ----------
    operator
        The operator of the prediction.
    u, position_nm
        Normalised drives and predicted positions, shapes (n,).
    start
        The state before the record.

    Returns
    -------
    Floats
        Shape (n,). Its root mean square over the time is the rms error of the whole record.
    """
    shares: dict[tuple[int, int], float] = {}

    def share(stroke: float, centre: float) -> float:
        at = round(stroke / _STEP), round(centre / _STEP)
        if at not in shares:
            rms, _, _, size = possible_errors(operator, max(at[0], 1) * _STEP, at[1] * _STEP)
            shares[at] = 0.01 * sqrt(rms * rms + _SIZE_SHARE * size * size)
        return shares[at]

    low, high = float(np.min(u)), float(np.max(u))
    stroke, centre = high - low, 0.5 * (low + high)
    rms, _, _, size = possible_errors(operator, stroke, centre)
    widest = 0.01 * float(np.ptp(position_nm)) * sqrt(rms * rms + _SIZE_SHARE * size * size)
    way, level = 0.0, 1.0
    if operator.misfit_percent is None:
        way = _memory_nm(operator, low, high, start)
    elif start is not Start.SETTLED:
        level = _RECORDS_LEVEL
    square = np.full(len(u), widest * widest + (0.0 if start is Start.SETTLED else (_FROM_REST * way) ** 2))
    for begin, end in pairwise(turns_of(u)):
        swept = abs(float(u[end] - u[begin]))
        if swept < _INSIDE * stroke:
            nm = abs(float(position_nm[end] - position_nm[begin]))
            its = share(swept, 0.5 * float(u[begin] + u[end])) * nm if swept >= _STEP else 0.0
            square[begin:end] += its * its + (_INNER * way) ** 2
    if len(u) > 1:
        square[-1] = square[-2]
    return np.asarray(level * np.sqrt(square), dtype=np.float64)


def _memory_nm(operator: Operator, low: float, high: float, start: Start) -> float:
    """Return the rms deviation in nm from a line, of the widest loop that the axis remembers."""
    if start is not Start.SETTLED:
        low, high = min(low, 0.0), max([high, *(line.centre + 0.5 * line.stroke for line in operator.lines)])
    stroke, centre = high - low, 0.5 * (low + high)
    return 0.01 * loop_shape(operator, stroke, centre).rms * operator.family.extent(stroke, centre)
