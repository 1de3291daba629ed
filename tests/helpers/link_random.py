"""Random dialogues with a device and with its model: requests good, damaged, repeated, of other sessions."""

import struct
from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np
from cut_flash import MODES, CutFlash
from link_device import SLOW_INDEX_BITS, SLOW_KNOTS, TABLE_PIXELS, CompiledProgram, HostDevice, Started, widest
from link_images import (
    damaged,
    damaged_slow,
    digest,
    random_image,
    random_limits,
    random_slow_program,
    random_z_program,
    resealed,
)
from link_talk import IDENTITY, Talk
from pixel_tables import PIXELS, damaged_table, long_windows, table_image
from programs import random_dual, with_table
from replacing import replace

from tablegen.device.commit_mode import CommitMode
from tablegen.device.dual_program import ScanProgram
from tablegen.device.registers import AXIS_WORDS, PAGE_WORDS, PIXEL_TABLE_WORD
from tablegen.fixedpoint.frame_program import FACTOR_FRACTION_BITS, FrameProgram
from tablegen.link.acceptance import first_objection
from tablegen.link.frames import Frame, FrameReader
from tablegen.link.messages import (
    OF_Z,
    SPLINE_DEGREE,
    VERSION,
    AxisShape,
    AxisWords,
    DeviceInfo,
    Feature,
    More,
    Move,
    Reason,
    Refusal,
    Request,
    ZInfo,
)
from tablegen.link.model_device import ModelDevice
from tablegen.link.players import SequencerPlayer
from tablegen.link.program_image import ProgramImage, fast_of, join, make_image, take_apart
from tablegen.link.store import Layout
from tablegen.verification.play.sequencer_shape import SequencerShape

HARMONICS = 4
KEY = bytes(range(32))
BOOT_HASH = bytes(range(100, 132))
SLOTS, COMPILED = 3, 2
LONG_NAME = "program_1" + 200 * "_"  # longer than an answer to LIST has room for
KEEPING = (Request.SLOT, Request.SAVE, Request.SELECT, Request.CONFIRM, Request.DELETE)
CERTAIN_MODES = tuple(mode for mode in MODES if mode != "unstable")  # whatever is read, and how often
CHECKED_OF_Z = frozenset(Reason) - {Reason.LENGTH, Reason.INCOMPLETE}  # whose detail is no number of bytes
TAGGED = (Request.PARK, Request.ARM, Request.TRIGGER, Request.CLEAR, Request.LIMITS)


class Differs(Exception):
    """A device answers what its model does not."""


