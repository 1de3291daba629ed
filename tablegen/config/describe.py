"""The keys of the input files, described: the table of hysteresis is that of all models together."""

from typing import Any

import msgspec.inspect as types
from msgspec import Struct
from msgspec.json import schema_components

from tablegen.compensation import models
from tablegen.compensation.model import Hysteresis

_MODEL_KEY = "model"


def purposes() -> str:
    """What each model is, in a line."""
    return "; ".join(f"{kind.model()}: {kind.purpose}" for kind in models.own())


def model_fields() -> list[tuple[types.Field, str]]:
    """Keys of the hysteresis tables of all models, each once; and for which models where not for all of them."""
    fields: dict[str, types.Field] = {}
    takers: dict[str, list[str]] = {}
    for kind in models.own():
        described = types.type_info(kind)
        assert isinstance(described, types.StructType)
        for field in described.fields:
            fields.setdefault(field.encode_name, field)
            takers.setdefault(field.encode_name, []).append(kind.model())
    everybody = len(models.own())
    return [
        (field, "" if len(takers[name]) == everybody else f"model {' or '.join(takers[name])}: ")
        for name, field in fields.items()
    ]


def json_schema(kind: type[Struct]) -> dict[str, Any]:
    """JSON Schema (2020-12) of a file; a hysteresis table has the keys of all models."""
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
    return {**root, "$defs": components}
