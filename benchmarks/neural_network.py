"""A neural network trained on the records that an operator is identified from, for docs/evidence.md.

``python benchmarks/neural_network.py --stage FOLDER`` prints both tables, ``--write`` puts them into the page. It needs
scikit-learn, which nothing else here does: ``pip install scikit-learn``. FOLDER has the two records of
https://github.com/yan9a/DiscreteBacklashOperator as ``piezo_1hz_full.csv`` and ``piezo_1hz_ramp.csv``.

The network is given what a branch depends on: the drive, its last two turns, and the rate where records have several;
rising and falling samples have networks of their own, as in https://doi.org/10.3390/act13100391, whose network has more
layers. Every network is trained from five seeds, and the median of their errors counts.
"""

import argparse
import os
import re
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from functools import cache
from itertools import pairwise
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent / "tests" / "helpers"))

from foreign_plants import (
    SIX,
    TEN,
    V_MAX,
    BoucWen,
    Floats,
    ForeignPlant,
    JilesAtherton,
    ManyPlays,
    record,
    triangle,
)
from sklearn.neural_network import MLPRegressor
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

import tablegen
from tablegen.calibration.laws.hysteresis import Trace
from tablegen.calibration.operator.fit import fit_operator
from tablegen.calibration.operator.periodic_line import periodic_line
from tablegen.compensation.dynamics import SecondOrder
from tablegen.compensation.operator.in_time import OperatorInTime, turns_of

PAGE = Path(__file__).parent.parent / "docs" / "evidence.md"
LAYERS = (32, 32)
SEEDS = range(5)
PENALTIES = (1e-6, 1e-3, 0.1, 10.0)
RESPONSE = SecondOrder(60e3, 14.0, 2e-6)
PLANTS = {  # those of benchmarks/reach.py, the first of each kind
    "plays": ForeignPlant(ManyPlays(seed=11), creep=0.024),
    "Bouc-Wen": ForeignPlant(
        BoucWen(a=0.3, beta=5.0, gamma=-1.0, n=1.2, depth=0.7, asymmetry=-0.3, bend=0.2, skew=0.1), 0.022
    ),
    "Jiles-Atherton": ForeignPlant(JilesAtherton()),
}
TRACES = {
    "ten, one at 10 Hz": [*((line, 100.0) for line in TEN), ((0.5, 0.5), 10.0)],
    "six at 50 V": [(line, 100.0) for line in SIX],
}
SCANS = {  # centre, stroke, Hz
    "sizes between, 50 V, 100 Hz": [(0.5, stroke, 100.0) for stroke in (0.15, 0.35, 0.55, 0.75)],
    "60 V, 100 Hz": [(0.6, stroke, 100.0) for stroke in (0.2, 0.45, 0.7)],
    "50 V, 30 and 500 Hz": [(0.5, stroke, rate) for stroke in (0.35, 0.75) for rate in (30.0, 500.0)],
}


class Branches:
    """A network for rising and one for falling samples, of one seed; ``penalty`` is that of its squared weights."""

    def __init__(self, seed: int, penalty: float = 1e-6) -> None:
        how = {"activation": "tanh", "solver": "lbfgs", "alpha": penalty, "max_iter": 2000, "random_state": seed}
        networks = [MLPRegressor(hidden_layer_sizes=LAYERS, **how) for _ in range(2)]
        self.networks = [make_pipeline(StandardScaler(), one) for one in networks]

    def fit(self, inputs: Floats, rising: Floats, nm: Floats) -> "Branches":
        """Train on inputs of shape (samples, n), and positions."""
        self.centre, self.scale = float(np.mean(nm)), float(np.std(nm))
        for network, side in zip(self.networks, (rising, ~rising), strict=True):
            network.fit(inputs[side], (nm[side] - self.centre) / self.scale)
        return self

    def predict(self, inputs: Floats, rising: Floats) -> Floats:
        """Return positions, (samples,)."""
        out = np.empty(len(inputs))
        for network, side in zip(self.networks, (rising, ~rising), strict=True):
            if np.any(side):
                out[side] = self.centre + self.scale * network.predict(inputs[side])
        return out


def memory(u: Floats, first: tuple[float, float]) -> tuple[Floats, Floats]:
    """Return drive, last turn and the turn before for every sample, (samples, 3), and which of them rise."""
    inputs, rising = np.empty((len(u), 3)), np.zeros(len(u), dtype=bool)
    last, before = first
    for begin, end in pairwise(turns_of(u)):
        inputs[begin : end + 1, 0] = u[begin : end + 1]
        inputs[begin : end + 1, 1:] = last, before
        rising[begin : end + 1] = u[end] > u[begin]
        last, before = u[end], last
    return inputs, rising


