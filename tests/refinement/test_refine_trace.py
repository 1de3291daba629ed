"""A trace of the running scan: its phase from drive or trigger, a period of it with errors, and what is none."""

import re
from pathlib import Path

import numpy as np
import pytest
from editing import SCANNER, write_pair
from hypothesis import example, given, settings
from hypothesis import strategies as st
from refining import scan_text

from tablegen.base.input_errors import Unphysical
from tablegen.config.load import load
from tablegen.planning.line_plan import LinePlan, make_plan
from tablegen.refinement import phase
from tablegen.refinement.displacement import fit_displacement
from tablegen.refinement.phase import phase_by_drive, phase_by_trigger
from tablegen.waveform.series import FourierSeries

LAYER = """+ [x.refinement]
a = [0.004, -0.001]
b = [0.002, 0.001]
v_amplitude = 20.0
v_offset = 50.0
rate_hz = 100.0
turn = 0.5
window = [0.1, 0.9]
directions = "both"
"""


def line_of(folder: Path, *edits: str) -> LinePlan:
    return make_plan(load(write_pair(folder, scan_text(*edits), SCANNER))).x


@pytest.fixture(scope="module")
def line(tmp_path_factory: pytest.TempPathFactory) -> LinePlan:
    return line_of(tmp_path_factory.mktemp("line"))


def drive(line: LinePlan, turns: np.ndarray) -> np.ndarray:
    """The waveform that is played, term by term, as the converter's hold lets it arrive: half a tick later."""
    n = np.arange(1, line.series.harmonics + 1)
    angle = 2.0 * np.pi * np.outer(turns - 0.5 / line.program.ticks, n)
    held = np.sinc(n / line.program.ticks)
    w = line.series.a0 + np.cos(angle) @ (held * line.series.a) + np.sin(angle) @ (held * line.series.b)
    return line.drive.v_offset + line.drive.v_amplitude * (w - 0.5)


def error_of_phase(line: LinePlan, turns: np.ndarray, sigma: float) -> float:
    """Return the largest standard error of a phase [periods] of a fit of phase, period, gain and offset to noise."""
    step = 1e-6
    slope = (drive(line, turns + step) - drive(line, turns - step)) / (2.0 * step)
    jacobian = np.column_stack([slope, slope * turns, drive(line, turns), np.ones(len(turns))])
    covariance = sigma**2 * np.linalg.inv(jacobian.T @ jacobian)[:2, :2]
    line_of_time = np.column_stack([np.ones(len(turns)), turns])
    return float(np.sqrt(np.max(np.einsum("ij,jk,ik->i", line_of_time, covariance, line_of_time))))


@given(
    start=st.floats(0.0, 0.999),
    clock=st.floats(-2e-3, 2e-3),
    periods=st.floats(1.05, 12.0),
    samples=st.floats(50.0, 400.0),
    noise=st.floats(0.0, 0.005),
    late=st.floats(-0.01, 0.01),
    seed=st.integers(0, 99),
)
@example(start=0.0, clock=0.0, periods=1.5, samples=50.0, noise=0.00390625, late=0.0, seed=20)
@example(start=0.25, clock=0.0, periods=1.5, samples=50.0, noise=0.005, late=0.0, seed=53)
@settings(max_examples=40, deadline=None)
def test_the_drive_says_when_each_sample_was_taken(
    line: LinePlan, start: float, clock: float, periods: float, samples: float, noise: float, late: float, seed: int
) -> None:
    turns = start + np.arange(int(periods * samples) + 1) / samples
    time = 17.3 + turns * 0.01 * (1.0 + clock)
    readings = drive(line, turns) + noise * 20.0 * np.random.default_rng(seed).standard_normal(len(turns))
    found = phase_by_drive(line, time, readings, late * 0.01)
    error = 5.0 * error_of_phase(line, turns, 20.0 * noise) + 1e-7
    off = found.turns - turns + late / (1.0 + clock)
    assert np.max(np.abs(off - np.rint(np.mean(off)))) < error
    assert found.period_s == pytest.approx(0.01 * (1.0 + clock), rel=2.0 * error / periods)
    assert found.drive is not None
    assert found.drive[0] == pytest.approx(1.0, abs=0.01)
    # Averaged in 64 pieces of a period, in each of which a short trace has a single reading or two.
    assert found.drive[1] < 1.6 * noise * min(1.0, 1.2 * np.sqrt(64 / len(turns))) + 1e-6


