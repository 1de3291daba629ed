"""A number or a word of one side, with its unit and its standard error; and the keys of a file as such quantities."""

from collections.abc import Iterator
from dataclasses import dataclass
from hashlib import sha256
from typing import Any

_SHOWN = 8  # numbers of a list that are listed one by one
_UNITS = {
    "nm_per_v": "nm/V",
    "v_per_s": "V/s",
    "percent": "%",
    "lsb": "LSB",
    "deg": "deg",
    "nm": "nm",
    "hz": "Hz",
    "db": "dB",
    "v": "V",
    "s": "s",
}


@dataclass(frozen=True)
class ComparedQuantity:
    """``value`` of ``name`` in a ``section``, with its standard error; two of them cover the truth in 95 % of cases.

    ``of_scan`` marks a value of a scan file or a scanner file that no build has.
    """

    section: str
    name: str
    value: float | str
    unit: str = ""
    error: float | None = None
    of_scan: bool = False


def unit_of(key: str) -> str:
    """Return the unit that is part of a key's name; empty where there is none, or for v_max and the like."""
    name = key.rpartition(".")[2].partition("[")[0]
    return next((unit for end, unit in _UNITS.items() if name.endswith(f"_{end}") or _begins(name, end)), "")


def _begins(name: str, end: str) -> bool:
    return end == "v" and name.startswith("v_") and name != "v_threshold"


def keys_of(section: str, key: str, value: Any, of_scan: bool = True) -> Iterator[ComparedQuantity]:
    """Yield all keys of a table, nested ones flattened; a long list of numbers gives its length and a digest."""
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from keys_of(section, f"{key}.{name}" if key else name, inner, of_scan)
    elif isinstance(value, list | tuple):
        if len(value) > _SHOWN and all(isinstance(one, int | float) for one in value):
            yield ComparedQuantity(section, key, f"{len(value)} numbers, {digest(value)}", of_scan=of_scan)
            return
        for i, inner in enumerate(value):
            yield from keys_of(section, f"{key}[{i}]", inner, of_scan)
    elif isinstance(value, bool) or not isinstance(value, int | float | None):
        yield ComparedQuantity(section, key, str(value).lower() if isinstance(value, bool) else value, of_scan=of_scan)
    elif value is not None:
        yield ComparedQuantity(section, key, value, unit_of(key), of_scan=of_scan)


def digest(value: object) -> str:
    """Return the beginning of the SHA-256 of a value as Python writes it."""
    return sha256(repr(value).encode()).hexdigest()[:8]
