"""Offsets with the size law: apparent sizes are no drive factors where the size is not proportional to the drive."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tablegen.calibration.offset import fit_offset
from tablegen.compensation.offset import OffsetLaw, normalised_offset
from tablegen.compensation.size import SizeLaw
from tablegen.numerics.arrays import Floats

V_MAX = 120.0
OFFSETS = np.array([8.0, 30.0, 60.0, 90.0, 112.0])
factors = st.tuples(st.floats(0.8, 1.0), st.floats(1.0, 1.4))


def looks(law: OffsetLaw, size: SizeLaw, size_v: float) -> Floats:
    """A piezo that takes m times the drive for any size, seen with one that does not change: R(V) / R(V / m)."""
    m = [law.factor(normalised_offset(volts, V_MAX)) for volts in OFFSETS.tolist()]
    v = size_v / V_MAX
    return 17.7 * np.array([size.size_nm(v) / size.size_nm(v / one) for one in m])


@given(factors, st.floats(0.0, 1.5), st.floats(5.0, 80.0))
def test_factors_are_those_of_the_drive(ends: tuple[float, float], beta: float, size_v: float) -> None:
    size = SizeLaw.calibrated(10.0, V_MAX, beta, 200.0, 0.5)
    fit = fit_offset(OFFSETS, looks(OffsetLaw.from_ends(*ends), size, size_v), V_MAX, size, size_v)
    assert (fit.m_minus.value, fit.m_plus.value) == pytest.approx(ends, abs=1e-6)
    assert fit.centre_nm.value == pytest.approx(17.7)
    assert fit.largest_percent < 1e-4


def test_without_the_law_large_scans_mislead() -> None:
    """Negative control, with the numbers of the virtual scanner: 1.3 % too much at the end of the range."""
    size = SizeLaw.calibrated(10.0, V_MAX, 0.53, 200.0, 0.5)
    apparent = looks(OffsetLaw.from_ends(0.92, 1.25), size, 15.6)
    plain, exact = fit_offset(OFFSETS, apparent, V_MAX), fit_offset(OFFSETS, apparent, V_MAX, size, 15.6)
    assert exact.m_plus.value == pytest.approx(1.25, abs=1e-6)
    assert plain.m_plus.value == pytest.approx(1.013 * 1.25, abs=0.001)


def test_a_linear_scanner_needs_no_law() -> None:
    size = SizeLaw.calibrated(10.0, V_MAX, 0.0, 200.0, 0.5)
    apparent = looks(OffsetLaw.from_ends(0.9, 1.2), size, 40.0)
    plain, exact = fit_offset(OFFSETS, apparent, V_MAX), fit_offset(OFFSETS, apparent, V_MAX, size, 40.0)
    assert (plain.m_minus.value, plain.m_plus.value) == pytest.approx((exact.m_minus.value, exact.m_plus.value))
