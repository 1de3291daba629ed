"""The payloads of requests and answers: the tables of docs/protocol.md."""

import struct
from dataclasses import dataclass, fields, replace
from enum import IntEnum, IntFlag
from typing import ClassVar, Literal, Self

VERSION = 1
DATA_BYTES = 240  # maximum payload of DATA
TAG_BYTES = 16
NONCE_BYTES = 16
HASH_BYTES = 32
ANSWER = 0x80
REFUSAL = 0xFF
CUBIC = 128  # flag in the index bits of a shape
SPLINE_DEGREE = 3


class Request(IntEnum):
    """The types of requests; the answer has bit 7 set."""

    HELLO = 1
    BEGIN = 2
    DATA = 3
    COMMIT = 4
    ABORT = 5
    STATUS = 6
    READBACK = 7
    PARK = 8
    ARM = 9
    TRIGGER = 10
    CLEAR = 11
    CHALLENGE = 12
    LIMITS = 13
    SLOT = 14
    SAVE = 15
    SELECT = 16
    CONFIRM = 17
    DELETE = 18
    MOVE = 19
    LIST = 20
    PLAY = 21


class Reason(IntEnum):
    """The reasons of refusals."""

    TYPE = 1
    PAYLOAD = 2
    VERSION = 3
    SESSION = 4
    OLD = 5
    KEY = 6
    BUSY = 7
    UPLOAD = 8
    SHAPE = 9
    LENGTH = 10
    HARMONICS = 11
    INCOMPLETE = 12
    INTERLOCK = 13
    IMAGE = 14
    SCHEDULE = 15
    PERIOD = 16
    OUTPUT = 17
    CODES = 18
    STEP = 19
    FOURIER = 20
    WORD = 21
    RANGE = 22
    SLEW = 23
    JUMP = 24
    WITHDRAWN = 25
    READBACK = 26
    TICKS = 27
    REFUSED = 28
    SHAPING = 29
    KEEP = 30
    SLOT = 31
    ROOM = 32
    PLAYING = 33
    GENERATION = 34
    TRIAL = 35
    FLASH = 36
    PIXEL_TICKS = 37
    SLOW_PART = 38
    NUMBER = 39


class Feature(IntFlag):
    """The features of a device."""

    TABLES = 1
    FOURIER = 2
    KEY = 4
    READBACK = 8
    INTERLOCK = 16
    NARROWS = 32
    COMMIT_MODES = 64
    STORE = 128


class More(IntFlag):
    """The further features of a device, which HELLO has behind the status."""

    SLOW_PARTS = 1
    MOVE = 2
    PIXEL_TABLES = 4
    PLAY = 8
    Z = 16
    SLOW_MOVE = 32


NO_MORE = More(0)
FURTHER_PARTS = More.SLOW_PARTS | More.PIXEL_TABLES  # those with words in an image


class DeviceState(IntEnum):
    """The states of the sequencer of a device."""

    NO_PROGRAM = 0
    PARKED = 1
    PARKING = 2
    PLAYING = 3


class SlotContent(IntEnum):
    """The content of a slot of a device."""

    EMPTY = 0
    PROGRAM = 1
    DAMAGED = 2


class Upload(IntEnum):
    """The states of an upload."""

    NONE = 0
    RECEIVING = 1
    CHECKING = 2
    WAITING = 3


OF_Z = 1 << 31  # in the detail of a refusal: it is about the image of z
PERMITS = 1  # bits of Status.flags
MOVED = 2
NO_SLOT = 255  # the program of the firmware, or no trial
STORES_WHILE_PLAYING = 1  # bit of StoreStatus.flags


