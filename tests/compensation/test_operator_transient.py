"""Drift after a change of offset or size: against plays that are stepped, and a virtual scanner that is followed."""

import re
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from editing import SCAN, SCANNER, edited, run
from foreign_plants import SIX, BoucWen, ForeignPlant, ManyPlays, record
from replacing import replace
from sets import LONG_TEST
from stepped_plants import Followed, followed, one_state_played, plays_played
from test_operator_waveform import THRESHOLDS, WEIGHTS, operator

from tablegen.calibration.laws.hysteresis import Trace
from tablegen.calibration.operator.file_of_fit import operator_file
from tablegen.calibration.operator.fit import OperatorFit, fit_operator
from tablegen.calibration.operator.periodic_line import periodic_line
from tablegen.compensation.operator.creep import LogarithmicCreep
from tablegen.compensation.operator.operator import Operator
from tablegen.compensation.operator.plays import FIXED_BENDS, envelopes
from tablegen.compensation.operator.transient import SettledLine, after_offset, after_size
from tablegen.compensation.operator.transient import transient_between as transient
from tablegen.compensation.transient import Transient
from tablegen.config.load import load
from tablegen.numerics.arrays import Floats
from tablegen.planning.line_plan import make_plan
from tablegen.planning.settling import settling
from tablegen.virtual.parameters import load_truth
from tablegen.virtual.scanner import VirtualScanner

pytestmark = pytest.mark.rest

LATE = LogarithmicCreep(0.03, 1e-4, 1e3, 100.0)
LINE_S = 0.01


def stepped_periods(*lines: tuple[float, float]) -> list[Floats]:
    """Positions in nm of the plays of ``operator()``, each period at 2 x 300 even times from the low turn on."""
    state, out = np.zeros((3, len(THRESHOLDS))), []
    for stroke, centre in lines:
        along = np.concatenate([np.linspace(0.0, 1.0, 300), np.linspace(1.0, 0.0, 300)])
        u = centre + stroke * (along - 0.5)
        transforms, moved = [envelopes(u, bend)[0] for bend in FIXED_BENDS], np.empty(len(u))
        for k in range(len(u)):
            g = np.array([[transform[k]] for transform in transforms])
            state = np.minimum(np.maximum(state, g - THRESHOLDS), g + THRESHOLDS)
            moved[k] = float(np.sum(WEIGHTS * state)) + 700.0 * u[k] + 60.0 * u[k] ** 2
        out.append(moved)
    return out


@pytest.mark.parametrize(
    ("after", "before"), [(after_offset, (0.3, 0.5)), (after_size, (0.15, 0.6))], ids=["offset", "size"]
)
def test_step_and_memory_are_those_of_plays_that_are_stepped(
    after: Callable[..., Transient], before: tuple[float, float]
) -> None:
    now = (0.3, 0.6)
    found = after(operator(LATE), *now, 1.0, 0.5, LINE_S)
    periods = stepped_periods((1.0, 0.5), before, before, now, now)[1:]
    middles = [0.5 * (float(np.max(one)) + float(np.min(one))) for one in periods]  # means of lines that are straight
    step = middles[3] - middles[1]
    for late, (share, tau_s) in zip(found.late, LATE.terms(), strict=True):
        if tau_s > 500.0 * LINE_S:  # what is faster knows where in the period the change is
            assert late.nm == pytest.approx(step * share, rel=0.02, abs=2e-3)
    # At the same drives the first sweep differs from settled ones.
    memory = np.interp(np.arange(0.0, 300.0), np.arange(len(found.memory_nm)) * 299.0 / 64.0, found.memory_nm)
    assert found.most_memory_nm == pytest.approx(
        float(np.max(np.abs(periods[2] - periods[3])[:300])), rel=0.02, abs=1e-6
    )
    assert float(np.max(np.abs(memory - (periods[2] - periods[3])[:300]))) < 0.05 * found.most_memory_nm + 1e-6
    assert found.most_memory_nm > 1.0 if after is after_offset else True


