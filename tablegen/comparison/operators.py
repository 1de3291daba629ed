"""The compared quantities of an operator: its numbers, and its lines where either side was measured."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.comparison.quantity import ComparedQuantity, keys_of
from tablegen.compensation.operator.file import OperatorFile, read_operator
from tablegen.compensation.operator.loop import POINTS, Loop
from tablegen.compensation.operator.operator import Operator
from tablegen.compensation.operator.uncertainty import possible_errors
from tablegen.numerics.arrays import Floats
from tablegen.numerics.driver import Driver

_WINDOW = (0.1, 0.9)  # of the drive, in which shapes are compared
_DEVIATIONS = 1.645  # standard errors within which 90 % are: the level of uncertainties of operators
SIDES = ("forward", "backward")
Place = tuple[float, float]  # stroke and centre, V


@dataclass(frozen=True, eq=False)
class ComparedOperator:
    """An operator, and the file that has it."""

    operator: Operator
    file: OperatorFile

    @classmethod
    def read(cls, path: Path) -> "ComparedOperator":
        """Read an operator file.

        Raises
        ------
        Rejected
            If it cannot be read.
        """
        return cls(*read_operator(path, str(path)))

    @property
    def places(self) -> list[Place]:
        """Strokes and centres of its traces in V, to four digits."""
        driver = self.driver
        places = ((driver.span * one.stroke, driver.volts(one.centre)) for one in self.file.lines)
        return list(dict.fromkeys((_short(stroke), _short(centre)) for stroke, centre in places))

    @property
    def driver(self) -> Driver:
        """The range to which its shares refer."""
        return Driver(self.file.v_max, self.file.v_min)

    def shares(self, place: Place) -> tuple[float, float]:
        """Return stroke and centre as shares of the range."""
        return place[0] / self.driver.span, self.driver.share(place[1])

    def loop(self, place: Place) -> Loop | None:
        """Compute the settled loop at a place; None where the operator has none."""
        stroke, centre = self.shares(place)
        low, high = centre - 0.5 * stroke, centre + 0.5 * stroke
        if low < -1e-9 or high > 1.0 + 1e-9:
            return None
        try:
            return self.operator.loop(max(low, 0.0), min(high, 1.0))
        except Unphysical:
            return None


def operator_quantities(one: ComparedOperator, places: Sequence[Place], section: str = "") -> list[ComparedQuantity]:
    """List the numbers of the file except its traces, and size, residual and mismatch of the line at each place.

    Errors are standard errors from the traces that were left out, which hold for 90 % of lines.
    """
    plain = msgspec.to_builtins(one.file)
    tables = {key: value for key, value in plain.items() if key not in ("lines", "axis", "version")}
    quantities = [*keys_of(f"{section}operator", "", {**tables, "traces": len(one.file.lines)}, of_scan=False)]
    for place in places:
        quantities += _line(one, place, section)
    return quantities


def _line(one: ComparedOperator, place: Place, section: str) -> Iterator[ComparedQuantity]:
    loop = one.loop(place)
    if loop is None:
        return
    stroke, centre = one.shares(place)
    rms, _, mismatch, size = (by / _DEVIATIONS for by in possible_errors(one.operator, stroke, centre))
    name = f"{section}line of {place[0]:g} V at {place[1]:g} V"
    yield ComparedQuantity(name, "size", loop.extent_nm, "nm", 0.01 * size * loop.extent_nm)
    both = residuals(loop)
    x = np.arange(POINTS) / (POINTS - 1)
    inside = (x >= _WINDOW[0]) & (x <= _WINDOW[1])
    for side, residual in zip(SIDES, both, strict=True):
        straight = np.polynomial.polynomial.polyfit(x[inside], residual[inside], 1)
        residue = residual[inside] - np.polynomial.polynomial.polyval(x[inside], straight)
        yield ComparedQuantity(name, f"rms residual {side}", float(np.sqrt(np.mean(residue * residue))), "%", rms)
        yield ComparedQuantity(name, f"largest residual {side}", float(residual[np.argmax(np.abs(residual))]), "%")
    largest = float(np.max(np.abs(both[0] - both[1])[inside]))
    yield ComparedQuantity(name, "forward to backward", largest, "%", mismatch)


def residuals(loop: Loop) -> tuple[Floats, Floats]:
    """Return the position less a straight line over the drive.

    Returns
    -------
    Residuals of the rising and of the falling branch in percent of the line, shape (POINTS,) each.
    """
    x = np.arange(POINTS) / (POINTS - 1)
    return 100.0 * (loop.rising - x), 100.0 * (loop.falling - x)


def _short(volts: float) -> float:
    return float(f"{volts:.4g}")
