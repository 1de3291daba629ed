"""What the virtual scanner would image: trace and retrace of a grating or a lattice, scanned with a triangle.

The slow axis is ideal: a ramp through the frame, which is as high as the line is long. Noise comes from the seed alone.
"""

from collections.abc import Callable

import numpy as np

from tablegen.numerics.arrays import Floats
from tablegen.virtual.line_error import ideal_triangle
from tablegen.virtual.scanner import VirtualAxis

_TICKS = 16384  # ticks per line
_STEEPNESS = 2.5  # steepness of the flanks of a bar, rounded as by a tip
_DUTY = 0.3

Surface = Callable[[Floats, Floats], Floats]  # height at x and y in nm


def grating(pitch_nm: float, angle_deg: float = 3.0) -> Surface:
    """Bars with round shoulders, wider than their gaps, whose normal is turned from x by an angle."""
    c, s = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))

    def height(x: Floats, y: Floats) -> Floats:
        wave = np.sin(2.0 * np.pi * (x * c + y * s) / pitch_nm)
        found: Floats = np.tanh(_STEEPNESS * (wave + _DUTY))
        return found

    return height


def hexagonal(constant_nm: float, angle_deg: float = 7.0) -> Surface:
    """A hexagonal lattice, its three waves of different heights as molecules without symmetry have them."""
    pitch = constant_nm * np.sqrt(3.0) / 2.0

    def height(x: Floats, y: Floats) -> Floats:
        total = np.zeros(np.broadcast(x, y).shape)
        for turned, size in ((0.0, 1.0), (60.0, 0.9), (120.0, 0.8)):
            a = np.radians(angle_deg + turned)
            total = total + size * np.cos(2.0 * np.pi * (x * np.cos(a) + y * np.sin(a)) / pitch + turned)
        return total

    return height


def image_pair(
    axis: VirtualAxis,
    surface: Surface,
    size_v: float,
    offset_v: float,
    rate_hz: float,
    pixels: int = 256,
    lines: int = 256,
    turn: float = 0.5,
    window: tuple[float, float] = (0.0, 1.0),
    noise: float = 0.05,
    drift: float = 0.0,
    seed: int = 0,
) -> tuple[Floats, Floats]:
    """Trace and retrace, lines x pixels, left on the left in both.

    Pixels are evenly spread in time over ``window`` of each sweep. ``noise`` is rms, of the heights' peak to peak;
    ``drift`` moves the sample along x by so much of the line in a frame, faster as it goes on.
    """
    volts = offset_v + size_v * (ideal_triangle(_TICKS, turn) - 0.5)
    moved = axis.settled(volts, 1.0 / (rate_hz * _TICKS))
    size = float(np.max(moved) - np.min(moved))
    place = window[0] + (window[1] - window[0]) * (np.arange(pixels) + 0.5) / pixels
    random = np.random.default_rng(seed)
    shown = []
    for time in (turn * place, turn + (1.0 - turn) * (1.0 - place)):
        x = np.interp(time, np.arange(_TICKS) / _TICKS, moved, period=1.0)
        frame = (np.arange(lines)[:, None] + time) / lines
        heights = surface(x + drift * size * frame**2, size * frame)
        shown.append(heights + noise * float(np.ptp(heights)) * random.standard_normal(heights.shape))
    return shown[0], shown[1]
