"""The lattice of an image: of known cells, of none, and of files of real instruments."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from lattice_images import three_sites, without_lattice
from real_files import real_folder

import tablegen
from tablegen.base.input_errors import Unphysical
from tablegen.cli import cli
from tablegen.images import image_cell
from tablegen.images.ambiguous_cell import likelihoods
from tablegen.images.autocorrelation import Spots
from tablegen.images.cell_spots import same_lattice
from tablegen.images.cell_vectors import area, reduced, sides_and_angle
from tablegen.images.indexer import find_cell
from tablegen.images.measured_cell import measured_cell

REAL = real_folder()


def plain_lattice(side: float = 12.0, turn: float = 0.4, size: int = 128) -> tuple[np.ndarray, np.ndarray]:
    """A hexagonal lattice of one site, with some noise, and its cell."""
    cell = side * np.array([[np.cos(turn), np.sin(turn)], [np.cos(turn + np.pi / 3), np.sin(turn + np.pi / 3)]])
    y, x = np.mgrid[:size, :size].astype(np.float64)
    at = np.stack([x, y], axis=-1) @ np.linalg.inv(cell)
    heights = np.cos(2 * np.pi * at[..., 0]) + np.cos(2 * np.pi * at[..., 1]) + np.cos(2 * np.pi * (at.sum(axis=-1)))
    return heights + 0.3 * np.random.default_rng(1).normal(size=heights.shape), cell


@pytest.mark.common
def test_a_plain_cell_is_right_within_its_errors() -> None:
    heights, cell = plain_lattice()
    result = find_cell(heights)
    measured = measured_cell(result.vectors, result.covariance, (1.0, 1.0))
    for estimate, truth in zip((measured.a, measured.b, measured.angle_deg), (12.0, 12.0, 60.0), strict=True):
        assert abs(estimate.value - truth) < 4.0 * estimate.standard_error + 1e-3 * truth
        assert estimate.standard_error < 0.01 * truth
    assert same_lattice(result.vectors, cell)


def test_missing_rows_and_pixels_do_not_matter() -> None:
    heights, cell = plain_lattice()
    heights[:12] = np.nan
    heights[90:] = 0.0  # a scan that was stopped
    heights[np.random.default_rng(2).random(heights.shape) < 0.02] = np.nan
    assert same_lattice(find_cell(heights).vectors, cell)


def test_pixels_need_not_be_square() -> None:
    heights, cell = plain_lattice(16.0)
    wide = find_cell(heights[:, ::2])
    measured = measured_cell(wide.vectors, wide.covariance, (2.0, 1.0))
    assert np.allclose(sides_and_angle(measured.vectors), sides_and_angle(reduced(cell)), rtol=0.01)


def accepted_and_wrong(seeds: range) -> tuple[int, list[int]]:
    """How many images of three sites have a cell, and the seeds of those whose cell is wrong."""
    accepted, wrong = 0, []
    for seed in seeds:
        heights, cell = three_sites(seed)
        try:
            result = find_cell(heights)
        except Unphysical:
            continue
        accepted += 1
        if not same_lattice(result.vectors, cell):
            wrong.append(seed)
    return accepted, wrong


@pytest.mark.common
@pytest.mark.parametrize("seed", [1019, 1043, 1031])
def test_slow_waves_of_a_terrace_make_no_larger_cell(seed: int) -> None:
    """The steps along the rows are levelled, and what remains has fewer than four periods in one direction."""
    assert accepted_and_wrong(range(seed, seed + 1)) == (1, [])


@pytest.mark.common
def test_an_ambiguous_lattice_names_the_cells_with_their_likelihoods() -> None:
    with pytest.raises(Unphysical, match=r"14\.41 x 14\.41 pixels at 60 degrees \(\d+ %\)") as reason:
        find_cell(three_sites(5051)[0])
    assert "may be 14.41 x 24.97 pixels at 90 degrees (" in str(reason.value)
    assert "ambiguous" in str(reason.value)


def test_likelihoods_prefer_the_cell_whose_waves_are_the_spots() -> None:
    cell = np.array([[14.0, 1.0], [-2.0, 13.0]])
    numbers = np.array([[0, 1], [1, 0], [1, 1], [1, -1], [2, 0], [0, 2], [2, 1]])
    spots = Spots(numbers @ np.linalg.inv(cell).T, np.full(7, 30.0), np.ones(7))
    double, half = cell * [[2.0], [1.0]], cell * [[0.5], [1.0]]
    shares = likelihoods([double, cell, half], spots, np.array([128.0, 128.0]))
    assert shares.sum() == pytest.approx(1.0)
    assert shares[1] > shares[0] > shares[2]


def test_half_of_the_columns_may_be_missing() -> None:
    heights, cell = plain_lattice()
    heights[:, :60] = np.nan
    assert same_lattice(find_cell(heights).vectors, cell)


@pytest.mark.long
@pytest.mark.timeout(86_400)
def test_weak_lowest_orders_terraces_and_rows_that_jump() -> None:
    accepted, wrong = accepted_and_wrong(range(24))
    assert wrong == []
    assert accepted >= 22


@pytest.mark.long
def test_of_many_images_95_percent_are_accepted_and_none_wrong() -> None:
    accepted, wrong = accepted_and_wrong(range(7000, 7160))
    assert wrong == []
    assert accepted >= 152


@pytest.mark.long
def test_the_numbers_of_the_page() -> None:
    """Of 400 images with weak lowest orders, terraces and rows that jump 395; of 200 without a lattice none."""
    accepted, wrong = accepted_and_wrong(range(6000, 6400))
    assert wrong == []
    assert accepted >= 395
    assert accepted_without_lattice(range(200)) == []


def largest_ratio(seed: int) -> float | None:
    """Largest distance of a side or the angle from the truth, in standard errors; None if the image is refused."""
    heights, cell = three_sites(seed)
    try:
        result = find_cell(heights)
    except Unphysical:
        return None
    measured = measured_cell(result.vectors, result.covariance, (1.0, 1.0))
    truth = sides_and_angle(np.round(measured.vectors @ np.linalg.inv(cell)) @ cell)
    estimates = (measured.a, measured.b, measured.angle_deg)
    return max(abs(one.value - true) / one.standard_error for one, true in zip(estimates, truth, strict=True))


@pytest.mark.parametrize("seed", [30001, 30013, 30015])
def test_the_errors_contain_what_levelling_shifts(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Rows that jump and terraces move the maxima of all blocks alike: the blocks alone do not show it."""
    ratio = largest_ratio(seed)
    assert ratio is not None
    assert ratio < 3.0
    monkeypatch.setattr(image_cell, "_scatter", lambda views, vectors: np.zeros((4, 4)))
    blocks_alone = largest_ratio(seed)
    assert blocks_alone is not None
    assert blocks_alone > 3.0


