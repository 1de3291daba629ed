"""One period of both axes as files of samples have it: time, volts, codes and markers, a value a tick."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.device.period import period_of
from tablegen.emit.content import Content
from tablegen.numerics.arrays import Bools, Floats, Ints

MOST_TICKS = 1 << 22


@dataclass(frozen=True, eq=False)
class Waveform:
    """A line of x or a frame of y; all arrays have the shape (ticks,).

    ``time_s`` begins with the period, in s; ``volts`` are those at the piezo that the codes make; ``codes`` are
    straight binary, 0 .. 2^dac_bits - 1; ``markers`` are ``start``, ``line``, ``pixel``, ``backward`` and ``inside``.
    """

    axis: Literal["x", "y"]
    time_s: Floats
    volts: Floats
    codes: Ints
    markers: dict[str, Bools]


def waveforms(content: Content) -> tuple[Waveform, Waveform]:
    """Compute a line of x and a frame of y. Raises ``Unphysical`` where there is no file of one period."""
    require_period(content)
    return _waveform(content, "x"), _waveform(content, "y")


def require_period(content: Content) -> None:
    """Check that a build has a period, of a size that a file of samples can have.

    Raises
    ------
    Unphysical
        If codes are shaped and so have no period, or if a frame would make a file of 100 MB and more.
    """
    if any(axis.program.output.shaping.order for axis in content.axes):
        raise Unphysical(
            "a file of samples has one period, and shaped codes have none: their remainders run on from line to line; "
            "dac.shaping = 'off' would fit, or formats of tables for a device that shapes"
        )
    ticks = content.schedule.frame_ticks
    if ticks > MOST_TICKS:
        raise Unphysical(
            f"a frame of {ticks} ticks is {ticks - MOST_TICKS} ticks too long for a file of its samples, which has at "
            f"most {MOST_TICKS}; a lower dac.update_rate_hz, fewer timing.lines or a higher timing.line_rate_hz "
            "would fit, and formats of tables have no such limit"
        )


def _waveform(content: Content, name: Literal["x", "y"]) -> Waveform:
    axis, period = getattr(content, name), period_of(content.program, name)
    names = ("start", "line", "pixel", "backward", "inside")
    return Waveform(
        axis=name,
        time_s=content.schedule.seconds(period.ticks),
        volts=axis.v_zero + axis.v_per_code * period.codes.astype(np.float64),
        codes=period.codes,
        markers={marker: getattr(period, marker) for marker in names},
    )
