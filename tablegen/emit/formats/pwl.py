"""Piecewise linear sources for circuit simulators: the output of the converter over one period, at the piezo."""

import numpy as np

from tablegen.emit.content import Content
from tablegen.emit.format import Format
from tablegen.emit.waveforms import Waveform, waveforms

_STEP_SHARE = 1e-3  # of a tick, which a step of the converter takes: a simulator needs a finite slope


class Pwl(Format):
    """The format pwl: ``NAME_x.pwl``, a line, and ``NAME_y.pwl``, a frame."""

    name = "pwl"
    purpose = "SPICE: time in s and volts at the piezo of a line of x and a frame of y, held between ticks as by a DAC"
    file_names = "NAME_x.pwl, NAME_y.pwl"

    def files(self, content: Content) -> dict[str, bytes]:
        """Render one file an axis; in LTspice ``PWL repeat forever (file=NAME_x.pwl) endrepeat``."""
        tick_s = float(1 / content.schedule.update_rate_hz)
        return {f"{content.name}_{waveform.axis}.pwl": _file(waveform, tick_s) for waveform in waveforms(content)}


FORMAT = Pwl()


def _file(waveform: Waveform, tick_s: float) -> bytes:
    """Write the corners of the held voltage: where it steps to another code, where the step ends, the period's end."""
    steps = np.flatnonzero(np.diff(waveform.codes)) + 1
    times, volts = waveform.time_s.tolist(), waveform.volts.tolist()
    corners = [(0.0, volts[0])]
    for at in steps.tolist():
        corners += [(times[at], volts[at - 1]), (times[at] + _STEP_SHARE * tick_s, volts[at])]
    corners.append((times[-1] + tick_s, volts[-1]))
    return "".join(f"{time!r} {value!r}\n" for time, value in corners).encode("ascii")
