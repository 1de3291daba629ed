"""Trace and retrace of a grating that are whole periods apart: decided by debris, by a known delay, or refused."""

import re
from collections import Counter
from collections.abc import Callable

import numpy as np
import pytest
from refining import GRATING, IMAGED, LATTICE, ON_TIME, Sample, calibrated, frames_of, imaged_scan, play, scanner
from replacing import replace

from tablegen.calibration.record_checks import WrongRecord
from tablegen.config.load import Setup
from tablegen.images.periodic_model import Geometry
from tablegen.planning.line_plan import make_plan
from tablegen.refinement import image_round
from tablegen.refinement.image_round import ImageRound, refine_images
from tablegen.refinement.lattice_line import ImageOptions, lattice_line
from tablegen.refinement.round import Options
from tablegen.refinement.whole_periods import PeriodsApart, check_periods_apart, periods_apart

pytestmark = pytest.mark.common

PERIODS = 12.0
DIRTY = replace(GRATING, periods=PERIODS, debris=6)
CLEAN = replace(GRATING, periods=PERIODS)
Pair = tuple[np.ndarray, np.ndarray]


@pytest.fixture(scope="module")
def setup() -> Setup:
    return calibrated(imaged_scan("x", 60.0, lines=100, pixels=128))


def delayed(setup: Setup, sample: Sample, apart: float, seed: int = 0) -> list[Pair]:
    """A frame whose trace and retrace are so many periods further apart, by a delay of the images."""
    late = 0.5 * apart * columns_per_period(sample)
    return frames_of(setup, sample, seed=seed, conditions=replace(IMAGED, late=late))


def columns_per_period(sample: Sample) -> float:
    return 128.0 / (0.8 * sample.periods)


def off(setup: Setup, found: ImageRound, edge: float = 0.0) -> float:
    """The rms distance of the measured error from the true one, in percent of the line, without its edges."""
    true = play(setup, "x", scanner().x).true
    inner = np.abs(true.points.position - 0.5) < 0.4 - edge
    return float(np.sqrt(np.mean((100.0 * (found.update.before.error - true.error))[inner] ** 2)))


def test_debris_tells_which_periods_belong_together(setup: Setup) -> None:
    found = refine_images(setup, "x", delayed(setup, DIRTY, 0.0), Options())
    assert off(setup, found) < 0.04
    late = delayed(setup, DIRTY, -1.0)
    with pytest.raises(WrongRecord, match="are a period of the sample further apart than its waves show") as refused:
        refine_images(setup, "x", late, Options(), ON_TIME)  # whatever is said of the delay
    assert refused.value.code == "ambiguous-shift"
    given = re.search(r"--delay-pixels (\S+);", str(refused.value))
    assert given is not None
    assert float(given[1]) == pytest.approx(-0.5 * columns_per_period(DIRTY), rel=0.03)
    again = refine_images(setup, "x", late, Options(), ImageOptions(delay_pixels=float(given[1])))
    assert off(setup, again, edge=0.1) < 0.2  # late images do not show all of the window


def test_without_the_check_the_line_is_half_a_period_off(setup: Setup, monkeypatch: pytest.MonkeyPatch) -> None:
    """A control: nothing else refuses it, and the layer would be wrong."""
    monkeypatch.setattr(image_round, "check_periods_apart", lambda *_: None)
    wrong = refine_images(setup, "x", delayed(setup, DIRTY, 1.0), Options())
    assert wrong.worse == ""
    both = wrong.update.before.points.by_side(wrong.update.before.error)
    assert abs(float(np.mean(both["forward"] - both["backward"]))) < 0.2 / PERIODS  # in truth a period


def test_clean_bars_need_a_known_delay(setup: Setup) -> None:
    """Exactly a period apart they are the same images: only who knows the delay can tell."""
    still = delayed(setup, CLEAN, 0.0)
    for pairs in (still, delayed(setup, CLEAN, 1.0)):
        with pytest.raises(WrongRecord, match=r"ambiguous shift of the sample: images that are 6\.7 pixels later"):
            refine_images(setup, "x", pairs, Options())
    assert off(setup, refine_images(setup, "x", still, Options(), ON_TIME)) < 0.04


