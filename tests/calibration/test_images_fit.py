"""Images to branches: whatever the sample, its angle, drift, window and levelling; and what is refused."""

import numpy as np
import pytest
from calibrating import AMPLITUDES, V_MAX, Sample, Scanner, grating, grown, lattice
from hypothesis import given, settings
from hypothesis import strategies as st
from lattice_images import OnTerraces, SitesOnTerrace
from replacing import replace

from tablegen.base.input_errors import Unphysical
from tablegen.calibration.laws.images import Pair, fit_images
from tablegen.fitting.estimate import Estimate
from tablegen.images.pair_checks import MIN_PIXELS
from tablegen.images.pair_fit import ImageFit, fit_pair
from tablegen.numerics.arrays import Floats

pytestmark = pytest.mark.common

FULL = [0.037, 0.37, 0.080, 0.48]  # beta and u_peak of the scanner's branches at full scale
SMALL = {"pixels": 128, "lines": 96}


def pair(
    sample: Sample | SitesOnTerrace, noise: float = 0.0, seed: int = 0, scanner: Scanner | None = None, v: float = 100.0
) -> Pair:
    return (scanner or Scanner()).images(v, sample, noise, np.random.default_rng(seed))


def fitted(images: Pair, **options: float) -> ImageFit:
    return fit_pair(images.trace, images.retrace, images.v_scan, **options)  # type: ignore[arg-type]


def shapes(fit: ImageFit) -> list[float]:
    return [e.value for side in (fit.forward, fit.backward) for e in (side.beta, side.u_peak)]


def distances(fit: ImageFit) -> list[float]:
    estimates = [e for side in (fit.forward, fit.backward) for e in (side.beta, side.u_peak)]
    return [(e.value - truth) / e.standard_error for e, truth in zip(estimates, FULL, strict=True)]


# what does not matter


@given(
    periods=st.floats(4.0, 18.0),
    angle=st.floats(-25.0, 25.0),
    turn=st.floats(0.2, 0.8),
    low=st.sampled_from([0.0, 0.05, 0.1]),
    drift=st.sampled_from([0.0, 0.03]),
    hexagonal=st.booleans(),
)
@settings(max_examples=10, deadline=None)
def test_exact_images_give_the_branches(
    periods: float, angle: float, turn: float, low: float, drift: float, hexagonal: bool
) -> None:
    window = low, 1.0 - 0.5 * low
    sample = (lattice if hexagonal else grating)(periods, angle, window=window, drift=drift, **SMALL)
    images = pair(sample, scanner=Scanner(turn=turn))
    # What a drift moves within a line is not in the model, a few millionths of the line here.
    assert shapes(fit_pair(images.trace, images.retrace, 100.0, turn, window)) == pytest.approx(
        FULL, abs=1e-4 if drift else 1e-7
    )


def test_lines_may_be_levelled_and_surfaces_bent() -> None:
    """Offsets of lines, a tilt and a bow of the background, a parabola taken off each line: nothing of that counts."""
    images = pair(grating(**SMALL))
    x = np.linspace(-1.0, 1.0, 128)
    offsets = np.random.default_rng(1).standard_normal((96, 1))
    bent = [image + 3.0 * offsets + 5.0 * x**2 - 2.0 * x for image in (images.trace, images.retrace)]
    basis = np.stack([np.ones(128), x, x**2], axis=1)
    level = [image - (basis @ np.linalg.lstsq(basis, image.T, rcond=None)[0]).T for image in bent]
    for trace, retrace in (bent, level):
        assert shapes(fit_pair(trace, retrace, 100.0)) == pytest.approx(FULL, abs=1e-7)


def test_units_and_steps_of_heights_do_not_matter() -> None:
    images = pair(grating(), 0.02)
    plain = shapes(fitted(images))
    scaled = shapes(fit_pair(-3e-9 * images.trace + 1e-6, -3e-9 * images.retrace + 1e-6, 100.0))
    assert scaled == pytest.approx(plain, abs=1e-9)
    stepped = fit_pair(np.round(20.0 * images.trace), np.round(20.0 * images.retrace), 100.0)
    assert shapes(stepped) == pytest.approx(FULL, abs=3e-4)


