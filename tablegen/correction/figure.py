"""A corrected scan as a picture: before, after, how far it was moved, what is left. Needs the extra ``plot``."""

from io import BytesIO
from typing import Any, Literal

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from tablegen.correction.agreement import levelled
from tablegen.correction.straight import ScanPicture, StraightScan
from tablegen.numerics.arrays import Floats, Ints

_METADATA_WITHOUT_DATE: dict[str, dict[str, Any]] = {"png": {}, "svg": {"Date": None}, "pdf": {"CreationDate": None}}
_ARROWS = 12  # along and across
_MOST_PIXELS = 400  # of a panel, along and across: more are not seen, and a file would have them all
_BLUE, _GREY = "#1f5fa8", "#777777"


def draw_correction(scan: StraightScan, kind: Literal["png", "svg", "pdf"]) -> bytes:
    """Up to six panels: those of a comparison where there is a retrace, that of the lattice where there is one."""
    trace = scan.judged[0]
    before, after = scan.taken[trace], scan.pictures[trace]
    more = [_apart, _difference] if scan.agreement is not None else []
    if scan.lattice is not None:
        more.append(_lattice)
    rows = 2 if more else 1
    figure = Figure(figsize=(13.0, 4.4 * rows), layout="constrained")
    panels = figure.subplots(rows, 3, squeeze=False)
    _image(panels[0, 0], before, None, "before: trace")
    _image(panels[0, 1], after, scan.size_nm, "after: trace")
    _displacement(panels[0, 2], scan)
    for panel, draw in zip(panels[1:].flat, more, strict=False):
        draw(panel, scan)
    for panel in panels.flat[3 + len(more) :]:
        panel.set_visible(False)
    for panel in panels.flat:
        panel.title.set_fontsize("medium")
    out = BytesIO()
    with rc_context({"svg.hashsalt": "tablegen"}):
        figure.savefig(out, format=kind, dpi=110, metadata=_METADATA_WITHOUT_DATE[kind])
    return out.getvalue()


