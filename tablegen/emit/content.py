"""The content that formats render: the integers of a build, and words for its comments.

``tablegen.emit.render`` makes it from a plan, ``tablegen.emit.stored`` from a manifest.
"""

from typing import Literal

from msgspec import Struct

from tablegen.device.dual_program import DualProgram, ScanProgram
from tablegen.device.schedule import Schedule
from tablegen.fixedpoint.program import Program
from tablegen.numerics.arrays import Ints

MAX_RENDERED_HARMONICS = 512  # the most that a sequencer in Verilog renders


class AxisContent(Struct, frozen=True, eq=False):
    """One axis: its program, its Fourier words a0, a1..aH, b1..bH, and the volts of its codes.

    The piezo is at ``v_zero + v_per_code * code``, in V.
    """

    axis: Literal["x", "y"]
    program: Program
    fourier_words: Ints
    v_zero: float
    v_per_code: float

    @property
    def harmonics(self) -> int:
        """The highest harmonic H."""
        return len(self.fourier_words) // 2


class Content(Struct, frozen=True, eq=False):
    """A build as formats see it; the content of comments alone is empty where a manifest is the source.

    ``z`` is the program of a second sequencer that plays the output z, where the scan has one.
    """

    name: str
    hash: str
    program: DualProgram
    x: AxisContent
    y: AxisContent
    header_only: bool
    clocks_per_tick: int = 0
    version: str = ""
    scanner: str = ""
    summary: tuple[str, ...] = ()
    z: ScanProgram | None = None

    @property
    def axes(self) -> tuple[AxisContent, AxisContent]:
        """Both axes, fast first."""
        return self.x, self.y

    @property
    def schedule(self) -> Schedule:
        """Ticks, lines and windows of the scan."""
        return self.program.schedule

    @property
    def renders_tables(self) -> bool:
        """True if ``NAME_top.v`` boots Fourier words and renders both tables from them."""
        modes = {axis.program.mode for axis in self.axes}
        return "direct" not in modes and max(axis.harmonics for axis in self.axes) <= MAX_RENDERED_HARMONICS

    @property
    def sine_index_bits(self) -> int:
        """The logarithm to base 2 of the longest interpolated table, whose sine renders all; 0 where none is."""
        return max(axis.program.index_bits for axis in self.axes)
