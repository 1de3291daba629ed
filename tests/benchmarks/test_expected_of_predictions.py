"""`benchmarks/expected_of_predictions.py`: what it counts as covered, and how often the uncertainty holds."""

import expected_of_predictions as coverage
import numpy as np
import pytest
from expected_of_records import ASIDE, operator_of


def test_a_record_is_covered_below_its_uncertainty() -> None:
    some = [coverage.Judged("", share) for share in (0.3, 0.6, 1.1)]
    assert coverage.row("a piezo", some) == "| a piezo | 3 | 67 % | 0.60 |"


@pytest.mark.rest
def test_predictions_of_a_piezo_that_was_kept_aside_hold() -> None:
    core = ASIDE["Bouc-Wen, skewed"]
    some = [*coverage.judged(core, operator_of(core, "random sweeps"), None, 1)]
    shares = np.array([one.share for one in some])
    assert {one.drive for one in some} == {*coverage.PREDICTED}
    assert np.mean(shares <= 1.0) > 0.6
    assert 0.2 < np.median(shares) < 1.0
