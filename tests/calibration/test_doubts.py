"""Fits that say nothing about the scanner are told from those that do, for each kind of calibration."""

import numpy as np
import pytest
from calibrating import (
    AMPLITUDES,
    DRIVES,
    FREQUENCIES,
    OFFSETS,
    RESPONSE,
    V_MAX,
    Scanner,
    actual,
    apparent,
)
from replacing import replace

from tablegen.calibration.fit_checks import doubts
from tablegen.calibration.laws.frequency import fit_frequency
from tablegen.calibration.laws.hysteresis import HysteresisFit, Trace, fit_hysteresis
from tablegen.calibration.laws.offset import fit_offset
from tablegen.calibration.laws.resonance import fit_resonance
from tablegen.calibration.laws.size import fit_size
from tablegen.fitting.estimate import Estimate, Fit
from tablegen.fitting.growth import Growth, fit_growth
from tablegen.fitting.measured_branch import MeasuredBranch


def traces(noise: float, *forward: float) -> list[Trace]:
    """A trace at each amplitude; ``forward`` are the betas that each of them shows, whatever (22) says."""
    random = np.random.default_rng(5)
    shapes = [Scanner() if not forward else Scanner(forward=(beta, 1e-9, 0.4)) for beta in forward or AMPLITUDES]
    volts = AMPLITUDES[: len(shapes)]
    both = zip(shapes, volts, strict=True)
    return [one.trace(v, 3.3, 800, noise * random.standard_normal((2, 800))) for one, v in both]


def measured(kind: str, noise: float) -> Fit:
    """A calibration of one kind with so much noise."""
    random = np.random.default_rng(7)

    def noisy(values: np.ndarray) -> np.ndarray:
        return np.maximum(values * (1.0 + noise * random.standard_normal(len(values))), 1e-3 * values)

    if kind == "hysteresis":
        return fit_hysteresis(traces(noise), V_MAX)
    if kind == "offset":
        return fit_offset(OFFSETS, noisy(apparent(OFFSETS, 0.92, 1.25, 17.7)), V_MAX)
    if kind == "size":
        return fit_size(DRIVES, noisy(actual(DRIVES, 10.0, 0.53, 0.5, 200.0)), V_MAX)
    if kind == "frequency":
        return fit_frequency(FREQUENCIES, noisy(1.0 - 0.03 * np.log10(FREQUENCIES / 100.0)), 100.0)
    r = RESPONSE / 40e3
    h = 1.0 / (1.0 - r**2 + 1j * r / 20.0)
    return fit_resonance(
        RESPONSE, noisy(np.abs(h)), np.degrees(np.angle(h)) + 50.0 * noise * random.standard_normal(58)
    )


KINDS = ("offset", "size", "hysteresis", "frequency", "resonance")


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("noise", [0.0, 0.002, 0.01])
def test_a_measurement_with_noise_of_a_sensor_is_not_doubted(kind: str, noise: float) -> None:
    assert doubts(measured(kind, noise)) == ()


@pytest.mark.parametrize(
    ("kind", "noise", "said"),
    [
        ("offset", 0.4, "may be off by a fifth or more; measure at more offsets"),
        ("size", 0.4, "beta = .* cannot be distinguished from 0, the linear scanner"),
        ("frequency", 0.15, r"alpha = .* cannot be distinguished from 0, no loss"),
    ],
)
def test_noise_that_hides_the_correction_is(kind: str, noise: float, said: str) -> None:
    found = doubts(measured(kind, noise))
    assert found
    assert any(np.char.find(one, said.split(".*")[-1].strip()) >= 0 for one in found), found


def test_a_scanner_without_an_error_is_no_doubt() -> None:
    """A factor of 1, a beta and a loss of 0 are results, where they are known."""
    random = np.random.default_rng(9)
    noise = 1.0 + 0.001 * random.standard_normal(15)
    assert doubts(fit_offset(OFFSETS, 17.7 * noise[:5], V_MAX)) == ()
    assert doubts(fit_size(DRIVES, 10.0 * DRIVES * noise[:11], V_MAX)) == ()
    assert doubts(fit_frequency(FREQUENCIES, noise, 100.0)) == ()


def test_as_many_points_as_parameters_are_no_doubt() -> None:
    """The paper's procedure, whose errors cannot be known; a remark says so."""
    assert doubts(fit_offset(OFFSETS[::2], apparent(OFFSETS[::2], 0.92, 1.25, 17.7), V_MAX)) == ()
    two = DRIVES[[2, 10]]
    assert doubts(fit_size(two, actual(two, 10.0, 0.53, 0.5, 200.0), V_MAX)) == ()


def grown(*amplitudes: tuple[float, float, float]) -> Growth:
    """(22) through amplitudes (of v_max), betas and their standard errors."""
    v = np.array([one[0] for one in amplitudes])
    return fit_growth(v, [MeasuredBranch(Estimate(b, e), Estimate(0.4, 0.01)) for _, b, e in amplitudes], 1.5)


def with_forward(growth: Growth) -> HysteresisFit:
    fit = fit_hysteresis(traces(0.002), V_MAX)
    return replace(fit, branches=(replace(fit.branches[0], forward=growth),))


def test_a_law_that_misses_what_it_describes_is_doubted() -> None:
    """The finding: beta 0.032 ± 0.069, and (22) far from what was measured."""
    wild = grown((0.3, 0.08, 0.002), (0.6, 0.005, 0.002), (1.0, 0.06, 0.002))
    assert wild.off_errors > 10.0
    below, off = doubts(with_forward(wild))
    assert "turn 0.5, forward: beta_max = " in below
    assert "is less than 2 standard errors from none" in below
    assert "(22) misses the measured residuals by " in off
    assert "take --points" in off
    assert doubts(with_forward(wild), points=True) == ()


def test_a_law_that_misses_little_is_not_however_small_the_errors() -> None:
    """A precise sensor sees that (22) is not exact: 12 standard errors of a hundredth of the residual."""
    good = grown((0.3, 0.0301, 1e-5), (0.6, 0.048, 1e-5), (1.0, 0.0600, 1e-5))
    assert good.off_errors > 10.0
    assert good.off_share < 0.1
    assert doubts(with_forward(good)) == ()


@pytest.mark.common
@pytest.mark.parametrize(("error", "doubted"), [(0.009, False), (0.021, True)])
def test_two_standard_errors_are_the_limit(error: float, doubted: bool) -> None:
    fit = fit_hysteresis(traces(0.002), V_MAX)
    growth = replace(fit.branches[0].forward, beta_max=Estimate(0.04, error))
    assert bool(doubts(with_forward(growth))) == doubted
    peak = replace(fit.branches[0].forward, u_peak=Estimate(0.4, 0.26))
    assert any("u_peak = 0.4 ± 0.26 may be anywhere" in one for one in doubts(with_forward(peak)))


@pytest.mark.parametrize(
    ("name", "estimate", "said"),
    [
        ("frequency_hz", Estimate(4e4, 5e3), "frequency_hz = 4e+04 ± 5e+03 may be off by a fifth"),
        ("quality", Estimate(20.0, 11.0), "quality = 20 ± 11 is less than 2 standard errors from none"),
        ("delay_s", Estimate(0.0, 2e-6), "delay_s = 0 ± 2e-06 may be off by a tenth of the resonance's period"),
    ],
)
def test_each_parameter_of_a_resonance(name: str, estimate: Estimate, said: str) -> None:
    fit = replace(measured("resonance", 0.002), **{name: estimate})  # type: ignore[arg-type]
    (one,) = doubts(fit)
    assert one.startswith(said)
    assert doubts(fit, points=True) == ()
