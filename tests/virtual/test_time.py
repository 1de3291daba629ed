"""The convention of time, end to end: codes are held, and a pixel of trace and retrace means the same place.

The reference is `fine_time`: emitted codes on a grid of 64 instants a tick, means between the markers of the schedule.
"""

from pathlib import Path

import numpy as np
import pytest
from fine_time import PARTS, followed, linear_setup, mismatch, staircase
from numpy.typing import NDArray
from replacing import replace

from tablegen.config.load import Setup
from tablegen.numerics.driver import Driver
from tablegen.planning import waveforms
from tablegen.planning.line_plan import Plan, make_plan
from tablegen.planning.windows import retrace_mismatch
from tablegen.refinement.round import Options, refine
from tablegen.virtual.modes import Modes, second_order
from tablegen.virtual.preisach import Preisach
from tablegen.virtual.running import running_trace
from tablegen.virtual.scanner import VirtualAxis
from tablegen.virtual.simulation import run_line

AGREES = 0.002  # percent of the line
STRAIGHT = Modes(1.0)
RESONANCE = (40e3, 20.0, 1.5e-6)  # Hz, quality, s
IN_FILE = "frequency_hz = 40e3\nquality = 20.0\ndelay_s = 1.5e-6\nmax_boost_db = 40.0\n"
# Line rate and update rate, turn, pixels, and harmonics; pixels are whole ticks in both directions.
SIZES = [
    (1e3, 1e6, 0.5, 200, 32),
    (1e3, 1e6, 0.7, 80, 48),
    (100.0, 1e6, 0.5, 200, 32),
    (100.0, 1e6, 0.7, 80, 48),
    (5e3, 500e3, 0.5, 20, 20),
    (5e3, 500e3, 0.7, 8, 28),
]


def linear(resonance: Modes = STRAIGHT) -> VirtualAxis:
    """An axis of 10 nm/V, without hysteresis."""
    return VirtualAxis(Driver(100.0), STRAIGHT, Preisach((1000.0,), ()), (1.0,), STRAIGHT, resonance)


def planned(folder: Path, size: tuple[float, float, float, int, int], resonance: str = "") -> Plan:
    rate, updates, turn, pixels, harmonics = size
    edits = f"x.turn = {turn}", f"timing.pixels = {pixels}", f"x.band_limit.harmonics = {harmonics}"
    return make_plan(linear_setup(folder, rate, updates, *edits, resonance=resonance))


@pytest.mark.common
@pytest.mark.parametrize("size", SIZES, ids=str)
@pytest.mark.parametrize("dynamics", [False, True], ids=["ideal", "second order"])
def test_trace_and_retrace_agree(size: tuple[float, float, float, int, int], dynamics: bool, tmp_path: Path) -> None:
    """0.2 % at 1 kHz and 1 MHz were it not for the hold, the other sizes in proportion."""
    plan = planned(tmp_path, size, IN_FILE if dynamics else "")
    line, schedule = plan.x, plan.schedule
    assert retrace_mismatch(schedule, line.drive.turn) < 1e-12

    def seen(position: NDArray[np.float64]) -> float:
        if dynamics:
            position = followed(position, 1.0 / float(line.rate), *RESONANCE)
        return float(mismatch(position, schedule)["largest"])

    position = staircase(line)
    assert seen(position) < AGREES
    # Negative control: codes that are samples of what shall arrive, as if they were not held.
    late = replace(line, series=line.drive_series)
    codes = late.float_codes(late.drive_series.value(np.arange(schedule.ticks) / schedule.ticks))
    unheld = (codes - late.converter.code(late.drive.v_offset)) / late.codes_per_unit + 0.5
    turn = line.drive.turn
    lag = 50.0 / schedule.ticks * (1.0 / turn + 1.0 / (1.0 - turn))  # percent of the line; half a tick each way
    assert seen(np.repeat(unheld, PARTS)) == pytest.approx(lag, rel=0.05)


def test_the_virtual_scanner_holds_its_codes(tmp_path: Path) -> None:
    """Its means over the ticks are those of the fine grid, and so is what trace and retrace of it are apart."""
    plan = planned(tmp_path, (5e3, 500e3, 0.5, 20, 20))
    for resonance, modes in ((False, STRAIGHT), (True, second_order(*RESONANCE[:2]))):
        position = staircase(plan.x)
        if resonance:
            position = followed(position, 1.0 / float(plan.x.rate), *RESONANCE[:2], 0.0)
        run = run_line(plan.x, linear(modes))
        means = position.reshape(-1, PARTS).mean(axis=1)
        expected = 10.0 * (plan.x.drive.v_offset + plan.x.drive.v_amplitude * (means - 0.5))
        assert run.displacement_nm == pytest.approx(expected, abs=2e-4 * np.ptp(expected))
        forward, backward = run.imaged.forward.residual_range, run.imaged.backward.residual_range
        apart = max(forward[1] - backward[0], backward[1] - forward[0])
        assert (apart > 0.1) == resonance  # the file has no resonance: it is the scanner's error
        assert (apart < 0.02) != resonance


