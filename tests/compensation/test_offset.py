"""Offset voltage, equations (1)-(4), and the position that an offset gives."""

import mpmath as mp
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tablegen.base.input_errors import Unphysical
from tablegen.compensation.offset import OffsetLaw, normalised_offset

laws = st.builds(OffsetLaw, st.floats(-0.3, 0.3), st.floats(-0.3, 0.3))


def test_coefficients_from_the_ends_are_equations_3_and_4() -> None:
    law = OffsetLaw.from_ends(0.92, 1.25)
    assert (law.alpha, law.beta) == (pytest.approx(0.165), pytest.approx(0.085))
    assert (law.factor(-1.0), law.factor(0.0), law.factor(1.0)) == (pytest.approx(0.92), 1.0, pytest.approx(1.25))


def test_p_is_equation_2() -> None:
    assert [normalised_offset(v, 100.0) for v in (0.0, 50.0, 93.0, 100.0)] == [-1.0, 0.0, pytest.approx(0.86), 1.0]


def test_the_papers_lattice_constants_are_fitted_where_they_were_measured() -> None:
    """17.7 nm at 50 V, 22.3 nm at 93 V and 16.3 nm at 7 V: the trap is to take 93 V and 7 V for the edges."""
    p = [normalised_offset(v, 100.0) for v in (50.0, 93.0, 7.0)]
    law = OffsetLaw.fit(p, [17.7, 22.3, 16.3])
    assert [law.factor(x) for x in p] == pytest.approx([1.0, 22.3 / 17.7, 16.3 / 17.7], rel=1e-12)
    taken_for_edges = OffsetLaw.from_ends(16.3 / 17.7, 22.3 / 17.7)
    assert law.factor(1.0) - taken_for_edges.factor(1.0) > 0.05


@given(laws, st.lists(st.floats(-1.0, 1.0), min_size=3, max_size=12), st.floats(1.0, 100.0))
def test_a_fit_of_exact_points_gives_the_law_back(law: OffsetLaw, p: list[float], size: float) -> None:
    p = sorted(round(x, 2) for x in p)
    if len(set(p)) < 3:
        p = [-0.8, *p, 0.1, 0.9]
    fitted = OffsetLaw.fit(p, [size * law.factor(x) for x in p])
    for x in (-1.0, -0.3, 0.4, 1.0):
        assert fitted.factor(x) == pytest.approx(law.factor(x), rel=1e-6)


def test_a_fit_of_many_points_is_least_squares() -> None:
    import numpy as np

    p = [-0.9, -0.5, 0.0, 0.3, 0.5, 0.86]
    y = [16.2, 16.9, 17.6, 18.9, 19.5, 22.4]
    quadratic, linear, constant = np.polyfit(p, y, 2)
    law = OffsetLaw.fit(p, y)
    assert (law.alpha, law.beta) == (pytest.approx(linear / constant), pytest.approx(quadratic / constant))


@pytest.mark.parametrize(
    ("p", "y", "why"),
    [
        ([0.1, 0.1, 0.5], [1.0, 1.0, 1.0], "2 different offsets"),
        ([0.0, 1e-4, 9e-4], [1.0, 1.1, 1.2], r"the offsets span 0\.00045 of v_max; at least 0\.0005"),
        ([0.0, 0.5, 1.0], [-1.0, 0.5, 3.0], "at the centre"),
        ([-1.0, 0.0, 1.0], [0.1, 1.0, -0.1], "falls to"),
    ],
)
def test_unusable_points_are_refused(p: list[float], y: list[float], why: str) -> None:
    with pytest.raises(Unphysical, match=why):
        OffsetLaw.fit(p, y)


def test_a_factor_that_reaches_zero_inside_the_range_is_refused() -> None:
    with pytest.raises(Unphysical, match=r"falls to -0\.5"):
        OffsetLaw(alpha=0.0, beta=-1.5)
    with pytest.raises(Unphysical, match="falls to"):
        OffsetLaw(alpha=2.2, beta=1.2)  # positive at both ends, negative at its vertex


@pytest.mark.common
@given(laws, st.floats(0.0, 100.0))
def test_position_is_the_integral_of_the_local_slope(law: OffsetLaw, v: float) -> None:
    mp.mp.dps = 20
    slope = mp.quad(lambda u: 10 / (1 + law.alpha * (2 * u / 100 - 1) + law.beta * (2 * u / 100 - 1) ** 2), [0, v])
    assert law.position_nm(v, 100.0, 10.0) == pytest.approx(float(slope), rel=1e-11, abs=1e-12)


@given(laws, st.floats(0.0, 1.0))
def test_voltage_is_the_inverse_of_position(law: OffsetLaw, share: float) -> None:
    position = share * law.position_nm(100.0, 100.0, 10.0)
    assert law.position_nm(law.voltage_at(position, 100.0, 10.0), 100.0, 10.0) == pytest.approx(position, abs=1e-9)


def test_a_position_out_of_reach_says_what_is_in_reach() -> None:
    with pytest.raises(Unphysical, match=r"1001 nm is outside the 0\.\.1000 nm"):
        OffsetLaw().voltage_at(1001.0, 100.0, 10.0)
