"""Small programs for tests of the link: few harmonics, short tables and frames; as many different ones as seeds."""

from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.random import Generator

from tablegen.device.dual_program import DualProgram
from tablegen.device.schedule import Schedule, Window
from tablegen.fixedpoint.interpolation import guard_bits
from tablegen.fixedpoint.output import UNIT_GAIN_BITS, Output
from tablegen.fixedpoint.phase import RationalPhase
from tablegen.fixedpoint.program import Program
from tablegen.fixedpoint.synthesis import FourierWords, synthesize
from tablegen.link.messages import AxisLimits, AxisShape, DeviceInfo, Feature
from tablegen.link.program_image import ProgramImage, make_image

BITS = 16  # of words and codes
UPDATE_RATE_HZ = 20000
LIMITS = AxisLimits(1000, 64000, 30000, 60000)
INFO = DeviceInfo(
    version=1,
    features=Feature.TABLES | Feature.FOURIER | Feature.READBACK | Feature.NARROWS,
    window=8,
    data_bytes=240,
    harmonics=16,
    image_bytes=192 + 2 * 2 * 256,
    x=AxisShape(8, BITS, BITS, BITS),
    y=AxisShape(7, BITS, BITS, BITS),
    x_limits=LIMITS,
    y_limits=LIMITS,
    update_rate_hz=UPDATE_RATE_HZ,
)


@dataclass(frozen=True, eq=False)
class SmallScan:
    """A program with the Fourier words that its tables were rendered from."""

    program: DualProgram
    x: FourierWords
    y: FourierWords
    digest: str

    def image(self, fourier: bool) -> ProgramImage:
        """In one of the two forms."""
        if fourier:
            return make_image(self.program, self.digest, self.x.in_order, self.y.in_order)
        return make_image(self.program, self.digest)


def make_scan(seed: int, ticks: int = 96, lines: int = 6, index_bits: tuple[int, int] = (7, 6)) -> SmallScan:
    """A scan that no other seed makes, within ``LIMITS``; tables of 2^index_bits words of x and y."""
    rng = np.random.default_rng(seed)
    schedule = Schedule(
        ticks=ticks,
        lines=lines,
        update_rate_hz=Fraction(UPDATE_RATE_HZ),
        requested_hz=UPDATE_RATE_HZ / ticks,
        pixels=ticks // 4,
        settle_lines=seed % 3,
        turn_tick=ticks // 2,
        forward=Window(ticks // 10, ticks // 3),
        backward=Window(ticks // 2 + ticks // 10, ticks // 3),
        turn_line=lines // 2,
        up=Window(1, max(lines // 2 - 1, 0)),
        down=Window(lines // 2, max(lines // 2 - 1, 0)),
    )
    x_words, y_words = _words(rng), _words(rng)
    x = _axis(rng, x_words, ticks, 1, index_bits[0])
    stepped = seed % 2 == 1
    y = _axis(rng, y_words, lines if stepped else ticks * lines, ticks if stepped else 1, index_bits[1])
    return SmallScan(DualProgram(x, y, schedule), x_words, y_words, f"{seed:064x}")


def _words(rng: Generator) -> FourierWords:
    """A triangle of sorts, with something added."""
    half = 1 << 29
    a = rng.integers(-half // 40, half // 40, size=5)
    b = rng.integers(-half // 60, half // 60, size=5)
    a[0] = -half + int(rng.integers(0, half // 10))
    return FourierWords(int(rng.integers(-half // 8, half // 8)), a, b)


def _axis(rng: Generator, words: FourierWords, advances: int, hold: int, index_bits: int) -> Program:
    gain_q = UNIT_GAIN_BITS + BITS + guard_bits(BITS) - BITS
    output = Output(
        gain_word=int(rng.integers(20000, 60000)),
        gain_q=gain_q,
        offset_word=(int(rng.integers(31000, 34000)) << gain_q) + int(rng.integers(0, 1 << gain_q)),
        code_min=1500,
        code_max=63500,
        max_step=26000 if hold != 1 else 4000,  # a line's step at once
        park_code=int(rng.integers(20000, 40000)),
        dac_bits=BITS,
        coding="offset-binary",
        align="right",
        word_bits=BITS,
    )
    table = synthesize(words, 1 << index_bits, BITS)
    return Program(RationalPhase(advances), hold, "interpolated", BITS, table, output)
