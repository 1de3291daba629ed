"""`benchmarks/expected_of_records.py`: what it counts as covered, and that piezos kept aside are."""

import expected_of_records as coverage
import numpy as np
import pytest
from replacing import replace

from tablegen.compensation.operator.uncertainty import possible_errors


def test_a_line_is_covered_below_its_uncertainty() -> None:
    bound = np.array([0.2, 4.0, 0.5, 1.0])
    lines = [coverage.Judged("", by * bound * (1.0, 1.0, 1.0, -1.0), bound) for by in (0.3, 0.6, 1.1)]
    assert lines[2].shares == pytest.approx([1.1] * 4)
    assert coverage.row("a piezo", lines) == "| a piezo | 67 % / 0.60 | 67 % / 0.60 | 67 % / 0.60 | 67 % / 0.60 |"


def test_no_piezo_is_among_both() -> None:
    assert not {*coverage.FITTED} & {*coverage.ASIDE}
    assert not [one for one in coverage.ASIDE.values() if one in coverage.FITTED.values()]


@pytest.mark.common
def test_the_figures_of_records_hold() -> None:
    """The rule of settled lines, the control, is several times too wide for sizes one after the other."""
    core = coverage.ASIDE["plays, others"]
    operator = coverage.operator_of(core, "five sizes")
    judged = [*coverage.lines(core, "five sizes", operator, 1, 12)]
    shares = np.array([one.shares for one in judged])
    assert np.mean(shares <= 1.0) > 0.8
    scaling = float(np.median(shares[:, 1]))
    assert 0.3 < scaling < 0.9
    old = replace(operator, misfit_percent=None)
    assert possible_errors(old, 0.3, 0.5)[1] > 3.0 * possible_errors(operator, 0.3, 0.5)[1]


@pytest.mark.long
def test_piezos_that_were_kept_aside_are_covered_as_often_as_it_says() -> None:
    judged = [
        one
        for seed, core in enumerate(coverage.ASIDE.values(), 1)
        for one in coverage.judged_piezo(core, seed, 12, 0.001)
    ]
    shares = np.array([one.shares for one in judged])
    covered, median = np.mean(shares <= 1.0, axis=0), np.median(shares, axis=0)
    assert np.all(covered > 0.83)
    assert np.all(covered < 0.98)
    assert np.all(median > 0.3)
    assert np.all(median < 0.7)