@pytest.mark.common
def test_drift_falls_from_line_to_line_and_lines_are_the_first_within_the_bound() -> None:
    after = after_offset(operator(LATE), 0.3, 0.6, 1.0, 0.5, LINE_S)
    drifts = [after.drift_nm(LINE_S, first, 200) for first in range(400)]
    assert drifts == sorted(drifts, reverse=True)
    assert drifts[0] > 1.2 * drifts[1]  # the first line has what hysteresis remembers, too
    for bound in (0.3, 0.7, 1.0, 2.0):
        lines = after.lines(LINE_S, 200, bound, 255)
        assert lines == next((first for first in range(256) if drifts[first] <= bound), 256)
    slow = [after.drift_nm(LINE_S, 50, 200, limit) for limit in (0.1, 1.0, 10.0, 1e4)]
    assert [drifts[50], *slow] == sorted([drifts[50], *slow], reverse=True)
    assert slow[-1] == 0.0
    assert after.lines(LINE_S, 200, 1e9, 255) == 0
    assert after.lines(LINE_S, 200, 1e-6, 255) == 256
    assert after_offset(operator(), 0.3, 0.6, 1.0, 0.5, LINE_S).late == ()


def test_near_the_ends_the_line_before_fits_the_driver() -> None:
    for centre in (0.12, 0.88):
        found = after_offset(operator(LATE), 0.2, centre, 1.0, 0.95, LINE_S)
        inwards = -1.0 if centre < 0.5 else 1.0
        assert all(late.nm * inwards > 0.0 for late in found.late)


class Preisach(ForeignPlant):
    """y of the virtual scanner, for ``record``."""

    def __init__(self) -> None:
        self.axis = VirtualScanner.of(load_truth()).y

    def settled(self, volts: Floats, rate_hz: float) -> Floats:
        return self.axis.settled(volts, 1.0 / (rate_hz * len(volts)))


@cache
def identified() -> OperatorFit:
    protocol = [*((stroke, 5.0) for stroke in (0.1, 0.25, 0.5, 0.75, 0.97)), (0.5, 0.5)]
    return fit_operator(
        [
            periodic_line(Trace(f"{k}", *record(Preisach(), 0.5, stroke, rate, k)), 100.0)
            for k, (stroke, rate) in enumerate(protocol)
        ],
        None,
        lambda _: 1.0,
    )


def slowest(one: Operator) -> Operator:
    return replace(one, creep=one.creep.down_to(0.01))


@pytest.mark.common
@pytest.mark.parametrize(("stroke", "centre"), [(0.2, 0.5), pytest.param(0.6, 0.5, marks=LONG_TEST), (0.6, 0.6)])
def test_the_virtual_scanner_drifts_as_the_operator_says(stroke: float, centre: float) -> None:
    """Its hysteresis from the loop before, and its creep from the mean of that: as if that had lasted for ever."""
    along = np.concatenate([np.linspace(0.0, 1.0, 20, endpoint=False), np.linspace(1.0, 0.0, 20, endpoint=False)])
    axis, lines = VirtualScanner.of(load_truth()).y, 600
    before, now = (np.tile(at + stroke * (along - 0.5), count) for at, count in ((centre - 0.1, 3), (centre, lines)))
    moved = axis.hysteresis.play(np.concatenate([before, now]))[0]
    moved = moved * axis._sensitivity(100.0 * centre)
    rest, moved = float(np.mean(moved[len(before) - 40 : len(before)])), moved[len(before) :]
    means = axis.creep.follow(moved, LINE_S / 40, rest).reshape(lines, 40).mean(axis=1)
    after = after_offset(slowest(identified().operator), stroke, centre, 1.0, 0.5, LINE_S)
    for first in (1, 20, 100, 255):
        drift = float(means[first + 300] - means[first])
        assert after.drift_nm(LINE_S, first, 300) == pytest.approx(drift, rel=0.08), first


