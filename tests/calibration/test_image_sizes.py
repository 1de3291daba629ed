"""Images of a sample of known constant to the length of the line, however it lies; and what is refused."""

from math import sqrt

import numpy as np
import pytest
from calibrating import LATTICE_NM, PITCH_NM, V_MAX, Scanner, grating, lattice, measured, scan_of, trials
from calibrating import Sample as Seen
from hypothesis import given, settings
from hypothesis import strategies as st
from lattice_images import three_sites
from replacing import replace
from sets import long

from tablegen.base.input_errors import Unphysical
from tablegen.calibration.laws.image_sizes import Acquisition, KnownSample, SampleImage, sizes_of
from tablegen.fitting.estimate import Estimate
from tablegen.fitting.least_squares import Solution, solve, with_errors
from tablegen.images.cell_vectors import reduced, sides_and_angle
from tablegen.images.fast_axis_line import fit_line
from tablegen.images.line_length import Cell, Grating
from tablegen.numerics.arrays import Floats

pytestmark = pytest.mark.common

HEXAGONAL = KnownSample(Cell.hexagonal(LATTICE_NM))
BARS = KnownSample(None, Grating(PITCH_NM))
FULL_NM = 1000.0  # the line of 100 V, in which samples count their periods


def shown(seen: Seen, noise: float = 0.0, seed: int = 0, alone: bool = False, v: float = 100.0) -> SampleImage:
    both = Scanner().images(v, seen, noise, np.random.default_rng(seed))
    return SampleImage("an image", v, None, both.trace, None if alone else both.retrace)


def size(image: SampleImage, sample: KnownSample, **options: object) -> Estimate:
    return sizes_of([image], V_MAX, sample, Acquisition(**options)).images[0].size.nm  # type: ignore[arg-type]


def cell(a_nm: float, b_nm: float, gamma: float, angle: float, **options: float) -> Seen:
    """Any lattice: the waves of its reciprocal cell, and their sum."""
    g, turn = np.radians([gamma, angle])
    direct = np.array([[a_nm, 0.0], [b_nm * np.cos(g), b_nm * np.sin(g)]])
    direct = direct @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    first, second = FULL_NM * np.linalg.inv(direct).T
    waves = [
        (float(np.hypot(*wave)), float(np.degrees(np.arctan2(wave[1], wave[0]))), height, begins)
        for wave, height, begins in ((first, 1.0, 0.0), (second, 0.8, 0.3), (first + second, 0.5, 0.1))
    ]
    return Seen(tuple(waves), **options)  # type: ignore[arg-type]


@given(
    angle=st.floats(-90.0, 90.0),
    periods=st.floats(5.0, 16.0),
    drift=st.floats(-0.03, 0.03),
    turn=st.floats(0.3, 0.7),
    alone=st.booleans(),
)
@settings(max_examples=6, deadline=None)
def test_a_lattice_says_the_size_however_it_lies(
    angle: float, periods: float, drift: float, turn: float, alone: bool
) -> None:
    """Turned and drifting; from the trace alone as well."""
    both = Scanner(turn=turn).images(
        100.0, lattice(periods, angle, pixels=128, lines=96, drift=drift), 0.0, np.random.default_rng(0)
    )
    image = SampleImage("an image", 100.0, None, both.trace, None if alone else both.retrace)
    constant = FULL_NM / periods * 2.0 / sqrt(3.0)
    found = size(image, KnownSample(Cell.hexagonal(constant)), turn=turn)
    assert found.value == pytest.approx(FULL_NM, rel=6e-4)
    assert abs(found.value - FULL_NM) < 3.0 * found.standard_error + 1e-6


@pytest.mark.parametrize(
    ("a_nm", "b_nm", "gamma", "angle"), [(70.0, 70.0, 90.0, 20.0), (60.0, 85.0, 90.0, -35.0), (65.0, 90.0, 75.0, 10.0)]
)
def test_any_cell(a_nm: float, b_nm: float, gamma: float, angle: float) -> None:
    image = shown(cell(a_nm, b_nm, gamma, angle, pixels=160, lines=160))
    found = size(image, KnownSample(Cell(a_nm, b_nm, gamma, "given")))
    assert found.value == pytest.approx(FULL_NM, rel=5e-4)


