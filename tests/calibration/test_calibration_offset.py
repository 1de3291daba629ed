"""Offsets with the size law: apparent sizes are no drive factors where the size is not proportional to the drive."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tablegen.calibration.fit_checks import doubts
from tablegen.calibration.laws.offset import fit_offset
from tablegen.calibration.laws.offset_sizes import OffsetSizesFit, fit_offset_sizes
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


@pytest.mark.common
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


def test_several_sizes_are_fitted_one_by_one_and_doubted_one_by_one() -> None:
    """Whatever the order of the rows; what one size does not tell is said of that size."""
    size = SizeLaw.calibrated(10.0, V_MAX, 0.53, 200.0, 0.5)
    random = np.random.default_rng(4)
    rows = [
        (at, seen * (1.0 + noise * error), volts)
        for volts, noise, ends in ((50.0, 0.05, (0.9, 1.3)), (15.0, 1e-4, (0.94, 1.2)))
        for at, seen, error in zip(
            OFFSETS.tolist(),
            looks(OffsetLaw.from_ends(*ends), size, volts).tolist(),
            random.standard_normal(5),
            strict=True,
        )
    ]
    offset_v, apparent, size_v = (np.array(column) for column in zip(*rows, strict=True))
    fit = fit_offset_sizes(offset_v, apparent, size_v, V_MAX, size)
    assert isinstance(fit, OffsetSizesFit)
    assert [one.size_v for one in fit.sizes] == [15.0, 50.0]
    alone = fit_offset(offset_v[5:], apparent[5:], V_MAX, size, 15.0)
    assert (fit.sizes[0].m_minus, fit.sizes[0].m_plus) == (alone.m_minus, alone.m_plus)
    assert fit.residual_percent[5:].tolist() == alone.residual_percent.tolist()
    assert {doubt.split(":")[0] for doubt in doubts(fit)} == {"images of 50 V"}
    only = fit_offset_sizes(offset_v[5:], apparent[5:], size_v[5:], V_MAX, size)
    assert (only.points, type(only)) == (5, type(alone))
    near = fit_offset_sizes(offset_v, apparent, np.where(size_v > 20.0, 20.0, size_v), V_MAX, size)
    assert any("hardly show how m changes" in remark for remark in near.remarks)
