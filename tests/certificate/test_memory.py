"""What a certificate holds at most while it measures two hundred million ticks."""

import tracemalloc
from pathlib import Path

import pytest
from editing import SCAN, edited, write_pair

import tablegen

LONG_LINES = ("dac.bits = 24", "dac.update_rate_hz = 10e6", "timing.line_rate_hz = 10", "- [limits]")


@pytest.mark.common
def test_long_lines_are_measured_in_parts(tmp_path: Path) -> None:
    """A frame of 2e8 ticks and two million runs takes their starts and codes twice, and little beside those.

    With Python and numpy, some 45 MB, that leaves a process well below 200 MB.
    """
    plan = tablegen.plan(tablegen.load(write_pair(tmp_path, edited(SCAN, *LONG_LINES))))
    tracemalloc.start()
    try:
        certificates = tablegen.certify(plan)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert certificates["y"].ticks == 200_000_000
    assert peak < 80e6
