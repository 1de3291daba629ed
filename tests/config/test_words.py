"""Words for images: what they make of sizes, lines and rates, against plain arithmetic on what is played."""

from fractions import Fraction
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from editing import SCAN, SCANNER, edited, run, write_pair
from hypothesis import assume, example, given
from hypothesis import strategies as st

import tablegen
from tablegen.base.input_errors import Problems
from tablegen.base.toml import parse_toml
from tablegen.config.load import from_values
from tablegen.device.schedule import Schedule
from tablegen.planning.timing import make_schedule

K = 20.0  # nm/V, of a piezo whose size is proportional to its voltage
BETA, U_PEAK = 0.06, 0.45  # of the hysteresis, at every size
BRANCH = {"points": [{"size_v": volts, "beta": BETA, "u_peak": U_PEAK} for volts in (1.0, 150.0)]}
HYSTERESIS = {"branches": [{"turn": turn, "forward": BRANCH, "backward": BRANCH} for turn in (0.5, 0.95)]}
SCANNER_VALUES: dict[str, Any] = {
    "name": "test",
    "v_max": 150.0,
    "x": {"size": {"k_nm_per_v": K}, "hysteresis": HYSTERESIS},
    "y": {"like": "x"},
}
DAC = {"bits": 20, "v_min": 0.0, "v_max": 15.0, "update_rate_hz": 200e3}
VALUES: dict[str, Any] = {
    "image_um": 2.0,
    "dac": DAC,
    "amplifier": {"gain": 10.0},
    "timing": {"pixels": 512, "image_lines": 512, "line_rate_hz": 1.0},
    "x": {"offset_v": 75.0, "table": {"bits": 20}},
    "y": {"like": "x"},
}


def with_timing(**timing: Any) -> dict[str, Any]:
    """The values with other words for lines and rates."""
    return {**VALUES, "timing": {"pixels": 512, **timing}}


def schedule_of(values: dict[str, Any]) -> Schedule:
    """The ticks and lines of values, without any waveform."""
    problems = Problems()
    found = make_schedule(from_values(values, SCANNER_VALUES), problems)
    problems.stop_if_any()
    assert found is not None
    return found


def position(codes: np.ndarray, span_nm: float) -> np.ndarray:
    """Where a piezo with (17)'s hysteresis is on the way up, in nm from the offset, by bisection of its equation."""
    volts = 150.0 * codes / 2.0**20
    w = (volts - 75.0) * K / span_nm + 0.5
    at_peak = U_PEAK - BETA
    s, c = np.sin(pi * at_peak), np.cos(pi * at_peak)
    rows = [[s, c - 1.0 + 2.0 * at_peak], [pi * c, -pi * s + 2.0]]
    xi, xi_gamma = np.linalg.solve(rows, [BETA, 0.0])
    low, high = np.full_like(w, -0.2), np.full_like(w, 1.2)
    for _ in range(60):
        middle = 0.5 * (low + high)
        u = (1 + 2 * xi_gamma) * middle + xi * np.sin(pi * middle) + xi_gamma * (np.cos(pi * middle) - 1)
        low, high = np.where(u < w, middle, low), np.where(u < w, high, middle)
    return span_nm * (low - 0.5)


@pytest.mark.common
@pytest.mark.parametrize("frame", ["flyback", "up-down"])
def test_two_micrometres_of_512_lines_at_1_hz_are_that(frame: str) -> None:
    built = tablegen.build(scan={**with_timing(image_lines=512, line_rate_hz=1.0, frame=frame)}, scanner=SCANNER_VALUES)
    schedule = built.plan.schedule
    assert built.warnings == []
    assert (schedule.line_rate, schedule.pixel_ticks.denominator) == (1, 1)
    line_nm = built.plan.x.drive.size_nm
    x = built.plan.x.codes(0, schedule.ticks)
    edges = position(x[[schedule.forward.first, schedule.forward.stop]].astype(float), line_nm)
    assert edges[1] - edges[0] == pytest.approx(2000.0, abs=0.05)
    assert np.mean(edges) == pytest.approx(0.0, abs=0.1)
    # y at the first tick of the first image line, and at that after the last one.
    starts = np.array([schedule.up.first, schedule.up.stop]) * schedule.ticks
    y = np.array([built.plan.y.codes(tick, tick + 1)[0] for tick in starts])
    assert schedule.up.count == 512
    edges = position(y.astype(float), built.plan.y.drive.size_nm)
    assert edges[1] - edges[0] == pytest.approx(2000.0, abs=0.2)
    assert schedule.down.count == (512 if frame == "up-down" else 0)


