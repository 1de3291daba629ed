"""Offset, size, frequency and resonance against their synthetic truth, and what is said where data do not suffice."""

from math import isnan, sqrt

import numpy as np
import pytest
from calibrating import CASES, DRIVES, FREQUENCIES, OFFSETS, RESPONSE, V_MAX, actual, apparent, distances, trials
from sets import long

from tablegen.base.input_errors import Unphysical
from tablegen.calibration.laws.frequency import fit_frequency
from tablegen.calibration.laws.offset import fit_offset
from tablegen.calibration.laws.resonance import fit_resonance
from tablegen.calibration.laws.size import fit_size
from tablegen.compensation.offset import OffsetLaw
from tablegen.compensation.size import SizeLaw
from tablegen.fitting.estimate import Estimate

FAST = {"offset": 400, "size": 100, "hysteresis": 50, "images": 10, "frequency": 300, "resonance": 50}
SLOW = ("hysteresis", "images", "resonance")
COVERED = 0.9545  # by two standard errors, as they are defined


@pytest.mark.parametrize("kind", CASES)
def test_exact_data_give_exact_parameters(kind: str) -> None:
    for name, (estimate, truth) in next(trials(kind, 1, noise=0.0)).items():
        assert estimate.value == pytest.approx(truth, rel=1e-9), name
        assert estimate.standard_error <= 1e-6 * abs(truth), name


@pytest.mark.rest
@pytest.mark.parametrize("kind", long([each for each in CASES if each not in SLOW], CASES))
def test_standard_errors_are_neither_too_small_nor_too_large(kind: str) -> None:
    """Within three standard deviations of the share; parameters of one fit, which hang together, count as two."""
    by_name = distances(kind, FAST[kind])
    count, found = FAST[kind] * min(len(by_name), 2), np.concatenate([*by_name.values()])
    least, most = (COVERED + sign * 3.0 * sqrt(COVERED * (1.0 - COVERED) / count) for sign in (-1.0, 1.0))
    assert least <= np.mean(np.abs(found) <= 2.0) <= most
    # The negative controls: errors of half the size would not pass, and with twice the size nothing would be outside.
    assert np.mean(np.abs(found) <= 1.0) < min(least, 0.9)
    assert np.mean(np.abs(found) <= 4.0) > 0.98
    assert np.mean(found) == pytest.approx(0.0, abs=0.3), "biased"


@pytest.mark.rest
@pytest.mark.parametrize("kind", long([each for each in CASES if each not in SLOW], CASES))
def test_the_truth_lies_within_two_errors_in_95_of_100(kind: str) -> None:
    """Of 1,000 trials a share of 95.45 % is measured to 0.66 %: three times of that are allowed. Images take longer."""
    count = 300 if kind == "images" else 1000
    allowed = 3.0 * sqrt(COVERED * (1.0 - COVERED) / count)
    for name, found in distances(kind, count).items():
        assert COVERED - allowed <= np.mean(np.abs(found) <= 2.0) <= COVERED + allowed, name


# offset


def test_three_points_are_exact_and_agree_with_the_build() -> None:
    """What the scanner file's ``points`` would give is what is written."""
    v, sizes = np.array([7.0, 50.0, 93.0]), np.array([16.3, 17.7, 22.3])
    fit = fit_offset(v, sizes, V_MAX)
    law = OffsetLaw.fit([-0.86, 0.0, 0.86], sizes.tolist())
    assert fit.m_minus.value == pytest.approx(law.factor(-1.0), rel=1e-12)
    assert fit.m_plus.value == pytest.approx(law.factor(1.0), rel=1e-12)
    assert fit.largest_percent < 1e-9
    assert isnan(fit.m_minus.standard_error)
    assert "few-points" in [remark.code for remark in fit.remarks]


def test_more_points_agree_with_the_build_too() -> None:
    sizes = apparent(OFFSETS, 0.92, 1.25, 17.7) * [1.001, 0.998, 1.002, 1.0, 0.999]
    fit = fit_offset(OFFSETS, sizes, V_MAX)
    law = OffsetLaw.fit((OFFSETS / 50.0 - 1.0).tolist(), sizes.tolist())
    assert fit.m_minus.value == pytest.approx(law.factor(-1.0), rel=1e-9)
    assert fit.m_plus.value == pytest.approx(law.factor(1.0), rel=1e-9)


def test_the_residual_is_the_scale_error_that_is_left() -> None:
    sizes = apparent(OFFSETS, 0.92, 1.25, 17.7) * [1.0, 1.0, 1.003, 1.0, 1.0]
    fit = fit_offset(OFFSETS, sizes, V_MAX)
    m = apparent(OFFSETS, fit.m_minus.value, fit.m_plus.value, 1.0)
    assert fit.residual_percent == pytest.approx(100.0 * (sizes / fit.centre_nm.value / m - 1.0), abs=1e-9)