@pytest.mark.parametrize("part", [2, 3])
def test_bars_whose_harmonic_is_strongest(part: int) -> None:
    """The first wave has a third of the height of the second, or of the third."""
    weak = ((6.0, 3.0, 0.35, 0.1), (6.0 * part, 3.0, 1.0, 0.4), (6.0 * (part + 2), 3.0, 0.3, 0.2))
    found = size(shown(Seen(weak)), KnownSample(None, Grating(FULL_NM / 6.0, Estimate(3.0, 0.1))))
    assert found.value == pytest.approx(FULL_NM, rel=1e-3)


def weak_lowest(times: float, turned: float, share: float) -> SampleImage:
    """Images of a hexagonal lattice, 8 periods in the line, whose lowest waves have a share of the strong ones'."""
    waves = []
    for n, height in enumerate((1.0, 0.9, 0.8)):
        waves.append((8.0, 7.0 + 60.0 * n, share * height, 0.1 * n))
        waves.append((8.0 * times, 7.0 + 60.0 * n + turned, height, 0.3 * n + 0.05))
    return shown(Seen(tuple(waves), pixels=128, lines=128), 0.02, 1)


EIGHT_PERIODS = KnownSample(Cell.hexagonal(FULL_NM / 8.0 * 2.0 / sqrt(3.0)))
STRONG_WAVES = pytest.mark.parametrize(
    ("times", "turned", "index"), [(sqrt(3.0), 30.0, 3), (2.0, 0.0, 4), (3.0, 0.0, 9)]
)


@STRONG_WAVES
def test_a_lattice_with_weak_lowest_spots_says_the_size(times: float, turned: float, index: int) -> None:
    """The strong spots alone would give a size wrong by the root of 3, by 2 or by 3."""
    sizes = sizes_of([weak_lowest(times, turned, 0.1)], V_MAX, EIGHT_PERIODS, Acquisition())
    assert sizes.nm[0] == pytest.approx(FULL_NM, rel=3e-4)
    assert abs(sizes.nm[0] - FULL_NM) < 3.0 * sizes.errors_nm[0]
    assert f"the strong spots are those of a cell with 1/{index} of the area" in " ".join(map(str, sizes.remarks))


@STRONG_WAVES
def test_a_cell_that_one_weak_spot_decides_is_refused(times: float, turned: float, index: int) -> None:
    """Of the whole cell, or one of 1/index of its area."""
    del index
    text = refused(weak_lowest(times, turned, 0.04), EIGHT_PERIODS)
    assert "the lattice is ambiguous: the cell may be" in text
    assert "the size of the line would be another with each; image more periods with less noise" in text


@pytest.mark.rest
@STRONG_WAVES
def test_a_faint_wave_that_may_be_of_a_larger_cell_is_refused(times: float, turned: float, index: int) -> None:
    """The indexer does not see it; a fit of all pixels does."""
    part = 2 if index == 4 else 3
    text = refused(weak_lowest(times, turned, 0.025), EIGHT_PERIODS)
    assert f"a weak wave at parts of {part} of the strong ones may be that of a larger cell" in text
    assert size(weak_lowest(times, turned, 0.0), EIGHT_PERIODS).value == pytest.approx(times * FULL_NM, rel=1e-3)


@pytest.mark.rest
@pytest.mark.parametrize("seed", [0, 14, 17])
def test_an_image_with_three_sites_a_cell_terraces_and_rows_that_jump(seed: int) -> None:
    """The strong spots gave 134 and 117 pixels in place of 128, and a refusal."""
    heights, vectors = three_sites(seed)
    sides = sides_and_angle(reduced(vectors))
    line = size(SampleImage("an image", 100.0, None, heights, None), KnownSample(Cell(*sides, "given")))
    assert line.value == pytest.approx(128.0, rel=0.02)


