"""Draw the picture of the README: a lattice before and after, a simulation. Usage: make figures"""

from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np

from tablegen.config.load import load
from tablegen.planning.line_plan import make_plan
from tablegen.virtual.calibration_day import calibrate
from tablegen.virtual.imaging import Conditions, FrameImages, hexagonal, running_frame, triangle_frame
from tablegen.virtual.parameters import load_truth
from tablegen.virtual.scanner import VirtualScanner

FOLDER = Path(__file__).parent
SCANNER = FOLDER.parents[1] / "examples" / "scanner.toml"
CONSTANT_NM = 75.0
SAMPLE = hexagonal(CONSTANT_NM, 0.0)
RED = "#e0503a"
QUIET = Conditions(noise=0.02, seed=1)
PIXELS = 256
VOLTS = 80.0
SCAN = f"""name = "picture"
scanner = "{SCANNER}"
dac = {{ bits = 16, v_min = -5.0, v_max = 5.0, update_rate_hz = 500e3 }}
amplifier = {{ gain = 10.0, bias_v = 50.0 }}
timing = {{ pixels = {PIXELS}, lines = 640, line_rate_hz = 100.0 }}
x = {{ size_v = {VOLTS}, offset_v = 50.0 }}
y = {{ size_v = {VOLTS}, offset_v = 50.0, turn = 0.5 }}
"""


def frames() -> tuple[FrameImages, FrameImages]:
    """A triangle on both axes; and the same voltage compensated, calibrated with a sensor on the same scanner."""
    scanner = VirtualScanner.of(load_truth())
    sizes, offsets, window = (VOLTS, VOLTS), (50.0, 50.0), (0.1, 0.9)
    before = triangle_frame(scanner.x, scanner.y, SAMPLE, sizes, offsets, 100.0, QUIET, PIXELS, PIXELS, window=window)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "scan.toml"
        path.write_text(SCAN, "utf-8")
        plan = make_plan(calibrate(load(path), scanner).setup)
    return before, running_frame(plan, scanner.x, scanner.y, SAMPLE, QUIET)


def rings(frame: FrameImages) -> tuple[np.ndarray, np.ndarray]:
    """Columns and rows at which the pits of the lattice would be if all pixels were evenly spaced."""
    grid = np.linspace(0.0, 2.0 * CONSTANT_NM, 301)
    x, y = np.meshgrid(grid, grid)
    lowest = np.argmin(SAMPLE(x, y))
    i, j = np.mgrid[-60:61, -60:61]
    x = x.flat[lowest] + CONSTANT_NM * np.sqrt(0.75) * i
    y = y.flat[lowest] + CONSTANT_NM * (0.5 * i + j)
    places = []
    for nm, values, axis in ((x, frame.trace.x_nm, 0), (y, frame.trace.y_nm, 1)):
        line = values.mean(axis=axis)
        slope, first = np.polyfit(np.arange(len(line)), line, 1)
        places.append((nm - first) / slope)
    inside = (np.minimum(*places) > 3) & (np.maximum(*places) < PIXELS - 4)
    return places[0][inside], places[1][inside]


def bent(frame: FrameImages) -> float:
    """How far the worst pixel of the trace is from an even grid, in percent of the width."""
    far = 0.0
    for places, axis in ((frame.trace.x_nm, 0), (frame.trace.y_nm, 1)):
        line = places.mean(axis=axis)
        even = np.polyval(np.polyfit(np.arange(len(line)), line, 1), np.arange(len(line)))
        far = max(far, 100.0 * float(np.max(np.abs(line - even)) / np.ptp(even)))
    return far


def apart(frame: FrameImages) -> float:
    """How far trace and retrace of a pixel are apart at most, in percent of the width."""
    return 100.0 * float(np.max(np.abs(frame.trace.x_nm - frame.retrace.x_nm)) / np.ptp(frame.trace.x_nm))


def draw() -> None:
    """Both traces, with a ring where a pit would be in a straight image, and how far pixels are off."""
    figure, panels = plt.subplots(1, 2, figsize=(8.4, 5.0), layout="constrained")
    for panel, frame, title in zip(panels, frames(), ("plain triangle", "compensated by tablegen"), strict=True):
        image = frame.trace.heights
        panel.imshow(image, cmap="gray", vmin=np.percentile(image, 1), vmax=np.percentile(image, 99), origin="lower")
        panel.plot(*rings(frame), "o", color=RED, mfc="none", ms=7, mew=1.2)
        panel.set(title=title, xticks=[], yticks=[])
        what = f"off by up to {bent(frame):.1f} % of the width;\ntrace and retrace {apart(frame):.1f} % apart"
        panel.set_xlabel(what)
    figure.suptitle(
        "A lattice on the virtual scanner (simulation); rings: where a straight image has its pits", fontsize=10
    )
    figure.savefig(FOLDER / "lattice.png", dpi=72, metadata={"Software": None})


if __name__ == "__main__":
    mpl.use("Agg")
    mpl.rcParams.update({"font.size": 10})
    draw()