def row_along_the_lines(setup: Setup) -> Callable[[float], list[Pair]]:
    """A lattice whose closest row is along the lines, and looks the same a period further."""
    return lambda apart: delayed(setup, replace(LATTICE, periods=PERIODS, angle_deg=30.0), apart)


def test_a_lattice_with_a_row_along_the_lines_is_ambiguous_too(setup: Setup) -> None:
    with pytest.raises(WrongRecord, match="ambiguous shift of the sample"):
        refine_images(setup, "x", row_along_the_lines(setup)(0.0), Options())
    assert off(setup, refine_images(setup, "x", row_along_the_lines(setup)(0.0), Options(), ON_TIME)) < 0.04
    refine_images(setup, "x", delayed(setup, replace(LATTICE, periods=PERIODS), 0.0), Options())  # another row decides


def test_with_a_known_delay_trace_and_retrace_meet_at_the_turns(setup: Setup) -> None:
    """A period of hysteresis more than the fit has: 1.4 in the middle, half of one at the ends of the window."""
    frame = lattice_line(make_plan(setup), *delayed(setup, CLEAN, 0.0)[0], ON_TIME)
    check_periods_apart((frame,), 0.0)
    geometry: Geometry = frame.geometry
    apart = (5.6 * geometry.place * (1.0 - geometry.place) - 1.0) / PERIODS
    bent = np.concatenate([0.5 * apart, -0.5 * apart])
    modes = np.linalg.lstsq(frame.rows_model.modes.values.T, bent, rcond=None)[0]
    wrong = replace(frame, fit=replace(frame.fit, state=replace(frame.fit.state, modes=modes)))
    with pytest.raises(WrongRecord, match="would be a period of it apart at the turns, where they meet"):
        check_periods_apart((wrong,), 0.0)


@pytest.mark.parametrize(
    ("correlations", "decided"),
    [
        ([0.0, 1.0, 9.0], 1),
        ([0.0, 1.0, 5.9], None),  # not above the noise
        ([0.0, 6.0, 9.0], None),  # wide debris
        ([9.0], None),
        ([], None),
    ],
)
def test_one_shift_alone_has_to_be_clear(correlations: list[float], decided: int | None) -> None:
    shifts = np.arange(len(correlations), dtype=np.float64) - 1.0
    assert PeriodsApart(shifts, np.array(correlations)).decided == decided


@pytest.mark.long
def test_no_frame_is_a_period_off(setup: Setup) -> None:
    """The counts of docs/refine.md: 66 frames of 9 or 15 bars, clean or with debris, delayed either way."""
    plan, counts, before = make_plan(setup), Counter[tuple[bool, str]](), 0
    for periods in (9.0, 15.0):
        for debris in (0, 3, 12):
            for apart in (0.0, 0.3, -0.3, 0.8, -0.8, 1.0, -1.0, 1.2, -1.2, 1.3, -1.3):
                sample = replace(GRATING, periods=periods, debris=debris)
                frame = lattice_line(plan, *delayed(setup, sample, apart)[0], ImageOptions())
                image_round._check(frame)
                before += abs(apart) > 0.5
                try:
                    check_periods_apart((frame,), None)
                except WrongRecord:
                    counts[debris > 0, "refused"] += 1
                    continue
                counts[debris > 0, "wrong" if abs(apart) > 0.5 else "right"] += 1
    assert before == 48
    assert counts == {(False, "refused"): 22, (True, "right"): 12, (True, "refused"): 32}


def test_noise_alone_decides_nothing(setup: Setup) -> None:
    for seed in range(2):
        frame = lattice_line(make_plan(setup), *delayed(setup, CLEAN, 0.0, seed)[0], ON_TIME)
        assert float(np.max(np.abs(periods_apart(frame).correlations))) < 4.5