PLANTS = {"plays": plays_played(ManyPlays()), "Bouc-Wen": one_state_played(BoucWen())}
PERIODS = {"plays": 3, "Bouc-Wen": 300}  # that a loop takes to close
CORES = {"plays": ManyPlays(), "Bouc-Wen": BoucWen()}


@cache
def foreign(name: str, rate_hz: float) -> Operator:
    """Of six traces at one rate, and one that is ten times slower."""
    plant = ForeignPlant(CORES[name])
    protocol = [*((at, rate_hz) for at in SIX), ((0.5, 0.5), 0.1 * rate_hz)]
    traces = [Trace(f"{k}", *record(plant, *at, rate, k)) for k, (at, rate) in enumerate(protocol)]
    return slowest(fit_operator([periodic_line(one, 100.0) for one in traces], None, lambda _: 1.0).operator)


def followed_plant(name: str, change: str, turn: float, period_s: float, line_s: float, lines: int) -> Followed:
    """Of a size of 1 at 100 Hz, as the traces are."""
    plant = ForeignPlant(CORES[name])
    shares = np.full(len(plant.times_s), plant.creep / 3.0)
    at_once = 1.0 / abs(1.0 + np.sum(shares / (1.0 + 200j * np.pi * plant.times_s)))

    def play(parts: list[Floats]) -> list[Floats]:
        return [float(at_once) * part for part in PLANTS[name](parts)]

    return followed(
        play,
        (shares, plant.times_s),
        *CHANGES[change],
        turn,
        period_s,
        line_s,
        lines,
        100 if turn > 0.5 else 40,
        PERIODS[name],
    )


CHANGES = {
    "offset": ((0.3, 0.5), (0.4, 0.6)),
    "offset of a large scan": ((0.1, 0.7), (0.2, 0.8)),
    "offset far up": ((0.6, 0.8), (0.7, 0.9)),
    "size": ((0.4, 0.6), (0.3, 0.7)),
    "size of a large scan": ((0.3, 0.7), (0.1, 0.9)),
}


@pytest.mark.common
@pytest.mark.parametrize(("name", "first", "within"), [("plays", 1, 0.08), ("Bouc-Wen", 20, 0.12)])
def test_foreign_lines_drift_as_the_operator_says(name: str, first: int, within: float) -> None:
    """Bouc-Wen's loop takes some periods to close, which no settled line shows."""
    for change, (before, now) in CHANGES.items():
        truth = followed_plant(name, change, 0.5, LINE_S, LINE_S, 512)
        said = transient(foreign(name, 100.0), *(SettledLine(*line, 0.5, LINE_S) for line in (before, now)), 1.0)
        step = 0.2 if change.startswith("size") else 0.0  # percent of the line
        for line in (1, 5, 20, 100, 255):
            if line >= first:
                error = abs(said.drift_nm(LINE_S, line, 256) - truth.drift(line, 256))
                bound = 0.01 * step * 1250.0 * (now[1] - now[0]) if step else within * truth.drift(line, 256)
                assert error <= bound, (change, line)
        if name == "plays":
            assert said.drift_nm(LINE_S, 0, 256) == pytest.approx(truth.drift(0, 256), rel=0.15), change
            assert said.most_memory_nm == pytest.approx(float(np.max(np.abs(truth.first_sweep))), abs=3.0), change