@pytest.mark.long
def test_of_200_images_2_percent_are_beyond_three_standard_errors() -> None:
    """A side or the angle; by the blocks alone, 9 % were."""
    ratios = [ratio for seed in range(30000, 30200) if (ratio := largest_ratio(seed)) is not None]
    assert len(ratios) >= 190
    assert np.mean(np.array(ratios) > 3.0) <= 0.02
    assert np.mean(np.array(ratios) > 2.0) <= 0.08


def accepted_without_lattice(seeds: range) -> list[int]:
    """The seeds of images without a lattice that have a cell."""
    accepted = []
    for seed in seeds:
        try:
            find_cell(without_lattice(seed))
        except Unphysical:
            continue
        accepted.append(seed)
    return accepted


@pytest.mark.rest
def test_images_without_a_lattice_are_refused() -> None:
    assert accepted_without_lattice(range(40)) == []


@pytest.mark.common
def test_a_grating_is_one_direction_and_has_a_pitch() -> None:
    heights = without_lattice(2)
    with pytest.raises(Unphysical, match="--lattice grating"):
        find_cell(heights)
    rng = np.random.default_rng(2)
    rng.normal(size=(128, 128))
    u, v = rng.uniform(0.05, 0.2), rng.uniform(0.0, 0.2)
    pitch = tablegen.lattice(heights, lattice="grating").pitch
    assert pitch.value == pytest.approx(1.0 / np.hypot(u, v), abs=5.0 * pitch.standard_error)
    assert pitch.standard_error < 0.01 * pitch.value


