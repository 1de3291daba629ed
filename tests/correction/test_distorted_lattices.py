"""Lattices with weak lowest orders, terraces and rows that jump, as a scanner with hysteresis and drift images them."""

from collections.abc import Iterable

import numpy as np
import pytest
from distorted_lattices import Knowledge, accepted_without_period, corrected, deviation, distorted_lattice
from lattice_images import three_sites
from sets import common_of

from tablegen.base.input_errors import Unphysical
from tablegen.images.terraces import without_steps, without_terraces


def accepted_and_wrong(seeds: Iterable[int], known: Knowledge) -> tuple[int, list[int]]:
    """How many images are corrected, and the seeds of those with another cell, or with a pixel at a wrong place."""
    accepted, wrong = 0, []
    for seed in seeds:
        lattice = distorted_lattice(seed)
        try:
            distortion = corrected(lattice, known)
        except Unphysical:
            continue
        accepted += 1
        if deviation(distortion, lattice, known).wrong:
            wrong.append(seed)
    return accepted, wrong


@pytest.mark.common
@pytest.mark.parametrize("seed", [2, 8, 82])
def test_a_distorted_lattice_is_corrected(seed: int) -> None:
    """The terraces of these made the fit fail, or moved rows by 4 pixels."""
    assert accepted_and_wrong([seed], "size and constant") == (1, [])


@pytest.mark.common
def test_an_edge_along_the_rows_does_not_move_them() -> None:
    """The edge of a terrace crosses 9 rows, fewer than those of other terraces: they were off by 1.3 pixels."""
    lattice = distorted_lattice(752)
    error = deviation(corrected(lattice, "size and constant"), lattice, "size and constant")
    assert error.outermost < 0.3


@pytest.mark.long
@pytest.mark.timeout(86_400)
def test_a_dozen_distorted_lattices() -> None:
    assert accepted_and_wrong([0, 1, 3, 4, 5, 7, 9, 10, 19, 24, 53, 98], "size and constant") == (12, [])


@pytest.mark.rest
@pytest.mark.parametrize("known", ["size", "nothing"])
def test_it_is_corrected_without_the_constant(known: Knowledge) -> None:
    assert accepted_and_wrong([8], known) == (1, [])


@pytest.mark.common
def test_without_a_size_another_cell_may_have_the_constant() -> None:
    """Its strong spots are those of a third of the area: the size would be wrong by the root of 3."""
    with pytest.raises(Unphysical, match="may be the constant of the whole cell, or of one with 1/3 of its area"):
        corrected(distorted_lattice(6), "constant")


@pytest.mark.common
@pytest.mark.parametrize("seed", common_of(3, range(3), range(10)))
def test_a_sample_without_a_lattice_is_refused(seed: int) -> None:
    assert not accepted_without_period(seed)


def terraced(step: float = 2.0) -> tuple[np.ndarray, np.ndarray]:
    """A lattice on a slope, with noise and rows that jump, and on one side of an oblique edge higher by a step."""
    rng = np.random.default_rng(3)
    y, x = np.mgrid[:96, :128].astype(np.float64)
    lattice = 0.5 * (np.cos(2.0 * np.pi * (x / 13.0 + y / 40.0)) + np.cos(2.0 * np.pi * (y / 12.0 - x / 50.0)))
    edge = x - 60.0 - 0.2 * y > 0.0
    heights = lattice + 0.1 * rng.normal(size=x.shape) + rng.normal(size=(96, 1)) + 0.05 * x + step * edge
    return heights, lattice


def test_steps_are_removed_and_nothing_else() -> None:
    heights, lattice = terraced()
    level, stepped = without_steps(heights, lattice)
    assert stepped
    remainder = level - lattice
    assert np.std(remainder) == pytest.approx(0.1, rel=0.1)
    assert abs(np.mean(remainder[:, :50]) - np.mean(remainder[:, 90:])) < 0.02
    plain, stepped = without_steps(terraced(0.0)[0], lattice)
    assert not stepped
    assert np.std(plain - lattice) == pytest.approx(0.1, rel=0.1)


def test_a_lattice_without_terraces_is_left_as_it_is() -> None:
    assert without_terraces(terraced(0.0)[0]) is None
    assert without_terraces(terraced()[0]) is not None
    assert without_terraces(three_sites(1)[0]) is None


@pytest.mark.long
def test_the_numbers_of_the_page_of_correct() -> None:
    """Of 1,000 images 95 % are accepted and none wrong; of 200 without a lattice none is accepted."""
    accepted, wrong = accepted_and_wrong(range(1000), "size and constant")
    assert wrong == []
    assert accepted >= 950
    assert not any(accepted_without_period(seed) for seed in range(200))
