"""Decode plain TOML values into the frozen types of the schema, and collect every fault."""

import math
from collections.abc import Callable
from datetime import date, time
from functools import cache
from typing import Any, TypeAlias, TypeVar

import msgspec.inspect as types
from msgspec import Struct
from msgspec.structs import FieldInfo, fields

from tablegen.base.input_errors import Document, Problems
from tablegen.base.toml import join_key
from tablegen.compensation import models
from tablegen.compensation.model import Hysteresis

T = TypeVar("T", bound=Struct)

# Called for every table with its type, its key, its written values, and the decoded struct or None.
Check: TypeAlias = Callable[[type, str, dict[str, Any], Any], None]

_ALREADY_REPORTED = object()  # the value of a key that was reported already
_UNITS = ("_nm", "_v", "_hz", "_s", "_nm_per_v", "_v_per_s", "_db", "_lsb", "_percent")


def decode(kind: type[T], values: dict[str, Any], document: Document, problems: Problems, check: Check) -> T | None:
    """Build ``kind`` from a table of TOML values; None, and at least one problem, where that is not possible.

    ``check`` is called for each table and adds contradictions between its keys.
    """
    built = _Decoder(document, problems, check).struct(kind, values, "")
    return built if isinstance(built, kind) else None


class _Decoder:
    def __init__(self, document: Document, problems: Problems, check: Check) -> None:
        self._document = document
        self._problems = problems
        self._check = check

    def _wrong(self, key: str, why: str) -> object:
        self._problems.add(self._document, key, why)
        return _ALREADY_REPORTED

    def _any(self, kind: types.Type, value: Any, key: str) -> Any:
        match kind:
            case types.Metadata():
                return self._any(kind.type, value, key)
            case types.UnionType():
                return self._union(kind, value, key)
            case types.StructType():
                return self.struct(kind.cls, value, key)
            case types.ListType():
                return self._list(kind, value, key)
            case types.TupleType():
                return self._tuple(kind, value, key)
            case types.FloatType():
                return self._number(kind, value, key)
            case types.IntType():
                return self._integer(kind, value, key)
            case types.StrType():
                return self._text(kind, value, key)
            case types.LiteralType():
                if value in kind.values and isinstance(value, str):
                    return value
                accepted = ", ".join(map(repr, kind.values))
                return self._wrong(key, f"{_display(value)} is not one of {accepted}")
            case types.BoolType():
                return value if isinstance(value, bool) else self._wrong(key, f"{_display(value)} is not true or false")
        raise NotImplementedError(kind)  # pragma: no cover - a type that the schema does not use

    def _union(self, kind: types.UnionType, value: Any, key: str) -> Any:
        """Decode "something or None", since TOML has no null; or a number or a word."""
        some = [t for t in kind.types if not isinstance(t, types.NoneType)]
        arrays = [t for t in some if isinstance(_bare(t), types.ListType)]
        if arrays and len(some) > 1:  # a number, or an array of them
            return self._any(next(t for t in some if (t in arrays) == isinstance(value, list)), value, key)
        words = [word for t in some if isinstance(t, types.LiteralType) for word in t.values]
        if len(some) > 1 and isinstance(value, str):
            wrong = f"{_display(value)} is not a number, nor {' or '.join(map(repr, words))}"
            return value if value in words else self._wrong(key, wrong)
        return self._any(next(t for t in some if len(some) == 1 or not isinstance(t, types.LiteralType)), value, key)

    def struct(self, kind: type[Struct], value: Any, key: str) -> Any:
        if not isinstance(value, dict):
            return self._wrong(key, f"{_display(value)} is not a table")
        valid, built = True, {}
        if kind is Hysteresis:
            known_model = self._model(value, key)
            if known_model is None:  # the keys of an unknown model are unknown
                return _ALREADY_REPORTED
            kind = known_model
        known = _fields(kind)
        tag_field = kind.__struct_config__.tag_field
        tag = () if tag_field is None else (tag_field,)
        unknown = [name for name in value if name not in known and name not in tag]
        for name in unknown:
            valid = False
            self._wrong(join_key(key, name), f"unknown key; {_suggestion(name, [*tag, *known], value)}")
        for name, field in known.items():
            if name in value:
                inner = join_key(key, name)
                if types.is_struct_type(field.type):
                    built[name] = self.struct(field.type, value[name], inner)
                else:
                    built[name] = self._any(_described(kind, name), value[name], inner)
                valid = valid and built[name] is not _ALREADY_REPORTED
            elif field.required:
                valid = False
                if not any(name in meant(other, known) for other in unknown):
                    kind_of = "table" if types.is_struct_type(field.type) else "key"
                    self._wrong(join_key(key, name), f"missing; this {kind_of} is required")
        struct = kind(**built) if valid else None
        self._check(kind, key, value, struct)
        return struct if valid else _ALREADY_REPORTED

    def _model(self, value: dict[str, Any], key: str) -> type[Struct] | None:
        """Return the type of a hysteresis table by the name in it; None where there is no such model."""
        name = value.get("model", models.DEFAULT)
        try:
            if not isinstance(name, str):
                raise models.UnknownModel(f"{_display(name)} is not one of {', '.join(map(repr, models.names()))}")
            return models.get(name)
        except models.UnknownModel as why:
            self._wrong(join_key(key, "model"), str(why))
            return None

    def _list(self, kind: types.ListType, value: Any, key: str) -> Any:
        if not isinstance(value, list):
            return self._wrong(key, f"{_display(value)} is not an array")
        if kind.min_length is not None and len(value) < kind.min_length:
            return self._wrong(key, f"{len(value)} entries are too few, at least {kind.min_length} are needed")
        if kind.max_length is not None and len(value) > kind.max_length:
            return self._wrong(key, f"{len(value)} entries are too many, at most {kind.max_length} are taken")
        built = [self._any(kind.item_type, item, f"{key}[{i}]") for i, item in enumerate(value)]
        return _ALREADY_REPORTED if any(item is _ALREADY_REPORTED for item in built) else built

    def _tuple(self, kind: types.TupleType, value: Any, key: str) -> Any:
        count = len(kind.item_types)
        if not isinstance(value, list) or len(value) != count:
            return self._wrong(key, f"{_display(value)} is not an array of {count} numbers")
        built = [
            self._any(t, item, f"{key}[{i}]") for i, (t, item) in enumerate(zip(kind.item_types, value, strict=True))
        ]
        return _ALREADY_REPORTED if any(item is _ALREADY_REPORTED for item in built) else tuple(built)

    def _number(self, kind: types.FloatType, value: Any, key: str) -> Any:
        if isinstance(value, bool) or not isinstance(value, int | float):
            return self._wrong(key, f"{_display(value)} is not a number")
        if isinstance(value, float) and not math.isfinite(value):
            return self._wrong(key, f"{value} is not a finite number")
        if not self._in_range(kind, value, key):
            return _ALREADY_REPORTED
        return float(value)

    def _integer(self, kind: types.IntType, value: Any, key: str) -> Any:
        if isinstance(value, bool) or not isinstance(value, int):
            whole = isinstance(value, float) and value.is_integer() and abs(value) < 1e15
            return self._wrong(
                key, f"{value!r} has to be written {value:.0f}" if whole else f"{_display(value)} is not a whole number"
            )
        return value if self._in_range(kind, value, key) else _ALREADY_REPORTED

    def _in_range(self, kind: types.FloatType | types.IntType, value: float, key: str) -> bool:
        text = _display(value)
        if kind.le is not None and value > kind.le:
            self._wrong(key, f"{text} is above {kind.le:.12g}")
        elif kind.ge is not None and value < kind.ge:
            self._wrong(key, f"{text} is below {kind.ge:.12g}")
        elif kind.lt is not None and value >= kind.lt:
            self._wrong(key, f"{text} is not below {kind.lt:.12g}")
        elif kind.gt is not None and value <= kind.gt:
            self._wrong(key, f"{text} is not above {kind.gt:.12g}")
        else:
            return True
        return False

    def _text(self, kind: types.StrType, value: Any, key: str) -> Any:
        if not isinstance(value, str):
            return self._wrong(key, f"{_display(value)} is not a text in quotes")
        if kind.min_length is not None and len(value) < kind.min_length:
            return self._wrong(key, "is empty")
        if kind.max_length is not None and len(value) > kind.max_length:
            return self._wrong(key, f"{len(value)} characters are too many, at most {kind.max_length} are taken")
        return value