def test_the_angle_of_bars_is_taken_from_the_rows_or_given() -> None:
    image = shown(grating(12.0, 8.0, drift=0.02, pixels=160, lines=160))
    pitch = FULL_NM / 12.0
    rows = size(image, KnownSample(None, Grating(pitch)))
    told = size(image, KnownSample(None, Grating(pitch, Estimate(8.0, 0.5))))
    assert told.value == pytest.approx(FULL_NM, rel=2e-4)
    assert 1e-3 < abs(rows.value / FULL_NM - 1.0) < 4e-3, "what 2 % of drift does at 8 degrees"
    assert abs(rows.value - FULL_NM) < 2.0 * rows.standard_error
    # A frame of another height than its pixels say.
    low = sizes_of([image], V_MAX, KnownSample(None, Grating(pitch)), Acquisition(aspect=0.8)).images[0].size
    assert abs(low.nm.value - FULL_NM) < 2.0 * np.hypot(low.nm.standard_error, 2.0 * low.shared * FULL_NM)
    with pytest.raises(Unphysical, match=r"the rows show bars under 9.* degrees, and 25 were given"):
        size(image, KnownSample(None, Grating(pitch, Estimate(25.0, 0.5))))


@pytest.mark.rest
def test_errors_hold_with_noise() -> None:
    """Root mean square of the distance to the truth, in standard errors, of lattices and gratings that drift."""
    random = np.random.default_rng(4)
    away = []
    for nm, v in ((130.0, 13.0), (200.0, 20.0), (430.0, 40.0), (900.0, 80.0)) * 2:
        found = measured([scan_of(nm, v, random, 0.05, 128)])
        away.append((found.nm[0] - nm) / np.hypot(found.errors_nm[0], found.shared * nm))
    assert 0.1 < np.sqrt(np.mean(np.square(away))) < 1.5


@pytest.mark.long
@pytest.mark.timeout(86_400)
@pytest.mark.parametrize("kind", long(["offset --image"], ["size --image", "offset --image"]))
def test_fits_of_images_know_themselves(kind: str) -> None:
    """Truth within two standard errors in most of few trials; docs/calibration.md has the share of many."""
    hits = [abs(e.value - truth) <= 2.0 * e.standard_error for one in trials(kind, 8) for e, truth in one.values()]
    assert np.mean(hits) > 0.85


# weights


def test_known_errors_are_weights_and_a_law_that_is_missed_adds_scatter() -> None:
    x = np.linspace(1.0, 2.0, 40)
    errors = np.where(np.arange(40) % 2, 0.01, 0.1)
    random = np.random.default_rng(2)

    def line(values: Floats) -> Solution:
        def fit(one: Floats) -> Solution:
            return solve(lambda p: (p[0] + p[1] * x - values) / one, [0.0, 1.0], ("a", "b"), [1.0, 1.0])

        return with_errors(fit, values, errors)

    clean = 1.0 + 2.0 * x
    away, scattered = [], []
    for _ in range(40):
        noisy = line(clean + errors * random.standard_normal(40))
        away += [(noisy.estimate(n).value - t) / noisy.estimate(n).standard_error for n, t in (("a", 1.0), ("b", 2.0))]
        scattered.append(line(clean + np.hypot(errors, 0.03 * clean) * random.standard_normal(40)).scatter)
    assert np.sqrt(np.mean(np.square(away))) == pytest.approx(1.0, abs=0.3)
    assert np.mean(scattered) == pytest.approx(0.03, rel=0.15)
    assert line(clean).scatter == 0.0


# what is refused


def refused(image: SampleImage, sample: KnownSample = BARS, **options: object) -> str:
    with pytest.raises(Unphysical) as caught:
        size(image, sample, **options)
    assert str(caught.value).startswith("an image: ")
    return str(caught.value)


