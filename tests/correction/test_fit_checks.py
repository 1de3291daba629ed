"""Corrections by a fit that are refused: another cell would do, too large a displacement, no better agreement."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from correcting import LAWS, off, old_frame, save_pair
from editing import run
from instrument_files import sxm

from tablegen.base.input_errors import Unphysical
from tablegen.correction.agreement import Agreement
from tablegen.correction.by_fit import by_fit
from tablegen.correction.distortion import Distortion, Sweep1D
from tablegen.correction.fit_checks import check_agreement, check_cell, check_moves, check_straight_cell, strange_spot
from tablegen.correction.old_scan import OldScan
from tablegen.correction.periodic_scan import PeriodicScan
from tablegen.correction.scan_images import Choice, read_scan
from tablegen.numerics.arrays import Floats
from tablegen.virtual.imaging import Surface

SHAPE = {"pixels": 128, "lines": 96}
Times = tuple[float, float]  # how often the strong waves have the frequency of the lowest, and by how much they turn
TIMES = {"root of 3": (float(np.sqrt(3.0)), 30.0), "2": (2.0, 0.0), "3": (3.0, 0.0)}


def weak(constant_nm: float, lowest: float, times: Times) -> Surface:
    """A hexagonal lattice whose lowest spots have a share of the amplitude of those of a higher order."""
    steps = 2.0 / np.sqrt(3.0) / constant_nm

    def height(x: Floats, y: Floats) -> Floats:
        total = np.zeros(np.broadcast(x, y).shape)
        for turned, size in ((7.0, 1.0), (67.0, 0.9), (127.0, 0.8)):
            for share, (factor, more) in ((lowest, (1.0, 0.0)), (size, times)):
                a = np.radians(turned + more)
                total += share * np.cos(2.0 * np.pi * factor * steps * (x * np.cos(a) + y * np.sin(a)) + turned)
        return total

    return height


@pytest.mark.common
@pytest.mark.parametrize(("times", "lowest"), [("root of 3", 0.05), ("root of 3", 0.6), ("2", 0.6), ("3", 0.6)])
def test_a_pitch_that_may_be_that_of_the_strong_spots_is_refused(
    times: str, lowest: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The densest rows of which cell have this pitch?"""
    monkeypatch.chdir(tmp_path)
    save_pair(old_frame("paper", surface=weak(50.0 * TIMES[times][0], lowest, TIMES[times]), **SHAPE), tmp_path)
    outcome = run("correct", "trace.npy", "retrace.npy", "--fit", "--pitch-nm", "43.3", "-o", "o.gwy")
    assert (outcome.status, outcome.out) == (2, "")
    assert "43.3 nm may be the constant of the whole cell, or of one with 1/" in outcome.err
    assert not (tmp_path / "o.gwy").exists()


