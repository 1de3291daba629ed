"""A corrected scan as charts: before, after, the displacement, and the residual."""

from typing import Literal

import numpy as np

from tablegen.charts.chart import Arrows, Chart, DrawnCurve, Mark, Raster
from tablegen.charts.picture_file import PlottedCharts
from tablegen.correction.agreement import levelled
from tablegen.correction.straight import ScanPicture, StraightScan
from tablegen.numerics.arrays import Floats, Ints

_ARROWS = 12  # along and across
_MOST_PIXELS = 256  # of a picture, along and across: more would not be visible, but enlarge the file


def correction_charts(scan: StraightScan, name: str) -> PlottedCharts:
    """Return up to six charts: comparisons if there is a retrace, the residual lattice if there is one."""
    trace = scan.reference[0]
    charts = [
        height_chart("before", scan.raw[trace], None, "before: trace"),
        height_chart("after", scan.pictures[trace], scan.size_nm, "after: trace"),
        _moved(scan),
    ]
    brief = charts[1:2]
    if scan.agreement is not None:
        charts += [_apart(scan), _difference(scan)]
        brief.append(charts[3])
    if scan.lattice is not None:
        charts.append(_lattice(scan))
    return PlottedCharts(f"{name}: correction", tuple(charts), 3, tuple(brief))


def height_chart(key: str, picture: ScanPicture, size_nm: tuple[float, float] | None, title: str) -> Chart:
    """Draw the heights of a picture in shades, levelled line by line; in nm where its size is known, else in pixels."""
    heights = _levelled(picture.heights)
    low, high = (float(np.nanpercentile(heights, share)) for share in (1.0, 99.0))
    unit = f"heights [{picture.unit}]" if picture.unit else "heights [units of the file]"
    return _shown(key, title, heights, picture.bottom_first, (low, high), size_nm, "grey", unit)


def _shown(
    key: str,
    title: str,
    values: Floats,
    bottom_first: bool,
    shades: tuple[float, float],
    size_nm: tuple[float, float] | None,
    kind: Literal["grey", "heat", "signed"],
    label: str,
    arrows: Arrows | None = None,
) -> Chart:
    """Draw values over a picture: upwards from below in nm, or in pixels."""
    rows, columns = values.shape
    width, height = size_nm or (float(columns), float(rows))
    unit = "pixels" if size_nm is None else "nm"
    upright = _thinned(values)[::-1] if bottom_first else _thinned(values)
    raster = Raster(upright, (0.0, width), (0.0, height), *shades, kind, label)
    return Chart(key, title, f"x [{unit}]", f"y [{unit}]", (), raster=raster, arrows=arrows, equal=True)


def _moved(scan: StraightScan) -> Chart:
    """Draw the displacement in shades, with arrows in true proportion to the picture."""
    first = scan.raw[scan.reference[0]]
    x, y = scan.distortion.displacement(first.forward)
    x, y = (values - float(np.nanmean(values)) for values in (x, y))
    far = np.hypot(x, y)
    arrows = _arrows(-x, -y, first.bottom_first, 1.0)
    label = "moved by [pixels]"
    title = "by how much the trace was moved"
    return _shown(
        "moved", title, far, first.bottom_first, (0.0, float(np.nanmax(far)) or 1.0), None, "heat", label, arrows
    )


def _lattice(scan: StraightScan) -> Chart:
    """Draw the deviation from a perfect lattice after the correction; arrows show the direction, much too long."""
    assert scan.lattice is not None
    picture = scan.pictures[scan.reference[0]]
    rows, columns = picture.heights.shape
    x, y = scan.lattice.x, scan.lattice.y
    far = 100.0 * (np.abs(x) / columns if y is None else np.hypot(x / columns, y / rows))
    down = np.zeros_like(x) if y is None else y
    longest = float(np.nanmax(np.hypot(x, down))) or 1.0
    arrows = _arrows(x, down, picture.bottom_first, columns / _ARROWS / longest)
    worst = 100.0 * max(one / count for one, count in zip(scan.lattice.worst, (columns, rows), strict=True))
    title = f"lattice after: off by {worst:.2g} % of the width at most"
    shades = (0.0, float(np.nanmax(far)) or 1.0)
    return _shown("lattice", title, far, picture.bottom_first, shades, None, "heat", "off by [% of the width]", arrows)


def _arrows(right: Floats, down: Floats, bottom_first: bool, scale: float) -> Arrows:
    """Return some of the arrows of a picture, whose rows run downwards, or upwards with the lowest one first."""
    rows, columns = right.shape
    at_row, at_column = _places(rows), _places(columns)
    grid = np.ix_(at_row, at_column)
    across, below = np.meshgrid(at_column + 0.5, at_row + 0.5)
    up = below if bottom_first else rows - below
    rising = down[grid] if bottom_first else -down[grid]
    finite = np.isfinite(right[grid]) & np.isfinite(rising)
    return Arrows(across[finite], up[finite], scale * right[grid][finite], scale * rising[finite])


def _places(count: int) -> Ints:
    return np.linspace(0.04 * count, 0.96 * count - 1.0, _ARROWS).astype(np.int64)


def _difference(scan: StraightScan) -> Chart:
    """Draw trace less retrace: the left half before, the right half after."""
    assert scan.agreement is not None
    trace, retrace = scan.reference
    raw, straight = (
        _levelled(group[trace].heights) - _levelled(group[retrace].heights) for group in (scan.raw, scan.pictures)
    )
    columns = raw.shape[1]
    both = np.concatenate([raw[:, : columns // 2], straight[:, columns // 2 :]], axis=1)
    most = float(np.nanpercentile(np.abs(raw), 99.5)) or 1.0
    first, last = (100.0 * share for share in scan.agreement.difference)
    title = f"trace less retrace: left before, {first:.3g} %, right after, {last:.3g} % of the contrast"
    picture = scan.raw[trace]
    unit = f"difference [{picture.unit or 'units of the file'}]"
    return _shown("difference", title, both, picture.bottom_first, (-most, most), None, "signed", unit)


def _apart(scan: StraightScan) -> Chart:
    agreement = scan.agreement
    assert agreement is not None
    title, curves = "trace and retrace have too little in common", []
    if len(agreement.place):
        after = float(np.max(np.abs(agreement.offsets[1])))
        title = f"retrace right of the trace, after: {after:.2g} pixels"
        before = DrawnCurve("before", "before", agreement.place, agreement.offsets[0])
        curves = [before, DrawnCurve("after", "other", agreement.place, agreement.offsets[1])]
    zero = (Mark(0.0, "", "y"),)
    return Chart("apart", title, "column [pixels]", "distance [pixels]", tuple(curves), marks=zero)


def _levelled(heights: Floats) -> Floats:
    return np.where(np.isfinite(heights), levelled(heights), np.nan)


def _thinned(values: Floats) -> Floats:
    rows, columns = (max(1, -(-count // _MOST_PIXELS)) for count in values.shape)
    return values[::rows, ::columns]
