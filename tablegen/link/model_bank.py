"""The memory of a device as docs/protocol.md has it: the upload in progress, its checks, and what plays."""

import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction

from tablegen.config.schema import MAXIMUM_SPLINE_BITS, MAXIMUM_SPLINE_LENGTH
from tablegen.device.dual_program import DualProgram
from tablegen.device.registers import AXIS_WORDS, PAGE_WORDS
from tablegen.device.schedule import Schedule, Window
from tablegen.link.acceptance import Playing, first_objection
from tablegen.link.messages import SPLINE_DEGREE, AxisLimits, DeviceInfo, DeviceState, ImageInfo, Reason, Upload
from tablegen.link.players import Player
from tablegen.link.program_image import PROGRAM_BYTES, Contents, layout, make_image, take_apart

_MIN_INDEX_BITS = 3  # least index bits of an interpolated table


class RequestRefused(Exception):
    """A request that the device refuses, with the reason and its detail of docs/protocol.md."""

    def __init__(self, reason: Reason, detail: int = 0) -> None:
        super().__init__(reason, detail)
        self.reason, self.detail = reason, detail


@dataclass
class Held:
    """An upload in progress; ``announced`` is what BEGIN said."""

    info: ImageInfo
    announced: bytes
    data: bytearray
    state: Upload = Upload.RECEIVING


@dataclass(frozen=True)
class Taken:
    """The program that plays by an upload, since which generation, and the line of the old one that was its last."""

    info: ImageInfo
    image: bytes
    generation: int
    line: int


def program_of(contents: Contents, update_rate_hz: int = 0) -> DualProgram:
    """Return the program of an image.

    Raises
    ------
    ValueError
        If it cannot be played at all.
    """
    scan = contents.scan
    schedule = Schedule(
        ticks=scan("line_ticks"),
        lines=scan("frame_lines"),
        update_rate_hz=Fraction(update_rate_hz or 1),
        requested_hz=0.0,
        pixels=scan("pixels"),
        settle_lines=scan("settle_lines"),
        turn_tick=scan("turn_tick"),
        forward=Window(scan("forward_first"), scan("forward_count")),
        backward=Window(scan("backward_first"), scan("backward_count")),
        turn_line=0,
        up=Window(scan("up_first"), scan("up_count")),
        down=Window(scan("down_first"), scan("down_count")),
    )
    return DualProgram(contents.program(1), contents.program(2), schedule)


