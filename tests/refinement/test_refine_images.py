"""Learning from images of the running scan: what is seen against what is true, what is reached, and what is refused."""

from collections.abc import Callable

import numpy as np
import pytest
from lattice_images import weak_lowest
from refining import (
    GRATING,
    IMAGED,
    LATTICE,
    ON_TIME,
    ROUGH,
    SLOPING,
    Sample,
    calibrated,
    frames_of,
    image_rounds,
    imaged_scan,
    play,
    scanner,
)
from replacing import replace
from sets import one_of

from tablegen.base.input_errors import Unphysical
from tablegen.calibration.laws.image_sizes import KnownSample
from tablegen.config.load import Setup
from tablegen.images.line_length import Cell
from tablegen.planning.line_plan import make_plan
from tablegen.refinement.departure import Departure
from tablegen.refinement.image_round import refine_images, refine_mismatch
from tablegen.refinement.lattice_line import ImageOptions
from tablegen.refinement.round import Options
from tablegen.virtual.imaging import running_frame

Pair = tuple[np.ndarray, np.ndarray]


pytestmark = pytest.mark.common


@pytest.fixture(scope="module")
def setup() -> Setup:
    return calibrated(imaged_scan("x", 60.0, lines=100, pixels=128))


@pytest.fixture(scope="module")
def lattice(setup: Setup) -> Pair:
    return frames_of(setup, LATTICE)[0]


@pytest.fixture(scope="module")
def bars(setup: Setup) -> Pair:
    return frames_of(setup, replace(GRATING, periods=12.0))[0]


def shares(found: Departure) -> tuple[np.ndarray, np.ndarray]:
    """What both directions share of the error, and half of what they differ by, in percent of the line."""
    sides = found.points.by_side(100.0 * found.error)
    return 0.5 * (sides["forward"] + sides["backward"]), 0.5 * (sides["forward"] - sides["backward"])


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


@pytest.mark.parametrize("sample", [LATTICE, replace(GRATING, periods=12.0)], ids=lambda one: one.name)
def test_images_show_the_true_error_of_the_line(setup: Setup, sample: Sample) -> None:
    """In 128 x 85 pixels with 5 % of noise, drift and tilt: to 0.02 % of the line, and within the errors it states."""
    found = refine_images(setup, "x", frames_of(setup, sample), Options(), ON_TIME)
    true = play(setup, "x", scanner().x).true
    off = 100.0 * (found.update.before.error - true.error)
    assert true.rms_percent > 0.3
    assert rms(off) < 0.02
    # Pixels and degrees of the fit do not show the steps of the converter: they are in the truth, and no noise.
    assert found.update.noise_percent < 0.03
    assert rms(off) < 3.0 * found.update.noise_percent
    assert found.worse == ""


@pytest.mark.parametrize(("periods", "times"), [(8.0, 2.0), (7.0, 3.0)])
def test_a_lattice_with_weak_lowest_spots_says_the_error_and_the_size(
    setup: Setup, periods: float, times: float
) -> None:
    """Refused before, as waves of a frame 1.6 and 0.26 times as high as its lines are long."""
    plan = make_plan(setup)
    nm = plan.x.drive.size_nm
    surface = weak_lowest(nm / periods, times, 0.0, 0.1)
    frame = running_frame(plan, scanner().x, scanner().y, surface, IMAGED)
    sample = KnownSample(Cell.hexagonal(nm / periods * 2.0 / 3.0**0.5))
    pairs = [(frame.trace.heights, frame.retrace.heights)]
    found = refine_images(setup, "x", pairs, Options(), None, sample)
    true = play(setup, "x", scanner().x).true
    assert rms(100.0 * (found.update.before.error - true.error)) < 0.025
    assert found.size is not None
    both = np.concatenate([frame.trace.x_nm[0], frame.retrace.x_nm[0]])
    low, high = plan.x.band_limit.window
    place = low + (high - low) * (np.arange(128) + 0.5) / 128
    assert found.size.nm.value == pytest.approx(np.polyfit(np.tile(place, 2), both, 1)[0], rel=5e-4)
    assert found.periods == pytest.approx(times * periods, rel=0.05)


