"""``tablegen live``: change the scan of a running device, by keys, or by lines of JSON from another program."""

import json
import sys
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tablegen.cli.device.connection import baud_option, connected, key_option, port_option
from tablegen.cli.shared.common import fail, planned_at_any_angle, scan_argument
from tablegen.cli.shared.exit_status import ExitStatus

if TYPE_CHECKING:
    from tablegen.api.live import Live
    from tablegen.link.device import Device
    from tablegen.link.messages import DeviceStatus

_LONGEST_LINE = 65_536  # characters of a request


@click.command(short_help="Move, zoom and change the scan of a running device.")
@scan_argument
@port_option()
@baud_option
@key_option
def live(scan: Path, port: str, baud: int, key_file: Path | None) -> int:
    """Put a scan into a running device and start it; then change it while it plays: by keys, or by another program.

    In a terminal, keys move, zoom, turn, change the line rate and park; the command shows where the scan is in the
    range of the driver. Otherwise a request is a line of JSON on standard input, and has one line of JSON as its
    answer: "ok" is true with the scan that plays now, or false with the "error". After an error the scan before plays
    on. At the end of the input the device plays on.

    \b
    {"do": "move", "x_nm": 50, "y_nm": 0}                move the scan by nm
    {"do": "zoom", "factor": 0.8}                        make it smaller or larger about its middle
    {"do": "rotate", "by_deg": 15}                       turn it counterclockwise about its middle
    {"do": "set", "values": {"timing.line_rate_hz": 2}}  give keys of the scan file other values
    {"do": "park"}   {"do": "trigger"}   {"do": "status"}

    Every change is planned and checked as a build would be, and sent only if scanner, scan and device allow it. The
    frame goes on if the firmware has DAC_COMMIT_MODES=1, and ticks and lines stay the same. With DAC_MOVE=1 a preview
    plays before the exact scan. A scan at an angle needs an operator on both axes, and seconds for each change; a
    preview plays until then. The output z of a tilted sample follows its plane through all changes, on firmware with
    DAC_LINK_Z=1.

    \b
    Example:
      echo '{"do": "move", "x_nm": 50}' | tablegen live annexin_200nm.toml --port /dev/ttyUSB0

    \b
    Exit status: 0 the input ended, or q in a terminal, 2 wrong input, 3 a limit of the scan is
    exceeded, 6 pyserial is missing, 7 no port, 8 no answer, 9 the device refuses the scan of the
    file, 10 link lost or timeout, 12 invalid answers.
    """
    from tablegen.api.live import Live
    from tablegen.base.input_errors import Rejected
    from tablegen.cli.device.live_keys import follow_keys, show_preview, show_stage

    planned_at_any_angle(scan)  # what is wrong with it needs no device
    with connected(port, baud, key_file, goes_on="with the scan that plays") as device:
        in_terminal = sys.stdin.isatty() and sys.stdout.isatty()
        try:
            if in_terminal:
                live_scan = Live(device, scan, on_preview=show_preview, on_stage=show_stage)
            else:
                live_scan = Live(device, scan)
            first = live_scan.start()
        except Rejected as rejected:
            fail(rejected.problems, ExitStatus.WRONG_INPUT)
        if in_terminal:
            follow_keys(live_scan, device, first)
            return ExitStatus.OK
        _say({"ok": True, "scan": first.as_dict()})
        while line := sys.stdin.readline(_LONGEST_LINE):
            whole = len(line) < _LONGEST_LINE or line.endswith("\n")
            while not whole:  # what is left of a line is no request of its own
                whole = not (rest := sys.stdin.readline(_LONGEST_LINE)) or rest.endswith("\n")
                line = ""
            if not line:
                _say({"ok": False, "error": f"the line has more than {_LONGEST_LINE} characters"})
            elif line.strip():
                _say(_answer(live_scan, device, line))
    return ExitStatus.OK


def _say(answer: dict[str, Any]) -> None:
    click.echo(json.dumps(answer))


