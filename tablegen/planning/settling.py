"""How many lines a scan has to settle after a change, by the operators of its axes."""

from dataclasses import dataclass

from tablegen.compensation.transient import OFFSET_CHANGE, Transient
from tablegen.config.load import Setup
from tablegen.device.schedule import Schedule
from tablegen.planning.drive import Drive
from tablegen.problems import Problems

MOST_LINES = 255  # that a device counts
_SHOWN_NM = 0.005
BOUND = 0.005  # of the line, by which the image may drift in a frame; a pixel where that is more


@dataclass(frozen=True, slots=True)
class Settling:
    """Of one axis, after a change of offset by ``offset_v`` and after a smaller scan.

    ``lines`` are enough for the image to drift by no more than ``bound_nm`` in the next frame after either, or
    ``MOST_LINES`` + 1. ``drift_nm`` is that of a frame without them from its second line on, after the change of
    offset, and ``size_drift_nm`` after that of the size. ``memory_nm`` is by how much the first period is off.
    """

    lines: int
    offset_v: float
    bound_nm: float
    drift_nm: float
    size_drift_nm: float
    memory_nm: float


def settling(axis: str, drive: Drive, schedule: Schedule) -> Settling | None:
    """What the operator of an axis says; None without one."""
    transients = drive.shape.transients
    if transients is None:
        return None
    after_offset, after_size = transients
    line_s = 1.0 / float(schedule.line_rate)
    pixels = schedule.pixels if axis == "x" else max(schedule.up.count, 1)
    bound = max(BOUND * drive.size_nm, drive.window_nm / pixels)

    def lines_of(after: Transient) -> int:
        return after.lines(line_s, schedule.lines, bound, MOST_LINES)

    lines = max(lines_of(after_offset), lines_of(after_size))
    if axis == "x":  # hysteresis forgets what was before in a period, which of y is a frame
        lines = max(lines, 1)
    return Settling(
        lines,
        OFFSET_CHANGE * drive.v_max,
        bound,
        after_offset.drift_nm(line_s, 1, schedule.lines),
        after_size.drift_nm(line_s, 1, schedule.lines),
        max(after_offset.memory_nm, after_size.memory_nm),
    )


def settle_lines(setup: Setup, drives: dict[str, Drive], schedule: Schedule, problems: Problems) -> int:
    """As the scan file has them, or as many as the slower of both axes needs, at most ``MOST_LINES``."""
    asked = setup.scan.timing.settle_lines
    if asked != "auto":
        return asked
    found = {axis: settling(axis, drive, schedule) for axis, drive in drives.items()}
    without = " and ".join(axis for axis, one in found.items() if one is None)
    if without:
        problems.add(
            setup.scan_file,
            "timing.settle_lines",
            f"'auto' needs an operator of both axes, and there is none of {without}; "
            "run `tablegen calibrate operator`, or give a number of lines",
        )
    return min(max((one.lines for one in found.values() if one is not None), default=0), MOST_LINES)


def settling_text(found: Settling) -> list[str]:
    """For the terminal and the emitted files."""
    lines = f"in {found.lines} lines" if found.lines <= MOST_LINES else f"in more than {MOST_LINES} lines"
    out = [
        f"{lines} after a change of offset of {found.offset_v:.4g} V; drifts {found.drift_nm:.3g} nm in the first frame"
    ]
    if found.size_drift_nm >= _SHOWN_NM:
        out.append(f"drifts {found.size_drift_nm:.3g} nm after half the size")
    if found.memory_nm >= _SHOWN_NM:
        out.append(f"the hysteresis bends the first period by up to {found.memory_nm:.3g} nm")
    return out
