"""The values of swept keys, from the text of ``--set``: ranges, lists, texts."""

from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from typing import Any

from tablegen.base.input_errors import Problem, Rejected, shortened
from tablegen.base.toml import parse_toml

MOST_VALUES = 65_536  # of one key, and of scans in one sweep
_OPENING, _CLOSING = "[{", "]}"


@dataclass(frozen=True)
class Setting:
    """A key of the scan file, such as ``x.size_nm``, its values in a sweep, and its origin in messages."""

    key: str
    values: tuple[Any, ...]
    origin: str = ""

    @property
    def parts(self) -> list[str]:
        """The parts of the key, table by table."""
        return self.key.split(".")


def parse_setting(text: str) -> Setting:
    """Parse ``KEY=VALUE,VALUE..``; a value is a number, a range START:STOP:STEP, a word or a TOML value.

    A range ends at STOP where a whole number of steps reaches it, and before it where none does.

    Raises
    ------
    Rejected
        If the text is not a setting.
    """
    origin = f"--set {shortened(text)}"
    key, equals, written = text.partition("=")
    key = key.strip()
    if not equals or not key or not all(key.split(".")):
        raise _refused(origin, "is not KEY=VALUES, as in x.size_nm=50:1000:50 or x.offset_v=10,50,90")
    values: list[Any] = []
    for item in _items(written, origin):
        values += _values(item.strip(), origin)
        if len(values) > MOST_VALUES:
            raise _refused(origin, f"has more than {MOST_VALUES} values")
    texts: set[str] = set()
    for value in values:
        if repr(value) in texts:
            raise _refused(origin, f"has {value!r} twice")
        texts.add(repr(value))
    return Setting(key, tuple(values), origin)


def check_repeated_keys(settings: "Sequence[Setting]") -> None:
    """Check that no key is set twice, or beside a table that holds it.

    Raises
    ------
    Rejected
        If a key is.
    """
    for at, setting in enumerate(settings):
        for other in settings[:at]:
            if setting.key == other.key:
                raise _refused(setting.origin or setting.key, f"{setting.key} is given twice; list its values in one")
            shorter, longer = sorted((setting.parts, other.parts), key=len)
            if longer[: len(shorter)] == shorter:
                raise _refused(setting.origin or setting.key, f"{'.'.join(longer)} lies in {'.'.join(shorter)}")


def _refused(origin: str, why: str) -> Rejected:
    return Rejected([Problem(origin, 0, "", why)])


def _items(text: str, origin: str) -> list[str]:
    """Return the text split at its commas, except those in brackets and quotes."""
    items, depth, quote = [""], 0, ""
    for character in text:
        if quote:
            quote = "" if character == quote else quote
        elif character in "\"'":
            quote = character
        elif character in _OPENING:
            depth += 1
        elif character in _CLOSING:
            depth -= 1
        elif character == "," and depth == 0:
            items.append("")
            continue
        items[-1] += character
    if not all(item.strip() for item in items):
        raise _refused(origin, "has an empty value; quote a text that is empty")
    return items


def _values(item: str, origin: str) -> list[Any]:
    if ":" in item and item[0] not in "\"'[{":
        numbers = [_number(part.strip()) for part in item.split(":")]
        if all(number is not None for number in numbers):
            return _range([number for number in numbers if number is not None], item, origin)
        if any(number is not None for number in numbers):
            raise _refused(origin, f"{item!r} is no range START:STOP:STEP of numbers; quote it if it is a text")
    try:
        return [parse_toml(f"value = {item}", origin)[0]["value"]]
    except Rejected:
        return [item]  # a word without quotes


def _number(text: str) -> Decimal | None:
    try:
        value = Decimal(text.replace("_", ""))
    except InvalidOperation:
        return None
    return value if value.is_finite() and abs(value.adjusted()) < 100 else None


def _range(numbers: list[Decimal], item: str, origin: str) -> list[int | float]:
    """Return every STEP from START to STOP, in decimal: 0.1:0.5:0.1 includes 0.3 and 0.5."""
    if len(numbers) != 3:
        raise _refused(origin, f"{item!r} has no step; a range is START:STOP:STEP, as in 50:1000:50")
    start, stop, step = numbers
    if step == 0:
        raise _refused(origin, f"{item!r} has a step of 0")
    if (stop - start) * step < 0:
        raise _refused(origin, f"{item!r} steps away from {stop}; give the step the other sign")
    count = int((stop - start) / step) + 1
    if count > MOST_VALUES:
        raise _refused(origin, f"{item!r} has {count} values; at most {MOST_VALUES} are taken")
    whole = all(number == number.to_integral_value() and _exponent(number) >= 0 for number in numbers)
    numbers_in_range = [start + step * at for at in range(count)]
    return [int(value) for value in numbers_in_range] if whole else [float(value) for value in numbers_in_range]


def _exponent(number: Decimal) -> int:
    exponent = number.as_tuple().exponent
    return exponent if isinstance(exponent, int) else 0
