"""Scans with the outputs z and aux, and the heights that they want by a formula of their own."""

from math import cos, radians, sin
from pathlib import Path

import numpy as np
from editing import SCAN, SCANNER, edited, write_pair
from foreign_plants import ForeignPlant, ManyPlays
from operator_files import operator_file
from sine_scans import response_csv, sine_scan, text_of
from turned_scans import write_turned

from tablegen.numerics.arrays import Floats, Ints

LINES, SIZE_NM, TURN, SLOW_TURN = 24, 300.0, 0.5, 0.95
SHORT = (f"timing.lines = {LINES}", "x.band_limit.harmonics = 24", "timing.line_rate_hz = 400")
SLOPE_X, SLOPE_Y, NM_PER_V, OFFSET_V = 0.02, -0.05, 5.0, 20.0
UP_DOWN = ("y.turn = 0.5", "y.band_limit.directions = 'both'", "y.band_limit.window = [0.1, 0.9]")
STEPS = ("y.motion = 'step'", "y.band_limit.harmonics = 8", "- amplifier.max_slew_v_per_s")
SINE = (
    "- x.band_limit.harmonics", "x.motion = 'sine'", "timing.line_rate_hz = 2e3", "dac.update_rate_hz = 1e6",
    "timing.pixels = 32", "timing.lines = 24", "y.band_limit.harmonics = 8", f"x.size_nm = {SIZE_NM}",
    f"y.size_nm = {SIZE_NM}",
)  # fmt: skip
Z = f"+ [z]\nslope_x = {SLOPE_X}\nslope_y = {SLOPE_Y}\noffset_v = {OFFSET_V}"
OF_SCANNER = f"+ [z]\nnm_per_v = {NM_PER_V}\nv_max = 100.0"
AUX_X, AUX_Y, AUX_NM_PER_V, AUX_OFFSET_V = -0.04, 0.015, -4.0, 45.0
AUX = f"+ [aux]\nslope_x = {AUX_X}\nslope_y = {AUX_Y}\noffset_v = {AUX_OFFSET_V}"
AUX_OF_SCANNER = f"+ [aux]\nnm_per_v = {AUX_NM_PER_V}\nv_max = 100.0\n[aux.dac]\ncoding = 'twos-complement'"


def with_aux(path: Path, *edits: str, scanner: tuple[str, ...] = (AUX_OF_SCANNER,)) -> Path:
    """Give a scan with z and its scanner the second output, in place; edits may be those of keys of ``[aux]``."""
    for file, tables in ((path, (AUX, *edits)), (path.with_name("scanner.toml"), scanner)):
        file.write_text(edited(file.read_text("utf-8"), *tables), "utf-8")
    return path


def write_tilted(folder: Path, angle_deg: float, *edits: str, scanner: tuple[str, ...] = (OF_SCANNER,)) -> Path:
    """Write a short scan at an angle with the output z, and its scanner; edits may be those of keys of ``[z]``."""
    path = write_turned(folder, angle_deg, *SHORT, Z, *edits, size_nm=SIZE_NM)
    file = folder / "scanner.toml"
    file.write_text(edited(file.read_text("utf-8"), *scanner), "utf-8")
    return path


def write_straight(folder: Path, *edits: str) -> Path:
    """Write the same frame at 0 degrees on the paper's scanner, whose axes are corrected by laws alone."""
    sizes = (f"x.size_nm = {SIZE_NM}", f"y.size_nm = {SIZE_NM}", "y.band_limit.harmonics = 16", "- [limits]")
    return write_pair(folder, edited(SCAN, *SHORT, *sizes, Z, *edits), edited(SCANNER, OF_SCANNER))


def write_stepped(folder: Path, *edits: str) -> Path:
    """Write the frame at 0 degrees whose y moves in steps, on axes with operators."""
    return write_tilted(folder, 0.0, *STEPS, *edits)


def write_sine(folder: Path, *edits: str) -> Path:
    """Write lines of 2 kHz with a sine on x, which has an operator and a measured response."""
    response = response_csv(ForeignPlant(ManyPlays()), 150e3)
    sine_scan(folder, text_of(operator_file("x")), response, *SINE, *edits)
    for name, table in (("scan.toml", Z), ("scanner.toml", OF_SCANNER)):
        (folder / name).write_text(edited((folder / name).read_text("utf-8"), table), "utf-8")
    return folder / "scan.toml"


def triangle(phase: Floats, turn: float) -> Floats:
    """Return positions from 0 to 1 and back to 0 over a period."""
    return np.asarray(np.interp(phase, [0.0, turn, 1.0], [0.0, 1.0, 0.0]))


def wanted_y(phase: Floats, turn: float) -> Floats:
    """Return the wanted y in nm of a scan at 0 degrees, from its centre, at phases of the frame."""
    return np.asarray(SIZE_NM * (triangle(phase, turn) - 0.5))


def wanted_places(angle_deg: float, line: Ints, t: Floats, lines: int = LINES) -> tuple[Floats, Floats]:
    """Return the wanted x and y in nm on the sample, from the centre of the scan, at phases of lines, broadcast."""
    along = SIZE_NM * (triangle(t, TURN) - 0.5) + 0.0 * line
    across = SIZE_NM * (triangle((line + t) / lines, SLOW_TURN) - 0.5)
    c, s = cos(radians(angle_deg)), sin(radians(angle_deg))
    return c * along - s * across, s * along + c * across


def volts_of(codes: Ints) -> Floats:
    """Return the volts at the piezo of z: 16 bits over -5..5 V, an amplifier of 10 and 50 V."""
    return np.asarray(10.0 * (-5.0 + 10.0 * codes / 65536.0) + 50.0)


def fitted_plane(x_nm: Floats, y_nm: Floats, z_nm: Floats) -> tuple[float, float, float]:
    """Return the slopes along x and y, and the height in the centre, of the plane through points."""
    design = np.stack([x_nm.ravel(), y_nm.ravel(), np.ones(x_nm.size)], axis=1)
    slope_x, slope_y, centre = np.linalg.lstsq(design, z_nm.ravel(), rcond=None)[0].tolist()
    return slope_x, slope_y, centre
