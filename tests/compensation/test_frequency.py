"""Loss with frequency, equation (23)."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tablegen.base.input_errors import Unphysical
from tablegen.compensation.frequency import frequency_gain


def test_three_percent_a_decade() -> None:
    assert frequency_gain(100.0, 0.03, 100.0) == 1.0
    assert frequency_gain(1000.0, 0.03, 100.0) == pytest.approx(1 / 0.97)
    assert frequency_gain(10.0, 0.03, 100.0) == pytest.approx(1 / 1.03)


def test_the_papers_frame_rates() -> None:
    """Figure 6: 0.5 to 7.3 frames a second, 17.7 nm appear as 18.3 nm."""
    assert frequency_gain(7.3, 0.03, 0.5) == pytest.approx(18.3 / 17.7, abs=0.003)


@given(st.floats(1e-3, 1e5), st.floats(0.0, 0.1))
def test_the_gain_restores_the_amplitude_of_23(rate: float, alpha: float) -> None:
    from math import log10

    remaining = 1.0 - alpha * log10(rate / 100.0)
    assert frequency_gain(rate, alpha, 100.0) * remaining == pytest.approx(1.0, rel=1e-13)


def test_a_law_that_leaves_too_little_is_refused() -> None:
    with pytest.raises(Unphysical, match=r"at 1e\+06 Hz equation \(23\) leaves 0\.4 of the amplitude"):
        frequency_gain(1e6, 0.3, 1e4)