def test_an_outlier_is_named_and_kept() -> None:
    v = np.linspace(5.0, 95.0, 12)
    sizes = apparent(v, 0.92, 1.25, 17.7) * (1.0 + 0.002 * np.random.default_rng(3).standard_normal(12))
    clean = fit_offset(v, sizes, V_MAX)
    assert clean.outliers == ()
    sizes[4] *= 1.03
    wrong = fit_offset(v, sizes, V_MAX)
    assert wrong.outliers == (4,)
    assert wrong.points == 12
    assert wrong.centre_nm.value != pytest.approx(clean.centre_nm.value, rel=1e-4), "it was dropped"


@pytest.mark.common
def test_outliers_are_rarely_seen_where_there_are_none() -> None:
    v = np.linspace(5.0, 95.0, 12)
    random = np.random.default_rng(4)
    truth = apparent(v, 0.92, 1.25, 17.7)
    found = sum(
        bool(fit_offset(v, truth * (1.0 + 0.002 * random.standard_normal(12)), V_MAX).outliers) for _ in range(400)
    )
    assert found <= 12  # 1 in 100 is meant


@pytest.mark.parametrize(
    ("offsets", "why"),
    [
        ([50.0, 50.0, 93.0], "2 different offsets do not determine"),
        ([50.0, 93.0], "2 different offsets do not determine"),
        ([7.0, 50.0, 193.0], "193 V is outside the driver's 0..100 V; is v_max right"),
    ],
)
def test_offsets_that_do_not_suffice(offsets: list[float], why: str) -> None:
    with pytest.raises(Unphysical, match=why):
        fit_offset(np.array(offsets), np.full(len(offsets), 17.7), V_MAX)


def test_offsets_on_one_side_are_called_extrapolated() -> None:
    v = np.array([50.0, 60.0, 70.0, 80.0])
    fit = fit_offset(v, apparent(v, 0.92, 1.25, 17.7) * [1.0, 1.002, 0.998, 1.0], V_MAX)
    said = " ".join(fit.remarks)
    assert "m_minus is extrapolated over 50 % of the range; measure at some 7 % from 0 V" in said
    assert "m_plus is extrapolated" not in said


# size


def test_the_size_law_is_the_one_that_a_build_inverts() -> None:
    """Of another base size, beyond the threshold too."""
    for base, threshold in ((200.0, 0.5), (900.0, 0.4)):
        law = SizeLaw.calibrated(9.0, V_MAX, 0.7, base, threshold)
        sizes = np.array([law.size_nm(v / V_MAX) for v in DRIVES])
        fit = fit_size(DRIVES, sizes, V_MAX, base)
        assert fit.k_nm_per_v.value == pytest.approx(9.0, rel=1e-8)
        assert fit.beta.value == pytest.approx(0.7, rel=1e-7)
        assert fit.v_threshold.value == pytest.approx(threshold, rel=1e-7)
        assert fit.rms_percent < 1e-6


def test_two_sizes_are_the_papers_own_procedure() -> None:
    """At the base size and at another: k, then beta; golden numbers of 400 nm asked for, 436.4 and 466.7 reached."""
    for reached, beta in ((436.3636363636, 0.5), (466.6666666667, 1.0)):
        fit = fit_size(np.array([20.0, 40.0]), np.array([200.0, reached]), V_MAX)
        assert fit.k_nm_per_v.value == pytest.approx(10.0, rel=1e-9)
        assert fit.beta.value == pytest.approx(beta, rel=1e-9)
        assert fit.v_threshold == Estimate(0.5, fit.v_threshold.standard_error)
        said = " ".join(fit.remarks)
        assert "threshold is not determined" in said
        assert "errors cannot be estimated" in said


def test_a_threshold_that_was_given_is_kept() -> None:
    sizes = actual(DRIVES, 10.0, 0.53, 0.5, 200.0)
    fit = fit_size(DRIVES, sizes, V_MAX, threshold=0.4)
    assert fit.v_threshold.value == 0.4
    assert not any("threshold" in remark for remark in fit.remarks)
    assert fit.rms_percent > 0.1


@pytest.mark.parametrize(
    "drives", [np.linspace(5.0, 45.0, 9), np.linspace(60.0, 100.0, 9)], ids=["all below", "all above"]
)
def test_a_threshold_outside_the_points_is_not_guessed(drives: np.ndarray) -> None:
    sizes = actual(drives, 10.0, 0.53, 0.5, 200.0) * (1.0 + 0.002 * np.random.default_rng(5).standard_normal(9))
    fit = fit_size(drives, sizes, V_MAX)
    assert fit.v_threshold.value == 0.5
    assert any("the threshold is not determined by these points and was set to 0.5" in r for r in fit.remarks)


