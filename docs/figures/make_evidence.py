"""Draw the picture of the README: a real stage, predicted. Usage: make figures STAGE=FOLDER

FOLDER has the two records of https://github.com/yan9a/DiscreteBacklashOperator (MIT licence) as ``piezo_1hz_full.csv``
and ``piezo_1hz_ramp.csv``; without it the picture stays as it is.
"""

import os
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np

import tablegen
from tablegen.numerics.arrays import Bools, Floats

FOLDER = Path(__file__).parent
FROM_S, UNTIL_S = 17.0, 21.0  # predicted; drawn from two seconds before
GREY, RED, BLUE, ORANGE = "#777777", "#c23b22", "#1f5fa8", "#d98e04"
PUBLISHED_PERCENT = 0.55  # rms that a published inverse left, played on that stage


def predicted(full: Path, ramp: Path) -> tuple[Floats, Floats, Floats]:
    """Return times in s, measured and predicted position in um of the second record, from both until ``FROM_S``."""
    with TemporaryDirectory() as place:
        before, scanner = Path(place) / "before.csv", Path(place) / "stage.toml"
        rows = ramp.read_text("utf-8").splitlines(keepends=True)
        before.write_text("".join(rows[:1] + [row for row in rows[1:] if float(row.split(",")[0]) < FROM_S]), "utf-8")
        scanner.write_text('name = "stage"\nv_max = 3.6\n[x.size]\nk_nm_per_v = 12500\n[y]\nlike = "x"\n', "utf-8")
        fit = tablegen.calibrate_operator([full, before], axis="x", scanner=scanner, drive_gain=1.0, delay_s="fit")
        fit.write(scanner)
        out = tablegen.predict(scanner, ramp, axis="x", against=ramp, drive_gain=1.0, delay_s=fit.delay.value)
    assert out.measured_nm is not None
    return out.time_s, 1e-3 * out.measured_nm, 1e-3 * out.position_nm


def simple(ramp: Path, measured_um: Floats, before: Bools, degree: int) -> Floats:
    """Return the positions of a polynomial of the drive, fitted to the same record."""
    volts = np.loadtxt(ramp, delimiter=",", skiprows=1)[: len(measured_um), 1]
    return np.asarray(np.polyval(np.polyfit(volts[before], measured_um[before], degree), volts))


def main(records: Path) -> None:
    full, ramp = (records / f"piezo_1hz_{name}.csv" for name in ("full", "ramp"))
    time, measured, ours = predicted(full, ramp)
    later, drawn = time >= FROM_S, (time >= FROM_S - 2.0) & (time < UNTIL_S)
    span = float(np.ptp(measured[time > 1.0]))
    errors = {}
    for name, position in (("straight line", simple(ramp, measured, ~later, 1)), ("operator", ours)):
        error = 100.0 * (position - measured) / span
        errors[name] = error - np.mean(error[later])
    middle = float(np.mean(measured[later]))
    drawn[1::2] = False  # every other sample is drawn
    figure, (above, below) = plt.subplots(2, 1, figsize=(8.0, 4.4), sharex=True, height_ratios=(1.0, 1.0))
    above.plot(time[drawn], measured[drawn] - middle, color=GREY, linewidth=3.5, label="measured")
    part = drawn & later
    above.plot(time[part], ours[part] - np.mean(ours[later]), color=BLUE, linewidth=1.2, label="predicted")
    above.set_ylabel("position [um]")
    for (name, error), color in zip(errors.items(), (ORANGE, BLUE), strict=True):
        rms = float(np.sqrt(np.mean(error[later] ** 2)))
        below.plot(time[part], error[part], color=color, linewidth=1.2, label=f"{name}, {rms:.2f} % rms")
    below.axhspan(-PUBLISHED_PERCENT, PUBLISHED_PERCENT, color=GREY, alpha=0.25, linewidth=0.0)
    below.plot([], [], color=GREY, alpha=0.4, linewidth=6.0, label=f"published inverse, {PUBLISHED_PERCENT} % rms")
    below.set_ylabel("error [% of the stroke]")
    below.set_xlabel("time [s]")
    for axes in (above, below):
        axes.axvline(FROM_S, color=RED, linewidth=0.8, linestyle="--")
        axes.spines[["top", "right"]].set_visible(False)
        axes.legend(loc="lower right", fontsize=8, frameon=False, ncols=3)
    below.margins(y=0.25)
    above.text(FROM_S - 0.03, above.get_ylim()[1], "fitted until here", ha="right", va="top", fontsize=8, color=RED)
    figure.tight_layout()
    figure.savefig(FOLDER / "real_stage.svg", metadata={"Date": None, "Creator": None})


if __name__ == "__main__":
    mpl.rcParams["svg.hashsalt"] = "tablegen"
    mpl.rcParams["svg.fonttype"] = "none"
    if len(sys.argv) > 1:
        main(Path(sys.argv[1]))
    else:
        print("the records of the real stage are not given: real_stage.svg stays as it is")
