"""The key ``[y] like = "x"``: y inherits the keys of x unless it has its own, on the values as written."""

from collections.abc import Mapping
from typing import Any

from msgspec.structs import replace

from tablegen.base.input_errors import Document, Problems
from tablegen.base.toml import join_key

_NOTHING: Mapping[str, tuple[str, ...]] = {}
# By the table of an axis: keys of x that are not inherited beside a key of y, since they set the same quantity.
_INSTEAD: Mapping[str, Mapping[str, tuple[str, ...]]] = {
    "": {
        "size_nm": ("size_um", "size_v"),
        "size_um": ("size_nm", "size_v"),
        "size_v": ("size_nm", "size_um", "size_of"),
        "offset_v": ("offset_nm", "offset_um"),
        "offset_nm": ("offset_v", "offset_um"),
        "offset_um": ("offset_v", "offset_nm"),
    },
    "band_limit": {"harmonics": ("cutoff_hz",), "cutoff_hz": ("harmonics",)},
    "table": {"mode": ("length",)},
    "offset": {
        **dict.fromkeys(("m_minus", "m_plus"), ("alpha", "beta", "points", "sizes")),
        **dict.fromkeys(("alpha", "beta"), ("m_minus", "m_plus", "points", "sizes")),
        "points": ("m_minus", "m_plus", "alpha", "beta", "sizes"),
        "sizes": ("m_minus", "m_plus", "alpha", "beta", "points"),
    },
    "resonance": {
        **dict.fromkeys(("frequency_hz", "quality", "delay_s"), ("response",)),
        "response": ("frequency_hz", "quality", "delay_s"),
    },
}
_NEVER = ("refinement", "frame_refinement", "motion")  # learnt on x itself; of its line


def inherited(values: Mapping[str, Any], document: Document) -> tuple[dict[str, Any], Document]:
    """Return the values with what y inherits from x, and the document with the sources; unchanged without ``like``."""
    values = dict(values)
    x, y = values.get("x"), values.get("y")
    if not isinstance(x, dict) or not isinstance(y, dict) or y.get("like") != "x":
        return values, document
    sources: dict[str, str] = {}
    values["y"] = _merged(x, y, "", _excluded(values, y), sources)
    return values, replace(document, inherited=sources)


def warn_inherited_once(problems: Problems, document: Document) -> None:
    """Remove a fault that y inherits from x where that of x is reported."""
    if not document.inherited:
        return
    own = document.lines or {}
    of_x = {p.key[2:] for p in problems.entries if p.file == document.name and p.key.startswith("x.")}
    problems.entries[:] = [
        p
        for p in problems.entries
        if p.file != document.name or not p.key.startswith("y.") or p.key in own or p.key[2:] not in of_x
    ]


def _excluded(values: Mapping[str, Any], y: Mapping[str, Any]) -> set[str]:
    """Return the keys of x, below its name, that y never inherits, and those that the scan sets in another way."""
    excluded = set(_NEVER)
    timing = values.get("timing")
    if isinstance(timing, dict) and "frame" in timing:
        excluded |= {"turn", "band_limit.directions"}
    if y.get("motion") == "off":
        excluded |= {"size_nm", "size_um", "size_v", "size_of", "turn", "band_limit", "table"}
    return excluded


def _merged(
    x: Mapping[str, Any], y: Mapping[str, Any], path: str, excluded: set[str], sources: dict[str, str]
) -> dict[str, Any]:
    """Return the keys of y, and those of x that it does not replace; ``path`` is that of the table below the axis."""
    if path == "hysteresis" and "model" in y and y["model"] != x.get("model", y["model"]):
        return dict(y)  # the keys of another model do not apply
    instead = _INSTEAD.get(path, _NOTHING)
    skipped = {key for own in y for key in instead.get(own, ())}
    merged = dict(y)
    for name, value in x.items():
        inner = join_key(path, name)
        if inner in excluded or (name in skipped and name not in y):
            continue
        if name not in y:
            merged[name] = _copied(value, inner, excluded, sources)
        elif isinstance(value, dict) and isinstance(y[name], dict):
            merged[name] = _merged(value, y[name], inner, excluded, sources)
    return merged


def _copied(value: Any, path: str, excluded: set[str], sources: dict[str, str]) -> Any:
    """Return a value of x for y, and note every key in it."""
    sources[f"y.{path}"] = f"x.{path}"
    if isinstance(value, dict):
        inner = {name: join_key(path, name) for name in value}
        return {
            name: _copied(one, inner[name], excluded, sources)
            for name, one in value.items()
            if inner[name] not in excluded
        }
    if isinstance(value, list):
        return [_copied(one, f"{path}[{i}]", excluded, sources) for i, one in enumerate(value)]
    return value
