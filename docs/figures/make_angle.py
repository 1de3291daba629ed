"""Draw the picture of docs/angle.md: a lattice at 30 degrees on a simulated piezo. Usage: make figures

The piezo is a Preisach operator that tablegen does not contain, identified from ten traces an axis. Trace alone, 48
lines; each pixel shows the lattice where the tip is.
"""

import os
import sys
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np

FOLDER = Path(__file__).parent
sys.path.insert(0, str(FOLDER.parents[1] / "tests" / "helpers"))

from turned_scans import PIEZOS, moved_by, turned_setup  # noqa: E402

from tablegen.compensation.operator.turned_frame import learn_frame  # noqa: E402
from tablegen.numerics.arrays import Floats  # noqa: E402
from tablegen.planning.turned_plan import TurnedAxis, TurnedPlan, make_turned_plan  # noqa: E402
from tablegen.waveform.series import FourierSeries  # noqa: E402

PIEZO, ANGLE_DEG, LINES, SAMPLES = "preisach", 30.0, 96, 320
PERIOD_NM = 40.0


def unchanged(series: FourierSeries) -> FourierSeries:
    """No dynamics."""
    return series


def straight_lines(axis: TurnedAxis) -> Floats:
    """The drive of an axis without any correction, of the size that small scans have."""
    of, t = axis.motion, np.arange(SAMPLES) / SAMPLES
    phase = (np.arange(of.lines)[:, None] + t) / of.lines
    nm = of.fast_nm * (of.fast(t) - 0.5) + of.slow_nm * (of.slow(phase) - 0.5)
    return of.centre + nm / axis.known.operator.nm_per_drive


def apart(axis: TurnedAxis) -> Floats:
    """The sum of two drives, each learnt without the other motion."""
    of = axis.motion
    fast = learn_frame(axis.piezo, replace(of, slow_nm=0.0), unchanged, 16)
    slow = learn_frame(axis.piezo, replace(of, fast_nm=0.0), unchanged, 16)
    return replace(fast, slow=slow.slow).on_grid(of.lines, SAMPLES)


def together(axis: TurnedAxis) -> Floats:
    """The drive of the plan."""
    return axis.drive.on_grid(axis.motion.lines, SAMPLES)


def image_nm(plan: TurnedPlan) -> tuple[float, float]:
    """The wanted size of the image along and across the lines."""
    rising = np.count_nonzero(plan.x.motion.imaged) / (plan.x.motion.slow_turn * LINES)
    return 0.8 * plan.geometry.size_nm[0], plan.geometry.size_nm[1] * rising


def image(plan: TurnedPlan, drives: list[Floats]) -> Floats:
    """The lattice at the position of each imaged sample of the trace, by lines."""
    of = plan.x.motion
    x_nm, y_nm = (moved_by(core, u, of.line_rate_hz) for core, u in zip(PIEZOS[PIEZO], drives, strict=True))
    along, across = plan.geometry.on_the_sample(x_nm, y_nm, np.zeros(1))
    t = np.arange(SAMPLES) / SAMPLES
    inside = np.flatnonzero(of.inside(t) & (t < of.fast_turn))
    at = np.ix_(np.flatnonzero(of.imaged), inside)
    sizes = image_nm(plan)
    u = along[at] - np.mean(along[at]) + 0.5 * sizes[0]
    v = across[at] - np.mean(across[at]) + 0.5 * sizes[1]
    return np.cos(2.0 * np.pi * u / PERIOD_NM) + np.cos(2.0 * np.pi * v / PERIOD_NM)


def main() -> None:
    """Draw the three images."""
    mpl.rcParams.update({"font.size": 9, "svg.hashsalt": "tablegen"})
    with TemporaryDirectory() as folder:
        plan = make_turned_plan(turned_setup(Path(folder), ANGLE_DEG, f"timing.lines = {LINES}", piezo=PIEZO))
    kinds = {"no correction": straight_lines, "two corrections apart": apart, "planned together": together}
    figure, axes = plt.subplots(1, 3, figsize=(7.6, 2.9), layout="constrained")
    for place, (title, drive) in zip(axes, kinds.items(), strict=True):
        shown = image(plan, [drive(axis) for axis in plan.axes])
        sizes = image_nm(plan)
        place.imshow(shown, cmap="gray", origin="lower", extent=(0.0, sizes[0], 0.0, sizes[1]), interpolation="none")
        ticks = np.arange(0.0, max(sizes), PERIOD_NM)
        place.set_xticks(ticks[ticks < sizes[0]])
        place.set_yticks(ticks[ticks < sizes[1]])
        place.tick_params(labelsize=7)
        place.grid(color="tab:orange", linewidth=0.4)
        place.set_title(title)
        place.set_xlabel("along the lines [nm]")
    axes[0].set_ylabel("across [nm]")
    figure.savefig(FOLDER / "angle.png", dpi=110, metadata={"Software": None})


if __name__ == "__main__":
    main()
