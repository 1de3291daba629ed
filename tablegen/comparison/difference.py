"""Two sides quantity by quantity: the differences, and whether they exceed the standard errors."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot
from typing import Any

from tablegen.comparison.quantity import ComparedQuantity

SURE = 2.0  # standard errors of a difference: beyond it, chance alone is one case of twenty


@dataclass(frozen=True)
class ComparedPair:
    """A quantity of A and of B; None where that side does not have it."""

    section: str
    name: str
    unit: str
    a: ComparedQuantity | None
    b: ComparedQuantity | None

    @property
    def label(self) -> str:
        """The name with the unit."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name

    @property
    def same(self) -> bool:
        """True if both sides have the same value."""
        return self.a is not None and self.b is not None and self.a.value == self.b.value

    @property
    def difference(self) -> float | None:
        """B less A; None of words, and where one side lacks it."""
        if self.a is None or self.b is None or isinstance(self.a.value, str) or isinstance(self.b.value, str):
            return None
        return self.b.value - self.a.value

    @property
    def percent(self) -> float | None:
        """The difference in percent of A; None where A is 0, and of decibels."""
        if self.unit == "dB" or self.difference is None or self.a is None:
            return None
        if isinstance(self.a.value, str) or not self.a.value:
            return None
        return 100.0 * self.difference / abs(self.a.value)

    @property
    def errors(self) -> float | None:
        """The difference in its own standard errors; None unless both are known."""
        if self.difference is None or self.a is None or self.b is None:
            return None
        if self.a.error is None or self.b.error is None or not hypot(self.a.error, self.b.error):
            return None
        return abs(self.difference) / hypot(self.a.error, self.b.error)

    @property
    def verdict(self) -> str:
        """The comparison with the standard errors; empty where they are unknown or the values are the same."""
        if self.errors is None or self.same:
            return ""
        return "more than the errors" if self.errors > SURE else "within the errors"

    def record(self) -> dict[str, Any]:
        """Return the pair as plain data."""
        sides = {
            side: None if one is None else one.value if one.error is None else {"value": one.value, "error": one.error}
            for side, one in (("a", self.a), ("b", self.b))
        }
        record = {"section": self.section, "name": self.name, "unit": self.unit, **sides, "same": self.same}
        more = {"difference": self.difference, "percent": self.percent, "standard_errors": self.errors}
        return {**record, **{key: value for key, value in more.items() if value is not None}}


def pairs(a: Sequence[ComparedQuantity], b: Sequence[ComparedQuantity], of_scan: bool) -> list[ComparedPair]:
    """Return every quantity of either side, in the order of A; those of B alone follow their neighbours.

    Without ``of_scan`` quantities that only a scan has are left out.
    """
    sides = [{(one.section, one.name): one for one in side if of_scan or not one.of_scan} for side in (a, b)]
    sections = _merged([key[0] for key in sides[0]], [key[0] for key in sides[1]])
    compared_pairs = []
    for section in sections:
        for name in _merged(*([key[1] for key in side if key[0] == section] for side in sides)):
            first, second = (side.get((section, name)) for side in sides)
            unit = next(one.unit for one in (first, second) if one is not None)
            compared_pairs.append(ComparedPair(section, name, unit, first, second))
    return compared_pairs


def _merged(a: Sequence[str], b: Sequence[str]) -> list[str]:
    """Merge two lists without repetition, in the order of both as far as they agree."""
    merged, in_a, pending = list(dict.fromkeys(a)), set(a), list[str]()
    for one in dict.fromkeys(b):
        if one not in in_a:
            pending.append(one)
        elif pending:
            at = merged.index(one)
            merged[at:at] = pending
            pending = []
    return merged + pending
