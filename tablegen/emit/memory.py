"""The tables of a build as memories: words of so many bits, and how files spell them."""

from collections.abc import Iterable, Mapping
from typing import Literal

import numpy as np
from msgspec import Struct

from tablegen.device.registers import program_words
from tablegen.device.schedule import Schedule
from tablegen.emit.content import Content
from tablegen.fixedpoint.program import Program
from tablegen.fixedpoint.synthesis import WORD_BITS, sine_quarter
from tablegen.numerics.arrays import Ints

PIXEL_BITS = 16  # of the ticks of a pixel


class Memory(Struct, frozen=True, eq=False):
    """The words of one memory of a device.

    ``name`` is x, y, x_fourier, y_fourier, program, sine or pixels; of a scan at an angle x, y, slow or program.
    ``words`` are integers of ``bits`` bits, in two's complement but for the program's registers and the ticks of
    pixels, which are unsigned.
    """

    name: str
    words: list[int]
    bits: int
    what: str

    @property
    def word_bytes(self) -> int:
        """The bytes of a word in files of bytes: 1, 2 or 4, the least that hold it."""
        return 1 if self.bits <= 8 else 2 if self.bits <= 16 else 4

    def hexadecimal(self) -> list[str]:
        """Return each word in two's complement of ``bits`` bits, in as many digits as these take."""
        return memory_file(self.words, self.bits).decode("ascii").split()

    def raw(self) -> bytes:
        """Return each word in ``word_bytes`` bytes, sign-extended, the least significant byte first."""
        mask = (1 << 8 * self.word_bytes) - 1
        return np.array([word & mask for word in self.words], dtype=f"<u{self.word_bytes}").tobytes()

    def described(self, content: Content) -> str:
        """Return a line for a comment: which words of which build these are."""
        return f"{content.name}, {self.what}: {len(self.words)} words of {self.bits} bits; plan {content.hash}"


def memories(content: Content) -> list[Memory]:
    """Return all tables of a build: the content of its ``.mem`` files, in the same order."""
    fourier = {axis.axis: axis.fourier_words for axis in content.axes}
    return _memories(content.schedule, content.x.program, content.y.program, fourier)


def memory_file(words: Ints | Iterable[int], bits: int) -> bytes:
    """Write words, each in as many hexadecimal digits as ``bits`` take.

    Parameters
    ----------
    words
        Integers of up to ``bits`` bits, negative ones in two's complement, shape (n,).
    bits
        Word length.

    Returns
    -------
    bytes
        A line a word.
    """
    digits, mask = -(-bits // 4), (1 << bits) - 1
    values = np.asarray(words if isinstance(words, np.ndarray | list) else list(words), dtype=np.int64)
    if len(values) and digits % 2 == 0:  # whole bytes, which are spelled all at once
        raw = (values & mask).astype(">u8").view(np.uint8).reshape(-1, 8)[:, 8 - digits // 2 :].tobytes()
        return raw.hex("\n", digits // 2).encode("ascii") + b"\n"
    return "".join(f"{int(word) & mask:0{digits}x}\n" for word in words).encode("ascii")


def memory_files(
    name: str, schedule: Schedule, x: Program, y: Program, fourier: Mapping[Literal["x", "y"], Ints]
) -> dict[str, bytes]:
    """Write all memory files of a build.

    The registers are those for uploaded tables: a host that uploads Fourier words instead writes HARMONICS over the
    last register of their axis, which is 0 here. The quarter sine is that of the longest interpolated table, and serves
    shorter ones too; where no table is interpolated there is none.

    Parameters
    ----------
    fourier
        Fourier words of "x" and "y" in order, Q2.30, each of shape (2 H + 1,).

    Returns
    -------
    dict of str to bytes
        Contents by file name.
    """
    memories = _memories(schedule, x, y, fourier)
    return {f"{name}_{memory.name}.mem": memory_file(memory.words, memory.bits) for memory in memories}


def _memories(schedule: Schedule, x: Program, y: Program, fourier: Mapping[Literal["x", "y"], Ints]) -> list[Memory]:
    memories = []
    programs: tuple[tuple[Literal["x", "y"], Program], ...] = (("x", x), ("y", y))
    for axis, program in programs:
        memories.append(Memory(axis, program.words.tolist(), program.bits, f"table of {axis}"))
        memories.append(Memory(f"{axis}_fourier", fourier[axis].tolist(), WORD_BITS, f"Fourier words of {axis}"))
    memories.append(Memory("program", program_words(schedule, x, y), WORD_BITS, "registers of the program"))
    if index_bits := max(x.index_bits, y.index_bits):
        memories.append(Memory("sine", sine_quarter(index_bits).tolist(), WORD_BITS, "quarter sine"))
    if schedule.pixel_table is not None:
        memories.append(Memory("pixels", pixel_words(schedule), PIXEL_BITS, "ticks of each pixel"))
    return memories


def pixel_words(schedule: Schedule) -> list[int]:
    """Return the ticks of each pixel, of the forward window and then of the backward one; none where they are equal."""
    return [ticks for window in schedule.pixel_table or () for ticks in window]