def test_a_linear_scanner_has_no_threshold() -> None:
    sizes = 10.0 * DRIVES * (1.0 + 0.002 * np.random.default_rng(6).standard_normal(len(DRIVES)))
    fit = fit_size(DRIVES, sizes, V_MAX)
    assert abs(fit.beta.value) <= 3.0 * fit.beta.standard_error
    assert any("the threshold is not determined" in remark for remark in fit.remarks)


def test_a_base_size_outside_the_points_is_called_extrapolated() -> None:
    drives = DRIVES[5:]
    fit = fit_size(drives, actual(drives, 10.0, 0.53, 0.5, 200.0), V_MAX, base_nm=100.0)
    assert any("the base size of 100 nm lies outside" in remark for remark in fit.remarks)


def test_absolute_noise_weighs_small_sizes_less() -> None:
    """The same error in nm at the smallest size moves a fit that takes errors as relative far more."""
    sizes = actual(DRIVES, 10.0, 0.53, 0.5, 200.0)
    sizes[0] += 2.0
    relative, absolute = (fit_size(DRIVES, sizes, V_MAX, noise=noise).beta.value for noise in ("relative", "absolute"))
    assert abs(absolute - 0.53) < 0.2 * abs(relative - 0.53)


@pytest.mark.parametrize(
    ("drives", "sizes", "base", "why"),
    [
        ([20.0, 20.0], [200.0, 200.0], 200.0, "one size does not determine k and beta; measure a second"),
        ([20.0, 120.0], [200.0, 900.0], 200.0, "120 V is above v_max"),
        ([0.0, 20.0], [1.0, 200.0], 200.0, "0 V is not a scan"),
        ([20.0, 40.0], [200.0, 400.0], 5000.0, "5000 nm needs .* of v_max; take a base size of 1000 nm or less"),
        ([20.0, 80.0], [200.0, 210.0], 200.0, "edge of what \\(6\\) can be"),
    ],
)
def test_sizes_that_do_not_suffice(drives: list[float], sizes: list[float], base: float, why: str) -> None:
    with pytest.raises(Unphysical, match=why):
        fit_size(np.array(drives), np.array(sizes), V_MAX, base)


# frequency


def test_the_lowest_frequency_is_the_reference_unless_one_is_given() -> None:
    gain = 1.0 - 0.03 * np.log10(FREQUENCIES)
    fit = fit_frequency(FREQUENCIES, gain)
    assert fit.reference_hz == 1.0
    assert fit.alpha.value == pytest.approx(0.03, rel=1e-9)
    assert any("the reference is the lowest frequency, 1 Hz" in remark for remark in fit.remarks)


def test_alpha_refers_to_the_gain_at_the_reference() -> None:
    """R is normalised to its value at f_DH: the slope per decade divided by the gain there."""
    gain = 2.0 - 0.1 * np.log10(FREQUENCIES)
    assert fit_frequency(FREQUENCIES, gain, 100.0).alpha.value == pytest.approx(0.1 / 1.8, rel=1e-9)


def test_a_rise_below_the_resonance_is_seen() -> None:
    f = np.geomspace(10.0, 10e3, 20)
    gain = (1.0 - 0.03 * np.log10(f / 100.0)) / (1.0 - (f / 40e3) ** 2)
    noise = 1.0 + 0.001 * np.random.default_rng(7).standard_normal(20)
    assert any("bends up" in remark for remark in fit_frequency(f, gain * noise, 100.0).remarks)
    low = f < 2e3
    assert not any("bends up" in remark for remark in fit_frequency(f[low], (gain * noise)[low], 100.0).remarks)


def test_a_gain_that_rises_is_refused_and_one_that_stays_is_no_loss() -> None:
    with pytest.raises(Unphysical, match=r"the gain rises by 3 % a decade.*--to-hz"):
        fit_frequency(FREQUENCIES, 1.0 + 0.03 * np.log10(FREQUENCIES))
    flat = 1.0 + 0.002 * np.random.default_rng(1).standard_normal(15)
    fits = [fit_frequency(FREQUENCIES, gain, 1.0) for gain in (flat, flat[::-1])]
    assert min(fit.alpha.value for fit in fits) == 0.0
    assert any("alpha is set to 0" in remark for fit in fits for remark in fit.remarks)


def test_one_frequency_determines_nothing() -> None:
    with pytest.raises(Unphysical, match="one frequency does not determine alpha"):
        fit_frequency(np.array([5.0, 5.0]), np.array([1.0, 1.0]))
    near = fit_frequency(np.array([100.0, 101.0, 102.0]), np.array([1.0, 0.995, 1.004]), 100.0)
    assert any("alpha is not determined" in remark for remark in near.remarks)


