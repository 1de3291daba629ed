"""How often the uncertainty of `tablegen predict` holds for drives that are no settled lines.

``python benchmarks/expected_of_predictions.py`` prints, for operators of settled traces (six and ten) and of records in
time, the share of predicted records whose rms error is below the uncertainty, which should be 90 %, and the median of
the error over it: for the piezos of ``expected_of_records.py`` on which the shares were chosen, for those kept aside,
and for each drive. No operator has seen the predicted records. A simulation.
"""

import argparse
import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from expected_of_records import ASIDE, DRIVES, FITTED, SECONDS, Core, chirp, falling_sine, operator_of, sines
from foreign_plants import SIX, TEN, V_MAX, Floats, triangle
from stepped_plants import random_triangle, recorded, settled

from tablegen.base.input_errors import Unphysical
from tablegen.calibration.laws.hysteresis import Trace
from tablegen.calibration.operator.fit import fit_operator
from tablegen.calibration.operator.periodic_line import periodic_line
from tablegen.compensation.operator.in_time import OperatorInTime, Start
from tablegen.compensation.operator.operator import STROKE_REACH, Operator
from tablegen.compensation.operator.prediction_uncertainty import possible_prediction_errors

TRACES = {"six traces": SIX, "ten traces": TEN}
RATE_HZ = 60.0  # of the traces
LINES = 8  # of a running scan, before it is predicted


def through(*turns: float, samples: int = 100) -> Floats:
    return np.concatenate([np.linspace(a, b, samples, endpoint=False) for a, b in pairwise(turns)])


def steps(seed: int) -> Floats:
    levels = np.random.default_rng(seed).uniform(0.05, 0.95, 20)
    ramps = [np.concatenate([np.linspace(a, b, 8), np.full(22, b)]) for a, b in pairwise([0.0, 0.95, 0.05, *levels])]
    return np.concatenate(ramps)


def scan(seed: int) -> Floats:
    """Lines of one size, then of another one at another offset; all of them from 0 on."""
    random = np.random.default_rng(seed)
    parts = []
    for _ in range(2):
        half = random.uniform(0.05, 0.25)
        centre = random.uniform(half + 0.05, 0.95 - half)
        parts.append(np.tile(through(centre - half, centre + half, centre - half, samples=20), LINES))
    return np.concatenate([np.linspace(0.0, parts[0][0], 20, endpoint=False), *parts])


PREDICTED: dict[str, tuple[Callable[[int], Floats], Start]] = {
    "random sweeps": (lambda seed: random_triangle(40 + seed, 20, 30), Start.REST),
    "small random sweeps": (lambda seed: 0.1 * seed + 0.3 * random_triangle(50 + seed, 20, 30), Start.REST),
    "first loop": (lambda seed: through(0.0, 0.9 - 0.1 * seed, 0.1, 0.6, 0.05 * seed), Start.REST),
    "sizes": (lambda seed: sines(np.random.default_rng(seed).uniform(0.05, 0.45, 4).tolist(), 16, 1200), Start.REST),
    "chirp": (lambda seed: chirp() * (1.0 - 0.15 * seed), Start.REST),
    "sine that falls": (lambda seed: falling_sine() * (1.0 - 0.15 * seed), Start.REST),
    "steps": (lambda seed: steps(60 + seed), Start.REST),
    "running scan": (lambda seed: scan(70 + seed), Start.LINE),
}


@dataclass(frozen=True)
class Judged:
    """A predicted record: its rms error over the uncertainty."""

    drive: str
    share: float


def offset_law(core: Core) -> Callable[[float], float]:
    """m of (1), by small scans."""
    centres = np.linspace(0.1, 0.9, 9)
    sizes = np.array([np.ptp(settled(core, triangle(200, at, 0.1) / V_MAX, RATE_HZ)) for at in centres.tolist()])
    middle = float(np.interp(0.5, centres, sizes))
    return lambda centre: middle / float(np.interp(centre, centres, sizes))


def operator_of_traces(core: Core, places: Sequence[tuple[float, float]], law: Callable[[float], float]) -> Operator:
    """The operator of settled traces with 0.1 % of noise."""
    lines = []
    for seed, (centre, stroke) in enumerate(places):
        u = triangle(400, centre, stroke) / V_MAX
        moved = np.tile(settled(core, u, RATE_HZ), 5)
        moved = moved + 0.001 * np.ptp(moved) * np.random.default_rng(seed).standard_normal(len(moved))
        time = np.arange(len(moved)) / (len(u) * RATE_HZ)
        lines.append(periodic_line(Trace(f"{seed}", time, V_MAX * np.tile(u, 5), moved), V_MAX))
    return fit_operator(lines, None, law).operator


def judged(core: Core, operator: Operator, law: Callable[[float], float] | None, count: int) -> Iterable[Judged]:
    """Judge records of every drive; those that `predict` refuses are left out."""
    largest = max(line.stroke for line in operator.lines) + STROKE_REACH

    def factor(mean: float) -> float:
        return 1.0 if law is None else law(mean) / law(operator.centre)

    for drive, (make, start) in PREDICTED.items():
        for seed in range(count):
            u = make(seed)
            time = np.linspace(0.0, SECONDS, len(u))
            measured = recorded(core, u, time, noise=0.0)
            if start is Start.LINE:  # the scan has run for some lines
                first = 20 + 40 * (LINES // 2)
                time, u, measured = time[first:], u[first:], measured[first:]
            if np.ptp(u) > largest:
                continue
            try:
                position = OperatorInTime(operator, factor).position(time, u, start)
            except Unphysical:
                continue
            bound = float(np.sqrt(np.mean(possible_prediction_errors(operator, u, position, start) ** 2)))
            yield Judged(drive, float(np.std(position - measured)) / bound)


def row(name: str, some: Sequence[Judged]) -> str:
    shares = np.array([one.share for one in some])
    return f"| {name} | {len(shares)} | {100.0 * np.mean(shares <= 1.0):.0f} % | {np.median(shares):.2f} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--records", type=int, default=2, help="of each operator and drive")
    given = parser.parse_args()
    print("| piezos, operator or drive | records | covered | median |\n|---|---|---|---|")
    for group, cores in (("chosen on", FITTED), ("kept aside", ASIDE)):
        by: dict[str, list[Judged]] = {}
        for name, core in cores.items():
            law = offset_law(core)
            for traces, places in TRACES.items():
                some = list(judged(core, operator_of_traces(core, places, law), law, given.records))
                for key in (traces, f"traces, {name}"):
                    by.setdefault(key, []).extend(some)
            for drive in DRIVES:
                some = list(judged(core, operator_of(core, drive), None, given.records))
                for key in ("records in time", f"records in time, {name}"):
                    by.setdefault(key, []).extend(some)
        every = [one for key in (*TRACES, "records in time") for one in by[key]]
        for drive in PREDICTED:
            by[drive] = [one for one in every if one.drive == drive]
        for key, some in by.items():
            print(row(f"{group}, {key}", some))
        print(row(f"{group}, all", every), flush=True)


if __name__ == "__main__":
    main()
