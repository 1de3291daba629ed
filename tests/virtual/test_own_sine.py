"""A sine on its own operator, stepped tick by tick, against the certificate of its pixels, which steps nothing.

And what else takes a sine: frames and traces of the laboratory, tables, a layer of y; and what refuses it, and why.
"""

from pathlib import Path

import numpy as np
import pytest
from foreign_plants import ForeignPlant, ManyPlays
from operator_files import operator_file
from replacing import replace
from sine_scans import response_csv, short_sine, sine_scan, text_of

import tablegen
from tablegen.api.simulate import simulate
from tablegen.base.input_errors import Rejected
from tablegen.config.load import Setup
from tablegen.device.schedule import Schedule
from tablegen.html_report.planned_scan import planned_scan
from tablegen.html_report.playing import played_axes
from tablegen.html_report.table_rows import AxisTables
from tablegen.numerics.arrays import Floats
from tablegen.planning.line_plan import make_plan
from tablegen.virtual.imaging import running_frame
from tablegen.virtual.own_run import own_piezo
from tablegen.virtual.pixel_line_error import pixel_line_error
from tablegen.virtual.simulation import run_on_each

pytestmark = pytest.mark.common

SAMPLE = {"lattice_nm": 20.0}


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


def test_a_frame_has_the_pixels_of_the_sine(setup: Setup) -> None:
    """Columns evenly in time, as those of a line are, would be off by percents of the line."""
    plan = make_plan(setup, sines=True)
    piezo, certified = own_piezo(plan.x), plan.pixel_errors
    assert piezo is not None
    assert certified is not None
    low, high = plan.x.imaged or (0.0, 1.0)
    grid = low + (high - low) * (np.arange(48) + 0.5) / 48

    def off(schedule: Schedule) -> list[Floats]:
        frame = running_frame(replace(plan, schedule=schedule), piezo, piezo, lambda x, y: x + y)
        sides = [sweep.x_nm[0] for sweep in (frame.trace, frame.retrace)]
        slope, start = np.polyfit(np.concatenate([grid, grid]), np.concatenate(sides), 1)
        return [100.0 * ((nm - start) / slope - grid) for nm in sides]

    for found, side in zip(off(plan.schedule), ("forward", "backward"), strict=True):
        # The position in the middle of a pixel is not quite its mean.
        assert np.max(np.abs(found - certified.errors[side])) < 0.1
    assert np.max(np.abs(off(replace(plan.schedule, pixel_table=None))[0])) > 1.0
    with pytest.raises(ValueError, match="the table of a sine has 48 pixels, not 32"):
        running_frame(plan, piezo, piezo, lambda x, y: x + y, pixels=32)


def test_the_laboratory_plays_a_sine_by_its_pixels(setup: Setup) -> None:
    laboratory = tablegen.Laboratory(like=setup.scanner)
    run = laboratory.play(setup, "x")
    assert run.pixels is not None
    assert len(run.imaged.forward.residual) == run.pixels.pixels == 48
    assert laboratory.play(setup, "y").pixels is None
    assert laboratory.frame(setup, laboratory.lattice(20.0)).trace.x_nm.shape[1] == 48


def test_tables_of_a_sine_have_one_harmonic(setup: Setup) -> None:
    x, y = tablegen.tables(setup).axes
    assert isinstance(x, AxisTables)
    assert (x.harmonics, x.ticks, y.axis) == (1, 400, "y")
    planned = next(row for row in x.rows if row.planned)
    (certificate, _) = tablegen.certify(tablegen.plan(setup.scan_file.name)).values()
    assert planned.max_error_lsb == pytest.approx(certificate.max_error_lsb)


def test_what_needs_a_straight_line_says_what_to_use(setup: Setup, tmp_path: Path) -> None:
    trace = tablegen.Laboratory(like=setup.scanner).running_trace(setup, "x")
    with pytest.raises(Rejected, match=r"scan\.toml:\d+: x\.motion: a layer .*; calibrate the operator again"):
        tablegen.refine(setup, trace, axis="x")
    heights = np.random.default_rng(1).random((13, 48))
    for mismatch in (True, False):
        with pytest.raises(Rejected, match=r"x\.motion: a layer .* or take 'line'"):
            tablegen.refine(
                setup, images=[(heights, heights)], axis="x", mismatch=mismatch, **{} if mismatch else SAMPLE
            )
    with pytest.raises(Rejected, match=r"x\.motion: the pixels of a sine .* with --fit"):
        tablegen.correct(heights, scan=setup.scan_file.name)


def test_y_beside_a_sine_learns_a_layer(setup: Setup) -> None:
    trace = tablegen.Laboratory(like=setup.scanner).running_trace(setup, "y")
    refined = tablegen.refine(setup, trace, axis="y")
    plan = make_plan(refined.setup, sines=True)
    assert plan.schedule.pixel_table is not None
    assert plan.y.layer is not None


def test_auto_that_ends_in_a_line_is_refined_and_stays_one(tmp_path: Path) -> None:
    setup = short_sine(tmp_path, "x.motion = 'auto'", "x.band_limit.harmonics = 3", "timing.pixels = 150")
    trace = tablegen.Laboratory(like=setup.scanner).running_trace(setup, "x")
    refined = tablegen.refine(setup, trace, axis="x")
    plan = make_plan(refined.setup, sines=True)
    assert plan.schedule.pixel_table is None
    assert plan.x.layer is not None
    subject = planned_scan(refined.setup, remedies=False)
    assert subject.planned is not None
    assert played_axes(subject.planned)[0].emitted is not None
