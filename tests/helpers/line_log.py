"""The lines that a device played, by their CRCs, against the integer model: every one a whole line of one program.

A log has a record a line: generation, line of the frame, ticks, CRC-32 over x u32, y u32 and markers u8 of every tick,
all markers together, and the faults at its end. A line begins with its marker; a tick on which no scan plays ends one.
"""

import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tablegen.device.commit_mode import CommitMode
from tablegen.device.dual_program import ScanProgram
from tablegen.device.played_lines import LineTicks, play_line
from tablegen.device.sequencer import Sequencer, Tick, can_keep
from tablegen.numerics.arrays import Ints
from tablegen.verification.play.stream import FLAGS

_BIT = {name: 1 << bit for bit, name in enumerate(FLAGS)}
_RECORD = np.dtype([("x", "<u4"), ("y", "<u4"), ("markers", "u1")])


class WrongLine(AssertionError):
    """A line that no program has, or not there."""


@dataclass(frozen=True, slots=True)
class PlayedLine:
    """A record of the log."""

    generation: int
    line: int
    ticks: int
    crc: int
    markers: int
    faults: int

    @classmethod
    def parse(cls, text: str) -> "PlayedLine":
        """As firmware writes it: six hexadecimal numbers."""
        return cls(*(int(part, 16) for part in text.split()))


@dataclass(eq=False)
class _Ticks:
    """The ticks of a line, and the CRC of so many of them."""

    records: NDArray[Any]
    codes: Ints  # shape (ticks, 2)
    sums: dict[int, tuple[int, int]] = field(default_factory=dict)

    def sum(self, ticks: int) -> tuple[int, int]:
        """CRC and markers of the first ones."""
        if ticks not in self.sums:
            part = self.records[:ticks]
            self.sums[ticks] = zlib.crc32(part.tobytes()), int(np.bitwise_or.reduce(part["markers"]))
        return self.sums[ticks]


def _record(program: ScanProgram, x: Ints, y: Ints, markers: Ints) -> _Ticks:
    records = np.empty(len(x), dtype=_RECORD)
    for name, axis, codes in (("x", program.x, x), ("y", program.y, y)):
        records[name] = axis.output.word(codes)  # type: ignore[arg-type]
    records["markers"] = markers
    return _Ticks(records, np.stack([x, y], axis=1))


def _steady(program: ScanProgram, line: int, settled: bool) -> _Ticks:
    ticks: LineTicks = play_line(program, line, settled)
    markers = np.full(program.schedule.ticks, _BIT["playing"])
    for name in ("line", "frame", "pixel", "backward", "valid"):
        markers |= np.where(getattr(ticks, name), _BIT[name], 0)
    return _record(program, ticks.x, ticks.y, markers)


def _stepped(program: ScanProgram, ticks: list[Tick]) -> _Ticks:
    markers = [sum(bit for name, bit in _BIT.items() if getattr(tick, name)) for tick in ticks]
    return _record(program, np.array([t.x for t in ticks]), np.array([t.y for t in ticks]), np.array(markers))


class _Play:
    """A program that plays from some line on, in one of the ways in which it may have come to that."""

    def __init__(self, check: "LineCheck", sequencer: Sequencer, program: ScanProgram, after_park: bool) -> None:
        self.program, self.after_park = program, after_park
        self._check = check
        self._sequencer: Sequencer | None = sequencer
        self.line = 0
        self._settle = program.schedule.settle_lines
        self._ticks: _Ticks | None = None

    def ticks(self) -> _Ticks:
        """Of the next line."""
        if self._ticks is None:
            if self._sequencer is not None:
                steps = [self._sequencer.step() for _ in range(self.program.schedule.ticks)]
                self._ticks = _stepped(self.program, steps)
                if not self._sequencer.catching_up:
                    self._sequencer = None
            else:
                self._ticks = self._check.steady(self.program, self.line, self._settle == 0)
        return self._ticks

    def fits(self, played: PlayedLine) -> bool:
        """Whether a record is of that line."""
        schedule = self.program.schedule
        if played.line != self.line or not 0 < played.ticks <= schedule.ticks or played.faults:
            return False
        return self.ticks().sum(played.ticks) == (played.crc, played.markers)

    def go_on(self, ticks: int) -> tuple[int, int]:
        """To the next line; the codes where this one ended."""
        x, y = self.ticks().codes[ticks - 1]
        self._ticks = None
        self._settle = max(self._settle - 1, 0)
        self.line = (self.line + 1) % self.program.schedule.lines
        return int(x), int(y)