def test_errors_are_those_of_many_images(setup: Setup) -> None:
    """The stated errors of the coefficients against their spread over noise."""
    small = replace(setup, scan=setup.scan)
    found = [
        refine_images(small, "x", frames_of(setup, replace(GRATING, periods=8.0), seed=s), Options(), ON_TIME)
        for s in range(6)
    ]
    coefficients = np.stack([one.measured.coefficients for one in found])
    stated = np.sqrt(np.mean([np.diag(one.measured.line_covariance) for one in found], axis=0))
    seen = np.std(coefficients, axis=0, ddof=1)
    assert 0.7 < float(np.median(seen / stated)) < 1.3


REACHES = [
    ("default", "x", 60.0, GRATING),
    ("default", "x", 30.0, LATTICE),
    ("duhem", "x", 95.0, LATTICE),
    ("duhem", "x", 30.0, GRATING),
    ("default", "y", 60.0, LATTICE),
    ("duhem", "y", 60.0, SLOPING),
]


@pytest.mark.rest
@pytest.mark.parametrize(("plant", "axis", "volts", "sample"), one_of(2, REACHES, names=4))
def test_three_rounds_reach_what_is_to_be_reached(plant: str, axis: str, volts: float, sample: Sample) -> None:
    """0.1 % rms of the line and 1.5 % scaling error, with 5 % of noise, drift and tilt, on both built-in scanners."""
    scan = imaged_scan(axis, volts)  # type: ignore[arg-type]
    first, *_, last = image_rounds(calibrated(scan, plant), scan.axis, 3, sample, plant)
    assert max(first.true.scaling_percent.values()) > 2.5
    assert first.true.rms_percent > 0.14
    for side, (error, _) in last.true.residual_percent.items():
        assert error < 0.1
        assert last.true.scaling_percent[side] < 1.5


@pytest.mark.rest
def test_a_second_frame_tells_drift_from_y() -> None:
    """Drift along y that becomes faster bends one frame as y does; two that follow each other show it."""
    setup = calibrated(imaged_scan("y", 60.0))
    true = play(setup, "y", scanner().y).true
    off = []
    for count in (1, 2):
        found = refine_images(setup, "y", frames_of(setup, LATTICE, count), Options())
        off.append(rms(100.0 * (found.update.before.error - true.error)))
        assert any(remark.code == "uneven-drift" for remark in found.remarks) == (count == 1)
    assert off[0] > 0.05  # the drift of 1 % of the frame bends it by 0.07 % rms
    assert off[1] < 0.02


def test_images_of_the_way_up_leave_the_way_down_of_y_as_it_was() -> None:
    """Both ways are imaged, and the images that y is learnt from are those of its way up."""
    scan = imaged_scan("y", 60.0)
    both = ("y.turn = 0.85", "y.band_limit.directions = 'both'", "y.band_limit.window = [0.1, 0.9]")
    setup = calibrated(replace(scan, edits=(*scan.edits, *both)))
    found = refine_images(setup, "y", frames_of(setup, LATTICE, 2), Options())
    assert set(found.update.before.residual_percent) == {"forward"}
    assert any("y was learnt on its way up" in remark for remark in found.remarks)
    errors = []
    for one in (setup, found.setup):
        true = play(one, "y", scanner().y).true
        errors.append({side: rms(about_line(error)) for side, error in true.points.by_side(true.error).items()})
    assert errors[1]["forward"] < 0.5 * errors[0]["forward"]
    assert errors[1]["backward"] < 1.1 * errors[0]["backward"]


def about_line(values: np.ndarray) -> np.ndarray:
    """Values less their best straight line."""
    at = np.arange(len(values))
    return values - np.polyval(np.polyfit(at, values, 1), at)


@pytest.mark.parametrize("plant", ["default", "duhem"])
def test_trace_against_retrace_tells_their_difference_and_nothing_else(plant: str) -> None:
    """A sample without a period: what differs goes below a fifth in two rounds, what is shared stays as it was."""
    scan = imaged_scan("x", 60.0)
    first, _, last = image_rounds(calibrated(scan, plant), "x", 2, ROUGH, plant)
    (shared, differing), (kept, left) = shares(first.true), shares(last.true)
    assert rms(differing) > 0.3
    assert rms(left) < 0.2 * rms(differing)
    assert rms(kept - shared) < 0.01
    assert first.round is not None
    seen_shared, seen = shares(first.round.update.before)
    assert rms(seen - differing) < 0.04
    assert rms(seen_shared) < 1e-3  # of the model's own line, which no image shows
    assert "an error that both share stays" in first.round.remarks[0]