def test_a_slow_axis_that_steps_or_ramps_is_told_by_a_lattice() -> None:
    for lag in (0.0, 1.0, -1.0):  # -1: the frame is shown upside down
        assert shapes(fitted(pair(lattice(lag=lag, **SMALL)))) == pytest.approx(FULL, abs=1e-7)


def on_terrace(seed: int, step: float) -> ImageFit:
    return fitted(pair(SitesOnTerrace(seed, step), 0.02, seed))


@pytest.mark.rest
@pytest.mark.parametrize("seed", [0, 3])
def test_weak_lowest_orders_beside_a_terrace_give_the_branches(seed: int) -> None:
    """The terrace is the strongest spot: its two periods were refused, or the fit did not converge."""
    fit = on_terrace(seed, 2.5)
    assert max(map(abs, distances(fit))) < 3.0
    assert shapes(fit) == pytest.approx(FULL, abs=4e-3)


def test_all_waves_of_a_cell_with_weak_lowest_orders_count() -> None:
    """Those of the strongest spots' cell alone left 0.0051 of error for u_peak."""
    fit = on_terrace(1, 0.0)
    assert max(map(abs, distances(fit))) < 3.0
    assert fit.forward.u_peak.standard_error < 1e-3


def test_cells_without_common_waves_are_refused() -> None:
    with pytest.raises(Unphysical, match="the lattice is ambiguous: the cell may be") as refused:
        on_terrace(3, 1.0)
    assert "image more periods with less noise, or choose another --channel" in str(refused.value)
    assert "--lattice-nm" not in str(refused.value), "the command does not take it"


def test_slow_drift_is_followed() -> None:
    """A tenth of the line, faster as it goes: one and a half periods that a straight line would leave."""
    still, drifting = (fitted(pair(grating(drift=drift), 0.05, 2)) for drift in (0.0, 0.1))
    assert max(map(abs, distances(drifting))) < 4.0
    assert still.drift_percent < 0.1
    assert drifting.drift_percent == pytest.approx(2.5, rel=0.1)


# errors


def scatter(noise: Floats, fits: int = 12) -> tuple[float, float]:
    """Root mean square of distances to the truth in standard errors, and the mean error of beta forward."""
    images = pair(grating(5.0, **SMALL))
    found = []
    errors = []
    for seed in range(fits):
        random = np.random.default_rng(seed)
        both = [image + coloured(random, image.shape, noise) for image in (images.trace, images.retrace)]
        fit = fit_pair(both[0], both[1], 100.0)
        found += distances(fit)
        errors.append(fit.forward.beta.standard_error)
    return float(np.sqrt(np.mean(np.square(found)))), float(np.mean(errors))


def coloured(random: np.random.Generator, shape: tuple[int, int], kernel: Floats) -> Floats:
    """White noise drawn through a kernel, along the line."""
    white = random.standard_normal((shape[0], shape[1] + len(kernel) - 1))
    return np.stack([np.convolve(row, kernel, "valid") for row in white])


@pytest.mark.rest
def test_errors_hold_for_noise_of_any_colour_along_the_line() -> None:
    """Noise alike over nine pixels, as a feedback makes it, has more power where a coarse grating has its period."""
    white, white_error = scatter(np.array([0.1]))
    slow, slow_error = scatter(np.full(9, 0.1 / 3.0))
    assert white == pytest.approx(1.0, abs=0.3)
    assert slow == pytest.approx(1.0, abs=0.3)
    assert slow_error > 1.5 * white_error, "or the test would show nothing"


