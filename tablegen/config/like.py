"""``[y] like = "x"``: y takes what x has, and its own keys go before that; on the values as they were written."""

from collections.abc import Mapping
from typing import Any

from msgspec.structs import replace

from tablegen.base.input_errors import Document, Problems
from tablegen.base.toml import join_key

_NOTHING: Mapping[str, tuple[str, ...]] = {}
# By the table of an axis: what is not taken from x beside a key of y, since both would say the same or contradict.
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
_NEVER = ("refinement",)  # learnt on x itself


def inherited(values: Mapping[str, Any], document: Document) -> tuple[dict[str, Any], Document]:
    """The values with what y has from x, and the document that knows whose keys they are; as they are without like."""
    values = dict(values)
    x, y = values.get("x"), values.get("y")
    if not isinstance(x, dict) or not isinstance(y, dict) or y.get("like") != "x":
        return values, document
    taken: dict[str, str] = {}
    values["y"] = _merged(x, y, "", _left_out(values, y), taken)
    return values, replace(document, inherited=taken)


def told_once(problems: Problems, document: Document) -> None:
    """Of a fault of x that y has by like, that of x stays."""
    if not document.inherited:
        return
    own = document.lines or {}
    of_x = {p.key[2:] for p in problems.found if p.file == document.name and p.key.startswith("x.")}
    problems.found[:] = [
        p
        for p in problems.found
        if p.file != document.name or not p.key.startswith("y.") or p.key in own or p.key[2:] not in of_x
    ]


def _left_out(values: Mapping[str, Any], y: Mapping[str, Any]) -> set[str]:
    """Keys of x, below its name, that y never takes, and those that the scan says otherwise."""
    left = set(_NEVER)
    timing = values.get("timing")
    if isinstance(timing, dict) and "frame" in timing:
        left |= {"turn", "band_limit.directions"}
    if y.get("motion") == "off":
        left |= {"size_nm", "size_um", "size_v", "size_of", "turn", "band_limit", "table"}
    return left


def _merged(
    x: Mapping[str, Any], y: Mapping[str, Any], path: str, left_out: set[str], taken: dict[str, str]
) -> dict[str, Any]:
    """The keys of y, and of x those that it does not replace; ``path`` is that of the table below the axis."""
    if path == "hysteresis" and "model" in y and y["model"] != x.get("model", y["model"]):
        return dict(y)  # the keys of another model mean nothing to it
    instead = _INSTEAD.get(path, _NOTHING)
    skipped = {key for own in y for key in instead.get(own, ())}
    merged = dict(y)
    for name, value in x.items():
        inner = join_key(path, name)
        if inner in left_out or (name in skipped and name not in y):
            continue
        if name not in y:
            merged[name] = _copied(value, inner, left_out, taken)
        elif isinstance(value, dict) and isinstance(y[name], dict):
            merged[name] = _merged(value, y[name], inner, left_out, taken)
    return merged


def _copied(value: Any, path: str, left_out: set[str], taken: dict[str, str]) -> Any:
    """A value of x for y; every key in it is noted."""
    taken[f"y.{path}"] = f"x.{path}"
    if isinstance(value, dict):
        inner = {name: join_key(path, name) for name in value}
        return {
            name: _copied(one, inner[name], left_out, taken)
            for name, one in value.items()
            if inner[name] not in left_out
        }
    if isinstance(value, list):
        return [_copied(one, f"{path}[{i}]", left_out, taken) for i, one in enumerate(value)]
    return value
