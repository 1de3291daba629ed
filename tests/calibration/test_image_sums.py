"""Sums over images that are calculated in a short way: each agrees with the long one."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from tablegen.correction.fit_checks import _bow
from tablegen.images.autocorrelation import _overlap
from tablegen.images.cell_errors import block_sums
from tablegen.images.lattice_filters import FilteredImage, filtered_images
from tablegen.images.periodic_model import _real_product, _with_real
from tablegen.images.spots import _FINE_STEP_PERIODS, _FINE_STEPS, _matches

RANDOM = np.random.default_rng(3)


def images() -> list[FilteredImage]:
    """Filtered images whose weight is a product of rows and columns, and one with a gap, whose weight is none."""
    heights = np.random.default_rng(1).normal(size=(48, 40))
    heights[10, 5:15] = np.nan
    return [*filtered_images(np.nan_to_num(heights)), filtered_images(heights)[0]]


@pytest.mark.parametrize("number", [0, 1, 2])
def test_products_over_blocks_are_those_of_the_shifted_images(number: int) -> None:
    image = images()[number]
    assert (image.factors is None) == (number == 2)
    x, y, blocks = 3, -5, 3
    first, second = (slice(5, 48), slice(0, 37)), (slice(0, 43), slice(3, 40))
    window = image.weight[first] * image.weight[second]
    for sums, whole in zip(
        block_sums(image, image, (x, y), blocks),
        (image.values[first] * image.values[second] * window, window),
        strict=True,
    ):
        rows, columns = (np.linspace(0, count, blocks + 1).astype(int) for count in whole.shape)
        expected = [whole[i:j, k:m].sum() for i, j in pairwise(rows) for k, m in pairwise(columns)]
        assert sums == pytest.approx(np.array(expected), abs=1e-10)


@pytest.mark.parametrize("number", [0, 1, 2])
def test_the_overlap_of_windows_is_that_of_the_transform(number: int) -> None:
    image = images()[number]
    shape = (96, 80)
    expected = np.fft.irfft2(np.abs(np.fft.rfft2(image.weight, shape)) ** 2, shape)
    assert np.allclose(_overlap(image), expected, rtol=0.0, atol=1e-10)
    other = replace(image, weight=image.weight**2)
    assert not np.allclose(_overlap(other), expected, rtol=0.0, atol=1e-3)


def test_waves_beside_one_are_powers_of_a_step() -> None:
    x, profile = np.sort(RANDOM.random(200)), RANDOM.normal(size=200) + 1j * RANDOM.normal(size=200)
    q = 17.3 + np.arange(-_FINE_STEPS, _FINE_STEPS + 1) * _FINE_STEP_PERIODS
    expected = np.abs(np.exp(-2j * np.pi * np.outer(q, x)) @ profile)
    assert np.allclose(_matches(17.3, x, profile), expected, rtol=0.0, atol=1e-10)
    assert not np.allclose(_matches(17.4, x, profile), expected, rtol=0.0, atol=1e-3)


def test_products_of_real_parts() -> None:
    one, other = (RANDOM.normal(size=(8, 8)) + 1j * RANDOM.normal(size=(8, 8)) for _ in range(2))
    assert np.allclose(_real_product(one, other), np.real(one @ other), atol=1e-12)
    assert np.allclose(_with_real(one, other.real), one @ other.real, atol=1e-12)
    assert not np.allclose(_real_product(one, np.conj(other)), np.real(one @ other), atol=1e-3)


def test_the_bow_is_that_of_a_fit_to_all_pixels() -> None:
    place = np.linspace(-1.0, 1.0, 50)
    displacement = 2.0 * place**2 - place**3 + 0.1 * RANDOM.normal(size=(40, 50))
    displacement[RANDOM.random(displacement.shape) < 0.1] = np.nan
    there = np.isfinite(displacement)
    cubic = np.polynomial.Polynomial.fit(np.tile(place, (40, 1))[there], displacement[there], 3, domain=(-1.0, 1.0))
    bow = cubic(place)
    bowed, beside = _bow(displacement)
    assert bowed == pytest.approx(np.max(np.abs(bow - np.linspace(bow[0], bow[-1], 50))), abs=1e-10)
    assert beside == pytest.approx(np.nanmax(np.abs(displacement - bow)), abs=1e-10)
    assert bowed > 1.0
