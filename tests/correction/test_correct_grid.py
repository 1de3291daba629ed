"""The straight grid: what was nowhere is masked, what is straight stays, planes come back whatever bent them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tablegen.base.input_errors import Unphysical
from tablegen.correction.agreement import agreement, difference
from tablegen.correction.distortion import Distortion, Resampler, Sweep1D
from tablegen.correction.residual_lattice import residual_lattice
from tablegen.numerics.arrays import Floats
from tablegen.virtual.imaging import grating, hexagonal

ROWS, COLUMNS = 48, 64
PLACE = (np.arange(COLUMNS) + 0.5) / COLUMNS
FRAME = np.arange(ROWS + 1) / ROWS
BEND = st.floats(-0.12, 0.12)


def distortion(
    forward: Floats, backward: Floats, y: Floats, drift: Floats | None = None, lag: float = 1.0
) -> Distortion:
    sweeps = Sweep1D(forward, 0.5 * PLACE), Sweep1D(backward, 1.0 - 0.5 * PLACE)
    return Distortion(ROWS, COLUMNS, *sweeps, y, np.zeros(ROWS + 1) if drift is None else drift, lag)


def bent(place: Floats, by: float, skew: float) -> Floats:
    """Monotone on 0..1, which it keeps."""
    return place + by * np.sin(np.pi * place) + 0.5 * skew * np.sin(2.0 * np.pi * place)


def seen(found: Distortion, forward: bool, surface: str) -> Floats:
    """A plane as that scan would show it, by the definition of where its pixels are."""
    side = found.side(forward)
    time = np.arange(ROWS)[:, None] + 0.5 + found.lag * (side.time - 0.5)
    x = side.x + np.interp(time, np.arange(ROWS + 1.0), found.drift)
    return x if surface == "x" else np.interp(time, np.arange(ROWS + 1.0), found.y)


def test_what_is_straight_stays_bit_for_bit_where_nothing_moves() -> None:
    found = distortion(PLACE, PLACE, FRAME, lag=0.0)
    image = np.random.default_rng(1).standard_normal((ROWS, COLUMNS))
    for forward in (True, False):
        assert Resampler.of(found, forward)(image) == pytest.approx(image, abs=1e-12)
        assert np.nanmax(np.abs(found.displacement(forward))) < 1e-9


@settings(max_examples=25, deadline=None)
@given(BEND, BEND, BEND, BEND, st.floats(-0.05, 0.05), st.booleans(), st.sampled_from([0.0, 1.0]))
def test_planes_come_back(a: float, b: float, c: float, d: float, drift: float, forward: bool, lag: float) -> None:
    """x and y themselves are the heights: each pixel of the straight image then says where it is."""
    moved = drift * (FRAME**2 - 0.5)
    found = distortion(bent(PLACE, a, b), bent(PLACE, -c, b), bent(FRAME, d, c), moved, lag)
    found.check()
    straighten = Resampler.of(found, forward)
    x, y = found.grid
    for surface, expected in (("x", x[None, :]), ("y", y[:, None])):
        picture = straighten(seen(found, forward, surface))
        inner = np.isfinite(picture)
        error = np.abs(picture - expected)
        assert inner.mean() > 0.6
        assert np.max(error[inner]) < 6e-4  # of the width: a thirtieth of a pixel, where the frame is bent most


@settings(max_examples=20, deadline=None)
@given(BEND, BEND, st.integers(0, 2**32 - 1))
def test_noise_is_never_more(a: float, b: float, seed: int) -> None:
    found = distortion(bent(PLACE, a, b), bent(PLACE, b, a), bent(FRAME, a, b))
    noise = np.random.default_rng(seed).standard_normal((ROWS, COLUMNS))
    straight = Resampler.of(found, True)(noise)
    assert np.nanstd(straight) < 1.05 * np.std(noise)


def test_what_was_not_imaged_is_masked_and_nothing_else() -> None:
    """The retrace of a window that lies further left: its right columns have nothing there."""
    found = distortion(0.1 + 0.8 * PLACE, 0.8 * PLACE, FRAME, lag=0.0)
    trace, retrace = (np.isfinite(Resampler.of(found, way)(np.ones((ROWS, COLUMNS)))) for way in (True, False))
    x, _ = found.grid
    edge = 0.4 / COLUMNS  # half a pixel: the middle of the first one
    assert np.array_equal(trace, np.broadcast_to(x >= 0.1 + edge, (ROWS, COLUMNS)))
    assert np.array_equal(retrace, np.broadcast_to(x <= 0.8 - edge, (ROWS, COLUMNS)))


def test_rows_before_a_turn_are_left_out() -> None:
    """As of creep after a flyback: the axis goes on back for five rows."""
    y = np.where(np.arange(ROWS + 1) < 5, 0.2 - 0.04 * np.arange(ROWS + 1), FRAME - 5.0 / ROWS)
    found = distortion(PLACE, PLACE, y)
    found.check()
    assert found.left_out == (5, 0)
    assert found.y_range == (pytest.approx(0.0), pytest.approx(1.0 - 5.0 / ROWS))
    picture = Resampler.of(found, True)(seen(found, True, "y"))
    assert picture[8:-2, 2:-2] == pytest.approx(
        np.broadcast_to(found.grid[1][8:-2, None], (ROWS - 10, COLUMNS - 4)), abs=2e-3
    )


@pytest.mark.parametrize(("x", "y", "part"), [(PLACE**0.0, FRAME, "column"), (PLACE, np.minimum(FRAME, 0.5), "row")])
def test_what_stands_still_is_refused(x: Floats, y: Floats, part: str) -> None:
    with pytest.raises(Unphysical, match=f"stands still or goes back at {part}"):
        distortion(x, PLACE, y).check()


def test_the_distance_of_two_pictures_is_measured() -> None:
    """A pattern that is 1.7 pixels further right in the retrace; by the noise no more than a twentieth off."""
    x, y = np.meshgrid(np.arange(256.0), np.arange(96.0))
    random = np.random.default_rng(2)
    trace, retrace = (hexagonal(21.0)(x - by, y) + 0.2 * random.standard_normal(x.shape) for by in (0.0, 1.7))
    still = Distortion(
        96,
        256,
        *(Sweep1D(np.arange(256.0), np.linspace(0.0, 0.5, 256)) for _ in "ab"),
        np.arange(97.0),
        np.zeros(97),
        0.0,
    )
    found = agreement((trace, retrace), (trace, retrace), still)
    assert found.offsets[0] == pytest.approx(found.offsets[1], abs=1e-6)
    assert found.offsets[1] == pytest.approx(np.full(len(found.place), 1.7), abs=0.05)
    assert difference(trace, trace) == 0.0
    assert difference(trace, random.standard_normal(x.shape)) == pytest.approx(1.0, abs=0.05)
    nothing = agreement((trace, random.standard_normal(x.shape)), (trace, random.standard_normal(x.shape)), still)
    assert nothing.worst is None


@pytest.mark.common
def test_a_bent_lattice_is_seen_and_a_straight_one_is_none() -> None:
    x, y = np.meshgrid(np.arange(256.0), np.arange(192.0))
    bend = 1.5 * np.sin(2.0 * np.pi * x / 256.0)
    for surface, both in ((hexagonal(16.0), True), (grating(12.0), False)):
        straight, found = residual_lattice(surface(x, y)), residual_lattice(surface(x + bend, y))
        assert straight is not None
        assert found is not None
        assert (found.y is not None) == both
        assert straight.worst[0] < 0.1
        inside = np.isfinite(found.x)
        expected = bend[inside] - np.polyval(np.polyfit(x[inside], bend[inside], 1), x[inside])
        assert -found.x[inside] == pytest.approx(expected, abs=0.25)
    assert residual_lattice(np.random.default_rng(3).standard_normal((192, 256))) is None