@pytest.mark.common
def test_a_long_trace_is_fitted_in_parts_as_a_whole(line: LinePlan, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of its first fit only every so many samples take part; one step with all of them ends where a whole fit does."""
    turns = 0.3 + np.arange(50_001) / 500
    noise = 0.1 * np.random.default_rng(3).standard_normal(len(turns))
    time, volts = turns * 0.01 * 1.0007, drive(line, turns) + noise
    whole = phase_by_drive(line, time, volts, 0.0)
    monkeypatch.setattr(phase, "_MOST_AT_ONCE", 3000)
    parts = phase_by_drive(line, time, volts, 0.0)
    assert np.max(np.abs(parts.turns - whole.turns)) < 1e-7  # a hundredth of the standard error
    assert parts.drive == pytest.approx(whole.drive, abs=1e-6)
    monkeypatch.setattr(phase, "_step", lambda *_: np.zeros(4))
    assert np.max(np.abs(phase_by_drive(line, time, volts, 0.0).turns - whole.turns)) > 1e-6


def test_a_trigger_is_a_line_start(line: LinePlan) -> None:
    time = np.arange(500) * 1e-4
    assert phase_by_trigger(line, time, None, 0.0).turns == pytest.approx(time / 0.01)
    assert phase_by_trigger(line, time, 0.0101, 2e-4).turns == pytest.approx((time - 2e-4) / 0.0101)


def wrong(line: LinePlan, time: np.ndarray, volts: np.ndarray) -> str:
    with pytest.raises(Unphysical) as caught:
        phase_by_drive(line, time, volts, 0.0)
    return str(caught.value)


def test_a_drive_of_something_else_is_refused(line: LinePlan) -> None:
    turns = np.arange(1000) / 200
    time, volts = turns * 0.01, drive(line, turns)
    assert "20 V about 50 V" in wrong(line, time, 0.1 * (volts - 50.0))
    assert "behind the amplifier" in wrong(line, time, volts + 3.0)
    assert "has a period of 0.0103 s, this scan 0.01 s" in wrong(line, time * 1.03, volts)
    triangle = 50.0 + 20.0 * (2.0 * np.abs(turns % 1.0 - 0.5) - 0.5)
    assert re.search(r"departs from this scan's by .* % rms", wrong(line, time, 100.0 - triangle))
    assert "the drive does not move" in wrong(line, time, np.full(1000, 50.0))
    assert "time does not ascend after 0.0499" in wrong(line, np.minimum(time, time[-2]), volts)
    assert "0.5 of a period of 0.01 s are recorded" in wrong(line, time[:100], volts[:100])
    assert "20 samples a period are too few" in wrong(line, time[::10], volts[::10])
    assert "39 samples are not enough for a trace" in wrong(line, time[:39], volts[:39])


def test_a_trace_of_the_build_before_is_refused(line: LinePlan, tmp_path: Path) -> None:
    """It lacks the layer that the file has by now; with noise, and without being fooled by noise."""
    turns = 0.2 + np.arange(4000) / 500
    noise = 0.02 * np.random.default_rng(1).standard_normal(len(turns))
    later = line_of(tmp_path, LAYER)
    assert re.search("lacks (9.|100) % of the layer", wrong(later, turns * 0.01, drive(line, turns) + noise))
    phase_by_drive(later, turns * 0.01, drive(later, turns) + noise, 0.0)
    loud = np.random.default_rng(2).standard_normal(len(turns)) * 0.1
    phase_by_drive(later, turns * 0.01, drive(later, turns) + loud, 0.0)


def series(seed: int, harmonics: int) -> FourierSeries:
    generator = np.random.default_rng(seed)
    falling = 1.0 / np.arange(1, harmonics + 1) ** 2
    return FourierSeries(
        300.0,
        100.0 * falling * generator.standard_normal(harmonics),
        100.0 * falling * generator.standard_normal(harmonics),
    )


@given(st.integers(0, 999), st.floats(2.1, 8.0), st.floats(60.0, 300.0), st.floats(-3.0, 3.0))
@settings(max_examples=30, deadline=None)
def test_a_period_comes_back_through_drift(seed: int, periods: float, samples: float, drift: float) -> None:
    truth = series(seed, 12)
    turns = 0.3 + np.arange(int(periods * samples)) / samples
    found = fit_displacement(turns, truth.value(turns) + drift * turns, 16, settle_periods=0)
    assert found.series.a[:12] == pytest.approx(truth.a, abs=1e-6)
    assert found.series.b[:12] == pytest.approx(truth.b, abs=1e-6)
    assert found.drift_nm == pytest.approx(abs(drift) * float(turns[-1] - turns[0]), abs=1e-6)
    assert found.noise_nm < 1e-6


@pytest.mark.parametrize(("periods", "order"), [(1.5, 0), (2.5, 1), (4.5, 2), (6.5, 3)])
def test_the_order_of_the_drift_goes_by_the_periods(periods: float, order: int) -> None:
    """By default as the page says: a power of time up to that order goes away, the next one does not."""
    turns, truth = np.arange(round(100 * periods)) / 100, series(1, 8)
    time = 2.0 * turns / turns[-1] - 1.0
    for power in range(5):
        found = fit_displacement(turns, truth.value(turns) + 20.0 * time**power, 8, settle_periods=0)
        assert (found.noise_nm < 1e-9) == (power <= order)


def test_covariances_are_those_of_many_traces() -> None:
    truth, sigma = series(3, 8), 0.7
    turns = 0.1 + np.arange(1000) / 190
    generator = np.random.default_rng(5)
    found = [
        fit_displacement(turns, truth.value(turns) + sigma * generator.standard_normal(1000), 8) for _ in range(300)
    ]
    c = np.array([[one.series.a0, *one.series.a, *one.series.b] for one in found])
    expected = np.mean([np.diag(one.covariance) for one in found], axis=0)
    assert np.var(c, axis=0) == pytest.approx(expected, rel=0.35)
    assert np.mean([one.noise_nm for one in found]) == pytest.approx(sigma, rel=0.02)
    assert {one.left_out for one in found} == {190}


def test_hum_widens_the_errors() -> None:
    turns = np.arange(2000) / 200
    hum = 0.5 * np.sin(2.0 * np.pi * 3.37 * turns)
    found = fit_displacement(turns, series(1, 8).value(turns) + hum, 8)
    assert found.correlated > 3.0
    white = 2.0 * found.noise_nm**2 / found.samples
    assert found.covariance[1, 1] == pytest.approx(found.correlated * white, rel=0.2)


def test_too_little_of_a_displacement() -> None:
    turns = np.arange(200) / 100
    with pytest.raises(Unphysical, match="does not move"):
        fit_displacement(turns, np.ones(200), 8)
    with pytest.raises(Unphysical, match="2 periods are recorded, which leaves no whole period after 2 to settle"):
        fit_displacement(turns, turns, 8, settle_periods=2)
    uneven = np.concatenate([np.linspace(0.0, 0.2, 150), [1.1]])
    with pytest.raises(Unphysical, match="do not determine"):
        fit_displacement(uneven, np.sin(uneven), 30)
