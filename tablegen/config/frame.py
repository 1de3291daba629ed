"""The frame in the user's terms, and its line periods and the turn and window of y. Exact fractions, no floats.

An image of N lines takes more line periods than N: y has to turn round outside its window, and to fly back. With U
line periods on the way up, of which a lie before the window and a behind it, the turn is U / lines and the window
a / U .. 1 - a / U.
"""

from collections.abc import Callable
from fractions import Fraction
from math import ceil, floor
from typing import Literal

from msgspec import Struct

from tablegen.base.input_errors import Unphysical

# Of y at rest: so near to the end of the frame that no line comes after it.
RESTING_TURN = 0.999999999999
FrameMode = Literal["flyback", "up-down"]
MOST_LINES = 65536
_MARGIN = 18  # image lines for each line of turnaround on one side: about 0.05 of the way up
_FLYBACK = 19  # lines up for each line of flyback: about 0.05 of the frame
_PARTS = 10**9  # windows are given to so many parts, turns to a thousand times as many


class ImageFrame(Struct, frozen=True):
    """Line periods of a frame, the turn of y, its window, and the line periods at which it images."""

    lines: int
    turn: float
    window: tuple[float, float]
    both: bool

    @property
    def up(self) -> tuple[int, int]:
        """The first line of the image on the way up, and the number of lines."""
        return lines_inside(self.turn, self.window, self.both, self.lines)[0]

    @property
    def down(self) -> tuple[int, int]:
        """The first line of the image on the way down, and the number of lines; 0 where it does not image."""
        return lines_inside(self.turn, self.window, self.both, self.lines)[1]


def exact(value: float) -> Fraction:
    """Return the decimal fraction that a float of a configuration was written as."""
    return Fraction(repr(value))


def lines_inside(
    turn: float, window: tuple[float, float], both: bool, lines: int
) -> tuple[tuple[int, int], tuple[int, int]]:
    """Return first and count of the lines inside the window of y, on the way up and on the way back.

    A line lasts from its number to the next. Without ``both`` none images on the way back.
    """
    low, high = (exact(edge) for edge in window)
    share = exact(turn)

    def between(begin: Fraction, end: Fraction) -> tuple[int, int]:
        first = ceil(begin * lines)
        return first, max(floor(end * lines) - first, 0)

    up = between(share * low, share * high)
    if turn == RESTING_TURN:
        return (0, lines), (0, 0)
    if not both:
        return up, (0, 0)
    return up, between(share + (1 - share) * (1 - high), share + (1 - share) * (1 - low))


def frame_of_image(mode: FrameMode, image_lines: int, window: tuple[float, float] | None) -> ImageFrame:
    """Return the shortest frame whose window holds that many lines, on the way up, and down where that images.

    Raises
    ------
    Unphysical
        If no frame does.
    """
    if window is not None:
        if mode == "up-down":
            return lines_of_image(image_lines, 0.5, window, both=True)
        return _shortest_frame(
            image_lines, Fraction(_FLYBACK, _FLYBACK + 1), window, lambda count: _flyback_frames(count, window), up=True
        )
    margin = max(1, round(Fraction(image_lines, _MARGIN)))
    up = image_lines + 2 * margin
    lines = 2 * up if mode == "up-down" else up + _flyback(up)
    if lines > MOST_LINES:
        most = floor(Fraction(image_lines * MOST_LINES, lines)) - 3
        raise Unphysical(
            f"{image_lines} image lines take {lines} line periods a frame, above {MOST_LINES}; at most {most} fit"
        )
    turn = _turn(mode, up, lines)
    return ImageFrame(lines, turn, _margins(margin, up, lines, turn), mode == "up-down")


def frame_of_lines(mode: FrameMode, lines: int, window: tuple[float, float] | None) -> ImageFrame:
    """Return the frame of that many line periods.

    Raises
    ------
    Unphysical
        If no line of it images.
    """
    frame = _split(mode, lines, window)
    if frame.up[1] < 1 or (frame.both and frame.down[1] < 1):
        raise Unphysical(f"{lines} line periods hold no image line with frame = '{mode}'; take more, or image_lines")
    return frame


def lines_of_image(image_lines: int, turn: float, window: tuple[float, float], both: bool) -> ImageFrame:
    """Return the shortest frame with that many lines in the window on the way up, and down if both ways are as long.

    Raises
    ------
    Unphysical
        If there is none.
    """
    return _shortest_frame(image_lines, exact(turn), window, lambda lines: [ImageFrame(lines, turn, window, both)])


def _shortest_frame(
    image_lines: int,
    way: Fraction,
    window: tuple[float, float],
    make: Callable[[int], list[ImageFrame]],
    up: bool = False,
) -> ImageFrame:
    """Return the first frame that holds the image, by its lines or by those ``up``; ``way`` is the share going up."""
    low, high = window
    share = (exact(high) - exact(low)) * way
    near = image_lines / share
    if near > MOST_LINES:
        raise Unphysical(
            f"{image_lines} image lines in the window [{low:g}, {high:g}] of y take about {float(near):.7g} line "
            f"periods a frame, above {MOST_LINES}; at most {floor(MOST_LINES * share)} fit, or widen the window"
        )
    first = floor(near * way) if up else floor(near)
    for count in range(max(first - 2, 1), first + ceil(3 / share) + 5):
        for frame in make(count):
            same = not frame.both or frame.turn != 0.5 or frame.down[1] == image_lines
            if frame.up[1] == image_lines and same and frame.lines <= MOST_LINES:
                return frame
    raise Unphysical(
        f"no frame has {image_lines} lines in the window [{low:g}, {high:g}] of y; take another number, or "
        "another window"
    )


def _split(mode: FrameMode, lines: int, window: tuple[float, float] | None) -> ImageFrame:
    if mode == "up-down":
        return ImageFrame(lines, 0.5, window or (0.05, 0.95), True)
    up = max(lines - max(1, round(Fraction(lines, _FLYBACK + 1))), 1)
    margin = max(1, round(Fraction(up, _MARGIN + 2)))
    turn = _turn(mode, up, lines)
    return ImageFrame(lines, turn, window or _margins(margin, up, lines, turn), False)


def _flyback_frames(up: int, window: tuple[float, float]) -> list[ImageFrame]:
    """Return frames of that many lines up, with two flybacks: a turn of another last digit may hold another line."""
    lines = [up + _flyback(up) + more for more in (0, 1)]
    return [ImageFrame(count, _turn("flyback", up, count), window, False) for count in lines]


def _flyback(up: int) -> int:
    return max(1, round(Fraction(up, _FLYBACK)))


def _turn(mode: FrameMode, up: int, lines: int) -> float:
    """Return the turn, rounded down, so that the first line that flies back is number ``up``, not the one after it."""
    digits = 1000 * _PARTS
    return 0.5 if mode == "up-down" else floor(Fraction(up * digits, lines)) / digits


def _margins(margin: int, up: int, lines: int, turn: float) -> tuple[float, float]:
    """Return a window rounded outwards by more than the turn is, so that it holds every line between the margins."""
    low = floor(Fraction(margin * _PARTS, up))
    if exact(turn) * lines != up and low * up == margin * _PARTS:
        low -= 1
    return low / _PARTS, (_PARTS - low) / _PARTS
