"""What formats render: the integers of a build, from a plan or from a manifest, and words for its comments."""

from dataclasses import dataclass
from typing import Literal

from tablegen.device.schedule import Schedule
from tablegen.device.sequencer import DualProgram
from tablegen.fixedpoint.program import Program
from tablegen.manifest.read import StoredBuild
from tablegen.numerics.arrays import Ints


@dataclass(frozen=True, eq=False)
class AxisContent:
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
        """H, the highest harmonic."""
        return len(self.fourier_words) // 2


@dataclass(frozen=True, eq=False)
class Content:
    """A build as formats see it. What stands in comments alone is empty where a manifest is the source."""

    name: str
    hash: str
    program: DualProgram
    x: AxisContent
    y: AxisContent
    header_only: bool
    version: str = ""
    scanner: str = ""
    summary: tuple[str, ...] = ()

    @property
    def axes(self) -> tuple[AxisContent, AxisContent]:
        """Both axes, fast first."""
        return self.x, self.y

    @property
    def schedule(self) -> Schedule:
        """Ticks, lines and windows of the scan."""
        return self.program.schedule

    @property
    def sine_index_bits(self) -> int:
        """log2 of the longest interpolated table, whose sine renders all; 0 where no table is rendered."""
        return max(axis.program.index_bits for axis in self.axes)


def stored_content(stored: StoredBuild) -> Content:
    """The content of a build, from its manifest alone."""

    def axis(name: Literal["x", "y"], program: Program) -> AxisContent:
        found = getattr(stored.manifest.axes, name)
        return AxisContent(name, program, found.fourier_words, found.output.v_zero, found.output.v_per_code)

    name = stored.manifest.name
    return Content(
        name=name,
        hash=stored.manifest.hash,
        program=stored.program,
        x=axis("x", stored.program.x),
        y=axis("y", stored.program.y),
        header_only=f"{name}.c" not in stored.manifest.files,
        version=stored.manifest.tablegen,
    )
