"""The memory of a device as docs/protocol.md has it: the upload in progress, its checks, and what plays."""

import struct
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from tablegen.config.schema import MAXIMUM_SPLINE_BITS, MAXIMUM_SPLINE_LENGTH
from tablegen.device.dual_program import ScanProgram
from tablegen.device.registers import (
    AXIS_WORDS,
    PAGE_WORDS,
    PIXEL_TABLE_WORD,
    SCAN_WORDS,
    SLOW_INDEX_SHIFT,
    SLOW_WORDS,
)
from tablegen.device.schedule import Schedule, Window
from tablegen.fixedpoint.frame_program import Knots
from tablegen.fixedpoint.output import GAIN_BITS
from tablegen.fixedpoint.rounding import signed_limits
from tablegen.link.acceptance import Playing, first_objection
from tablegen.link.messages import (
    HASH_BYTES,
    OF_Z,
    SPLINE_DEGREE,
    TAG_BYTES,
    AxisLimits,
    AxisShape,
    DeviceInfo,
    DeviceState,
    ImageInfo,
    More,
    Move,
    Reason,
    Upload,
)
from tablegen.link.players import Player
from tablegen.link.program_image import (
    PROGRAM_BYTES,
    Contents,
    ProgramImage,
    make_image,
    pack_words,
    parts_of,
    size_of,
    take_apart,
)

_MIN_INDEX_BITS = 3  # least index bits of an interpolated table, and of a slow one
_MIXED_INDEX_BITS = 8  # most index bits of a table of lines with a slow part
_MIN_KNOTS = 2
_SCHEDULE_BYTES = 4 * (SCAN_WORDS.index("pixels") + 1)  # program words that the images of x and y and of z share
_MOVED_BYTES = 12  # words of an axis that MOVE replaces: the gain, and the low and the high part of the offset


def plain_move_bytes(size: int) -> int:
    """Return the bytes of the payload of a MOVE without its tag; with factors they are more."""
    plain = Move.LAYOUT.size
    with_factors = plain + Move.FACTORS.size
    return with_factors if size in (with_factors, with_factors + TAG_BYTES) else plain


class RequestRefused(Exception):
    """A request that the device refuses, with the reason and its detail of docs/protocol.md."""

    def __init__(self, reason: Reason, detail: int = 0) -> None:
        super().__init__(reason, detail)
        self.reason, self.detail = reason, detail

    def of_z(self) -> "RequestRefused":
        """Return the refusal that says that this is about the image of z."""
        return RequestRefused(self.reason, self.detail | OF_Z)


@dataclass
class IncomingUpload:
    """An upload in progress; ``announcement`` is the payload of its BEGIN."""

    info: ImageInfo
    announcement: bytes
    data: bytearray
    state: Upload = Upload.RECEIVING


@dataclass(frozen=True)
class ActiveUpload:
    """An upload that plays: the generation since which it does, and the last line of the old program.

    ``moved``: the image as it was uploaded, if MOVE has changed its words since.
    """

    info: ImageInfo
    image: bytes
    generation: int
    line: int
    moved: bytes | None = None

    @property
    def uploaded(self) -> bytes:
        """The image as it was uploaded."""
        return self.image if self.moved is None else self.moved


def program_of(contents: Contents, update_rate_hz: int = 0) -> ScanProgram:
    """Return the program of an image.

    Raises
    ------
    ValueError
        If it cannot be played at all.
    """
    scan = contents.scan
    pixels = None
    if contents.pixel_ticks is not None:
        forward, backward = contents.pixel_ticks.tolist()
        pixels = tuple(forward), tuple(backward)
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
        pixel_table=pixels,
    )
    return ScanProgram(contents.program(1), contents.program(2), schedule)


