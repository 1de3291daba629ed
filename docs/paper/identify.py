"""Find the parameters of the default virtual scanner from the numbers that the paper prints.

    PYTHONPATH=docs python -m paper.identify > tablegen/virtual/default.toml

Displacement is linear in the coefficients of the hysteresis, creep included, so that one least squares with
coefficients >= 0 fits them to sizes and shapes of triangles at once. What the offset does beyond that is the
sensitivity's. Needs scipy.
"""

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise, product

import numpy as np
from scipy.optimize import nnls

from tablegen.compensation.hysteresis import BranchShape, beta_at
from tablegen.compensation.offset import OffsetLaw, normalised_offset
from tablegen.compensation.size import SizeLaw
from tablegen.numerics.arrays import Floats, FloatsLike
from tablegen.virtual.creep import logarithmic_creep
from tablegen.virtual.preisach import Preisach

DEGREE, REVERSIBLE, SENSITIVITY = 8, 2, 6  # degrees of the polynomials
TICKS = 2000  # ticks of a triangle
HALF = TICKS // 2
SIZES = (0.07, 0.13, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
OFFSETS_V = (7.0, 20.0, 35.0, 50.0, 65.0, 80.0, 93.0)
V_MAX = 100.0
OFFSET_SIZE = 0.13  # share of v_max, 200 nm in figure 2 of the paper
LOSS = 0.03
FASTEST_S, SLOWEST_S, PER_DECADE = 1e-6, 1e3, 2
# Normalised sizes at middles away from that of the range, at which one m(p) and one size law shall serve.
ELSEWHERE = (
    *product((0.05, 0.2, 0.4), (0.3, 0.4, 0.6, 0.7)),
    *product((0.03, 0.06, 0.1), (0.07, 0.15, 0.285, 0.5, 0.715, 0.85, 0.93)),
    *product((0.2, 0.24), (0.15, 0.2, 0.8, 0.85)),
)
# The largest loop is what the paper prints most of; the offset's curvature, which the sensitivity can take over, least.
SIZE_WEIGHT, LARGEST_WEIGHT, SMALLER_WEIGHT, OFFSET_WEIGHT, ELSEWHERE_WEIGHT = 20.0, 80.0, 10.0, 1.0, 7.0


@dataclass(frozen=True)
class Targets:
    """What a scanner shall measure like, at the rate at which its gain is 1."""

    size: SizeLaw
    offset: OffsetLaw
    rate_hz: float

    @staticmethod
    def shapes(v: float) -> tuple[BranchShape, BranchShape]:
        """Hysteresis at a normalised size: section 8 at full scale, (22) with figure 5k's parameters below."""
        forward, backward = (0.035, 0.085) if v == 1.0 else (beta_at(v, 0.037, 4.0), beta_at(v, 0.08, 1.5))
        return BranchShape.harmonic(forward, 0.37), BranchShape.harmonic(backward, 0.48)


@dataclass(frozen=True)
class Identified:
    """Coefficients of one axis."""

    hysteresis: Preisach
    sensitivity: tuple[float, ...]


def paper_targets(beta: float, at: Sequence[float], apparent: Sequence[float], rate_hz: float) -> Targets:
    """``apparent`` sizes, relative to the middle, at offsets ``at`` of (2); ``beta`` of (6), 10 nm/V at 200 nm."""
    return Targets(SizeLaw.calibrated(10.0, V_MAX, beta, 200.0, 0.5), OffsetLaw.fit([*at], [*apparent]), rate_hz)


# Figure 2: 17.7 nm at 50 V, +25 % at 93 V and -8 % at 7 V; the y axis as in the example's scanner file.
X_TARGETS = paper_targets(0.53, (-0.86, 0.0, 0.86), (0.92, 1.0, 1.25), 100.0)
Y_TARGETS = paper_targets(0.60, (-1.0, 0.0, 1.0), (0.90, 1.0, 1.22), 1.0)


# Settled displacement, shape (ticks, unknowns), of a triangle: its size and its middle as shares of v_max.
Triangles = Callable[[float, float], Floats]


class Equations:
    """Linear equations for the unknowns of an operator: what is printed, at a weight each."""

    def __init__(self, triangles: Triangles, targets: Targets, offset_weight: float) -> None:
        self._targets = targets
        self._rows: list[Floats] = []
        self._wanted: list[Floats] = []
        tau, sparse = np.arange(HALF) / HALF, slice(0, HALF, 10)
        for v in SIZES:
            relative = triangles(v, 0.5) / targets.size.size_nm(v)
            relative = relative - relative[0]
            self.add(relative[HALF : HALF + 1], np.ones(1), SIZE_WEIGHT)
            forward, backward = targets.shapes(v)
            weight = (LARGEST_WEIGHT if v == 1.0 else SMALLER_WEIGHT) / np.sqrt(HALF / 10)
            self.add(relative[:HALF][sparse], forward.inverse(tau)[sparse], weight)
            self.add(relative[HALF:][sparse], 1.0 - backward.inverse(tau)[sparse], weight)
        self._factors = np.array([targets.offset.factor(normalised_offset(volts, V_MAX)) for volts in OFFSETS_V])
        ends = [triangles(OFFSET_SIZE, volts / V_MAX)[[0, HALF]] for volts in OFFSETS_V]
        self._sizes = np.array([b - a for a, b in ends]) / targets.size.size_nm(OFFSET_SIZE)
        self.add(self._sizes * self._factors[:, None], np.ones(len(self._factors)), offset_weight)

    def add(self, row: Floats, value: Floats, weight: float) -> None:
        """``row`` times the unknowns shall be ``value``."""
        self._rows.append(weight * row)
        self._wanted.append(weight * value)

    def solved(self, least: FloatsLike = 0.0) -> Floats:
        """The unknowns, none below ``least``, in six digits."""
        rows, wanted = np.vstack(self._rows), np.concatenate(self._wanted)
        lowest = np.broadcast_to(np.asarray(least, dtype=np.float64), rows.shape[1])
        above, _ = nnls(rows, wanted - rows @ lowest, maxiter=20000)
        return np.array([float(f"{value:.6g}") for value in lowest + above])

    def sensitivity(self, found: Floats) -> tuple[float, ...]:
        """What the offset does beyond what the operator does with these unknowns."""
        middle = float(self._sizes[OFFSETS_V.index(50.0)] @ found)
        p = np.array([normalised_offset(volts, V_MAX) for volts in OFFSETS_V])
        missing = middle / (self._sizes @ found * self._factors) - 1.0
        powers = p[:, None] ** np.arange(1, SENSITIVITY + 1)
        return tuple(float(f"{value:.5g}") for value in np.linalg.lstsq(powers, missing, rcond=None)[0])


def identify(targets: Targets, elsewhere: Sequence[tuple[float, float]] = ELSEWHERE) -> Identified:
    """Fit hysteresis and sensitivity to the targets.

    ``elsewhere`` are the sizes and middles, shares of v_max, at which one m(p) shall serve: a choice, which nothing in
    the paper asks for. Without it the scanner is another one with the same printed numbers.
    """
    triangles = partial(_triangles, _units(), rate_hz=targets.rate_hz)
    equations = Equations(triangles, targets, OFFSET_WEIGHT)
    # A build asks for m times the drive, whatever the size: m of the offset's images has to serve the others.
    small = targets.size.size_nm(OFFSET_SIZE)
    for v, middle in elsewhere:
        m = targets.offset.factor(2.0 * middle - 1.0)
        if max(0.5 * m * v, 0.5 * m * OFFSET_SIZE) > min(middle, 1.0 - middle):
            continue
        at_v = np.diff(triangles(m * v, middle)[[0, HALF]], axis=0)
        at_small = np.diff(triangles(m * OFFSET_SIZE, middle)[[0, HALF]], axis=0)
        equations.add(at_v / targets.size.size_nm(v) - at_small / small, np.zeros(1), ELSEWHERE_WEIGHT)
    found = equations.solved()
    density = found[REVERSIBLE + 1 :]
    starts = np.cumsum([0, *range(DEGREE + 1, 0, -1)])
    return Identified(
        Preisach(
            tuple(map(float, found[: REVERSIBLE + 1])),
            tuple(tuple(map(float, density[a:b])) for a, b in pairwise(starts)),
        ),
        equations.sensitivity(found),
    )


def _units() -> list[Preisach]:
    """One operator for each coefficient."""
    places = [(i, j) for i in range(DEGREE + 1) for j in range(DEGREE + 1 - i)]
    rest = tuple(0.0 for _ in range(REVERSIBLE + 1))
    empty = [[0.0] * (DEGREE + 1 - i) for i in range(DEGREE + 1)]
    units = [Preisach(tuple(float(k == n) for k in range(REVERSIBLE + 1)), ()) for n in range(REVERSIBLE + 1)]
    for i, j in places:
        rows = [[*row] for row in empty]
        rows[i][j] = 1.0
        units.append(Preisach(rest, tuple(map(tuple, rows))))
    return units


def _triangles(units: list[Preisach], v: float, middle: float, rate_hz: float) -> Floats:
    """Settled displacement of every operator under a triangle, shape (ticks, operators), in nm."""
    low, high = middle - 0.5 * v, middle + 0.5 * v
    tau = np.arange(HALF) / HALF
    creep = logarithmic_creep(LOSS, rate_hz, FASTEST_S, SLOWEST_S, PER_DECADE)
    out = np.empty((TICKS, len(units)))
    for n, unit in enumerate(units):
        up = unit.branch(low + v * tau, np.full_like(tau, low))
        down = unit.branch(high, low) - unit.branch(np.full_like(tau, high), high - v * tau)
        out[:, n] = creep.settled(np.concatenate((up, down)), 1.0 / (rate_hz * TICKS))
    return out


def row_text(values: Sequence[float]) -> str:
    """An array of TOML."""
    return "[" + ", ".join(f"{value:g}" for value in values) + "]"


def _axis_text(axis: str, found: Identified, rate_hz: float) -> str:
    density = ",\n".join(f"    {row_text(row)}" for row in found.hysteresis.density)
    return f"""
[{axis}]
# Factor on the displacement, 1 + c1 p + c2 p^2 + ..., with p = 2 V / v_max - 1 of the mean voltage.
sensitivity = {row_text(found.sensitivity)}

[{axis}.hysteresis]
reversible_nm = {row_text(found.hysteresis.reversible)}
density_nm = [
{density},
]

[{axis}.creep]
loss_per_decade = {LOSS:g}
reference_hz = {rate_hz:g}
fastest_s = {FASTEST_S:g}
slowest_s = {SLOWEST_S:g}
terms_per_decade = {PER_DECADE}

[{axis}.resonance]
frequency_hz = 50e3
quality = 20
"""


def default_text() -> str:
    """The file of the default scanner."""
    head = f"""# The default virtual scanner: a simulation, identified from the numbers that the paper prints.
# docs/virtual.md says where each comes from; docs/paper/identify.py makes this file.
name = "virtual"
identified_on = "numbers that the paper prints"
v_max = {V_MAX:g}

[amplifier]
bandwidth_hz = 250e3
"""
    axes = (("x", X_TARGETS), ("y", Y_TARGETS))
    return head + "".join(_axis_text(axis, identify(targets), targets.rate_hz) for axis, targets in axes)


if __name__ == "__main__":
    sys.stdout.write(default_text())
