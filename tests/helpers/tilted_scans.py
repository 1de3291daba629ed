"""Scans with the output z, and the heights that they want by a formula of their own."""

from math import cos, radians, sin
from pathlib import Path

import numpy as np
from editing import SCAN, SCANNER, edited, write_pair
from turned_scans import write_turned

from tablegen.numerics.arrays import Floats, Ints

LINES, SIZE_NM, TURN, SLOW_TURN = 24, 300.0, 0.5, 0.95
SHORT = (f"timing.lines = {LINES}", "x.band_limit.harmonics = 24", "timing.line_rate_hz = 400")
SLOPE_X, SLOPE_Y, NM_PER_V, OFFSET_V = 0.02, -0.05, 5.0, 20.0
Z = f"+ [z]\nslope_x = {SLOPE_X}\nslope_y = {SLOPE_Y}\noffset_v = {OFFSET_V}"
OF_SCANNER = f"+ [z]\nnm_per_v = {NM_PER_V}\nv_max = 100.0"


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


def triangle(phase: Floats, turn: float) -> Floats:
    """Return positions from 0 to 1 and back to 0 over a period."""
    return np.asarray(np.interp(phase, [0.0, turn, 1.0], [0.0, 1.0, 0.0]))


def wanted_places(angle_deg: float, line: Ints, t: Floats) -> tuple[Floats, Floats]:
    """Return the wanted x and y in nm on the sample, from the centre of the scan, at phases of lines, broadcast."""
    along = SIZE_NM * (triangle(t, TURN) - 0.5) + 0.0 * line
    across = SIZE_NM * (triangle((line + t) / LINES, SLOW_TURN) - 0.5)
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