def test_what_the_model_does_not_describe_widens_and_is_said() -> None:
    """A ripple of 0.3 % of the line on both sweeps."""
    sample = grating(21.0)
    place = (np.arange(256) + 0.5) / 256
    rippled = Scanner()
    images = pair(sample, 0.02)
    bent = [
        np.stack([np.interp(place + 0.003 * np.sin(5.0 * np.pi * place), place, row) for row in image])
        for image in (images.trace, images.retrace)
    ]
    fit = fit_images([replace(images, trace=bent[0], retrace=bent[1])], V_MAX)
    assert fit.largest_percent == pytest.approx(0.3, rel=0.3)
    assert any("standard errors were widened" in remark for remark in fit.remarks)
    (one,) = fit.branches[0].traces
    assert one.forward.beta.standard_error > 10.0 * fitted(images).forward.beta.standard_error
    assert one.forward.beta.value == pytest.approx(grown(100.0, *rippled.forward[:2]), abs=0.002)


def test_many_periods_do_not_lose_count() -> None:
    """A period of 1.6 % of the line, where trace and retrace are 10.6 % apart: six periods."""
    fit = fitted(pair(grating(62.0), 0.05))
    assert shapes(fit) == pytest.approx(FULL, abs=5e-4)
    assert fit.registration_percent == pytest.approx(10.6, abs=0.1)


@pytest.mark.parametrize("taken", [0, 7])
def test_pixels_are_the_middle_of_their_time(taken: int) -> None:
    """Of eight moments the first or the last: what --delay-pixels makes good."""
    fine = pair(grating(pixels=256 * 8, lines=96))
    trace, retrace = fine.trace[:, taken::8], fine.retrace[:, 7 - taken :: 8]
    late = 0.5 - (taken + 0.5) / 8.0
    assert shapes(fit_pair(trace, retrace, 100.0, delay_pixels=late)) == pytest.approx(FULL, abs=1e-7)
    average = [image.reshape(96, 256, 8).mean(axis=2) for image in (fine.trace, fine.retrace)]
    assert shapes(fit_pair(average[0], average[1], 100.0)) == pytest.approx(FULL, abs=1e-4)


def test_a_known_lag_of_the_feedback_is_taken_off() -> None:
    images = pair(grating(), 0.02)
    columns = np.arange(256.0)
    late = [
        np.stack([np.interp(columns - shift, columns, row) for row in image])
        for image, shift in ((images.trace, 1.5), (images.retrace, -1.5))
    ]
    assert shapes(fit_pair(late[0], late[1], 100.0, delay_pixels=1.5)) == pytest.approx(FULL, abs=5e-4)
    assert abs(shapes(fit_pair(late[0], late[1], 100.0))[0] - 0.037) > 3e-3, "or the test would show nothing"


# growth


def test_amplitudes_give_growth_as_traces_do() -> None:
    pairs = [pair(grating(15.0), v=v) for v in (60.0, 100.0, 30.0)]
    fit = fit_images(pairs, V_MAX)
    (branch,) = fit.branches
    for growth, truth in ((branch.forward, Scanner.forward), (branch.backward, Scanner.backward)):
        assert [growth.beta_max.value, growth.rho.value, growth.u_peak.value] == pytest.approx(truth, rel=1e-6)
    assert [one.v_scan for one in branch.traces] == list(AMPLITUDES)
    assert np.isnan(branch.turn.standard_error)
    assert fit.points == 3 * 2 * 256 * 256


def test_voltages_of_other_pairs_are_told() -> None:
    """More volts and fewer periods may be another sample, but hysteresis grows then."""
    large, small = pair(grating(15.0)), pair(grating(15.0), v=30.0)
    asked = "are the voltages those of their pairs?"
    swapped = fit_images([replace(large, v_scan=30.0), replace(small, v_scan=100.0)], V_MAX)
    assert any(asked in remark for remark in swapped.remarks)
    finer = pair(grating(60.0), v=30.0)
    for right in ([large, small], [large, finer]):
        assert not any(asked in remark for remark in fit_images(right, V_MAX).remarks)
    with pytest.raises(Unphysical, match="images of 100 V and of 60 V are the same"):
        fit_images([large, replace(large, v_scan=60.0)], V_MAX)