class LineCheck:
    """Follows the log of a device that starts with ``boot`` at ``codes``; what may be uploaded is offered before.

    ``taken`` is the program of each generation that played a line, by its name as it was offered, since the start;
    ``kept`` has those that went on with the frame of the one before, which only a check with ``keeps`` allows.
    """

    BOOT = "boot"

    def __init__(self, boot: ScanProgram, codes: tuple[int, int] = (0, 0), keeps: bool = False) -> None:
        self._boot, self._power_up, self._keeps = boot, codes, keeps
        self._offered: dict[str, ScanProgram] = {self.BOOT: boot}
        self._steady: dict[tuple[ScanProgram, int, bool], _Ticks] = {}
        self.lines = 0
        self.reboot()

    def reboot(self) -> None:
        """The device has started again; what was logged before has been followed."""
        self.taken: dict[int, str] = {1: self.BOOT}
        self.kept: set[int] = set()
        self._play: _Play | None = None
        self._generation = 1
        self._whole = False  # the last line
        self._codes = self._power_up

    def offer(self, name: str, program: ScanProgram) -> None:
        """It may come into force from now on."""
        self._offered[name] = program

    def steady(self, program: ScanProgram, line: int, settled: bool) -> _Ticks:
        """A line that nothing disturbs."""
        key = program, line, settled
        if key not in self._steady:
            self._steady[key] = _steady(program, line, settled)
        return self._steady[key]

    def follow(self, log: Iterable[PlayedLine]) -> None:
        """The next records. Raises ``WrongLine`` at the first that cannot be."""
        for played in log:
            found = next(((name, play) for name, play in self._ways(played) if play.fits(played)), None)
            if found is None:
                raise WrongLine(f"{played} after generation {self._generation}, {self._last()}")
            name, play = found
            if played.generation != self._generation and played.line != 0:
                self.kept.add(played.generation)
            self.taken[played.generation] = name
            self._play, self._generation = play, played.generation
            self._codes = play.go_on(played.ticks)
            self._whole = played.ticks == play.program.schedule.ticks
            self.lines += 1

    def _last(self) -> str:
        if self._play is None:
            return "which has not played"
        return f"before line {self._play.line}, {'whole' if self._whole else 'cut off'}"

    def _ways(self, played: PlayedLine) -> Iterator[tuple[str, _Play]]:
        """How the device may have come to a line of this generation, the likely ways first."""
        same = played.generation == self._generation
        if self._play is not None and self._whole:
            if same:
                yield self.taken[self._generation], self._play
            elif played.generation == self._generation + 1:
                for name, program in self._offered.items():
                    yield name, self._swapped(self._play.program, program, self._codes)
                    if self._keeps and can_keep(self._play.program, program):
                        yield name, self._swapped(self._play.program, program, self._codes, self._play.line)
        if played.line != 0 or played.generation < self._generation:
            return
        if same:
            old = self._program(self.taken[self._generation])
            for codes in self._ramp(old, self._codes):
                yield self.taken[self._generation], self._started(old, codes)
            return
        yield from self._ways_of_another(played)

    def _ways_of_another(self, played: PlayedLine) -> Iterator[tuple[str, _Play]]:
        """How the device may have come to the first line of a later generation, from rest."""
        before = self._play.program if self._play is not None else self._boot
        parked = before.x.output.park_code, before.y.output.park_code
        for name, program in self._offered.items():
            for codes in self._ramp(program, parked):
                yield name, self._started(program, codes)
        # Committed between a trigger and its first tick, a tick after a park at the earliest.
        for codes in self._ramp(before, self._codes)[: -1 if self._play is not None else None]:
            for name, program in self._offered.items():
                yield name, self._swapped(before, program, codes)
        if played.generation == self._generation + 1:
            return
        # The same, where the program that was triggered came into force after the last line, and has not played one.
        for between in self._offered.values():
            for codes in self._ramp(between, parked):
                for name, program in self._offered.items():
                    yield name, self._swapped(between, program, codes)

    def _program(self, name: str) -> ScanProgram:
        if self._play is not None and self.taken[self._generation] == name:
            return self._play.program
        return self._offered[name]

    def _swapped(self, old: ScanProgram, new: ScanProgram, codes: tuple[int, int], line: int = 0) -> _Play:
        """Taken at the start of a line: the first of a frame, or ``line`` of the frame that goes on."""
        sequencer = self._running(old, codes)
        sequencer.line = line
        sequencer.commit(new, CommitMode.KEEP if line else CommitMode.LINE)
        play = _Play(self, sequencer, new, after_park=False)
        play.line = line
        return play

    def _started(self, program: ScanProgram, codes: tuple[int, int]) -> _Play:
        """Triggered, from codes on the way to its park codes."""
        return _Play(self, self._running(program, codes), program, after_park=True)

    @staticmethod
    def _running(program: ScanProgram, codes: tuple[int, int]) -> Sequencer:
        sequencer = Sequencer(program)
        sequencer.codes = codes
        sequencer.arm()
        sequencer.trigger()
        return sequencer

    @staticmethod
    def _ramp(program: ScanProgram, codes: tuple[int, int]) -> list[tuple[int, int]]:
        """Codes on the way to the park codes, from the last backwards."""
        sequencer = Sequencer(program)
        sequencer.codes = codes
        way = [codes]
        while not sequencer.step().parked:
            way.append(sequencer.codes)
        return [sequencer.codes, *reversed(way)]