class _Struct:
    """A payload of fixed layout; ``unpack`` ignores what later versions may append."""

    LAYOUT: ClassVar[struct.Struct]

    def pack(self) -> bytes:
        """Return the payload."""
        return self.LAYOUT.pack(*(getattr(self, field.name) for field in fields(self)))  # type: ignore[arg-type]

    @classmethod
    def unpack(cls, payload: bytes) -> Self:
        """Read the fields of a payload.

        Raises
        ------
        ValueError
            If it has fewer bytes than the layout.
        """
        if len(payload) < cls.LAYOUT.size:
            raise ValueError(f"{len(payload)} bytes, too few for {cls.__name__}, which has {cls.LAYOUT.size}")
        return cls(*cls.LAYOUT.unpack_from(payload))


@dataclass(frozen=True, slots=True)
class AxisShape(_Struct):
    """The widths of an axis: bits of the index of its (longest) table, 0 if not interpolated; of its words; of a code.

    Those of a cubic table have 128 added. ``converter``, of a device: bits of the converter's word, + 64 for two's
    complement, + 128 for left alignment.
    """

    LAYOUT: ClassVar[struct.Struct] = struct.Struct("<4B")

    index_bits: int
    word_bits: int
    dac_bits: int
    converter: int = 0

    @property
    def mode(self) -> Literal["interpolated", "cubic", "direct"]:
        """The mode in which the table is played."""
        return "direct" if not self.index_bits else "cubic" if self.index_bits & CUBIC else "interpolated"

    @property
    def length_bits(self) -> int:
        """The logarithm to base 2 of the number of words; 0 of a table that is not interpolated."""
        return self.index_bits & ~CUBIC

    @property
    def word_bytes(self) -> int:
        """The bytes of a table word in an image."""
        return 2 if self.word_bits <= 16 else 3


@dataclass(frozen=True, slots=True)
class AxisLimits(_Struct):
    """The limits of all programs of an axis: straight binary codes, and codes a tick."""

    LAYOUT: ClassVar[struct.Struct] = struct.Struct("<4I")

    code_min: int
    code_max: int
    max_step: int
    max_jump: int

    def within(self, other: "AxisLimits") -> "AxisLimits":
        """Return the limits that both allow."""
        return AxisLimits(
            max(self.code_min, other.code_min),
            min(self.code_max, other.code_max),
            min(self.max_step, other.max_step),
            min(self.max_jump, other.max_jump),
        )


@dataclass(frozen=True, slots=True)
class ZInfo:
    """The properties of the second sequencer of a device (48 bytes), whose x is z and whose y rests.

    They stand in the answer to HELLO behind ``table_pixels``, and are named as those of ``DeviceInfo``.
    """

    LAYOUT: ClassVar[struct.Struct] = struct.Struct("<I2B2x4s4s16s16s")

    image_bytes: int
    slow_knots: int
    slow_index_bits: int
    x: AxisShape
    y: AxisShape
    x_limits: AxisLimits
    y_limits: AxisLimits

    def pack(self) -> bytes:
        """Return the end of the answer to HELLO."""
        parts = (self.x.pack(), self.y.pack(), self.x_limits.pack(), self.y_limits.pack())
        return self.LAYOUT.pack(self.image_bytes, self.slow_knots, self.slow_index_bits, *parts)

    @classmethod
    def unpack_from(cls, payload: bytes, at: int) -> "ZInfo":
        """Read the properties from the answer to HELLO, which has them at this byte."""
        size, knots, bits, x, y, x_limits, y_limits = cls.LAYOUT.unpack_from(payload, at)
        limits = AxisLimits.unpack(x_limits), AxisLimits.unpack(y_limits)
        return cls(size, knots, bits, AxisShape.unpack(x), AxisShape.unpack(y), *limits)


