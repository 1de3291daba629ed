"""``tablegen status``: show the state and limits of a device."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tablegen.cli.device.connection import baud_option, connected, key_option, port_option
from tablegen.cli.shared.exit_status import ExitStatus

if TYPE_CHECKING:
    from tablegen.link.messages import AxisLimits, AxisShape, DeviceInfo, DeviceStatus, ZStatus

_FAULTS = ("slew", "clamp", "overrun", "underrun")
_FAULT_BITS = (1, 2, 4, 8)


@click.command("status", short_help="Show state, active scan, faults and limits of a device.")
@port_option()
@baud_option
@key_option
@click.option("--json", "as_json", is_flag=True, help="Print JSON instead of text.")
def device_status(port: str, baud: int, key_file: Path | None, as_json: bool) -> int:
    """Show the state, active scan, upload in progress, faults and limits of a device.

    \b
    Examples:
      tablegen status --port /dev/ttyUSB0
      tablegen status --port /dev/ttyUSB0 --json | jq .status.state

    Exit status: 0 done, 6 pyserial is missing, 7 no port, 8 no answer, 9 refused, 10 link lost,
    12 invalid answers.
    """
    with connected(port, baud, key_file) as device:
        info, limits, status = device.info, device.limits(), device.status()
    if as_json:
        import json

        click.echo(json.dumps(_record(info, limits, status), indent=2))
        return ExitStatus.OK
    for name, text in _rows(info, limits, status):
        click.echo(f"{name:<11} {text}")
    return ExitStatus.OK


def _features(info: "DeviceInfo") -> list[str]:
    from tablegen.link.messages import Feature

    return [feature.name.lower() for feature in Feature if feature in info.features and feature.name]


def _record(info: "DeviceInfo", limits: "tuple[AxisLimits, AxisLimits]", status: "DeviceStatus") -> dict[str, Any]:
    """Return all values, by the names of docs/protocol.md."""
    return {
        "device": {
            "version": info.version,
            "features": _features(info),
            "window": info.window,
            "data_bytes": info.data_bytes,
            "harmonics": info.harmonics,
            "image_bytes": info.image_bytes,
            "update_rate_hz": info.update_rate_hz,
            "axes": {
                name: {**_fields(shape), "limits": _fields(build), "limits_in_force": _fields(now)}
                for name, shape, build, now in (
                    ("x", info.x, info.x_limits, limits[0]),
                    ("y", info.y, info.y_limits, limits[1]),
                )
            },
            "z": None if info.z is None else _second(info.of_z),
        },
        "status": {
            "state": status.state.name.lower(),
            "upload": status.upload.name.lower(),
            "faults": [name for name, bit in zip(_FAULTS, _FAULT_BITS, strict=True) if status.faults & bit],
            "fault_counts": dict(zip(_FAULTS, status.fault_counts, strict=True)),
            "permits": status.permits,
            "boot": status.boot,
            "generation": status.generation,
            "line": status.line,
            "received": status.received,
            "image_crc": status.image_crc,
            "bad_frames": status.bad_frames,
            "hash": status.hash.hex() if any(status.hash) else None,
            "moved": status.moved,
            "z": None if status.z is None else _second_status(status.z),
        },
    }


def _second(of_z: "DeviceInfo") -> dict[str, Any]:
    """Return what the second sequencer has, whose x is z; its limits are those of the build."""
    axes = (("z", of_z.x, of_z.x_limits), ("rest", of_z.y, of_z.y_limits))
    return {
        "image_bytes": of_z.image_bytes,
        "slow_knots": of_z.slow_knots,
        "slow_index_bits": of_z.slow_index_bits,
        "axes": {name: {**_fields(shape), "limits": _fields(limits)} for name, shape, limits in axes},
    }


def _second_status(status: "ZStatus") -> dict[str, Any]:
    return {
        "plays": status.plays,
        "state": status.state.name.lower(),
        "faults": [name for name, bit in zip(_FAULTS, _FAULT_BITS, strict=True) if status.faults & bit],
        "fault_counts": dict(zip(_FAULTS, status.fault_counts, strict=True)),
        "generation": status.generation,
        "line": status.line,
    }


def _fields(values: "AxisShape | AxisLimits") -> dict[str, int]:
    from dataclasses import asdict

    return asdict(values)


def _rows(info: "DeviceInfo", limits: "tuple[AxisLimits, AxisLimits]", status: "DeviceStatus") -> list[tuple[str, str]]:
    """Return the rows of the table, the most urgent first."""
    from tablegen.link.messages import DeviceState, Feature, Upload

    state = {
        DeviceState.NO_PROGRAM: "no scan yet; send one with `tablegen upload`",
        DeviceState.PARKED: "parked; start the scan with `tablegen trigger`",
        DeviceState.PARKING: "ramping to the park codes",
        DeviceState.PLAYING: f"playing, line {status.line}",
    }[status.state]
    scan = status.hash.hex()[:12] if any(status.hash) else "hash unknown"
    scan = "moved by new words, which no plan has" if status.moved else scan
    upload = {
        Upload.NONE: "none in progress",
        Upload.RECEIVING: f"{status.received} bytes received; repeat the upload to continue",
        Upload.CHECKING: "being checked",
        Upload.WAITING: "complete, waiting for the start of a line",
    }[status.upload]
    faults = _fault_text(status)
    rows = [("state", state), ("scan", f"{scan}, generation {status.generation}"), ("upload", upload)]
    rows.append(("faults", faults))
    if Feature.INTERLOCK in info.features:
        rows.append(("interlock", "closed" if status.permits else "open: no upload can become active"))
    rate = f"{info.update_rate_hz} ticks/s" if info.update_rate_hz else "rate unknown"
    takes = [*(["tables"] if Feature.TABLES in info.features else [])]
    takes += [f"Fourier words of {info.harmonics} harmonics"] if Feature.FOURIER in info.features else []
    key = ", has a key" if Feature.KEY in info.features else ""
    rows.append(("device", f"{rate}, accepts {' and '.join(takes)}, {info.image_bytes} bytes{key}"))
    axes = [("x", info.x, limits[0]), ("y", info.y, limits[1])]
    if info.z is not None:
        axes.append(("z", info.z.x, info.z.x_limits))
    for name, shape, limit in axes:
        rows.append(
            (
                name,
                f"2^{shape.index_bits} words of {shape.word_bits} bits, codes {limit.code_min}..{limit.code_max} of "
                f"{shape.dac_bits} bits, steps up to {limit.max_step}, jumps up to {limit.max_jump}",
            )
        )
    if status.z is not None:
        follows = "follows the scan" if status.z.plays else "is not in the scan, and rests at its park code"
        rows.append(("output z", f"{follows}; faults: {_fault_text(status.z)}"))
    rows.append(("line", f"{status.bad_frames} bad frames since start {status.boot}"))
    return rows


def _fault_text(status: "DeviceStatus | ZStatus") -> str:
    counts = [f"{name} {count}" for name, count in zip(_FAULTS, status.fault_counts, strict=True) if count]
    return f"{', '.join(counts)}; clear with `tablegen clear`" if counts or status.faults else "none"
