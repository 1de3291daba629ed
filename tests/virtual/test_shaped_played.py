"""What the virtual scanner, samples, the report and comparisons make of shaped codes."""

from pathlib import Path

import numpy as np
import pytest
from building import Variant, write_variant
from editing import run

from tablegen.api.samples import samples
from tablegen.config.load import load
from tablegen.planning.line_plan import Plan, make_plan
from tablegen.virtual.played import played

SMALL = {"x.size_nm": 20.0, "y.size_nm": 20.0, "timing.lines": 8, "limits": {}}


def scan(folder: Path, shaping: str) -> Path:
    return write_variant(folder, Variant({**SMALL, "dac.shaping": shaping}))


@pytest.fixture(scope="module")
def plan(tmp_path_factory: pytest.TempPathFactory) -> Plan:
    return make_plan(load(scan(tmp_path_factory.mktemp("plan"), "second")))


def test_a_whole_period_is_the_first_one(plan: Plan) -> None:
    drive, line = played(plan.x), plan.x
    assert np.array_equal(drive.codes, line.codes(0, 1250))
    assert np.array_equal(drive.codes, samples(plan, "x").codes)
    assert np.array_equal(samples(plan, "y", 3000, 4000).codes, plan.y.codes(3000, 4000))
    assert np.array_equal(drive.volts, line.converter.v_zero + line.converter.v_per_code * drive.codes)


def test_of_a_long_period_the_volts_are_those_of_the_mean(plan: Plan) -> None:
    """Single shaped codes that stand for many ticks would be noise that nobody plays."""
    line = plan.y
    thinned = played(line, 400)  # of 25 ticks each, which have a middle
    codes = line.codes(0, line.program.ticks).reshape(400, 25).mean(axis=1)
    mean = line.converter.v_zero + line.converter.v_per_code * codes
    assert np.max(np.abs(thinned.volts - mean)) < 0.5 * abs(line.converter.v_per_code)
    assert np.std(thinned.volts - mean) < 0.15 * abs(line.converter.v_per_code)


@pytest.mark.common
def test_the_report_and_a_comparison_say_it(tmp_path: Path) -> None:
    shaped, rounded = scan(tmp_path / "shaped", "second"), scan(tmp_path / "off", "off")
    page = tmp_path / "report.html"
    assert run("report", shaped, "-o", page).status == 0
    text = page.read_text("utf-8")
    for part in ("largest error of the position", "the same without shaping", "codes change on", "are shaped"):
        assert part in text
    assert run("report", rounded, "-o", page).status == 0
    for part in ("of the position", "without shaping"):
        assert part not in page.read_text("utf-8")
    outcome = run("compare", shaped, rounded)
    for part in ("dac.shaping", "order of shaping", "ticks on which the code changes"):
        assert part in outcome.out