class Bank:
    """The memory of a device: the upload in progress, the one that plays, and the active limits.

    ``staged``: the image is kept, and not its tables. ``second`` is the memory of a second sequencer, for the image of
    z; an upload, with what was received of it, is here alone.
    """

    def __init__(self, info: DeviceInfo, player: Player, staged: bool, second: "Bank | None" = None) -> None:
        self._info, self._player, self._staged, self.second = info, player, staged, second
        self.power_up()

    def power_up(self) -> None:
        """Reset the memory to the firmware's."""
        self.incoming: IncomingUpload | None = None
        self.move: IncomingUpload | None = None  # the image of a MOVE that is checked or waits
        self.active: ActiveUpload | None = None
        self.limits = self._info.x_limits, self._info.y_limits
        self._stage_is_whole = True

    def begin(self, payload: bytes) -> bytes:
        """Return the answer to BEGIN.

        Raises
        ------
        RequestRefused
            If an upload is being checked, or the image does not fit the device.
        """
        info = ImageInfo.of_begin(payload)
        incoming = self.incoming
        self.check_idle()
        self._check_announcement(info.first)
        if info.second is not None and self.second is not None:
            try:
                self.second._check_announcement(info.second)
            except RequestRefused as refused:
                self.incoming = None
                raise refused.of_z() from None
        if incoming is None or incoming.announcement != payload:
            self._stage_is_whole = False
            incoming = self.incoming = IncomingUpload(info, payload, bytearray())
        return struct.pack("<I", len(incoming.data))

    def _check_announcement(self, info: ImageInfo) -> None:
        """Check the shapes of an image and its length."""
        for axis, (ours, theirs) in enumerate(((self._info.x, info.x), (self._info.y, info.y))):
            fits = theirs.index_bits == 0 or _MIN_INDEX_BITS <= theirs.length_bits <= ours.index_bits
            if theirs.mode == "cubic":
                fits = fits and self._info.degree >= SPLINE_DEGREE and theirs.word_bits <= MAXIMUM_SPLINE_BITS
                fits = fits and 1 << theirs.length_bits <= MAXIMUM_SPLINE_LENGTH
            if not fits or (theirs.word_bits, theirs.dac_bits) != (ours.word_bits, ours.dac_bits):
                raise RequestRefused(Reason.SHAPE, axis)
        if not PROGRAM_BYTES <= info.image_bytes <= self._info.image_bytes:
            raise RequestRefused(Reason.LENGTH, self._info.image_bytes)

    def data(self, payload: bytes) -> bytes:
        """Return the answer to DATA.

        Raises
        ------
        RequestRefused
            If no upload was announced, or its program words cannot be played.
        """
        incoming = self.incoming
        if self.move is not None:
            raise RequestRefused(Reason.BUSY)
        if incoming is None:
            raise RequestRefused(Reason.UPLOAD)
        (offset,) = struct.unpack_from("<I", payload)
        before = len(incoming.data)
        if offset == before and before + len(payload) - 4 <= incoming.info.image_bytes:
            incoming.data += payload[4:]
            try:
                self._check_pages(incoming, before)
            except RequestRefused:
                self.incoming = None
                raise
        return struct.pack("<I", len(incoming.data))

    def _check_pages(self, incoming: IncomingUpload, before: int) -> None:
        """Check the program words of both images as soon as they are complete; ``before`` were received before."""
        info, data = incoming.info, incoming.data
        if before < PROGRAM_BYTES <= len(data):
            self._check_words(info.first, data)
        at = info.first.image_bytes
        if info.second is not None and self.second is not None and before < at + PROGRAM_BYTES <= len(data):
            try:
                self.second._check_words(info.second, data[at:])
            except RequestRefused as refused:
                raise refused.of_z() from None

    def _check_words(self, info: ImageInfo, data: bytes | bytearray) -> None:
        """Check the program words of an upload: shapes, harmonics, and the length of its image."""
        words = struct.unpack_from(f"<{PROGRAM_BYTES // 4}I", data)
        shapes = ((info.x, self._info.x), (info.y, self._info.y))
        for page, (shape, _) in enumerate(shapes, 1):
            harmonics = words[page * PAGE_WORDS + AXIS_WORDS.index("harmonics")]
            most = self._info.harmonics if shape.index_bits and not self._slow_part(words, page) else 0
            if harmonics > most:
                raise RequestRefused(Reason.HARMONICS, most)
        for page, (shape, ours) in enumerate(shapes, 1):
            period = words[page * PAGE_WORDS + AXIS_WORDS.index("phase_period")]
            if not shape.index_bits and period > 1 << ours.index_bits:
                raise RequestRefused(Reason.SHAPE, page - 1)
            if (slow := self._slow_part(words, page)) and not self._plays(slow, shape):
                raise RequestRefused(Reason.SHAPE, page - 1)
        if More.PIXEL_TABLES in self._info.more:
            has, pixels = words[PIXEL_TABLE_WORD], words[SCAN_WORDS.index("pixels")]
            if has and not (has == 1 and 1 <= pixels <= self._info.table_pixels):
                raise RequestRefused(Reason.SHAPE, 0)
        size = size_of(words, info.x, info.y, self._info.more)
        if size != info.image_bytes:
            raise RequestRefused(Reason.LENGTH, size)

    def _slow_part(self, words: Sequence[int], page: int) -> int:
        """Return the word that describes the slow part of an axis; 0 without one."""
        at = page * PAGE_WORDS + len(AXIS_WORDS) + SLOW_WORDS.index("slow_part")
        return words[at] if More.SLOW_PARTS in self._info.more else 0

    def _plays(self, slow: int, shape: AxisShape) -> bool:
        """Return True if the device plays a slow part of this size beside a table of this shape."""
        knots, index_bits = slow & ((1 << SLOW_INDEX_SHIFT) - 1), slow >> SLOW_INDEX_SHIFT
        return (
            _MIN_KNOTS <= knots <= self._info.slow_knots
            and _MIN_INDEX_BITS <= index_bits <= self._info.slow_index_bits
            and (shape.mode == "cubic" or (shape.mode == "interpolated" and shape.length_bits <= _MIXED_INDEX_BITS))
            and shape.word_bits <= MAXIMUM_SPLINE_BITS
        )

    def find(self, image_crc: int) -> ActiveUpload | IncomingUpload:
        """Find what a COMMIT means: the program that plays already, or a complete upload.

        Raises
        ------
        RequestRefused
            If no complete upload has this CRC, or one is being checked.
        """
        incoming, active = self.incoming, self.active
        if self.move is not None:
            raise RequestRefused(Reason.BUSY)
        if incoming is None:
            if active is None or active.moved is not None or active.info.image_crc != image_crc:
                raise RequestRefused(Reason.UPLOAD)
            return active
        if incoming.info.image_crc != image_crc:
            raise RequestRefused(Reason.UPLOAD)
        if incoming.state is not Upload.RECEIVING:
            raise RequestRefused(Reason.BUSY)
        if len(incoming.data) < incoming.info.image_bytes:
            raise RequestRefused(Reason.INCOMPLETE, len(incoming.data))
        return incoming

    def accept(
        self, incoming: IncomingUpload, authentic: Callable[[bytes], None]
    ) -> tuple[ScanProgram, ScanProgram | None]:
        """Check an upload, and return its program, and that of z where it has one.

        Parameters
        ----------
        authentic
            Function that raises if the tag is not the image's.

        Raises
        ------
        RequestRefused
            If the image is damaged or cannot be played within the limits.
        """
        image = bytes(incoming.data)
        if incoming is not self.move:  # of which nothing was received, and whose tag has been checked
            if zlib.crc32(image) != incoming.info.image_crc:
                raise RequestRefused(Reason.IMAGE)
            authentic(image)
        whole = ProgramImage(incoming.info, image)
        first, second = whole.first, whole.second
        program = self._judge(first)
        if second is None or self.second is None:
            return program, None
        if first.data[:_SCHEDULE_BYTES] != second.data[:_SCHEDULE_BYTES]:
            raise RequestRefused(Reason.SCHEDULE, OF_Z)
        try:
            return program, self.second._judge(second)
        except RequestRefused as refused:
            raise refused.of_z() from None

    def _judge(self, image: ProgramImage) -> ScanProgram:
        """Check the content of an image, and return its program."""
        contents = take_apart(image.data, image.info.x, image.info.y, self._info.more)
        old = self._player.playing
        playing = None if old is None else Playing(old.x, old.y, self._player.state is DeviceState.PLAYING)
        if objection := first_objection(contents, *self.limits, playing, self._info.shaping):
            raise RequestRefused(*objection)
        return program_of(contents, self._info.update_rate_hz)

    def take(self, incoming: IncomingUpload) -> None:
        """Make an upload, or a move, the current one, once the sequencer has taken its program."""
        is_moved = incoming is self.move
        uploaded = self.active.uploaded if is_moved and self.active is not None else None
        generation, line = self._player.swaps, self._player.swapped_at
        self.active = ActiveUpload(incoming.info, bytes(incoming.data), generation, line, uploaded)
        if is_moved:
            self.move = None
            return
        self.incoming = None
        self._stage_is_whole = True

    def begin_move(self, payload: bytes, permits: bool) -> IncomingUpload:
        """Return the image that plays with the words of a MOVE, as something that is checked.

        Raises
        ------
        RequestRefused
            If another program is checked, waits or plays, or none that could be moved.
        """
        active, (generation,) = self.active, struct.unpack_from("<I", payload)
        self.check_idle()
        if active is None:
            raise RequestRefused(Reason.READBACK)
        if generation != self._player.swaps:
            raise RequestRefused(Reason.GENERATION, self._player.swaps)
        playing = struct.unpack_from(f"<{PROGRAM_BYTES // 4}I", active.image)
        has_factors = plain_move_bytes(len(payload)) > Move.LAYOUT.size
        for axis in range(2):
            slow_part = playing[PAGE_WORDS * (axis + 1) + len(AXIS_WORDS) + SLOW_WORDS.index("slow_part")]
            if (slow_part != 0) != has_factors:
                raise RequestRefused(Reason.SLOW_PART, axis)
        data = bytearray(active.image)
        if has_factors:
            self._scale_gains(data, active, Move.FACTORS.unpack_from(payload, Move.LAYOUT.size))
        if not permits:
            raise RequestRefused(Reason.INTERLOCK)
        for axis in range(2):
            at = 4 * (PAGE_WORDS * (axis + 1) + AXIS_WORDS.index("gain"))
            words = payload[4 + _MOVED_BYTES * axis :]
            data[at : at + _MOVED_BYTES] = words[:_MOVED_BYTES]
        self.move = IncomingUpload(replace(active.info, hash=bytes(HASH_BYTES)), b"", data, Upload.CHECKING)
        return self.move

    def _scale_gains(self, data: bytearray, active: ActiveUpload, factors: tuple[int, ...]) -> None:
        """Put the gains that were uploaded, times the factor of each axis, into an image.

        Raises
        ------
        RequestRefused
            If one has more than its 18 bits.
        """
        info, at, (low, high) = active.info, PROGRAM_BYTES, signed_limits(GAIN_BITS)
        contents = take_apart(active.uploaded, info.x, info.y, self._info.more)
        for axis, factor in enumerate(factors):
            word = 0
            for part in parts_of(contents.words, axis + 1, contents.shape(axis + 1), self._info.more):
                slow = contents.slow(axis + 1)
                if part.name == "gain" and slow is not None:
                    gains = Knots(slow.gains, 1).times(factor).words
                    for knot, gain in enumerate(gains.tolist()):
                        if not low <= gain <= high:
                            raise RequestRefused(Reason.WORD, axis + 2 * (word + knot))
                    data[at : at + part.length * part.size] = pack_words(gains, part.size)
                word += part.length
                at += part.length * part.size

    def at_work(self) -> IncomingUpload | None:
        """Return the upload or the move that is checked or waits."""
        if self.move is not None:
            return self.move
        incoming = self.incoming
        return None if incoming is None or incoming.state is Upload.RECEIVING else incoming

    def _is_at_work(self) -> bool:
        return self.at_work() is not None

    def load(self, image: ProgramImage) -> ScanProgram:
        """Check a kept image at a start, make it the current one, and return its program.

        Raises
        ------
        RequestRefused
            If it is none that this device plays.
        """
        info = image.info
        self._check_announcement(info)
        self._check_words(info, image.data)
        contents = take_apart(image.data, info.x, info.y, self._info.more)
        if objection := first_objection(contents, *self.limits, None, self._info.shaping):
            raise RequestRefused(*objection)
        self.active = ActiveUpload(info, image.data, 1, 0)
        return program_of(contents, self._info.update_rate_hz)

    def put(self, image: ProgramImage) -> IncomingUpload | None:
        """Make an image of the device the upload that is checked; None if it does not suit it, or not now."""
        if self.incoming is not None:
            return None
        try:
            self.check_idle()
            return self.replace(image)
        except RequestRefused:
            return None

    def check_idle(self) -> None:
        """Raise ``RequestRefused`` while a program is checked or waits."""
        second_waits = self.second is not None and not self.second._player.writable
        if self._is_at_work() or not self._player.writable or second_waits:
            raise RequestRefused(Reason.BUSY)

    def replace(self, image: ProgramImage) -> IncomingUpload:
        """Make an image of the device the upload that is checked, in place of one that is received.

        Raises
        ------
        RequestRefused
            If it does not suit the device.
        """
        self.incoming = None
        self._check_announcement(image.info)
        self._check_words(image.info, image.data)
        self.incoming = IncomingUpload(image.info, image.info.pack(), bytearray(image.data), Upload.CHECKING)
        return self.incoming

    def image(self) -> ProgramImage:
        """Return the image of the tables that play, with the announcement of what was uploaded.

        Raises
        ------
        RequestRefused
            If the image is not held.
        """
        if self.active is None:
            raise RequestRefused(Reason.READBACK)
        data = self._of_tables(self.active)
        return ProgramImage(replace(self.active.info, image_bytes=len(data), image_crc=zlib.crc32(data)), data)

    def readback(self, offset: int, count: int) -> bytes:
        """Return bytes of the image that plays.

        Raises
        ------
        RequestRefused
            If the image is not held.
        """
        active = self.active
        if active is None or (self._staged and not self._stage_is_whole):
            raise RequestRefused(Reason.READBACK)
        image = active.image if self._staged else self._of_tables(active)
        return image[offset : offset + count]

    def limit(self, payload: bytes) -> bytes:
        """Return the answer to LIMITS."""
        if payload:
            size = AxisLimits.LAYOUT.size
            x, y = (AxisLimits.unpack(payload[at : at + size]) for at in (0, size))
            self.limits = x.within(self._info.x_limits), y.within(self._info.y_limits)
        return b"".join(limits.pack() for limits in self.limits)

    def _of_tables(self, active: ActiveUpload) -> bytes:
        """Return the image of the tables that play."""
        whole = ProgramImage(active.info, active.image)
        first, second = whole.first, whole.second
        program = program_of(take_apart(first.data, first.info.x, first.info.y, self._info.more))
        return make_image(program, active.info.hash.hex()).data + (b"" if second is None else second.data)