def test_wrong_images_are_named_with_what_to_do() -> None:
    bars = shown(grating(20.0, pixels=192, lines=96), 0.05)
    assert bars.retrace is not None
    noise = np.random.default_rng(3).standard_normal((96, 192))
    assert "no period stands out in the trace" in refused(replace(bars, trace=noise, retrace=None))
    assert "at least 3 are needed" in refused(shown(grating(2.3, pixels=192, lines=96), 0.02))
    assert "exchanged" in refused(replace(bars, trace=bars.retrace, retrace=bars.trace))
    assert "it needs --retrace-mirrored" in refused(replace(bars, retrace=bars.retrace[:, ::-1].copy()))
    assert "saturated" in refused(replace(bars, trace=np.clip(bars.trace, -0.8, 0.8)))
    assert "no contrast" in refused(replace(bars, trace=np.zeros((96, 192))))
    assert "pixels; both must be from one scan" in refused(replace(bars, retrace=bars.retrace[:, 5:]))
    # Half a period, and a tenth of the line, cut off at the right of both images, or of the left.
    for cut in (slice(0, -5), slice(5, None), slice(19, None)):
        cropped = replace(bars, trace=bars.trace[:, cut].copy(), retrace=bars.retrace[:, cut].copy())
        assert "if columns were cropped" in refused(cropped)
    small = shown(grating(60.0, pixels=192, lines=96), 0.05, v=30.0)
    assert small.retrace is not None
    assert size(small, BARS).value > 0.0
    cropped = replace(small, trace=small.trace[:, 5:].copy(), retrace=small.retrace[:, 5:].copy())
    assert "if columns were cropped" in refused(cropped)
    few = shown(grating(9.0, pixels=192, lines=96), 0.05)
    assert few.retrace is not None
    late = replace(few, trace=np.roll(few.trace, 2, 1), retrace=np.roll(few.retrace, -2, 1))
    assert "--delay-pixels" in refused(late)


def test_another_sample_than_said_is_refused() -> None:
    bars, net = (shown(one(14.0, pixels=160, lines=160), 0.02) for one in (grating, lattice))
    assert "one wave is in the image, as of bars" in refused(bars, HEXAGONAL)
    assert "two waves are in the image, as of a lattice" in refused(net, BARS)
    assert "not those of a given lattice" in refused(net, KnownSample(Cell(40.0, 200.0, 90.0, "given")))


@pytest.mark.rest
def test_another_size_than_said_and_an_alias_are_named() -> None:
    """Of three images one has another voltage, another pitch, or periods finer than two pixels."""
    right = [replace(shown(grating(16.0, pixels=128, lines=64), v=v), name=f"{v:g} V") for v in (40.0, 70.0, 100.0)]
    sizes_of(right, V_MAX, BARS, Acquisition())
    wrong_volts = [right[0], replace(right[1], v_scan=35.0), right[2]]
    fine = replace(shown(grating(128.0 + 22.0, 1.0, pixels=128, lines=64), v=70.0), name="70 V")
    for images in (wrong_volts, [right[0], replace(shown(grating(32.0, pixels=128, lines=64), v=70.0), name="70 V")]):
        with pytest.raises(Unphysical, match=r"nm per volt, and .*is each image of the stated voltage"):
            sizes_of(images, V_MAX, BARS, Acquisition())
    with pytest.raises(Unphysical, match="70 V"):
        sizes_of([right[0], fine, right[2]], V_MAX, BARS, Acquisition())
    with pytest.raises(Unphysical, match="the image is that of 40 V"):
        sizes_of([right[0], replace(right[0], v_scan=80.0, name="80 V")], V_MAX, BARS, Acquisition())
    with pytest.raises(Unphysical, match=r"outside the driver's 0..100 V"):
        sizes_of([replace(right[2], v_offset=20.0)], V_MAX, BARS, Acquisition())


def test_positions_are_right_where_the_branches_are_not_the_harmonic_ones() -> None:
    """A ripple of 0.3 % of the line on both sweeps, as no branch of (17) has it."""
    plain = Scanner().images(100.0, grating(18.0, 2.0, pixels=192, lines=96), 0.0, np.random.default_rng(0))
    place = (np.arange(192) + 0.5) / 192
    moved = place + 0.003 * np.sin(3.0 * np.pi * place)
    trace, retrace = (np.stack([np.interp(moved, place, row) for row in one]) for one in (plain.trace, plain.retrace))
    still, bent = fit_line(plain.trace, plain.retrace), fit_line(trace, retrace)
    inside = np.linspace(0.1, 0.9, 33)
    for forward in (True, False):
        expected = still.position(inside + 0.003 * np.sin(3.0 * np.pi * inside), forward)
        assert bent.position(inside, forward) == pytest.approx(expected, abs=4e-4)
        assert np.max(np.abs(bent.position(inside, forward) - still.position(inside, forward))) > 2e-3
    ends = np.array([0.0, 1.0])
    assert bent.position(ends, True) == pytest.approx(ends, abs=1e-12)
