"""The writer of ``manifest.json``, the machine-readable record of a build."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from tablegen.base.reading import MANIFEST as MANIFEST_KIND
from tablegen.certificate.certificate import Certificate
from tablegen.config.schema import DEFAULT_FORMATS, TILT_NAMES, TiltName
from tablegen.manifest.read import DamagedManifest, parse_manifest
from tablegen.manifest.record import certificate_record, tilt_certificate_record
from tablegen.version import __version__

if TYPE_CHECKING:
    from tablegen.planning.tilt import TiltErrors

_json = json.JSONEncoder(ensure_ascii=True, allow_nan=False).encode  # one, for there are hundreds of values


class UnreadableManifest(ValueError):
    """A manifest that would be refused when it is read back; the message has the reason."""


class TooLongManifest(UnreadableManifest):
    """A manifest with more bytes than are read."""


def manifest_file(
    record: dict[str, Any],
    digest: str,
    formats: Sequence[str],
    certificates: dict[str, Certificate],
    files: Mapping[str, bytes],
    clocks_per_tick: int = 0,
    tilts: "Mapping[TiltName, TiltErrors] | None" = None,
) -> bytes:
    """Write the plan's record with its hash, the certificates, and the SHA-256 of every other file of the build.

    ``formats`` stand in it unless they are those that a build has by default, ``clocks_per_tick`` unless it is 0.
    ``tilts`` are the errors of the outputs beside x and y, by their names.
    ``require_readable`` belongs before the disk.
    """
    axes = {
        axis: {**content, "certificate": certificate_record(certificates[axis])}
        for axis, content in record["axes"].items()
    }
    manifest = {
        "tablegen": __version__,
        "hash": digest,
        **{key: value for key, value in record.items() if key not in ("axes", *TILT_NAMES)},
        **({"formats": list(formats)} if sorted(formats) != sorted(DEFAULT_FORMATS) else {}),
        **({"clocks_per_tick": clocks_per_tick} if clocks_per_tick else {}),
        "files": {name: hashlib.sha256(content).hexdigest() for name, content in sorted(files.items())},
        "axes": axes,
        **({} if tilts is None else _tilts(record, tilts)),
    }
    return (readable(manifest) + "\n").encode("ascii")


def _tilts(record: dict[str, Any], tilts: "Mapping[TiltName, TiltErrors]") -> dict[str, Any]:
    """Return the records of the outputs beside x and y with their certificates."""
    return {name: {**record[name], "certificate": tilt_certificate_record(each)} for name, each in tilts.items()}


def require_readable(content: bytes) -> None:
    """Check that the reader of manifests accepts one before it is written.

    Raises
    ------
    TooLongManifest
        If it has more bytes than are read.
    UnreadableManifest
        If its reader refuses it.
    """
    if len(content) > MANIFEST_KIND.most_bytes:
        raise TooLongManifest(f"it has {len(content)} bytes, above the {MANIFEST_KIND.most_bytes} that are read")
    try:
        parse_manifest(content)
    except DamagedManifest as damage:
        raise UnreadableManifest(str(damage)) from None


def readable(value: Any, indent: str = "") -> str:
    """Format JSON with a key a line, and arrays of numbers on one line."""
    if isinstance(value, dict) and value:
        inner = indent + "  "
        items = (f"{inner}{_json(key)}: {readable(item, inner)}" for key, item in value.items())
        return "{\n" + ",\n".join(items) + f"\n{indent}}}"
    return _json(value)