@dataclass(frozen=True, slots=True)
class DeviceInfo:
    """The properties of a device, fixed at its build; ``shaping`` is its highest order of shaped output.

    They are 56 bytes in front of the status in the answer to HELLO, and ``more`` behind it, where it is not 0; behind
    that ``slow_knots`` and ``slow_index_bits``, the most knots and the longest slow table, where it plays slow parts or
    tables of pixels (0 without slow parts); behind those ``table_pixels``, the most pixels of such a table; and ``z``,
    which a device without a second sequencer does not have.
    """

    LAYOUT: ClassVar[struct.Struct] = struct.Struct("<4BH2BI4s4s16s16sI")
    MORE: ClassVar[struct.Struct] = struct.Struct("<I")
    SLOW: ClassVar[struct.Struct] = struct.Struct("<2B")
    PIXELS: ClassVar[struct.Struct] = struct.Struct("<H")

    version: int
    features: Feature
    window: int
    data_bytes: int
    harmonics: int
    image_bytes: int
    x: AxisShape
    y: AxisShape
    x_limits: AxisLimits
    y_limits: AxisLimits
    update_rate_hz: int
    shaping: int = 0
    degree: int = 0  # highest degree of a spline; 0 of a device that plays lines only
    more: More = NO_MORE
    slow_knots: int = 0
    slow_index_bits: int = 0
    table_pixels: int = 0
    z: ZInfo | None = None

    @property
    def of_z(self) -> "DeviceInfo":
        """The properties of the second sequencer, as those of a device that has nothing else."""
        if self.z is None:
            raise ValueError("the device has no output z")
        return replace(
            self,
            features=self.features & ~Feature.FOURIER,
            harmonics=0,
            image_bytes=self.z.image_bytes,
            x=self.z.x,
            y=self.z.y,
            x_limits=self.z.x_limits,
            y_limits=self.z.y_limits,
            more=More.SLOW_PARTS if self.z.slow_knots else NO_MORE,
            slow_knots=self.z.slow_knots,
            slow_index_bits=self.z.slow_index_bits,
            table_pixels=0,
            z=None,
        )

    @property
    def whole_image_bytes(self) -> int:
        """The largest size of an upload, with the image of z."""
        return self.image_bytes + (0 if self.z is None else self.z.image_bytes)

    def pack(self) -> bytes:
        """Return the beginning of the answer to HELLO."""
        parts = (self.x.pack(), self.y.pack(), self.x_limits.pack(), self.y_limits.pack())
        first = (self.version, self.features, self.window, self.data_bytes, self.harmonics, self.shaping, self.degree)
        return self.LAYOUT.pack(*first, self.image_bytes, *parts, self.update_rate_hz)

    def hello(self, status: "DeviceStatus") -> bytes:
        """Return the answer to HELLO; without further features it has the length that it had before them."""
        answer = self.pack() + status.pack_first() + (self.MORE.pack(self.more) if self.more else b"")
        pixels = bool(self.more & (More.PIXEL_TABLES | More.Z))
        if pixels or More.SLOW_PARTS in self.more:
            answer += self.SLOW.pack(self.slow_knots, self.slow_index_bits)
        answer += self.PIXELS.pack(self.table_pixels) if pixels else b""
        return answer + (b"" if self.z is None else self.z.pack())

    @classmethod
    def unpack(cls, payload: bytes) -> "DeviceInfo":
        """Read the properties from the answer to HELLO, or from its beginning.

        Raises
        ------
        ValueError
            If it is too short.
        """
        if len(payload) < cls.LAYOUT.size:
            raise ValueError(f"{len(payload)} bytes, too few for a device")
        version, features, window, data, harmonics, shaping, degree, image, *parts, rate = cls.LAYOUT.unpack_from(
            payload
        )
        x, y, x_limits, y_limits = parts
        more_at = cls.LAYOUT.size + DeviceStatus.LAYOUT.size
        (more,) = cls.MORE.unpack_from(payload, more_at) if len(payload) >= more_at + cls.MORE.size else (0,)
        slow_at = more_at + cls.MORE.size
        has_slow = more & More.SLOW_PARTS and len(payload) >= slow_at + cls.SLOW.size
        knots, slow_bits = cls.SLOW.unpack_from(payload, slow_at) if has_slow else (0, 0)
        pixels_at = slow_at + cls.SLOW.size
        has_pixels = more & More.PIXEL_TABLES and len(payload) >= pixels_at + cls.PIXELS.size
        (pixels,) = cls.PIXELS.unpack_from(payload, pixels_at) if has_pixels else (0,)
        z_at = pixels_at + cls.PIXELS.size
        has_z = more & More.Z and len(payload) >= z_at + ZInfo.LAYOUT.size
        return cls(
            version,
            Feature(features),
            window,
            data,
            harmonics,
            image,
            AxisShape.unpack(x),
            AxisShape.unpack(y),
            AxisLimits.unpack(x_limits),
            AxisLimits.unpack(y_limits),
            rate,
            shaping,
            degree,
            More(more),
            knots,
            slow_bits,
            pixels,
            ZInfo.unpack_from(payload, z_at) if has_z else None,
        )


