"""Fields between measured points, and creep against its definition."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tablegen.compensation.operator.creep import NO_CREEP, LogarithmicCreep
from tablegen.compensation.operator.field import Lengths, covariance, distinct, through

POINTS = np.array([(0.1, 0.5), (0.4, 0.5), (0.9, 0.5), (0.3, 0.7)])
LENGTHS = Lengths(0.8, 1.0, 1e-8)


def test_a_field_goes_through_what_was_measured() -> None:
    rows = np.random.default_rng(1).normal(size=(4, 3))
    field = through(POINTS, rows, LENGTHS)
    for point, row in zip(POINTS.tolist(), rows, strict=True):
        assert field.at(*point) == pytest.approx(row, abs=1e-4)


def test_smaller_lines_are_straighter_but_for_what_all_strokes_share() -> None:
    rows = np.stack([POINTS[:, 0], np.ones(4)], axis=1)
    field = through(POINTS, rows, LENGTHS, straight=True)
    for point, row in zip(POINTS.tolist(), rows, strict=True):
        assert field.at(*point) == pytest.approx(row, abs=1e-4)
    for centre in (0.3, 0.5, 0.7):
        assert field.at(0.0, centre) == pytest.approx([0.0, 1.0], abs=0.15)


def test_a_shape_is_that_of_the_same_stroke_at_another_centre() -> None:
    one = POINTS[:3]
    field = through(one, np.array([[0.1], [0.5], [0.7]]), Lengths(3.0, 2.0, 1e-9), straight=True)
    for stroke in (0.05, 0.3, 0.6):
        here, there = field.at(stroke, 0.5)[0], field.at(stroke, 0.85)[0]
        assert there == pytest.approx(here, rel=0.03)


def test_a_share_of_the_field_is_that_of_the_rate() -> None:
    points = np.array([(0.4, 0.5, 2.0), (0.4, 0.5, 3.0)])
    field = through(points, np.array([[1.0], [3.0]]), Lengths(0.8, 1.0, 1e-8, 0.1))
    at = [field.at_rate(rate_hz).at(0.4, 0.5)[0] for rate_hz in (100.0, 10.0**2.5, 1000.0)]
    assert at == pytest.approx([1.0, 2.0, 3.0], abs=0.02)
    alone = through(points[:1], np.array([[1.0]]), Lengths(0.8, 1.0, 1e-8, 0.1))
    assert alone.at_rate(1e8).at(0.4, 0.5)[0] == pytest.approx(0.9, abs=1e-3)
    everywhere = through(points, np.array([[1.0], [1.0]]), Lengths(0.8, 1.0, 1e-3))
    assert everywhere.at_rate(1e8) is everywhere


@pytest.mark.parametrize("straight", [False, True])
@pytest.mark.parametrize("rate_share", [0.0, 0.1])
def test_many_rows_have_every_bit_of_each(straight: bool, rate_share: float) -> None:
    """Strokes and centres that come twice too; the negative control: at another rate they are others."""
    random = np.random.default_rng(3)
    points = np.column_stack([POINTS, random.uniform(0.0, 3.0, len(POINTS))])
    field = through(points, random.normal(size=(4, 3)), Lengths(0.8, 0.7, 1e-8, rate_share), straight)
    strokes, centres = np.tile(random.uniform(0.0, 1.0, (2, 25)), 2)
    rows = field.at_rate(20.0).at_many(strokes, centres)
    each = [field.at_rate(20.0).at(*one) for one in zip(strokes.tolist(), centres.tolist(), strict=True)]
    assert rows.tobytes() == np.array(each).tobytes()
    assert np.array_equal(field.at_rate(200.0).at_many(strokes, centres), rows) == (rate_share == 0.0)


def test_far_from_all_points_a_field_is_nothing() -> None:
    assert through(POINTS, np.ones((4, 1)), Lengths(0.05, 0.05, 1e-6)).at(5.0, 5.0)[0] == pytest.approx(0.0, abs=1e-12)


@given(st.floats(0.2, 3.0), st.floats(0.2, 3.0))
def test_a_covariance_is_positive(stroke: float, centre: float) -> None:
    matrix = covariance(POINTS, POINTS, Lengths(stroke, centre, 1e-8))
    assert matrix == pytest.approx(matrix.T)
    assert float(np.min(np.linalg.eigvalsh(matrix))) > -1e-12


def test_centres_that_are_the_same() -> None:
    assert distinct([0.5, 0.51, 0.7, 0.499]) == [0.5, 0.7]


def test_creep_loses_its_share_a_decade() -> None:
    creep = LogarithmicCreep(0.03, 1e-5, 1e3, 1.0)
    f = np.array([0.1, 1.0, 10.0])
    real, imaginary = creep.response(f)
    size = np.hypot(real, imaginary)
    assert size[1] == pytest.approx(1.0)
    # 3 % of what moves at once, which is 1 / (1 + creep until then) of what moves at 1 Hz.
    assert (size[0] - size[1]) / (size[1] - size[2]) == pytest.approx(1.0, abs=0.02)
    assert size[0] - size[1] == pytest.approx(0.03 / (1.0 + 5.0 * 0.03), rel=0.05)
    assert np.all(imaginary < 0.0)


def test_without_creep_nothing_is_late() -> None:
    real, imaginary = NO_CREEP.response(np.array([1.0, 100.0]))
    assert real.tolist() == [1.0, 1.0]
    assert imaginary.tolist() == [0.0, 0.0]