class Bank:
    """``held`` is the upload in progress, ``taken`` the one that plays; ``limits`` are the active ones.

    ``staged``: the image is kept, and not its tables.
    """

    def __init__(self, info: DeviceInfo, player: Player, staged: bool) -> None:
        self._info, self._player, self._staged = info, player, staged
        self.power_up()

    def power_up(self) -> None:
        """Nothing but what is in the firmware."""
        self.held: Held | None = None
        self.taken: Taken | None = None
        self.limits = self._info.x_limits, self._info.y_limits
        self._stage_is_whole = True

    def begin(self, payload: bytes) -> bytes:
        """Return the answer to BEGIN.

        Raises
        ------
        RequestRefused
            If an upload is being checked, or the image does not fit the device.
        """
        info = ImageInfo.unpack(payload)
        held = self.held
        if (held is not None and held.state is not Upload.RECEIVING) or not self._player.writable:
            raise RequestRefused(Reason.BUSY)
        for axis, (ours, theirs) in enumerate(((self._info.x, info.x), (self._info.y, info.y))):
            fits = theirs.index_bits == 0 or _MIN_INDEX_BITS <= theirs.length_bits <= ours.index_bits
            if theirs.mode == "cubic":
                fits = fits and self._info.degree >= SPLINE_DEGREE and theirs.word_bits <= MAXIMUM_SPLINE_BITS
                fits = fits and 1 << theirs.length_bits <= MAXIMUM_SPLINE_LENGTH
            if not fits or (theirs.word_bits, theirs.dac_bits) != (ours.word_bits, ours.dac_bits):
                raise RequestRefused(Reason.SHAPE, axis)
        if not PROGRAM_BYTES <= info.image_bytes <= self._info.image_bytes:
            raise RequestRefused(Reason.LENGTH, self._info.image_bytes)
        if held is None or held.announced != payload:
            self._stage_is_whole = False
            held = self.held = Held(info, payload, bytearray())
        return struct.pack("<I", len(held.data))

    def data(self, payload: bytes) -> bytes:
        """Return the answer to DATA.

        Raises
        ------
        RequestRefused
            If no upload was announced, or its program words cannot be played.
        """
        held = self.held
        if held is None:
            raise RequestRefused(Reason.UPLOAD)
        (offset,) = struct.unpack_from("<I", payload)
        before = len(held.data)
        if offset == before and before + len(payload) - 4 <= held.info.image_bytes:
            held.data += payload[4:]
            if before < PROGRAM_BYTES <= len(held.data):
                try:
                    self._look_at_words(held)
                except RequestRefused:
                    self.held = None
                    raise
        return struct.pack("<I", len(held.data))

    def _look_at_words(self, held: Held) -> None:
        """Once the program words are there, an image that is not as long as they say is forgotten."""
        words = struct.unpack_from(f"<{PROGRAM_BYTES // 4}I", held.data)
        shapes = ((held.info.x, self._info.x), (held.info.y, self._info.y))
        for page, (shape, _) in enumerate(shapes, 1):
            harmonics = words[page * PAGE_WORDS + AXIS_WORDS.index("harmonics")]
            most = self._info.harmonics if shape.index_bits else 0
            if harmonics > most:
                raise RequestRefused(Reason.HARMONICS, most)
        for page, (shape, ours) in enumerate(shapes, 1):
            period = words[page * PAGE_WORDS + AXIS_WORDS.index("phase_period")]
            if not shape.index_bits and period > 1 << ours.index_bits:
                raise RequestRefused(Reason.SHAPE, page - 1)
        size = PROGRAM_BYTES + sum(layout(words, held.info.x, held.info.y))
        if size != held.info.image_bytes:
            raise RequestRefused(Reason.LENGTH, size)

    def find(self, image_crc: int) -> Taken | Held:
        """Find what a COMMIT means: the program that plays already, or a complete upload.

        Raises
        ------
        RequestRefused
            If no complete upload has this CRC, or one is being checked.
        """
        held, taken = self.held, self.taken
        if held is None:
            if taken is None or taken.info.image_crc != image_crc:
                raise RequestRefused(Reason.UPLOAD)
            return taken
        if held.info.image_crc != image_crc:
            raise RequestRefused(Reason.UPLOAD)
        if held.state is not Upload.RECEIVING:
            raise RequestRefused(Reason.BUSY)
        if len(held.data) < held.info.image_bytes:
            raise RequestRefused(Reason.INCOMPLETE, len(held.data))
        return held

    def accept(self, held: Held, authentic: Callable[[bytes], None]) -> DualProgram:
        """Check an upload, and return its program.

        Parameters
        ----------
        authentic
            Function that raises if the tag is not the image's.

        Raises
        ------
        RequestRefused
            If the image is damaged or cannot be played within the limits.
        """
        image = bytes(held.data)
        if zlib.crc32(image) != held.info.image_crc:
            raise RequestRefused(Reason.IMAGE)
        authentic(image)
        contents = take_apart(image, held.info.x, held.info.y)
        old = self._player.playing
        playing = None if old is None else Playing(old.x, old.y, self._player.state is DeviceState.PLAYING)
        if objection := first_objection(contents, *self.limits, playing, self._info.shaping):
            raise RequestRefused(*objection)
        return program_of(contents, self._info.update_rate_hz)

    def take(self, held: Held) -> None:
        """Make an upload the current one, once the sequencer has taken its program."""
        self.taken = Taken(held.info, bytes(held.data), self._player.swaps, self._player.swapped_at)
        self.held = None
        self._stage_is_whole = True

    def readback(self, offset: int, count: int) -> bytes:
        """Return bytes of the image that plays.

        Raises
        ------
        RequestRefused
            If the image is not held.
        """
        taken = self.taken
        if taken is None or (self._staged and not self._stage_is_whole):
            raise RequestRefused(Reason.READBACK)
        image = taken.image if self._staged else _of_tables(taken)
        return image[offset : offset + count]

    def limit(self, payload: bytes) -> bytes:
        """Return the answer to LIMITS."""
        if payload:
            size = AxisLimits.LAYOUT.size
            x, y = (AxisLimits.unpack(payload[at : at + size]) for at in (0, size))
            self.limits = x.within(self._info.x_limits), y.within(self._info.y_limits)
        return b"".join(limits.pack() for limits in self.limits)


def _of_tables(taken: Taken) -> bytes:
    """Return the image of the tables that play."""
    program = program_of(take_apart(taken.image, taken.info.x, taken.info.y))
    return make_image(program, taken.info.hash.hex()).data
