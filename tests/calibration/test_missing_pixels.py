"""Images with missing pixels, missing and clipped rows, and half-empty frames: what is found in spite of them."""

from pathlib import Path

import numpy as np
import pytest
from calibrating import V_MAX, Scanner, lattice
from correcting import old_frame
from distorted_lattices import DistortedLattice, deviation, distorted_lattice, images_of
from lattice_images import narrow_sites, three_sites, without_lattice
from sets import long, one_of

import tablegen
from tablegen.base.input_errors import Rejected, Unphysical
from tablegen.calibration.laws.image_sizes import Acquisition, KnownSample, SampleImage, sizes_of
from tablegen.calibration.laws.images import Pair, fit_images
from tablegen.correction.by_fit import by_fit
from tablegen.correction.old_scan import OldScan
from tablegen.images import image_cell, lattice_filters, missing
from tablegen.images.cell_spots import same_lattice
from tablegen.images.files import read_image
from tablegen.images.indexer import find_cell
from tablegen.images.line_length import Cell
from tablegen.images.missing import completed, count_missing
from tablegen.images.pair_fit import fit_pair
from tablegen.numerics.arrays import Floats
from tablegen.virtual.imaging import FrameImages, SweepImage

pytestmark = pytest.mark.common

GAPS = ("pixels", "rows", "block", "half", "clipped", "stopped")
FULL = [0.037, 0.37, 0.080, 0.48]  # beta and u_peak of the scanner's branches


