"""A converter that holds its codes, on a time grid of its own, far finer than a tick; and the means that pixels show.

Nothing of ``tablegen.virtual`` is in it: a staircase of the emitted codes, times the response at each of its harmonics,
and plain means between the pixel markers of the schedule.
"""

from pathlib import Path
from typing import Any

import numpy as np
from editing import SCAN, SCANNER, edited, write_pair

from tablegen.config.load import Setup, load
from tablegen.device.schedule import Schedule, Window, pixel_starts
from tablegen.planning.line_plan import LinePlan

PARTS = 64  # instants a tick
NO_DYNAMICS = ("- [x.hysteresis]", "- [[x.hysteresis.branches]]", "- [x.resonance]")
# 1 part in 10^6 of the line: neither converter nor table hides what is looked for.
FINE = (
    *("dac.bits = 24", "x.table.bits = 24", "x.table.length = 16384", "x.size_nm = 500.0"),
    *("- limits.max_scaling_error_percent", "- limits.max_error_lsb", "- amplifier.max_slew_v_per_s"),
)


def linear_setup(folder: Path, line_rate: float, update_rate: float, *edits: str, resonance: str = "") -> Setup:
    """The example on a scanner without hysteresis; ``resonance`` are the lines of [x.resonance], if there is one."""
    timing = (f"dac.update_rate_hz = {update_rate!r}", f"timing.line_rate_hz = {line_rate!r}", "timing.lines = 20")
    scanner = edited(SCANNER, *NO_DYNAMICS, *((f"+ [x.resonance]\n{resonance}",) if resonance else ()))
    return load(write_pair(folder, edited(SCAN, *timing, *FINE, *edits), scanner))


def staircase(line: LinePlan, parts: int = PARTS) -> np.ndarray:
    """One period of the codes as the converter holds them, in parts of the line, ``parts`` instants a tick."""
    codes = line.codes(0, line.program.ticks).astype(np.float64)
    return np.repeat((codes - line.converter.code(line.drive.v_offset)) / line.codes_per_unit + 0.5, parts)


def followed(volts: np.ndarray, period_s: float, frequency_hz: float, quality: float, delay_s: float) -> np.ndarray:
    """What a resonance with a dead time makes of a period, at the middle of each instant."""
    f = np.arange(len(volts) // 2 + 1) / period_s
    r = f / frequency_hz
    response = np.exp(-2j * np.pi * f * delay_s) / (1.0 - r * r + 1j * r / quality)
    return np.fft.irfft(np.fft.rfft(volts) * response, len(volts))


def pixel_means(position: np.ndarray, schedule: Schedule, window: Window) -> np.ndarray:
    """Mean position of each pixel of a sweep, from its marker to the next, or to the window's end."""
    parts = len(position) // schedule.ticks
    edges = np.append(pixel_starts(window, schedule.pixels), window.stop) * parts
    whole = np.concatenate([[0.0], np.cumsum(position)])
    return np.diff(whole[edges]) / np.diff(edges)


def mismatch(position: np.ndarray, schedule: Schedule) -> dict[str, Any]:
    """Trace less retrace, pixel by pixel, in percent of the line: mean, rms, and largest."""
    trace = pixel_means(position, schedule, schedule.forward)
    retrace = pixel_means(position, schedule, schedule.backward)[::-1]
    apart = 100.0 * (trace - retrace)
    return {"mean": float(apart.mean()), "rms": float(np.sqrt((apart**2).mean())), "largest": float(abs(apart).max())}
