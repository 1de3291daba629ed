"""The distance between the places of a pixel in trace and retrace by ticks alone, and the lines that have none."""

from tablegen.config.frame import exact
from tablegen.device.schedule import MAXIMUM_LINE_TICKS
from tablegen.planning.line_plan import Plan
from tablegen.planning.windows import matching_lines, retrace_mismatch

_MAX_MISMATCH_PIXELS = 0.25  # of a pixel; more is a warning


def pixel_mismatch_percent(plan: Plan) -> float:
    """Return the largest distance of a pixel's two places, in percent of the line; 0 where one direction images."""
    if (pixels := plan.pixel_errors) is not None:
        return pixels.mismatch
    return 100.0 * retrace_mismatch(plan.schedule, plan.x.drive.turn)


def pixel_mismatch_note(plan: Plan) -> str:
    """Return a sentence on the distance, with the lines that have none; "" where there is no distance."""
    mismatch = pixel_mismatch_percent(plan)
    if not mismatch or plan.schedule.pixel_table is not None:  # the errors of its pixels say it
        return ""
    schedule, (low, high) = plan.schedule, plan.x.band_limit.window
    requested = exact(plan.x.drive.turn), exact(low), exact(high)
    lines = matching_lines(*requested, schedule.ticks, schedule.pixels, MAXIMUM_LINE_TICKS)
    remedy = f"; a timing.ticks_per_line of {' or '.join(map(str, lines))} makes them match" if lines else ""
    return (
        f"the same pixel of trace and retrace shows places up to {mismatch:.2g} % of the line apart, since pixels "
        f"begin on whole ticks{remedy}"
    )


def pixel_mismatch_warning(plan: Plan) -> str:
    """Return the sentence of ``apart_note`` where the distance is more than a quarter of a pixel; "" otherwise."""
    low, high = plan.x.band_limit.window
    pixel = 100.0 * (high - low) / plan.schedule.pixels
    return (
        pixel_mismatch_note(plan) if pixel_mismatch_percent(plan) > _MAX_MISMATCH_PIXELS * pixel * (1.0 + 1e-9) else ""
    )
