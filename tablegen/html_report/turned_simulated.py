"""A simulation of a scan at an angle as charts: the errors over the image, of each correction."""

from collections.abc import Sequence

from tablegen.charts.picture_file import PlottedCharts
from tablegen.html_report.turned_charts import error_maps, lattice_image, line_errors, mean_line
from tablegen.planning.turned_plan import TurnedPlan
from tablegen.virtual import own_report, report
from tablegen.virtual.turned_report import FrameStage
from tablegen.virtual.turned_run import BUILT


def frame_charts(plan: TurnedPlan, stages: Sequence[FrameStage]) -> PlottedCharts:
    """Draw a column of straight lines, and one of the emitted integers with each scanner file."""
    entries = []
    for number, stage in enumerate(stages):
        for row in stage.rows:
            if row.example is not None and (row.correction == BUILT or number == 0):
                title = f"{row.correction}, file as {stage.name}" if len(stages) > 1 else row.correction
                entries.append((row.example.imaged, f"{stage.name}-{row.correction}", title))
    images = [lattice_image(plan, *one) for one in entries]
    maps = [error_maps(plan, *one) for one in entries]
    means = [mean_line(plan, *one) for one in entries]
    lines = [line_errors(plan, *one) for one in entries]
    charts = (*images, *(one for one, _ in maps), *(one for _, one in maps), *means, *lines)
    label = own_report.LABEL if stages[0].own else report.LABEL
    return PlottedCharts(f"{plan.name}: {label}", charts, max(1, len(entries)), (*means, *lines))
