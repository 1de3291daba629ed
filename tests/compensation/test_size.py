"""Scan size, equations (5)-(12)."""

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from tablegen.base.input_errors import Unphysical
from tablegen.compensation.size import SizeLaw

laws = st.builds(
    SizeLaw.calibrated,
    k_nm_per_v=st.floats(0.1, 1000.0),
    v_max=st.just(100.0),
    beta=st.floats(-0.49, 5.0),
    base_nm=st.floats(0.1, 10.0),
    v_threshold=st.floats(0.05, 1.0),
)


@pytest.mark.parametrize(("beta", "printed"), [(0.5, 436.4), (1.0, 466.7)])
def test_the_papers_uncorrected_400_nm(beta: float, printed: float) -> None:
    """Asked for twice the base size by a linear law, the scanner goes further. 9 % and 17 % in the paper."""
    law = SizeLaw.calibrated(k_nm_per_v=10.0, v_max=100.0, beta=beta, base_nm=200.0, v_threshold=0.5)
    linear = 400.0 / (10.0 * 100.0)
    assert law.size_nm(linear) == pytest.approx(printed, abs=0.05)


def test_k_is_per_full_scale_in_equation_8() -> None:
    """The trap: with k in nm/V instead, alpha is off by V_max and the base size is missed."""
    law = SizeLaw.calibrated(k_nm_per_v=10.0, v_max=100.0, beta=0.5, base_nm=200.0, v_threshold=0.5)
    assert law.alpha_nm == pytest.approx(1000.0 / 1.1)
    assert law.size_nm(0.2) == pytest.approx(200.0)
    trap = 10.0 / (1.0 + 0.5 * 200.0 / 10.0)
    assert law.alpha_nm / trap == pytest.approx(1000.0)


def test_the_law_of_the_paper_reads_390_nm_as_8_percent_too_much() -> None:
    """Figure 3a, b: calibrated at 200 nm, imaged at 390 nm, the lattice of 17.7 nm appears as 16.4 nm."""
    law = SizeLaw.calibrated(k_nm_per_v=10.0, v_max=100.0, beta=0.53, base_nm=200.0, v_threshold=0.5)
    assert law.size_nm(0.39) / 390.0 == pytest.approx(17.7 / 16.4, abs=0.02)


@pytest.mark.common
@example(SizeLaw(99.00990099009901, 1.0, 0.25), 1.0)  # comes back a last place above full scale
@given(laws, st.floats(1e-6, 1.0))
def test_the_inverse_is_exact_on_both_branches(law: SizeLaw, v: float) -> None:
    assert law.voltage(law.size_nm(v)) == pytest.approx(v, rel=1e-12)


@given(laws)
def test_value_and_slope_are_continuous_at_the_threshold(law: SizeLaw) -> None:
    v, h = law.v_threshold, 1e-6
    if v + h > 1.0:
        return
    below, at, above = law.size_nm(v - h), law.size_nm(v), law.size_nm(v + h)
    assert above - at == pytest.approx(at - below, rel=1e-4)
    assert law.voltage(at) == pytest.approx(v, rel=1e-12)


@given(st.floats(0.1, 1000.0), st.floats(1e-6, 1.0))
def test_beta_zero_is_the_linear_scanner(k: float, v: float) -> None:
    law = SizeLaw.calibrated(k_nm_per_v=k, v_max=100.0, beta=0.0, base_nm=1.0, v_threshold=0.5)
    assert law.size_nm(v) == pytest.approx(k * 100.0 * v, rel=1e-14)
    assert law.voltage(k * 100.0 * v) == pytest.approx(v, rel=1e-14)


def test_a_tiny_beta_meets_the_linear_law() -> None:
    """Equation (9) as printed loses every digit here; multiplied out it does not."""
    law = SizeLaw.calibrated(k_nm_per_v=10.0, v_max=100.0, beta=1e-15, base_nm=200.0, v_threshold=0.5)
    assert law.voltage(123.0) == pytest.approx(0.123, rel=1e-13)


@given(laws)
def test_the_base_size_is_met(law: SizeLaw) -> None:
    assert law.size_nm(law.voltage(0.05)) == pytest.approx(0.05, rel=1e-12)


def test_a_base_size_beyond_the_threshold_is_met_too() -> None:
    law = SizeLaw.calibrated(k_nm_per_v=10.0, v_max=100.0, beta=0.5, base_nm=700.0, v_threshold=0.3)
    assert law.size_nm(0.7) == pytest.approx(700.0)


def test_equation_10_and_12_as_printed() -> None:
    law = SizeLaw(alpha_nm=900.0, beta=0.53, v_threshold=0.5)
    v = 0.8
    assert law.size_nm(v) == pytest.approx(900.0 * ((1 + 2 * 0.53 * 0.5) * v - 0.53 * 0.25))
    assert law.voltage(800.0) == pytest.approx((800.0 + 900.0 * 0.53 * 0.25) / (900.0 * (1 + 2 * 0.53 * 0.5)))


def test_a_size_beyond_reach_says_what_fits() -> None:
    law = SizeLaw.calibrated(k_nm_per_v=10.0, v_max=100.0, beta=0.53, base_nm=200.0, v_threshold=0.5)
    reach = law.size_nm(1.0)
    with pytest.raises(Unphysical, match=rf"at most {reach:.6g} nm fit") as caught:
        law.voltage(reach * 1.2)
    assert "1.18" in str(caught.value)  # on the linear part 20 % more size is 18 % more voltage
    assert law.voltage(reach) == pytest.approx(1.0)


def test_a_base_size_beyond_reach_is_refused() -> None:
    with pytest.raises(Unphysical, match=r"calibrate at 1000 nm or less"):
        SizeLaw.calibrated(k_nm_per_v=10.0, v_max=100.0, beta=0.5, base_nm=1100.0, v_threshold=0.5)
