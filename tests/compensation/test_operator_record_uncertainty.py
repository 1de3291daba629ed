"""How far an operator from records may be off: its misfit, and the distance to the sweeps that the records have."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from foreign_plants import ManyPlays
from hypothesis import given
from hypothesis import strategies as st
from operator_files import operator_file
from replacing import replace
from stepped_plants import random_triangle, recorded

from tablegen.calibration.laws.hysteresis import Trace
from tablegen.calibration.operator.file_of_fit import operator_file as file_of
from tablegen.calibration.operator.record_fit import fit_records
from tablegen.calibration.operator.time_record import time_record
from tablegen.compensation.identification import MeasuredLine
from tablegen.compensation.operator.family import Family
from tablegen.compensation.operator.file import operator_text, read_operator
from tablegen.compensation.operator.plays import NO_PLAYS
from tablegen.compensation.operator.record_uncertainty import possible_record_errors
from tablegen.compensation.operator.uncertainty import possible_errors

STRAIGHT = Family(NO_PLAYS).over(np.array([1000.0]))
UNITS = (3.0, 30.0, 8.0, 10.0)
NOTHING = (0.0, 0.0, 0.0, 0.0)


def lines(*strokes: float) -> list[MeasuredLine]:
    return [MeasuredLine("", stroke, 0.5, 100.0, NOTHING, NOTHING) for stroke in strokes]


def bound(
    misfit: float, stroke: float, units: tuple[float, ...] = UNITS, strokes: tuple[float, ...] = (0.94,)
) -> list[float]:
    return list(possible_record_errors(STRAIGHT, lines(*strokes), misfit, (stroke, 0.5), units))


def test_a_stroke_that_no_sweep_had_may_have_another_loop() -> None:
    """The records of one size do not show how the loop of another one is; those of several do."""
    known, far = bound(0.0, 0.94), bound(0.0, 0.4)
    assert far[0] > 5.0 * known[0]
    assert 0.7 * UNITS[0] < far[0] < 1.5 * UNITS[0]
    several = bound(0.0, 0.4, strokes=(0.94, 0.7, 0.5, 0.35, 0.2))
    assert several[0] < 0.2 * far[0]
    assert bound(0.0, 0.4, NOTHING)[0] < 0.2 * far[0], "without a loop there is none to become another one"


@given(st.floats(0.01, 3.0), st.floats(1.1, 10.0), st.floats(0.05, 0.94))
def test_it_grows_with_the_misfit_and_not_faster(misfit: float, times: float, stroke: float) -> None:
    one, other = np.array(bound(misfit, stroke)), np.array(bound(times * misfit, stroke))
    assert np.all(other > one)
    assert np.all(other <= times * one * (1.0 + 1e-12))


def test_a_misfit_in_nm_is_a_larger_share_of_smaller_lines() -> None:
    strokes = (0.94, 0.6, 0.3, 0.1)
    at = [bound(0.3, stroke, NOTHING, strokes) for stroke in strokes]
    assert all(np.all(np.array(small) > np.array(large)) for large, small in pairwise(at))
    assert at[3][3] == pytest.approx(at[0][3] * 0.94 / 0.1, rel=1e-9)
    nearly_nothing = bound(0.3, 1e-9, NOTHING, strokes)
    assert np.all(np.isfinite(nearly_nothing))


def test_the_misfit_alone_tells_records_from_settled_lines(tmp_path: Path) -> None:
    """An operator of settled lines has none: it goes by the traces that were left out, as before."""
    path = tmp_path / "x.toml"
    path.write_text(operator_text(operator_file(), []), "utf-8")
    operator, _ = read_operator(path, "x.toml")
    assert operator.misfit_percent is None
    assert "misfit" not in path.read_text("utf-8")
    settled = possible_errors(operator, 0.3, 0.5)
    assert possible_errors(replace(operator, misfit_percent=2.0), 0.3, 0.5)[0] > 10.0 * settled[0]


@pytest.mark.common
def test_the_file_of_records_keeps_the_figures(tmp_path: Path) -> None:
    u = random_triangle(3)
    time = np.linspace(0.0, 0.25, len(u))
    record = time_record(Trace("a.csv", time, 100.0 * u, recorded(ManyPlays(count=60), u, time)), 100.0)
    fit = fit_records([record], None, lambda _: 1.0, 0.0)
    path = tmp_path / "x.toml"
    path.write_bytes(file_of(fit, "x", 100.0))
    again, _ = read_operator(path, "x.toml")
    assert again.misfit_percent == pytest.approx(fit.operator.misfit_percent, rel=1e-8)
    assert possible_errors(again, 0.3, 0.45) == pytest.approx(possible_errors(fit.operator, 0.3, 0.45), rel=1e-6)
