"""Hysteresis against the scan size: (22), or as measured."""

from pathlib import Path

import numpy as np
import pytest
from editing import SCAN, SCANNER, edited, write_pair
from hypothesis import given
from hypothesis import strategies as st

from tablegen.base.input_errors import Rejected, Unphysical
from tablegen.compensation.branch import Branch, ResidualLaw
from tablegen.compensation.hysteresis import beta_at
from tablegen.compensation.points import SIZE_REACH, HysteresisPoint
from tablegen.config.load import load
from tablegen.planning.line_plan import make_plan

V_MAX = 120.0
rows = st.lists(
    st.tuples(st.integers(1, 120), st.floats(0.0, 0.2), st.floats(0.25, 0.75)),
    min_size=1,
    max_size=6,
    unique_by=lambda row: row[0],
)


def measured(points: list[tuple[int, float, float]]) -> ResidualLaw:
    found = [HysteresisPoint(size_v=float(v), beta=beta, u_peak=peak) for v, beta, peak in points]
    return ResidualLaw.of(Branch(points=found), V_MAX)


@pytest.mark.common
@given(rows, st.floats(0.0, 1.0))
def test_points_are_met_and_joined_by_lines(points: list[tuple[int, float, float]], share: float) -> None:
    """Against numpy's interpolation, in any order of the points."""
    law = measured(points)
    ascending = sorted(points)
    volts = [0.0, *(float(v) for v, _, _ in ascending)]
    betas = [0.0, *(beta for _, beta, _ in ascending)]
    peaks = [ascending[0][2], *(peak for _, _, peak in ascending)]
    v = share * (volts[-1] / V_MAX + SIZE_REACH)
    beta, peak = law.at(v, V_MAX)
    assert beta == pytest.approx(np.interp(v * V_MAX, volts, betas), abs=1e-12)
    assert peak == pytest.approx(np.interp(v * V_MAX, volts, peaks), abs=1e-12)
    for at, b, p in points:
        assert law.at(at / V_MAX, V_MAX) == pytest.approx((b, p), abs=1e-12)


@given(rows, st.floats(1e-6, 1.0))
def test_no_scan_is_served_that_nobody_measured(points: list[tuple[int, float, float]], beyond: float) -> None:
    largest = max(v for v, _, _ in points)
    with pytest.raises(Unphysical, match=f"measured up to {largest:g} V"):
        measured(points).at(largest / V_MAX + SIZE_REACH + beyond, V_MAX)


def test_without_points_it_is_the_equation() -> None:
    law = ResidualLaw.of(Branch(beta_max=0.08, rho=1.5, u_peak=0.48), V_MAX)
    for v in (0.0, 0.05, 0.4, 1.0):
        assert law.at(v, V_MAX) == (beta_at(v, 0.08, 1.5), 0.48)


def test_a_scan_between_two_points_and_two_turns(tmp_path: Path) -> None:
    """20 V: beta 0.02 and 0.04 at the two turns; a tenth of the way from one to the other."""
    low = "{ points = [{ size_v = 10, beta = 0.01, u_peak = 0.4 }, { size_v = 30, beta = 0.03, u_peak = 0.5 }] }"
    high = "{ points = [{ size_v = 20, beta = 0.04, u_peak = 0.55 }] }"
    scanner = edited(
        SCANNER,
        f"x.hysteresis.branches.forward = {low}",
        f"+ [[x.hysteresis.branches]]\nturn = 0.6\nforward = {high}\nbackward = {{ beta_max = 0.05, u_peak = 0.5 }}",
    )
    scan = edited(SCAN, "x.size_v = 20", "- x.size_nm", "x.turn = 0.51")
    drive = make_plan(load(write_pair(tmp_path, scan, scanner))).x.drive
    assert (drive.forward.beta, drive.forward.u_peak) == pytest.approx((0.022, 0.46), abs=1e-12)
    expected = beta_at(0.2, 0.08 + 0.1 * (0.05 - 0.08), 1.5)
    assert drive.backward.beta == pytest.approx(expected, abs=1e-12)


def test_points_on_the_curve_build_the_same_words(tmp_path: Path) -> None:
    """The same beta and u_peak, whichever way they are given."""
    beta = beta_at(0.2, 0.037, 4.0)
    points = f"{{ points = [{{ size_v = 20.0, beta = {beta!r}, u_peak = 0.37 }}] }}"
    scan = edited(SCAN, "x.size_v = 20.0", "- x.size_nm")
    plans = []
    for i, edits in enumerate(((), (f"x.hysteresis.branches.forward = {points}",))):
        (tmp_path / str(i)).mkdir()
        plans.append(make_plan(load(write_pair(tmp_path / str(i), scan, edited(SCANNER, *edits)))))
    assert np.array_equal(plans[0].x.program.words, plans[1].x.program.words)


@pytest.mark.parametrize(("volts", "served"), [(101.9, True), (102.1, False)])
def test_no_point_was_measured_beyond_the_driver(volts: float, served: bool, tmp_path: Path) -> None:
    """But for the error of a voltage, as calibrations allow it."""
    points = f"{{ points = [{{ size_v = {volts}, beta = 0.03, u_peak = 0.4 }}] }}"
    setup = load(write_pair(tmp_path, SCAN, edited(SCANNER, f"x.hysteresis.branches.backward = {points}")))
    if served:
        assert make_plan(setup).x.drive.backward.u_peak == 0.4
    else:
        with pytest.raises(Rejected, match=r"backward.points\[0\].size_v: 102.1 V is above v_max = 100 V"):
            make_plan(setup)
