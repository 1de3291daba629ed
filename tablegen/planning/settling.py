"""The number of lines that a scan needs to settle after a change, by the operators of its axes."""

from msgspec import Struct

from tablegen.base.input_errors import Problems
from tablegen.compensation.transient import OFFSET_CHANGE
from tablegen.config.load import Setup
from tablegen.device.schedule import Schedule
from tablegen.planning.drive import Drive

MOST_LINES = 255  # the largest count of a device
_PRINTED_NM = 0.005
BOUND = 0.005  # of the line, by which the image may drift in a frame; a pixel where that is more


class Settling(Struct, frozen=True):
    """The settling of one axis after a change of offset by ``offset_v``, and after a smaller scan.

    ``lines`` are enough for the image to drift by no more than ``bound_nm`` in the next frame after either, or
    ``MOST_LINES`` + 1. ``drift_nm`` is that of a frame without them, after the change of offset, ``size_drift_nm``
    after that of the size, and ``late_nm`` that of the frame after ``lines``, the larger of both. The part
    ``extrapolated_nm`` of it comes from creep slower than a period of the slowest trace, ``slowest_s``. ``memory_nm``
    is by how much hysteresis bends the first period. ``unknown_nm`` is how far the image may drift besides, in all,
    where no record shows whether the sensitivity follows the offset late.
    """

    lines: int
    offset_v: float
    bound_nm: float
    drift_nm: float
    size_drift_nm: float
    late_nm: float
    extrapolated_nm: float
    slowest_s: float
    memory_nm: float
    unknown_nm: float


def settling(axis: str, drive: Drive, schedule: Schedule) -> Settling | None:
    """Return the settling by the operator of an axis; None without one."""
    transients = drive.shape.identification.transients
    if transients is None:
        return None
    line_s = 1.0 / float(schedule.line_rate)
    pixels = schedule.pixels if axis == "x" else max(schedule.up.count, 1)
    bound = max(BOUND * drive.size_nm, drive.window_nm / pixels)

    def drifts(first: int, slower_than_s: float = 0.0) -> list[float]:
        return [after.drift_nm(line_s, first, schedule.lines, slower_than_s) for after in transients]

    lines = max(after.lines(line_s, schedule.lines, bound, MOST_LINES) for after in transients)
    if axis == "x":  # the first line is bent, whatever the bound
        lines = max(lines, 1)
    written_lines = min(lines, MOST_LINES)
    late, of = max((nm, which) for which, nm in enumerate(drifts(written_lines)))
    after_offset, after_size = drifts(0)
    slowest_s = transients[0].measured_s
    return Settling(
        lines,
        OFFSET_CHANGE * drive.driver.span,
        bound,
        after_offset,
        after_size,
        late,
        drifts(written_lines, slowest_s)[of],
        slowest_s,
        max(after.most_memory_nm for after in transients),
        max(after.unknown_nm for after in transients),
    )


def settle_lines(setup: Setup, drives: dict[str, Drive], schedule: Schedule, problems: Problems) -> int:
    """Return the settling lines of the scan file, or as many as the slower axis needs, at most ``MOST_LINES``.

    The settling of an axis without an operator is not known; such an axis is ignored.
    """
    written = setup.scan.timing.settle_lines
    if written != "auto":
        return written
    settlings = [one for axis, drive in drives.items() if (one := settling(axis, drive, schedule)) is not None]
    if not settlings:
        problems.add(
            setup.scan_file,
            "timing.settle_lines",
            "'auto' needs an operator of x or of y, and there is none; run `tablegen calibrate operator`, or give a "
            "number of lines",
        )
    return min(max((one.lines for one in settlings), default=0), MOST_LINES)


def settling_text(settled: Settling) -> list[str]:
    """Return the lines of text for the terminal and the emitted files."""
    lines = f"in {settled.lines} lines" if settled.lines <= MOST_LINES else f"in more than {MOST_LINES} lines"
    out = [
        f"{lines} after a change of offset of {settled.offset_v:.4g} V; "
        f"drifts {settled.drift_nm:.3g} nm in the first frame"
    ]
    if settled.size_drift_nm >= _PRINTED_NM:
        out.append(f"drifts {settled.size_drift_nm:.3g} nm after half the size")
    if settled.memory_nm >= _PRINTED_NM:
        out.append(f"hysteresis bends the first sweep by up to {settled.memory_nm:.3g} nm")
    if settled.extrapolated_nm >= _PRINTED_NM:
        share = 100.0 * settled.extrapolated_nm / settled.late_nm
        out.append(
            f"after {min(settled.lines, MOST_LINES)} lines drifts {settled.late_nm:.3g} nm, {share:.2g} % of it slower "
            f"than the slowest trace, {settled.slowest_s:.3g} s: extrapolated"
        )
    if settled.unknown_nm >= settled.bound_nm:
        out.append(
            f"may drift by up to {settled.unknown_nm:.3g} nm more after a change of offset, within minutes, if the "
            "sensitivity follows the offset late: `calibrate operator --step` measures it"
        )
    return out
