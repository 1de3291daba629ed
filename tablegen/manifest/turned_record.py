"""The plan of a scan at an angle and its certificate as plain data: the content of its manifest."""

import hashlib
from collections.abc import Mapping, Sequence
from typing import Any

from msgspec import structs

from tablegen.certificate.turned_errors import TurnedCertificate
from tablegen.manifest.record import output_record, sequence_record
from tablegen.manifest.write import readable
from tablegen.planning.tilt import TiltedOutput
from tablegen.planning.turned_plan import TurnedAxis, TurnedPlan
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
            "axes": {axis.axis: _axis(axis) for axis in plan.axes},
            **({} if plan.z is None else {"z": _z(plan.z)}),
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
    z = certificate.z
    of_z = {} if z is None else {"error_lsb": figure(z.error_lsb), "error_nm": figure(z.error_nm)}
    return {
        "errors": errors,
        "codes": codes if z is None else codes | {"z": structs.asdict(z.codes)},
        **({"z": of_z} if of_z else {}),
    }


def _z(z: TiltedOutput) -> dict[str, Any]:
    slopes = {"slope_x": z.slope_x, "slope_y": z.slope_y, "nm_per_v": z.nm_per_v}
    return slopes | _axis(z)


def _axis(axis: TurnedAxis | TiltedOutput) -> dict[str, Any]:
    program = axis.program
    return {
        "fast_nm": axis.motion.fast_nm,
        "slow_nm": axis.motion.slow_nm,
        "bits": program.fast.bits,
        "words": program.fast.words.tolist(),
        "second": program.second.tolist(),
        "gains": {"spacing": program.gains.spacing, "words": program.gains.words.tolist()},
        "ratios": {"spacing": program.ratios.spacing, "words": program.ratios.words.tolist()},
        "slow": {
            "gain_word": program.slow.gain_word,
            "offset_word": program.slow.offset_word,
            "words": program.slow.words.tolist(),
        },
        "output": output_record(program.output, axis.converter),
    }
