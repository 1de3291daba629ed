"""A scan that is moved at random by MOVE while it plays, and a check of every line that is played meanwhile."""

import struct
import zlib
from collections import Counter
from collections.abc import Iterable
from typing import Any, Protocol

import numpy as np
from line_log import PlayedLine, WrongLine
from link_programs import make_scan
from link_talk import Talk
from numpy.random import Generator
from numpy.typing import NDArray
from replacing import replace

from tablegen.device.commit_mode import CommitMode
from tablegen.device.dual_program import DualProgram
from tablegen.device.sequencer import Sequencer
from tablegen.fixedpoint.output import Output
from tablegen.link.messages import REFUSAL, AxisWords, Move, Reason, Refusal, Request
from tablegen.verification.play.stream import FLAGS

BOOT, SCAN = (make_scan(seed, ticks=40, lines=5) for seed in (1, 3))  # y of both in steps
_BIT = {name: 1 << bit for bit, name in enumerate(FLAGS)}
_RECORD = np.dtype([("x", "<u4"), ("y", "<u4"), ("markers", "u1")])
_REFUSED = {Reason.OUTPUT, Reason.RANGE, Reason.SLEW, Reason.JUMP}  # what the random words may be refused for


class MovingDevice(Protocol):
    """A device at the end of a line, which notes the lines that it plays."""

    def receive(self, data: bytes) -> None:
        """Bytes from the host."""

    def transmit(self) -> bytes:
        """Bytes to the host."""

    def tick(self, ticks: int) -> None:
        """Samples."""

    def lines(self) -> Iterable[Any]:
        """The lines that ended since the last call."""


class MovedLines:
    """Follows the lines of a scan that starts at its park codes; ``offer`` has the programs to come.

    Every line has to be a whole one of one program and the next of the frame. Its codes are those of the integer model,
    inside the limits, and no step is larger than the slew guard allows.
    """

    def __init__(self, program: DualProgram, generation: int) -> None:
        self.lines, self.generation = 0, generation
        self._sequencer = Sequencer(program)
        self._sequencer.arm()
        self._sequencer.trigger()
        self._codes = np.array([self._sequencer.codes])
        self._program = program
        self._offered: dict[int, DualProgram] = {}

    def offer(self, generation: int, program: DualProgram) -> None:
        """The program may play from now on."""
        self._offered[generation] = program

    def follow(self, log: Iterable[PlayedLine]) -> None:
        """Check the next lines. Raises ``WrongLine`` at the first that cannot be."""
        for played in log:
            if played.generation == self.generation + 1:
                self._program = self._offered.pop(played.generation)
                self._sequencer.commit(self._program, CommitMode.KEEP)
            elif played.generation != self.generation:
                raise WrongLine(f"{played} after generation {self.generation}")
            self.generation = played.generation
            ticks = self._program.schedule.ticks
            records = self._play(ticks)
            expected = (self.lines % self._program.schedule.lines, ticks, zlib.crc32(records.tobytes()), 0)
            if (played.line, played.ticks, played.crc, played.faults) != expected:
                raise WrongLine(f"{played} is not {expected}")
            self._check_codes(records)
            self.lines += 1

    def _play(self, ticks: int) -> NDArray[Any]:
        records = np.zeros(ticks, dtype=_RECORD)
        tick = self._sequencer.step()  # with the swap, if there is one
        records[0] = tick.x, tick.y, sum(bit for name, bit in _BIT.items() if getattr(tick, name))
        at = 1
        while at < ticks:
            ahead = self._sequencer.ahead(ticks - at)
            assert ahead is not None
            played, _ = ahead
            part = records[at : at + len(played.x)]
            part["x"], part["y"], part["markers"] = played.x, played.y, _BIT["playing"]
            for name in ("line", "frame", "pixel", "backward", "valid"):
                part["markers"] |= np.where(getattr(played, name), _BIT[name], 0).astype(np.uint8)
            at += len(part)
        return records

    def _check_codes(self, records: NDArray[Any]) -> None:
        codes = np.vstack([self._codes, np.stack([records["x"], records["y"]], axis=1).astype(np.int64)])
        steps = np.abs(np.diff(codes, axis=0))
        for number, axis in enumerate((self._program.x.output, self._program.y.output)):
            column = codes[:, number]
            if column.min() < axis.code_min or column.max() > axis.code_max or steps[:, number].max() > axis.max_step:
                raise WrongLine(f"line {self.lines} of generation {self.generation}: a code or a step beyond a limit")
        self._codes = codes[-1:]


