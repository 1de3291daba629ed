"""The content that the files of a scan at an angle render: its integers, and words for their comments."""

from msgspec import Struct

from tablegen.device.dual_program import ScanProgram
from tablegen.fixedpoint.frame_program import FrameProgram


class TurnedContent(Struct, frozen=True, eq=False):
    """A scan at an angle as its files have it; words of comments are empty where a manifest is the source.

    ``clocks_per_tick`` are those of an FPGA, 0 where its clock is not known.
    """

    name: str
    hash: str
    program: ScanProgram
    version: str = ""
    scanner: str = ""
    summary: tuple[str, ...] = ()
    clocks_per_tick: int = 0

    @property
    def axes(self) -> tuple[FrameProgram, FrameProgram]:
        """The programs of x and y."""
        x, y = self.program.x, self.program.y
        assert isinstance(x, FrameProgram)
        assert isinstance(y, FrameProgram)
        return x, y
