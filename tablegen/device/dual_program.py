"""The content of a bank of the device."""

from msgspec import Struct

from tablegen.device.schedule import Schedule
from tablegen.fixedpoint.frame_program import FrameProgram
from tablegen.fixedpoint.program import Program

AxisProgram = Program | FrameProgram


class ScanProgram(Struct, frozen=True, eq=False):
    """The content of a bank: both axes, each with a slow part of its own or without, and their common schedule.

    The sequencer plays it. Whatever plays or sends programs without a slow part takes a ``DualProgram``.
    """

    x: AxisProgram
    y: AxisProgram
    schedule: Schedule

    def __post_init__(self) -> None:
        lines, ticks = self.schedule.lines, self.schedule.ticks
        for name, axis in (("x", self.x), ("y", self.y)):
            if isinstance(axis, FrameProgram) and (axis.lines, axis.fast.phase.ticks) != (lines, ticks):
                raise ValueError(
                    f"{name} has {axis.lines} lines of {axis.fast.phase.ticks} ticks, the schedule {lines} of {ticks}"
                )

    @property
    def shaping_order(self) -> int:
        """Highest order of shaping of both axes, which a device must have; 0 where neither shapes."""
        return max(axis.output.shaping.order for axis in (self.x, self.y))


class DualProgram(ScanProgram, frozen=True, eq=False):
    """The content of a bank without a slow part: both axes play one table each."""

    x: Program
    y: Program
    schedule: Schedule


def require_dual(program: ScanProgram) -> DualProgram:
    """Return a program of which neither axis has a slow part.

    Raises
    ------
    ValueError
        If an axis has one, or might have one.
    """
    if not isinstance(program, DualProgram):
        raise ValueError("a program with a slow part is for C, its link, and the Verilog of a scan at an angle")
    return program