@pytest.mark.common
@pytest.mark.parametrize(("times", "lowest"), [("root of 3", 0.05), ("root of 3", 0.6), ("2", 0.05), ("3", 0.05)])
def test_weak_lowest_spots_are_seen_and_nothing_is_written(
    times: str, lowest: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The size would be wrong by the root of 3, by 2 or by 3, and nothing in the file says which it is."""
    monkeypatch.chdir(tmp_path)
    save_pair(old_frame("paper", surface=weak(50.0 * TIMES[times][0], lowest, TIMES[times]), **SHAPE), tmp_path)
    outcome = run("correct", "trace.npy", "retrace.npy", "--fit", "--lattice-nm", "50", "-o", "o.gwy")
    assert (outcome.status, outcome.out) == (2, "")
    assert len(outcome.messages) == 1
    if times == "3":
        assert "the cell may be a multiple or a root of the sample's: a spot at (" in outcome.err
        assert "is that of another cell with 3 times the area; image more periods" in outcome.err
    else:
        share = {"root of 3": 3, "2": 4}[times]
        assert f"50 nm may be the constant of the whole cell, or of one with 1/{share} of its area" in outcome.err
    assert not (tmp_path / "o.gwy").exists()


@pytest.mark.common
@pytest.mark.parametrize("lowest", [0.05, 0.6])
def test_weak_lowest_spots_are_those_of_the_cell_by_the_size_of_the_file(lowest: float, tmp_path: Path) -> None:
    """The strong spots alone would make the size wrong by the root of 3; the other constant does not fit the size."""
    constant = 50.0 * TIMES["root of 3"][0]
    frame = old_frame("paper", surface=weak(constant, lowest, TIMES["root of 3"]), **SHAPE)
    path = tmp_path / "a.sxm"
    path.write_bytes(sxm({"Z": (frame.trace.heights, frame.retrace.heights)}, (1080.0, 1080.0), times_s=(5e-3, 5e-3)))
    images = read_scan(path, None, Choice())
    scan, fit = by_fit(images, OldScan(), lattice_nm=constant)
    assert (fit.indexed, fit.strong_index) == (True, 3)
    assert off(scan.distortion, frame).size == pytest.approx((0.0, 0.0), abs=0.3)
    with pytest.raises(Unphysical, match="is that of another cell with 3 times the area"):
        by_fit(images, OldScan(), lattice_nm=50.0)


@pytest.mark.common
def test_another_cell_in_the_corrected_image_is_refused(tmp_path: Path) -> None:
    """Negative control: the picture of the right fit passes, with the sizes of another one it does not."""
    frame = old_frame("paper", **SHAPE)
    scan, fit = by_fit(read_scan(*save_pair(frame, tmp_path), Choice()), OldScan(), lattice_nm=60.0)
    pictures = [picture.heights for picture in scan.pictures]
    check_straight_cell(fit, pictures, scan.size_nm, 60.0)
    check_straight_cell(fit, pictures)
    assert scan.size_nm is not None
    with pytest.raises(Unphysical, match=r"does not show the sample's cell: its sides are .* and not 60 nm at 60"):
        check_straight_cell(fit, pictures, (1.03 * scan.size_nm[0], scan.size_nm[1]), 60.0)
    with pytest.raises(Unphysical, match=r"does not show the sample's cell: its sides are .* and not .* pixels at"):
        check_straight_cell(replace(fit, waves=2.0 * fit.waves), pictures)
    noise = np.random.default_rng(1).standard_normal((2, *pictures[0].shape))
    with pytest.raises(Unphysical, match="does not show the sample's cell: no lattice stands out"):
        check_straight_cell(fit, list(noise), scan.size_nm, 60.0)


@pytest.mark.common
def test_the_same_lattice_without_weak_spots_is_corrected(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The negative control."""
    monkeypatch.chdir(tmp_path)
    save_pair(old_frame("paper", surface=weak(100.0, 0.0, TIMES["2"]), **SHAPE), tmp_path)
    assert run("correct", "trace.npy", "retrace.npy", "--fit", "--lattice-nm", "50", "-o", "o.gwy").status == 0


def picture(*waves: tuple[float, float, float], noise: float = 0.0) -> Floats:
    """96 x 128 pixels of waves: amplitude, periods along x and along y."""
    y, x = np.mgrid[:96, :128]
    drawn = [size * np.cos(2.0 * np.pi * (u * x / 128 + v * y / 96) + u) for size, u, v in waves]
    return np.sum(drawn, axis=0) + noise * np.random.default_rng(1).standard_normal((96, 128))


CELL = np.array([[20.0, 3.0], [7.0, 18.0]])
LATTICE = (1.0, 20.0, 3.0), (0.9, 7.0, 18.0), (0.8, 13.0, -15.0)


def test_a_lattice_alone_has_no_strange_spot() -> None:
    spot = strange_spot(picture(*LATTICE, (0.3, 40.0, 6.0), noise=0.1), CELL)
    assert spot is not None
    assert spot.share < 0.02


@pytest.mark.parametrize(
    ("periods", "index", "area"),
    [
        *(((10.0, 1.5), (0.5, 0.0), 2), ((13.5, 10.5), (0.5, 0.5), 2), ((9.0, 7.0), (1 / 3, 1 / 3), 3)),
        *(((6.66, 1.0), (1 / 3, 0.0), 3), ((31.0, -9.0), (1.9, -1.0), None)),
    ],
)
def test_a_spot_of_another_cell(periods: tuple[float, float], index: Floats, area: int | None) -> None:
    spot = strange_spot(picture(*LATTICE, (0.1, *periods), noise=0.1), CELL)
    assert spot is not None
    assert spot.share == pytest.approx(0.1, abs=0.02)
    assert spot.contrast > 4.0
    if area is not None:
        assert spot.index == pytest.approx(index, abs=0.06)
        assert spot.area == area


def test_a_second_direction_is_strange_to_a_grating() -> None:
    spot = strange_spot(picture(*LATTICE), CELL[:1])
    assert spot is not None
    assert spot.share > 0.7
    spot = strange_spot(picture((1.0, 20.0, 3.0), (0.3, 40.0, 6.0), noise=0.1), CELL[:1])
    assert spot is not None
    assert spot.share < 0.02


def straight(rows: int, columns: int) -> Distortion:
    even = (np.arange(columns) + 0.5) / columns
    return Distortion(rows, columns, Sweep1D(even, 0.5 * even), None, np.arange(rows + 1) / rows, np.zeros(rows + 1))


def test_noise_that_hides_spots_is_said() -> None:
    """Weak lower spots are not excluded where noise is as strong as they may be."""
    fit = PeriodicScan(straight(96, 128), CELL, 0.1, True)
    check_cell(fit, picture(*LATTICE, noise=1.0), True)
    with pytest.raises(Unphysical, match="would hide weaker ones; image more periods with less noise"):
        check_cell(fit, picture(*LATTICE, noise=12.0), True)


def test_a_lattice_of_few_periods_hides_the_spots_of_a_larger_cell() -> None:
    few = 0.2 * CELL
    with pytest.raises(Unphysical, match=r"cell cannot be distinguished from its own; image 4\.4 periods or more"):
        check_cell(PeriodicScan(straight(96, 128), few, 0.9, True), picture((1.0, 4.0, 0.6), (0.9, 1.4, 3.6)), True)


def bent(
    x: Callable[[Floats], Floats], y: Callable[[Floats], Floats], shear: float = 0.0, lag: float = 1.0
) -> Distortion:
    even, times = (np.arange(128) + 0.5) / 128, np.arange(97) / 96
    drift = shear * (times - 0.5)
    return Distortion(96, 128, Sweep1D(x(even), 0.5 * even), None, y(times), drift, lag)


def test_hysteresis_may_bow_a_sweep_and_nothing_else_may_move_it() -> None:
    def even(t: Floats) -> Floats:
        return t

    def bow(sagitta: float) -> Callable[[Floats], Floats]:
        return lambda t: t + 4.0 * sagitta * t * (1.0 - t)

    def wave(t: Floats) -> Floats:
        return t + 0.07 * np.sin(4.0 * np.pi * t)

    for accepted in (bent(bow(0.09), bow(-0.09)), bent(even, even, 0.08)):
        check_moves(accepted)
    for refused, name, what in (
        (bent(bow(0.16), even), "columns", "in a bow"),
        (bent(even, bow(0.16)), "rows", "in a bow"),
        (bent(wave, even), "columns", "beside the bow"),
        (bent(even, wave), "rows", "beside the bow"),
        (bent(even, even, 0.2), "columns", "beside the bow"),
        (bent(even, even, 0.0, 41.0), "rows", "beside the bow"),
    ):
        with pytest.raises(Unphysical, match=rf"^{name} would move by \d+\.\d % of the picture {what}"):
            check_moves(refused)


def agreement(difference: tuple[float, float], apart: tuple[float, float]) -> Agreement:
    return Agreement(difference, np.array([10.0]), (np.array([apart[0]]), np.array([apart[1]])))


@pytest.mark.parametrize(
    ("difference", "apart", "accepted"),
    [
        *(((1.0, 0.1), (20.0, 0.1), True), ((0.77, 0.76), (3.0, 0.3), True), ((0.2, 0.2), (0.1, 0.1), True)),
        *(((0.77, 0.76), (3.0, 2.9), False), ((0.7, 0.75), (0.1, 0.1), False), ((0.7, 0.9), (3.0, 0.2), False)),
    ],
)
def test_agreement_has_to_improve(difference: tuple[float, float], apart: tuple[float, float], accepted: bool) -> None:
    """Images that agreed to half a pixel before need not agree better, and none may agree less."""
    if accepted:
        check_agreement(agreement(difference, apart))
        return
    with pytest.raises(Unphysical, match="trace and retrace do not agree better after the correction: they differ by"):
        check_agreement(agreement(difference, apart))


def test_a_trace_alone_has_nothing_to_agree_with() -> None:
    check_agreement(None)


@pytest.mark.common
def test_no_better_agreement_ends_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    save_pair(old_frame("paper", **SHAPE), tmp_path)
    found = agreement((0.8, 0.79), (3.0, 3.0))
    monkeypatch.setattr("tablegen.correction.straight.agreement", lambda *_: found)
    outcome = run("correct", "trace.npy", "retrace.npy", "--fit", "-o", "o.gwy")
    assert (outcome.status, outcome.out) == (2, "")
    assert "trace and retrace do not agree better after the correction: they differ by 80 % of the" in outcome.err
    assert not (tmp_path / "o.gwy").exists()


@pytest.mark.common
def test_the_height_of_the_file_is_compared_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A frame of 1080 x 1080 nm, and a file that has half of its height."""
    monkeypatch.chdir(tmp_path)
    frame = old_frame("paper", **SHAPE)
    for height in (1080.0, 540.0):
        content = sxm({"Z": (frame.trace.heights, frame.retrace.heights)}, (1080.0, height))
        (tmp_path / f"{height:g}.sxm").write_bytes(content)
    assert run("correct", "1080.sxm", "--fit", "--lattice-nm", "60").status == 0
    outcome = run("correct", "540.sxm", "--fit", "--lattice-nm", "60", "-o", "o.gwy")
    assert (outcome.status, outcome.out) == (2, "")
    assert "the frame is 1080 nm high by the sample's constant, and 540 nm by the file" in outcome.err


@pytest.mark.common
def test_the_scan_angle_is_kept_and_said_where_an_axis_is_taken(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    frame = old_frame("paper", **SHAPE)
    both = frame.trace.heights, frame.retrace.heights
    content = sxm({"Z": both}, (1080.0, 1080.0), angle_deg=90.0, times_s=(5e-3, 5e-3))
    (tmp_path / "a.sxm").write_bytes(content)
    (tmp_path / "scanner.toml").write_text(LAWS, "utf-8")
    fitted = run("correct", "a.sxm", "--fit", "--json")
    assert json.loads(fitted.out)["scan_angle_deg"] == 90.0
    assert "scan angle" not in run("correct", "a.sxm", "--fit").out
    drive = ("--scanner", "scanner.toml", "--size-v", "90", "--offset-v", "50", "--rate-hz", "100")
    text = "note: scan angle 90 degrees: the fast axis was y; the correction took [x] of the scanner file for the fast"
    assert text in run("correct", "a.sxm", *drive).out


def test_the_turn_of_the_file_is_taken_and_said_unless_one_is_given(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """12.5 s forward and 2.5 s back are a turn of 0.833."""
    monkeypatch.chdir(tmp_path)
    frame = old_frame("paper", **SHAPE)
    both = frame.trace.heights, frame.retrace.heights
    (tmp_path / "a.sxm").write_bytes(sxm({"Z": both}, (1080.0, 1080.0), times_s=(12.5, 2.5)))
    (tmp_path / "scanner.toml").write_text(LAWS.replace("turn = 0.5", "turn = 0.8", 1), "utf-8")
    drive = ("correct", "a.sxm", "--scanner", "scanner.toml", "--size-v", "90", "--offset-v", "50")
    record = json.loads(run(*drive, "--json").out)
    assert record["x"]["turn"] == record["file_turn"] == pytest.approx(12.5 / 15.0)
    assert record["x"]["rate_hz"] == pytest.approx(1.0 / 15.0)
    assert record["y"]["turn"] == 0.5
    assert "turn 0.8333, as the image file states" in run(*drive).out
    given = run(*drive, "--turn", "0.8", "--json")
    assert json.loads(given.out)["x"]["turn"] == 0.8
    assert "as the image file states" not in run(*drive, "--turn", "0.8").out