def random_words(rng: Generator, output: Output) -> AxisWords:
    """Words that a device may take, mostly; some of them are anything."""
    gain, offset, one = output.gain_word, output.offset_word, 1 << output.gain_q
    kind = rng.random()
    if kind < 0.8:
        share = float(rng.uniform(0.05, 1.0))
        room = (1.0 - share) * gain * (1 << 19)  # of the words that the scale leaves on each side
        return AxisWords(round(share * gain), offset + round(float(rng.uniform(-0.4, 0.4)) * room))
    if kind < 0.9:
        return AxisWords(int(rng.integers(-(1 << 17) - 9, (1 << 17) + 9)), offset)
    return AxisWords(gain, offset + int(rng.integers(-(1 << 17), 1 << 17)) * one)


def moved(program: DualProgram, x: AxisWords, y: AxisWords) -> DualProgram:
    """The program with other words."""
    axes = {
        name: replace(axis, output=replace(axis.output, gain_word=words.gain_word, offset_word=words.offset_word))
        for name, axis, words in (("x", program.x, x), ("y", program.y, y))
    }
    return replace(program, **axes)


class MovedScan:
    """A host that moves the scan of a device again and again; ``seen`` counts what the device answers to a MOVE."""

    def __init__(self, device: MovingDevice, seed: int) -> None:
        self.device, self.rng, self.talk = device, np.random.default_rng(seed), Talk()
        self.seen: Counter[str] = Counter()
        device.receive(self.talk.hello())
        device.tick(400)
        for wire in self.talk.upload(SCAN.image(False)):
            device.receive(wire)
        device.receive(self.talk.commit(SCAN.image(False)))
        device.tick(400)  # parked at the new park codes
        list(device.lines())
        self._program = SCAN.program
        self.check = MovedLines(self._program, 2)
        self._generation, self._waits = 2, False
        device.receive(self.talk.acting(Request.ARM, bytes(4)) + self.talk.acting(Request.TRIGGER))
        self._tick(20)

    def play(self, moves: int) -> None:
        """So many MOVEs, some of which come too early, and a few of which are withdrawn."""
        for _ in range(moves):
            self._move()
            if self.rng.random() < 0.02:
                self.device.receive(self.talk.acting(Request.ABORT))
            self._tick(int(self.rng.choice([0, 1, 7, 39, 40, 60])))
        self._tick(80)

    def _move(self) -> None:
        words = [random_words(self.rng, axis.output) for axis in (SCAN.program.x, SCAN.program.y)]
        if not self._waits:
            self.check.offer(self._generation + 1, moved(self._program, *words))
        self._waits = True
        self.device.receive(self.talk.acting(Request.MOVE, Move(self._generation, *words).pack()))
        self._hear()

    def _tick(self, ticks: int) -> None:
        self.device.tick(ticks)
        self._hear()
        self.check.follow(PlayedLine(*line) for line in self.device.lines())

    def _hear(self) -> None:
        for answer in self.talk.answers(self.device.transmit()):
            if answer.type == REFUSAL:
                refusal = Refusal.unpack(answer.payload)
                assert refusal.type == Request.MOVE, refusal
                self.seen[Reason(refusal.reason).name] += 1
                self._waits = self._waits and refusal.reason == Reason.BUSY
                assert refusal.reason in _REFUSED | {Reason.BUSY, Reason.WITHDRAWN}
            elif answer.type == Request.MOVE | 0x80:
                generation, _ = struct.unpack("<II", answer.payload)
                assert generation == self._generation + 1
                self._generation, self._waits = generation, False
                self.seen["MOVED"] += 1
