"""Find the parameters of the virtual scanner with a Duhem operator from the numbers that the paper prints.

    PYTHONPATH=docs python -m paper.identify_duhem > tablegen/virtual/duhem.toml

With the rates given, displacement is linear in the coefficients, so that the least squares of ``identify`` serves. The
rates are those of the smallest error that a random search found among operators of which no branch can run backwards.
Needs scipy.
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from paper.identify import (
    FASTEST_S,
    HALF,
    LOSS,
    PER_DECADE,
    SLOWEST_S,
    TICKS,
    V_MAX,
    X_TARGETS,
    Y_TARGETS,
    Equations,
    Targets,
    row_text,
)
from tablegen.numerics.arrays import Floats
from tablegen.virtual.creep import logarithmic_creep
from tablegen.virtual.duhem import Duhem, Lag

REVERSIBLE, LAG = 4, 4  # degrees of the polynomials
RATES = ((7.0, 7.0), (18.0, 2.0))  # rise and fall of each lag, per full drive
OFFSET_WEIGHT = 2.0
RIDGE = 2e-5  # of a coefficient in nm: lags that cancel each other are not wanted
LEAST_NM = 8.0  # of a lag's coefficient, so that a loop opens wherever the drive turns


@dataclass(frozen=True)
class IdentifiedDuhem:
    """Coefficients of one axis."""

    hysteresis: Duhem
    sensitivity: tuple[float, ...]


def identify_duhem(targets: Targets, rates: Sequence[tuple[float, float]] = RATES) -> IdentifiedDuhem:
    """Fit hysteresis and sensitivity to the targets. Nothing is asked of other offsets than those of figure 2."""
    units = _units(rates)
    creep = logarithmic_creep(LOSS, targets.rate_hz, FASTEST_S, SLOWEST_S, PER_DECADE)

    def triangles(v: float, middle: float) -> Floats:
        low = middle - 0.5 * v
        tau = np.arange(HALF) / HALF
        drive = np.concatenate((low + v * tau, low + v * (1.0 - tau)))
        moved = [creep.settled(unit.settled(drive), 1.0 / (targets.rate_hz * TICKS)) for unit in units]
        return np.stack(moved, axis=1)

    equations = Equations(triangles, targets, OFFSET_WEIGHT)
    equations.add(np.eye(len(units)), np.zeros(len(units)), RIDGE)
    found = equations.solved([0.0] * (REVERSIBLE + 1) + [LEAST_NM] * (len(units) - REVERSIBLE - 1))
    lags = found[REVERSIBLE + 1 :].reshape(len(rates), 2, LAG + 1)
    hysteresis = Duhem(
        _floats(found[: REVERSIBLE + 1]),
        tuple(Lag(*rate, _floats(below), _floats(above)) for rate, (below, above) in zip(rates, lags, strict=True)),
    )
    return IdentifiedDuhem(hysteresis, equations.sensitivity(found))


class _Unit(Duhem):
    """An operator with one coefficient; alone it may run backwards."""

    def __post_init__(self) -> None:
        """Nothing to check."""


def _units(rates: Sequence[tuple[float, float]]) -> list[Duhem]:
    """One operator for each coefficient."""
    none, whole = (0.0,), np.eye(LAG + 1)
    units: list[Duhem] = [_Unit(_floats(row), ()) for row in np.eye(REVERSIBLE + 1)]
    for rate, above in product(rates, (False, True)):
        for row in whole:
            sides = (none, _floats(row)) if above else (_floats(row), none)
            units.append(_Unit(none, (Lag(*rate, *sides),)))
    return units


def _floats(values: Floats) -> tuple[float, ...]:
    return tuple(map(float, values))


def _axis_text(axis: str, found: IdentifiedDuhem, rate_hz: float) -> str:
    lags = "".join(
        f"""
[[{axis}.hysteresis.lags]]
rise = {lag.rise:g}
fall = {lag.fall:g}
below_nm = {row_text(lag.below)}
above_nm = {row_text(lag.above)}
"""
        for lag in found.hysteresis.lags
    )
    return f"""
[{axis}]
# Factor on the displacement, 1 + c1 p + c2 p^2 + ..., with p = 2 V / v_max - 1 of the mean voltage of the last seconds.
sensitivity = {row_text(found.sensitivity)}
sensitivity_memory_s = 20
dead_time_s = 2e-6

[{axis}.hysteresis]
family = "duhem"
reversible_nm = {row_text(found.hysteresis.reversible)}
{lags}
[{axis}.creep]
loss_per_decade = {LOSS:g}
reference_hz = {rate_hz:g}
fastest_s = {FASTEST_S:g}
slowest_s = {SLOWEST_S:g}
terms_per_decade = {PER_DECADE}

[{axis}.resonance]
frequency_hz = 50e3
quality = 14

[{axis}.second_resonance]
frequency_hz = 31e3
quality = 25
share = 0.05
"""


def duhem_text() -> str:
    """The file of the scanner."""
    head = f"""\
# A virtual scanner with a Duhem operator: a simulation, identified from the numbers that the paper prints.
# docs/virtual.md says where each comes from; docs/paper/identify_duhem.py makes this file.
name = "virtual, Duhem"
identified_on = "numbers that the paper prints"
v_max = {V_MAX:g}

[amplifier]
bandwidth_hz = 250e3
"""
    axes = (("x", X_TARGETS), ("y", Y_TARGETS))
    return head + "".join(_axis_text(axis, identify_duhem(targets), targets.rate_hz) for axis, targets in axes)


if __name__ == "__main__":
    sys.stdout.write(duhem_text())
