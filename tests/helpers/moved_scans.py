"""A scan that is moved at random by MOVE while it plays, and a check of every line that is played meanwhile.

There are straight scans, and scans with slow parts, as at an angle.
"""

import struct
import zlib
from collections import Counter
from collections.abc import Iterable
from typing import Any, Protocol

import numpy as np
from frame_programs import common_knots, scan_program
from line_log import PlayedLine, WrongLine
from link_programs import make_scan
from link_talk import Talk
from numpy.random import Generator
from numpy.typing import NDArray
from replacing import replace

from tablegen.device.commit_mode import CommitMode
from tablegen.device.dual_program import AxisProgram, ScanProgram
from tablegen.device.sequencer import Sequencer
from tablegen.fixedpoint.frame_program import FACTOR_FRACTION_BITS, FrameProgram
from tablegen.link.messages import REFUSAL, AxisWords, Move, Reason, Refusal, Request
from tablegen.link.program_image import make_image
from tablegen.verification.play.sequencer_shape import SequencerShape
from tablegen.verification.play.stream import FLAGS


def _slow_program(seed: int) -> ScanProgram:
    """A program with slow parts that takes some third of the range of both axes."""
    rng, schedule = np.random.default_rng(seed), BOOT.program.schedule
    for _ in range(500):
        program = common_knots(rng, scan_program(rng, SLOW_SHAPE, schedule, "xy"))
        axes = _in_the_middle(program.x), _in_the_middle(program.y)
        spans = [axis.extremes[1] - axis.extremes[0] for axis in axes]
        if all(12_000 < span < 30_000 for span in spans) and max(axis.extremes[2] for axis in axes) < _MOST_STEP:
            return replace(program, x=axes[0], y=axes[1])
    raise AssertionError


def _in_the_middle(axis: AxisProgram) -> FrameProgram:
    """An axis about the middle of its converter, with other limits and fewer of what is mixed into its lines."""
    assert isinstance(axis, FrameProgram)
    limits = {"code_min": 2000, "code_max": 63000, "park_code": 30000, "max_step": _MOST_STEP}
    slow = replace(axis.slow, offset_word=32500 << axis.output.gain_q)
    ratios = replace(axis.ratios, words=axis.ratios.words // 8)
    return replace(axis, fast=replace(axis.fast, output=replace(axis.output, **limits)), ratios=ratios, slow=slow)


BOOT, SCAN = (make_scan(seed, ticks=40, lines=5) for seed in (1, 3))  # y of both in steps
_MOST_STEP = 6000
SLOW_SHAPE = SequencerShape(16, 3, 5, 16, 3, 4, 16)
SLOW_SCAN = _slow_program(2)
_BIT = {name: 1 << bit for bit, name in enumerate(FLAGS)}
_RECORD = np.dtype([("x", "<u4"), ("y", "<u4"), ("markers", "u1")])
_REFUSED = {
    Reason.OUTPUT,
    Reason.WORD,
    Reason.RANGE,
    Reason.SLEW,
    Reason.JUMP,
}  # what the random words may be refused for


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

    def __init__(self, program: ScanProgram, generation: int) -> None:
        self.lines, self.generation = 0, generation
        self._sequencer = Sequencer(program)
        self._sequencer.arm()
        self._sequencer.trigger()
        self._codes = np.array([self._sequencer.codes])
        self._program = program
        self._offered: dict[int, ScanProgram] = {}

    def offer(self, generation: int, program: ScanProgram) -> None:
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


def random_words(rng: Generator, axis: AxisProgram) -> AxisWords:
    """Words that a device may take, mostly; some of them are anything."""
    if isinstance(axis, FrameProgram):
        return _random_slow_words(rng, axis)
    output = axis.output
    gain, offset, one = output.gain_word, output.offset_word, 1 << output.gain_q
    kind = rng.random()
    if kind < 0.8:
        share = float(rng.uniform(0.05, 1.0))
        room = (1.0 - share) * gain * (1 << 19)  # of the words that the scale leaves on each side
        return AxisWords(round(share * gain), offset + round(float(rng.uniform(-0.4, 0.4)) * room))
    if kind < 0.9:
        return AxisWords(int(rng.integers(-(1 << 17) - 9, (1 << 17) + 9)), offset)
    return AxisWords(gain, offset + int(rng.integers(-(1 << 17), 1 << 17)) * one)


def _random_slow_words(rng: Generator, axis: FrameProgram) -> AxisWords:
    """As above: of up to twice the size, on either side, and mirrored; some of them are anything."""
    one, gain, kind = 1 << axis.output.gain_q, axis.slow.gain_word, rng.random()
    size = float(rng.choice([-1.0, 1.0]) * rng.uniform(0.1, 2.0))
    factor, gain = round(size * float(rng.uniform(0.8, 1.2)) * (1 << FACTOR_FRACTION_BITS)), round(size * gain)
    offset = axis.slow.offset_word + round(float(rng.uniform(-15000.0, 15000.0)) * one)
    if kind < 0.05:
        factor = int(rng.integers(-(1 << 31), 1 << 31)) >> int(rng.integers(0, 14))
    elif kind < 0.1:
        gain = int(rng.integers(-(1 << 17) - 9, (1 << 17) + 9))
    elif kind < 0.15:
        offset += int(rng.integers(-(1 << 17), 1 << 17)) * one
    return AxisWords(gain, offset, factor)


def moved(program: ScanProgram, x: AxisWords, y: AxisWords) -> ScanProgram:
    """The program as it was uploaded, with other words; as it was where gains do not fit, which no device takes."""
    try:
        return replace(program, x=_moved(program.x, x), y=_moved(program.y, y))
    except OverflowError:
        return program


def _moved(axis: AxisProgram, words: AxisWords) -> AxisProgram:
    level = {"gain_word": words.gain_word, "offset_word": words.offset_word}
    if not isinstance(axis, FrameProgram):
        return replace(axis, output=replace(axis.output, **level))
    assert words.factor_word is not None
    gains = [(gain * words.factor_word + (1 << 15)) // (1 << 16) for gain in axis.gains.words.tolist()]
    return replace(axis, gains=replace(axis.gains, words=np.array(gains)), slow=replace(axis.slow, **level))


class MovedScan:
    """A host that moves the scan of a device again and again; ``seen`` counts what the device answers to a MOVE."""

    def __init__(self, device: MovingDevice, seed: int, slow: bool = False) -> None:
        """Play ``SCAN`` on a device that boots ``BOOT``, or ``SLOW_SCAN``."""
        program, image = SCAN.program, SCAN.image(False)
        if slow:
            program, image = SLOW_SCAN, make_image(SLOW_SCAN, 64 * "5")
        self.device, self.rng, self.talk = device, np.random.default_rng(seed), Talk()
        self.seen: Counter[str] = Counter()
        device.receive(self.talk.hello())
        device.tick(400)
        for wire in self.talk.upload(image):
            device.receive(wire)
        device.receive(self.talk.commit(image))
        device.tick(400)  # parked at the new park codes
        list(device.lines())
        self._program = program
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
        words = [random_words(self.rng, axis) for axis in (self._program.x, self._program.y)]
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
