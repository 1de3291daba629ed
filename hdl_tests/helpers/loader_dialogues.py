"""Random dialogues with a simulated program_loader and with the model of a device, told by a seed."""

import struct
from binascii import crc32
from collections import Counter
from collections.abc import Callable
from typing import Any
from unittest import mock

import numpy as np
from link_images import damaged, random_image
from link_talk import Talk
from loader_bridge import BOOT_HASH
from loader_device import LoaderDevice, without_lines
from replacing import replace

from tablegen.device.dual_program import DualProgram
from tablegen.device.registers import AXIS_WORDS, PAGE_WORDS
from tablegen.link import model_bank
from tablegen.link.acceptance import Finding, first_objection
from tablegen.link.frames import Frame, FrameReader
from tablegen.link.messages import ANSWER, DeviceInfo, Feature, Reason, Refusal, Request
from tablegen.link.model_device import ModelDevice
from tablegen.link.players import SequencerPlayer
from tablegen.link.program_image import Contents, ProgramImage
from tablegen.verification.play.sequencer_shape import SequencerShape

MOST_FRAMES = (1 << 16) - 1
_NOT_CHECKED = {Reason.RANGE, Reason.SLEW, Reason.JUMP}  # docs/verilog.md says why not
_LEAST_TICKS = 8  # of a line
_MOST_LINES = 1 << 16
_MOST_SETTLE_LINES = 255


class Differs(Exception):
    """The loader does not answer what its model does."""


def objection(contents: Contents, *others: Any) -> Finding | None:
    """The first check of the loader that a program fails."""
    scan = contents.scan
    if (
        scan("line_ticks") < _LEAST_TICKS
        or scan("frame_lines") > _MOST_LINES
        or scan("settle_lines") > _MOST_SETTLE_LINES
    ):
        return Reason.SCHEDULE, 0
    found = first_objection(_not_shaped(contents), *others[:3])
    if found and found[0] not in _NOT_CHECKED:
        return found
    shaped = first_objection(contents, *others)
    return (Reason.REFUSED, 0) if shaped and shaped[0] == Reason.SHAPING else None  # by the sequencer, behind all else


def _not_shaped(contents: Contents) -> Contents:
    words = list(contents.words)
    for page in (1, 2):
        words[page * PAGE_WORDS + AXIS_WORDS.index("shaping")] = 0
    return replace(contents, words=tuple(words))


