"""A record with other values in some of its fields, whether it is a struct of msgspec or a dataclass."""

import dataclasses
from typing import Any, TypeVar

from msgspec import Struct, structs

Record = TypeVar("Record")


def replace(record: Record, **changes: Any) -> Record:
    """A new record."""
    made: Any = structs.replace(record, **changes) if isinstance(record, Struct) else None
    return dataclasses.replace(record, **changes) if made is None else made  # type: ignore[type-var]
