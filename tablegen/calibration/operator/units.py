"""Refuse lines that cannot all be in V at the piezo and nm, before an operator is fitted to them."""

from collections.abc import Sequence

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.calibration.operator.periodic_line import PeriodicLine

_LEAST_STROKE = 0.05  # of v_max: least stroke of the largest trace
MOST_RATIO = 3.0  # of the sensitivities of two traces, or of a trace and the scanner file


def check_units(lines: Sequence[PeriodicLine]) -> None:
    """Refuse lines that cannot all be in V and nm.

    Raises
    ------
    Unphysical
        If the lines are refused.
    """
    largest = max(line.stroke for line in lines)
    if largest < _LEAST_STROKE:
        raise Unphysical(
            f"the largest drive moves by {100.0 * largest:.2g} % of v_max; is it in volts at the piezo? "
            f"At least {100.0 * _LEAST_STROKE:g} % are needed"
        )
    sensitivities = [sensitivity(line) for line in lines]
    usual = float(np.median(sensitivities))
    for line, one in zip(lines, sensitivities, strict=True):
        if not 1.0 / MOST_RATIO < one / usual < MOST_RATIO:
            raise Unphysical(
                f"{line.name}: moves {one / usual:.3g} times as far for its drive as the other traces do; are all in "
                "V at the piezo and nm?"
            )


def check_size(lines: Sequence[PeriodicLine], nm_per_full_scale: float, where: str) -> None:
    """Refuse lines that are far from another calibration of the sensitivity, whose origin is ``where``.

    Raises
    ------
    Unphysical
        If the lines are refused.
    """
    usual = float(np.median([sensitivity(line) for line in lines]))
    if not 1.0 / MOST_RATIO < usual / nm_per_full_scale < MOST_RATIO:
        raise Unphysical(
            f"the traces move {usual / nm_per_full_scale:.3g} times as far as {where} says; are they in V at the piezo "
            "and nm?"
        )


def sensitivity(line: PeriodicLine) -> float:
    """Return the sensitivity in nm for the whole of v_max."""
    return float(np.ptp(line.displacement_nm)) / line.stroke