class Dialogue:
    """One that is told by a seed. ``seen`` counts answers by type, and refusals by request and reason."""

    def __init__(
        self,
        shape: SequencerShape,
        seed: int,
        key: bytes = b"",
        notes: bool = False,
        order: int = 0,
        store: bool = False,
        slow: bool = False,
        pixels: bool = False,
        plays: bool = False,
        z: bool = False,
        **how: Any,
    ) -> None:
        self.slow, self.pixels, self.z = slow, pixels, z
        self.rng = np.random.default_rng(seed)
        self.shape, self.key, self.order = shape, key, order
        boot = self._some_boot(slow) if self.rng.random() < 0.9 else None
        like = boot or random_dual(self.rng, shape, kind="smooth")
        limits = (widest(like.x.output), widest(like.y.output))
        z_boot = self._some_z(boot) if z and boot is not None and self.rng.random() < 0.6 else None
        if z:
            how |= {"z": z_boot or like, "z_boot": z_boot}
        if self.rng.random() < 0.2:
            limits = random_limits(self.rng, like)
        index = tuple(max(bits, 3) for bits in (shape.x_index_bits, shape.y_index_bits))
        self.flashes: list[CutFlash] = []
        kept: dict[str, Any] = {}
        if plays:
            how["plays"] = True
        if store:
            layout = _some_layout(seed)
            self.flashes = [CutFlash(layout.place(layout.slots + 1), layout.sector_bytes) for _ in range(2)]
            kept = {"stores_while_playing": bool(self.rng.random() < 0.5)}
            how |= {"flash": (self.flashes[0], layout), **kept}
            kept |= {"flash": (self.flashes[1], layout)}
        if store or plays:
            compiled = [self._some_compiled() for _ in range(COMPILED)]
            names = ("program_0", LONG_NAME)
            kept |= {"compiled": {name: image for name, (image, _) in zip(names, compiled, strict=True)}}
            how |= {
                "compiled": [
                    CompiledProgram(name.encode(), image.info.hash.hex().encode(), program)
                    for name, (image, program) in zip(names, compiled, strict=True)
                ]
            }
        self.device = HostDevice(
            like,
            boot,
            limits=limits,
            index_bits=(index[0], index[1]),
            harmonics=HARMONICS,
            key=key,
            boot_hash=BOOT_HASH,
            interlock=True,
            boot_count=int(self.rng.integers(0, 1 << 32)),
            update_rate_hz=20000,
            shaping=order,
            slow=slow,
            pixels=pixels,
            **how,
        )
        assert self.device.started is Started.STARTED, self.device.started
        if notes:
            self.device.take_notes()
        features = Feature.TABLES | Feature.FOURIER | Feature.READBACK | Feature.INTERLOCK | Feature.NARROWS
        self._moves, self._plays = bool(how.get("moves")), plays
        self._modes = bool(how.get("modes")) or self._moves
        features |= Feature.COMMIT_MODES if self._modes else Feature(0)
        features |= Feature.STORE if store else Feature(0)
        x, y = fast_of(like.x), fast_of(like.y)
        shapes = [AxisShape(index[0], x.bits, shape.dac_bits, shape.dac_bits)]
        shapes += [AxisShape(index[1], y.bits, shape.dac_bits, shape.dac_bits)]
        sizes = [each.word_bytes << each.index_bits for each in shapes]
        if slow:
            knots = 5 * SLOW_KNOTS
            sizes = [
                size + (1 << each.index_bits) + (each.word_bytes << SLOW_INDEX_BITS) + knots
                for size, each in zip(sizes, shapes, strict=True)
            ]
        most = 192 + sum(max(size, 4 * (2 * HARMONICS + 1)) for size in sizes) + 4 * TABLE_PIXELS * pixels
        z_info = None
        if z:
            knots = (SLOW_KNOTS, SLOW_INDEX_BITS) if slow else (0, 0)
            z_info = ZInfo(192 + sum(sizes), *knots, shapes[0], shapes[1], *(widest(like.x.output),) * 2)
        ring = self.device.library.ring // 256
        degree = SPLINE_DEGREE if "cubic" in (x.mode, y.mode) else 0
        info = DeviceInfo(
            VERSION,
            features | (Feature.KEY if key else 0),
            ring,
            240,
            HARMONICS,
            most,
            *shapes,
            *limits,
            20000,
            order,
            degree,
            (More.MOVE if self._moves else More(0))
            | (More.SLOW_MOVE if self._moves and slow else More(0))
            | (More.SLOW_PARTS if slow else More(0))
            | (More.PIXEL_TABLES if pixels else More(0))
            | (More.PLAY if plays else More(0))
            | (More.Z if z else More(0)),
            *((SLOW_KNOTS, SLOW_INDEX_BITS) if slow else (0, 0)),
            TABLE_PIXELS if pixels else 0,
            z_info,
        )
        self._clock = 0
        self.device.set_clock(0)
        self.model = ModelDevice(
            info,
            SequencerPlayer(boot),
            key=key,
            boot=self.device.boot_count,
            boot_hash=BOOT_HASH,
            identity=IDENTITY,
            milliseconds=lambda: self._clock,
            z_player=SequencerPlayer(z_boot) if z else None,
            plays_z=z_boot is not None,
            **kept,
        )
        self.talk = Talk(int(self.rng.integers(1, 1 << 32)), key)
        self.seen: Counter[Any] = Counter()
        self._sent = [self.talk.hello()]
        self._nonce_given = bytes(16)
        self._image = self._some_image()
        self._reader = FrameReader()
        self.heard = bytearray()
        self._received = 0

    def _some_boot(self, slow: bool) -> ScanProgram:
        """A program that a device can load: of a slow part one that its specification has no objection to."""
        while slow and self.rng.random() < 0.5:
            program = random_slow_program(self.rng, self.shape)
            image = make_image(program, "00" * 32)
            limits = widest(program.x.output), widest(program.y.output)
            if first_objection(take_apart(image.data, image.info.x, image.info.y), *limits, None) is None:
                return program
        return random_dual(self.rng, self.shape, kind="smooth")

    def _some_compiled(self) -> tuple[ProgramImage, ScanProgram]:
        """A program that a sequencer loads; one with a slow part may fail the checks of its codes."""
        while self.slow and self.rng.random() < 0.7:
            program = random_slow_program(self.rng, self.shape)
            image = make_image(program, digest(self.rng))
            limits = widest(program.x.output), widest(program.y.output)
            objection = first_objection(take_apart(image.data, image.info.x, image.info.y), *limits, None)
            if objection is None or objection[0] in (Reason.RANGE, Reason.SLEW):
                return image, program
        return random_image(self.rng, self.shape, 0, "smooth", self.order)

    def _some_z(self, beside: ScanProgram) -> ScanProgram:
        """A program of z that a device can load, with the schedule of that of x and y."""
        while True:
            program = random_z_program(self.rng, self.shape, beside.schedule)
            image = make_image(program, "00" * 32)
            limits = widest(program.x.output), widest(program.y.output)
            if first_objection(take_apart(image.data, image.info.x, image.info.y), *limits, None) is None:
                return program

    def _some_image(self) -> ProgramImage:
        if not self.z or self.rng.random() < 0.25:
            return self._some_first_image()
        rng = self.rng
        program = random_slow_program(rng, self.shape)
        first, fourier = make_image(program, digest(rng)), rng.random()
        if fourier < 0.3:
            first, program = random_image(rng, self.shape, HARMONICS, "smooth", self.order)
        elif fourier < 0.4:
            first = damaged_slow(rng, first)
        second = make_image(random_z_program(rng, self.shape, program.schedule), digest(rng))
        if rng.random() < 0.1:
            second = make_image(random_slow_program(rng, self.shape), digest(rng))  # another schedule
        if rng.random() < 0.1:  # form
            data = bytearray(second.data)
            at = 4 * (PAGE_WORDS * int(rng.integers(1, 3)) + int(rng.choice([10, 12])))
            data[at + int(rng.integers(0, 3))] ^= 1 << int(rng.integers(0, 8))
            second = resealed(second, bytes(data))
        elif rng.random() < 0.4:
            second = damaged_slow(rng, second)
        return join(first, second)

    def _some_first_image(self) -> ProgramImage:
        if self.slow and self.rng.random() < 0.7:
            return self._some_slow_image()
        if self.pixels and self.rng.random() < 0.7:
            return self._some_table_image()
        kind = str(self.rng.choice(["smooth", "smooth", "tame", "wild"]))
        image, _ = random_image(self.rng, self.shape, HARMONICS, kind, self.order)  # type: ignore[arg-type]
        if self.rng.random() < 0.05:
            data = bytearray(image.data)
            data[4 * (PAGE_WORDS * int(self.rng.integers(1, 3)) + AXIS_WORDS.index("harmonics"))] ^= 9
            return resealed(image, bytes(data))
        return damaged(self.rng, image) if self.rng.random() < 0.3 else image

    def _some_table_image(self) -> ProgramImage:
        image, program = random_image(self.rng, self.shape, order=self.order)
        schedule = long_windows(self.rng, program.schedule.ticks, program.schedule.lines)
        image = table_image(self.rng, replace(program, schedule=schedule))
        if self.rng.random() < 0.1:  # form of the table
            data, at = bytearray(image.data), 4 * int(self.rng.choice([PIXELS, PIXEL_TABLE_WORD]))
            data[at + int(self.rng.integers(0, 2))] ^= 1 << int(self.rng.integers(0, 8))
            return resealed(image, bytes(data))
        return damaged_table(self.rng, image) if self.rng.random() < 0.3 else image

    def _good_slow_image(self) -> ProgramImage:
        """An image with a slow part of both axes that the device takes, if one is soon found."""
        for _ in range(40):
            program = random_slow_program(self.rng, self.shape)
            if not (isinstance(program.x, FrameProgram) and isinstance(program.y, FrameProgram)):
                continue
            image = make_image(program, digest(self.rng))
            contents = take_apart(image.data, image.info.x, image.info.y)
            limits = widest(program.x.output), widest(program.y.output)
            if first_objection(contents, *limits, None, self.order) is None:
                return image
        return self._some_image()

    def _some_slow_image(self) -> ProgramImage:
        program = random_slow_program(self.rng, self.shape)
        if self.pixels and self.rng.random() < 0.7:
            program = replace(program, schedule=with_table(self.rng, program.schedule))
        image = make_image(program, digest(self.rng))
        if self.rng.random() < 0.1:  # form of the slow part
            data = bytearray(image.data)
            data[4 * (PAGE_WORDS * int(self.rng.integers(1, 3)) + 12) + int(self.rng.integers(0, 3))] ^= 1 << int(
                self.rng.integers(0, 8)
            )
            return resealed(image, bytes(data))
        return damaged_slow(self.rng, image) if self.rng.random() < 0.3 else image

    # What is said

    def _say(self, wire: bytes) -> None:
        """To both; noise on the way is the same for both."""
        if self.rng.random() < 0.03:
            damage = bytearray(wire)
            damage[int(self.rng.integers(0, len(damage)))] ^= 1 << int(self.rng.integers(0, 8))
            wire = bytes(damage)
        elif self.rng.random() < 0.02:
            wire = wire[
                : int(self.rng.integers(0, max(len(wire) - 1, 1)))
            ]  # not just its end: two frames in one piece overlap
        elif self.rng.random() < 0.02:
            wire = b"\0" + wire
        # With a trigger and a swap on one tick it is anybody's guess which line was the last of the old program.
        alone = any(frame.type == Request.TRIGGER for frame in FrameReader().feed(wire))
        self._tick(alone)
        self.device.receive(wire)
        self.model.receive(wire)
        self._hear()
        self._tick(alone)

    def _tick(self, ticks: int) -> None:
        for _ in range(ticks):
            self.device.tick(1)
            self.model.tick(1)
            self._hear()

    def _hear(self) -> None:
        got, expected = self.device.transmit(), self.model.transmit()
        self.heard += got
        if got != expected:
            reader = FrameReader()
            raise Differs(f"{reader.feed(got)} and not {reader.feed(expected)}")
        for frame in self._reader.feed(got):
            if frame.type == 0xFF:
                refusal = Refusal.unpack(frame.payload)
                self.seen[refusal.type, refusal.reason] += 1
                if refusal.detail & OF_Z and refusal.reason in CHECKED_OF_Z:
                    self.seen[refusal.type, refusal.reason, "z"] += 1
            else:
                self.seen[frame.type & 0x7F] += 1
                if frame.type & 0x7F == Request.MOVE and isinstance(self.model.player.playing.x, FrameProgram):
                    self.seen[Request.MOVE, "slow"] += 1
                if frame.type & 0x7F in (Request.BEGIN, Request.DATA):
                    (self._received,) = struct.unpack_from("<I", frame.payload)
                if frame.type & 0x7F == Request.CHALLENGE:
                    self._nonce_given = frame.payload

    def _send(self, wire: bytes) -> None:
        self._sent = [*self._sent[-30:], wire]
        self._say(wire)

    def play(self, steps: int) -> None:
        """So many things that are said or done."""
        self._send(self.talk.hello())
        doings: list[tuple[float, Callable[[], None]]] = [
            (10, self._upload), (25, self._data), (6, self._commit), (8, self._ticks), (10, self._act),
            (3, self._ask), (1, self._hello), (3, self._again), (1, self._noise), (1, self._odd),
            (0.5, self._permit), (0.3, self._reboot), (0.7, self._whole),
        ]  # fmt: skip
        if self.flashes:
            doings += [(12, self._keep), (2, self._cut), (1, self._reboot), (4, self._whole), (3, self._trial)]
            doings += [(3, self._play)]
        if self._plays:
            doings += [(12, self._play_number), (4, self._whole)]
        if self._moves:
            doings += [(15, self._move), (2, self._whole)]
        if self.pixels:
            doings += [(8, self._another)]
        if self.z:
            doings += [(10, self._begin_z), (6, self._whole), (3, self._another)]
        if self.device.notes is not None:  # a replay has no cuts
            doings = [doing for doing in doings if doing[1] != self._cut]
        weights = np.array([weight for weight, _ in doings])
        for _ in range(steps):
            doings[int(self.rng.choice(len(doings), p=weights / weights.sum()))][1]()

    def _upload(self) -> None:
        if self.rng.random() < 0.4:
            self._image = self._some_image()
        info = self._image.info.pack()
        if self.rng.random() < 0.1:
            at = int(self.rng.integers(0, len(info)))
            info = info[:at] + bytes([info[at] ^ 1 << int(self.rng.integers(0, 8))]) + info[at + 1 :]
        if self._received == 0 or self.rng.random() < 0.2:
            self._send(self.talk.request(Request.BEGIN, info))

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
        self._commit(sure=True)

    def _another(self) -> None:
        """Another image, whole, with time for it to be taken."""
        self._send(self.talk.acting(Request.ABORT))
        self._image = self._some_image()
        self._whole()
        self._tick(60)

    def _tagged(self, kind: int, payload: bytes = b"", image: bytes | None = None) -> bytes:
        if self.key and self.rng.random() < 0.9:
            self._send(self.talk.request(Request.CHALLENGE))
            if self.rng.random() < 0.2:
                self._clock += int(self.rng.choice([1, 9_999, 10_000, 4_000_000_000]))
                self.device.set_clock(self._clock & 0xFFFFFFFF)
            if self.rng.random() < 0.9:
                return self.talk.acting(kind, payload, self._nonce_given, image)
            return self.talk.acting(kind, payload + bytes(16))
        return self.talk.acting(kind, payload)

    def _commit(self, sure: bool = False) -> None:
        if not sure and self._received < len(self._image.data) and self.rng.random() < 0.7:
            return
        crc = self._image.info.image_crc ^ (0 if sure or self.rng.random() < 0.95 else 1)
        payload = struct.pack("<I", crc)
        if self._modes and self.rng.random() < 0.8:
            payload += bytes([int(self.rng.choice([*CommitMode, *CommitMode, 3]))])
        self._send(self._tagged(Request.COMMIT, payload, self._image.data))

    def _move(self) -> None:
        """New words: near those that play, or any; mostly of a program that was uploaded."""
        playing = self.model.player.playing
        if (
            self.rng.random() < 0.9
            and self.model.status().hash in (BOOT_HASH, bytes(32))
            and not self.model.status().moved
        ):
            self._send(self.talk.acting(Request.ABORT))
            self._image, _ = random_image(self.rng, self.shape, HARMONICS, "smooth", self.order)
            if self.slow and self.rng.random() < 0.7:
                self._image = self._good_slow_image()
            self._whole()
            self._tick(60)
            playing = self.model.player.playing
        if playing is None:
            return
        words = []
        has_factors = isinstance(playing.x, FrameProgram) != (self.slow and self.rng.random() < 0.03)
        for program in (playing.x, playing.y):
            axis, level = program.output, program.slow if isinstance(program, FrameProgram) else program.output
            gain, offset, one = level.gain_word, level.offset_word, 1 << axis.gain_q
            factor = round((1 << FACTOR_FRACTION_BITS) * self.rng.uniform(0.9, 1.0)) if has_factors else None
            kind = self.rng.random()
            if kind < 0.7:
                gain = round(gain * self.rng.uniform(0.9, 1.0))
                offset += round(self.rng.normal(0.0, 1.0) * one)
            elif kind < 0.8:
                gain = int(self.rng.integers(-(1 << 17) - 2, (1 << 17) + 2))
            elif kind < 0.9:
                offset += int(self.rng.integers(-(1 << axis.dac_bits), 1 << axis.dac_bits)) * one
            elif kind < 0.95 and has_factors:
                factor = int(self.rng.integers(-(1 << 31), 1 << 31)) >> int(self.rng.integers(0, 20))
            words.append(AxisWords(gain, offset, factor))
        wrong = int(self.rng.random() < 0.05)
        payload = bytearray(Move(self.model.status().generation + wrong, *words).pack())
        if self.rng.random() < 0.05:
            payload[int(self.rng.integers(4, len(payload)))] ^= 1 << int(self.rng.integers(0, 8))
        self._send(self._tagged(Request.MOVE, bytes(payload)))
        if self.rng.random() < 0.3:
            self._send(self.talk.request(Request.READBACK, struct.pack("<IB", 64, 240)))

    def _begin_z(self) -> None:
        """An upload with z or without, in place of what plays; mostly where no scan plays."""
        self._send(self.talk.acting(Request.ABORT))
        if self.rng.random() < 0.7:
            self._send(self._tagged(Request.PARK))
            self._tick(int(self.rng.choice([0, 1, 60])))
        self._image = self._some_image()
        self._whole()
        self._tick(int(self.rng.choice([0, 1, 60])))
        if self.rng.random() < 0.8:
            self._send(self._tagged(Request.ARM, struct.pack("<I", int(self.rng.choice([0, 1])))))
            self._send(self._tagged(Request.TRIGGER))
        if self.rng.random() < 0.2:
            self._send(self.talk.acting(Request.ABORT))
        self._tick(int(self.rng.choice([0, 1, 60])))

    def _ticks(self) -> None:
        self._tick(int(self.rng.choice([0, 1, 2, 20, 60])))

    def _act(self) -> None:
        kind = int(self.rng.choice([Request.ABORT, *TAGGED, Request.ARM, Request.TRIGGER]))
        payload = b""
        if kind == Request.ARM:
            payload = struct.pack("<I", int(self.rng.choice([0, 0, 0, 1, 2, 1 << 31, (1 << 31) + 1])))
        if kind == Request.LIMITS:
            limits = random_limits(self.rng, random_dual(self.rng, self.shape, kind="smooth"))
            wide = self.rng.random() < 0.7
            payload = struct.pack("<8I", *(0, 0xFFFFFFFF, 1 << 30, 1 << 30) * 2) if wide else b"".join(
                each.pack() for each in limits
            )  # fmt: skip
        self._send(self.talk.acting(kind, payload) if kind == Request.ABORT else self._tagged(kind, payload))

    def _ask(self) -> None:
        kind = int(self.rng.choice([Request.STATUS, Request.READBACK, Request.LIMITS, Request.CHALLENGE]))
        payload = b""
        if kind == Request.READBACK:
            offset = int(self.rng.choice([0, 1, 100, 190, 192, 240, 250, 400, 5000, (1 << 32) - 1]))
            payload = struct.pack("<IB", offset, int(self.rng.choice([0, 1, 7, 240, 241])))
        self._send(self.talk.request(kind, payload))

    def _hello(self) -> None:
        if self.rng.random() < 0.3:
            self.talk.session = int(self.rng.integers(0, 1 << 32))
            self.talk.seq = int(self.rng.integers(0, 256))
        self._send(self.talk.hello())

    def _again(self) -> None:
        self._say(self._sent[-1 - int(self.rng.integers(0, min(len(self._sent), int(self.rng.choice([1, 3, 30])))))])

    def _noise(self) -> None:
        count = int(self.rng.choice([1, 5, 300]))
        self._say(bytes(self.rng.integers(0, 256, count, dtype=np.uint8).tolist()))

    def _odd(self) -> None:
        """Frames that no host sends."""
        kind = int(self.rng.choice([*range(23 if self._plays else 20), 0x81, 0xFF]))
        payload = bytes(self.rng.integers(0, 256, int(self.rng.integers(0, 244)), dtype=np.uint8).tolist())
        session = self.talk.session if self.rng.random() < 0.7 else 1
        seq = int(self.rng.integers(0, 256)) if kind in (Request.STATUS, Request.BEGIN) else self.talk.seq
        self._send(Frame(kind, seq, session, payload[: int(self.rng.choice([0, 1, 4, 5, 16, 32, 48, 200]))]).encode())

    def _permit(self) -> None:
        permits = bool(self.rng.random() < 0.8)
        self.device.permits = self.model.permits = permits

    def _keep(self) -> None:
        """Something about the kept programs."""
        kind = int(self.rng.choice([*KEEPING, Request.SAVE, Request.SAVE, Request.SELECT, Request.SELECT]))
        slot = int(self.rng.choice([*range(SLOTS + 1), *range(SLOTS), 255]))
        payload = bytes([slot])
        if kind == Request.SAVE:
            wrong = int(self.rng.random() < 0.1)
            payload += struct.pack("<I", self.model.status().generation + wrong)
        elif kind == Request.SELECT:
            payload += bytes([int(self.rng.choice([0, 0, 1, 1, 1, 2]))])
        elif kind == Request.CONFIRM:
            payload = b""
        self._send(self.talk.request(kind, payload) if kind == Request.SLOT else self._tagged(kind, payload))

    def _play(self) -> None:
        """The application plays a program of the device, and goes on at once or after some ticks."""
        if self.rng.random() < 0.7:
            self._send(self.talk.acting(Request.ABORT))
            self._tick(1)
        held = [slot for slot in range(SLOTS) if self.model.keeps(slot)]
        slot = int(self.rng.choice([*held, *held, *held, *range(-COMPILED, SLOTS + 1), 255]))
        begun = self.device.play(COMPILED + slot)
        if begun != self.model.play(COMPILED + slot):
            raise Differs(f"program {slot} {'begins' if begun else 'does not begin'}")
        self.seen["played" if begun else "not played", "compiled" if slot < 0 else "kept"] += 1
        self._hear()
        self._tick(int(self.rng.choice([0, 0, 1, 20])))

    def _play_number(self) -> None:
        """A host asks for a program of the device, or what it is."""
        slots = SLOTS if self.flashes else 0
        held = [COMPILED + slot for slot in range(slots) if self.model.keeps(slot)]
        number = int(self.rng.choice([*range(COMPILED + slots + 1), *held, *range(COMPILED), 0x100, 0xFFFF]))
        if self.rng.random() < 0.4:
            self._send(self.talk.request(Request.LIST, struct.pack("<H", number)))
            return
        if self.rng.random() < 0.3:
            self._act()
        mode = int(self.rng.choice([0, 0, *CommitMode, 3]))
        self._send(self._tagged(Request.PLAY, struct.pack("<HB", number, mode)))
        self._received = 0
        if self.rng.random() < 0.2:
            self._send(self.talk.acting(Request.ABORT))
        self._tick(int(self.rng.choice([0, 0, 1, 20, 60])))

    def _trial(self) -> None:
        """Keep what plays, try it after a start, and confirm it."""
        slot = int(self.rng.integers(0, SLOTS))
        if self.rng.random() < 0.7:
            self._send(self.talk.acting(Request.ABORT))
            self._image, _ = random_image(self.rng, self.shape, HARMONICS, "smooth", self.order)
            self._whole()
            self._tick(60)
        if self.rng.random() < 0.7:
            generation = struct.pack("<I", self.model.status().generation)
            self._send(self._tagged(Request.SAVE, bytes([slot]) + generation))
        self._send(self._tagged(Request.SELECT, bytes([slot, 1])))
        self._reboot()
        self._tick(int(self.rng.choice([0, 1, 1, 5])))
        if self.rng.random() < 0.3:
            self._keep()
        self._send(self._tagged(Request.CONFIRM))
        self._send(self.talk.request(Request.SLOT, bytes([slot])))

    def _cut(self) -> None:
        """The supply fails while something is done about the kept programs, or soon after; then a start."""
        event, mode = int(self.rng.choice([0, 1, 3, 5, 9, 30, 60])), str(self.rng.choice(CERTAIN_MODES))
        for flash in self.flashes:
            flash.cut(event, mode)
        self._keep()
        self._reboot()

    def _reboot(self) -> None:
        for flash in self.flashes:
            flash.power_up()
        self.device.reboot()
        self.model.reboot()
        self._received = 0
        self._send(self.talk.hello())


def _some_layout(seed: int) -> Layout:
    """A layout of few slots; in one of five the longest images have no room."""
    return Layout(320, 320, 1, SLOTS) if seed % 5 == 0 else Layout(0, 256, 2, SLOTS)
