"""Bouc and Wen's equation settled, against the equation stepped; and the families that are mixed of it and plays."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from foreign_plants import BoucWen as Stepped
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace as replace_table
from operator_files import operator_file
from replacing import replace

from tablegen.base.input_errors import Rejected
from tablegen.compensation.operator.bouc_wen import POWER_BITS, BoucWen
from tablegen.compensation.operator.family import Family
from tablegen.compensation.operator.file import BoucWenTable, operator_text, read_operator
from tablegen.compensation.operator.plays import NO_PLAYS, Plays, bent
from tablegen.numerics.arrays import Floats

N = 83 / 64
LOOP = {"depth_nm": 500.0, "n": N, "beta": 4.0, "gamma": -1.5, "asymmetry": 0.25, "bend": [0.0, 0.0]}
MODEL = BoucWen(500.0, N, 4.0, -1.5, 0.25, (0.0, 0.0))
PLAYS = Family(Plays(np.array([0.05, 0.2]), np.array([[30.0, 60.0]]), np.array([900.0, 40.0]), np.zeros((1, 4))))


def stepped(model: BoucWen) -> Stepped:
    """The plant of the tests with these parameters: its h is that of the model, times a."""
    return Stepped(1.0, model.beta, model.gamma, model.n, model.depth / 1250.0, 2.0 * model.asymmetry, 0.0)


def period(low: float, stroke: float, count: int = 250) -> Floats:
    along = np.linspace(0.0, 1.0, count, endpoint=False)
    return low + stroke * np.concatenate([along, 1.0 - along])


@settings(max_examples=25, deadline=None)
@given(
    st.integers(64, 128),
    st.floats(0.5, 8.0),
    st.floats(-0.6, 0.6),
    st.floats(-0.5, 0.5),
    st.floats(0.0, 0.5),
    st.floats(0.02, 0.5),
)
def test_a_settled_line_is_that_of_the_stepped_equation(
    n: int, beta: float, gamma: float, asymmetry: float, low: float, stroke: float
) -> None:
    model = BoucWen(500.0, n / 64, beta, gamma * beta, asymmetry, (0.0, 0.0))
    u = period(low, stroke)
    half = len(u) // 2
    expected = stepped(model).settled(u) - 1250.0 * u
    found = np.concatenate(
        [model.branch(part, low, low + stroke, going) for part, going in ((u[:half], True), (u[half:], False))]
    )
    off = found - expected  # where a small loop lies depends on the last digits of its steps
    assert off - np.mean(off) == pytest.approx(0.0, abs=5e-4 * 500.0 * stroke)
    assert np.mean(off) == pytest.approx(0.0, abs=1e-2 * 500.0 * stroke)


def test_branches_meet_where_the_drive_turns() -> None:
    model = replace(MODEL, bend=(0.3, -0.2))
    for low, high in ((0.0, 1.0), (0.4, 0.43), (0.1, 0.9)):
        ends = np.array([low, high])
        rising, falling = (model.branch(ends, low, high, going) for going in (True, False))
        assert rising == pytest.approx(falling, abs=1e-9)


def test_a_bent_drive_is_the_drive() -> None:
    model, u = replace(MODEL, bend=(0.3, -0.2)), np.linspace(0.2, 0.7, 50)
    v = bent(u, 0.3, -0.2)
    assert model.branch(u, 0.2, 0.7, True) == pytest.approx(MODEL.branch(v, float(v[0]), float(v[-1]), True), abs=1e-9)


def test_powers_are_products_of_roots() -> None:
    """n next to a multiple of the step is that multiple: the file's digits do not matter."""
    near = replace(MODEL, n=N + 0.3 / (1 << POWER_BITS))
    u = np.linspace(0.1, 0.9, 9)
    assert np.array_equal(near.branch(u, 0.1, 0.9, True), MODEL.branch(u, 0.1, 0.9, True))
    h, slope = MODEL._rising._arrays
    side = h > 0.0
    assert slope[side] * 64 == pytest.approx(1.0 - (-1.5 + 4.0 * 1.25) * h[side] ** N, abs=1e-12)


@pytest.mark.parametrize("share", [0.25, 0.75])
def test_a_mixture_is_the_weighted_sum(share: float) -> None:
    loop = Family(NO_PLAYS, MODEL).over(np.array([1100.0]))
    u = np.linspace(0.2, 0.8, 33)
    for mixed in (PLAYS.weighted(share, loop), loop.weighted(1.0 - share, PLAYS)):
        for going in (True, False):
            one, other = (family.branch(u, 0.2, 0.8, going) for family in (PLAYS, loop))
            assert mixed.branch(u, 0.2, 0.8, going) == pytest.approx(share * one + (1.0 - share) * other, abs=1e-9)
        assert mixed.extent(0.6, 0.5) == pytest.approx(
            share * PLAYS.extent(0.6, 0.5) + (1.0 - share) * loop.extent(0.6, 0.5)
        )


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"bend": [0.9, -0.6]}, "bouc_wen.bend: |l| + |s| / 2 above 1 would let the bent drive run backwards"),
        ({"n": 0.5}, "bouc_wen.n"),
        ({"asymmetry": 1.0}, "bouc_wen.asymmetry"),
        ({"depth_nm": -1.0}, "bouc_wen.depth_nm"),
    ],
)
def test_a_file_is_refused_at_the_line_of_its_fault(change: dict[str, Any], said: str, tmp_path: Path) -> None:
    table = BoucWenTable(**{**LOOP, **change})
    text = operator_text(replace_table(operator_file(), bouc_wen=table), [])
    (tmp_path / "x.toml").write_text(text, "utf-8")
    with pytest.raises(Rejected) as refused:
        read_operator(tmp_path / "x.toml", "x.toml")
    (problem,) = refused.value.problems
    assert said in str(problem)
    assert text.splitlines()[problem.line - 1].startswith(next(iter(change)))


def test_a_file_holds_the_equation(tmp_path: Path) -> None:
    file = replace_table(operator_file(), bouc_wen=BoucWenTable(**LOOP))
    (tmp_path / "x.toml").write_text(operator_text(file, []), "utf-8")
    found = read_operator(tmp_path / "x.toml", "x.toml")[0].family.bouc_wen
    assert found is not None
    u = np.linspace(0.2, 0.8, 9)
    assert np.array_equal(found.branch(u, 0.2, 0.8, True), MODEL.branch(u, 0.2, 0.8, True))
