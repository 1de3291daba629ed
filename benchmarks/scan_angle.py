"""Scans at an angle on simulated piezos that the project does not contain, for docs/angle.md.

``python benchmarks/scan_angle.py`` prints the errors at some angles, ``--step 7`` the worst over 0, 7, 14, ... 357
degrees; ``--write`` puts the table of angles into the page. Each axis is identified from ten traces; a scan of 300 nm
and 48 lines at 100 Hz is planned at the angle, and its emitted integers are played on the piezo itself: hysteresis
stepped over the frame, creep, two modes and a dead time. 0 degrees is planned in the same way. ``--refine`` prints the
errors at 30 degrees before and after each of two rounds of learning from a sensor with noise and drift.
"""

import argparse
import os
import re
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

sys.path.insert(0, str(Path(__file__).parent.parent / "tests" / "helpers"))

from turned_scans import PIEZOS, on_the_piezo, sensor_trace, turned_setup

from tablegen.planning.turned_plan import make_turned_plan
from tablegen.refinement.frame_round import FrameOptions, refine_frame

PAGE = Path(__file__).parent.parent / "docs" / "angle.md"
ANGLES = (0.0, 30.0, 45.0, 77.0, 120.0, 200.0)
ROUNDS = 2
WITHOUT_MEMORY_OF_TURNS = ("bouc-wen", "jiles-atherton")
COLUMNS = ("rms", "worst_line", "mismatch", "fast_size", "slow_size", "shear")
HEAD = (
    "| piezo, angle | rms | worst line | trace and retrace | size along | size across | shear |\n"
    "|---|---|---|---|---|---|---|"
)


def errors(piezo: str, angle_deg: float) -> dict[str, float]:
    """Errors of a scan at an angle on a piezo, in percent."""
    with tempfile.TemporaryDirectory() as folder:
        return on_the_piezo(make_turned_plan(turned_setup(Path(folder), angle_deg, piezo=piezo)), piezo)


def row(name: str, found: dict[str, float]) -> str:
    """A row of the table."""
    signed = {"fast_size", "slow_size", "shear"}
    return f"| {name} | " + " | ".join(f"{found[key]:{'+' if key in signed else ''}.3f}" for key in COLUMNS) + " |"


def rows() -> Iterator[str]:
    """The rows of the page."""
    for piezo in PIEZOS:
        for angle in ANGLES if piezo not in WITHOUT_MEMORY_OF_TURNS else (0.0, 30.0):
            yield row(f"{piezo}, {angle:g}", errors(piezo, angle))


def refined(piezo: str) -> Iterator[str]:
    """Rows of a scan at 30 degrees: as planned, and after each round."""
    with tempfile.TemporaryDirectory() as folder:
        setup = turned_setup(Path(folder), 30.0, piezo=piezo)
        for number in range(ROUNDS + 1):
            plan = make_turned_plan(setup)
            yield row(f"{piezo}, {number}", on_the_piezo(plan, piezo))
            for axis in "xy" if number < ROUNDS else "":
                setup = refine_frame(setup, axis, *sensor_trace(plan, piezo, axis), FrameOptions()).setup


def worst(piezo: str, step: int) -> str:
    """The worst over all angles."""
    all_errors = [errors(piezo, float(angle)) for angle in range(0, 360, step)]
    most = {key: max((one[key] for one in all_errors), key=abs) for key in COLUMNS}
    return row(f"{piezo}, worst of {len(all_errors)}", most)


def main() -> None:
    """Print the table, or write it into the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--step", type=int, metavar="DEGREES", help="print the worst over all angles in steps")
    parser.add_argument("--refine", action="store_true", help="print the errors of two rounds of learning")
    parser.add_argument("--write", action="store_true", help="put the table into docs/angle.md")
    options = parser.parse_args()
    if options.step:
        print(HEAD)
        for piezo in PIEZOS:
            if piezo not in WITHOUT_MEMORY_OF_TURNS:
                print(worst(piezo, options.step), flush=True)
        return
    if options.refine:
        print(HEAD.replace("piezo, angle", "piezo, rounds"))
        for piezo in PIEZOS:
            for line in refined(piezo):
                print(line, flush=True)
        return
    found = []
    for line in rows():
        found.append(line)
        print(line, file=sys.stderr, flush=True)
    table = "\n".join([HEAD, *found])
    if not options.write:
        print(table)
        return
    text = PAGE.read_text("utf-8")
    PAGE.write_text(re.sub(r"\| piezo, angle \|[^\n]*\n(\|[^\n]*\n)+", lambda _: table + "\n", text), "utf-8")


if __name__ == "__main__":
    main()