def test_one_amplitude_keeps_rho() -> None:
    (branch,) = fit_images([pair(grating(), 0.05)], V_MAX, rho=2.0).branches
    assert branch.backward.rho == Estimate(2.0, branch.backward.rho.standard_error)


# what is refused


def refused(trace: Floats, retrace: Floats, **options: object) -> str:
    with pytest.raises(Unphysical) as caught:
        fit_images([Pair("a pair", 100.0, trace, retrace)], V_MAX, **options)  # type: ignore[arg-type]
    assert str(caught.value).startswith("a pair: ")
    return str(caught.value)


@pytest.mark.rest
@pytest.mark.parametrize("angle", [0.0, 5.0])
def test_images_that_are_turned_or_exchanged_are_told(angle: float) -> None:
    images = pair(grating(angle=angle), 0.05)
    trace, retrace = images.trace, images.retrace
    assert "it needs --retrace-mirrored" in refused(trace, retrace[:, ::-1])
    assert "leave --retrace-mirrored out" in refused(trace, retrace, retrace_mirrored=True)
    assert "trace and retrace are exchanged, or both mirrored" in refused(retrace, trace)
    assert "exchanged, or both mirrored" in refused(trace[:, ::-1], retrace[:, ::-1])
    assert "mirrored" in refused(trace[:, ::-1], retrace)
    right, mirrored = fitted(images), fit_pair(trace, retrace[:, ::-1], 100.0, retrace_mirrored=True)
    assert shapes(right) == shapes(mirrored)


def blurred(seed: int) -> Floats:
    """A rough surface without a period."""
    random = np.random.default_rng(seed)
    f = np.hypot(np.fft.fftfreq(256)[:, None], np.fft.rfftfreq(256))
    return np.fft.irfft2(np.fft.rfft2(random.standard_normal((256, 256))) * np.exp(-((25.0 * f) ** 2)))


def test_what_is_no_periodic_sample_is_refused() -> None:
    random = np.random.default_rng(3)
    assert "no period stands out" in refused(*random.standard_normal((2, 128, 128)))
    assert "no period stands out" in refused(blurred(1), blurred(2))
    assert "has no contrast" in refused(np.ones((64, 64)), np.zeros((64, 64)))
    assert "has no contrast" in refused(*(np.arange(64.0) * np.ones((64, 1)) * side for side in (1.0, 2.0)))
    images = pair(grating(), 0.05)
    assert "are the same image; both directions are needed" in refused(images.trace, images.trace)
    assert "does not show the trace's pattern" in refused(images.trace, random.standard_normal((256, 256)))
    assert "no branches of the harmonic model join" in refused(images.trace, pair(grating(12.0), 0.05).retrace)


@pytest.mark.parametrize(
    ("periods", "said"),
    [
        (1.5, "at least 3 are needed"),
        (2.0, "at least 3 are needed"),
        (2.4, "at least 3 are needed"),
        (120.0, "too fine"),
    ],
)
def test_too_few_and_too_many_periods_are_refused(periods: float, said: str) -> None:
    images = pair(grating(periods), 0.02)
    assert said in refused(images.trace, images.retrace)


