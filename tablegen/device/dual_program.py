"""The content of a bank of the device."""

from msgspec import Struct

from tablegen.device.schedule import Schedule
from tablegen.fixedpoint.program import Program


class DualProgram(Struct, frozen=True, eq=False):
    """The content of a bank: both axes and their common schedule."""

    x: Program
    y: Program
    schedule: Schedule
