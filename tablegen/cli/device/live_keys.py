"""The terminal of ``tablegen live``: keys that move, zoom, speed up and park, and where the scan is."""

from typing import TYPE_CHECKING

import click

from tablegen.cli.shared.terminal import ARROWS

if TYPE_CHECKING:
    from tablegen.api.live import Live, LiveScan
    from tablegen.api.live_preview import LivePreview
    from tablegen.link.device import Device
    from tablegen.planning.line_plan import LinePlan

KEYS = "arrows move by a tenth, + - zoom, < > line rate, p park, t start, q quit (the scan plays on)"
_MOVES = {"up": (0, 1), "down": (0, -1), "right": (1, 0), "left": (-1, 0)}
_SHARE = 0.1  # of the size, by which a key moves
_ZOOMS = {"+": 0.8, "-": 1.25}
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

    x, y = live.plan.lines
    try:
        if key in ARROWS:
            right, up = _MOVES[ARROWS[key]]
            return _place(live, live.move(right * _SHARE * x.drive.size_nm, up * _SHARE * y.drive.size_nm))
        if key in _ZOOMS:
            return _place(live, live.zoom(_ZOOMS[key]))
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


def _place(live: "Live", scan: "LiveScan") -> str:
    """Describe the scan that plays: a bar of the driver's range for each axis, rate, and how it began."""
    rows = [_bar(line) for line in live.plan.lines]
    how = {"keep": "the frame goes on", "frame": "from a new frame", "line": "a frame begins", None: "played already"}
    return "\n".join([*rows, f"{scan.line_rate_hz:.4g} Hz, {scan.lines} lines; {how[scan.swap]}"])


def _bar(line: "LinePlan") -> str:
    drive, driver = line.drive, line.drive.driver
    half = 0.0 if drive.resting else 0.5 * drive.v_amplitude
    low, high = (driver.share(drive.v_offset + by) for by in (-half, half))
    first = min(max(int(low * _BAR), 0), _BAR - 1)
    last = min(max(int(high * _BAR), first), _BAR - 1)
    bar = "." * first + "=" * (last + 1 - first) + "." * (_BAR - 1 - last)
    place = f"{drive.size_nm:.5g} nm at {drive.position_nm:.5g} nm"
    return f"{line.axis} {driver.v_min:g} V [{bar}] {driver.v_max:g} V  {place}"
