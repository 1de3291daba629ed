"""The terminal of ``tablegen live``: keys that move, zoom, speed up and park, and where the scan is."""

from math import cos, radians, sin
from typing import TYPE_CHECKING

import click

from tablegen.cli.shared.terminal import ARROWS

if TYPE_CHECKING:
    from tablegen.api.live import Live, LiveAxis, LiveScan
    from tablegen.api.live_preview import LivePreview
    from tablegen.api.live_tilt import LiveZ
    from tablegen.link.device import Device
    from tablegen.planning.line_plan import LinePlan

KEYS = "arrows move by a tenth, + - zoom, [ ] turn, < > line rate, p park, t start, q quit (the scan plays on)"
_MOVES = {"up": (0, 1), "down": (0, -1), "right": (1, 0), "left": (-1, 0)}
_SHARE = 0.1  # of the size, by which a key moves
_ZOOMS = {"+": 0.8, "-": 1.25}
_TURNS_DEG = {"[": 5.0, "]": -5.0}
_RATES = {"<": 0.8, ">": 1.25}
_BAR = 40  # characters


def follow_keys(live: "Live", device: "Device", first: "LiveScan") -> None:
    """Carry out keys until q, and show after each where the scan is."""
    click.echo(KEYS)
    click.echo(_place(live, first))
    while (key := _key()) not in ("q", "Q", ""):
        if text := _done(live, device, key):
            click.echo(text)


def show_preview(preview: "LivePreview") -> None:
    """Show that a preview plays, and how far it is from the scan that follows."""
    errors = f"{preview.x_error_percent:.2g} % of x, {preview.y_error_percent:.2g} % of y"
    click.echo(f"preview plays, within {errors}; the exact scan follows")


def show_stage(stage: str) -> None:
    """Show the stage of a plan that takes seconds."""
    click.echo(f"{stage} ...")


def _key() -> str:
    """Return the next key; nothing at the end of the input."""
    try:
        return click.getchar()
    except EOFError:
        return ""


def _done(live: "Live", device: "Device", key: str) -> str:
    """Carry out a key, and say what came of it; nothing for a key without a meaning."""
    from tablegen.base.input_errors import Rejected
    from tablegen.link.errors import Refused, Unsuitable

    try:
        if key in ARROWS:
            return _place(live, live.move(*_distances(live, *_MOVES[ARROWS[key]])))
        if key in _ZOOMS:
            return _place(live, live.zoom(_ZOOMS[key]))
        if key in _TURNS_DEG:
            return _place(live, live.rotate(_TURNS_DEG[key]))
        if key in _RATES:
            rate_hz = float(live.plan.schedule.line_rate) * _RATES[key]
            return _place(live, live.set({"timing.line_rate_hz": rate_hz}))
        if key == "p":
            device.park()
            return "parks"
        if key == "t":
            device.arm()
            device.trigger()
            return "starts a frame"
    except Rejected as rejected:
        return "\n".join(f"not possible: {problem}" for problem in rejected.problems)
    except (Refused, Unsuitable) as error:
        return f"not possible: {error}"
    return ""


def _distances(live: "Live", right: int, up: int) -> tuple[float, float]:
    """Return how far to move the axes of the scanner, in nm: along the lines to the right, and across them."""
    x, y = live.place
    along, across = right * _SHARE * x.drive.size_nm, up * _SHARE * y.drive.size_nm
    angle = radians(live.angle_deg)
    return cos(angle) * along - sin(angle) * across, sin(angle) * along + cos(angle) * across


def _place(live: "Live", scan: "LiveScan") -> str:
    """Describe the scan that plays: a bar of the driver's range for each axis, rate, and how it began."""
    rows = [_bar(line, axis) for line, axis in zip(live.place, (scan.x, scan.y), strict=True)]
    rows += [_bar_beside(name, one) for name, one in (("z", scan.z), ("aux", scan.aux)) if one is not None]
    how = {"keep": "the frame goes on", "frame": "from a new frame", "line": "a frame begins", None: "played already"}
    angle = f", {scan.angle_deg:.4g} degrees" if scan.angle_deg else ""
    return "\n".join([*rows, f"{scan.line_rate_hz:.4g} Hz, {scan.lines} lines{angle}; {how[scan.swap]}"])


def _bar(line: "LinePlan", axis: "LiveAxis") -> str:
    drive, driver = line.drive, line.drive.driver
    half = 0.5 * axis.amplitude_v
    low, high = (driver.share(drive.v_offset + by) for by in (-half, half))
    bar = _drawn(low, high)
    place = f"{drive.size_nm:.5g} nm at {drive.position_nm:.5g} nm"
    drift = "" if axis.drift_nm is None else f", drifts {axis.drift_nm:.2g} nm in the first frame"
    return f"{line.axis} {driver.v_min:g} V [{bar}] {driver.v_max:g} V  {place}{drift}"


def _bar_beside(name: str, z: "LiveZ") -> str:
    """Draw the heights of z or aux in a frame in its whole range."""
    below, above, height = z.room_below_nm, z.room_above_nm, z.highest_nm - z.lowest_nm
    whole = below + height + above
    bottom, top = z.lowest_nm - below, z.highest_nm + above
    bar = _drawn(below / whole, (below + height) / whole)
    room = f"{height:.4g} nm about {z.offset_v:.5g} V, room {below:.4g} nm below, {above:.4g} nm above"
    return f"{name} {bottom:.4g} nm [{bar}] {top:.4g} nm  {room}"


def _drawn(low: float, high: float) -> str:
    """Return a bar with the part between two shares of it drawn."""
    first = min(max(int(low * _BAR), 0), _BAR - 1)
    last = min(max(int(high * _BAR), first), _BAR - 1)
    return "." * first + "=" * (last + 1 - first) + "." * (_BAR - 1 - last)
