"""One printed number of the paper beside ours, and whether they are the same: computed, never typed."""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum
from math import inf, isfinite

ABOUT = 0.1  # what "about" leaves open, of the value


class Source(StrEnum):
    """Where our number comes from. This decides how much an agreement shows; what shows most comes first."""

    SIMULATED = "simulation"
    LAW = "law"
    FITTED = "law, fitted"
    ARITHMETIC = "arithmetic"
    IDENTIFIED = "simulation, identified"
    INPUT = "input"


OWN = (Source.IDENTIFIED, Source.INPUT)  # the printed number is the source of ours
MADE_SO = "made so"


@dataclass(frozen=True)
class Printed:
    """A number as the paper prints it, and the range in which another one is the same."""

    text: str
    unit: str
    low: float
    high: float
    decimals: int

    @property
    def within(self) -> str:
        """The range as text."""
        if self.low == self.high:
            return f"{self.low:g}"
        low, high = (f"{value:.{self.decimals + 1}f}" for value in (self.low, self.high))
        if self.low == -inf:
            return f"to {high}"
        return f"from {low}" if self.high == inf else f"{low} .. {high}"

    def agrees(self, value: float) -> bool:
        """Whether a value is the same."""
        return self.low <= value <= self.high


@dataclass(frozen=True)
class Row:
    """The number that a figure or section prints, our number, its source, and ``why`` they differ, if they do.

    ``operator`` is the same of an identified operator, in place of the paper's model. ``decimals`` of our numbers; by
    default one more than the paper's, so that it can be seen by how much they agree.
    """

    figure: str
    what: str
    printed: Printed
    ours: float
    source: Source
    why: str = ""
    decimals: int | None = None
    operator: float | None = None

    @property
    def same(self) -> bool:
        """Whether the numbers agree."""
        return self.printed.agrees(self.ours)

    @property
    def verdict(self) -> str:
        """``same``, or why not; ``made so`` where the printed number is the source of ours."""
        if not self.same:
            return self.why
        return MADE_SO if self.source in OWN else "same"

    @property
    def shown(self) -> float:
        """Our number, rounded as it is shown."""
        return round(self.ours, self._decimals)

    @property
    def ours_text(self) -> str:
        """Our number, with the sign where the paper has one."""
        return self._text(self.ours)

    @property
    def operator_text(self) -> str:
        """The operator's number in the same way; empty where it has none."""
        return "" if self.operator is None else self._text(self.operator)

    def _text(self, value: float) -> str:
        sign = "+" if "+" in self.printed.text else ""
        plus_minus = "±" if "±" in self.printed.text else ""
        return f"{plus_minus}{value:{sign}.{self._decimals}f} {self.printed.unit}".strip()

    @property
    def _decimals(self) -> int:
        return self.printed.decimals + 1 if self.decimals is None else self.decimals


def faults(rows: Iterable[Row]) -> list[str]:
    """Rows with a missing reason, a needless reason, no number, or a rounded number with another verdict."""
    found = []
    for row in rows:
        name = f"{row.figure}, {row.what}: {row.printed.text} in the paper, {row.ours_text} here"
        if not isfinite(row.ours):
            found.append(f"{name}: no number")
        elif row.printed.agrees(row.shown) != row.same:
            found.append(f"{name}: rounded as shown it is on the other side of {row.printed.within}; show more digits")
        elif row.same and row.why:
            found.append(f"{name}: the same, with a reason why not: {row.why}")
        elif not row.same and not row.why:
            found.append(f"{name}: not within {row.printed.within}, without a reason")
    return found


def exact(value: str, unit: str = "", mark: str = "") -> Printed:
    """A plain number: the same to half a unit of its last digit. ``mark`` is a sign that is only shown, as in ±0.5."""
    half = 0.5 * 10.0 ** -_decimals(value)
    return _around(value, unit, mark, half, _decimals(value))


def exactly(value: str, unit: str = "") -> Printed:
    """A number that the paper calls exact: the same to a thousandth of it."""
    return _around(value, unit, "exactly ", 1e-3 * abs(float(value)), _decimals(value) + 2)


def about(value: str, unit: str = "", mark: str = "", before: str = "") -> Printed:
    """About, approximately, ~: to a tenth of it; with three digits or more, to one unit of the last."""
    digits = len(value.lstrip("+-0.").replace(".", ""))
    unit_of_last = 10.0 ** -_decimals(value)
    slack = unit_of_last if digits >= 3 else max(ABOUT * abs(float(value)), 0.5 * unit_of_last)
    return _around(value, unit, f"{before}about {mark}", slack, _decimals(value))


def between(low: str, high: str, unit: str = "", word: str = "") -> Printed:
    """A range, its ends to half a unit of their last digits."""
    half = 0.5 * 10.0 ** -max(map(_decimals, (low, high)))
    text = f"{word}{low} to {high} {unit}".strip()
    return Printed(text, unit, float(low) - half, float(high) + half, max(map(_decimals, (low, high))))


def limits(text: str, unit: str = "", low: float = -inf, high: float = inf, decimals: int = 1) -> Printed:
    """The bounds that a sentence states."""
    return Printed(text, unit, low, high, decimals)


def _around(value: str, unit: str, mark: str, slack: float, decimals: int) -> Printed:
    number = float(value)
    return Printed(f"{mark}{value} {unit}".strip(), unit, number - slack, number + slack, decimals)


def _decimals(value: str) -> int:
    return len(value.partition(".")[2])
