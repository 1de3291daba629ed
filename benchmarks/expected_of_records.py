"""How often the figures of `expected` hold of an operator that was fitted to records in time.

``python benchmarks/expected_of_records.py`` prints a row for each piezo and for each drive of a record: the share of
settled lines whose error is below the uncertainty, which should be 90 %, and the median of the error over it. Lines are
at random sizes and offsets, and at the rate of the records. The levels of the uncertainty were chosen on ``FITTED``;
those of ``ASIDE`` are of other numbers or families; docs/operator.md says what was seen of them meanwhile. ``--noise``
is that of the records. A simulation.
"""

import argparse
import os
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent / "tests" / "helpers"))

from foreign_plants import V_MAX, BoucWen, Floats, JilesAtherton, ManyPlays, OneState, triangle
from stepped_plants import random_triangle, recorded, settled

from tablegen.base.input_errors import Unphysical
from tablegen.calibration.laws.hysteresis import Trace
from tablegen.calibration.operator.loop_errors import compare
from tablegen.calibration.operator.periodic_line import PHASES, PeriodicLine
from tablegen.calibration.operator.record_fit import fit_records
from tablegen.calibration.operator.time_record import time_record
from tablegen.compensation.operator.operator import STROKE_REACH, Operator
from tablegen.compensation.operator.uncertainty import possible_errors
from tablegen.virtual.duhem import Duhem
from tablegen.virtual.parameters import load_truth
from tablegen.virtual.preisach import Preisach
from tablegen.virtual.scanner import VirtualScanner

Core = ManyPlays | OneState | Preisach | Duhem
MEASURES = ("rms", "scaling", "mismatch", "size")
SECONDS = 0.25  # of a record
CENTRES = (0.35, 0.7)
SHARES = (0.1, 0.9)  # of the range that a centre leaves


def random_preisach(seed: int) -> Preisach:
    """A random density, and a random slope without hysteresis."""
    random = np.random.default_rng(seed)
    density = tuple(tuple(random.uniform(100.0, 1200.0, 4 - i).tolist()) for i in range(4))
    return Preisach(tuple(random.uniform(700.0, 1100.0, 4).tolist()), density)


def sines(amplitudes: Sequence[float], periods: int, samples: int) -> Floats:
    """Sines about the middle, of one amplitude after the other."""
    t = np.arange(samples) / samples
    amplitude = np.asarray(amplitudes)[np.minimum((t * len(amplitudes)).astype(int), len(amplitudes) - 1)]
    return 0.5 - amplitude * np.cos(2.0 * np.pi * periods * t)


def chirp() -> Floats:
    t = np.arange(800) / 800
    return 0.5 - 0.47 * np.cos(2.0 * np.pi * (2.0 * t + 5.0 * t * t))


def falling_sine() -> Floats:
    t = np.arange(1000) / 1000
    return 0.5 - 0.48 * np.clip(1.8 - 1.8 * t, 0.0, 1.0) * np.cos(2.0 * np.pi * 12.0 * t)


def random_sweeps() -> Floats:
    return random_triangle(3)


DRIVES: dict[str, tuple[Callable[[], Floats], ...]] = {
    "random sweeps": (random_sweeps,),
    "one size": (chirp,),
    "sine that falls": (falling_sine,),
    "full sine, sine that falls": (lambda: sines([0.48], 15, 1200), falling_sine),
    "random sweeps, one size": (random_sweeps, chirp),
    "five sizes": (lambda: sines([0.48, 0.35, 0.22, 0.12, 0.3], 25, 1600),),
}
FITTED: dict[str, Core] = {
    "plays": ManyPlays(seed=1, count=100),
    "Bouc-Wen": BoucWen(),
    "Bouc-Wen, n of 1": BoucWen(beta=4.5, gamma=-1.0, n=1.0, asymmetry=0.3, bend=0.1),
    "Jiles-Atherton": JilesAtherton(),
    "Preisach": VirtualScanner.of(load_truth()).x.hysteresis,
    "Preisach, random": random_preisach(5),
}
ASIDE: dict[str, Core] = {
    "plays, others": ManyPlays(seed=11, count=100),
    "plays, a third": ManyPlays(seed=12, count=100),
    "Bouc-Wen, skewed": BoucWen(a=0.3, beta=5.0, gamma=-1.0, n=1.2, depth=0.7, asymmetry=-0.3, bend=0.2, skew=0.1),
    "Jiles-Atherton, others": JilesAtherton(0.45, 0.6, -0.1, 0.5, 0.45, 0.15),
    "Duhem": VirtualScanner.of(load_truth("duhem")).x.hysteresis,
}


