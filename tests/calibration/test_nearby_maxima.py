"""Maxima near points, found in buckets, against a look at all of them."""

import numpy as np
import pytest

from tablegen.images import nearby_maxima
from tablegen.images.nearby_maxima import NearbyMaxima

RNG = np.random.default_rng(7)
LAGS = np.round(RNG.uniform(-200.0, 200.0, (3000, 2)), 1)  # some at equal distances
PEAKS = NearbyMaxima(LAGS, RNG.uniform(0.0, 1.0, len(LAGS)))
POINTS = np.concatenate([RNG.uniform(-260.0, 260.0, (60, 2)), [[-200.0, 200.0], [0.0, 0.0], [900.0, -900.0]], LAGS[:5]])


@pytest.mark.parametrize("radius", [1.5, 7.0, 60.0, 700.0])
def test_the_buckets_show_what_a_look_at_all_maxima_shows(radius: float, monkeypatch: pytest.MonkeyPatch) -> None:
    nearest, matched = PEAKS.nearest(POINTS, radius)
    highest = [PEAKS.highest(point, radius) for point in POINTS]
    monkeypatch.setattr(nearby_maxima, "_FEW", len(LAGS))
    every, matched_of_all = PEAKS.nearest(POINTS, radius)
    assert np.array_equal(matched, matched_of_all)
    assert np.array_equal(nearest[matched], every[matched])
    assert highest == [PEAKS.highest(point, radius) for point in POINTS]
    assert matched.any()


def test_few_maxima_are_looked_at() -> None:
    points, _ = PEAKS.around(POINTS, 5.0)
    assert np.max(np.bincount(points)) < 30  # of 3000: those of 24 x 24 pixels at most