def test_a_mismatch_is_not_compared_with_a_line(setup: Setup, lattice: Pair) -> None:
    """Residuals of a mismatch are another measure: a round by a lattice after it is not refused for it."""
    first = refine_mismatch(setup, "x", [lattice], Options())
    assert first.refinement is not None
    assert first.refinement.before_of == "mismatch"
    tiny = replace(
        first.setup,
        scan=_with_before(first.setup, 1e-4),
    )
    assert "the residual grew" in refine_mismatch(tiny, "x", [lattice], Options()).worse
    assert refine_images(tiny, "x", [lattice], Options()).worse == ""

    layer = {"before_scaling_percent": 1e-4, "previous_a": [1e-4], "previous_b": [0.0]}
    for before_of, refining in (("mismatch", refine_mismatch), (None, refine_images)):
        better = replace(first.setup, scan=_with_before(first.setup, 100.0, before_of=before_of, **layer))
        found = refining(better, "x", [lattice], Options())
        assert "the scaling error rose from 0.0001 % to" in found.stopped
        assert found.best is not None
        assert (found.best.a, found.best.best, found.best.before_of) == ([1e-4], True, before_of)
        other = refine_images if refining is refine_mismatch else refine_mismatch
        assert other(better, "x", [lattice], Options()).stopped == "", "they are not compared with each other"


def _with_before(setup: Setup, percent: float, **values: object) -> object:
    import msgspec

    layer = msgspec.structs.replace(setup.scan.x.refinement, before_percent=percent, **values)
    return msgspec.structs.replace(setup.scan, x=msgspec.structs.replace(setup.scan.x, refinement=layer))


