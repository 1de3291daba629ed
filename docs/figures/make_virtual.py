"""Draw the pictures of docs/virtual.md: a simulation. Usage: make figures"""

import sys
from pathlib import Path

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np

FOLDER = Path(__file__).parent
sys.path.insert(0, str(FOLDER.parent))

from paper.identify import X_TARGETS
from paper.printed_numbers import default_x, triangle_line

from tablegen.compensation.hysteresis import beta_at
from tablegen.virtual.experiments import apparent_sizes, frequency_response

GREY, RED, BLUE = "#777777", "#c23b22", "#1f5fa8"


def scanner() -> None:
    """Hysteresis, its growth, offset and frequency, each with what the paper prints."""
    axis = default_x()
    figure, ((loop, growth), (offset, frequency)) = plt.subplots(2, 2, figsize=(10, 7), layout="constrained")

    whole = triangle_line(axis, 100.0)
    for branch, colour, side in ((whole.forward, RED, "forward"), (whole.backward, BLUE, "backward")):
        loop.plot(branch.position, branch.residual, color=colour, lw=1.8, label=side)
    loop.plot([0.35, 0.37], [-3.5, -3.5], "o", color=RED, ms=5, mfc="white")
    loop.plot([0.55, 0.52], [8.5, 8.5], "o", color=BLUE, ms=5, mfc="white")
    loop.axhline(0.0, color=GREY, lw=0.6)
    loop.set(title="Triangle of 100 V", xlabel="normalised drive", ylabel="residual [%]", xlim=(0, 1))
    loop.legend(frameon=False)

    volts = np.linspace(5.0, 100.0, 20)
    lines = [triangle_line(axis, v) for v in volts]
    dense = np.linspace(0.0, 1.0, 101)
    for side, colour, beta_max, rho in (("forward", RED, 0.037, 4.0), ("backward", BLUE, 0.08, 1.5)):
        growth.plot(volts, [abs(getattr(line, side).peak[0]) for line in lines], color=colour, lw=1.8)
        growth.plot(100 * dense, [100 * beta_at(v, beta_max, rho) for v in dense], "--", color=colour, lw=1)
    growth.set(title="Growth with the scan; dashed: (22)", xlabel="scan [V]", ylabel="peak residual [%]", xlim=(0, 100))

    at = np.linspace(7.0, 93.0, 44)
    found = apparent_sizes(axis, [*at], 13.0, 100.0, true_nm=17.7)
    offset.plot(at, found["apparent_nm"], color=BLUE, lw=1.8)
    offset.plot(at, [17.7 * X_TARGETS.offset.factor(v / 50 - 1) for v in at], "--", color=GREY, lw=1)
    offset.plot([7, 50, 93], [16.3, 17.7, 22.3], "o", color=BLUE, ms=5, mfc="white")
    offset.set(title="Lattice of 17.7 nm; dashed: (1)", xlabel="offset [V]", ylabel="apparent [nm]")

    f = np.geomspace(0.1, 2e5, 2000)
    response = frequency_response(axis, f)
    frequency.semilogx(f, response["gain"], color=BLUE, lw=1.8)
    frequency.semilogx(f[f < 1e4], 1 - 0.03 * np.log10(f[f < 1e4] / 100), "--", color=GREY, lw=1)
    frequency.set(title="Small signals; dashed: 3 % a decade", xlabel="Hz", ylabel="gain", ylim=(0.8, 1.3))
    figure.suptitle("Virtual scanner: simulation (lines), and what the paper prints (circles, dashes)", fontsize=10)
    figure.savefig(FOLDER / "virtual_scanner.png", dpi=100, metadata={"Software": None})


if __name__ == "__main__":
    mpl.use("Agg")
    mpl.rcParams.update({"font.size": 10, "axes.spines.top": False, "axes.spines.right": False})
    scanner()