def image_lines_played(schedule: Schedule) -> tuple[int, int]:
    """Lines of which every tick is one at which y is in its image, up and down, counted in whole line periods."""
    up = [n for n in range(schedule.lines) if schedule.up.first <= n < schedule.up.stop]
    down = [n for n in range(schedule.lines) if schedule.down.first <= n < schedule.down.stop]
    assert all(n + 1 <= schedule.turn_line for n in up)
    assert all(n >= schedule.turn_line for n in down)
    return len(up), len(down)


@pytest.mark.common
@given(
    lines=st.integers(1, 3000),
    pixels=st.integers(1, 1000),
    rate=st.floats(0.5, 2000.0),
    mode=st.sampled_from(["flyback", "up-down", None]),
    by_frame=st.booleans(),
    window=st.sampled_from([None, [0.1, 0.9], [0.05, 0.95], [0.0, 1.0], [0.2, 0.7]]),
)
@example(lines=512, pixels=512, rate=1.0, mode="flyback", by_frame=False, window=None)
@example(lines=1, pixels=1, rate=100.0, mode="up-down", by_frame=True, window=[0.1, 0.9])
@example(lines=1, pixels=65, rate=192.25, mode="flyback", by_frame=False, window=None)
def test_any_image_has_the_lines_that_were_asked_for(
    lines: int, pixels: int, rate: float, mode: str | None, by_frame: bool, window: list[float] | None
) -> None:
    timing: dict[str, Any] = {"pixels": pixels, "image_lines": lines}
    timing |= {"frame_rate_hz": rate / (1.2 * lines)} if by_frame else {"line_rate_hz": rate}
    timing |= {} if mode is None else {"frame": mode}
    y: dict[str, Any] = {"like": "x"} if window is None else {"like": "x", "band_limit": {"window": window}}
    values = {**VALUES, "timing": timing, "y": y}
    setup, problems = from_values(values, SCANNER_VALUES), Problems()
    schedule = make_schedule(setup, problems)
    assert {problem.key for problem in problems.entries} <= {"timing.pixels", "timing.image_lines"}  # too many of them
    assume(schedule is not None)
    assert schedule is not None
    up, down = image_lines_played(schedule)
    assert up == lines
    assert down == (0 if mode == "flyback" else lines)
    # No more is spent on turnarounds than the window says, and a few lines.
    share = 0.9 if window is None else window[1] - window[0]
    ways = 1.0 if mode == "flyback" else 2.0
    assert schedule.lines <= ways * lines / share / (0.95 if mode == "flyback" else 1.0) * 1.01 + 8
    # The rate is the nearest that whole ticks give, of lines or of frames.
    asked = Fraction(repr(timing["frame_rate_hz"])) * schedule.lines if by_frame else Fraction(repr(rate))
    assert abs(schedule.ticks - 200_000 / asked) <= Fraction(1, 2)
    assert schedule.frame_rate == Fraction(200_000, schedule.ticks * schedule.lines)
    # The window of x is the default one or one near it with whole ticks a pixel; its size follows.
    scan = setup.scan
    low, high = scan.x.band_limit.window
    assert (low, high) == (0.1, 0.9) or schedule.pixel_ticks.denominator == 1
    assert high - low == pytest.approx(0.8, abs=0.05 + 1e-9)  # 1/8 to 7/8 is 0.05 narrower
    assert (scan.x.size_nm, scan.x.size_of, scan.y.size_nm, scan.y.size_of) == (2000.0, "window", 2000.0, "window")


@given(st.integers(8, 3000), st.sampled_from(["flyback", "up-down"]))
def test_a_frame_of_so_many_line_periods_keeps_them(lines: int, mode: str) -> None:
    schedule = schedule_of(with_timing(lines=lines, frame=mode, line_rate_hz=10.0))
    up, down = image_lines_played(schedule)
    assert schedule.lines == lines
    assert down == (0 if mode == "flyback" else up)
    assert up >= 0.8 * lines / (2 if down else 1) - 3