def mirrored(image: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(image[:, ::-1])


def upside_down(image: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(image[::-1])


BAD: dict[str, tuple[Callable[[Pair], Pair], str]] = {
    "exchanged": (lambda p: (p[1], p[0]), "images are exchanged, or their rows upside down"),
    "upside down": (lambda p: (upside_down(p[0]), upside_down(p[1])), "exchanged, or their rows upside down"),
    "both mirrored": (lambda p: (mirrored(p[0]), mirrored(p[1])), "both images are mirrored"),
    "retrace mirrored": (lambda p: (p[0], mirrored(p[1])), "it needs --retrace-mirrored"),
    "cropped": (lambda p: (p[0][:, 4:], p[1][:, 4:]), "have 124 columns, and this scan 128 pixels"),
    "flat": (lambda p: (p[0], np.zeros_like(p[1])), "the retrace has no contrast"),
    "saturated": (lambda p: (np.minimum(p[0], np.quantile(p[0], 0.6)), p[1]), "the trace is saturated"),
    "the same": (lambda p: (p[0], p[0]), "trace and retrace are the same image"),
    "another scan": (lambda p: (p[0], np.random.default_rng(1).normal(size=p[0].shape)), "does not show the trace's"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_images_are_named(setup: Setup, lattice: Pair, name: str) -> None:
    change, message = BAD[name]
    with pytest.raises(Unphysical, match=message):
        refine_images(setup, "x", [change(lattice)], Options())


def test_a_retrace_that_was_stored_mirrored_can_be_told(setup: Setup, lattice: Pair) -> None:
    plain = refine_images(setup, "x", [lattice], Options())
    turned = refine_images(
        setup, "x", [(lattice[0], mirrored(lattice[1]))], Options(), ImageOptions(retrace_mirrored=True)
    )
    assert turned.measured.coefficients == pytest.approx(plain.measured.coefficients, abs=1e-12)
    with pytest.raises(Unphysical, match="leave --retrace-mirrored out"):
        refine_images(setup, "x", [lattice], Options(), ImageOptions(retrace_mirrored=True))


def test_a_grating_exchanged_is_refused_in_the_next_round(setup: Setup) -> None:
    """Nothing in the images tells it; the layer that it teaches makes the scan worse, and that does."""
    wrong = [pair[::-1] for pair in frames_of(setup, GRATING)]
    taught = refine_images(setup, "x", wrong, Options(), ON_TIME)
    assert taught.worse == ""
    again = [pair[::-1] for pair in frames_of(taught.setup, GRATING, seed=1)]
    assert "the residual grew" in refine_images(taught.setup, "x", again, Options(), ON_TIME).worse


def test_half_a_period_between_the_images_is_refused(setup: Setup, bars: Pair) -> None:
    """As of a retrace that was cropped, and pasted."""
    with pytest.raises(Unphysical, match=r"0\.\d+ periods of the sample apart"):
        refine_images(setup, "x", [(bars[0], np.roll(bars[1], 6, axis=1))], Options())


@pytest.mark.parametrize("columns", [5, 15])
def test_a_lattice_folded_onto_the_next_period_is_refused(setup: Setup, lattice: Pair, columns: int) -> None:
    """One wave folds onto the next period; the other one does not. The layer was wrong, with status 0."""
    with pytest.raises(Unphysical, match=r"at different places: \d\d % of the contrast has their periods"):
        refine_images(setup, "x", [(lattice[0], np.roll(lattice[1], columns, axis=1))], Options())


@pytest.mark.parametrize(
    ("periods", "message"),
    [
        (2.0, "the line has about 2 periods; at least 3 are needed"),
        (55.0, "too fine"),
        (90.0, "too fine"),  # seen as 70
        (128.0, "finer than two pixels"),  # seen as 33, and then trace and retrace do not belong together
        (200.0, "finer than two pixels"),
    ],
)
def test_too_few_periods_and_aliases_are_refused(setup: Setup, periods: float, message: str) -> None:
    with pytest.raises(Unphysical, match=message):
        refine_images(setup, "x", frames_of(setup, replace(GRATING, periods=periods)), Options())


def test_a_sample_without_a_period_is_refused_where_one_is_needed(setup: Setup) -> None:
    random = np.random.default_rng(2)
    noise = random.normal(size=(85, 128)), random.normal(size=(85, 128))
    with pytest.raises(Unphysical, match="no period stands out"):
        refine_images(setup, "x", [noise], Options())
    with pytest.raises(Unphysical, match="does not show what the trace shows"):
        refine_mismatch(setup, "x", [noise], Options())
    rough = frames_of(setup, ROUGH)[0]
    with pytest.raises(Unphysical, match=r"periodic|period stands out"):
        refine_images(setup, "x", [rough], Options())
    with pytest.raises(Unphysical, match="it needs --retrace-mirrored"):
        refine_mismatch(setup, "x", [(rough[0], mirrored(rough[1]))], Options())


def test_y_needs_the_whole_frame_and_periods_along_it(setup: Setup, lattice: Pair, bars: Pair) -> None:
    with pytest.raises(Unphysical, match="have 75 rows, and this scan images 85 lines"):
        refine_images(setup, "y", [(lattice[0][10:], lattice[1][10:])], Options())
    with pytest.raises(Unphysical, match=r"periods of the sample along y; at least 3 are needed: turn a grating"):
        refine_images(setup, "y", [bars], Options())
    with pytest.raises(Unphysical, match="do not show the error of y"):
        refine_mismatch(setup, "y", [lattice], Options())
    with pytest.raises(Unphysical, match="do not show one sample"):
        refine_images(setup, "y", [lattice, frames_of(setup, replace(LATTICE, periods=12.0))[0]], Options())


def test_a_late_image_is_put_right_by_its_delay(setup: Setup) -> None:
    """A pixel late moves trace against retrace by two; told, it is gone."""
    late = frames_of(setup, LATTICE, conditions=replace(IMAGED, late=0.5))
    true = play(setup, "x", scanner().x).true
    wrong = refine_images(setup, "x", late, Options()).update.before
    told = refine_images(setup, "x", late, Options(), ImageOptions(delay_pixels=0.5)).update.before
    assert rms(100.0 * (wrong.error - true.error)) > 0.1
    assert rms(100.0 * (told.error - true.error)) < 0.02
