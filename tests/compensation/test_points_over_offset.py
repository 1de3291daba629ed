"""Hysteresis as measured at several offsets: `offset_v` of points."""

from pathlib import Path

import numpy as np
import pytest
from editing import SCAN, SCANNER, edited, write_pair
from hypothesis import given
from hypothesis import strategies as st

from tablegen.base.input_errors import Rejected, Unphysical
from tablegen.compensation.branch import Branch, ResidualLaw
from tablegen.compensation.points import OFFSET_REACH, HysteresisPoint
from tablegen.config.load import load
from tablegen.planning.drive import Drive
from tablegen.planning.line_plan import make_plan

V_MAX = 100.0
SETS = {30.0: ((20.0, 0.02, 0.4), (50.0, 0.05, 0.5)), 60.0: ((20.0, 0.04, 0.45), (50.0, 0.06, 0.55))}


def law_of(sets: dict[float, tuple[tuple[float, float, float], ...]]) -> ResidualLaw:
    points = [
        HysteresisPoint(size_v=v, beta=beta, u_peak=peak, offset_v=at)
        for at, rows in sets.items()
        for v, beta, peak in rows
    ]
    return ResidualLaw.of(Branch(points=points[::-1]), V_MAX)


@given(st.floats(0.0, 0.6), st.floats(20.0, 70.0))
def test_points_are_joined_over_size_and_offset(v: float, offset_v: float) -> None:
    """Against numpy's interpolation, one after the other; constant beyond the outer offsets."""
    by_size = [
        [np.interp(v * V_MAX, volts, values) for volts, values in (((0, 20, 50), (0, *b)), ((0, 20, 50), (u[0], *u)))]
        for _, b, u in (tuple(zip(*rows, strict=True)) for rows in SETS.values())
    ]
    expected = [np.interp(offset_v, [*SETS], [one[k] for one in by_size]) for k in (0, 1)]
    assert law_of(SETS).at(v, V_MAX, offset_v) == pytest.approx(expected, abs=1e-12)


def test_of_one_offset_they_are_as_those_without() -> None:
    without = ResidualLaw.of(
        Branch(points=[HysteresisPoint(size_v=v, beta=b, u_peak=u) for v, b, u in SETS[30.0]]), V_MAX
    )
    for v in (0.1, 0.3, 0.55):
        assert law_of({30.0: SETS[30.0]}).at(v, V_MAX, 35.0) == without.at(v, V_MAX, 35.0) == without.at(v, V_MAX, 90.0)


def test_where_large_scans_do_not_fit_small_ones_grow_as_those_of_the_middle() -> None:
    """At 85 V nothing above 25 V was measured: at 67.5 V, half way, a scan of 40 V takes its growth from 50 V."""
    sets = {50.0: ((25.0, 0.04, 0.40), (50.0, 0.06, 0.50)), 85.0: ((25.0, 0.06, 0.44),)}
    beta, peak = law_of(sets).at(0.4, V_MAX, 67.5)
    assert beta == pytest.approx(0.5 * 0.052 + 0.5 * 0.06 * 0.052 / 0.04)
    assert peak == pytest.approx(0.5 * 0.46 + 0.5 * (0.44 + 0.06))
    assert law_of(sets).at(0.25, V_MAX, 67.5) == pytest.approx((0.05, 0.42))
    law_of(sets).at(0.47, V_MAX, 67.5)  # half way from 50 to 25 V, and a tenth of v_max beyond
    with pytest.raises(Unphysical, match=r"measured up to 37\.5 V"):
        law_of(sets).at(0.48, V_MAX, 67.5)


@given(st.floats(1e-6, 0.2), st.booleans())
def test_no_scan_is_served_far_from_what_was_measured(beyond: float, above: bool) -> None:
    reach = V_MAX * (OFFSET_REACH + beyond)
    with pytest.raises(Unphysical, match="measured at offsets of 30 to 60 V, which serves 20 to 70 V"):
        law_of(SETS).at(0.1, V_MAX, 60.0 + reach if above else 30.0 - reach)


def drive_of(folder: Path, points: str, offset_v: float = 40.0) -> Drive:
    scan = edited(SCAN, "x.size_v = 20", "- x.size_nm", f"x.offset_v = {offset_v}")
    forward = f"x.hysteresis.branches.forward = {{ points = [{points}] }}"
    return make_plan(load(write_pair(folder, scan, edited(SCANNER, forward)))).x.drive


def test_a_build_takes_the_branch_at_its_offset(tmp_path: Path) -> None:
    points = (
        "{ size_v = 20, beta = 0.02, u_peak = 0.4, offset_v = 35 }, "
        "{ size_v = 20, beta = 0.03, u_peak = 0.5, offset_v = 55 }"
    )
    drive = drive_of(tmp_path, points)
    assert (drive.forward.beta, drive.forward.u_peak) == pytest.approx((0.0225, 0.425), abs=1e-12)
    with pytest.raises(Rejected, match=r"forward.points: measured at offsets of 35 to 55 V.* this scan is at 70 V"):
        drive_of(tmp_path, points, 70.0)


@pytest.mark.parametrize(
    ("points", "said"),
    [
        (
            "{ size_v = 20, beta = 0.02, u_peak = 0.4, offset_v = 50 }, { size_v = 30, beta = 0.03, u_peak = 0.4 }",
            r"points\[1\].offset_v: missing beside those of other points",
        ),
        (
            "{ size_v = 20, beta = 0.02, u_peak = 0.4, offset_v = 120 }",
            r"points\[0\].offset_v: 120 V is outside the driver's 0..100 V",
        ),
        (
            "{ size_v = 20, beta = 0.02, u_peak = 0.4, offset_v = 50 }, "
            "{ size_v = 20, beta = 0.03, u_peak = 0.4, offset_v = 50 }",
            r"points\[1\].size_v: 20 V is measured twice",
        ),
    ],
)
def test_points_that_cannot_be_are_refused(points: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(Rejected, match=said):
        drive_of(tmp_path, points)
