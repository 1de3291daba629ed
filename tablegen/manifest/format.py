"""What writer and reader of ``manifest.json`` agree on: its name, and the hash that names a plan."""

import hashlib
import json
from typing import Any

MANIFEST = "manifest.json"


def content_hash(record: dict[str, Any]) -> str:
    """SHA-256 of a plan's record in canonical JSON."""
    canonical = json.dumps(record, sort_keys=True, separators=(",", ":"), ensure_ascii=True, allow_nan=False)
    return hashlib.sha256(canonical.encode("ascii")).hexdigest()