def with_hum(heights: np.ndarray, forward: bool, seed: int = 1) -> np.ndarray:
    """The second and the fifth harmonic of a wave in time, which are at no fraction of the lattice's waves."""
    rows, columns = heights.shape
    elapsed = np.arange(columns) / columns * (1.0 if forward else -1.0)
    time = np.arange(rows)[:, None] * 2.2613 + elapsed
    hum = sum(np.cos(2.0 * np.pi * n * 7.13 * time + n) for n in (2, 5))
    noise = np.random.default_rng(seed).normal(size=heights.shape)
    return np.asarray(heights + 0.15 * np.std(heights) * hum + 0.1 * np.std(heights) * noise)


def test_hum_of_a_retrace_alone_is_refused_as_what_it_is() -> None:
    """With the trace beside it, whose hum is mirrored, the cell is found; all spots were called strange."""
    heights, cell = three_sites(30004)
    trace, retrace = with_hum(heights, True), with_hum(heights, False, 2)
    with pytest.raises(Unphysical, match=r"spectrum: 4 of 38 significant spots remain; .* which tell hum"):
        find_cell(retrace, None, area(cell))
    assert same_lattice(find_cell(retrace, trace, area(cell)).vectors, cell)


def test_too_few_periods_are_refused() -> None:
    with pytest.raises(Unphysical):
        find_cell(plain_lattice(90.0)[0])


@pytest.mark.common
def test_the_command_prints_the_cell_and_the_shift_and_writes_nothing(tmp_path: Path) -> None:
    heights, _ = plain_lattice(14.0)
    np.save(tmp_path / "trace.npy", heights[:, 4:])
    np.save(tmp_path / "retrace.npy", heights[:, 1:-3])
    files = [str(tmp_path / "trace.npy"), str(tmp_path / "retrace.npy")]
    text = CliRunner().invoke(cli, ["lattice", *files], catch_exceptions=False)
    assert "size unknown" in text.output
    assert "cell: 1" in text.output
    record = json.loads(CliRunner().invoke(cli, ["lattice", *files, "--json"], catch_exceptions=False).output)
    assert record["retrace_shift_pixels"]["value"] == pytest.approx([3.0, 0.0], abs=0.2)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["retrace.npy", "trace.npy"]


@pytest.mark.common
@pytest.mark.parametrize("first_row", ["top", "bottom"])
def test_the_plot_shows_the_spots_where_the_spectrum_is_high(first_row: str) -> None:
    """The lattice is not symmetric, so that a mirrored spectrum would show its maxima elsewhere."""
    result = tablegen.lattice(plain_lattice()[0][:, :104])
    heights, spectrum = replace(result, scan=replace(result.scan, first_row=first_row)).charts().charts[:2]
    assert (heights.key, spectrum.key) == ("lattice", "spectrum")
    assert spectrum.x_label == "waves along x [1/pixels]"
    raster = spectrum.raster
    assert raster is not None
    rows, columns = raster.values.shape
    x, y = np.concatenate([[curve.x, curve.y] for curve in spectrum.curves], axis=1)
    assert len(x) >= 3
    for sign in (1, -1):  # the left half is the right one, turned
        column = np.round((0.5 + sign * x / (raster.x[1] - raster.x[0])) * columns - 0.5).astype(int)
        row = np.round((0.5 - sign * y / (raster.y[1] - raster.y[0])) * rows - 0.5).astype(int)
        assert np.all(raster.values[row, column] > np.median(raster.values) + 10.0)  # dB
    assert spectrum.arrows is not None
    sides, waves = (np.stack([one.dx, one.dy], axis=1) for one in (heights.arrows, spectrum.arrows) if one is not None)
    assert sides @ waves.T == pytest.approx(np.eye(2), abs=1e-9)


