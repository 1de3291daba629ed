"""Pixels of a line that is not straight in time: windows and ticks of each pixel, from where the piezo is."""

import numpy as np
from msgspec.structs import replace

from tablegen.base.input_errors import Unphysical
from tablegen.device.schedule import Schedule, Window
from tablegen.numerics.arrays import Floats, Ints
from tablegen.waveform.series import FourierSeries

_GRID = 1 << 14  # times of a period between which the position is interpolated: exact to 1e-7 of the line
_MOST_TICKS = 65535  # of a pixel


def with_pixel_table(schedule: Schedule, place: FourierSeries, window: tuple[float, float]) -> Schedule:
    """Return the schedule with pixels of equal steps in position, on one grid in trace and retrace.

    Parameters
    ----------
    schedule
        The schedule of the scan, whose windows in a line are replaced.
    place
        Position of the fast axis over a line, 0..1.
    window
        The imaged part of the line, 0..1.

    Raises
    ------
    Unphysical
        If a pixel is shorter than a tick, or too long, or the piezo goes to and fro.
    """
    ticks, pixels = schedule.ticks, schedule.pixels
    edges = np.linspace(*window, pixels + 1)
    rising, falling = passages(place, edges)
    trace, retrace = (whole_ticks(times * ticks) for times in (rising, falling[::-1]))
    for times in (np.diff(rising), np.diff(falling[::-1])):
        if float(np.min(times)) * ticks < 1.0:
            most = max(int(pixels * float(np.min(times)) * ticks), 1)
            raise Unphysical(
                f"{pixels} pixels are too many for a sine of {ticks} ticks: where it is fastest, one lasts "
                f"{float(np.min(times)) * ticks:.3g} ticks; about {most} pixels fit, or a lower line rate, or more "
                "updates a second"
            )
    counts = [np.diff(each) for each in (trace, retrace)]
    longest = max(int(np.max(each)) for each in counts)
    if longest > _MOST_TICKS:
        raise Unphysical(f"a pixel of {longest} ticks is longer than {_MOST_TICKS}; take more pixels")
    forward, backward = (tuple(each.tolist()) for each in counts)
    windows = {"forward": _window(trace), "backward": _window(retrace)}
    return replace(schedule, **windows, pixel_table=(forward, backward))


def whole_ticks(times: Floats) -> Ints:
    """Round the edges of pixels to whole ticks so that the middles of the pixels, where they are, move least.

    Each edge is the tick before or after its time. The sum of the squares over all pixels, each in units of its own
    length, is the least of all such choices.

    Parameters
    ----------
    times
        Times of edges in ticks, ascending by at least 1, shape (n,).

    Returns
    -------
    Ints
        Ticks, strictly ascending, shape (n,).
    """
    low = np.floor(times).astype(np.int64)
    late = (times - low).tolist()
    shorter = (1.0 / np.diff(times)).tolist()
    tick, best = low.tolist(), [0.0, 0.0]
    choices: list[tuple[int, int]] = []
    for k in range(1, len(tick)):
        costs, before = [], []
        for up in (0, 1):
            ways = []
            for was in (0, 1):
                moved = 0.5 * (up - late[k] + was - late[k - 1]) * shorter[k - 1]
                empty = tick[k] + up <= tick[k - 1] + was
                ways.append(float("inf") if empty else best[was] + moved * moved)
            before.append(0 if ways[0] <= ways[1] else 1)
            costs.append(min(ways))
        best = costs
        choices.append((before[0], before[1]))
    up = 0 if best[0] <= best[1] else 1
    edges = [tick[-1] + up]
    for k in range(len(tick) - 2, -1, -1):
        up = choices[k][up]
        edges.append(tick[k] + up)
    return np.array(edges[::-1], dtype=np.int64)


def passages(place: FourierSeries, positions: Floats) -> tuple[Floats, Floats]:
    """Return when the piezo is at positions on its way forward, and on its way back.

    Parameters
    ----------
    place
        Position over a period, 0..1.
    positions
        Positions, ascending, shape (n,).

    Returns
    -------
    rising, falling
        Times in periods from the start of the line, each shape (n,).

    Raises
    ------
    Unphysical
        If the piezo passes one of them twice in a direction, or outside its line.
    """
    values, (bottom, top) = place.on_grid(_GRID), turns(place)
    up = np.arange(round(bottom * _GRID), round(top * _GRID) + 1)
    down = np.arange(round(top * _GRID), round((bottom + 1.0) * _GRID) + 1)
    rising = _times_at(positions, values, up)
    falling = _times_at(positions, values, down[::-1])
    if rising[0] < 0.0 or falling[0] > 1.0:
        raise Unphysical("the piezo passes the image outside its line by its operator; take motion = 'line'")
    return rising, falling


def _times_at(positions: Floats, values: Floats, k: Ints) -> Floats:
    """Return the times in periods at which ``values`` of the grid, which ascend along ``k``, pass the positions."""
    way = values[k % _GRID]
    inside = (way >= positions[0]) & (way <= positions[-1])
    if np.any(np.diff(way)[inside[1:] & inside[:-1]] <= 0.0):
        raise Unphysical("the piezo goes to and fro within the image by its operator; take motion = 'line'")
    return np.interp(positions, way, k / _GRID)


def turns(place: FourierSeries) -> tuple[float, float]:
    """Return when the piezo turns at the bottom, within half a period of 0, and when it turns at the top after that."""
    values = place.on_grid(_GRID)
    bottom, top = int(np.argmin(values)), int(np.argmax(values))
    bottom -= _GRID if bottom > _GRID // 2 else 0
    return bottom / _GRID, (bottom + (top - bottom) % _GRID) / _GRID


def _window(edges: Ints) -> Window:
    return Window(int(edges[0]), int(edges[-1] - edges[0]))