def _answer(live_scan: "Live", device: "Device", line: str) -> dict[str, Any]:
    """Carry out one request. A lost link is no answer: it ends the command."""
    from tablegen.base.input_errors import Rejected
    from tablegen.link.errors import Refused, Unsuitable

    try:
        return {"ok": True, **_done(live_scan, device, line)}
    except Rejected as rejected:
        return {"ok": False, "error": "; ".join(map(str, rejected.problems))}
    except (Refused, Unsuitable, _WrongRequest) as error:
        return {"ok": False, "error": str(error)}


class _WrongRequest(Exception):
    """A line that is no request."""


def _done(live_scan: "Live", device: "Device", line: str) -> dict[str, Any]:
    try:
        request = json.loads(line)
    except ValueError as error:
        raise _WrongRequest(f"the line is not JSON: {error}") from None
    except RecursionError:
        raise _WrongRequest("the line is nested too deeply for a request") from None
    name = request.pop("do", None) if isinstance(request, dict) else None
    if not isinstance(name, str) or name not in _REQUESTS:
        raise _WrongRequest(f'a request is an object with "do": {", ".join(_REQUESTS)}')
    allowed, act = _REQUESTS[name]
    if unknown := [key for key in request if key not in allowed]:
        raise _WrongRequest(f"{name}: unknown {', '.join(unknown)}; possible: {', '.join(allowed) or 'nothing'}")
    return act(live_scan, device, request)


def _number(request: dict[str, Any], key: str, default: float | None) -> float:
    value = request.get(key, default)
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < float("inf"):
        raise _WrongRequest(f"{key} is {json.dumps(value)}; give a number")
    return float(value)


def _move(live_scan: "Live", device: "Device", request: dict[str, Any]) -> dict[str, Any]:
    scan = live_scan.move(_number(request, "x_nm", 0.0), _number(request, "y_nm", 0.0))
    return {"scan": scan.as_dict()}


def _zoom(live_scan: "Live", device: "Device", request: dict[str, Any]) -> dict[str, Any]:
    return {"scan": live_scan.zoom(_number(request, "factor", None)).as_dict()}


def _rotate(live_scan: "Live", device: "Device", request: dict[str, Any]) -> dict[str, Any]:
    return {"scan": live_scan.rotate(_number(request, "by_deg", None)).as_dict()}


def _set(live_scan: "Live", device: "Device", request: dict[str, Any]) -> dict[str, Any]:
    values = request.get("values")
    if not isinstance(values, dict):
        raise _WrongRequest('values is missing, or no object; give {"KEY": VALUE} with keys of the scan file')
    return {"scan": live_scan.set(values).as_dict()}


def _park(live_scan: "Live", device: "Device", request: dict[str, Any]) -> dict[str, Any]:
    device.park()
    return _status(live_scan, device, request)


def _trigger(live_scan: "Live", device: "Device", request: dict[str, Any]) -> dict[str, Any]:
    device.arm()
    device.trigger()
    return _status(live_scan, device, request)


def _status(live_scan: "Live", device: "Device", request: dict[str, Any]) -> dict[str, Any]:
    status = device.status()
    return {
        "status": {
            "state": status.state.name.lower(),
            "line": status.line,
            "generation": status.generation,
            "faults": status.faults,
            "digest": status.hash.hex(),
            "moved": status.moved,
            **_where(live_scan, status),
        }
    }


def _where(live_scan: "Live", status: "DeviceStatus") -> dict[str, Any]:
    """Return position and size of each axis, and z; null where the device plays a scan that is not of this session."""
    if status.generation != live_scan.generation:
        return {"x": None, "y": None, "z": None, "aux": None}
    z = live_scan.z
    faults = {} if status.z is None else {"faults": status.z.faults}
    return {
        **{
            line.axis: {"position_nm": line.drive.position_nm, "size_nm": line.drive.size_nm}
            for line in live_scan.place
        },
        "z": None if z is None else {**asdict(z), **faults},
        "aux": None if live_scan.aux is None else asdict(live_scan.aux),
    }


_Act = Callable[["Live", "Device", dict[str, Any]], dict[str, Any]]
_REQUESTS: dict[str, tuple[tuple[str, ...], _Act]] = {
    "move": (("x_nm", "y_nm"), _move),
    "zoom": (("factor",), _zoom),
    "rotate": (("by_deg",), _rotate),
    "set": (("values",), _set),
    "park": ((), _park),
    "trigger": ((), _trigger),
    "status": ((), _status),
}