@pytest.mark.parametrize(("lines", "harmonics"), [(200, 64), (20, 11)])
def test_a_y_that_steps_has_the_harmonics_that_its_lines_carry(lines: int, harmonics: int) -> None:
    values = with_timing(image_lines=lines, line_rate_hz=40.0, frame="flyback", pixels=64)
    plan = tablegen.plan(scan={**values, "y": {"like": "x", "motion": "step"}}, scanner=SCANNER_VALUES)
    assert plan.y.series.harmonics == harmonics
    assert plan.schedule.up.count == lines
    assert (plan.schedule.lines - 1) // 2 >= harmonics


def test_a_speed_is_that_of_the_tip_over_the_window() -> None:
    for key, value in (("speed_mm_per_s", 0.04), ("speed_um_per_s", 40.0)):
        schedule = schedule_of(with_timing(image_lines=64, **{key: value}))
        seconds = schedule.forward.count / 200e3  # for 2 um
        assert 2.0 / seconds == pytest.approx(40.0, rel=2e-4)


def test_micrometres_are_the_nanometres_that_they_say() -> None:
    """0.3 um are 300 nm and not the 300.00000000000006 of floats: the same bytes."""
    one = edited(SCAN, "x.size_nm = 300.0", "y.size_nm = 300.0")
    other = edited(one, "- x.size_nm", "x.size_um = 0.3", "- y.size_nm", "y.size_um = 0.3")
    plans = []
    for text in (one, other):
        values = parse_toml(text, "scan.toml")[0]
        scanner = parse_toml(SCANNER, "scanner.toml")[0]
        plans.append(tablegen.plan(scan=values, scanner=scanner))
    assert plans[0].x.program.words.tobytes() == plans[1].x.program.words.tobytes()
    assert plans[0].x.program.output == plans[1].x.program.output
    setup = from_values({**VALUES, "x": {"offset_um": 0.7}, "y": {"offset_nm": 1}}, SCANNER_VALUES)
    assert setup.scan.x.offset_nm == 700.0


MIXED = {
    ("image_nm = 100",): [
        "scan.toml:24: x.size_nm: image_nm on line 1 sets the size of both axes already, as that of the imaging "
        "windows; leave out one of the two",
        "scan.toml:40: y.size_nm: image_nm on line 1 sets the size of both axes already, as that of the imaging "
        "windows; leave out one of the two",
    ],
    ("x.size_um = 0.2",): ["scan.toml:23: x.size_um: size_nm is given as well; keep one of the two"],
    ("timing.image_lines = 100",): ["scan.toml:18: timing.image_lines: lines is given as well; keep one of the two"],
    ("timing.frame_rate_hz = 2",): [
        "scan.toml:18: timing.frame_rate_hz: line_rate_hz is given as well; keep one of the two"
    ],
    ("timing.frame = 'flyback'",): [
        "scan.toml:42: y.turn: timing.frame on line 18 sets where y turns; leave out one of the two",
        "scan.toml:48: y.band_limit.directions: timing.frame on line 18 sets the directions of y; leave out one of "
        "the two",
    ],
    ("timing.frame = 'down'",): [
        "scan.toml:18: timing.frame: 'down' is not one of 'flyback', 'up-down'",
        "scan.toml:42: y.turn: timing.frame on line 18 sets where y turns; leave out one of the two",
        "scan.toml:48: y.band_limit.directions: timing.frame on line 18 sets the directions of y; leave out one of "
        "the two",
    ],
    ("timing.ticks_per_line = 1250", "- timing.line_rate_hz", "timing.frame_rate_hz = 2"): [
        "scan.toml:18: timing.frame_rate_hz: timing.ticks_per_line on line 19 sets the length of the line already; "
        "leave out one of the two"
    ],
    ("- timing.line_rate_hz",): [
        "scan.toml:17: timing.line_rate_hz: missing; give line_rate_hz or frame_rate_hz or speed_um_per_s or "
        "speed_mm_per_s"
    ],
    ("- timing.line_rate_hz", "timing.speed_um_per_s = 9", "- x.size_nm", "x.size_v = 20"): [
        "scan.toml:18: timing.speed_um_per_s: x.size_v on line 23 gives no length, which a speed needs; give a size in "
        "nm, or a line rate"
    ],
    ("image_nm = [1, 2, 3]", "- x.size_nm", "- y.size_nm"): [
        "scan.toml:1: image_nm: 3 entries are too many, at most 2 are taken"
    ],
    ("image_nm = [200, 2000]", "- x.size_nm", "- y.size_nm"): [
        "scan.toml:1: image_nm: y: its line of 2222.22 nm needs 1.649 of v_max; at most 1294.64 nm fit, a window of "
        "1165.17 nm"
    ],
    ("- timing.lines", "timing.image_lines = 32000", "- y.turn", "- y.band_limit.directions"): [
        "scan.toml:18: timing.image_lines: 32000 image lines in the window [0.05, 0.95] of y take about 71111.11 line "
        "periods a frame, above 65536; at most 29491 fit, or widen the window"
    ],
    ("image_nm = 0.1", "y.size_of = 'window'", "x.tilt = 1", "timing.pixels = 0", "- x.size_nm", "- y.size_nm"): [
        "scan.toml:19: timing.pixels: 0 is below 1",
        "scan.toml:24: x.tilt: unknown key; known here: band_limit, frame_refinement, motion, offset_nm, offset_um, "
        "offset_v, park_v, refinement, size_nm, size_of, size_um, size_v, table, turn",
        "scan.toml:40: y.size_of: image_nm on line 1 sets the size of both axes already, as that of the imaging "
        "windows; leave out one of the two",
    ],
}