@dataclass(frozen=True, slots=True)
class ZStatus:
    """The status of the second sequencer of a device (28 bytes), which STATUS has behind that of the first.

    ``plays``: its program belongs to that of x and y; else z rests.
    """

    LAYOUT: ClassVar[struct.Struct] = struct.Struct("<3Bx2I16s")

    state: DeviceState
    faults: int
    plays: bool
    generation: int
    line: int
    fault_counts: tuple[int, int, int, int]  # slew, clamp, overrun, underrun

    def pack(self) -> bytes:
        """Return the end of the answer to STATUS."""
        counts = struct.pack("<4I", *self.fault_counts)
        return self.LAYOUT.pack(self.state, self.faults, self.plays, self.generation, self.line, counts)

    @classmethod
    def unpack(cls, payload: bytes) -> "ZStatus":
        """Read the end of the answer to STATUS.

        Raises
        ------
        ValueError
            If it is too short, or of an unknown state.
        """
        if len(payload) < cls.LAYOUT.size:
            raise ValueError(f"{len(payload)} bytes, too few for a status of z")
        state, faults, plays, generation, line, counts = cls.LAYOUT.unpack_from(payload)
        if state not in list(DeviceState):
            raise ValueError(f"state of z is {state}; possible: 0 to {max(DeviceState)}")
        return cls(DeviceState(state), faults, bool(plays), generation, line, struct.unpack("<4I", counts))


@dataclass(frozen=True, slots=True)
class DeviceStatus:
    """The status of a device (76 bytes), and ``z``, which only STATUS has of a device with a second sequencer."""

    LAYOUT: ClassVar[struct.Struct] = struct.Struct("<4B5I16sI32s")

    state: DeviceState
    upload: Upload
    faults: int
    flags: int
    boot: int
    generation: int
    line: int
    received: int
    image_crc: int
    fault_counts: tuple[int, int, int, int]  # slew, clamp, overrun, underrun
    bad_frames: int
    hash: bytes
    z: ZStatus | None = None

    @property
    def permits(self) -> bool:
        """True if the interlock permits a scan, or there is none."""
        return bool(self.flags & PERMITS)

    @property
    def moved(self) -> bool:
        """True if MOVE has changed words of the program that plays, so that no plan is its own; ``hash`` is 0 then."""
        return bool(self.flags & MOVED)

    def pack(self) -> bytes:
        """Return the answer to STATUS."""
        return self.pack_first() + (b"" if self.z is None else self.z.pack())

    def pack_first(self) -> bytes:
        """Return the status of x and y, which HELLO has too."""
        return self.LAYOUT.pack(
            self.state,
            self.upload,
            self.faults,
            self.flags,
            self.boot,
            self.generation,
            self.line,
            self.received,
            self.image_crc,
            struct.pack("<4I", *self.fault_counts),
            self.bad_frames,
            self.hash,
        )

    @classmethod
    def unpack(cls, payload: bytes) -> "DeviceStatus":
        """Read the answer to STATUS.

        Raises
        ------
        ValueError
            If it is too short, or of an unknown state.
        """
        if len(payload) < cls.LAYOUT.size:
            raise ValueError(f"{len(payload)} bytes, too few for a status")
        state, upload, *numbers, counts, bad, digest = cls.LAYOUT.unpack_from(payload)
        faults, flags, boot, generation, line, received, crc = numbers
        for field, value, known in (("state", state, DeviceState), ("upload", upload, Upload)):
            if value not in list(known):
                raise ValueError(f"{field} is {value}; possible: 0 to {max(known)}")
        return cls(
            DeviceState(state),
            Upload(upload),
            faults,
            flags,
            boot,
            generation,
            line,
            received,
            crc,
            struct.unpack("<4I", counts),
            bad,
            digest,
        )


