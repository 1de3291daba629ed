"""A sine on the fast axis: pixels where the operator predicts the piezo, refusals, the choice of the motion."""

from pathlib import Path

import numpy as np
import pytest
from foreign_plants import ForeignPlant, ManyPlays
from hypothesis import given
from hypothesis import strategies as st
from operator_files import operator_file
from sine_scans import response_csv, sine_scan, text_of

from tablegen.base.input_errors import Rejected
from tablegen.config.load import Setup, load
from tablegen.planning.line_plan import make_plan
from tablegen.planning.pixel_table import passages, whole_ticks

SINE = ("- x.band_limit.harmonics", "x.motion = 'sine'")
RATES = ("timing.line_rate_hz = 5e3", "dac.update_rate_hz = 4e6", "timing.pixels = 64")


def setup(folder: Path, *edits: str) -> Setup:
    """A scan at 5 kHz with an operator that nobody measured, behind the modes of a foreign plant."""
    response = response_csv(ForeignPlant(ManyPlays()), 150e3)
    return sine_scan(folder, text_of(operator_file("x")), response, *RATES, *edits)


def test_pixels_of_trace_and_retrace_are_on_one_grid_of_the_position(tmp_path: Path) -> None:
    plan = make_plan(setup(tmp_path, *SINE), sines=True)
    schedule, errors = plan.schedule, plan.pixel_errors
    assert plan.x.series.harmonics == 1
    assert plan.formats == ("c",)
    assert schedule.pixel_table is not None
    assert errors is not None
    forward, backward = schedule.pixel_table
    assert len(forward) == len(backward) == schedule.pixels == 64
    assert max(forward) > 1.3 * min(forward), "a sine is slower towards the ends of the window"
    # A tick is at most pi / ticks of the line; the middle of a pixel is within half of one of its place.
    tick_percent = 100.0 * np.pi / schedule.ticks
    assert max(errors.worst.values()) < 0.75 * tick_percent
    assert max(errors.rms.values()) < 0.2 * tick_percent
    assert errors.mismatch <= sum(errors.worst.values())


def test_the_position_has_harmonics_that_the_drive_has_not(tmp_path: Path) -> None:
    """The trap of release 0.3: a loop makes odd harmonics, which the response moves on their own."""
    shape = make_plan(setup(tmp_path, *SINE), sines=True).x.drive.shape
    place = shape.place  # type: ignore[attr-defined]
    content = np.hypot(place.a, place.b)
    assert place.harmonics == 64
    assert content[2] > 1e-3 * content[0]
    assert content[-1] < 1e-5
    rising, falling = passages(place, np.array([0.1, 0.5, 0.9]))
    assert 0.0 < rising[0] < rising[1] < rising[2] < falling[2] < falling[1] < falling[0] < 1.0
    assert np.allclose(place.value(np.concatenate([rising, falling])), [0.1, 0.5, 0.9] * 2, atol=1e-6)


@given(st.lists(st.floats(1.0, 9.0), min_size=1, max_size=8), st.floats(0.0, 50.0))
def test_edges_are_rounded_so_that_middles_move_least(lengths: list[float], first: float) -> None:
    """Against all choices of the tick before and after each edge."""
    times = first + np.concatenate([[0.0], np.cumsum(lengths)])
    low = np.floor(times)

    def moved(edges: np.ndarray) -> float:
        middles = 0.5 * (edges[1:] + edges[:-1] - times[1:] - times[:-1])
        return float(np.sum((middles / np.diff(times)) ** 2)) if np.all(np.diff(edges) > 0) else np.inf

    choices = np.array(np.meshgrid(*[[0, 1]] * len(times))).T.reshape(-1, len(times))
    least = min(moved(low + choice) for choice in choices)
    edges = whole_ticks(times)
    assert np.all(np.diff(edges) >= 1)
    assert moved(edges.astype(np.float64)) <= least * (1.0 + 1e-9) + 1e-12


REFUSED = {
    "x.band_limit.harmonics": ("x.motion = 'sine'", "one harmonic"),
    "timing.pixels": ("timing.pixels = 250", "about"),
    "x.turn": ("x.turn = 0.6", "half of it"),
    "x.band_limit.directions": ("x.band_limit.directions = 'forward'", "trace and retrace"),
    "emit.formats[1]": ("+ [emit]\nformats = ['c', 'vhdl']", "table of pixels"),
}


@pytest.mark.parametrize("key", REFUSED)
def test_what_a_sine_cannot_have_is_refused_at_its_key(key: str, tmp_path: Path) -> None:
    edit, why = REFUSED[key]
    edits = (edit,) if key.endswith("harmonics") else (*SINE, edit)
    with pytest.raises(Rejected) as refused:
        make_plan(setup(tmp_path, *edits), sines=True)
    assert [(one.key, why in one.why) for one in refused.value.problems] == [(key, True)], str(refused.value)


def test_a_sine_needs_an_operator_and_a_caller_that_knows_it(tmp_path: Path) -> None:
    given = setup(tmp_path, *SINE)
    with pytest.raises(Rejected, match=r"x\.motion: a straight line is needed here"):
        make_plan(given)
    scanner = (tmp_path / "scanner.toml").read_text("utf-8").replace('"operator"', '"triangle"')
    text = "\n".join(line for line in scanner.splitlines() if "operator" not in line)
    (tmp_path / "scanner.toml").write_text(text, "utf-8")
    with pytest.raises(Rejected, match=r"x\.motion: a sine needs an operator"):
        make_plan(load(tmp_path / "scan.toml"), sines=True)


def test_auto_takes_what_leaves_less(tmp_path: Path) -> None:
    """A line of few harmonics is worse than a sine, one of many is better; and where pixels do not fit a sine."""
    few = make_plan(setup(tmp_path, "x.motion = 'auto'", "x.band_limit.harmonics = 3"), sines=True)
    assert few.pixel_errors is not None
    many = make_plan(
        setup(tmp_path, "x.motion = 'auto'", "x.band_limit.harmonics = 3", "timing.pixels = 300"), sines=True
    )
    assert many.pixel_errors is None
    assert many.x.series.harmonics == 3


def test_the_peaks_of_a_sine_are_not_cut_off(tmp_path: Path) -> None:
    """Between the points of a coarse grid they would be beyond the table's largest word."""
    line = make_plan(setup(tmp_path, *SINE), sines=True).x
    ticks = line.program.ticks
    exact = line.float_codes(line.series.on_grid(ticks))
    assert np.max(np.abs(line.codes(0, ticks) - exact)) < 1.0