@pytest.mark.common
def test_foreign_frames_drift_as_the_operator_says() -> None:
    """The slow axis, of which the first sweep is a frame, and is bent by what hysteresis remembers."""
    frame_s, line_s, lines = 2.0, 0.02, 100
    for change, (before, now) in CHANGES.items():
        truth = followed_plant("plays", change, 0.95, frame_s, line_s, 3 * lines)
        said = transient(foreign("plays", 5.0), *(SettledLine(*line, 0.95, frame_s) for line in (before, now)), 1.0)
        for line in (0, 5, 20, 100, 150):
            error = abs(said.drift_nm(line_s, line, lines) - truth.drift(line, lines))
            bound = 0.003 * 1250.0 * (now[1] - now[0]) if change.startswith("size") else 0.3
            assert error < max(0.15 * truth.drift(line, lines), bound), (change, line)


def pair(folder: Path, axes: str, *edits: str) -> Path:
    """A scan whose axes have operators, with ``settle_lines = "auto"``."""
    scanner = SCANNER
    for axis in axes:
        (folder / f"{axis}.toml").write_bytes(operator_file(identified(), axis, 100.0))
        table = f'+ [{axis}.hysteresis]\nmodel = "operator"\nfile = "{axis}.toml"'
        scanner = edited(scanner, f"- [{axis}.hysteresis]", f"- [[{axis}.hysteresis.branches]]", table)
    (folder / "scanner.toml").write_text(scanner, "utf-8")
    sizes = ("x.size_nm = 300.0", "y.size_nm = 300.0")
    edits = (*sizes, "timing.line_rate_hz = 100.0", 'timing.settle_lines = "auto"', "- [limits]", *edits)
    (folder / "scan.toml").write_text(edited(SCAN, *edits), "utf-8")
    return folder / "scan.toml"


@pytest.mark.common
def test_auto_takes_the_lines_of_the_slower_axis(tmp_path: Path) -> None:
    scan = pair(tmp_path, "xy")
    plan = make_plan(load(scan))
    found = [settling(line.axis, line.drive, plan.schedule) for line in plan.lines]
    assert [one is not None for one in found] == [True, True]
    assert plan.schedule.settle_lines == max(one.lines for one in found if one is not None)
    assert 50 < plan.schedule.settle_lines < 255
    shown = run("show", str(scan), "--no-plot", "--all").out
    assert f"settles           in {plan.schedule.settle_lines} lines after a change of offset of 10 V; drifts" in shown
    assert "nm in the first frame" in shown
    assert re.search(
        r"after \d+ lines drifts [\d.]+ nm, \d+ % of it slower than the slowest trace, 2 s: extrapolated", shown
    )
    fewer = make_plan(load(pair(tmp_path, "xy", "timing.settle_lines = 3")))
    assert fewer.schedule.settle_lines == 3
    assert "after the 3 settle_lines that follow" in run("show", str(scan), "--no-plot", "--all").out


@pytest.mark.common
def test_lines_that_a_device_cannot_count_are_255_and_said(tmp_path: Path) -> None:
    scan = pair(tmp_path, "xy", "timing.line_rate_hz = 1000.0", "timing.lines = 1000", "timing.pixels = 150")
    done = run("show", str(scan), "--no-plot", "--all")
    assert "settles           in more than 255 lines after a change of offset of 10 V" in done.out
    assert "a frame after the 255 settle_lines that follow a change of offset of 10 V" in done.out


@pytest.mark.common
def test_auto_takes_one_operator_for_both_axes_and_says_what_is_not_known(tmp_path: Path) -> None:
    scan = pair(tmp_path, "x")
    plan = make_plan(load(scan))
    found = settling("x", plan.x.drive, plan.schedule)
    assert found is not None
    assert plan.schedule.settle_lines == found.lines > 1
    shown = run("show", str(scan), "--no-plot", "--all").out
    assert shown.count("settles           in ") == 1
    assert "settles           not known: there is no operator of y" in shown


def test_auto_without_an_operator_is_refused(tmp_path: Path) -> None:
    done = run("check", str(pair(tmp_path, "")))
    assert done.status == 2
    assert (
        "timing.settle_lines: 'auto' needs an operator of x or of y, and there is none; run `tablegen calibrate "
        "operator`, or give a number of lines" in done.err
    )
