"""The image of a program: the bytes that an upload sends and a readback returns (docs/protocol.md)."""

import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from tablegen.device.dual_program import AxisProgram, ScanProgram
from tablegen.device.registers import (
    AXIS_WORDS,
    OFFSET_LOW_BITS,
    PAGE_WORDS,
    PIXEL_TABLE_WORD,
    SCAN_WORDS,
    SLOW_INDEX_SHIFT,
    SLOW_WORDS,
    program_words,
)
from tablegen.fixedpoint.frame_program import FrameProgram, Knots, SlowTable
from tablegen.fixedpoint.interpolation import guard_bits
from tablegen.fixedpoint.output import UNIT_GAIN_BITS, Output
from tablegen.fixedpoint.phase import RationalPhase
from tablegen.fixedpoint.program import Program
from tablegen.fixedpoint.shaping import OFF, Shaping
from tablegen.fixedpoint.synthesis import FourierWords, synthesize
from tablegen.link.messages import CUBIC, FURTHER_PARTS, AxisShape, ImageInfo, More, ZImageInfo
from tablegen.numerics.arrays import Ints

PROGRAM_WORDS = 3 * PAGE_WORDS
PROGRAM_BYTES = 4 * PROGRAM_WORDS
FOURIER_BYTES = 4  # bytes per Fourier word
SECOND_BYTES, GAIN_BYTES, RATIO_BYTES = (
    1,
    3,
    2,
)  # bytes per word of a slow part; the slow table's are as wide as a table's
PIXEL_BYTES = 2  # bytes per number of ticks of a table of pixels
_PIXELS = SCAN_WORDS.index("pixels")
_NAMES = (*AXIS_WORDS, *SLOW_WORDS)
_KNOTS = 127  # mask of slow_part


@dataclass(frozen=True, slots=True)
class ProgramImage:
    """An image for an upload, and its announcement by BEGIN."""

    info: ImageInfo
    data: bytes

    @property
    def first(self) -> "ProgramImage":
        """The image of x and y."""
        info = self.info.first
        return ProgramImage(info, self.data[: info.image_bytes])

    @property
    def second(self) -> "ProgramImage | None":
        """The image of z; None without z."""
        info = self.info.second
        return None if info is None else ProgramImage(info, self.data[self.info.first.image_bytes :])


class ImagePart(NamedTuple):
    """A part of the words behind the program words of an image: what they are, how many, and the bytes of one."""

    name: str
    length: int
    size: int


