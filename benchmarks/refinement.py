"""What `tablegen refine` reaches on the virtual scanner, round by round, as tables for docs/refine.md.

``python benchmarks/refinement.py`` prints them, ``--write`` puts them into the page. A simulation: the scanner was
calibrated on its own simulated sensor data, and every trace has the noise of a sensor.
"""

import argparse
import re
import sys
from pathlib import Path

ROOT = Path(__file__).parent.parent
PAGE = ROOT / "docs" / "refine.md"
sys.path.insert(0, str(ROOT / "tests" / "helpers"))

from refining import (  # noqa: E402
    GRATING,
    LATTICE,
    ROUGH,
    ROUNDS,
    SCANS,
    SLOPING,
    Step,
    calibrated,
    elsewhere,
    image_rounds,
    imaged_scan,
    rounds,
)

from tablegen.virtual.parameters import BUILT_IN  # noqa: E402


def reached(plant: str) -> str:
    """A row a round of every scan: true errors of the virtual scanner, not what its sensor saw."""
    rows = [
        "| scan | rounds | residual forward | backward | scaling forward | backward | by extremes forward | backward |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for scan in SCANS:
        for count, step in enumerate(rounds(calibrated(scan, plant), scan.axis, ROUNDS, plant=plant)):
            rows.append(f"| {scan.name if count == 0 else ''} | {count} | {_figures(step)} |")
    return "\n".join(rows) + "\n"


IMAGED = (
    ("x, 30 V, lattice", "x", 30.0, LATTICE),
    ("x, 60 V, grating", "x", 60.0, GRATING),
    ("x, 95 V, lattice", "x", 95.0, LATTICE),
    ("x, 60 V, no period", "x", 60.0, ROUGH),
    ("y, 60 V, lattice", "y", 60.0, LATTICE),
    ("y, 60 V, grating", "y", 60.0, SLOPING),
)
IMAGE_ROUNDS = 3


def from_images(plant: str) -> str:
    """A row a round of every scan that is refined from images."""
    rows = [
        "| scan, sample | rounds | residual forward | backward | scaling forward | backward |",
        "|---|---|---|---|---|---|",
    ]
    for name, axis, volts, sample in IMAGED:
        setup = calibrated(imaged_scan(axis, volts), plant)
        for count, step in enumerate(image_rounds(setup, axis, IMAGE_ROUNDS, sample, plant)):
            cells = _figures(step).split(" | ")[:4]
            rows.append(f"| {name if count == 0 else ''} | {count} | {' | '.join(cells)} |")
    return "\n".join(rows) + "\n"


def _figures(step: Step) -> str:
    sides = [step.true.residual_percent.get(side) for side in ("forward", "backward")]
    residual = [f"{rms:.3f} rms, {most:.3f}" for rms, most in filter(None, sides)]
    scaling = [f"{value:.2f}" for value in step.true.scaling_percent.values()]
    extremes = [f"{step.by_extremes[side]:.3f}" for side in step.true.scaling_percent]
    return " | ".join(" | ".join(one + ["-"] * (2 - len(one))) for one in (residual, scaling, extremes))


def served(plant: str) -> str:
    """A row a change of the scan: what is left with the layer, and without one."""
    rows = ["| scan | with the layer | without |", "|---|---|---|"]
    for what, kept, without in elsewhere(plant):
        rows.append(f"| {what} | {_short(kept)} | {_short(without)} |")
    return "\n".join(rows) + "\n"


def _short(step: Step) -> str:
    return f"{step.true.rms_percent:.3f} rms, {max(step.true.scaling_percent.values()):.1f} % scaling error"


TABLES = (("reached", reached), ("images", from_images), ("elsewhere", served))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help=f"put the tables into {PAGE.name}")
    parser.add_argument("--only", choices=[mark for mark, _ in TABLES], help="make one kind of table")
    given = parser.parse_args()
    chosen = [(mark, make) for mark, make in TABLES if given.only in (None, mark)]
    tables = [(f"{mark} {plant}", make(plant)) for plant in BUILT_IN for mark, make in chosen]
    for mark, text in tables:
        print(text)
        if given.write:
            page = PAGE.read_text("utf-8")
            marked = rf"(?<=<!-- {mark} -->\n).*(?=<!-- /{mark} -->)"
            PAGE.write_text(re.sub(marked, lambda _, text=text: text, page, count=1, flags=re.DOTALL), "utf-8")


if __name__ == "__main__":
    main()
