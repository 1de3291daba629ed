"""Times of ticks: the float nearest to the exact quotient, whatever the update rate."""

from fractions import Fraction

import numpy as np
import pytest
from building import EXAMPLE
from replacing import replace

import tablegen


@pytest.mark.parametrize("rate", [500e3, 123456.789, 1e9, 0.1 + 0.2, 333333.3333333333])
def test_ticks_have_the_nearest_time(rate: float) -> None:
    exact = Fraction(repr(rate))
    schedule = replace(tablegen.plan(EXAMPLE).schedule, update_rate_hz=exact)
    ticks = np.array([0, 1, 2, 3, 1249, 1 << 24, (1 << 31) - 1])
    assert schedule.seconds(ticks).tolist() == [float(k / exact) for k in ticks.tolist()]
    assert schedule.seconds(ticks[:0]).shape == (0,)