class Dialogue:
    """``seen`` counts answers by type, and refusals by request and reason."""

    def __init__(
        self, device: LoaderDevice, info: DeviceInfo, boot: DualProgram, shape: SequencerShape, seed: int
    ) -> None:
        self.rng = np.random.default_rng(seed)
        self.shape, self.info, self.device = shape, info, device
        self.model = ModelDevice(
            info, SequencerPlayer(boot), boot=seed, boot_hash=BOOT_HASH, staged=True, most_frames=MOST_FRAMES
        )
        self.talk = Talk(int(self.rng.integers(0, 1 << 32)))
        self.seen: Counter[Any] = Counter()
        self._sent = [self.talk.hello()]
        self._received = 0
        self._image = self._some_image()
        self._readers = FrameReader(), FrameReader()

    def play(self, steps: int) -> None:
        """So many things that are said or done. Raises ``Differs``."""
        doings: list[tuple[float, Callable[[], None]]] = [
            (10, self._upload), (20, self._data), (6, self._commit), (8, self._ticks), (10, self._act), (4, self._ask),
            (1, self._hello), (3, self._again), (1, self._odd), (1, self._permit), (2, self._whole),
        ]  # fmt: skip
        weights = np.array([weight for weight, _ in doings])
        with mock.patch.object(model_bank, "first_objection", objection):
            self._advance(5)
            self._send(self._sent[0])
            for _ in range(steps):
                doings[int(self.rng.choice(len(doings), p=weights / weights.sum()))][1]()

    def upload(self, uploads: int) -> None:
        """So many whole uploads, each of another image. Raises ``Differs``."""
        with mock.patch.object(model_bank, "first_objection", objection):
            self._advance(5)
            self._say(self.talk.hello())
            for _ in range(uploads):
                self._image = self._rare(self._some_image(0.7))
                for wire in [*self.talk.upload(self._image), self.talk.commit(self._image)]:
                    self._say(wire)
                how = self.rng.random()
                if how < 0.1:
                    self._abort()
                elif how < 0.2:  # somebody else takes over
                    self.talk.session ^= 1
                    self._say(self.talk.hello())
                self._advance(60)
                self._say(self.talk.request(Request.READBACK, struct.pack("<IB", 0, 240)))

    def _rare(self, image: ProgramImage) -> ProgramImage:
        """Now and then what chance does not bring about."""
        data, how = bytearray(image.data), int(self.rng.integers(0, 20))
        if how == 0:  # not what BEGIN announces
            return ProgramImage(
                replace(image.info, image_crc=image.info.image_crc ^ 1 << int(self.rng.integers(0, 32))), image.data
            )
        if how == 1:  # longer than its words say
            data += bytes(2)
        if how == 2:  # a step whose product with an even period is the same in 32 bits
            data[4 * PAGE_WORDS + 3] ^= 0x80
        if how == 3 and not data[8 * PAGE_WORDS + 4 * AXIS_WORDS.index("harmonics")]:  # a word of y of 13 bits
            data[-1] ^= 0x08
        return ProgramImage(replace(image.info, image_bytes=len(data), image_crc=crc32(data)), bytes(data))

    def _some_image(self, wrong: float = 0.4) -> ProgramImage:
        image, _ = random_image(self.rng, self.shape, self.info.harmonics, "smooth")
        return damaged(self.rng, image) if self.rng.random() < wrong else image

    def _send(self, wire: bytes) -> None:
        self._sent = [*self._sent[-30:], wire]
        how = self.rng.random()
        if how < 0.03:
            spoilt = bytearray(wire)
            spoilt[int(self.rng.integers(0, len(spoilt)))] ^= 1 << int(self.rng.integers(0, 8))
            wire = bytes(spoilt)
        elif how < 0.05:
            wire = wire[: int(self.rng.integers(0, len(wire)))]
        elif how < 0.07:
            wire = b"\0" + wire
        elif how < 0.08:
            wire = bytes(self.rng.integers(0, 256, int(self.rng.choice([3, 30, 400])), dtype=np.uint8).tolist())
        self._say(wire)

    def _say(self, wire: bytes) -> None:
        self.device.receive(wire)
        self.model.receive(wire)
        self.model.tick(0)
        self._hear()

    def _advance(self, ticks: int) -> None:
        self.device.tick(ticks)
        self.model.tick(ticks)
        self._hear()

    def _hear(self) -> None:
        got, expected = (
            [without_lines(frame) for frame in reader.feed(each.transmit())]
            for reader, each in zip(self._readers, (self.device, self.model), strict=True)
        )
        if got != expected:
            raise Differs(f"{got} and not {expected}")
        for frame in got:
            self._note(frame)

    def _note(self, frame: Frame) -> None:
        if frame.type == 0xFF:
            refusal = Refusal.unpack(frame.payload)
            self.seen[refusal.type, refusal.reason] += 1
            return
        self.seen[frame.type ^ ANSWER] += 1
        if frame.type ^ ANSWER in (Request.BEGIN, Request.DATA):
            (self._received,) = struct.unpack_from("<I", frame.payload)

    def _upload(self) -> None:
        if self.rng.random() < 0.4:
            self._image = self._some_image()
        announced = self._image.info.pack()
        if self.rng.random() < 0.1:
            # but for the bits of an index: a shorter table is no program of this device, whatever others take
            at = int(self.rng.choice([place for place in range(48) if place not in (40, 44)]))
            announced = (
                announced[:at] + bytes([announced[at] ^ 1 << int(self.rng.integers(0, 8))]) + announced[at + 1 :]
            )
        self._send(self.talk.request(Request.BEGIN, announced))

    def _data(self) -> None:
        size = int(self.rng.choice([1, 3, 60, 150, 240]))
        at = self._received
        if self.rng.random() < 0.1:
            at = max(at + int(self.rng.integers(-5, 6)), 0)
        part = self._image.data[at : at + size] or b"\1"
        self._send(self.talk.request(Request.DATA, struct.pack("<I", at) + part))

    def _whole(self) -> None:
        """An upload as it should be."""
        for wire in self.talk.upload(self._image):
            self._send(wire)
        self._send(self.talk.commit(self._image))

    def _commit(self) -> None:
        wrong = self.rng.random() < 0.05
        crc = self._image.info.image_crc ^ wrong
        mode = b""
        if self.info.features & Feature.COMMIT_MODES and self.rng.random() < 0.8:
            mode = bytes([int(self.rng.integers(4))])
        self._send(self.talk.acting(Request.COMMIT, struct.pack("<I", crc) + mode))

    def _ticks(self) -> None:
        self._advance(int(self.rng.choice([1, 2, 20, 60, 200])))

    def _act(self) -> None:
        kind = Request(int(self.rng.choice([Request.ABORT, *_PLAIN, Request.ARM, Request.TRIGGER])))
        payload = b""
        if kind == Request.ARM:
            payload = struct.pack("<I", int(self.rng.choice([0, 0, 0, 1, 2, MOST_FRAMES + 1, 1 << 31])))
        if kind == Request.ABORT:
            self._abort()
            return
        self._send(self.talk.acting(kind, payload))
        self._advance(1)

    def _abort(self) -> None:
        """A model has to wait for a tick, the loader asks its sequencer; the same is said in the end."""
        wire = self.talk.acting(Request.ABORT)
        self.device.receive(wire)
        self.model.receive(wire)
        self._advance(1)

    def _ask(self) -> None:
        kind = int(self.rng.choice([Request.STATUS, Request.LIMITS, Request.READBACK, Request.READBACK]))
        payload = b""
        if kind == Request.READBACK:
            offset = int(self.rng.choice([0, 1, 100, 190, 230, 400, 1 << 31]))
            payload = struct.pack("<IB", offset, int(self.rng.choice([0, 1, 30, 240, 240, 241])))
        self._send(self.talk.request(kind, payload))

    def _hello(self) -> None:
        if self.rng.random() < 0.7:
            self.talk.session = int(self.rng.integers(0, 1 << 32))
        payload = bytes([1]) if self.rng.random() < 0.8 else bytes(int(self.rng.integers(0, 4)))
        self._send(self.talk.request(Request.HELLO, payload))

    def _again(self) -> None:
        self._send(self._sent[int(self.rng.integers(0, len(self._sent)))])

    def _odd(self) -> None:
        """A request of any type, number and length."""
        payload = bytes(self.rng.integers(0, 256, int(self.rng.choice([0, 1, 4, 5, 48, 244])), dtype=np.uint8).tolist())
        kind, seq = int(self.rng.integers(0, 256)), int(self.rng.integers(0, 256))
        if kind == Request.ABORT:
            return
        session = self.talk.session ^ int(self.rng.random() < 0.3)
        self._send(Frame(kind, seq, session, payload).encode())

    def _permit(self) -> None:
        self.device.permits = self.model.permits = self.rng.random() < 0.6


_PLAIN = (Request.PARK, Request.TRIGGER, Request.CLEAR)
