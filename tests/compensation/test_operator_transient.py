"""Drift after a change of offset or size: against plays that are stepped, and a virtual scanner that is followed."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from editing import SCAN, SCANNER, edited, run
from foreign_plants import ForeignPlant, record
from test_operator_waveform import THRESHOLDS, WEIGHTS, operator

from tablegen.calibration.hysteresis import Trace
from tablegen.calibration.operator.fit import OperatorFit, fit_operator
from tablegen.calibration.operator.periodic_line import periodic_line
from tablegen.calibration.operator.record import operator_file
from tablegen.compensation.operator.creep import LogarithmicCreep
from tablegen.compensation.operator.operator import Operator
from tablegen.compensation.operator.plays import FIXED_BENDS, envelopes
from tablegen.compensation.operator.transient import after_offset, after_size
from tablegen.compensation.transient import Transient
from tablegen.config.load import load
from tablegen.numerics.arrays import Floats
from tablegen.planning.line_plan import make_plan
from tablegen.planning.settling import settling
from tablegen.virtual.parameters import load_truth
from tablegen.virtual.scanner import VirtualScanner

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
    found = after(operator(LATE), *now, 1.0, 0.5)
    periods = stepped_periods(before, before, now, now)
    step = float(np.mean(periods[3]) - np.mean(periods[1]))
    shares = sum(share for share, _ in LATE.terms())
    assert sum(nm for nm, _ in found.late) == pytest.approx(step * shares, rel=0.02, abs=2e-3)
    # At the same drives the first sweep differs from settled ones.
    assert found.memory_nm == pytest.approx(float(np.max(np.abs(periods[2] - periods[3])[:300])), rel=0.02, abs=1e-6)
    assert found.memory_nm > 1.0 if after is after_offset else True


def test_drift_falls_from_line_to_line_and_lines_are_the_first_within_the_bound() -> None:
    after = after_offset(operator(LATE), 0.3, 0.6, 1.0, 0.5)
    drifts = [after.drift_nm(LINE_S, first, 200) for first in range(400)]
    assert drifts == sorted(drifts, reverse=True)
    for bound in (0.3, 0.7, 1.0, 2.0):
        lines = after.lines(LINE_S, 200, bound, 255)
        assert lines == next((first for first in range(256) if drifts[first] <= bound), 256)
    assert after.lines(LINE_S, 200, 1e9, 255) == 0
    assert after.lines(LINE_S, 200, 1e-6, 255) == 256
    assert after_offset(operator(), 0.3, 0.6, 1.0, 0.5).late == ()


def test_near_the_ends_the_line_before_fits_the_driver() -> None:
    for centre in (0.12, 0.88):
        found = after_offset(operator(LATE), 0.2, centre, 1.0, 0.95)
        inwards = -1.0 if centre < 0.5 else 1.0
        assert all(nm * inwards > 0.0 for nm, _ in found.late)


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
@pytest.mark.parametrize(("stroke", "centre"), [(0.2, 0.5), (0.6, 0.5), (0.6, 0.6)])
def test_the_virtual_scanner_drifts_as_the_operator_says(stroke: float, centre: float) -> None:
    """Its hysteresis from the loop before, and its creep from the mean of that: as if that had lasted for ever."""
    along = np.concatenate([np.linspace(0.0, 1.0, 20, endpoint=False), np.linspace(1.0, 0.0, 20, endpoint=False)])
    axis, lines = VirtualScanner.of(load_truth()).y, 600
    before, now = (np.tile(at + stroke * (along - 0.5), count) for at, count in ((centre - 0.1, 3), (centre, lines)))
    moved = axis.hysteresis.play(np.concatenate([before, now]))[0]
    moved = moved * axis._sensitivity(100.0 * centre)
    rest, moved = float(np.mean(moved[len(before) - 40 : len(before)])), moved[len(before) :]
    means = axis.creep.follow(moved, LINE_S / 40, rest).reshape(lines, 40).mean(axis=1)
    after = after_offset(slowest(identified().operator), stroke, centre, 1.0, 0.5)
    for first in (1, 20, 100, 255):
        drift = float(means[first + 300] - means[first])
        assert after.drift_nm(LINE_S, first, 300) == pytest.approx(drift, rel=0.15), first


def pair(folder: Path, axes: str, *edits: str) -> Path:
    """A scan whose axes have operators, with ``settle_lines = "auto"``."""
    scanner = SCANNER
    for axis in axes:
        (folder / f"{axis}.toml").write_bytes(operator_file(identified(), axis, 100.0))
        table = f'+ [{axis}.hysteresis]\nmodel = "operator"\nfile = "{axis}.toml"'
        scanner = edited(scanner, f"- [{axis}.hysteresis]", f"- [[{axis}.hysteresis.branches]]", table)
    (folder / "scanner.toml").write_text(scanner, "utf-8")
    edits = ("timing.line_rate_hz = 100.0", 'timing.settle_lines = "auto"', "- [limits]", *edits)
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
    shown = run("show", str(scan), "--no-plot").out
    assert f"settles           in {plan.schedule.settle_lines} lines after a change of offset of 10 V; drifts" in shown
    assert "nm in the first frame" in shown
    fewer = make_plan(load(pair(tmp_path, "xy", "timing.settle_lines = 3")))
    assert fewer.schedule.settle_lines == 3
    assert "after the 3 settle_lines that follow" in run("show", str(scan), "--no-plot").out


@pytest.mark.common
def test_lines_that_a_device_cannot_count_are_255_and_said(tmp_path: Path) -> None:
    scan = pair(tmp_path, "xy", "timing.line_rate_hz = 1000.0", "timing.lines = 1000", "timing.pixels = 150")
    done = run("show", str(scan), "--no-plot")
    assert "settles           in more than 255 lines after a change of offset of 10 V" in done.out
    assert "a frame after the 255 settle_lines that follow a change of offset of 10 V" in done.out


@pytest.mark.parametrize(("axes", "without"), [("", "x and y"), ("x", "y")])
@pytest.mark.common
def test_auto_without_an_operator_is_refused(axes: str, without: str, tmp_path: Path) -> None:
    done = run("check", str(pair(tmp_path, axes)))
    assert done.status == 2
    assert (
        f"timing.settle_lines: 'auto' needs an operator of both axes, and there is none of {without}; run `tablegen "
        "calibrate operator`, or give a number of lines" in done.err
    )
