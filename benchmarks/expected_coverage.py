"""How often the figures of `expected` hold, and how far above the truth they are, on piezos of several families.

``python benchmarks/expected_coverage.py`` prints a row for each piezo and protocol: the share of scans that leave less
than value and uncertainty together, which should be 90 %, and the median of what is left over that sum. Scans are at
random sizes, offsets between those of the traces, and rates. The levels of the uncertainty were chosen on ``FITTED``;
those of ``ASIDE`` are of other numbers or families; docs/operator.md says what was seen of them meanwhile. A
simulation.
"""

import argparse
import os
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from reach import MEASURES, PLANTS, RATES_HZ, TUNED, Floats, Judged, calibrated, figures_of, judge

sys.path.insert(0, str(Path(__file__).parent.parent / "tests" / "helpers"))

from foreign_plants import SIX, TEN, Core, ForeignPlant

from tablegen.virtual.parameters import load_truth
from tablegen.virtual.preisach import Preisach
from tablegen.virtual.scanner import VirtualScanner

OFFSETS = (0.4, 0.85)  # ends of the range
SHARES = (0.1, 0.9)  # of the range that an offset leaves
PROTOCOLS = {"six traces at 50 V": SIX, "ten traces": TEN}


class VirtualCore:
    """The hysteresis of a virtual scanner, of drives that leave 0..1 by no more than a rounding."""

    def __init__(self, core: Core) -> None:
        self._core = core

    def settled(self, u: Floats) -> Floats:
        return self._core.settled(np.clip(u, 0.0, 1.0))


def virtual(name: str) -> VirtualCore:
    """That of x of a scanner that comes with the package."""
    return VirtualCore(VirtualScanner.of(load_truth(name)).x.hysteresis)


def random_preisach(seed: int) -> VirtualCore:
    """A random density, and a random slope without hysteresis."""
    random = np.random.default_rng(seed)
    density = tuple(tuple(random.uniform(100.0, 1200.0, 4 - i).tolist()) for i in range(4))
    return VirtualCore(Preisach(tuple(random.uniform(700.0, 1100.0, 4).tolist()), density))


FITTED = {  # and the seed of the scans
    "plays": (647, TUNED["plays"][0]),
    "Preisach": (992, ForeignPlant(virtual("default"), 0.022)),
    "Preisach, random": (1006, ForeignPlant(random_preisach(5), 0.028)),
    "Jiles-Atherton": (232, PLANTS["Jiles-Atherton"][0]),
}
ASIDE = {
    "plays, others": (649, TUNED["plays"][2]),
    "Bouc-Wen": (246, PLANTS["Bouc-Wen"][0]),
    "Bouc-Wen, others": (247, PLANTS["Bouc-Wen"][1]),
    "Jiles-Atherton, others": (233, PLANTS["Jiles-Atherton"][1]),
    "Duhem": (531, ForeignPlant(virtual("duhem"), 0.02)),
}


def shares_of(judged: Sequence[Judged], measure: str) -> Floats:
    """What each scan leaves over the most that was expected."""
    shares = []
    for one in judged:
        assert one.expected is not None
        most = max(abs(figure.value) + (figure.uncertainty or 0.0) for figure in figures_of(one.expected, measure))
        shares.append(abs(one.left[measure]) / most)
    return np.array(shares)


def judged_scans(seed: int, plant: ForeignPlant, protocol: Sequence[tuple[float, float]], count: int) -> list[Judged]:
    """Scans at random; the same for every protocol."""
    random = np.random.default_rng(seed)
    found = []
    with tempfile.TemporaryDirectory() as folder:
        setup = calibrated(plant, Path(folder), protocol)
        for _ in range(count):
            offset = float(random.uniform(*OFFSETS))
            share, rate_hz = (float(np.exp(random.uniform(*np.log(ends)))) for ends in (SHARES, RATES_HZ))
            found.append(judge(setup, plant, offset, share, round(rate_hz)))
    return found


def row(name: str, protocol: str, judged: Sequence[Judged]) -> str:
    cells = []
    for measure in MEASURES:
        shares = shares_of(judged, measure)
        cells.append(f"{100.0 * np.mean(shares <= 1.0):.0f} % / {np.median(shares):.2f}")
    return f"| {name} | {protocol} | {' | '.join(cells)} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scans", type=int, default=12, help="of each piezo and protocol")
    given = parser.parse_args()
    print(f"| piezo | traces | {' | '.join(f'{measure}: covered / median' for measure in MEASURES)} |")
    print("|---" * (2 + len(MEASURES)) + "|")
    for kind, plants in (("fitted", FITTED), ("kept aside", ASIDE)):
        together: dict[str, list[Judged]] = {protocol: [] for protocol in PROTOCOLS}
        for name, (seed, plant) in plants.items():
            for protocol, lines in PROTOCOLS.items():
                judged = judged_scans(seed, plant, lines, given.scans)
                together[protocol] += judged
                print(row(name, protocol, judged), flush=True)
        for protocol, judged in together.items():
            print(row(f"all {kind}", protocol, judged), flush=True)


if __name__ == "__main__":
    main()
