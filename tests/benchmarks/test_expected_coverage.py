"""`benchmarks/expected_coverage.py`: what it counts as covered."""

import expected_coverage as coverage
import pytest
from foreign_plants import TEN
from reach import Judged

from tablegen.compensation.expectation import Expectation, Figure


def judged(rms: float, size: float) -> Judged:
    """A scan with 0.05 + 0.05 % of rms expected, and a size right within 0.4 %."""
    sides = {"forward": Figure(0.01, 0.02), "backward": Figure(0.05, 0.05)}
    left = {"rms": rms, "scaling": 1.0, "mismatch": 0.1, "size": size}
    expected = Expectation("traces", sides, sides, Figure(0.1, 0.1), Figure(0.0, 0.4))
    return Judged(0.5, 0.5, 100.0, left, left, left, expected)


def test_a_scan_is_covered_below_the_most_that_either_side_expects() -> None:
    scans = [judged(0.05, -0.2), judged(0.099, 0.5), judged(0.11, 0.1)]
    assert coverage.shares_of(scans, "rms") == pytest.approx([0.5, 0.99, 1.1])
    assert coverage.shares_of(scans, "size") == pytest.approx([0.5, 1.25, 0.25])
    assert "| 67 % / 0.99 | 0 % / " in coverage.row("a piezo", "ten traces", scans)


def test_no_piezo_is_among_both() -> None:
    assert not {*coverage.FITTED} & {*coverage.ASIDE}
    assert not [one for one in coverage.ASIDE.values() if one in coverage.FITTED.values()]
    assert coverage.PROTOCOLS["ten traces"] == TEN