@cache
def _fields(kind: type[Struct]) -> dict[str, FieldInfo]:
    """Return the fields of a type by their keys, cached since a scan has several tables of one type."""
    return {field.encode_name: field for field in fields(kind)}


@cache
def _described(kind: type[Struct], name: str) -> types.Type:
    """Return a field of a type with its range, only for written keys: all of them take some percent of a build."""
    return types.type_info(_fields(kind)[name].type)


def _bare(kind: types.Type) -> types.Type:
    return _bare(kind.type) if isinstance(kind, types.Metadata) else kind


def meant(name: str, known: Any) -> list[str]:
    """Return the known keys that an unknown one was probably meant to be: with its unit, or without a typing error."""
    with_unit = [k for k in known if any(k == name + unit for unit in _UNITS)]
    stem = name.rsplit("_", 1)[0]
    other_unit = [k for k in known if any(k == stem + unit for unit in _UNITS)] if "_" in name else []
    if with_unit or other_unit:
        return with_unit or other_unit
    from difflib import get_close_matches  # here: only a mistaken key needs it

    return get_close_matches(name, list(known), n=1, cutoff=0.6)


def _suggestion(name: str, known: list[str], written: dict[str, Any]) -> str:
    likely = meant(name, known)
    if not likely:
        return f"known here: {', '.join(sorted(known))}"
    if present := [key for key in likely if key in written]:
        return f"{present[0]} is given as well"
    unit = " (units are part of the name)" if any(m == name + unit for m in likely for unit in _UNITS) else ""
    return f"did you mean {' or '.join(likely)}?{unit}"


def _display(value: Any) -> str:
    if isinstance(value, dict):
        return "a table"
    if isinstance(value, list):
        return f"an array of {len(value)}"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int) and value.bit_length() > 1000:  # Python refuses to print the longest ones
        return f"a whole number of {value.bit_length()} bits"
    if isinstance(value, float):
        short = f"{value:.12g}"
        return short if float(short) == value else repr(value)
    if isinstance(value, date | time):
        return f"the date or time {value}"
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