def test_a_count_that_the_window_leaves_open_is_refused() -> None:
    """Away from the turns nothing says which of sixty periods is which, once the branches are not exactly (17)."""
    images = pair(grating(60.0, window=(0.15, 0.85)), 0.02)
    place = (np.arange(256) + 0.5) / 256
    bent = np.stack([np.interp(place + 0.006 * place**2, place, row) for row in images.retrace])
    assert "periods further left or right" in refused(images.trace, bent, window=(0.15, 0.85))


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"retrace": np.zeros((256, 128))}, "trace and retrace have 256 x 256 and 256 x 128 pixels"),
        ({"trace": np.zeros((256, 20)), "retrace": np.zeros((256, 20))}, "256 x 20 pixels are too few"),
        ({"trace": np.full((256, 256), np.nan)}, "the trace has no pixel with a height"),
        ({"v_scan": 120.0}, "a scan of 120 V is outside the driver's 0..100 V"),
    ],
)
def test_images_that_cannot_be_are_refused(changed: dict[str, object], said: str) -> None:
    with pytest.raises(Unphysical, match=said):
        fit_images([replace(pair(grating(**{"pixels": 256, "lines": 256})), **changed)], V_MAX)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"window": (0.4, 0.6)}, "is not a large part"),
        ({"turn": 1.0}, "a turn of 1 is outside"),
        ({"delay_pixels": np.nan}, "a delay of nan pixels is too large for a line of 128"),
        ({"delay_pixels": -125.0}, "a delay of -125 pixels is too large"),
    ],
)
def test_options_out_of_range_are_refused(options: dict[str, object], said: str) -> None:
    images = pair(grating(**SMALL))
    assert said in refused(images.trace, images.retrace, **options)


@pytest.mark.parametrize("rows", [1, 40, 70])
def test_lines_that_were_not_scanned_have_no_weight(rows: int) -> None:
    """Where a scan was stopped; too few lines are refused by their number."""
    images = pair(grating(**SMALL))
    stopped = [image.copy() for image in (images.trace, images.retrace)]
    for image in stopped:
        image[len(image) - rows :] = 0.7
    if len(stopped[0]) - rows < MIN_PIXELS:
        assert f"{len(stopped[0]) - rows} of {len(stopped[0])} rows have data" in refused(*stopped)
    else:
        assert shapes(fit_pair(stopped[0], stopped[1], 100.0)) == pytest.approx(FULL, abs=1e-3)


def test_loud_lines_are_named() -> None:
    images = pair(grating(), 0.05)
    loud = images.trace.copy()
    loud[100:103] += 2.0 * np.random.default_rng(5).standard_normal((3, 256))
    fit = fit_images([replace(images, trace=loud)], V_MAX)
    assert any("3 lines differ from the others (row 101, 102, 103); they were used" in text for text in fit.remarks)
    loud[100:103] *= 30.0
    assert "rows 101 to 103 have most of the trace's contrast; crop them" in refused(loud, images.retrace)


@pytest.mark.rest
@pytest.mark.parametrize("angle", [-8.0, 5.0])
def test_steps_of_terraces_are_removed(angle: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Three steps of six times the amplitude of the strongest wave."""
    images = pair(OnTerraces(lattice(9.3, 11.0), 6.0, angle), 0.02, seed=3)
    fit = fitted(images)
    assert fit.explained > 0.8
    assert max(map(abs, distances(fit))) < 4.0
    assert max(abs(one - truth) for one, truth in zip(shapes(fit), FULL, strict=True)) < 0.005
    monkeypatch.setattr("tablegen.images.pair_fit.have_terraces", lambda _: False)
    try:
        before = fitted(images)
    except Unphysical:
        return
    assert before.explained < 0.5
    assert before.forward.beta.standard_error > 3.0 * fit.forward.beta.standard_error


def test_steps_at_14_degrees_are_removed(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first fit has a wave that hardly changes along a line: its amplitude was beyond all bounds, and hid them."""
    images = pair(OnTerraces(lattice(9.3, 11.0), 6.0, 14.0), 0.02, seed=3)
    fit = fitted(images)
    assert fit.explained > 0.8
    assert max(map(abs, distances(fit))) < 4.0
    assert shapes(fit) == pytest.approx(FULL, abs=0.005)
    monkeypatch.setattr("tablegen.images.periodic_model._LEAST_PERIODS", 0.0)
    wrong = fitted(images)
    assert max(abs(one - truth) for one, truth in zip(shapes(wrong), FULL, strict=True)) > 0.02
