"""Scripts for a sequencer with PIXEL_INDEX_BITS: programs with and without a table of pixels, and tables to refuse."""

from collections.abc import Iterator
from dataclasses import dataclass

from numpy.random import Generator
from programs import random_dual, with_table
from replacing import replace

from tablegen.device.commit_mode import CommitMode
from tablegen.device.dual_program import DualProgram
from tablegen.device.registers import PIXEL_TABLE_WORD, SCAN_WORDS, program_words
from tablegen.device.schedule import Window
from tablegen.fixedpoint.synthesis import FourierWords
from tablegen.verification.play.loading import check_clocks
from tablegen.verification.play.sequencer_shape import SequencerShape
from tablegen.verification.play.stream import PIXEL_TICKS, PROGRAM, X_TABLE, Y_TABLE, Script

PIXELS = SCAN_WORDS.index("pixels")
PIXEL_INDEX_BITS = 7
PIXEL_TABLE: dict[str, int | str] = {"PIXEL_INDEX_BITS": PIXEL_INDEX_BITS}
MOST_PIXELS = 1 << (PIXEL_INDEX_BITS - 1)


@dataclass
class PixelScript(Script):
    """A script of programs some of which have a table of pixels; the commit of one takes until it has been read."""

    table_written_at: int = -1  # the swaps before the last table: until the next one word 14 stays

    def load(self, program: DualProgram, x: FourierWords | None = None, y: FourierWords | None = None) -> None:
        """Write a whole program, its table of pixels last; some that have none come without word 14, too."""
        self.wait_writable()
        if program.schedule.pixel_table is None and self.swaps % 2 and self.table_written_at != self.swaps:
            words = program_words(program.schedule, program.x, program.y)
            self.write(PROGRAM, words[:PIXEL_TABLE_WORD])
            self.write(PROGRAM, words[PIXEL_TABLE_WORD + 1 :], PIXEL_TABLE_WORD + 1)
            self.write(X_TABLE, program.x.words)
            self.write(Y_TABLE, program.y.words)
        else:
            super().load(program, x, y)
            self.write_pixels(program)
            if program.schedule.pixel_table is not None:
                self.table_written_at = self.swaps

    def write_pixels(self, program: DualProgram) -> None:
        """Write the table of pixels, where there is one."""
        self.write(PIXEL_TICKS, ticks_of(program))

    def request(
        self,
        *names: str,
        program: DualProgram | None = None,
        frames: int = 0,
        commit_clocks: int = 0,
        mode: CommitMode = CommitMode.LINE,
    ) -> None:
        """Play one clock with requests; a commit waits for the check of its table."""
        clocks = commit_clocks or self.commit_clocks
        if program is not None:
            clocks += check_clocks(program.schedule)
        super().request(*names, program=program, frames=frames, commit_clocks=clocks, mode=mode)


def ticks_of(program: DualProgram) -> list[int]:
    """The words of the table of pixels, forward and then backward."""
    return [ticks for window in program.schedule.pixel_table or () for ticks in window]


def pixel_program(rng: Generator, shape: SequencerShape, ticks: tuple[int, int], least: int, most: int) -> DualProgram:
    """A tame one with a table of so many pixels at least and at most."""
    while True:
        program = random_dual(rng, shape, ticks, kind="tame", lines=(1, 3))
        program = replace(program, schedule=with_table(rng, program.schedule))
        if program.schedule.pixel_table is not None and least <= program.schedule.pixels <= most:
            return program


def full_lines(rng: Generator, script: PixelScript, shape: SequencerShape) -> None:
    """Swap programs of which each tick is imaged into a scan, with and without a table, at a tick a clock."""
    for number in range(10):
        program = random_dual(rng, shape, (20, 30), kind="tame", lines=(1, 3))
        ticks, turn = program.schedule.ticks, int(rng.integers(8, 12))
        forward, backward = Window(0, turn), Window(turn, ticks - turn)
        table = ((turn - 4, 3, 1), (1, ticks - turn - 2, 1)) if number % 3 else None
        schedule = replace(program.schedule, turn_tick=turn, forward=forward, backward=backward, pixels=3)
        take(script, replace(program, schedule=replace(schedule, pixel_table=table)), starts=number == 0)


def take(script: PixelScript, program: DualProgram, *, starts: bool = False) -> None:
    """Load and commit a program, and play lines of it; the scan runs already, or it ``starts``."""
    script.wait_writable()
    script.pace(1, 41)
    script.load(program)
    script.request("commit", program=program)
    script.wait(check_clocks(program.schedule) + 2)
    if starts:
        script.wait_ticks(3)
        script.request("arm", "trigger")
    script.wait_ticks(100)


def withdrawn_checks(rng: Generator, script: PixelScript, shape: SequencerShape) -> None:
    """End the check of a table on each of its clocks, by a withdrawal; no write meets it."""
    program = pixel_program(rng, shape, (30, 40), 2, 3)
    script.load(program)
    for clocks in range(check_clocks(program.schedule) + 1):
        script.request("commit", program=program)
        script.wait(clocks)
        script.request("withdraw")
        script.wait(2 * MOST_PIXELS)
    script.request("commit", program=program)
    script.wait(1)
    script.write_refused(PIXEL_TICKS, [1, 2, 3])
    script.wait_ticks(100)
    script.request("clear_faults")


