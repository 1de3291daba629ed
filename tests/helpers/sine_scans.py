"""Scans with a sine on the fast axis, on piezos that the project does not contain: their codes and pixels, played."""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from editing import SCAN, SCANNER, edited, write_pair
from foreign_plants import Floats, ForeignPlant, ManyPlays
from operator_files import operator_file

from tablegen.compensation.dynamics import Measured
from tablegen.compensation.operator.file import OperatorFile, operator_text
from tablegen.compensation.response_file import read_response
from tablegen.config.load import Setup, load
from tablegen.planning.line_plan import Plan

CHORD = 0.05  # of the line
SIZE_NM = 200.0
_PARTS = 4  # of a tick, on which a piezo is stepped


def sine_scan(folder: Path, operator: bytes, response: str, *edits: str) -> Setup:
    """The example with an operator and a measured response of x, and ``edits`` of the scan file.

    ``response`` is the CSV of the response: frequency, gain, phase in degrees.
    """
    (folder / "operator_x.toml").write_bytes(operator)
    (folder / "response.csv").write_text(response, "ascii")
    scanner = edited(
        SCANNER, "x.hysteresis.model = 'operator'", "x.hysteresis.file = 'operator_x.toml'",
        "- [x.resonance]", "+ [x.resonance]\nresponse = 'response.csv'", "- [x.frequency]", "- [x.offset]",
    )  # fmt: skip
    scan = edited(
        SCAN, f"x.size_nm = {SIZE_NM}", "x.offset_v = 50", "- [limits]", "timing.lines = 20",
        "y.band_limit.harmonics = 8", "amplifier.max_slew_v_per_s = 1e9", *edits,
    )  # fmt: skip
    return load(write_pair(folder, scan, scanner))


def short_sine(folder: Path, *edits: str) -> Setup:
    """A sine of 5 kHz with 48 pixels a line and 16 lines, on a piezo of plays."""
    return sine_scan(
        folder, text_of(operator_file("x")), response_csv(ForeignPlant(ManyPlays()), 150e3),
        "- x.band_limit.harmonics", "x.motion = 'sine'", "timing.line_rate_hz = 5e3", "dac.update_rate_hz = 2e6",
        "timing.pixels = 48", "timing.lines = 16", "y.band_limit.harmonics = 4", *edits,
    )  # fmt: skip


def response_csv(
    plant: ForeignPlant, highest_hz: float, count: int = 600, noise: float = 1e-3, turning: float = 0.0, seed: int = 5
) -> str:
    """The response of a plant behind its hysteresis as measured, with noise of its gain, and of its phase in radians.

    Without other arguments: 600 points, and a thousandth of noise of the gain.
    """
    f = np.geomspace(50.0, highest_hz, count)
    response = plant.dynamics(f)
    random = np.random.default_rng(seed)
    gain = np.abs(response) * (1.0 + noise * random.standard_normal(count))
    phase = np.unwrap(np.angle(response, deg=True), period=360.0)
    if turning:
        phase += np.degrees(turning * random.standard_normal(count))
    rows = "\n".join(f"{one:.6g},{g:.6g},{p:.6g}" for one, g, p in zip(f, gain, phase, strict=True))
    return f"hz,gain,phase_deg\n{rows}\n"


def measured_response(text: str) -> Measured:
    """The response of a CSV as a build reads it."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "response.csv"
        path.write_text(text, "ascii")
        return read_response(path)


def text_of(file: OperatorFile) -> bytes:
    """The text of an operator that no fit has made."""
    return operator_text(file, []).encode("utf-8")


def pixels_on_the_piezo(plan: Plan, plant: ForeignPlant) -> tuple[Floats, Floats]:
    """Play the emitted codes of a line on a piezo; return the mean position over each pixel, trace and retrace, in nm.

    Both are in the order of the position, shape (pixels,) each.
    """
    schedule, line = plan.schedule, plan.x
    codes = np.repeat(line.codes(0, schedule.ticks), _PARTS)
    volts = line.converter.v_zero + line.converter.v_per_code * codes
    moved = np.fft.rfft(plant.settled(volts, float(schedule.line_rate)))
    middle = np.fft.irfft(moved * np.sinc(np.arange(len(moved)) / len(volts)), len(volts))
    sums = np.concatenate([[0.0], np.cumsum(middle)]) / _PARTS
    found = []
    for window, starts in zip((schedule.forward, schedule.backward), schedule.pixel_starts, strict=True):
        edges = np.append(starts, window.stop)
        found.append(np.diff(sums[edges * _PARTS]) / np.diff(edges))
    return found[0], found[1][::-1]


def image_errors(trace: Floats, retrace: Floats, window: tuple[float, float]) -> dict[str, float]:
    """Errors of an image in percent of the line, about the common best straight line of both directions."""
    low, high = window
    grid = low + (high - low) * (np.arange(len(trace)) + 0.5) / len(trace)
    return _errors(grid, (trace, retrace), (grid, grid))


def predicted_errors(plan: Plan, trace: Floats, retrace: Floats) -> dict[str, float]:
    """The same where each pixel of a sine is at the place that its certificate states, and not on the grid."""
    errors, window = plan.pixel_errors, plan.x.imaged
    assert errors is not None
    assert window is not None
    grid = window[0] + (window[1] - window[0]) * (np.arange(len(trace)) + 0.5) / len(trace)
    places = tuple(grid + 0.01 * errors.errors[side] for side in ("forward", "backward"))
    return _errors(grid, (trace, retrace), places)


def _errors(grid: Floats, sides: tuple[Floats, Floats], places: tuple[Floats, ...]) -> dict[str, float]:
    slope, start = np.polyfit(np.concatenate(places), np.concatenate(sides), 1)
    errors = [100.0 * ((one - start) / slope - at) for one, at in zip(sides, places, strict=True)]
    step = round(CHORD / (grid[1] - grid[0]))
    return {
        "rms": max(float(np.sqrt(np.mean(one * one))) for one in errors),
        "scaling": max(float(np.ptp(one[step:] - one[:-step])) / float(grid[step] - grid[0]) for one in errors),
        "mismatch": float(np.max(np.abs(errors[0] - errors[1]))),
        "size": float(100.0 * (slope / SIZE_NM - 1.0)),
    }
