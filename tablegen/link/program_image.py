"""The image of a program: the bytes that an upload sends and a readback returns (docs/protocol.md)."""

import zlib
from dataclasses import dataclass

import numpy as np

from tablegen.device.dual_program import DualProgram
from tablegen.device.registers import AXIS_WORDS, OFFSET_LOW_BITS, PAGE_WORDS, SCAN_WORDS, program_words
from tablegen.fixedpoint.interpolation import guard_bits
from tablegen.fixedpoint.output import UNIT_GAIN_BITS, Output
from tablegen.fixedpoint.phase import RationalPhase
from tablegen.fixedpoint.program import Program
from tablegen.fixedpoint.shaping import OFF, Shaping
from tablegen.fixedpoint.synthesis import FourierWords, synthesize
from tablegen.link.messages import CUBIC, AxisShape, ImageInfo
from tablegen.numerics.arrays import Ints

PROGRAM_WORDS = 3 * PAGE_WORDS
PROGRAM_BYTES = 4 * PROGRAM_WORDS
FOURIER_BYTES = 4  # bytes per Fourier word
_HARMONICS_WORD = AXIS_WORDS.index("harmonics")


@dataclass(frozen=True, slots=True)
class ProgramImage:
    """An image for an upload, and its announcement by BEGIN."""

    info: ImageInfo
    data: bytes


def make_image(
    program: DualProgram, digest: str, x_fourier: Ints | None = None, y_fourier: Ints | None = None
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
    """
    harmonics = [0 if words is None else len(words) // 2 for words in (x_fourier, y_fourier)]
    words = program_words(program.schedule, program.x, program.y, (harmonics[0], harmonics[1]))
    data = np.array(words, dtype="<u4").tobytes()
    for axis, fourier in ((program.x, x_fourier), (program.y, y_fourier)):
        data += _bytes(axis.words, shape_of(axis).word_bytes) if fourier is None else _bytes(fourier, FOURIER_BYTES)
    shapes = shape_of(program.x), shape_of(program.y)
    info = ImageInfo(bytes.fromhex(digest), len(data), zlib.crc32(data), *shapes)
    return ProgramImage(info, data)


def shape_of(axis: Program) -> AxisShape:
    """Return the shape of the table of an axis."""
    index_bits = axis.index_bits + (CUBIC if axis.mode == "cubic" else 0)
    return AxisShape(index_bits, axis.bits, axis.output.dac_bits)


def _bytes(words: Ints, size: int) -> bytes:
    """Return the low bytes of two's complement words, the lowest first."""
    return words.astype("<i8").view(np.uint8).reshape(-1, 8)[:, :size].tobytes()


def _words(data: bytes, size: int) -> Ints:
    """Return the signed words of bytes, ``size`` bytes each."""
    raw = np.frombuffer(data, dtype=np.uint8).reshape(-1, size)
    wide = np.where(raw[:, -1:] & 0x80, np.uint8(255), np.uint8(0)).repeat(8, axis=1)
    wide[:, :size] = raw
    return np.ascontiguousarray(wide).view("<i8")[:, 0].astype(np.int64)


@dataclass(frozen=True, eq=False)
class Contents:
    """The parts of an image: the program words, unsigned, and the words of both axes, signed."""

    words: tuple[int, ...]
    x_shape: AxisShape
    y_shape: AxisShape
    x: Ints
    y: Ints

    def scan(self, name: str) -> int:
        """Return a word of the page of the scan by its name in ``tablegen.device.registers.SCAN_WORDS``."""
        return self.words[SCAN_WORDS.index(name)]

    def axis(self, page: int, name: str) -> int:
        """Return a word of the page of x (1) or y (2) by its name in ``AXIS_WORDS``."""
        return self.words[page * PAGE_WORDS + AXIS_WORDS.index(name)]

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

    def program(self, page: int) -> Program:
        """Return the program of x (1) or y (2), with tables rendered from Fourier words. Its converter is a plain one.

        Its output is not shaped where the word of shaping defines none.

        Raises
        ------
        ValueError
            If it could not be played at all.
        """
        shape, words = (self.x_shape, self.x) if page == 1 else (self.y_shape, self.y)
        if self.axis(page, "harmonics"):
            half = len(words) // 2
            fourier = FourierWords(int(words[0]), words[1 : half + 1], words[half + 1 :])
            words = synthesize(fourier, 1 << shape.length_bits, shape.word_bits)
        try:
            shaping = self.shaping(page)
        except ValueError:
            shaping = OFF
        output = Output(
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
        hold = self.scan("line_ticks") if page == 2 and self.scan("y_steps") else 1
        phase = RationalPhase(self.axis(page, "phase_period"))
        return Program(phase, hold, shape.mode, shape.word_bits, words, output)


def _signed(word: int) -> int:
    return word - (1 << 32) if word >> 31 else word


def layout(words: tuple[int, ...], x: AxisShape, y: AxisShape) -> tuple[int, int]:
    """Return the bytes that follow the program words for x and for y."""
    sizes = []
    for page, shape in ((1, x), (2, y)):
        harmonics = words[page * PAGE_WORDS + _HARMONICS_WORD]
        period = words[page * PAGE_WORDS + AXIS_WORDS.index("phase_period")]
        length = 1 << shape.length_bits if shape.index_bits else period
        sizes.append(FOURIER_BYTES * (2 * harmonics + 1) if harmonics else shape.word_bytes * length)
    return sizes[0], sizes[1]


def take_apart(data: bytes, x: AxisShape, y: AxisShape) -> Contents:
    """Take apart an image of tables of these shapes.

    Raises
    ------
    ValueError
        If its length is not what its program words say.
    """
    if len(data) < PROGRAM_BYTES:
        raise ValueError(f"an image of {len(data)} bytes; the program words alone have {PROGRAM_BYTES}")
    words = tuple(int(word) for word in np.frombuffer(data, dtype="<u4", count=PROGRAM_WORDS))
    x_bytes, y_bytes = layout(words, x, y)
    if len(data) != PROGRAM_BYTES + x_bytes + y_bytes:
        raise ValueError(f"an image of {len(data)} bytes; it says {PROGRAM_BYTES + x_bytes + y_bytes} of itself")
    parts = []
    at = PROGRAM_BYTES
    for page, shape, size in ((1, x, x_bytes), (2, y, y_bytes)):
        harmonics = words[page * PAGE_WORDS + _HARMONICS_WORD]
        parts.append(_words(data[at : at + size], FOURIER_BYTES if harmonics else shape.word_bytes))
        at += size
    return Contents(words, x, y, *parts)
