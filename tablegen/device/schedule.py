"""The schedule of both axes: which tick belongs to which line, pixel and direction. Integers only."""

from fractions import Fraction
from math import floor

import numpy as np
from msgspec import Struct

from tablegen.numerics.arrays import Floats, Ints

MAXIMUM_LINE_TICKS = 1 << 24
_EXACT = 1 << 53  # integers below it are exact as floats


class Window(Struct, frozen=True):
    """A stretch [first, first + count) of ticks of a line, or of lines of a frame; empty where nothing is imaged."""

    first: int
    count: int

    @property
    def stop(self) -> int:
        """The first tick (or line) after it."""
        return self.first + self.count

    def __contains__(self, k: int) -> bool:
        return self.first <= k < self.stop


class Schedule(Struct, frozen=True):
    """Ticks of a line, lines of a frame, and where they image.

    ``forward`` and ``backward`` are in ticks of the line, ``up`` and ``down`` in lines of the frame (y forward and
    backward). ``turn_tick`` is the first tick of the backward sweep, ``turn_line`` the first line that starts in it.
    ``pixel_table`` has the ticks of each pixel of both windows, in order of time; None for pixels of equal length.
    """

    ticks: int
    lines: int
    update_rate_hz: Fraction
    requested_hz: float
    pixels: int
    settle_lines: int
    turn_tick: int
    forward: Window
    backward: Window
    turn_line: int
    up: Window
    down: Window
    pixel_table: tuple[tuple[int, ...], tuple[int, ...]] | None = None

    def __post_init__(self) -> None:
        if self.pixel_table is None:
            return
        for window, counts in zip((self.forward, self.backward), self.pixel_table, strict=True):
            if len(counts) != self.pixels or sum(counts) != window.count or not all(0 < n < 1 << 16 for n in counts):
                raise ValueError(
                    f"{len(counts)} pixels of {sum(counts)} ticks in all do not fit {self.pixels} pixels, "
                    f"each of 1 to 65535 ticks, in a window of {window.count}"
                )

    @property
    def update_rate_millihz(self) -> int:
        """The ticks in a thousand seconds, to the nearest, ties up: the update rate as an integer."""
        return floor(self.update_rate_hz * 1000 + Fraction(1, 2))

    @property
    def frame_ticks(self) -> int:
        """Ticks of a frame."""
        return self.ticks * self.lines

    @property
    def line_rate(self) -> Fraction:
        """Lines per second, exactly."""
        return self.update_rate_hz / self.ticks

    @property
    def frame_rate(self) -> Fraction:
        """Frames per second, exactly."""
        return self.line_rate / self.lines

    def seconds(self, ticks: Ints) -> Floats:
        """Return the times of ticks: the nearest float to the exact quotient.

        Parameters
        ----------
        ticks
            Ticks, counted from 0, shape (n,).

        Returns
        -------
        Floats
            Times in s from tick 0, shape (n,).
        """
        rate = self.update_rate_hz
        if rate.numerator < _EXACT and int(np.max(ticks, initial=0)) * rate.denominator < _EXACT:
            return ticks * rate.denominator / rate.numerator
        return np.array([k * rate.denominator / rate.numerator for k in ticks.tolist()], dtype=np.float64)

    @property
    def pixel_ticks(self) -> Fraction:
        """The ticks per pixel of the forward sweep; pixel p starts at the tick ceil(p pixel_ticks) of the window."""
        return Fraction(self.forward.count, self.pixels)

    @property
    def pixel_starts(self) -> tuple[Ints, Ints]:
        """The ticks at which the pixels of the forward and of the backward window start, ascending."""
        if self.pixel_table is None:
            return pixel_starts(self.forward, self.pixels), pixel_starts(self.backward, self.pixels)
        forward, backward = (np.cumsum([0, *counts[:-1]]) for counts in self.pixel_table)
        return self.forward.first + forward, self.backward.first + backward

    @property
    def pixel_edges(self) -> tuple[Ints, Ints]:
        """The ticks between which the pixels of both windows lie, ascending, shape (pixels + 1,) each."""
        forward, backward = self.pixel_starts
        return np.append(forward, self.forward.stop), np.append(backward, self.backward.stop)


def has_ticks_for_pixels(pixels: int, forward_count: int, backward_count: int) -> bool:
    """Return True if each window that has ticks has at least one for each pixel.

    All devices refuse a program of which this is not true: a pixel would have no tick, and accumulators overflow.
    """
    return all(not count or pixels <= count for count in (forward_count, backward_count))


def pixel_starts(window: Window, pixels: int) -> Ints:
    """Return the ticks at which pixels start: tick i of the window where floor(i pixels / count) rises.

    A device adds ``pixels`` to an accumulator and subtracts ``count`` when it can: no multiplier.

    Returns
    -------
    Ints
        Ticks, ascending, shape (pixels,) where the window has a tick for each.
    """
    i = np.arange(window.count, dtype=np.int64)
    pixel = i * pixels // max(window.count, 1)
    return window.first + i[np.diff(pixel, prepend=-1) > 0]