@pytest.mark.parametrize("edits", MIXED, ids="; ".join)
def test_mixed_words_are_refused_with_reason_line_and_remedy(edits: tuple[str, ...], tmp_path: Path) -> None:
    path = write_pair(tmp_path, edited(SCAN, *edits))
    outcome = run("check", path)
    assert outcome.status == 2
    assert outcome.err.replace(f"{tmp_path}/", "").splitlines() == MIXED[edits]


def test_a_slower_frame_is_advised_where_a_frame_rate_was_asked_for(tmp_path: Path) -> None:
    """The advice is a value of the key that was written, and it is enough."""
    edits = ["- timing.line_rate_hz", "timing.frame_rate_hz = 3.0", "amplifier.max_slew_v_per_s = 20000"]
    outcome = run("check", write_pair(tmp_path, edited(SCAN, *edits)))
    assert "scan.toml:18: timing.frame_rate_hz: the x drive slews at" in outcome.err
    advised = outcome.err.split("about frame_rate_hz = ")[1].split()[0]
    again = edited(SCAN, edits[0], f"timing.frame_rate_hz = {advised}", edits[2])
    assert run("check", write_pair(tmp_path, again)).status == 0


def test_build_and_show_say_what_was_chosen(tmp_path: Path) -> None:
    words = ["- timing.lines", "timing.image_lines = 170", "- y.turn", "- y.band_limit.directions"]
    words += ["timing.frame = 'flyback'", "image_nm = 180.0", "- x.size_nm", "- y.size_nm"]
    path = write_pair(tmp_path, edited(SCAN, *words))
    shown = [run("show", path, "--no-plot"), run("build", path, "-o", tmp_path / "out")]
    for outcome in shown:
        assert outcome.status == 0, outcome.err
        chosen = [line for line in outcome.out.splitlines() if line.startswith("chosen: ")]
        assert any("170 image lines take 200 line periods a frame" in line for line in chosen), outcome.out
        assert any("span 180 x 180 nm: the lines are 225 x 200 nm long" in line for line in chosen)


def test_a_file_without_words_has_nothing_chosen_for_it(tmp_path: Path) -> None:
    assert tablegen.load(write_pair(tmp_path)).choices == ()


def test_words_are_the_keys_that_they_are_solved_for(tmp_path: Path) -> None:
    """The same scan in other words: line periods, turn, window, sizes of the windows. Every file is the same."""
    words = with_timing(image_lines=61, frame_rate_hz=0.5, frame="flyback")
    words["timing"]["pixels"] = 50
    scan = from_values(words, SCANNER_VALUES).scan
    sizes = {"size_nm": 2000.0, "size_of": "window", "offset_v": 75.0, "table": {"bits": 20}}
    limit = {"window": list(scan.y.band_limit.window), "directions": "forward", "harmonics": 64}
    keys = {
        "dac": DAC,
        "amplifier": {"gain": 10.0},
        "timing": {"pixels": 50, "lines": scan.timing.lines, "line_rate_hz": 0.5 * scan.timing.lines},
        "x": {**sizes, "band_limit": {"window": list(scan.x.band_limit.window)}},
        "y": {**sizes, "turn": scan.y.turn, "band_limit": limit},
    }
    one, other = (tablegen.build(scan=values, scanner=SCANNER_VALUES) for values in (words, keys))
    assert one.choices
    assert other.choices == ()
    assert one.files == other.files
