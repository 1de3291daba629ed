"""One round of refining a scan that was built on an operator: what is left then, on piezos of four families."""

from pathlib import Path

import pytest
from foreign_plants import BoucWen, ForeignPlant, ManyPlays
from operator_scans import Played, fitted, foreign_traces, scan_on, virtual_traces
from refining import learnt, play, scanner

pytestmark = pytest.mark.common

PIEZOS = {
    "many plays": lambda: Played(ForeignPlant(ManyPlays())),
    "Bouc-Wen": lambda: Played(ForeignPlant(BoucWen())),
    "default": lambda: scanner("default").x,
    "duhem": lambda: scanner("duhem").x,
}


@pytest.mark.parametrize(
    ("name", "offset_v"),
    [("Bouc-Wen", 70.0), *(pytest.param(name, 50.0, marks=pytest.mark.rest) for name in PIEZOS)],
)
def test_one_round_leaves_at_most_0_03_percent(name: str, offset_v: float, tmp_path: Path) -> None:
    """Sizes are between those of the traces; the sensor of the running scan has 0.2 % of noise, ten periods."""
    axis = PIEZOS[name]()
    traces = foreign_traces(axis._plant) if isinstance(axis, Played) else virtual_traces(axis)
    setup = scan_on(tmp_path, fitted(traces), 350.0, offset_v, "- [x.offset]")
    before = play(setup, "x", axis)
    after = play(learnt(before, axis, 3).setup, "x", axis)
    assert after.true.rms_percent <= 0.03
    assert after.true.rms_percent < max(before.true.rms_percent, 0.01)
    assert max(after.true.scaling_percent.values()) < 1.5
    print(
        name,
        offset_v,
        before.true.rms_percent,
        after.true.rms_percent,
        max(before.true.scaling_percent.values()),
        max(after.true.scaling_percent.values()),
    )
