"""An operator's fit as charts: its errors on every trace, and where another trace would help."""

from collections.abc import Sequence

import numpy as np

from tablegen.calibration.operator.advice import NextTrace, beyond_reach, possible_rms
from tablegen.calibration.operator.fit import OperatorFit
from tablegen.calibration.operator.loop_errors import WINDOW
from tablegen.calibration.operator.periodic_line import PeriodicLine
from tablegen.charts.chart import POSITION, Chart, DrawnCurve, Mark, Raster, Role
from tablegen.charts.picture_file import PlottedCharts
from tablegen.numerics.driver import Driver

_GRID = 121  # points of the map, each way
_SIDES: tuple[Role, Role] = ("forward", "backward")


def operator_charts(
    fit: OperatorFit, lines: Sequence[PeriodicLine], further: NextTrace, driver: Driver, axis: str
) -> PlottedCharts:
    """Draw the map over size and offset, then a chart of each trace with its residual left out and in the fit."""
    where = _map(fit, lines, further, driver)
    traces = tuple(_trace(number, fit, line, driver) for number, line in enumerate(lines))
    worst = max(range(len(lines)), key=lambda at: fit.left_out[at].rms)
    return PlottedCharts(f"operator of {axis}", (where, *traces), 3, (where, traces[worst]))


def _trace(number: int, fit: OperatorFit, line: PeriodicLine, driver: Driver) -> Chart:
    """Draw the error of a prediction from the other traces, and, fainter, that in the fit."""
    inside, outside = fit.in_fit[number], fit.left_out[number]
    curves = []
    for name, errors in (("in the fit", inside), ("left out", outside)):
        if errors.sides is not None:
            x = np.linspace(*WINDOW, errors.sides.shape[1])
            curves += [
                DrawnCurve(f"{side}, {name}", side, x, values, faint=errors is inside)
                for side, values in zip(_SIDES, errors.sides, strict=True)
            ]
    where = f"{line.stroke * driver.span:.3g} V about {driver.volts(line.centre):.3g} V, {line.rate_hz:.3g} Hz"
    return Chart(
        f"trace-{number + 1}",
        f"{where}: {outside.rms:.2g} % rms left out",
        POSITION,
        "residual [% of the line]",
        tuple(curves),
        marks=(Mark(0.0, "", "y"),),
        x_range=WINDOW,
    )


def _map(fit: OperatorFit, lines: Sequence[PeriodicLine], further: NextTrace, driver: Driver) -> Chart:
    """Draw the rms residual that nine of ten scans stay below, where the driver reaches and scans are not refused."""
    span, ends = driver.span, (driver.v_min, driver.v_max)
    strokes, centres = np.linspace(1.0, 0.02, _GRID), np.linspace(0.0, 1.0, _GRID)
    rms = possible_rms(fit.operator, strokes[::-1], centres)[::-1]
    trace_centres = np.array([line.centre for line in lines])
    refused = beyond_reach(lines, strokes, centres)
    beyond = 0.5 * strokes[:, None] > np.minimum(centres, 1.0 - centres)
    visible = np.where(refused | beyond, np.nan, rms)
    high = float(np.nanmax(visible)) if np.isfinite(visible).any() else 1.0
    raster = Raster(visible, ends, (0.02 * span, span), 0.0, high, "heat", "rms that 90 % stay below [% of the line]")
    curves = (
        DrawnCurve(
            "largest size of the driver",
            "before",
            driver.volts(np.array([0.0, 0.5, 1.0])),
            span * np.array([0.0, 1.0, 0.0]),
        ),
        DrawnCurve(
            "traces",
            "other",
            driver.volts(trace_centres),
            span * np.array([line.stroke for line in lines]),
            "points",
        ),
        DrawnCurve(
            f"next trace: {further.size_v:.3g} V at {further.offset_v:.3g} V",
            "limit",
            np.array([further.offset_v]),
            np.array([further.size_v]),
            "points",
        ),
    )
    return Chart(
        "expected",
        "Possible error of other scans; blank: refused",
        "offset [V]",
        "size [V]",
        curves,
        x_range=ends,
        y_range=(0.0, 1.05 * span),
        raster=raster,
    )
