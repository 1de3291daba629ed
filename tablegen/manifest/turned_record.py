"""The plan of a scan at an angle and its certificate as plain data: the content of its manifest."""

import hashlib
from collections.abc import Mapping, Sequence
from typing import Any

from msgspec import structs

from tablegen.certificate.turned_errors import TurnedCertificate
from tablegen.manifest.record import frame_axis_record, sequence_record, tilt_record
from tablegen.manifest.write import readable
from tablegen.planning.turned_plan import TurnedPlan
from tablegen.version import __version__


def turned_record(plan: TurnedPlan) -> dict[str, Any]:
    """Return everything that decides what a device plays, as JSON-ready data."""
    geometry = plan.geometry
    return {
        "name": plan.name,
        "scanner": plan.scanner,
        "sequence": sequence_record(plan.schedule),
        "turned": {
            "angle_deg": geometry.angle_deg,
            "size_nm": list(geometry.size_nm),
            "coupling": [geometry.x_per_y, geometry.y_per_x],
            "drift_nm_per_s": list(geometry.drift_nm_per_s),
            "axes": {axis.axis: frame_axis_record(axis.motion, axis.program, axis.converter) for axis in plan.axes},
            **{tilt.name: tilt_record(tilt) for tilt in plan.tilts},
        },
    }


def turned_manifest(
    record: dict[str, Any],
    digest: str,
    formats: Sequence[str],
    certificate: TurnedCertificate,
    files: Mapping[str, bytes],
    clocks_per_tick: int = 0,
) -> bytes:
    """Write the plan's record with its hash, the certificate, and the SHA-256 of every other file of the build.

    ``formats`` stand in it unless they are c alone, ``clocks_per_tick`` unless it is 0.
    """
    manifest = {
        "tablegen": __version__,
        "hash": digest,
        **record,
        **({"formats": list(formats)} if list(formats) != ["c"] else {}),
        **({"clocks_per_tick": clocks_per_tick} if clocks_per_tick else {}),
        "certificate": certificate_record(certificate),
        "files": {name: hashlib.sha256(content).hexdigest() for name, content in sorted(files.items())},
    }
    return (readable(manifest) + "\n").encode("ascii")


def certificate_record(certificate: TurnedCertificate) -> dict[str, Any]:
    """Return a certificate as JSON-ready data; figures have 5 decimals, since their last bits differ by machine."""

    def figure(value: Any) -> Any:
        if isinstance(value, tuple):
            return [figure(each) for each in value]
        return round(value, 5)

    errors = {key: figure(value) for key, value in structs.asdict(certificate.errors).items()}
    codes = {axis: structs.asdict(one) for axis, one in zip("xy", certificate.codes, strict=True)}
    tilts = certificate.tilts
    return {
        "errors": errors,
        "codes": codes | {name: structs.asdict(each.codes) for name, each in tilts.items()},
        **{
            name: {"error_lsb": figure(each.error_lsb), "error_nm": figure(each.error_nm)}
            for name, each in tilts.items()
        },
    }