def _difference(panel: Any, scan: StraightScan) -> None:
    """Trace less retrace: the left half before, the right half after."""
    assert scan.agreement is not None
    trace, retrace = scan.judged
    raw, straight = (
        _levelled(group[trace].heights) - _levelled(group[retrace].heights) for group in (scan.taken, scan.pictures)
    )
    columns = raw.shape[1]
    both = np.concatenate([raw[:, : columns // 2], straight[:, columns // 2 :]], axis=1)
    most = float(np.nanpercentile(np.abs(raw), 99.5)) or 1.0
    shown = _upright(_thinned(both), scan.taken[trace].bottom_first)
    panel.imshow(
        shown,
        cmap="RdBu_r",
        vmin=-most,
        vmax=most,
        extent=(0.0, columns, raw.shape[0], 0.0),
        interpolation="nearest",
    )
    panel.axvline(0.5 * columns, color="black", lw=0.8)
    first, last = (100.0 * share for share in scan.agreement.difference)
    panel.set_title(f"trace less retrace: before {first:.3g} % | after {last:.3g} % of the contrast")
    panel.set(xlabel="pixels")


def _lattice(panel: Any, scan: StraightScan) -> None:
    """How far the sample is off a perfect lattice, in percent of the width."""
    assert scan.lattice is not None
    picture = scan.pictures[scan.judged[0]]
    rows, columns = picture.heights.shape
    x, y = scan.lattice.x, scan.lattice.y
    size = np.abs(x) / columns if y is None else np.hypot(x / columns, y / rows)
    shown = _upright(_thinned(100.0 * size), picture.bottom_first)
    image = panel.imshow(shown, cmap="viridis", vmin=0.0, extent=(0.0, columns, rows, 0.0), interpolation="nearest")
    panel.figure.colorbar(image, ax=panel, label="% of the width", shrink=0.85)
    at_row, at_column = _arrow_places(rows, columns)
    grid = np.ix_(at_row, at_column)
    right, down = x[grid], np.zeros_like(x[grid]) if y is None else y[grid]
    where = at_row
    if picture.bottom_first:
        where, down = rows - 1 - at_row, -down
    panel.quiver(at_column, where, right, down, color="white", angles="xy", width=0.004)
    worst = max(one / count for one, count in zip(scan.lattice.worst, (columns, rows), strict=True))
    panel.set_title(f"lattice after: off by {100.0 * worst:.2g} % of the width at most")
    panel.set(xlabel="pixels", xlim=(0, columns), ylim=(rows, 0))


def _arrow_places(rows: int, columns: int) -> tuple[Ints, Ints]:
    down, right = (np.linspace(0.04 * count, 0.96 * count - 1.0, _ARROWS).astype(np.int64) for count in (rows, columns))
    return down, right


def _image(panel: Any, picture: ScanPicture, size_nm: tuple[float, float] | None, title: str) -> None:
    heights = _levelled(picture.heights)
    low, high = (float(np.nanpercentile(heights, share)) for share in (1.0, 99.0))
    rows, columns = heights.shape
    extent = None if size_nm is None else (0.0, size_nm[0], size_nm[1], 0.0)
    shown = _upright(_thinned(heights), picture.bottom_first)
    panel.set_facecolor("#ffd9d0")  # what was not imaged
    panel.imshow(
        shown,
        cmap="gray",
        vmin=low,
        vmax=high,
        extent=extent or (0.0, columns, rows, 0.0),
        aspect="equal",
        interpolation="nearest",
    )
    panel.set_title(title)
    panel.set(xlabel="nm" if size_nm is not None else "pixels", ylabel="")


def _displacement(panel: Any, scan: StraightScan) -> None:
    """How far the trace was moved: colour for its size, arrows for where to, in true proportion to the picture."""
    forward = scan.taken[scan.judged[0]].forward
    x, y = scan.distortion.moved(forward)
    x, y = (values - float(np.nanmean(values)) for values in (x, y))
    upside_down = scan.taken[scan.judged[0]].bottom_first
    size = np.hypot(x, y)
    rows, columns = size.shape
    shown = _upright(_thinned(size), upside_down)
    image = panel.imshow(shown, cmap="viridis", extent=(0.0, columns, rows, 0.0), interpolation="nearest")
    panel.figure.colorbar(image, ax=panel, label="pixels", shrink=0.85)
    at_row, at_column = _arrow_places(rows, columns)
    grid = np.ix_(at_row, at_column)
    right, down = -x[grid], -y[grid]
    where = at_row
    if upside_down:
        where, down = rows - 1 - at_row, -down
    panel.quiver(at_column, where, right, down, color="white", angles="xy", scale_units="xy", scale=1.0, width=0.005)
    panel.set(title="by how much the trace was moved", xlabel="pixels", xlim=(0, columns), ylim=(rows, 0))


def _apart(panel: Any, scan: StraightScan) -> None:
    found = scan.agreement
    assert found is not None
    panel.axhline(0.0, color="#bbbbbb", lw=0.8)
    if len(found.place):
        for values, name, colour in zip(found.apart, ("before", "after"), (_GREY, _BLUE), strict=True):
            panel.plot(found.place, values, "o-", color=colour, markersize=3.5, lw=1.4, label=name)
        panel.legend(frameon=False)
        after = float(np.max(np.abs(found.apart[1])))
        panel.set_title(f"retrace right of the trace; after: {after:.2g} pixels at most")
    else:
        panel.set_title("trace and retrace have too little in common")
    panel.set(xlabel="column", ylabel="pixels")


def _levelled(heights: Floats) -> Floats:
    return np.where(np.isfinite(heights), levelled(heights), np.nan)


def _upright(values: Floats, bottom_first: bool) -> Floats:
    return values[::-1] if bottom_first else values


def _thinned(values: Floats) -> Floats:
    rows, columns = (max(1, -(-count // _MOST_PIXELS)) for count in values.shape)
    return values[::rows, ::columns]