def refuse_tables(rng: Generator, script: PixelScript, shape: SequencerShape) -> None:
    """Commit what is to be refused, each made right afterwards and taken; the device plays without end."""
    script.tick_every(1)
    program = pixel_program(rng, shape, (30, 40), 3, MOST_PIXELS)
    take(script, program, starts=True)
    withdrawn_checks(rng, script, shape)
    before = [program, program]
    for number in range(len(list(_spoilt(program)))):
        program = pixel_program(rng, shape, (30, 40), 3, MOST_PIXELS)
        while min(ticks_of(program)) == 1:
            program = pixel_program(rng, shape, (30, 40), 3, MOST_PIXELS)
        what, words, discards = list(_spoilt(program))[number]
        if "miss" in what:  # the words of this bank are those of the program already
            program = before[-2]
            what, words, discards = list(_spoilt(program))[number]
        script.wait_writable()
        Script.load(script, program)
        for region, address, word in words:
            script.write(region, [word], address)
        script.wait(1)
        script.commit_unfit()
        script.wait_ticks(2 * MOST_PIXELS + 80)
        script.state(f"commit of a table with {what}")
        script.pace(1, 41)
        script.request("clear_faults", *(["withdraw"] if discards else []))
        for region, address, _ in words:  # what was wrong alone
            script.write(region, [_right(program, region, address)], address)
        script.write_pixels(program)
        script.request("commit", program=program)
        script.wait(check_clocks(program.schedule) + 2)
        script.wait_ticks(100)
        before.append(program)
    more_than_a_bank(rng, script, shape)
    for bit in range(PIXEL_INDEX_BITS, 16):  # there are no such words
        script.write(PIXEL_TICKS, [1], 1 << bit)
        script.refused = True
        script.state(f"write to {1 << bit}")
        script.request("clear_faults")


def more_than_a_bank(rng: Generator, script: PixelScript, shape: SequencerShape) -> None:
    """Commit more pixels than a bank has, whose low bits are those of a table that fits, and which the windows have."""
    program = random_dual(rng, shape, (300, 300), kind="tame", lines=(1, 3))
    windows, table = (Window(0, 150), Window(150, 150)), ((70, 50, 30), (40, 50, 60))
    schedule = replace(program.schedule, turn_tick=150, forward=windows[0], backward=windows[1], pixels=3)
    program = replace(program, schedule=replace(schedule, pixel_table=table))
    take(script, program)
    script.wait_ticks(700)
    script.wait_writable()
    Script.load(script, program)
    script.write_pixels(program)
    script.write(PROGRAM, [2 * MOST_PIXELS + 3], PIXELS)
    script.wait(1)
    script.commit_unfit()
    script.wait_ticks(700)
    script.state("commit of more pixels than a bank has, of which the windows have as many ticks")
    script.pace(1, 41)
    script.request("clear_faults", "withdraw")


def _right(program: DualProgram, region: int, address: int) -> int:
    if region == PIXEL_TICKS:
        ticks = ticks_of(program)
        return ticks[address] if address < len(ticks) else 0
    return program.schedule.pixels if address == PIXELS else 1


def _spoilt(program: DualProgram) -> Iterator[tuple[str, list[tuple[int, int, int]], bool]]:
    """What is wrong, the writes after those of the program, and whether only a withdrawal makes it right.

    Where words are missing, the bank has them from an earlier program.
    """
    ticks, pixels = ticks_of(program), program.schedule.pixels
    table = [(PIXEL_TICKS, at, word) for at, word in enumerate(ticks)]

    def with_words(*changes: tuple[int, int]) -> list[tuple[int, int, int]]:
        words = list(ticks)
        for at, by in changes:
            words[at] += by
        return [(PIXEL_TICKS, at, word & 0xFFFFFFFF) for at, word in enumerate(words)]

    for at in (0, pixels - 1, pixels, 2 * pixels - 1):
        yield f"a tick more in {at}", with_words((at, 1)), False
        yield f"a tick less in {at}", with_words((at, -1)), False
        yield f"2^16 more in {at}", with_words((at, 1 << 16)), True
    # A pixel without ticks, whose ticks others have, in either window; and windows that are full together only.
    for first in (0, pixels):
        for other in (first + 1, first + pixels - 1):
            yield f"none in {first}", with_words((first, -ticks[first]), (other, ticks[first])), False
            yield f"none in {other}", with_words((other, -ticks[other]), (first, ticks[other])), False
        yield f"a window too long from {first} on", with_words((first, 65000), (first + 1, 535)), False
    yield "a tick of the other window", with_words((0, 1), (2 * pixels - 1, -1)), False
    yield "a pixel more", [*table, (PROGRAM, PIXELS, pixels + 1), (PIXEL_TICKS, 0, ticks[0])], False
    yield "no pixels", [*table, (PROGRAM, PIXELS, 0)], False
    yield "more pixels than the device has", [*table, (PROGRAM, PIXELS, MOST_PIXELS + 1)], False
    yield "as many as it has, of which it lacks most", [*table, (PROGRAM, PIXELS, MOST_PIXELS)], False
    yield "many more", [*table, (PROGRAM, PIXELS, 4 * MOST_PIXELS + pixels)], False
    yield "another word 14", [*table, (PROGRAM, PIXEL_TABLE_WORD, 3)], True
    yield "all words missing", [], False
    yield "a word missing", table[1:], False
    yield "its last word missing", table[:-1], False
