"""A script for the bench of the sequencer, and the ticks that the integer model makes of it.

Every call adds commands to the script and advances the model by the same clocks, so that a script needs no second
description of its effect. ``stream_bench.v`` plays it and captures; ``compare`` compares capture and model.
"""

import re
from array import array
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, field
from operator import attrgetter
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tablegen.device.commit_mode import CommitMode
from tablegen.device.dual_program import DualProgram, require_dual
from tablegen.device.played_lines import LineTicks
from tablegen.device.registers import program_words
from tablegen.device.sequencer import Fault, Sequencer, Tick
from tablegen.fixedpoint.synthesis import FourierWords
from tablegen.numerics.arrays import Ints

_WAIT, _WRITE, _REQUEST, _PERIOD, _STATE, _EXTRA = (op << 60 for op in (1, 2, 3, 4, 6, 7))
PROGRAM, X_TABLE, Y_TABLE, X_FOURIER, Y_FOURIER = range(5)
PIXEL_TICKS = 7
_REQUESTS = ("reset", "commit", "withdraw", "arm", "trigger", "park", "clear_faults", "underrun")
_DRAIN_CLOCKS = 200  # more than any sample takes
FLAGS = ("line", "frame", "pixel", "backward", "valid", "swapped", "playing", "parked")
FAULTS = ("slew", "clamp", "overrun", "underrun")
_flags_of = attrgetter(*FLAGS)
_VALID = 1 << 48 + FLAGS.index("valid")
_FAULTS_AT = 56
_WITH_COMMIT = 1 << 52  # of a write: a commit on the same clock
_MODE_AT = 54  # in a request: the mode of its commit, two bits
_WRITTEN = 1  # as the argument of a commit: the program is what was written
_UNFIT = 1 << 24  # of a request: its commit has to be refused
STATES = ("writable", "refused", "committed", "armed", "running", "busy")
OUTPUTS = "outputs"  # of a state, where a device does not hold what it has put out
STATE_WORDS = 4  # 64-bit words of a stored state

Words = NDArray[np.uint64]


def pack(tick: Tick) -> int:
    """Pack a tick as the bench captures it: faults, flags, y code, x code."""
    flags = sum(1 << i for i, flag in enumerate(_flags_of(tick)) if flag)
    return tick.faults.value << 56 | flags << 48 | tick.y << 24 | tick.x


def pack_line(ticks: LineTicks, faults: Ints) -> Words:
    """Pack the ticks of a line, all of which play, with the faults so far.

    Parameters
    ----------
    faults
        Bits of the faults at each tick, shape (ticks,).

    Returns
    -------
    Words
        Shape (ticks,).
    """
    markers = {"line": ticks.line, "frame": ticks.frame, "pixel": ticks.pixel, "backward": ticks.backward}
    words = faults << _FAULTS_AT | 1 << 48 + FLAGS.index("playing") | ticks.y << 24 | ticks.x
    for name, marker in {**markers, "valid": ticks.valid}.items():
        words |= marker.astype(np.int64) << 48 + FLAGS.index(name)
    return words.astype(np.uint64)


@dataclass(frozen=True)
class Sample:
    """The fields of a stored tick."""

    x: int
    y: int
    flags: tuple[str, ...]
    faults: int

    @classmethod
    def of(cls, word: int) -> "Sample":
        """Decode a captured word."""
        flags = tuple(name for i, name in enumerate(FLAGS) if word >> (48 + i) & 1)
        return cls(word & 0xFFFFFF, word >> 24 & 0xFFFFFF, flags, word >> 56 & 0xF)


@dataclass(frozen=True)
class StoredState:
    """The state of a device while nothing is on its way: its flags, its faults, their counts, its outputs."""

    flags: tuple[bool, ...]  # in the order of STATES
    faults: int
    counts: tuple[int, ...]  # in the order of FAULTS
    outputs: int  # codes and markers that it holds, as ``pack`` has them; 0 before the first tick

    @classmethod
    def of(cls, words: list[int]) -> "StoredState":
        """Decode the captured words of a state."""
        flags = tuple(bool(words[0] >> bit & 1) for bit in range(len(STATES)))
        counts = tuple(word >> shift & 0xFFFFFFFF for word in words[1:3] for shift in (0, 32))
        return cls(flags, words[0] >> 8 & 0xF, counts, words[3] & ~(0xFF << _FAULTS_AT))

    def limited(self, most_counted: int, ignored: tuple[str, ...] = ()) -> "StoredState":
        """Return the state of a device whose counters end at ``most_counted``, and which has no ``ignored`` flags."""
        flags = tuple(flag and name not in ignored for name, flag in zip(STATES, self.flags, strict=True))
        outputs = 0 if OUTPUTS in ignored else self.outputs
        return StoredState(flags, self.faults, tuple(min(count, most_counted) for count in self.counts), outputs)


