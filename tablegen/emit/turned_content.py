"""The content that the files of a scan at an angle render: its integers, and words for their comments."""

from msgspec import Struct

from tablegen.device.beside import rests
from tablegen.device.dual_program import ScanProgram
from tablegen.emit.content import Content
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
        return content_beside(self)

    @property
    def axes(self) -> tuple[FrameProgram, FrameProgram]:
        """The programs of x and y."""
        x, y = self.program.x, self.program.y
        assert isinstance(x, FrameProgram)
        assert isinstance(y, FrameProgram)
        return x, y


def content_beside(content: Content | TurnedContent) -> TurnedContent | None:
    """Return the content of the files of a second sequencer, whose x is z, and whose y rests or is aux; None without z.

    They have the hash of the plan of the whole scan.
    """
    if content.z is None:
        return None
    summary = (f"The output z of {content.name}, for a sequencer of its own: x is z here, y rests at its offset.",)
    if not rests(content.z):
        summary = (f"The outputs z and aux of {content.name}, for a sequencer of their own: x is z here, y is aux.",)
    return TurnedContent(
        f"{content.name}_z",
        content.hash,
        content.z,
        content.version,
        content.scanner,
        summary,
        content.clocks_per_tick,
    )
