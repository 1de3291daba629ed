"""Descriptions of the keys of the input files: the table of hysteresis is that of all models together."""

from typing import Any

import msgspec.inspect as types
from msgspec import Struct
from msgspec.json import schema_components

from tablegen.compensation import models
from tablegen.compensation.model import Hysteresis
from tablegen.config.image_keys import RATES
from tablegen.config.scanner import SlowScannerAxis
from tablegen.config.schema import WrittenTiming

_MODEL_KEY = "model"
# Keys of which one has to be given, and no two, by the table.
_ONE_OF = {WrittenTiming.__name__: (("lines", "image_lines"), RATES)}


def purposes() -> str:
    """Return the purpose of each model, in a line."""
    return "; ".join(f"{kind.model()}: {kind.purpose}" for kind in models.own())


def model_fields() -> list[tuple[types.Field, str]]:
    """Return the keys of the hysteresis tables of all models, each once, and its models where not all have it."""
    fields: dict[str, types.Field] = {}
    owners: dict[str, list[str]] = {}
    for kind in models.own():
        described = types.type_info(kind)
        assert isinstance(described, types.StructType)
        for field in described.fields:
            fields.setdefault(field.encode_name, field)
            owners.setdefault(field.encode_name, []).append(kind.model())
    model_count = len(models.own())
    return [
        (field, "" if len(owners[name]) == model_count else f"model {' or '.join(owners[name])}: ")
        for name, field in fields.items()
    ]


def json_schema(kind: type[Struct]) -> dict[str, Any]:
    """Return the JSON Schema (2020-12) of a file; a hysteresis table has the keys of all models."""
    (root,), components = schema_components([kind], ref_template="#/$defs/{name}")
    if Hysteresis.__name__ in components:
        _, of_models = schema_components(models.own(), ref_template="#/$defs/{name}")
        tables = [of_models.pop(one.__name__) for one in models.own()]
        merged: dict[str, Any] = {}
        for table in reversed(tables):
            merged = {**merged, **table["properties"]}
        model = {"description": purposes(), "enum": models.names(), "default": models.DEFAULT}
        required = set.intersection(*(set(table["required"]) for table in tables)) - {_MODEL_KEY}
        components |= of_models
        components[Hysteresis.__name__] = {
            **components[Hysteresis.__name__],
            "properties": {**merged, _MODEL_KEY: model},
            "required": sorted(required),
        }
    for name, ways in _ONE_OF.items():
        if name in components:
            groups = [{"oneOf": [{"required": [key]} for key in way]} for way in ways]
            components[name] = {**components[name], "allOf": groups}
    slow = components.get(SlowScannerAxis.__name__)
    if slow is not None:  # what y has from x is not required of it
        rest = {key: value for key, value in slow.items() if key != "required"}
        components[SlowScannerAxis.__name__] = {
            **rest,
            "anyOf": [{"required": ["like"]}, {"required": slow["required"]}],
        }
    return {**root, "$defs": components}
