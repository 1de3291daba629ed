"""Scans at an angle on simulated piezos that the project does not contain, for docs/angle.md.

``python benchmarks/scan_angle.py`` prints the errors at some angles, ``--step 7`` the worst over 0, 7, 14, ... 357
degrees, with ``--further`` from four more traces an axis; ``--write`` puts the table of angles into the page. Each axis
is identified from ten traces; a scan of 300 nm and 48 lines at 100 Hz is planned at the angle, and its emitted integers
are played on the piezo itself: hysteresis stepped over the frame, creep, two modes and a dead time. 0 degrees is
planned in the same way. ``--coupled`` does the same on axes of which each moves along the other by 2 %, and prints
beside it the worst of a plan that does not know it.
``--refine`` prints the errors at 30 degrees before and after each of two rounds of learning from a sensor with noise
and drift.
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

from turned_scans import FURTHER, PIEZOS, UNCOUPLED, Further, on_the_piezo, sensor_trace, turned_setup

from tablegen.planning.turned_plan import make_turned_plan
from tablegen.refinement.frame_round import FrameOptions, refine_frame

PAGE = Path(__file__).parent.parent / "docs" / "angle.md"
ANGLES = (0.0, 30.0, 45.0, 77.0, 120.0, 200.0)
COUPLED = 0.02, 0.02  # x_per_y, y_per_x
ROUNDS = 2
WITHOUT_MEMORY_OF_TURNS = ("bouc-wen", "jiles-atherton")
COLUMNS = ("rms", "worst_line", "mismatch", "fast_size", "slow_size", "shear")
HEAD = (
    "| piezo, angle | rms | worst line | trace and retrace | size along | size across | shear |\n"
    "|---|---|---|---|---|---|---|"
)


def errors(
    piezo: str, angle_deg: float, coupling: tuple[float, float], known: bool = True, further: Further = ()
) -> dict[str, float]:
    """Errors of a scan at an angle on a piezo, in percent; its axes are coupled, whether the plan knows it or not."""
    with tempfile.TemporaryDirectory() as folder:
        told = coupling if known else UNCOUPLED
        setup = turned_setup(Path(folder), angle_deg, piezo=piezo, coupling=told, further=further)
        return on_the_piezo(make_turned_plan(setup), piezo, coupling)


def row(name: str, found: dict[str, float]) -> str:
    """A row of the table."""
    signed = {"fast_size", "slow_size", "shear"}
    return f"| {name} | " + " | ".join(f"{found[key]:{'+' if key in signed else ''}.3f}" for key in COLUMNS) + " |"


def rows() -> Iterator[str]:
    """The rows of the page."""
    for piezo in PIEZOS:
        for angle in ANGLES if piezo not in WITHOUT_MEMORY_OF_TURNS else (0.0, 30.0):
            yield row(f"{piezo}, {angle:g}", errors(piezo, angle, UNCOUPLED))


def refined(piezo: str) -> Iterator[str]:
    """Rows of a scan at 30 degrees: as planned, and after each round."""
    with tempfile.TemporaryDirectory() as folder:
        setup = turned_setup(Path(folder), 30.0, piezo=piezo)
        for number in range(ROUNDS + 1):
            plan = make_turned_plan(setup)
            yield row(f"{piezo}, {number}", on_the_piezo(plan, piezo))
            for axis in "xy" if number < ROUNDS else "":
                setup = refine_frame(setup, axis, *sensor_trace(plan, piezo, axis), FrameOptions()).setup


def worst(name: str, all_errors: list[dict[str, float]]) -> str:
    """A row of the worst errors of some angles."""
    most = {key: max((one[key] for one in all_errors), key=abs) for key in COLUMNS}
    return row(f"{name}, worst of {len(all_errors)}", most)


def main() -> None:
    """Print the table, or write it into the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--step", type=int, metavar="DEGREES", help="print the worst over all angles in steps")
    parser.add_argument("--further", action="store_true", help="with --step: from fourteen traces an axis")
    parser.add_argument("--coupled", action="store_true", help="print the worst over some angles on coupled axes")
    parser.add_argument("--refine", action="store_true", help="print the errors of two rounds of learning")
    parser.add_argument("--write", action="store_true", help="put the table into docs/angle.md")
    options = parser.parse_args()
    if options.step or options.coupled:
        print(HEAD)
        angles = [float(angle) for angle in range(0, 360, options.step)] if options.step else ANGLES
        coupling = COUPLED if options.coupled else UNCOUPLED
        for piezo in (one for one in PIEZOS if one not in WITHOUT_MEMORY_OF_TURNS):
            further = FURTHER if options.further else ()
            if options.step:
                print(row(f"{piezo}, 0", errors(piezo, 0.0, coupling, further=further)), flush=True)
            print(worst(piezo, [errors(piezo, angle, coupling, further=further) for angle in angles]), flush=True)
            if options.coupled:
                unknown = [errors(piezo, angle, coupling, known=False) for angle in angles]
                print(worst(f"{piezo}, coupling not in the plan", unknown), flush=True)
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