@dataclass(frozen=True, slots=True)
class ZImageInfo:
    """The announcement of the image of z (12 bytes): its size, and the shapes of z and of the axis that rests."""

    LAYOUT: ClassVar[struct.Struct] = struct.Struct("<I4s4s")

    image_bytes: int
    x: AxisShape
    y: AxisShape

    def pack(self) -> bytes:
        """Return the end of the payload of BEGIN."""
        return self.LAYOUT.pack(self.image_bytes, self.x.pack(), self.y.pack())

    @classmethod
    def unpack_from(cls, payload: bytes, at: int) -> "ZImageInfo":
        """Read the end of the payload of BEGIN, which begins at this byte."""
        size, x, y = cls.LAYOUT.unpack_from(payload, at)
        return cls(size, AxisShape.unpack(x), AxisShape.unpack(y))


@dataclass(frozen=True, slots=True)
class ImageInfo:
    """The announcement of an image by BEGIN (48 bytes), and of the image of z behind it (12 bytes).

    With ``z``, ``image_bytes`` and ``image_crc`` are those of both images together.
    """

    LAYOUT: ClassVar[struct.Struct] = struct.Struct("<32s2I4s4s")

    hash: bytes
    image_bytes: int
    image_crc: int
    x: AxisShape
    y: AxisShape
    z: ZImageInfo | None = None

    @property
    def first(self) -> "ImageInfo":
        """The announcement of the image of x and y; with z, its CRC is that of both."""
        if self.z is None:
            return self
        return replace(self, image_bytes=(self.image_bytes - self.z.image_bytes) & 0xFFFFFFFF, z=None)

    @property
    def second(self) -> "ImageInfo | None":
        """The announcement of the image of z, with the CRC of both; None without z."""
        if self.z is None:
            return None
        return replace(self, image_bytes=self.z.image_bytes, x=self.z.x, y=self.z.y, z=None)

    def pack(self) -> bytes:
        """Return the payload of BEGIN."""
        first = self.LAYOUT.pack(self.hash, self.image_bytes, self.image_crc, self.x.pack(), self.y.pack())
        return first + (b"" if self.z is None else self.z.pack())

    @classmethod
    def unpack(cls, payload: bytes) -> "ImageInfo":
        """Read the payload of BEGIN.

        Raises
        ------
        ValueError
            If it is too short.
        """
        if len(payload) < cls.LAYOUT.size:
            raise ValueError(f"{len(payload)} bytes, too few for an image")
        digest, size, crc, x, y = cls.LAYOUT.unpack_from(payload)
        return cls(digest, size, crc, AxisShape.unpack(x), AxisShape.unpack(y))

    @classmethod
    def of_begin(cls, payload: bytes) -> "ImageInfo":
        """Read the payload of BEGIN, whose length says whether it has the image of z."""
        info, size = cls.unpack(payload), cls.LAYOUT.size
        return replace(info, z=ZImageInfo.unpack_from(payload, size)) if len(payload) > size else info


@dataclass(frozen=True, slots=True)
class StoreStatus(_Struct):
    """The programs that a device keeps, and one of its slots (12 bytes).

    Attributes
    ----------
    slots
        Number of slots, 1 to 15.
    selected, trial
        Slots, or ``NO_SLOT``.
    started
        1 if the trial has been started.
    start
        Slot with whose program the device started, or ``NO_SLOT``.
    reason
        A ``Reason`` why that was not the program that was due, or 0.
    content
        Of the slot that was asked for, a ``SlotContent``.
    flags
        ``STORES_WHILE_PLAYING``, or 0.
    room
        Bytes of the longest image that a slot can have.
    """

    LAYOUT: ClassVar[struct.Struct] = struct.Struct("<8BI")

    slots: int
    selected: int
    trial: int
    started: int
    start: int
    reason: int
    content: int
    flags: int
    room: int