# resonance


def response(delay_s: float = 3e-6) -> np.ndarray:
    r = RESPONSE / 40e3
    return 3.0 * np.exp(-2j * np.pi * RESPONSE * delay_s) / (1.0 - r**2 + 1j * r / 20.0)


@pytest.mark.parametrize("delay_s", [0.0, 3e-6, 3e-5])
def test_phases_are_unwrapped(delay_s: float) -> None:
    h = response(delay_s)
    fit = fit_resonance(RESPONSE, np.abs(h), np.degrees(np.angle(h)))
    assert fit.delay_s.value == pytest.approx(delay_s, rel=1e-9, abs=1e-15)
    assert fit.quality.value == pytest.approx(20.0, rel=1e-9)


def test_a_phase_that_is_better_than_the_gain_counts_for_more() -> None:
    noise = np.random.default_rng(13).standard_normal((2, len(RESPONSE)))
    gain, phase = np.abs(response()) * (1.0 + 0.02 * noise[0]), np.angle(response()) + 0.0005 * noise[1]
    both, alone = fit_resonance(RESPONSE, gain, np.degrees(phase)), fit_resonance(RESPONSE, gain)
    assert both.frequency_hz.standard_error < 0.1 * alone.frequency_hz.standard_error
    assert abs(both.frequency_hz.value - 40e3) <= 3.0 * both.frequency_hz.standard_error


def test_an_inverting_amplifier_is_turned() -> None:
    h = -response()
    fit = fit_resonance(RESPONSE, np.abs(h), np.degrees(np.angle(h)))
    assert fit.frequency_hz.value == pytest.approx(40e3, rel=1e-9)
    assert any("inverted" in remark for remark in fit.remarks)


def test_without_a_phase_there_is_no_delay() -> None:
    fit = fit_resonance(RESPONSE, np.abs(response()))
    assert fit.quality.value == pytest.approx(20.0, rel=1e-9)
    assert fit.delay_s.value == 0.0
    assert any("the delay is not determined" in remark for remark in fit.remarks)


def test_rows_may_stand_in_any_order_and_an_outlier_is_named() -> None:
    order = np.random.default_rng(8).permutation(len(RESPONSE))
    noise = np.random.default_rng(9).standard_normal((2, len(RESPONSE)))
    gain = np.abs(response()) * (1.0 + 0.002 * noise[0])
    gain[17] *= 1.1
    phase = np.degrees(np.angle(response()) + 0.002 * noise[1])
    fit = fit_resonance(RESPONSE[order], gain[order], phase[order])
    assert fit.outliers == (int(np.flatnonzero(order == 17)[0]),)


def test_a_resonance_outside_the_points_is_refused() -> None:
    low = RESPONSE < 20e3
    with pytest.raises(Unphysical, match=r"outside the .* Hz that were measured; measure through it"):
        fit_resonance(RESPONSE[low], np.abs(response())[low])
    with pytest.raises(Unphysical, match="2 frequencies do not determine a resonance"):
        fit_resonance(np.array([1.0, 2.0]), np.array([1.0, 1.0]))


def test_points_too_far_apart_to_follow_the_phase_are_noticed() -> None:
    h = response(5e-5)
    fit = fit_resonance(RESPONSE, np.abs(h), np.degrees(np.angle(h)))
    assert any("the phase is missed by" in remark for remark in fit.remarks)


def test_a_leading_phase_is_refused() -> None:
    h = response(-2e-5)
    with pytest.raises(Unphysical, match="a lag has to be negative"):
        fit_resonance(RESPONSE, np.abs(h), np.degrees(np.angle(h)))


def test_two_resonances_are_not_called_one() -> None:
    r = RESPONSE / 20e3
    both = response(0.0) * (1.0 + 0.5 / (1.0 - r**2 + 0.02j * r))
    fit = fit_resonance(RESPONSE, np.abs(both))
    assert any("one resonance does not describe this response" in remark for remark in fit.remarks)


# estimates


@pytest.mark.parametrize(
    ("value", "error", "rounded"),
    [
        (0.9203456789, 0.0012, 0.92035),
        (0.9203456789012, float("nan"), 0.920345679),
        (0.9203456789012, 0.0, 0.920345679),
        (40000.26123, 0.5, 40000.26),
        (1.23456, 100.0, 1.23),
        (0.0, 0.1, 0.0),
    ],
)
def test_what_is_written_has_the_digits_that_mean_something(value: float, error: float, rounded: float) -> None:
    assert Estimate(value, error).rounded == rounded