@dataclass(frozen=True)
class Judged:
    """A settled line, percent: its error by the operator, and the uncertainty of that."""

    drive: str
    error: Floats
    uncertainty: Floats

    @property
    def shares(self) -> Floats:
        """Each figure's error over its uncertainty."""
        return np.abs(self.error) / self.uncertainty


def operator_of(core: Core, drive: str, noise: float = 0.001) -> Operator:
    """The operator from the records of a drive."""
    records = []
    for seed, make in enumerate(DRIVES[drive], 1):
        u = make()
        time = np.linspace(0.0, SECONDS, len(u))
        moved = recorded(core, u, time, noise, seed)
        records.append(time_record(Trace(f"{seed}.csv", time, V_MAX * u, moved), V_MAX))
    return fit_records(records, None, lambda _: 1.0, 0.0).operator


def lines(core: Core, drive: str, operator: Operator, seed: int, count: int) -> Iterable[Judged]:
    """Judge settled lines at random; those that a build refuses are left out."""
    random = np.random.default_rng(seed)
    rate_hz = float(np.median([line.rate_hz for line in operator.lines]))
    largest = max(line.stroke for line in operator.lines) + STROKE_REACH
    for _ in range(count):
        centre = float(random.uniform(*CENTRES))
        stroke = 2.0 * min(centre, 1.0 - centre) * float(np.exp(random.uniform(*np.log(SHARES))))
        if stroke > largest:
            continue
        u = triangle(PHASES, centre, stroke) / V_MAX
        true = PeriodicLine("", rate_hz, 1, u, settled(core, u, rate_hz), 0.0, 0.0).without(None, operator.creep)
        try:
            loop = operator.loop(true.low, true.high, 1.0, true.mean)
        except Unphysical:
            continue
        error = np.array(compare(true, loop).figures)
        yield Judged(drive, error, np.array(possible_errors(operator, stroke, centre)))


def judged_piezo(core: Core, seed: int, count: int, noise: float, drives: Iterable[str] = DRIVES) -> list[Judged]:
    """Judge lines of one piezo, of the operators from every drive."""
    out = []
    for number, drive in enumerate(drives):
        operator = operator_of(core, drive, noise)
        out += lines(core, drive, operator, 100 * seed + number, count)
    return out


def row(name: str, judged: Sequence[Judged]) -> str:
    shares = np.array([one.shares for one in judged])
    cells = [f"{100.0 * np.mean(one <= 1.0):.0f} % / {np.median(one):.2f}" for one in shares.T]
    return f"| {name} | {' | '.join(cells)} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--lines", type=int, default=12, help="of each piezo and drive")
    parser.add_argument("--noise", type=float, default=0.001, help="of the records, of their stroke")
    given = parser.parse_args()
    print(f"| | {' | '.join(f'{measure}: covered / median' for measure in MEASURES)} |")
    print("|---" * (1 + len(MEASURES)) + "|")
    for kind, cores in (("fitted", FITTED), ("kept aside", ASIDE)):
        every: list[Judged] = []
        for seed, (name, core) in enumerate(cores.items(), 1):
            judged = judged_piezo(core, seed, given.lines, given.noise)
            print(row(f"{kind}, {name}", judged), flush=True)
            every += judged
        for drive in DRIVES:
            print(row(f"{kind}, {drive}", [one for one in every if one.drive == drive]))
        print(row(f"all {kind}", every), flush=True)


if __name__ == "__main__":
    main()