def rms(error: Floats, stroke: float) -> tuple[float, float]:
    """Return rms and largest error in percent of a stroke, without the mean."""
    error = 100.0 * (error - np.mean(error)) / stroke
    return float(np.sqrt(np.mean(error * error))), float(np.max(np.abs(error)))


def stage(folder: Path) -> list[str]:
    """Rows of a real stage: both records to 17 s, the rest of the second predicted."""
    full, ramp = (folder / f"piezo_1hz_{name}.csv" for name in ("full", "ramp"))
    rows = ["| model | weights | trained in | rms [%] | largest [%] |", "|---|---|---|---|---|"]
    begin = time.process_time()
    with tempfile.TemporaryDirectory() as place:
        before, scanner = Path(place) / "ramp.csv", Path(place) / "stage.toml"
        before.write_text("".join(ramp.read_text("utf-8").splitlines(keepends=True)[: 17 * 200 + 1]), "utf-8")
        scanner.write_text('name = "stage"\nv_max = 3.6\n[x.size]\nk_nm_per_v = 12500\n[y]\nlike = "x"\n', "utf-8")
        fit = tablegen.calibrate_operator([full, before], axis="x", scanner=scanner, drive_gain=1.0, delay_s="fit")
        seconds = time.process_time() - begin
        fit.write(scanner)
        ours = tablegen.predict(scanner, ramp, axis="x", against=ramp, drive_gain=1.0, delay_s=fit.delay.value)
    later = ours.time_s >= 17.0
    span = float(np.ptp(ours.measured_nm[ours.time_s > 1.0]))
    cells = rms((ours.position_nm - ours.measured_nm)[later], span)
    rows.append(f"| operator in time | {fit.in_time.weights} | {seconds:.1f} s | {cells[0]:.2f} | {cells[1]:.2f} |")
    delay = fit.delay.value
    parts = []
    for path in (full, ramp):
        t, v, um = np.loadtxt(path, delimiter=",", skiprows=1).T
        u = np.interp(t - delay, t, v) / 3.6  # what the sensor shows now was driven then
        inputs, rising = memory(u, (0.0, 1.0))
        parts.append((t, inputs, rising, 1e3 * um))
    (_, full_in, full_up, full_nm), (t, ramp_in, ramp_up, ramp_nm) = parts
    # The sensor's zero differs between the records: that of each is its middle at full stroke.
    middles = [0.5 * (np.max(nm) + np.min(nm)) for nm in (full_nm[1000:], ramp_nm[:2000])]
    ramp_nm = ramp_nm + middles[0] - middles[1]
    results, begin = [], time.process_time()

    def trained(seed: int, penalty: float, until_s: float) -> tuple[Floats, Branches]:
        part = t < until_s
        pairs = ((full_in, ramp_in[part]), (full_up, ramp_up[part]), (full_nm, ramp_nm[part]))
        network = Branches(seed, penalty).fit(*(np.concatenate(pair) for pair in pairs))
        return network.predict(ramp_in, ramp_up) - ramp_nm, network

    # As the operator's complexity, the penalty is chosen by the last part before what is predicted.
    last = (t >= 15.5) & (t < 17.0)
    penalty = min(PENALTIES, key=lambda one: np.median([rms(trained(k, one, 15.5)[0][last], span) for k in SEEDS]))
    for seed in SEEDS:
        error, _ = trained(seed, penalty, 17.0)
        results.append((rms(error[(t > 1.0) & (t < 17.0)], span)[0], *rms(error[t >= 17.0], span)))
    seconds = time.process_time() - begin
    inner, middle, worst = np.median(results, axis=0)
    rows.append(f"| network, penalty {penalty:g} | {weights(3)} | {seconds:.0f} s | {middle:.2f} | {worst:.2f} |")
    rows.append(f"| the same, in its own records | | | {inner:.2f} | |")
    return rows


def weights(inputs: int) -> int:
    """Return the number of weights of both networks."""
    sizes = (inputs, *LAYERS, 1)
    return 2 * sum(a * b + b for a, b in pairwise(sizes))


