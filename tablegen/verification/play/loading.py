"""Programs for the idle bank of a device that plays a script: that of the build as its files have it, and others."""

from collections.abc import Sequence
from dataclasses import dataclass

from tablegen.device.dual_program import DualProgram
from tablegen.device.registers import AXIS_WORDS, PAGE_WORDS, program_words
from tablegen.device.schedule import Schedule
from tablegen.verification.play.placement import Placement
from tablegen.verification.play.sequencer_shape import SequencerShape
from tablegen.verification.play.stream import PIXEL_TICKS, PROGRAM, X_FOURIER, X_TABLE, Y_FOURIER, Y_TABLE, Script
from tablegen.verification.play.unfit_words import c_edges, device_widths, edges
from tablegen.verification.play.variation import Kind, variation
from tablegen.verification.play.wide_program import Part, wide_program

_LOADING_PACE, _LOADING_TICKS = 7, 60  # clocks between ticks while words are written, at least, and how many at most
_CHECK_CLOCKS = 6  # of a table of pixels, beside its words
VARIATION = 1  # as the argument of a commit, to a device that has the program of the build already


def check_clocks(schedule: Schedule) -> int:
    """Return the clocks by which the check of a table of pixels delays a commit; 0 without a table."""
    return 0 if schedule.pixel_table is None else 2 * schedule.pixels + _CHECK_CLOCKS


@dataclass(frozen=True)
class Memories:
    """The words of a bank as in the memory files: of x and y the table, or the Fourier words to render it from."""

    program: Sequence[int]
    x: Sequence[int]
    y: Sequence[int]
    x_harmonics: int = 0  # where x has Fourier words
    y_harmonics: int = 0
    pixels: Sequence[int] = ()  # the ticks of each pixel, forward and then backward, where the program has them


@dataclass
class Loader:
    """A loader of programs, which commits them too; without ``memories`` the device has that of the build already."""

    script: Script
    own: DualProgram
    memories: Memories | None
    placement: Placement

    @property
    def own_commit_clocks(self) -> int:
        """The clocks from a commit of the build's program to its committed bank."""
        harmonics = (self.memories.x_harmonics, self.memories.y_harmonics) if self.memories else (0, 0)
        return self.placement.commit_clocks(
            (len(self.own.x.words), harmonics[0]), (len(self.own.y.words), harmonics[1])
        )

    def load_own(self) -> None:
        """Write the program of the build, word for word as its files have it."""
        memories, script = self.memories, self.script
        self._begin()
        if memories is None:
            return
        script.write(PROGRAM, list(memories.program))
        script.write(PIXEL_TICKS, list(memories.pixels))
        for words, harmonics, page, table, fourier in (
            (memories.x, memories.x_harmonics, 1, X_TABLE, X_FOURIER),
            (memories.y, memories.y_harmonics, 2, Y_TABLE, Y_FOURIER),
        ):
            script.write(fourier if harmonics else table, list(words))
            if harmonics:  # 0 in the file, which is for uploaded tables
                script.write(PROGRAM, [harmonics], first=page * PAGE_WORDS + AXIS_WORDS.index("harmonics"))

    def commit_own(self) -> None:
        """Commit it; its table of pixels is read first, and its tables are rendered, if they have to be."""
        checked = 0 if self.memories is None else check_clocks(self.own.schedule)
        self.script.request("commit", program=self.own, commit_clocks=checked + self.own_commit_clocks)
        self.script.wait(checked)

    def load(self, kind: Kind, longer: int = 0) -> DualProgram:
        """Write a variation: its registers and its tables, since a part of a program is refused."""
        program, script = variation(self.own, kind, self._bank, longer), self.script
        self._begin()
        script.write(PROGRAM, program_words(program.schedule, program.x, program.y))
        for axis, region in ((program.x, X_TABLE), (program.y, Y_TABLE)):
            script.write(region, axis.words)
        return program

    @property
    def has_long_tables(self) -> bool:
        """True if tables serve a period of any length."""
        return "direct" not in (self.own.x.mode, self.own.y.mode)

    def fill_banks(self) -> None:
        """Write as many words as a bank has, so that a direct table of any length is complete."""
        shape = SequencerShape.of((self.own.x, self.own.y))
        for region, index_bits in ((X_TABLE, shape.x_index_bits), (Y_TABLE, shape.y_index_bits)):
            self.script.write(region, [0] * 2**index_bits)

    def load_wide(self, part: Part) -> DualProgram:
        """Write a program that fills its registers, with the tables of a variation."""
        wide = wide_program(part, self.load("free"))
        self.script.write(PROGRAM, wide.words)
        return wide.program

    def edges(self, words: list[int]) -> tuple[list[tuple[int, int]], list[dict[int, int]]]:
        """Return words about the edges of what fits the device, near those of a program."""
        shape = SequencerShape.of((self.own.x, self.own.y))
        if self.memories is None:
            return c_edges(shape, words, max(one.output.shaping.order for one in (self.own.x, self.own.y))), []
        harmonics = max(self.memories.x_harmonics, self.memories.y_harmonics)
        return edges(words, device_widths(shape, self.placement, harmonics))

    def commit(self, program: DualProgram) -> None:
        """Commit a variation that was loaded."""
        self.script.request("commit", program=program, frames=VARIATION)

    def _begin(self) -> None:
        self.script.wait_writable()
        assert self.script.writable
        words = len(self.own.x.words) + len(self.own.y.words)
        least = self.placement.tick_clocks
        self.script.pace(max(_LOADING_PACE, words // _LOADING_TICKS, least), least)

    @property
    def _bank(self) -> int:
        """The bank that is idle once no program waits: they take turns."""
        return self.script.swaps % 2
