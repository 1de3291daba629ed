"""The least bound of linear maps against a linear programme solved by scipy."""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.optimize import linprog

from tablegen.numerics.arrays import Floats, folded_sum
from tablegen.numerics.interior_point import BoundConstraint, least_bound


@dataclass
class Dense:
    """A map by its matrix."""

    matrix: Floats

    def times(self, y: Floats) -> Floats:
        return self.matrix @ y

    def transposed(self, z: Floats) -> Floats:
        return self.matrix.T @ z

    def gram(self, diagonal: Floats) -> Floats:
        return (self.matrix.T * diagonal) @ self.matrix


def programme(parts: list[BoundConstraint], size: int) -> float:
    """The least v by HiGHS."""
    left, right = [], []
    for part in parts:
        assert isinstance(part.rows, Dense)
        for sign in (1.0, -1.0):
            left.append(np.hstack([sign * part.rows.matrix, np.full((len(part.target), 1), -part.share)]))
            right.append(part.fixed + sign * part.target)
    objective = np.append(np.zeros(size), 1.0)
    return float(linprog(objective, np.vstack(left), np.concatenate(right), bounds=(None, None), method="highs").fun)


def random_parts(seed: int, size: int = 7) -> list[BoundConstraint]:
    """Three parts of random rows; ``inside(seed)`` keeps the fixed one."""
    random = np.random.default_rng(seed)
    solution = random.standard_normal(size)
    fixed = random.standard_normal((12, size))
    shared = random.standard_normal((40, size))
    return [
        BoundConstraint(Dense(shared), random.standard_normal(40), 0.0, 1.0),
        BoundConstraint(Dense(fixed), fixed @ solution + random.uniform(-0.5, 0.5, 12), 0.6, 0.0),
        BoundConstraint(Dense(random.standard_normal((5, size))), random.standard_normal(5), 0.3, 2.0),
    ]


def inside(seed: int, size: int = 7) -> Floats:
    """Unknowns that keep the fixed part."""
    return np.random.default_rng(seed).standard_normal(size)


@pytest.mark.parametrize("seed", range(12))
def test_the_bound_is_the_optimum_of_the_linear_programme(seed: int) -> None:
    """From a start that is outside, and as near to the optimum as was asked."""
    parts = random_parts(seed)
    least = programme(parts, 7)
    for gap in (0.02, 1e-6):
        found = least_bound(parts, np.zeros(7), gap)
        assert found.settled
        assert least - 1e-6 <= found.bound <= least * (1.0 + gap) + 1e-6
        for part in parts:
            assert float(np.max(np.abs(part.rows.times(found.y) - part.target))) <= (
                part.fixed + part.share * found.bound
            ) * (1.0 + 1e-8)


def test_it_ends_early_where_enough_is_reached() -> None:
    parts = random_parts(3)
    least = programme(parts, 7)
    found = least_bound(parts, inside(3), 1e-9, lambda bound: bound < 1.5 * least)
    assert found.settled
    assert 1.01 * least < found.bound < 1.5 * least
    assert found.steps < least_bound(parts, inside(3), 1e-9).steps


def test_what_contradicts_itself_is_not_called_settled() -> None:
    one = Dense(np.array([[1.0]]))
    parts = [
        BoundConstraint(one, np.zeros(1), 0.0, 1.0),
        BoundConstraint(one, np.array([5.0]), 1.0, 0.0),
        BoundConstraint(one, -np.ones(1), 1.0, 0.0),
    ]
    assert not least_bound(parts, np.zeros(1), 0.02).settled


@pytest.mark.parametrize("count", [1, 2, 3, 7, 64, 1001])
def test_folded_sums_are_sums(count: int) -> None:
    values = np.random.default_rng(count).standard_normal((3, count))
    assert folded_sum(values.copy()) == pytest.approx(values.sum(axis=1), abs=1e-12)
