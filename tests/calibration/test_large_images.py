"""Images of more pixels than are searched: in blocks, or in the centre. The limit is lowered: images are small."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from test_image_lattice import plain_lattice

import tablegen
from tablegen.base.input_errors import Unphysical
from tablegen.cli import cli
from tablegen.images import image_grating, indexer, searched_part
from tablegen.images.direction_shift import direction_shift
from tablegen.images.image_grating import find_grating
from tablegen.images.indexer import find_cell, same_lattice
from tablegen.images.searched_part import aliased, central_part, complete_part

SIZE = 384


@pytest.fixture
def few_pixels(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nine times fewer pixels are searched than the images have."""
    monkeypatch.setattr(searched_part, "_MOST_PIXELS", SIZE**2 // 9)


@pytest.mark.parametrize(("side", "block"), [(40.0, 3), (26.0, 2), (6.0, 1)])
def test_the_cell_is_that_of_the_full_search(side: float, block: int, monkeypatch: pytest.MonkeyPatch) -> None:
    heights, truth = plain_lattice(side, size=SIZE)
    full = find_cell(heights)
    assert full.part.whole
    monkeypatch.setattr(searched_part, "_MOST_PIXELS", SIZE**2 // 9)
    cell = find_cell(heights)
    assert cell.part.block == block
    assert cell.part.cropped == (block < 3)
    assert same_lattice(cell.vectors, truth)
    errors = np.sqrt(np.diag(cell.covariance) + np.diag(full.covariance)) + 1e-3 * side
    change = np.round(full.vectors @ np.linalg.inv(cell.vectors)) @ cell.vectors - full.vectors
    assert np.all(np.abs(change.ravel()) < 4.0 * errors)
    assert np.all(np.abs(cell.spots.waves[cell.explained] @ cell.vectors.T % 1.0 - 0.5) > 0.35)


def test_without_the_checks_blocks_show_another_cell(few_pixels: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """Negative control: a period of 4.4 pixels looks like a longer one in blocks of 3."""
    heights, truth = plain_lattice(5.1, size=SIZE)
    monkeypatch.setattr(indexer, "largest_block", lambda heights, part: 3)
    assert same_lattice(find_cell(heights).vectors, truth)
    monkeypatch.setattr(indexer, "aliased", lambda heights, part, waves: np.zeros(1, dtype=bool))
    try:
        wrong = find_cell(heights).vectors
    except Unphysical:
        return
    assert not same_lattice(wrong, truth)


def test_an_alias_moves_by_another_phase_than_the_wave_that_it_looks_like() -> None:
    y, x = np.mgrid[:SIZE, :SIZE].astype(np.float64)
    blocks = central_part(complete_part(np.cos(x + y)), 3)
    for u, v in ((0.05, 0.03), (0.02, -0.07)):
        for beside in ((0.0, 0.0), (1 / 3, 0.0), (0.0, 1 / 3), (-1 / 3, 1 / 3)):
            heights = np.cos(2.0 * np.pi * ((u + beside[0]) * x + (v + beside[1]) * y))
            waves = [np.array([[3.0 * u, 3.0 * v]])] * 2
            assert np.all(aliased(heights, blocks, waves)) == (beside != (0.0, 0.0))


def test_a_fine_lattice_around_an_empty_centre_is_not_taken_for_a_coarse_one(few_pixels: None) -> None:
    heights, truth = plain_lattice(5.1, size=SIZE)
    heights[120:264, 120:264] = 0.3 * np.random.default_rng(4).normal(size=(144, 144))
    with pytest.raises(Unphysical, match="so large an image is searched in its centre, rows 129 to 256"):
        find_cell(heights)
    assert truth.shape == (2, 2)


def test_a_large_cell_with_fine_waves_needs_a_smaller_image(few_pixels: None) -> None:
    heights, _ = plain_lattice(40.0, size=SIZE)
    fine, _ = plain_lattice(5.0, size=SIZE)
    with pytest.raises(Unphysical, match="slow waves of a large cell beside fine ones, too many"):
        find_cell(heights + fine)


def test_missing_rows_beside_blocks(few_pixels: None) -> None:
    heights, truth = plain_lattice(40.0, size=SIZE)
    heights[:41] = np.nan
    heights[np.random.default_rng(2).random(heights.shape) < 0.02] = np.nan
    cell = find_cell(heights)
    assert same_lattice(cell.vectors, truth)
    assert cell.part.block > 1
    assert cell.part.rows[0] >= 41


def test_the_shift_of_the_retrace_is_in_pixels(few_pixels: None) -> None:
    heights, _ = plain_lattice(40.0, size=SIZE + 8)
    trace, retrace = heights[4:-4, 8:], heights[4:-4, 3:-5]
    cell = find_cell(trace)
    assert cell.part.block > 1
    shift = direction_shift(trace, retrace, cell)
    assert shift.pixels == pytest.approx([5.0, 0.0], abs=0.3)


@pytest.mark.parametrize(("pitch", "block"), [(30.0, 3), (5.0, 1)])
def test_the_pitch_of_a_grating_is_in_pixels(pitch: float, block: int, few_pixels: None) -> None:
    _, x = np.mgrid[:SIZE, :SIZE].astype(np.float64)
    heights = np.cos(2.0 * np.pi * x / pitch) + 0.3 * np.random.default_rng(3).normal(size=(SIZE, SIZE))
    grating = find_grating(heights)
    assert grating.part.block == block
    error = np.sqrt(grating.covariance[0, 0])
    assert grating.wave[0] == pytest.approx(1.0 / pitch, abs=5.0 * error)
    assert error < 0.01 / pitch


def test_a_grating_in_blocks_is_checked_for_aliases(few_pixels: None, monkeypatch: pytest.MonkeyPatch) -> None:
    _, x = np.mgrid[:SIZE, :SIZE].astype(np.float64)
    heights = np.cos(2.0 * np.pi * x / 3.5) + 0.1 * np.random.default_rng(3).normal(size=(SIZE, SIZE))
    monkeypatch.setattr(image_grating, "largest_block", lambda heights, part: 3)
    assert find_grating(heights).wave[0] == pytest.approx(1.0 / 3.5, rel=0.01)
    monkeypatch.setattr(image_grating, "aliased", lambda heights, part, waves: np.zeros(1, dtype=bool))
    assert find_grating(heights).wave[0] == pytest.approx(1.0 / 3.0 - 1.0 / 3.5, rel=0.01)  # the negative control


def test_text_json_and_charts_tell_of_the_blocks(few_pixels: None, tmp_path: Path) -> None:
    heights, _ = plain_lattice(40.0, size=SIZE)
    np.save(tmp_path / "large.npy", heights)
    file = str(tmp_path / "large.npy")
    text = CliRunner().invoke(cli, ["lattice", file], catch_exceptions=False).output
    assert "searched: rows 2 to 382, columns 2 to 382, blocks of 3 x 3 pixels" in text
    record = json.loads(CliRunner().invoke(cli, ["lattice", file, "--json"], catch_exceptions=False).output)
    assert record["searched"] == {"rows": [1, 382], "columns": [1, 382], "block_pixels": 3}
    result = tablegen.lattice(heights)
    picture, spectrum, around = result.charts().charts
    assert picture.x_limits == (0.0, SIZE)
    assert around.x_limits == pytest.approx((0.0, SIZE), abs=8.0)
    assert spectrum.arrows is not None
    assert around.arrows is not None
    sides, waves = (np.stack([one.dx, one.dy], axis=1) for one in (around.arrows, spectrum.arrows))
    assert sides @ waves.T == pytest.approx(np.eye(2), abs=1e-9)


def test_half_an_image_is_said() -> None:
    heights, _ = plain_lattice()
    assert "searched" not in tablegen.lattice(heights).summary()
    heights[:, :60] = np.nan
    assert "searched: rows 1 to 128, columns 61 to 128" in tablegen.lattice(heights).summary()
