"""Series by their Taylor expansions and by transforms, against the sum of their harmonics."""

import numpy as np
import pytest

from tablegen.waveform.sampler import Expansion, on_grid
from tablegen.waveform.series import FourierSeries


def series(harmonics: int, seed: int) -> FourierSeries:
    """Random coefficients that fall like those of a line."""
    rng = np.random.default_rng(seed)
    fall = 1.0 / np.arange(1.0, harmonics + 1.0) ** 2
    return FourierSeries(0.5, fall * rng.normal(size=harmonics), fall * rng.normal(size=harmonics))


@pytest.mark.parametrize("harmonics", [1, 7, 32, 64, 200])
def test_an_expansion_is_the_sum_of_its_harmonics(harmonics: int) -> None:
    """The value and two derivatives, at any time, before and behind the period too: to 1e-13 of the largest."""
    waveform = series(harmonics, harmonics)
    t = np.concatenate([np.random.default_rng(1).uniform(-1.0, 2.0, 500), [0.0, 0.5, 1.0, 1.0 / 3.0]])
    found = Expansion(waveform).at(t, 0, 1, 2)
    for order, values in enumerate(found):
        right = waveform.value(t, order)
        assert np.max(np.abs(values - right)) < 1e-13 * (1.0 + harmonics * np.max(np.abs(right)))
    assert np.array_equal(Expansion(waveform).at(t, 1)[0], found[1])


@pytest.mark.parametrize(("harmonics", "count"), [(1, 64), (32, 1024), (21, 1344)])
def test_a_grid_by_transform_is_the_one_by_harmonics(harmonics: int, count: int) -> None:
    waveform = series(harmonics, 3)
    assert np.max(np.abs(on_grid(waveform, count) - waveform.on_grid(count))) < 1e-14
