"""Draw the pictures of the README and the docs. Usage: make figures"""

from pathlib import Path

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np

from tablegen.compensation.hysteresis import BranchShape
from tablegen.compensation.line import LineShape
from tablegen.config.schema import BandLimit
from tablegen.numerics.arrays import Floats
from tablegen.planning.band_limit import band_limited

FOLDER = Path(__file__).parent
HARMONICS = 32
LOW, HIGH = 0.1, 0.9
FORWARD, BACKWARD = BranchShape.harmonic(0.035, 0.37), BranchShape.harmonic(0.085, 0.48)  # section 8 of the paper
SHAPE = LineShape(0.5, FORWARD, BACKWARD)
GREY, RED, BLUE, ORANGE = "#777777", "#c23b22", "#1f5fa8", "#d98e04"


def position(t: Floats, w: Floats) -> Floats:
    """The position of the modelled piezo at a drive w: the inverse of the branch being swept."""
    return np.where(t <= SHAPE.turn, FORWARD.inverse(w), 1.0 - BACKWARD.inverse(1.0 - w))


def scan_line() -> None:
    """The effect of the compensation on a scan line: drive, position error, scaling error."""
    t = np.linspace(0.0, 1.0, 4001)
    triangle = np.where(t <= 0.5, 2 * t, 2 - 2 * t)
    window = band_limited(SHAPE, BandLimit(), HARMONICS)
    truncated = band_limited(SHAPE, BandLimit(method="truncate"), HARMONICS)
    figure, (drive, error, scaling) = plt.subplots(1, 3, figsize=(12, 3.6), layout="constrained")

    for a, b in ((LOW / 2, HIGH / 2), (1 - HIGH / 2, 1 - LOW / 2)):
        for axes in (drive, error):
            axes.axvspan(a, b, color="#e8eef6", lw=0)
    drive.plot(t, triangle, color=GREY, lw=1.2, label="triangle")
    drive.plot(t, window.value(t), color=BLUE, lw=1.8, label="compensated")
    drive.set(title="Drive of one line", xlabel="time [line periods]", ylabel="normalised voltage", xlim=(0, 1))
    drive.legend(frameon=False, loc="lower center")

    ideal = triangle
    for w, colour, label in ((triangle, RED, "triangle"), (window.value(t), BLUE, "compensated")):
        error.plot(t, 100 * (position(t, w) - ideal), color=colour, lw=1.8, label=label)
    error.set(title="Position error", xlabel="time [line periods]", ylabel="% of the scan", xlim=(0, 1))
    error.set_ylim(-11, 11)
    error.legend(frameon=False, loc="upper left")

    x = np.linspace(LOW, HIGH, 2001)
    slope = 1.0 / FORWARD.slope(FORWARD.inverse(x))
    scaling.axhline(0, color=GREY, lw=0.6)
    scaling.plot(x, 100 * (slope / np.interp(0.5, x, slope) - 1), color=RED, lw=1.8, label="triangle")
    for series, colour, label in (
        (truncated, ORANGE, f"corrected, {HARMONICS} harmonics, cut off"),
        (window, BLUE, f"corrected, {HARMONICS} harmonics, fitted"),
    ):
        local = series.value(x / 2, 1) / SHAPE.slope(x / 2) - 1
        scaling.plot(
            x, 100 * (local - np.interp(0.5, x, local)), color=colour, lw=1.2 if colour == ORANGE else 1.8, label=label
        )
    scaling.set(title="Scaling error, forward", xlabel="position in the line", ylabel="%", xlim=(LOW, HIGH))
    scaling.legend(frameon=False, loc="lower right", fontsize=9)
    figure.savefig(FOLDER / "scan_line.png", dpi=110, metadata={"Software": None})


if __name__ == "__main__":
    mpl.use("Agg")
    mpl.rcParams.update({"font.size": 10, "axes.spines.top": False, "axes.spines.right": False})
    scan_line()