@dataclass
class Script:
    """Commands, and the ticks that the model makes of them.

    ``drain`` clocks pass from a swap to the next write, ``commit_clocks`` from a commit to the bank that is committed.
    """

    power_up: tuple[int, int] = (0, 0)
    drain: int = 48
    commit_clocks: int = 1
    commands: list[int] = field(default_factory=list)
    expected: "array[int]" = field(default_factory=lambda: array("Q"))  # as wide as Words
    swapped_programs: list[DualProgram] = field(default_factory=list)  # programs, one a swap
    refused: bool = False  # a write was to be refused, and the flag has not been cleared
    states: list[tuple[str, StoredState]] = field(default_factory=list)  # when each was asked for, and what it is
    programs: list[tuple[int, DualProgram | None]] = field(default_factory=list)  # each after its first tick

    def __post_init__(self) -> None:
        self.model = Sequencer(None, codes=self.power_up)
        self.clocks = 0
        self._period = self._until = self._ticked_at = 0
        self._commits: DualProgram | None = None
        self._mode = CommitMode.LINE
        self._commits_at = self._writable_at = 0
        self._faulty_after = -1  # so many ticks: what the last of them imaged is not valid any more
        self._reported = {"overrun": 0, "underrun": 0}  # the model has no clock, and no faults of it
        self.programs.append((0, None))

    def tick_every(self, clocks: int) -> None:
        """Request ticks every so many clocks from the next clock on; 0 for none."""
        self._command(_PERIOD | clocks)
        self._period, self._until = clocks, 0

    def pace(self, clocks: int, least: int) -> None:
        """Request ticks every so many clocks, unless they come so already; the first after ``least`` clocks or more."""
        if self._period == clocks:
            return
        if self._period:
            self.tick_every(0)
        self.wait(max(self._ticked_at + least - self.clocks - 1, 0))
        self.tick_every(clocks)

    def wait(self, clocks: int) -> None:
        """Let so many clocks pass."""
        if clocks:
            self.commands.append(_WAIT | clocks)
            self._pass(clocks)

    def with_tick(self, *names: str, frames: int = 0) -> None:
        """Put requests on the clock of the next tick."""
        assert self._period, "no tick comes"
        self.wait(self._until)
        self.request(*names, frames=frames)

    def wait_ticks(self, ticks: int) -> None:
        """Let clocks pass until so many more ticks have been played."""
        if ticks:
            self.wait(self._until + (ticks - 1) * self._period + 1)

    def write(self, region: int, words: list[int] | Ints, first: int = 0) -> None:
        """Write words to a region of the idle bank, from address ``first`` on, one a clock.

        Parameters
        ----------
        region
            Number of the region.
        words
            Integers of up to 32 bits, shape (n,).
        first
            Address of the first word.
        """
        base = _WRITE | region << 48
        values = np.asarray(words, dtype=np.int64) & 0xFFFFFFFF
        at = np.arange(first, first + len(values), dtype=np.int64) << 32
        self.commands.extend((values | at | base).tolist())
        self._pass(len(words))

    def write_refused(self, region: int, words: list[int] | Ints, first: int = 0) -> None:
        """Write words that must have no effect: a program is pending, or the last one is still leaving.

        Parameters
        ----------
        region
            Number of the region.
        words
            Integers of up to 32 bits, shape (n,).
        first
            Address of the first word.
        """
        assert not self.writable
        self.write(region, words, first)
        self.refused = True

    def write_unfit(self, address: int, word: int, *, at_once: bool = False) -> None:
        """Write a register of the idle program and commit it, ``at_once`` on the same clock: it does not fit."""
        base = _WRITE | PROGRAM << 48 | address << 32 | word
        self._command(base | (_WITH_COMMIT if at_once else 0))
        if at_once:
            self.refused = True
        else:
            self.commit_unfit()

    def commit_unfit(self) -> None:
        """Commit an idle program that does not fit the device, or that was never written: it is refused."""
        assert self.writable
        self._command(_REQUEST | _UNFIT | 1 << 16 + _REQUESTS.index("commit") | _WRITTEN)
        self.refused = True

    def load(self, program: DualProgram, x: FourierWords | None = None, y: FourierWords | None = None) -> None:
        """Write a whole program, once the idle bank can be written.

        Parameters
        ----------
        x, y
            Fourier words to render an axis from; without them its table is written.
        """
        self.wait_writable()
        assert self.writable, "a program waits to be taken; withdraw it first"
        harmonics = (x.harmonics if x else 0, y.harmonics if y else 0)
        self.write(PROGRAM, program_words(program.schedule, program.x, program.y, harmonics))
        self.write(X_FOURIER, x.in_order) if x else self.write(X_TABLE, program.x.words)
        self.write(Y_FOURIER, y.in_order) if y else self.write(Y_TABLE, program.y.words)

    def wait_writable(self) -> None:
        """Let clocks pass until the last swap is over, if it has come."""
        if not self.waiting:
            self.wait(max(self._writable_at - self.clocks, 0))

    @property
    def writable(self) -> bool:
        """True if the idle bank can be written now."""
        return not self.waiting and self.clocks >= self._writable_at

    @property
    def waiting(self) -> bool:
        """True if a committed program waits to be swapped in."""
        return self.model.idle is not None or self._commits is not None

    def request(
        self,
        *names: str,
        program: DualProgram | None = None,
        frames: int = 0,
        commit_clocks: int = 0,
        mode: CommitMode = CommitMode.LINE,
    ) -> None:
        """Play one clock with requests.

        A commit commits ``program`` in ``mode``, after ``commit_clocks`` or as always.
        """
        mask = sum(1 << _REQUESTS.index(name) for name in names)
        self.commands.append(_REQUEST | mode << _MODE_AT | mask << 16 | frames)
        self._pass(1)
        # In the order of their precedence; they act after a tick of the same clock, a commit one clock later or more.
        if {"clear_faults", "reset"} & set(names):
            self.refused = False
            self._reported = dict.fromkeys(self._reported, 0)
        if {"withdraw", "reset"} & set(names):
            self._commits = None  # what was to be committed later
        for name, act in (
            ("withdraw", self.model.withdraw),
            ("clear_faults", self.model.clear_faults),
            ("arm", lambda: self.model.arm(frames)),
            ("trigger", self.model.trigger),
            ("park", self.model.park),
            ("reset", self.model.reset),
        ):
            if name in names:
                act()
        if "underrun" in names:
            assert not self._period, "samples that are on their way would have it too"
            self._reported["underrun"] += 1
            self._faulty_after = len(self.expected)
        if "commit" in names and not {"withdraw", "reset"} & set(names):
            assert program is not None, "a commit needs its program"
            self._commits, self._mode = program, mode
            self._commits_at = self.clocks + (commit_clocks or self.commit_clocks)

    def come_to_rest(self) -> None:
        """Stop the ticks, and wait until all samples have left."""
        self.tick_every(0)
        self.wait(self.drain)

    def missed_with_sample(self, latency: int) -> None:
        """Tick at rest, with an underrun on the clock on which its sample leaves, ``latency`` clocks later."""
        self.tick_every(2 * latency)
        self.wait(1)
        self.tick_every(0)
        self.wait(latency - 3)
        self.request("underrun")
        self.expected[-1] = self._with_reported(self.expected[-1])

    def state(self, when: str, rests: bool = False) -> None:
        """Store what the device says of itself; ticks stop, or it ``rests`` already. No commit may be on its way."""
        if not rests:
            self.come_to_rest()
        assert not self._period, "samples are on their way"
        assert self._commits is None, "a commit is on its way"
        model = self.model
        flags = (self.writable, self.refused, model.idle is not None, model.armed, model.running, False)
        reported = sum(1 << FAULTS.index(name) for name, count in self._reported.items() if count)
        counts = (*self.counts, *self._reported.values())
        self.states.append((when, StoredState(flags, int(model.faults) | reported, counts, self._outputs)))
        self._command(_STATE)

    def images(self, ahead: int) -> bool:
        """Return True if the last tick is a valid one of an image, and so many after it, if nothing else comes."""
        model = copy(self.model)
        model.fault_counts = dict(self.model.fault_counts)
        return bool(self.expected[-1] & _VALID) and all(model.step().valid for _ in range(ahead))

    @property
    def _outputs(self) -> int:
        """The codes and markers that the device holds."""
        if not self.expected:
            return self.power_up[1] << 24 | self.power_up[0]
        output = self.expected[-1] & ~(0xFF << _FAULTS_AT)
        return output & ~_VALID if self._faulty_after == len(self.expected) else output

    def lost_tick(self, under_way: bool) -> None:
        """Tick too early: while the last sample is ``under_way``, or reported by a driver at rest."""
        assert not self._period
        self._reported["overrun"] += 1
        self._faulty_after = len(self.expected)
        if under_way:
            self.expected[-1] = self._with_reported(self.expected[-1])
        self._command(_EXTRA)

    def _with_reported(self, word: int) -> int:
        """Add the reported faults, which the model does not have, to a tick of the model."""
        for name, count in self._reported.items():
            if count:
                word = word & ~_VALID | 1 << _FAULTS_AT + FAULTS.index(name)
        return word

    def text(self) -> str:
        """Format the script for the bench; it ends with the ticks, and what is under way then."""
        if self._period:
            self.wait(self._period)  # requests act with a tick
            self.tick_every(0)
        return "".join(f"{command:016x}\n" for command in [*self.commands, _WAIT | _DRAIN_CLOCKS, 0])

    def _command(self, command: int) -> None:
        self.commands.append(command)
        self._pass(1)

    def _pass(self, clocks: int) -> None:
        end = self.clocks + clocks
        while self.clocks < end:
            if self._commits is not None:
                self._ticks(min(end, self._commits_at) - self.clocks)
                if self.clocks == self._commits_at:
                    self.model.commit(self._commits, self._mode)
                    self._commits = None
            else:
                self._ticks(end - self.clocks)

    def _ticks(self, clocks: int) -> None:
        """Play the ticks of so many clocks."""
        end = self.clocks + clocks
        if not self._period:
            self.clocks = end
            return
        while self.clocks + self._until < end:
            self.clocks += self._until + 1
            self._until = self._period - 1
            self._ticked_at = self.clocks
            at_once = self.model.ahead((end - self.clocks) // self._period + 1)
            if at_once is not None:
                words = pack_line(*at_once)
                for name, count in self._reported.items():
                    if count:
                        words = words & ~np.uint64(_VALID) | np.uint64(1 << _FAULTS_AT + FAULTS.index(name))
                self.expected.frombytes(words.tobytes())
                self._ticked_at = self.clocks = self.clocks + (len(words) - 1) * self._period
                continue
            tick = self.model.step()
            if tick.swapped:
                self._swapped()
                self._writable_at = self.clocks + self.drain
            self.expected.append(self._with_reported(pack(tick)))
        self._until -= end - self.clocks
        self.clocks = end

    def _swapped(self) -> None:
        """Add the program that the last tick swapped in."""
        assert self.model.playing is not None
        playing = require_dual(self.model.playing)
        self.swapped_programs.append(playing)
        self.programs.append((len(self.expected), playing))

    @property
    def swaps(self) -> int:
        """The number of swaps so far."""
        return len(self.swapped_programs)

    @property
    def all_counts(self) -> list[int]:
        """The counts of all faults, in the order of FAULTS."""
        return [*self.counts, *self._reported.values()]

    @property
    def counts(self) -> list[int]:
        """The counts of the faults of the model: slew, clamp."""
        return [self.model.fault_counts[fault] for fault in (Fault.SLEW, Fault.CLAMP)]


def read_states(words: list[int]) -> list[StoredState]:
    """Read states from their captured words, one after the other."""
    return [StoredState.of(words[at : at + STATE_WORDS]) for at in range(0, len(words), STATE_WORDS)]


def read_capture(path: Path) -> Words:
    """Read the words of a capture; a word with unknown bits becomes all ones, which no tick is.

    Returns
    -------
    Words
        Shape (ticks,).
    """
    text = path.read_text("ascii").lower()
    if "x" in text or "z" in text:
        text = re.sub(r"^.*[xz].*$", "f" * 16, text, flags=re.MULTILINE)
    return np.frombuffer(bytes.fromhex(text), dtype=">u8").astype(np.uint64)


@dataclass(frozen=True)
class Mismatch:
    """The first tick at which a capture and the model differ; None where one of them has ended."""

    tick: int
    expected: Sample | None
    got: Sample | None


def compare(expected: Sequence[int], capture: Words) -> Mismatch | None:
    """Compare every tick of a capture with the model: codes, markers and faults.

    Parameters
    ----------
    expected
        Words of the model, of length n.
    capture
        Captured words, shape (m,).

    Returns
    -------
    Mismatch or None
        The first tick that differs or that only one of both has; None where all are equal.
    """
    model = np.array(expected, dtype=np.uint64)
    length = min(len(model), len(capture))
    differs = np.flatnonzero(model[:length] != capture[:length])
    if not len(differs) and len(model) == len(capture):
        return None
    at = int(differs[0]) if len(differs) else length
    return Mismatch(
        at,
        Sample.of(int(model[at])) if at < len(model) else None,
        Sample.of(int(capture[at])) if at < len(capture) else None,
    )