def test_what_is_played_is_measured_at_its_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An ideal scanner: residuals about its line are those of the band limit, at a tick of 0.2 % of the line.

    The negative control is a build that leaves the hold as it is: both directions are off by half a tick.
    """
    limits = []
    for undone in (True, False):
        if not undone:
            monkeypatch.setattr(waveforms, "hold_inverse", lambda n, *_, **__: (np.ones(n), np.zeros(n)))
        error = run_line(planned(tmp_path, SIZES[0]).x, linear()).imaged
        limits.append([max(map(abs, branch.residual_range)) for branch in (error.forward, error.backward)])
    assert max(limits[0]) < AGREES
    assert limits[1] == pytest.approx([0.1, 0.1], rel=0.02)


def _refined(setup: Setup, axis: VirtualAxis, triggered: bool, rounds: int) -> Setup:
    for _ in range(rounds):
        line = make_plan(setup).x
        trace = running_trace(line, axis, periods=4.3, samples=1234, clock=0.0 if triggered else 5e-4)
        drive = None if triggered else trace["drive_v"]
        setup = refine(setup, "x", trace["time_s"], trace["displacement_nm"], drive, Options(gain=1.0)).setup
    return setup


@pytest.mark.common
@pytest.mark.parametrize("triggered", [False, True], ids=["by drive", "by trigger"])
@pytest.mark.parametrize("size", [SIZES[0], SIZES[1]], ids=str)
def test_refining_keeps_them_together(
    size: tuple[float, float, float, int, int], triggered: bool, tmp_path: Path
) -> None:
    """From a resonance that the scanner file does not know, and its lag of 0.35 % of the line, in three rounds."""
    rate, updates, turn, pixels, harmonics = size
    edits = f"x.turn = {turn}", f"timing.pixels = {pixels}", f"x.band_limit.harmonics = {harmonics}"
    setup = linear_setup(tmp_path, rate, updates, *edits)
    frequency, quality = 60e3, 3.0

    def apart(setup: Setup) -> float:
        plan = make_plan(setup)
        position = followed(staircase(plan.x), 1.0 / rate, frequency, quality, 0.0)
        return float(mismatch(position, plan.schedule)["largest"])

    before = apart(setup)
    after = apart(_refined(setup, linear(second_order(frequency, quality)), triggered, 3))
    assert before > 0.3
    assert after < AGREES


def test_drive_and_trigger_name_the_same_instant(tmp_path: Path) -> None:
    """On a scanner that the file describes there is nothing to learn, and neither finds anything."""
    setup = linear_setup(tmp_path, 1e3, 1e6)
    line = make_plan(setup).x
    trace = running_trace(line, linear(), periods=4.3, samples=1234, start=0.37)
    found = [
        refine(setup, "x", trace["time_s"], trace["displacement_nm"], drive, Options())
        for drive in (trace["drive_v"], None)
    ]
    by_drive, by_trigger = (one.phase.turns for one in found)
    assert np.max(np.abs(by_drive - by_trigger)) < 0.01 / line.program.ticks
    for one in found:
        assert one.update.before.rms_percent < AGREES


def test_the_staircase_itself_is_late_by_half_a_tick_and_counted_so(tmp_path: Path) -> None:
    """A recorder that is faster than the converter sees the stairs; times from them are those of the codes."""
    from tablegen.refinement.phase import phase_by_drive, phase_by_trigger

    line = make_plan(linear_setup(tmp_path, 1e3, 1e6)).x
    ticks = line.program.ticks
    turns = 0.37 + np.arange(20_000) / 4321.7
    codes = line.codes(0, ticks)[np.floor(turns * ticks).astype(np.int64) % ticks]
    volts = line.converter.v_zero + line.converter.v_per_code * codes
    found = phase_by_drive(line, turns / 1e3, volts, 0.0).turns - phase_by_trigger(line, turns / 1e3, None, 0.0).turns
    assert np.max(np.abs(found - np.rint(found))) < 0.02 / ticks
