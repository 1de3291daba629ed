"""The lines of a program as they are played undisturbed: codes of both axes and the markers of every tick."""

from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from tablegen.device.dual_program import ScanProgram
from tablegen.fixedpoint.frame_program import FrameProgram
from tablegen.fixedpoint.program import Program
from tablegen.numerics.arrays import Bools, Ints

Part = TypeVar("Part", np.int64, np.bool_)


@dataclass(frozen=True, eq=False)
class LineTicks:
    """One line, or several, as arrays of shape (ticks,): codes of both axes and the markers of every tick."""

    x: Ints
    y: Ints
    line: Bools
    frame: Bools
    pixel: Bools
    backward: Bools
    valid: Bools


class PlayedLines:
    """The lines of a program one after another, from its beginning on: remainders of shaped axes run on."""

    def __init__(self, program: ScanProgram) -> None:
        self._program = program
        self._remainders = program.x.output.begin(), program.y.output.begin()
        self._x_codes: Ints | None = None

    def unclamped(self, line: int, count: int = 1) -> tuple[Ints, Ints]:
        """Return codes of x and y on the next lines, before clamp and slew guard.

        Parameters
        ----------
        line
            Line of the frame that is the first of them.
        count
            Number of lines, all of one frame.

        Returns
        -------
        x, y
            Codes, each of shape (count * ticks of a line,).
        """
        x, y, ticks = self._program.x, self._program.y, self._program.schedule.ticks
        if isinstance(y, FrameProgram):
            y_codes = y.played(line, count, self._remainders[1])
        else:
            y_codes = y.unclamped(line * ticks, (line + count) * ticks, self._remainders[1])
        if isinstance(x, FrameProgram):
            return x.played(line, count, self._remainders[0]), y_codes
        if not x.output.shaping.order:
            return _repeated(self._x_line(x), count), y_codes
        lines = [x.unclamped(0, ticks, self._remainders[0]) for _ in range(count)]
        return np.concatenate(lines), y_codes

    def play(self, line: int, settled: bool = True) -> LineTicks:
        """Return the next line, which is ``line`` of a frame, as ``play_line`` does."""
        return self.ticks(line, self.unclamped(line), settled)

    def ticks(self, line: int, unclamped: tuple[Ints, Ints], settled: bool = True) -> LineTicks:
        """Return lines as they leave the device.

        Parameters
        ----------
        line
            Line of the frame that is the first of them.
        unclamped
            Their codes of x and y before the clamp, each of shape (count * ticks of a line,).
        settled
            False while the scan settles, when no tick is valid.

        Returns
        -------
        LineTicks
            Codes and markers, each of the shape of the codes.
        """
        schedule = self._program.schedule
        count = len(unclamped[0]) // schedule.ticks
        first, pixel, backward, inside = (_repeated(marker, count) for marker in self._markers)
        images = [settled and (at in schedule.up or at in schedule.down) for at in range(line, line + count)]
        frame = np.zeros(len(first), dtype=np.bool_)
        frame[0] = line == 0
        return LineTicks(
            x=self._program.x.output.clamp(unclamped[0]),
            y=self._program.y.output.clamp(unclamped[1]),
            line=first,
            frame=frame,
            pixel=pixel,
            backward=backward,
            valid=inside & np.repeat(images, schedule.ticks),
        )

    def _x_line(self, x: Program) -> Ints:
        """Return the codes of x on every line, where it is neither shaped nor has a slow part."""
        if self._x_codes is None:
            self._x_codes = x.unclamped(0, self._program.schedule.ticks, self._remainders[0])
        return self._x_codes

    @cached_property
    def _markers(self) -> tuple[Bools, Bools, Bools, Bools]:
        """The markers of every line: its beginning, pixels, backward sweep, and imaging windows."""
        schedule = self._program.schedule
        k = np.arange(schedule.ticks, dtype=np.int64)
        pixel = np.zeros(schedule.ticks, dtype=np.bool_)
        inside = np.zeros(schedule.ticks, dtype=np.bool_)
        for window, starts in zip((schedule.forward, schedule.backward), schedule.pixel_starts, strict=True):
            if window.count:
                pixel[starts] = True
                inside[window.first : window.stop] = True
        return k == 0, pixel, k >= schedule.turn_tick, inside


def play_line(program: ScanProgram, line: int, settled: bool = True) -> LineTicks:
    """Return line ``line`` of a frame in steady state: the slew guard untouched, ``valid`` as after settling.

    Raises
    ------
    ValueError
        If an axis is shaped: its codes depend on the lines before, and ``PlayedLines`` plays them.
    """
    for axis in (program.x, program.y):
        (axis if isinstance(axis, Program) else axis.fast).require_period()
    return PlayedLines(program).play(line, settled)


def _repeated(line: NDArray[Part], count: int) -> NDArray[Part]:
    """Return the values of a line ``count`` times; of one line no copy, since lines may be long."""
    return line if count == 1 else np.tile(line, count)
