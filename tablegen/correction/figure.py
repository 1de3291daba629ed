"""A corrected scan as a picture: before, after, how far it was moved, what is left. Needs the extra ``plot``."""

from io import BytesIO
from typing import Any, Literal

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from tablegen.correction.straight import Picture, StraightScan
from tablegen.numerics.arrays import Floats

_METADATA_WITHOUT_DATE: dict[str, dict[str, Any]] = {"png": {}, "svg": {"Date": None}, "pdf": {"CreationDate": None}}
_ARROWS = 12  # along and across
_MOST_PIXELS = 400  # of a panel, along and across: more are not seen, and a file would have them all
_BLUE, _RED, _GREY = "#1f5fa8", "#c23b22", "#777777"


def draw_correction(scan: StraightScan, kind: Literal["png", "svg", "pdf"]) -> bytes:
    """Six panels; without a retrace, three."""
    trace = scan.judged[0]
    pair = scan.agreement is not None
    figure = Figure(figsize=(12.4, 8.2 if pair else 4.3), layout="constrained")
    panels = figure.subplots(2 if pair else 1, 3, squeeze=False)
    before, after = scan.taken[trace], scan.pictures[trace]
    _image(panels[0, 0], before, None, "before: trace")
    _image(panels[0, 1], after, scan.size_nm, "after: trace")
    _displacement(panels[0, 2], scan)
    if pair:
        retrace = scan.judged[1]
        raw = _levelled(before.heights) - _levelled(scan.taken[retrace].heights)
        straight = _levelled(after.heights) - _levelled(scan.pictures[retrace].heights)
        most = float(np.nanpercentile(np.abs(raw), 99.5)) or 1.0
        assert scan.agreement is not None
        for panel, values, share, name in (
            (panels[1, 0], raw, scan.agreement.difference[0], "before"),
            (panels[1, 1], straight, scan.agreement.difference[1], "after"),
        ):
            shown = _upright(_thinned(values), before.bottom_first)
            panel.imshow(shown, cmap="RdBu_r", vmin=-most, vmax=most, aspect="auto", interpolation="nearest")
            panel.set_title(f"{name}: trace less retrace, {100.0 * share:.3g} % of the contrast")
            panel.set(xticks=[], yticks=[])
        _apart(panels[1, 2], scan)
    out = BytesIO()
    with rc_context({"svg.hashsalt": "tablegen"}):
        figure.savefig(out, format=kind, dpi=110, metadata=_METADATA_WITHOUT_DATE[kind])
    return out.getvalue()


def _image(panel: Any, picture: Picture, size_nm: tuple[float, float] | None, title: str) -> None:
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
        aspect="equal" if size_nm is None or 0.3 < size_nm[0] / size_nm[1] < 3.0 else "auto",
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
    at_row, at_column = (
        np.linspace(0.04 * count, 0.96 * count - 1.0, _ARROWS).astype(np.int64) for count in (rows, columns)
    )
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
        panel.set_title(f"retrace further right than trace; after: {after:.2g} pixels at most")
    else:
        panel.set_title("trace and retrace have too little in common")
    panel.set(xlabel="column", ylabel="pixels")


def _levelled(heights: Floats) -> Floats:
    return np.asarray(heights - np.nanmedian(heights, axis=1, keepdims=True), dtype=np.float64)


def _upright(values: Floats, bottom_first: bool) -> Floats:
    return values[::-1] if bottom_first else values


def _thinned(values: Floats) -> Floats:
    rows, columns = (max(1, -(-count // _MOST_PIXELS)) for count in values.shape)
    return values[::rows, ::columns]
