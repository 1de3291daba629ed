"""The common ground of writer and reader of ``manifest.json``: its name, and the hash that names a plan."""

import hashlib
import json
from typing import Any

MANIFEST = "manifest.json"
INDEX, RECORD = "library.json", "program.json"  # of a library, and of each of its programs
CONVERTER_KEYS = ("v_zero", "v_per_code", "coding", "align", "word_bits")  # of an output: its converter and amplifier


def read_json(content: bytes) -> Any:
    """Read a manifest.

    Raises
    ------
    ValueError
        If it is no JSON, or nested as no manifest is.
    """
    try:
        return json.loads(content, parse_constant=_no_number)
    except RecursionError:
        raise ValueError("nested too deeply for a manifest") from None


def _no_number(text: str) -> float:
    raise ValueError(f"{text} is no number of JSON")


def content_hash(record: dict[str, Any]) -> str:
    """Return the SHA-256 of a plan's record in canonical JSON."""
    canonical = json.dumps(record, sort_keys=True, separators=(",", ":"), ensure_ascii=True, allow_nan=False)
    return hashlib.sha256(canonical.encode("ascii")).hexdigest()