def offset_law(plant: ForeignPlant) -> Callable[[float], float]:
    """Return m of (1): the apparent size of small scans at a centre over that in the middle, as images show it."""

    @cache
    def extent(centre: float) -> float:
        return float(np.ptp(plant.settled(triangle(400, centre, 0.1), 100.0)))

    return lambda centre: extent(0.5) / extent(centre)


def settled_inputs(u: Floats, rate_hz: float | None) -> tuple[Floats, Floats]:
    """Return the inputs of a settled triangle from its lower turn on; no rate where all traces have one."""
    inputs, rising = memory(np.append(u, u[0]), (float(np.min(u)), float(np.max(u))))
    rate = [] if rate_hz is None else [np.full(len(u), np.log10(rate_hz))]
    return np.column_stack([inputs[:-1], *rate]), rising[:-1]


def compared(plant: ForeignPlant, protocol: Sequence[tuple[tuple[float, float], float]]) -> tuple[dict, dict]:
    """Return errors of rms and size of each kind of scan, and CPU seconds, of the operator and of the network."""
    records = [record(plant, *line, rate, seed) for seed, (line, rate) in enumerate(protocol)]
    factor = offset_law(plant)
    several = len({rate for _, rate in protocol}) > 1
    begin = time.process_time()
    lines = [periodic_line(Trace(f"{k}", *one), V_MAX) for k, one in enumerate(records)]
    operator = fit_operator(lines, RESPONSE, factor).operator
    ours_s = time.process_time() - begin
    inputs, rising, nm = [], [], []
    for (_, rate), line in zip(protocol, lines, strict=True):
        some, up = settled_inputs(line.drive, rate if several else None)  # averaged over the periods, without drift
        inputs.append(some)
        rising.append(up)
        nm.append(line.displacement_nm - np.mean(line.displacement_nm))
    begin = time.process_time()
    networks = [Branches(seed).fit(*(np.concatenate(part) for part in (inputs, rising, nm))) for seed in SEEDS]
    network_s = (time.process_time() - begin) / len(SEEDS)
    ours, theirs = {"s": ours_s}, {"s": network_s}
    for name, scans in SCANS.items():
        rows = []
        for centre, stroke, rate in scans:
            u = triangle(1000, centre, stroke) / V_MAX
            truth = plant.settled(V_MAX * u, rate)
            span = float(np.ptp(truth))
            t = np.arange(1001) / (1000.0 * rate)
            ratio = factor(centre) / factor(operator.centre)
            at_rate = operator.at_rate(rate)
            mine = OperatorInTime(at_rate, lambda _, by=ratio: by, RESPONSE).position(t, np.append(u, u[0]))[:-1]
            others = [network.predict(*settled_inputs(u, rate if several else None)) for network in networks]
            one = [(rms(p - truth, span)[0], 100.0 * abs(float(np.ptp(p)) / span - 1.0)) for p in (mine, *others)]
            rows.append((one[0], np.median(one[1:], axis=0)))
        ours[name], theirs[name] = (np.max([row[k] for row in rows], axis=0) for k in (0, 1))
    return ours, theirs


def simulated() -> list[str]:
    """Rows of simulated piezos: the worst scan of each kind."""
    rows = [f"| piezo | traces | model | {' | '.join(SCANS)} | CPU |", "|---" * (len(SCANS) + 4) + "|"]
    for name, plant in PLANTS.items():
        for traces, protocol in TRACES.items():
            for model, result in zip(("operator", "network"), compared(plant, protocol), strict=True):
                cells = [f"{result[kind][0]:.2f}, {result[kind][1]:.2f}" for kind in SCANS]
                rows.append(f"| {name} | {traces} | {model} | {' | '.join(cells)} | {result['s']:.1f} s |")
                print(rows[-1], flush=True)
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help=f"put the tables into {PAGE.name}")
    parser.add_argument("--stage", type=Path, help="folder with the records of the real stage")
    given = parser.parse_args()
    parts = {"network, stage": stage(given.stage)} if given.stage else {}
    print("\n".join(parts.get("network, stage", [])), flush=True)
    parts["network, simulated"] = simulated()
    for mark, rows in parts.items():
        if given.write:
            marked = re.compile(rf"(?<=<!-- {mark} -->\n).*?(?=<!-- /{mark} -->)", re.DOTALL)
            PAGE.write_text(
                marked.sub(lambda _, rows=rows: "\n".join(rows) + "\n", PAGE.read_text("utf-8"), 1), "utf-8"
            )


if __name__ == "__main__":
    main()