def lacking(heights: Floats, gap: str, seed: int = 1) -> Floats:
    """Heights with a gap."""
    rng = np.random.default_rng(seed)
    heights, rows = heights.copy(), np.arange(len(heights))
    match gap:
        case "pixels":
            heights[rng.random(heights.shape) < 0.01] = np.nan
        case "rows":
            heights[rng.choice(rows[3:-3], 5, replace=False)] = np.nan
        case "block":
            heights[40:45] = np.nan
        case "half":
            heights[len(rows) // 2 :] = np.nan
        case "clipped":  # half of each row is at the end of the range
            part = heights[30:50]
            part[part > np.median(part, axis=1, keepdims=True)] = np.max(heights)
        case "stopped":
            heights[2 * len(rows) // 3 :] = 0.0
            heights[2 * len(rows) // 3 - 1, 70:] = 0.0
    return heights


def test_gaps_are_counted_and_filled() -> None:
    heights = np.random.default_rng(0).normal(size=(64, 80))
    assert completed([heights]).heights[0] is not None
    assert np.array_equal(completed([heights]).heights[0], heights)  # bit for bit
    assert completed([heights]).weight is None
    heights[5, 7], heights[20], heights[50:] = np.nan, 0.0, np.nan
    assert str(count_missing(heights)) == "15 rows and 1 pixel"
    whole = completed([heights, heights])
    assert whole.rows == slice(0, 50)
    assert whole.weight is not None
    assert np.flatnonzero(whole.weight == 0.0).tolist() == [20]
    assert whole.heights[0][5, 7] == pytest.approx(0.5 * (heights[5, 6] + heights[5, 8]))
    assert np.allclose(whole.heights[0][20], 0.5 * (heights[19] + heights[21]))


def test_too_little_data_is_refused_with_its_reason() -> None:
    heights = np.random.default_rng(0).normal(size=(96, 64))
    few, columns = heights.copy(), heights.copy()
    few[20:], columns[:, 40:] = np.nan, np.nan
    for image in (few, columns):
        with pytest.raises(Unphysical, match=r"(20|0) of 96 rows have data, in 80 % of their columns or more; 32 such"):
            fit_pair(image, image + 0.1, 100.0)
    between = heights.copy()
    between[10:90:2] = np.nan
    with pytest.raises(Unphysical, match="56 of 96 rows have data among rows 1 to 96"):
        completed([between])


def test_files_may_have_missing_pixels(tmp_path: Path) -> None:
    heights = np.random.default_rng(0).normal(size=(64, 80))
    heights[3, 4], heights[60:] = np.nan, np.nan
    np.save(tmp_path / "a.npy", heights)
    image = tablegen.read_image(tmp_path / "a.npy")
    assert image.record["missing"] == {"rows": 4, "pixels": 1}
    assert "4 rows and 1 pixel missing" in image.summary()
    np.save(tmp_path / "b.npy", np.where(np.isnan(heights), np.inf, heights))
    with pytest.raises(Rejected, match="321 pixels are infinite; if they are missing, save them as NaN"):
        read_image(tmp_path / "b.npy")


def hexagonal(size: int = 128) -> tuple[Floats, float]:
    """An image of a lattice with noise, and its constant in pixels."""
    side, turn = 9.3, 0.3
    y, x = np.mgrid[:size, :size].astype(np.float64)
    waves = [
        np.cos(2.0 * np.pi * (x * np.cos(a) + y * np.sin(a)) / (side * 0.75**0.5))
        for a in turn + np.radians([0.0, 60.0, 120.0])
    ]
    return np.sum(waves, axis=0) + 0.4 * np.random.default_rng(2).normal(size=(size, size)), side


@pytest.mark.parametrize("gap", GAPS)
def test_the_cell_is_within_its_error(gap: str, tmp_path: Path) -> None:
    heights, side = hexagonal()
    np.save(tmp_path / "a.npy", lacking(heights, gap))
    result = tablegen.lattice(tmp_path / "a.npy", lattice="hexagonal")
    for one in (result.cell.a, result.cell.b):
        assert abs(one.value - side) < 3.5 * one.standard_error
        assert one.standard_error < 0.01 * side
    assert "missing: " in result.summary()
    assert any(result.record["missing"].values())


def with_gaps(heights: Floats, gap: str) -> Floats:
    """Heights of which columns or rows are missing at equal distances, or repeat the one before."""
    heights = heights.copy()
    match gap:
        case "zero columns":
            heights[:, 1::2] = 0.0
        case "equal columns":
            heights[:, 1::2] = heights[:, ::2]
        case "equal rows":
            heights[1::2] = heights[::2]
        case "third columns":
            heights[:, 1::3] = heights[:, :-1:3]
        case "fourth rows":
            heights[3::4] = np.nan
    return heights


@pytest.mark.parametrize(
    ("gap", "seed"),
    [("zero columns", 1), ("equal columns", 8), ("equal rows", 1), ("third columns", 4), ("fourth rows", 3)],
)
def test_columns_and_rows_missing_at_equal_distances_are_refused(gap: str, seed: int) -> None:
    with pytest.raises(Unphysical, match="constant, or repeat the one before, are missing"):
        find_cell(with_gaps(narrow_sites(seed)[0], gap))


@pytest.mark.parametrize(("gap", "seed"), [("zero columns", 1), ("equal columns", 8), ("fourth rows", 11)])
def test_missing_columns_that_count_as_data_make_a_larger_cell(
    gap: str, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What the check of missing columns and rows refuses would have another cell."""
    monkeypatch.setattr(missing, "_empty_columns", lambda heights, valid: np.zeros(heights.shape[1], dtype=bool))
    monkeypatch.setattr(lattice_filters, "_MOST_REGULAR", 1.0)
    monkeypatch.setattr(image_cell, "_MOST_FAST", 1000)
    heights, cell = narrow_sites(seed)
    assert not same_lattice(find_cell(with_gaps(heights, gap)).vectors, cell)


def test_sites_narrower_than_a_pixel_have_no_wrong_cell(monkeypatch: pytest.MonkeyPatch) -> None:
    heights, cell = narrow_sites(0)
    with pytest.raises(Unphysical, match="sites narrower than a pixel"):
        find_cell(heights)
    monkeypatch.setattr(image_cell, "_MOST_FAST", 1000)
    assert not same_lattice(find_cell(heights).vectors, cell)


@pytest.mark.long
@pytest.mark.parametrize("gap", ["", "zero columns", "equal columns", "equal rows", "third columns", "fourth rows"])
def test_no_narrow_sites_have_a_wrong_cell(gap: str) -> None:
    for seed in range(40):
        heights, cell = narrow_sites(seed)
        try:
            result = find_cell(with_gaps(heights, gap))
        except Unphysical:
            continue
        assert same_lattice(result.vectors, cell), seed


def test_a_sample_without_noise_may_be_constant_along_an_axis() -> None:
    """The rows of a grating repeat each other, and so do two columns in the middle of a symmetric image."""
    wave = np.cos(2.0 * np.pi * (np.arange(64) - 31.5) / 10.0)
    for heights in (np.tile(wave, (64, 1)), wave + np.linspace(0.0, 1.0, 64)[:, None]):
        assert missing.valid_pixels(heights).all()
    assert count_missing(np.repeat(np.random.default_rng(0).normal(size=(32, 64)), 2, axis=0)).rows == 32


@pytest.mark.parametrize("gap", ["half", "stopped"])
def test_weak_lowest_orders_in_part_of_a_frame_give_the_whole_cell(gap: str) -> None:
    heights, cell = three_sites(0)
    vectors = find_cell(lacking(heights, gap)).vectors
    assert same_lattice(vectors, cell)
    strong = np.stack([(cell[0] + cell[1]) / 3.0, cell[1]])  # the cell of the strong spots alone
    assert not same_lattice(vectors, strong)


@pytest.mark.long
@pytest.mark.parametrize("gap", ["half", "stopped"])
def test_no_cell_of_part_of_a_frame_is_wrong(gap: str) -> None:
    accepted = 0
    for seed in range(50):
        heights, cell = three_sites(seed)
        try:
            vectors = find_cell(lacking(heights, gap)).vectors
        except Unphysical:
            continue
        accepted += 1
        assert same_lattice(vectors, cell), seed
    assert accepted >= 45


def test_half_of_noise_is_no_lattice() -> None:
    for seed in range(3):
        with pytest.raises(Unphysical):
            find_cell(lacking(without_lattice(5 * seed), "half"))


@pytest.mark.parametrize("gap", GAPS)
def test_branches_of_images_with_gaps(gap: str) -> None:
    sample = lattice(9.3, 7.0, pixels=128, lines=96)
    images = Scanner().images(100.0, sample, 0.02, np.random.default_rng(4))
    trace, retrace = lacking(images.trace, gap, 5), lacking(images.retrace, gap, 6)
    fit = fit_pair(trace, retrace, 100.0)
    branches = [one for side in (fit.forward, fit.backward) for one in (side.beta, side.u_peak)]
    for estimate, truth in zip(branches, FULL, strict=True):
        assert abs(estimate.value - truth) < 4.0 * estimate.standard_error
    remarks = fit_images([Pair("", 100.0, trace, retrace)], V_MAX).remarks
    assert any("have no data; they have no weight" in str(one) for one in remarks)


@pytest.mark.parametrize("gap", ["rows", "half"])
def test_the_size_of_images_with_gaps(gap: str) -> None:
    constant = 80.0
    sample = lattice(1000.0 / (constant * 0.75**0.5), 7.0, pixels=128, lines=96)
    both = Scanner().images(100.0, sample, 0.02, np.random.default_rng(4))
    image = SampleImage("an image", 100.0, None, lacking(both.trace, gap, 5), lacking(both.retrace, gap, 6), 1.0)
    sizes = sizes_of([image], V_MAX, KnownSample(Cell.hexagonal(constant)), Acquisition())
    assert abs(sizes.images[0].size.nm.value - 1000.0) < 4.0 * sizes.images[0].size.nm.standard_error + 0.5
    assert any("have no data" in str(one) for one in sizes.remarks)


def distorted(gap: str) -> tuple[DistortedLattice, Floats, Floats]:
    """A frame of a lattice of 60 nm, and its images with a gap."""
    frame = old_frame("default", pixels=128, lines=128)
    return DistortedLattice(frame, 60.0, "hexagonal"), *(
        lacking(one.heights, gap, seed) for one, seed in ((frame.trace, 1), (frame.retrace, 2))
    )


def rows_of(whole: DistortedLattice, first: int, stop: int) -> DistortedLattice:
    """Part of a frame."""
    part = [
        SweepImage(*(one[first:stop] for one in (i.heights, i.x_nm, i.y_nm)), tuple(d[first:stop] for d in i.drift_nm))
        for i in (whole.frame.trace, whole.frame.retrace)
    ]
    return DistortedLattice(FrameImages(*part), whole.constant_nm, whole.kind)


@pytest.mark.rest
@pytest.mark.parametrize("seed", long([0], range(2)))
@pytest.mark.parametrize("gap", ["half", "stopped"])
def test_weak_lowest_orders_in_part_of_a_frame_are_corrected_or_refused(seed: int, gap: str) -> None:
    """With the size and the constant, and without them."""
    whole = distorted_lattice(seed)
    trace, retrace = (lacking(one.heights, gap) for one in (whole.frame.trace, whole.frame.retrace))
    size = float(np.ptp(whole.frame.trace.x_nm)), float(np.ptp(whole.frame.trace.y_nm))
    for known, nm, constant in (("size and constant", size, whole.constant_nm), ("nothing", None, None)):
        kind = None if constant is None else whole.kind
        try:
            scan, _ = by_fit(images_of(trace, retrace, nm), OldScan(), lattice_nm=constant, kind=kind)
        except Unphysical:
            continue
        part = rows_of(whole, *scan.record["imaged_rows"])
        assert not deviation(scan.distortion, part, known).wrong


@pytest.mark.rest
@pytest.mark.parametrize("gap", one_of(2, GAPS))
def test_a_correction_is_as_good_with_gaps(gap: str) -> None:
    whole, trace, retrace = distorted(gap)
    size = float(np.ptp(whole.frame.trace.x_nm)), float(np.ptp(whole.frame.trace.y_nm))
    scan, _ = by_fit(images_of(trace, retrace, size), OldScan(), lattice_nm=60.0, kind="hexagonal")
    first, stop = scan.record.get("imaged_rows", [0, len(trace)])
    part = rows_of(whole, first, stop)
    off = deviation(scan.distortion, part, "size and constant")
    assert not off.wrong
    assert off.displacement < 0.3
    assert "missing" in scan.record or "imaged_rows" in scan.record
    picture = scan.pictures[0].heights
    if gap == "block":
        assert 3 <= np.sum(np.isnan(picture[10:-10, 20:100]).all(axis=1)) <= 7
        assert np.sum(np.isnan(picture[10:-10, 20:100]).any(axis=1)) <= 9
    assert (stop - first, len(picture)) == (len(picture), {"half": 64, "stopped": 84}.get(gap, 128))
