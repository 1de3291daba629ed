"""Imaging windows in ticks: trace and retrace mean the same places, as far as whole ticks allow."""

from fractions import Fraction
from itertools import pairwise
from pathlib import Path

import pytest
from editing import run
from hypothesis import assume, example, given
from hypothesis import strategies as st
from variants import plan_of, setup_of

from tablegen.device.schedule import Window, pixel_starts
from tablegen.planning.windows import line_windows, matching_lines, retrace_mismatch

LOW, HIGH = Fraction(1, 10), Fraction(9, 10)
HALF = Fraction(1, 2)


def places(window: Window, pixels: int) -> list[Fraction]:
    """The middle of every pixel, in ticks, from its markers."""
    edges = [*map(int, pixel_starts(window, pixels)), window.stop]
    return [Fraction(a + b, 2) for a, b in pairwise(edges)]


def apart(windows: tuple[Window, Window], turn: Fraction, ticks: int, pixels: int) -> list[Fraction]:
    """Trace less retrace of each pixel, as a share of the line."""
    trace = [middle / (turn * ticks) for middle in places(windows[0], pixels)]
    retrace = [(ticks - middle) / ((1 - turn) * ticks) for middle in places(windows[1], pixels)][::-1]
    return [a - b for a, b in zip(trace, retrace, strict=True)]


TURNS = st.sampled_from([Fraction(text) for text in ("0.3", "0.45", "0.5", "0.7", "0.95", "0.123456789")])


@given(st.integers(8, 4000), TURNS, st.integers(0, 40), st.integers(60, 100), st.integers(1, 60))
@example(ticks=1001, turn=HALF, low=0, high=100, pixels=7)
@example(ticks=1000, turn=HALF, low=0, high=100, pixels=300)
@example(ticks=10, turn=Fraction("0.3"), low=1, high=80, pixels=1)
def test_windows_are_where_they_were_asked_for_and_match(
    ticks: int, turn: Fraction, low: int, high: int, pixels: int
) -> None:
    edges = Fraction(low, 100), Fraction(high, 100)
    windows = line_windows(turn, *edges, True, ticks, pixels)
    width = edges[1] - edges[0]
    for window, share in zip(windows, (turn, 1 - turn), strict=True):
        assert abs(window.count - share * width * ticks) <= HALF
    assert windows[0].first >= 0
    assert windows[0].stop <= windows[1].first
    assert windows[1].stop <= ticks
    assert abs(windows[0].first - turn * edges[0] * ticks) <= 2  # a tick, half a pixel's rounding, half a count's
    assume(min(window.count for window in windows) >= pixels)
    mean = sum(apart(windows, turn, ticks, pixels)) / pixels
    limit = HALF / ((1 - turn) * ticks)  # half a tick of the retrace
    touches = windows[1].first == windows[0].stop or windows[1].stop == ticks  # and can go no further
    assert abs(mean) <= limit or touches


@given(st.integers(8, 4000), st.integers(0, 40), st.integers(60, 100), st.integers(1, 60))
def test_no_neighbour_matches_better(ticks: int, low: int, high: int, pixels: int) -> None:
    """The retrace a tick earlier or later has the larger mismatch on average."""
    edges = Fraction(low, 100), Fraction(high, 100)
    forward, backward = line_windows(HALF, *edges, True, ticks, pixels)
    assume(min(forward.count, backward.count) >= pixels)
    found = []
    for by in (-1, 0, 1):
        moved = Window(backward.first + by, backward.count)
        if forward.stop <= moved.first and moved.stop <= ticks:
            found.append(abs(sum(apart((forward, moved), HALF, ticks, pixels))))
    assert min(found) == abs(sum(apart((forward, backward), HALF, ticks, pixels)))


@pytest.mark.parametrize("ticks", [1000, 1001, 999, 1250 - 250, 2003])
def test_whole_pixels_match_exactly_in_odd_lines_too(ticks: int) -> None:
    count = round(0.4 * ticks)
    windows = line_windows(HALF, LOW, HIGH, True, ticks, count)  # a pixel a tick
    assert set(apart(windows, HALF, ticks, count)) == {0}


def test_other_turns_match_where_lines_allow_it() -> None:
    turn = Fraction("0.7")
    assert matching_lines(turn, LOW, HIGH, 1000, 200, 1 << 24) == [2500]
    windows = line_windows(turn, LOW, HIGH, True, 2500, 200)
    assert set(apart(windows, turn, 2500, 200)) == {0}
    assert matching_lines(HALF, LOW, HIGH, 1250, 200, 1 << 24) == [1000, 1500]
    assert matching_lines(HALF, LOW, HIGH, 1000, 200, 1 << 24) == [1000]
    assert matching_lines(Fraction("0.123456789"), LOW, HIGH, 1000, 200, 1 << 24) == []


def test_one_direction_is_a_window_by_itself() -> None:
    assert line_windows(Fraction("0.95"), LOW, HIGH, False, 1000, 4) == (Window(95, 760), Window(0, 0))


def test_what_remains_is_said(tmp_path: Path) -> None:
    """By `show` and in the notes, as a number, beside lines that would have none of it; and not where there is none."""
    schedule = plan_of(tmp_path).schedule
    worst = max(map(abs, apart((schedule.forward, schedule.backward), HALF, 1250, 200)))
    assert worst == HALF / 625
    assert retrace_mismatch(schedule, 0.5) == pytest.approx(float(worst), rel=1e-12)
    setup_of(tmp_path)
    shown = run("show", tmp_path / "scan.toml", "--no-plot", "--all").out
    assert (
        "imaged are ticks 62..561 and 688..1187; a pixel's places in trace and retrace are up to 0.08 % of the" in shown
    )
    assert "a timing.ticks_per_line of 1000 or 1500 makes them match" in shown
    for ticks in ("1000", "1500"):
        setup_of(tmp_path, {"timing.ticks_per_line": ticks})
        shown = run("show", tmp_path / "scan.toml", "--no-plot", "--all").out
        assert "are up to 0.000 % of the line apart" in shown
        assert "makes them match" not in shown
    assert run("check", tmp_path / "scan.toml").err == ""
    # More than a quarter of a pixel is a warning of `check`, at the key that makes the line.
    setup_of(tmp_path, {"timing.ticks_per_line": "1250", "timing.pixels": "300"})
    warned = run("check", tmp_path / "scan.toml")
    assert warned.status == 0
    assert "timing.ticks_per_line: the same pixel of trace and retrace shows places up to 0.08 % of" in warned.err
    setup_of(tmp_path, {"x.band_limit.directions": '"forward"'})
    shown = run("show", tmp_path / "scan.toml", "--no-plot", "--all").out
    assert "imaged are ticks 62..561\n" in shown
