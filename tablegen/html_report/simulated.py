"""A simulation as charts: residual and scaling error of both directions, without and with the model."""

from collections.abc import Sequence

from tablegen.charts.chart import POSITION, Chart, DrawnCurve, Mark, Role
from tablegen.charts.picture_file import PlottedCharts
from tablegen.compensation import models
from tablegen.html_report.scan_errors import SIDES, inside
from tablegen.virtual.own_run import OwnRun
from tablegen.virtual.report import LABEL, SimulationStage
from tablegen.virtual.simulation import AxisRun, Run


def stage_charts(name: str, stages: Sequence[SimulationStage]) -> PlottedCharts:
    """Draw a row of residuals and one of scaling errors per axis: uncompensated, then each scanner file's model."""
    residuals, rows = [], []
    for axis in ("x", "y"):
        entries = [
            (f"{axis}, {_titled(stage, run, axis)}", f"{axis}-{stage.name}-{run.model}", getattr(run, axis))
            for number, stage in enumerate(stages)
            for run in stage.runs
            if axis in run.configured or (number == 0 and run.model == models.UNCOMPENSATED)
        ]
        row = [_residual(*one) for one in entries]
        residuals += row
        rows += [*row, *(_scaling(*one) for one in entries)]
    columns = max(1, len(rows) // 4)
    return PlottedCharts(f"{name}: {LABEL}", tuple(rows), columns, tuple(residuals))


def _titled(stage: SimulationStage, run: Run, axis: str) -> str:
    if run.model == models.UNCOMPENSATED and axis not in run.configured:
        return "without correction"
    return f"{run.model}, file as {stage.name}"


def own_charts(name: str, runs: Sequence[OwnRun]) -> PlottedCharts:
    """Draw the residual of each correction on the first of the scanners that depart from the operator."""
    entries = [
        (f"{run.axis}, {row.correction}", f"{run.axis}-{row.correction}", row.example)
        for run in runs
        for row in run.rows
        if row.example is not None
    ]
    residuals = [_residual(*one) for one in entries]
    rows = [*residuals, *(_scaling(*one) for one in entries)]
    heading = f"{name}: simulation on the scanner file's own operator, the first of its departures"
    return PlottedCharts(heading, tuple(rows), max(1, len(residuals)), tuple(residuals))


def _residual(title: str, key: str, run: AxisRun) -> Chart:
    curves = tuple(DrawnCurve(side, side, *inside(getattr(run.error, side))) for side in _sides(run))
    return Chart(f"residual-{key}", f"{title}: residual", POSITION, "residual [% of the line]", curves, marks=(_ZERO,))


def _scaling(title: str, key: str, run: AxisRun) -> Chart:
    errors = [(side, getattr(run.error, side)) for side in _sides(run)]
    curves = tuple(DrawnCurve(side, side, one.scaling_position, one.scaling) for side, one in errors)
    return Chart(f"scaling-{key}", f"{title}: scaling error", POSITION, "scaling error [%]", curves, marks=(_ZERO,))


_ZERO = Mark(0.0, "", "y")


def _sides(run: AxisRun) -> list[Role]:
    return [side for side in SIDES if side in run.directions]