def make_image(
    program: ScanProgram, digest: str, x_fourier: Ints | None = None, y_fourier: Ints | None = None
) -> ProgramImage:
    """Make the image of a program.

    Parameters
    ----------
    digest
        SHA-256 of the plan, 64 hexadecimal digits.
    x_fourier, y_fourier
        Fourier words that replace the table, Q2.30 of shape (2 H + 1,) in the order of devices.

    Returns
    -------
    ProgramImage
        What an upload sends.

    Raises
    ------
    ValueError
        If the gains and the ratios of a slow part are at different lines.
    """
    harmonics = [0 if words is None else len(words) // 2 for words in (x_fourier, y_fourier)]
    words = program_words(program.schedule, program.x, program.y, (harmonics[0], harmonics[1]))
    data = np.array(words, dtype="<u4").tobytes()
    for axis, fourier in ((program.x, x_fourier), (program.y, y_fourier)):
        if fourier is not None:
            data += pack_words(fourier, FOURIER_BYTES)
            continue
        size = shape_of(axis).word_bytes
        data += pack_words(fast_of(axis).words, size)
        if isinstance(axis, FrameProgram):
            data += pack_words(axis.second, SECOND_BYTES) + pack_words(axis.slow.words, size)
            data += pack_words(axis.gains.words, GAIN_BYTES) + pack_words(axis.ratios.words, RATIO_BYTES)
    for counts in program.schedule.pixel_table or ():
        data += np.array(counts, dtype="<u2").tobytes()
    shapes = shape_of(program.x), shape_of(program.y)
    info = ImageInfo(bytes.fromhex(digest), len(data), zlib.crc32(data), *shapes)
    return ProgramImage(info, data)


def join(first: ProgramImage, second: ProgramImage) -> ProgramImage:
    """Return the image of an upload of x and y, and z.

    Parameters
    ----------
    second
        Image of the program of the second sequencer, whose x is z.
    """
    data, info = first.data + second.data, second.info
    of_z = ZImageInfo(len(second.data), info.x, info.y)
    return ProgramImage(replace(first.info, image_bytes=len(data), image_crc=zlib.crc32(data), z=of_z), data)


def fast_of(axis: AxisProgram) -> Program:
    """Return the program of an axis over a line: the fast part where it has a slow one."""
    return axis.fast if isinstance(axis, FrameProgram) else axis


def shape_of(axis: AxisProgram) -> AxisShape:
    """Return the shape of the table of an axis."""
    axis = fast_of(axis)
    index_bits = axis.index_bits + (CUBIC if axis.mode == "cubic" else 0)
    return AxisShape(index_bits, axis.bits, axis.output.dac_bits)


def pack_words(words: Ints, size: int) -> bytes:
    """Return the low bytes of two's complement words, the lowest first."""
    return words.astype("<i8").view(np.uint8).reshape(-1, 8)[:, :size].tobytes()


def _words(data: bytes, size: int) -> Ints:
    """Return the signed words of bytes, ``size`` bytes each."""
    raw = np.frombuffer(data, dtype=np.uint8).reshape(-1, size)
    wide = np.where(raw[:, -1:] & 0x80, np.uint8(255), np.uint8(0)).repeat(8, axis=1)
    wide[:, :size] = raw
    return np.ascontiguousarray(wide).view("<i8")[:, 0].astype(np.int64)


@dataclass(frozen=True, eq=False)
class SlowWords:
    """The words of the slow part of an axis, signed: those of an image behind its table, in their order."""

    second: Ints
    table: Ints
    gains: Ints
    ratios: Ints


@dataclass(frozen=True, eq=False)
class Contents:
    """The parts of an image: the program words, unsigned, and the words of both axes, signed.

    ``pixel_ticks``: the ticks of each pixel of trace and retrace, shape (2, pixels); None without a table of pixels.
    """

    words: tuple[int, ...]
    x_shape: AxisShape
    y_shape: AxisShape
    x: Ints
    y: Ints
    x_slow: SlowWords | None = None
    y_slow: SlowWords | None = None
    pixel_ticks: Ints | None = None

    def scan(self, name: str) -> int:
        """Return a word of the page of the scan by its name in ``tablegen.device.registers.SCAN_WORDS``."""
        return self.words[SCAN_WORDS.index(name)]

    def axis(self, page: int, name: str) -> int:
        """Return a word of the page of x (1) or y (2) by its name in ``AXIS_WORDS`` or ``SLOW_WORDS``."""
        return self.words[page * PAGE_WORDS + _NAMES.index(name)]

    def slow(self, page: int) -> SlowWords | None:
        """Return the slow part of x (1) or y (2); None if it has none."""
        return self.x_slow if page == 1 else self.y_slow

    def table(self, page: int) -> Ints:
        """Return the words of the table of x (1) or y (2), or its Fourier words."""
        return self.x if page == 1 else self.y

    def shape(self, page: int) -> AxisShape:
        """Return the shape of the table of x (1) or y (2)."""
        return self.x_shape if page == 1 else self.y_shape

    def signed(self, page: int, name: str) -> int:
        """Return the word of ``axis`` as a signed number."""
        return _signed(self.axis(page, name))

    def offset_word(self, page: int) -> int:
        """Return the offset of an axis, from its two parts."""
        return (self.signed(page, "offset_high") << OFFSET_LOW_BITS) + self.axis(page, "offset_low")

    def shaping(self, page: int) -> Shaping:
        """Return the shaping of the output of x (1) or y (2).

        Raises
        ------
        ValueError
            If the word of shaping defines none.
        """
        return Shaping.of_word(self.axis(page, "shaping"))

    def output(self, page: int) -> Output:
        """Return the output stage of x (1) or y (2). Its converter is a plain one.

        It is not shaped where the word of shaping defines none. With a slow part, gain and offset are the slow table's.
        """
        shape = self.shape(page)
        try:
            shaping = self.shaping(page)
        except ValueError:
            shaping = OFF
        return Output(
            gain_word=self.signed(page, "gain"),
            gain_q=UNIT_GAIN_BITS + shape.word_bits + guard_bits(shape.word_bits) - shape.dac_bits,
            offset_word=self.offset_word(page),
            code_min=self.axis(page, "code_min"),
            code_max=self.axis(page, "code_max"),
            max_step=self.axis(page, "max_step"),
            park_code=self.axis(page, "park_code"),
            dac_bits=shape.dac_bits,
            coding="offset-binary",
            align="right",
            word_bits=shape.dac_bits,
            shaping=shaping,
        )

    def fast(self, page: int) -> Program:
        """Return the program of the table of x (1) or y (2), rendered from Fourier words if those were sent.

        Raises
        ------
        ValueError
            If it could not be played at all.
        """
        shape, words = self.shape(page), self.table(page)
        if self.axis(page, "harmonics"):
            half = len(words) // 2
            fourier = FourierWords(int(words[0]), words[1 : half + 1], words[half + 1 :])
            words = synthesize(fourier, 1 << shape.length_bits, shape.word_bits)
        hold = self.scan("line_ticks") if page == 2 and self.scan("y_steps") else 1
        phase = RationalPhase(self.axis(page, "phase_period"))
        return Program(phase, hold, shape.mode, shape.word_bits, words, self.output(page))

    def program(self, page: int) -> AxisProgram:
        """Return the program of x (1) or y (2); it is made once.

        Raises
        ------
        ValueError, OverflowError
            If it could not be played at all.
        """
        if page not in self._programs:
            self._programs[page] = self._program(page)
        return self._programs[page]

    @cached_property
    def _programs(self) -> dict[int, AxisProgram]:
        """The programs that were made, by page."""
        return {}

    def _program(self, page: int) -> AxisProgram:
        fast, slow, spacing = self.fast(page), self.slow(page), self.axis(page, "knot_spacing")
        if slow is None:
            return fast
        gains, ratios = Knots(slow.gains, spacing), Knots(slow.ratios, spacing)
        table = SlowTable(slow.table, fast.output.gain_word, fast.output.offset_word)
        return FrameProgram(fast, self.scan("frame_lines"), gains, ratios, slow.second, table)


def _signed(word: int) -> int:
    return word - (1 << 32) if word >> 31 else word


def parts_of(words: Sequence[int], page: int, shape: AxisShape, more: More = FURTHER_PARTS) -> list[ImagePart]:
    """Return the parts of the words of x (1) or y (2), in the order of an image.

    Parameters
    ----------
    words
        Program words.
    more
        Further features of the device: without slow parts it ignores their words.
    """
    word = dict(zip(_NAMES, words[page * PAGE_WORDS : (page + 1) * PAGE_WORDS], strict=True))
    if harmonics := word["harmonics"]:
        return [ImagePart("Fourier", 2 * harmonics + 1, FOURIER_BYTES)]
    length, size = 1 << shape.length_bits if shape.index_bits else word["phase_period"], shape.word_bytes
    table, slow = ImagePart("table", length, size), word["slow_part"]
    if not slow or More.SLOW_PARTS not in more:
        return [table]
    knots = slow & _KNOTS
    return [
        table,
        ImagePart("second table", length, SECOND_BYTES),
        ImagePart("slow table", 1 << (slow >> SLOW_INDEX_SHIFT & 31), size),
        ImagePart("gain", knots, GAIN_BYTES),
        ImagePart("ratio", knots, RATIO_BYTES),
    ]


def pixel_part(words: Sequence[int], more: More = FURTHER_PARTS) -> ImagePart:
    """Return the part behind the words of y, the table of pixels: of the trace, then of the retrace.

    Without such a table, or on a device that plays none, it has no words.
    """
    has = words[PIXEL_TABLE_WORD] and More.PIXEL_TABLES in more
    return ImagePart("pixel", 2 * words[_PIXELS] if has else 0, PIXEL_BYTES)


def size_of(words: Sequence[int], x: AxisShape, y: AxisShape, more: More = FURTHER_PARTS) -> int:
    """Return the bytes of an image with these program words; ``more`` as in ``parts_of``."""
    parts = [*parts_of(words, 1, x, more), *parts_of(words, 2, y, more), pixel_part(words, more)]
    return PROGRAM_BYTES + sum(part.length * part.size for part in parts)


def take_apart(data: bytes, x: AxisShape, y: AxisShape, more: More = FURTHER_PARTS) -> Contents:
    """Take apart an image of tables of these shapes; ``more`` as in ``parts_of``.

    Raises
    ------
    ValueError
        If its length is not what its program words say.
    """
    if len(data) < PROGRAM_BYTES:
        raise ValueError(f"an image of {len(data)} bytes; the program words alone have {PROGRAM_BYTES}")
    words = tuple(int(word) for word in np.frombuffer(data, dtype="<u4", count=PROGRAM_WORDS))
    size = size_of(words, x, y, more)
    if len(data) != size:
        raise ValueError(f"an image of {len(data)} bytes; it says {size} of itself")
    tables, slow = [], []
    at = PROGRAM_BYTES
    for page, shape in ((1, x), (2, y)):
        values = []
        for part in parts_of(words, page, shape, more):
            values.append(_words(data[at : at + part.length * part.size], part.size))
            at += part.length * part.size
        tables.append(values[0])
        slow.append(SlowWords(*values[1:]) if len(values) > 1 else None)
    pixels = None
    if pixel_part(words, more).length:
        pixels = np.frombuffer(data, dtype="<u2", offset=at).astype(np.int64).reshape(2, -1)
    return Contents(words, x, y, tables[0], tables[1], slow[0], slow[1], pixels)
