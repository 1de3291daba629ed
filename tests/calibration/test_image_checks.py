"""What is wrong with images is told, with what to do; and what only looks wrong is not."""

from collections.abc import Callable

import numpy as np
import pytest

from tablegen.base.input_errors import Unphysical
from tablegen.images.pair_checks import (
    check_heights,
    check_mirrored,
    check_pair,
    check_periods,
    check_size,
)
from tablegen.images.pair_fit import check_fit
from tablegen.images.periodic_model import BASES, LAG, Geometry, PeriodicModel
from tablegen.numerics.arrays import Floats


def bars(periods: float = 9.5, columns: int = 128, rows: int = 64, noise: float = 0.0) -> Floats:
    """Round bars, turned by some degrees."""
    x, y = np.arange(columns) / columns, np.arange(rows)[:, None] / rows
    clean = np.tanh(2.5 * (np.sin(2.0 * np.pi * (periods * x + 1.3 * y)) + 0.3))
    return clean + noise * np.random.default_rng(1).standard_normal(clean.shape)


@pytest.mark.parametrize(
    ("image", "said"),
    [
        (bars()[:20], "20 x 128 pixels are too few"),
        (np.full((40, 40), np.nan), "has no pixel with a height; was a different channel saved?"),
        (np.full((40, 40), 2.0), "no contrast: all its pixels are 2; was a different channel saved?"),
        (np.minimum(bars(noise=0.1), 0.8), "is saturated: .* are 0.8, the largest height; scan again"),
        (np.maximum(bars(noise=0.1), -0.9), "is saturated: .* are -0.9, the least height"),
        (np.clip(np.round(200.0 * bars(noise=0.1)), 0, 255), "is saturated"),
    ],
)
def test_heights_that_cannot_be_used_are_told(image: Floats, said: str) -> None:
    with pytest.raises(Unphysical, match=said):
        check_heights("trace", image)


@pytest.mark.parametrize(
    "image",
    [
        bars(),  # flat tops, without noise
        np.round(100.0 * bars()),
        np.round(4.0 * bars(noise=0.1)),  # few steps
        np.where(np.arange(64)[:, None] < 10, 0.0, 3.0 + bars(noise=0.1)),  # not begun yet: of the lines
    ],
)
def test_flat_tops_and_few_steps_are_not_saturated(image: Floats) -> None:
    check_heights("trace", image)


def test_two_images_of_one_scan() -> None:
    image = bars()
    with pytest.raises(Unphysical, match="64 x 128 and 64 x 122 pixels; both must be from one scan"):
        check_pair(image, image[:, :122])  # half a period of crop
    for same in (image, image[:, ::-1]):
        with pytest.raises(Unphysical, match="are the same image"):
            check_pair(image, same)
    check_pair(image, bars(noise=0.01))


@pytest.mark.parametrize(
    ("periods", "said"), [(1.5, "at least 3 are needed"), (90.0, "are too fine"), (200.0, "are too fine"), (9.5, "")]
)
def test_periods_that_columns_cannot_show(periods: float, said: str) -> None:
    if not said:
        check_periods(periods, 1.0, 256)
        return
    with pytest.raises(Unphysical, match=said):
        check_periods(periods, 1.0, 256)


def test_another_size_than_said() -> None:
    check_size(1000.0, 1300.0, "the scanner file")
    for ratio in (2.0, 0.5, np.sqrt(2.0), 1.0 / np.sqrt(2.0), np.sqrt(3.0)):
        with pytest.raises(Unphysical, match="by the sample's constant, and 1000 nm by the scanner file"):
            check_size(1000.0 * ratio, 1000.0, "the scanner file")


def rough(seed: int) -> Floats:
    """A surface without a period, of features some ten pixels wide."""
    f = np.hypot(np.fft.fftfreq(96)[:, None], np.fft.rfftfreq(160))
    white = np.random.default_rng(seed).standard_normal((96, 160))
    return np.fft.irfft2(np.fft.rfft2(white) * np.exp(-((20.0 * f) ** 2)), (96, 160))


@pytest.mark.parametrize("sample", [lambda: rough(3), lambda: bars(rows=96, columns=160)])
def test_a_mirrored_retrace_is_told_with_and_without_a_period(sample: Callable[[], Floats]) -> None:
    """Trace and retrace up to a tenth of the line apart, as hysteresis has them."""
    place = np.arange(160.0)
    trace = sample()
    lag = 10.0 * np.sin(np.pi * place / 160.0)
    retrace = np.stack([np.interp(place + lag, place, row) for row in trace])
    check_mirrored(trace, retrace, "unused")
    with pytest.raises(Unphysical, match="only when it is mirrored; turn it"):
        check_mirrored(trace, retrace[:, ::-1], "turn it")
    check_mirrored(trace, rough(4), "unused")  # another sample is another matter


def test_a_trace_alone_that_is_not_periodic_is_refused_with_a_remedy() -> None:
    geometry = Geometry(64, 64)
    noise = np.asarray(geometry.levelled(np.random.default_rng(1).standard_normal((64, 64))), dtype=np.float64)
    nowhere = np.zeros(64)
    model = PeriodicModel(geometry, [(True, noise)], [(1,)], 3, (nowhere, nowhere))
    start = np.zeros(BASES + 4)
    start[[LAG, BASES]] = 1.0, 10.0
    with pytest.raises(Unphysical, match=r"0 % of the trace's contrast is .* something else; crop the image to one"):
        check_fit(model, model.at(start), np.ones(len(start), dtype=np.bool_))