@dataclass(frozen=True, slots=True)
class Listing:
    """The answer to LIST: how many programs a device plays by number, and one of them (38 bytes and its name).

    Attributes
    ----------
    numbers
        How many numbers there are: compiled programs, then slots.
    compiled
        How many of them are compiled programs.
    content
        1 if the number has a program, 0 if not.
    hash
        Of its plan; zeros without a program.
    name
        Of a compiled program; empty for a slot.
    """

    LAYOUT: ClassVar[struct.Struct] = struct.Struct("<2H2B32s")

    numbers: int
    compiled: int
    content: int
    hash: bytes
    name: bytes

    def pack(self) -> bytes:
        """Return the answer."""
        return self.LAYOUT.pack(self.numbers, self.compiled, self.content, len(self.name), self.hash) + self.name

    @classmethod
    def unpack(cls, payload: bytes) -> "Listing":
        """Read the answer.

        Raises
        ------
        ValueError
            If it is too short.
        """
        size = cls.LAYOUT.size
        if len(payload) < size or len(payload) < size + cls.name_bytes(payload):
            raise ValueError(f"{len(payload)} bytes, too few for a program of a device")
        numbers, compiled, content, name_bytes, digest = cls.LAYOUT.unpack_from(payload)
        return cls(numbers, compiled, content, digest, payload[size : size + name_bytes])

    @classmethod
    def name_bytes(cls, payload: bytes) -> int:
        """Return the bytes of the name, by an answer that has at least its fixed part."""
        return payload[cls.LAYOUT.size - HASH_BYTES - 1]


@dataclass(frozen=True, slots=True)
class Play(_Struct):
    """The payload of PLAY (3 bytes): the number of a program, and the mode in which it is committed."""

    LAYOUT: ClassVar[struct.Struct] = struct.Struct("<HB")

    number: int
    mode: int


@dataclass(frozen=True, slots=True)
class AxisWords:
    """The words of an axis that MOVE replaces: the gain, and the offset with the fraction bits of the program.

    With a slow part they are those of the slow table, and ``factor_word`` is that of the gains of the line.
    """

    gain_word: int
    offset_word: int
    factor_word: int | None = None


@dataclass(frozen=True, slots=True)
class Move:
    """The payload of MOVE (28 bytes): new gain and offset words of the program ``generation``, whose tables stay.

    Those of an axis are as words 3 to 5 of its page. For a program with slow parts the factors of both axes follow.
    """

    LAYOUT: ClassVar[struct.Struct] = struct.Struct("<IiIiiIi")
    FACTORS: ClassVar[struct.Struct] = struct.Struct("<2i")
    LOW_BITS: ClassVar[int] = 18  # of an offset, as in tablegen.device.registers, which imports numpy

    generation: int
    x: AxisWords
    y: AxisWords

    def pack(self) -> bytes:
        """Return the payload of MOVE without its tag."""
        mask = (1 << self.LOW_BITS) - 1
        words = [
            word
            for axis in (self.x, self.y)
            for word in (axis.gain_word, axis.offset_word & mask, axis.offset_word >> self.LOW_BITS)
        ]
        data = self.LAYOUT.pack(self.generation, *words)
        if self.x.factor_word is None or self.y.factor_word is None:
            return data
        return data + self.FACTORS.pack(self.x.factor_word, self.y.factor_word)


@dataclass(frozen=True, slots=True)
class Refusal(_Struct):
    """The payload of a refusal; ``reason`` may be one that only a later version knows."""

    LAYOUT: ClassVar[struct.Struct] = struct.Struct("<2BI")

    type: int
    reason: int
    detail: int
