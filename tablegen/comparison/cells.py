"""A pair of quantities as cells of a table."""

from tablegen.comparison.difference import ComparedPair
from tablegen.comparison.quantity import ComparedQuantity

HEAD = ("A", "B", "B less A", "change")


def cells(pair: ComparedPair) -> tuple[str, str, str, str]:
    """Return A, B, the difference with its unit, and its percentage or its size in standard errors."""
    difference, change = "", ""
    if not pair.same and pair.difference is not None:
        difference = f"{pair.difference:+.5g}{_unit(pair)}"
    if not pair.same and pair.percent is not None:
        change = f"{pair.percent:+.3g} %"
    if pair.verdict:
        change = f"{change + ', ' if change else ''}{pair.errors:.2g} standard errors: {pair.verdict}"
    return _value(pair.a), _value(pair.b), difference, change


def _value(one: ComparedQuantity | None) -> str:
    if one is None:
        return "-"
    if isinstance(one.value, str):
        return one.value
    text = f"{one.value:.7g}" if isinstance(one.value, float) else str(one.value)
    return text if one.error is None else f"{text} \u00b1 {one.error:.2g}"


def _unit(pair: ComparedPair) -> str:
    return f" {pair.unit}" if pair.unit else ""
