"""Previews at an angle: where the operator is not known, and what is worked out before one plays."""

from pathlib import Path
from unittest.mock import patch

import pytest
from turned_scans import turned_setup

from tablegen.planning import turned_preview as previews
from tablegen.planning.turned_plan import TurnedPlan, make_turned_plan

pytestmark = pytest.mark.common


@pytest.fixture(scope="module")
def plan(tmp_path_factory: pytest.TempPathFactory) -> TurnedPlan:
    """A small scan in the middle of the range, where all traces of its operators are."""
    return make_turned_plan(turned_setup(tmp_path_factory.mktemp("plan"), 30.0, size_nm=60.0))


def test_a_place_far_from_every_trace_has_no_preview(plan: TurnedPlan, tmp_path: Path) -> None:
    """0.4 of 100 V from 50 V: at 91 V a build refuses the scan, and at 89 V it does not."""
    near, far = (turned_setup(tmp_path, 30.0, f"x.offset_v = {volts}", size_nm=60.0) for volts in (89.0, 91.0))
    assert previews.turned_preview(near, plan) is not None
    assert previews.turned_preview(far, plan) is None
    with patch.object(previews, "CENTRE_REACH", 0.45):  # the control: nothing else refuses it
        assert previews.turned_preview(far, plan) is not None


def test_the_error_is_worked_out_when_it_is_asked_for(plan: TurnedPlan, tmp_path: Path) -> None:
    setup = turned_setup(tmp_path, 30.0, "x.offset_v = 60", size_nm=60.0)
    with patch.object(previews, "_played", wraps=previews._played) as played:
        preview = previews.turned_preview(setup, plan)
        assert preview is not None
        assert played.call_count == 2  # once an axis
        assert 0.0 < preview.x_error_percent == preview.x_error_percent < 2.0
        assert played.call_count == 3
