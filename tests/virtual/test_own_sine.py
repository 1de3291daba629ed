"""A sine on its own operator, stepped tick by tick, against the certificate of its pixels, which steps nothing."""

import numpy as np
import pytest
from foreign_plants import ForeignPlant, ManyPlays
from operator_files import operator_file
from replacing import replace
from sine_scans import response_csv, sine_scan, text_of

from tablegen.api.simulate import simulate
from tablegen.base.input_errors import Rejected
from tablegen.config.load import Setup
from tablegen.planning.line_plan import make_plan
from tablegen.virtual.own_run import own_piezo
from tablegen.virtual.pixel_line_error import pixel_line_error
from tablegen.virtual.simulation import run_on_each

pytestmark = pytest.mark.common


@pytest.fixture(scope="module")
def setup(tmp_path_factory: pytest.TempPathFactory) -> Setup:
    return sine_scan(
        tmp_path_factory.mktemp("sine"), text_of(operator_file("x")), response_csv(ForeignPlant(ManyPlays()), 150e3),
        "- x.band_limit.harmonics", "x.motion = 'sine'", "timing.line_rate_hz = 5e3", "dac.update_rate_hz = 2e6",
        "timing.pixels = 48", "timing.lines = 16", "y.band_limit.harmonics = 4",
    )  # fmt: skip


def test_pixels_on_the_operator_have_the_errors_of_their_certificate(setup: Setup) -> None:
    """The certificate has the position in harmonics; the codes of every tick move the piezo here."""
    plan = make_plan(setup, sines=True)
    schedule, certified, piezo = plan.schedule, plan.pixel_errors, own_piezo(plan.x)
    assert certified is not None
    assert schedule.pixel_table is not None
    assert piezo is not None
    assert plan.x.imaged is not None
    (run,) = run_on_each(plan.x, [piezo], pixels=schedule)
    for side in ("forward", "backward"):
        errors = getattr(run.imaged, side).residual
        assert np.max(np.abs(errors - certified.errors[side])) < 0.02 < 0.15 < np.max(np.abs(errors))
    assert abs(run.size_error_percent) < 0.02
    # Controls: a pixel that gives a tick to the next one, and pixels of equal length.
    counts = list(schedule.pixel_table[0])
    counts[20:22] = counts[20] - 1, counts[21] + 1
    moved = replace(schedule, pixel_table=(tuple(counts), schedule.pixel_table[1]))
    wrong = pixel_line_error(run.displacement_nm, moved, plan.x.imaged)
    assert np.argmax(np.abs(wrong.forward.residual - run.error.forward.residual)) in (20, 21)
    assert np.max(np.abs(wrong.forward.residual - run.error.forward.residual)) > 0.3
    equal = pixel_line_error(run.displacement_nm, replace(schedule, pixel_table=None), plan.x.imaged)
    assert np.max(np.abs(equal.forward.residual)) > 1.0


def test_simulate_plays_the_sine_beside_straight_lines(setup: Setup) -> None:
    simulated = simulate(setup)
    (run,) = simulated.own_runs
    rows = {row.correction: row for row in run.rows}
    mean, worst = rows["operator"].summary()["rms"]
    assert 0.05 < mean < worst < 0.3
    assert "the response is measured up to" in rows["uncompensated"].rejected
    assert "x     operator" in simulated.summary()
    assert [chart.title for chart in simulated.charts().brief] == ["x, operator: residual"]
    with pytest.raises(Rejected, match="a sine is simulated on the scanner file's own operator alone"):
        simulate(setup, "default")
