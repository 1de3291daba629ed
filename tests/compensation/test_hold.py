"""The inverse of the converter's hold, against the staircase itself."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tablegen.compensation.hold import hold_inverse


@given(st.integers(8, 200), st.data())
def test_samples_that_are_held_have_the_harmonics_that_were_wanted(advances: int, data: st.DataObject) -> None:
    """By integrals over each tick of the staircase, none of which knows a sinc."""
    harmonics = data.draw(st.integers(1, (advances - 1) // 2))
    generator = np.random.default_rng(data.draw(st.integers(0, 99)))
    wanted = generator.standard_normal(harmonics) + 1j * generator.standard_normal(harmonics)
    real, imaginary = hold_inverse(harmonics, advances, steps=False)
    played = wanted * (real + 1j * imaginary)
    n, k = np.arange(1, harmonics + 1), np.arange(advances)
    samples = 2.0 * np.real(np.exp(2j * np.pi * np.outer(k, n) / advances) @ played)
    edge = np.exp(-2j * np.pi * np.outer(n, np.arange(advances + 1)) / advances)
    held = (np.diff(edge, axis=1) / (-2j * np.pi * n[:, None])) @ samples
    assert held == pytest.approx(wanted, abs=1e-11 * advances)


def test_the_gain_is_bounded_and_half_a_tick_is_half_a_tick() -> None:
    for advances in (8, 9, 1000, 1001):
        harmonics = (advances - 1) // 2
        real, imaginary = hold_inverse(harmonics, advances, steps=False)
        assert 1.0 < np.hypot(real, imaginary).max() < np.pi / 2
        n = np.arange(1, harmonics + 1)
        assert np.arctan2(imaginary, real) == pytest.approx(np.pi * n / advances)


def test_a_row_of_an_axis_that_steps_is_at_its_code() -> None:
    """In the middle of the line that the code holds for, and no larger."""
    real, imaginary = hold_inverse(40, 200, steps=True)
    n = np.arange(1, 41)
    assert real + 1j * imaginary == pytest.approx(np.exp(1j * np.pi * n / 200))
