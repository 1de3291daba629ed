"""Refuse measurements that cannot all be in V at the piezo and nm, before an operator is fitted to them."""

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.calibration.operator.periodic_line import PeriodicLine

_LEAST_STROKE = 0.05  # of v_max: least stroke of the largest trace
_MOST_RATIO = 3.0  # of the sensitivities of two measurements, or of one and the scanner file


class Measurement(Protocol):
    """A settled line, or a record of any drive."""

    @property
    def name(self) -> str:
        """The name in messages."""

    @property
    def stroke(self) -> float:
        """The stroke of the drive, peak to peak, as a share of v_max."""

    @property
    def span_nm(self) -> float:
        """The stroke of the displacement in nm, peak to peak."""


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
    check_alike(lines, "traces")


def check_alike(measurements: Sequence[Measurement], what: str) -> None:
    """Refuse a measurement whose sensitivity is far from that of the others; ``what`` they are, in the plural.

    Raises
    ------
    Unphysical
        If one is refused.
    """
    usual = _usual(measurements)
    for one in measurements:
        ratio = _sensitivity(one) / usual
        if not 1.0 / _MOST_RATIO < ratio < _MOST_RATIO:
            raise Unphysical(
                f"{one.name}: moves {ratio:.3g} times as far for its drive as the other {what} do; are all in "
                "V at the piezo and nm?"
            )


def check_size(measurements: Sequence[Measurement], nm_per_full_scale: float, where: str, what: str = "traces") -> None:
    """Refuse measurements that are far from another calibration of the sensitivity, whose origin is ``where``.

    Raises
    ------
    Unphysical
        If they are refused.
    """
    ratio = _usual(measurements) / nm_per_full_scale
    if not 1.0 / _MOST_RATIO < ratio < _MOST_RATIO:
        raise Unphysical(
            f"the {what} move {ratio:.3g} times as far as {where} says; are they in V at the piezo and nm?"
        )


def _usual(measurements: Sequence[Measurement]) -> float:
    return float(np.median([_sensitivity(one) for one in measurements]))


def _sensitivity(one: Measurement) -> float:
    """Return the sensitivity in nm for the whole of v_max."""
    return one.span_nm / one.stroke
