"""The content that the files of a scan at an angle render: its integers, and words for their comments."""

from msgspec import Struct

from tablegen.device.dual_program import ScanProgram
from tablegen.fixedpoint.frame_program import FrameProgram


class TurnedContent(Struct, frozen=True, eq=False):
    """A scan at an angle as its files have it; words of comments are empty where a manifest is the source.

    ``clocks_per_tick`` are those of an FPGA, 0 where its clock is not known. ``z`` is the program of a second sequencer
    that plays the output z, where the scan has one; its files are those of a scan named ``NAME_z``.
    """

    name: str
    hash: str
    program: ScanProgram
    version: str = ""
    scanner: str = ""
    summary: tuple[str, ...] = ()
    clocks_per_tick: int = 0
    z: ScanProgram | None = None

    @property
    def content_of_z(self) -> "TurnedContent | None":
        """The content of the files of the second sequencer; None without z."""
        if self.z is None:
            return None
        return content_beside(self.name, self.hash, self.z, self.version, self.scanner, self.clocks_per_tick)

    @property
    def axes(self) -> tuple[FrameProgram, FrameProgram]:
        """The programs of x and y."""
        x, y = self.program.x, self.program.y
        assert isinstance(x, FrameProgram)
        assert isinstance(y, FrameProgram)
        return x, y


def content_beside(
    name: str, digest: str, program: ScanProgram, version: str = "", scanner: str = "", clocks_per_tick: int = 0
) -> TurnedContent:
    """Return the content of the files of a second sequencer, which plays the output z of a scan of this name.

    Parameters
    ----------
    digest
        Hash of the plan of the scan, z included.
    program
        Its x is z, and its y rests.
    """
    summary = (f"The output z of {name}, for a sequencer of its own: x is z here, y rests at its offset.",)
    return TurnedContent(f"{name}_z", digest, program, version, scanner, summary, clocks_per_tick)
