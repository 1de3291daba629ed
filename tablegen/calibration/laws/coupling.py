"""Coupling of the axes as a fit of images or records has it, with what it leaves open."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from tablegen.base.warnings import Remark, spoils
from tablegen.fitting.estimate import Estimate
from tablegen.numerics.arrays import Floats

MOST_COUPLING = 0.5  # of the scanner file
_LOOSE = 0.005  # standard error of a coupling: 0.5 % of the frame


@dataclass(frozen=True, eq=False)
class CouplingFit:
    """Coupling by images or by records; what was not determined is None.

    ``directions_deg`` are those of lines and columns of each image against the scan angle, shape (images, 2), and
    ``fitted_deg`` those of the fit. ``drift`` along x and y is in the unit ``drift_unit``; ``size_ratio`` is by
    how much y is too long against x. ``lies_deg`` is where the first side of the sample's cell lies from x.
    """

    x_per_y: Estimate | None
    y_per_x: Estimate | None
    remarks: tuple[Remark, ...]
    directions_deg: Floats = field(default_factory=lambda: np.zeros((0, 2)))
    fitted_deg: Floats = field(default_factory=lambda: np.zeros((0, 2)))
    drift: tuple[Estimate, Estimate] | None = None
    drift_unit: str = ""
    size_ratio: Estimate | None = None
    shear_alone: bool = False

    @property
    def values(self) -> dict[str, Estimate]:
        """What was determined, by the keys of the scanner file."""
        both = {"x_per_y": self.x_per_y, "y_per_x": self.y_per_x}
        return {key: one for key, one in both.items() if one is not None}

    @property
    def doubts(self) -> tuple[str, ...]:
        """Reasons why the fit is meaningless; empty for one that can be written."""
        measured = [one for key, one in self.values.items() if not (self.shear_alone and key == "y_per_x")]
        if any(abs(one.value) > 2.0 * one.standard_error for one in measured):
            return ()
        largest = max(2.0 * one.standard_error for one in measured)
        return (f"no coupling is seen: it is below two standard errors, {largest:.2g}; the axes need none",)


def loose_remarks(*estimates: Estimate | None) -> list[Remark]:
    """Return a remark if a coupling is uncertain."""
    worst = max((one.standard_error for one in estimates if one is not None), default=0.0)
    if worst <= _LOOSE:
        return []
    text = f"the coupling is uncertain by {worst:.2g}: scan more cells, or average"
    return [spoils(text, 100.0 * worst, code="undetermined-parameter")]


def onto_earlier(remaining: Mapping[str, Estimate], earlier: tuple[float, float]) -> dict[str, Estimate]:
    """Return the coupling of axes whose images were taken with an earlier one undone, and still show another.

    Parameters
    ----------
    remaining
        Both values of the images.
    earlier
        x_per_y and y_per_x that were undone.
    """
    rest = np.array([[1.0, remaining["x_per_y"].value], [remaining["y_per_x"].value, 1.0]])
    whole = rest @ np.array([[1.0, earlier[0]], [earlier[1], 1.0]])
    values = {"x_per_y": whole[0, 1] / whole[1, 1], "y_per_x": whole[1, 0] / whole[0, 0]}
    return {key: Estimate(float(value), remaining[key].standard_error) for key, value in values.items()}
