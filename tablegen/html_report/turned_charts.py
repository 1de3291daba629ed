"""Charts of the positions of a frame at an angle: the errors over the image, and a lattice in it."""

import numpy as np

from tablegen.certificate.turned_errors import ImagedFrame
from tablegen.charts.chart import POSITION, Chart, DrawnCurve, Mark, Raster, Role
from tablegen.numerics.arrays import Bools, Ints
from tablegen.planning.turned_plan import TurnedPlan

_CELLS = 10.0  # of a lattice, over the shorter side of the image
_LEAST_LINES = 6  # of a cell
_COLUMNS = 256  # of a picture
_ZERO = Mark(0.0, "", "y")


def error_maps(plan: TurnedPlan, frame: ImagedFrame, key: str, title: str) -> tuple[Chart, Chart]:
    """Draw the errors along and across the lines over the image, those of the trace."""
    inside, rows, x, y = _trace(plan, frame)
    charts = []
    for name, left in zip(("along", "across"), frame.left_nm, strict=True):
        values = left[rows][::-1, inside]
        most = float(np.max(np.abs(values))) or 1.0
        raster = Raster(values, x, y, -most, most, "signed", f"error {name} the lines [nm]")
        charts.append(
            Chart(
                f"map-{name}-{key}", f"{title}: error {name} the lines", "along the lines [nm]", "across [nm]", (),
                raster=raster, equal=True,
            )
        )  # fmt: skip
    return charts[0], charts[1]


def line_errors(plan: TurnedPlan, frame: ImagedFrame, key: str, title: str) -> Chart:
    """Draw the residual of each imaged line of the frame."""
    lines = np.flatnonzero(plan.x.motion.imaged).astype(np.float64)
    rms = 100.0 * frame.line_rms(plan.geometry.size_nm)
    curve = DrawnCurve("residual", "other", lines, rms)
    return Chart(f"lines-{key}", f"{title}: lines", "line of the frame", "residual, rms [%]", (curve,), marks=(_ZERO,))


def mean_line(plan: TurnedPlan, frame: ImagedFrame, key: str, title: str) -> Chart:
    """Draw the residual along the lines, the mean over all imaged lines, of both directions."""
    motion, fast_nm = plan.x.motion, plan.geometry.size_nm[0]
    t = frame.t[motion.inside(frame.t)]
    mean, x = 100.0 * np.mean(frame.left_nm[0], axis=0) / fast_nm, motion.fast(t)
    sides: tuple[tuple[Role, Bools], ...] = (("forward", t <= motion.fast_turn), ("backward", t > motion.fast_turn))
    curves = []
    for side, here in sides:
        if np.any(here):
            order = np.argsort(x[here])
            curves.append(DrawnCurve(side, side, x[here][order], mean[here][order]))
    return Chart(
        f"mean-{key}", f"{title}: mean line", POSITION, "residual [% of the line]", tuple(curves), marks=(_ZERO,)
    )


def lattice_image(plan: TurnedPlan, frame: ImagedFrame, key: str, title: str) -> Chart:
    """Draw the trace of a square lattice whose rows are along the lines: rows that bend or lean are errors."""
    inside, rows, x, y = _trace(plan, frame)
    at = np.ix_(np.flatnonzero(plan.x.motion.imaged)[rows], np.flatnonzero(plan.x.motion.inside(frame.t))[inside])
    spacing = (y[1] - y[0]) / max(len(rows) - 1, 1)
    period = max(min(x[1] - x[0], y[1] - y[0]) / _CELLS, _LEAST_LINES * spacing)
    along, across = (one - float(np.mean(one)) for one in (frame.fast_nm[at], frame.slow_nm[at]))
    heights = np.cos(2.0 * np.pi * along / period) + np.cos(2.0 * np.pi * across / period)
    return Chart(
        f"image-{key}", f"{title}: lattice of {period:.3g} nm", "along the lines [nm]", "across [nm]", (),
        raster=Raster(heights[::-1], x, y, -2.0, 2.0), equal=True,
    )  # fmt: skip


def _trace(plan: TurnedPlan, frame: ImagedFrame) -> tuple[Ints, Ints, tuple[float, float], tuple[float, float]]:
    """Return which imaged samples and imaged lines a picture has, and the range of both in nm about the middle.

    The samples are those of the trace, thinned; lines are those of the way up, or of the way down where there are none.
    """
    motion, schedule, (fast_nm, slow_nm) = plan.x.motion, plan.schedule, plan.geometry.size_nm
    t = frame.t[motion.inside(frame.t)]
    inside = np.flatnonzero(t <= motion.fast_turn)
    inside = inside[:: -(-len(inside) // _COLUMNS)]
    numbers = np.flatnonzero(motion.imaged)
    rising = schedule.up if schedule.up.count else schedule.down
    rows = np.flatnonzero([at in rising for at in numbers.tolist()])
    if rising is schedule.down:
        rows = rows[::-1]
    columns, lines = frame.along[rows][:, inside], frame.across[rows][:, inside]
    x = float(np.min(columns)) * fast_nm, float(np.max(columns)) * fast_nm
    y = float(np.mean(lines[0])) * slow_nm, float(np.mean(lines[-1])) * slow_nm
    return inside, rows, x, y