def test_the_plot_of_a_grating_shows_its_wave() -> None:
    result = tablegen.lattice(without_lattice(2), lattice="grating")
    spectrum = result.charts().charts[1]
    assert result.wave is not None
    assert [(curve.x.tolist(), curve.y.tolist()) for curve in spectrum.curves] == [
        ([result.wave[0]], [-result.wave[1]])
    ]
    assert "1 of 1 spots" in spectrum.title


if REAL is not None:  # else the run says so at its end

    @pytest.mark.common
    def test_silicon_7x7_in_both_directions() -> None:
        result = tablegen.lattice(REAL / "si7x7_50nm.sxm", channel="Z", lattice="hexagonal", lattice_nm=2.688)
        for cell in (result.cell, result.retrace_cell):
            assert cell is not None
            assert 2.99 < cell.a.value < 3.02
            assert 3.38 < cell.b.value < 3.56
            assert 77.0 < cell.angle_deg.value < 79.0

    def test_the_retrace_of_silicon_alone() -> None:
        """Its hum is told by the trace of the file; without the trace it is refused for the spots of hum."""
        file = REAL / "si7x7_50nm.sxm"
        for constant in (None, 2.688):
            result = tablegen.lattice(file, channel="Z backward", lattice_nm=constant)
            assert 2.99 < result.cell.a.value < 3.02
            assert 3.38 < result.cell.b.value < 3.56
            assert 77.0 < result.cell.angle_deg.value < 79.0
        image = tablegen.read_image(file, channel="Z backward")
        with pytest.raises(Unphysical, match=r"may be 15\.44 x 17\.49 pixels at 77\.1 degrees \(above 99 %\)"):
            find_cell(image.heights)
        with pytest.raises(Unphysical, match=r"4 of 54 significant spots remain.*trace and retrace, which tell hum"):
            tablegen.lattice(image, lattice_nm=2.688)
        with pytest.raises(Unphysical, match="the fitted channel is a retrace"):
            tablegen.correct(file, channel="Z backward", fit=True, lattice_nm=2.688)
        with pytest.raises(Unphysical, match=r"the lattice is ambiguous: the cell may be 15\.44 x 17\.49"):
            tablegen.correct(image.heights, fit=True, lattice_nm=2.688)

    @pytest.mark.common
    def test_the_protein_of_a_movie_is_hexagonal() -> None:
        """Neither its sides nor its angle are those of the cell whose strong spots alone are looked at."""
        result = tablegen.lattice(REAL / "protein_lattice_100nm.asd", frames=(0, 8))
        assert result.cell.a.value == pytest.approx(17.6, abs=0.2)
        assert result.cell.b.value == pytest.approx(18.05, abs=0.3)
        assert result.cell.angle_deg.value == pytest.approx(62.0, abs=0.8)

    @pytest.mark.parametrize("direction", ["forward", "backward"])
    def test_a_moire_of_fewer_than_three_periods(direction: str) -> None:
        result = tablegen.lattice(REAL / "moire_10nm.sxm", channel=f"Z {direction}")
        assert result.cell.a.value == pytest.approx(3.78, abs=0.1)
        assert result.cell.b.value == pytest.approx(4.02, abs=0.15)
        assert result.cell.angle_deg.value == pytest.approx(62.7, abs=2.0)
        assert 0.01 < result.cell.a.standard_error < 0.1

    @pytest.mark.common
    def test_graphite_needs_its_constant() -> None:
        """Beside a step, graphite has a superstructure of three times the area."""
        lines = (REAL / "hopg_11nm_iso28600.spm").read_text("latin-1").splitlines()
        begin = lines.index("end of header") + 1
        heights = np.array([float(line) for line in lines[begin : begin + 512 * 512]]).reshape(512, 512)
        pixel = 11.4807 / 512
        with pytest.raises(Unphysical):
            find_cell(heights)
        cell = find_cell(heights, None, 0.246**2 * 0.75**0.5 / pixel**2)
        a, b, angle = sides_and_angle(cell.vectors * pixel)
        assert 0.2 < a < 0.26
        assert 0.2 < b < 0.26
        assert 60.0 < angle < 75.0
