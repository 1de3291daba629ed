"""`benchmarks/reach.py`, which measures docs/operator.md: its way from simulated traces to a judged scan."""

from pathlib import Path

import pytest
import reach


@pytest.mark.rest
def test_a_plant_is_calibrated_on_what_init_writes_and_its_scan_is_judged(tmp_path: Path) -> None:
    plant = reach.PLANTS["Bouc-Wen"][0]
    judged = reach.judge(reach.calibrated(plant, tmp_path, reach.SIX), plant, 0.5, 0.6, 100.0)
    assert judged.left["rms"] < 0.05
    assert judged.unrounded["scaling"] < judged.left["scaling"] < 3.0
    assert judged.expected is not None
    assert judged.expected.basis == "traces"
