"""The integer model of ``adc_pixels.v``, which sums the samples of an ADC over each pixel, and a reader of its words.

It is the specification, with docs/pixels.md: the module equals it on every clock. ``PixelStream`` has the FIFO and its
losses, ``PixelSums`` before it what a pixel is and what belongs to it.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tablegen.numerics.arrays import Floats

MAX_LOST = 0xFFFF  # the counter of lost words saturates


class PixelInputs(NamedTuple):
    """The inputs of a clock: pulses of one clock (``reset`` to ``frame``), levels, and the ready signal of the sink.

    ``samples`` has the new sample of each channel, or is None on a clock without.
    """

    samples: tuple[int, ...] | None = None
    reset: bool = False
    pixel: bool = False
    line: bool = False
    frame: bool = False
    backward: bool = False
    valid: bool = True
    playing: bool = True
    fault: bool = False
    ready: bool = True


@dataclass(frozen=True)
class PixelWord:
    """The sums over a pixel and what is known of it: a beat of the stream.

    Attributes
    ----------
    sums
        The sum of the first ``count`` samples of each channel.
    line, column
        Numbers within the frame and within the sweep, from 0, modulo 2^16.
    valid
        True if the scan was valid throughout the pixel, the pixel is complete, and it has a sample.
    first
        True for the first pixel of a frame.
    lost
        True if words were lost between the word before and this one.
    overfull
        True if the pixel had more samples than are counted.
    last
        True for the last pixel of its sweep.
    """

    sums: tuple[int, ...]
    count: int
    line: int
    column: int
    valid: bool
    backward: bool
    first: bool = False
    lost: bool = False
    overfull: bool = False
    last: bool = False

    @property
    def flags(self) -> int:
        """The flags as in the last 16 bits of a word."""
        flags = (self.valid, self.backward, self.first, self.lost, self.overfull, self.last)
        return sum(flag << bit for bit, flag in enumerate(flags))

    @property
    def data(self) -> int:
        """The word as an integer, its first byte in the lowest bits."""
        values = [*((total & 0xFFFFFFFF, 32) for total in self.sums)]
        values += [(value, 16) for value in (self.count, self.line, self.column, self.flags)]
        data, shift = 0, 0
        for value, bits in values:
            data |= value << shift
            shift += bits
        return data


@dataclass
class _Pixel:
    sums: list[int]
    line: int
    column: int
    backward: bool
    first: bool
    complete: bool
    count: int = 0
    overfull: bool = False


@dataclass
class PixelSums:
    """The pixels of the samples and markers of each clock, in front of the FIFO."""

    channels: int = 1
    count_bits: int = 16
    _pixel: _Pixel | None = None
    _line: int = 0
    _next_column: int = 0
    _was_backward: bool = False
    _line_is_0: bool = True  # the next line is the first of its frame
    _frame_waits: bool = False  # the next pixel is the first of its frame

    def step(self, inputs: PixelInputs) -> PixelWord | None:
        """Take the inputs of a clock; return the word of the pixel that ends on it, if one does.

        What begins on a clock takes the sample of this clock, what ends on it does not. A reset ends a pixel without a
        word.
        """
        sweep_ends = inputs.line or inputs.frame or inputs.backward != self._was_backward or not inputs.playing
        begins = inputs.pixel and inputs.playing
        sound = inputs.valid and not inputs.fault
        word = self._end(inputs, sweep_ends, begins)
        self._was_backward = inputs.backward
        if inputs.reset:
            self._pixel, self._line, self._next_column = None, 0, 0
            self._line_is_0, self._frame_waits = True, False
            return None
        self._number(inputs, sweep_ends)
        if begins:
            first = inputs.frame or self._frame_waits
            self._pixel = _Pixel([0] * self.channels, self._line, self._next_column, inputs.backward, first, sound)
            self._next_column = (self._next_column + 1) % 2**16
        self._line_is_0 = (inputs.frame or self._line_is_0) and not (inputs.line or begins)
        self._frame_waits = (inputs.frame or self._frame_waits) and not begins
        if self._pixel is not None:
            self._pixel.complete = self._pixel.complete and sound
            self._add(self._pixel, inputs.samples)
        return word

    def _number(self, inputs: PixelInputs, sweep_ends: bool) -> None:
        if inputs.frame:
            self._line = 0
        elif inputs.line and not self._line_is_0:
            self._line = (self._line + 1) % 2**16
        if sweep_ends:
            self._next_column = 0

    def _end(self, inputs: PixelInputs, sweep_ends: bool, begins: bool) -> PixelWord | None:
        """End the pixel that is open: at the next one, and at the end of its sweep or of the imaging window."""
        pixel = self._pixel
        if pixel is None:
            return None
        window_ends = pixel.complete and not inputs.valid and not inputs.fault
        if not (begins or sweep_ends or window_ends):
            return None
        self._pixel = None
        return PixelWord(
            sums=tuple(pixel.sums),
            count=pixel.count,
            line=pixel.line,
            column=pixel.column,
            valid=pixel.complete and inputs.playing and pixel.count > 0,
            backward=pixel.backward,
            first=pixel.first,
            overfull=pixel.overfull,
            last=sweep_ends or not begins,
        )

    def _add(self, pixel: _Pixel, samples: Sequence[int] | None) -> None:
        if samples is None:
            return
        if pixel.count == 2**self.count_bits - 1:
            pixel.overfull = True
            return
        pixel.sums = [total + sample for total, sample in zip(pixel.sums, samples, strict=True)]
        pixel.count += 1


class PixelOutputs(NamedTuple):
    """The outputs after a clock; ``word`` is None where ``m_axis_tvalid`` is low."""

    word: PixelWord | None
    lost_words: int


@dataclass
class PixelStream:
    """``PixelSums`` with the FIFO of 2^depth_bits words and the word at its output."""

    channels: int = 1
    count_bits: int = 16
    depth_bits: int = 4
    _stored: deque[PixelWord] = field(default_factory=deque)
    _out: PixelWord | None = None
    _lost: bool = False
    _first_lost: bool = False
    _lost_words: int = 0

    def __post_init__(self) -> None:
        """Make the sums."""
        self._sums = PixelSums(self.channels, self.count_bits)

    def step(self, inputs: PixelInputs) -> PixelOutputs:
        """Take the inputs of a clock; return the outputs after it."""
        word = self._sums.step(inputs)
        if inputs.reset:
            self._stored.clear()
            self._out, self._lost, self._first_lost, self._lost_words = None, False, False, 0
            return PixelOutputs(None, 0)
        full = len(self._stored) == 2**self.depth_bits
        if self._out is None or inputs.ready:
            self._out = self._stored.popleft() if self._stored else None
        if word is not None:
            first = word.first or self._first_lost
            if full:
                self._lost_words = min(self._lost_words + 1, MAX_LOST)
            else:
                self._stored.append(replace(word, lost=self._lost, first=first))
            self._lost, self._first_lost = full, full and first
        return PixelOutputs(self._out, self._lost_words)


def pixel_dtype(channels: int = 1, signed: bool = True) -> np.dtype[np.void]:
    """Return the type of a word, as DMA writes it into the memory of a little-endian host."""
    shape = (channels,)
    half = [(name, "<u2") for name in ("count", "line", "column", "flags")]
    return np.dtype([("sums", "<i4" if signed else "<u4", shape), *half])


def pixel_picture(
    words: npt.NDArray[np.void], lines: range, columns: int, backward: bool = False, channel: int = 0
) -> Floats:
    """Return the mean sample of each pixel of a sweep direction; of two words for the same pixel, the later one's.

    Parameters
    ----------
    words
        Words of ``pixel_dtype``, shape (words,).
    lines
        The lines of the frame that the picture shows.
    columns
        Pixels of a sweep.

    Returns
    -------
    Means, shape (lines, columns), in the order of time; not a number where there was no valid pixel.
    """
    picture = np.full((len(lines), columns), np.nan)
    flags = words["flags"]
    mask = (flags & 1 == 1) & (flags >> 1 & 1 == int(backward)) & (words["column"] < columns)
    mask &= (words["line"] >= lines.start) & (words["line"] < lines.stop)
    subset = words[mask]
    picture[subset["line"].astype(int) - lines.start, subset["column"]] = subset["sums"][:, channel] / subset["count"]
    return picture
