"""Sensor traces to branches: period, turn, alignment, drift, delay; growth with the amplitude; what is refused."""

import numpy as np
import pytest
from calibrating import AMPLITUDES, V_MAX, Scanner, branch, grown
from hypothesis import given, settings
from hypothesis import strategies as st
from replacing import replace

from tablegen.base.input_errors import Unphysical
from tablegen.calibration.laws.hysteresis import Trace, TurnFit, fit_hysteresis
from tablegen.calibration.laws.points import measured_points
from tablegen.calibration.laws.trace import TraceFit, fit_trace
from tablegen.calibration.laws.triangle import find_triangle
from tablegen.compensation.hysteresis import BranchShape
from tablegen.fitting.correlation import correlation_length
from tablegen.fitting.estimate import Estimate
from tablegen.fitting.growth import Growth, fit_growth
from tablegen.fitting.measured_branch import AmplitudeFit, MeasuredBranch

FULL = (0.037, 0.37), (0.080, 0.48)  # beta and u_peak of the scanner's branches at full scale


def fitted(trace: Trace, **options: float | None) -> TraceFit:
    return fit_trace(trace.time_s, trace.drive_v, trace.displacement_nm, **options)  # type: ignore[arg-type]


def shapes(fit: TraceFit) -> list[float]:
    return [e.value for side in (fit.forward, fit.backward) for e in (side.beta, side.u_peak)]


def noise(samples: int, seed: int, rms: float = 0.002) -> np.ndarray:
    return rms * np.random.default_rng(seed).standard_normal((2, samples))


@pytest.mark.common
@given(
    turn=st.floats(0.1, 0.9),
    begins=st.floats(0.0, 1.0),
    periods=st.floats(2.0, 7.0),
    period_s=st.sampled_from([2.5e-3, 1.0, 40.0]),
    samples=st.integers(900, 1300),
    drift=st.floats(-0.05, 0.05),
    sign=st.sampled_from([-1.0, 1.0]),
)
@settings(max_examples=15)
def test_an_exact_trace_gives_its_branches_whenever_it_begins_and_ends(
    turn: float, begins: float, periods: float, period_s: float, samples: int, drift: float, sign: float
) -> None:
    scanner = Scanner(turn=turn, begins=begins, period_s=period_s, drift=drift, sign=sign)
    fit = fitted(scanner.trace(100.0, periods, samples))
    assert shapes(fit) == pytest.approx([0.037, 0.37, 0.080, 0.48], abs=1e-8)
    assert fit.triangle.period_s == pytest.approx(period_s, rel=1e-10)
    assert fit.triangle.turn == pytest.approx(turn, abs=1e-10)
    assert fit.v_scan == pytest.approx(100.0, rel=1e-10)
    assert fit.inverted == (sign < 0.0)


def test_one_period_from_turn_to_turn_is_enough() -> None:
    fit = fitted(Scanner(begins=0.0).trace(100.0, periods=1.0, samples=400))
    assert shapes(fit) == pytest.approx([0.037, 0.37, 0.080, 0.48], abs=1e-8)
    assert fit.periods == pytest.approx(1.0)


@pytest.mark.common
def test_periods_are_averaged() -> None:
    """Four times the periods, half the error; and the errors say so."""
    scatter, errors = [], []
    for periods in (2, 8):
        samples = 150 * periods
        found = [fitted(Scanner().trace(100.0, periods, samples, noise(samples, seed))) for seed in range(10)]
        scatter.append(float(np.std([fit.forward.beta.value for fit in found])))
        errors.append(float(np.mean([fit.forward.beta.standard_error for fit in found])))
    assert errors[1] == pytest.approx(0.5 * errors[0], rel=0.15)
    assert [s / e for s, e in zip(scatter, errors, strict=True)] == pytest.approx([1.0, 1.0], abs=0.5)


def test_the_first_of_three_periods_is_left_out() -> None:
    trace = Scanner().trace(100.0, 4.0, 1000)
    unsettled = trace.displacement_nm + 40.0 * np.exp(-trace.time_s / 0.0008)
    told = replace(trace, displacement_nm=unsettled)
    assert shapes(fitted(told)) == pytest.approx([0.037, 0.37, 0.080, 0.48], abs=2e-6)
    assert abs(shapes(fitted(told, settle_periods=0))[0] - 0.037) > 2e-4, "or the test would show nothing"
    assert fitted(told).settling_samples == pytest.approx(250, abs=1)


def test_drift_is_taken_off_as_far_as_a_polynomial_follows_it() -> None:
    trace = Scanner(drift=0.0).trace(100.0, 5.0, 1500)
    s = trace.time_s / trace.time_s[-1]
    creep = replace(trace, displacement_nm=trace.displacement_nm + 1000.0 * (0.05 * s - 0.03 * s**2 + 0.01 * s**3))
    fit = fitted(creep)
    assert shapes(fit) == pytest.approx([0.037, 0.37, 0.080, 0.48], abs=1e-8)
    assert fit.drift_percent > 1.0
    assert abs(shapes(fitted(creep, drift_order=0))[0] - 0.037) > 2e-4, "or the test would show nothing"


def test_a_delay_that_is_known_is_taken_off_and_one_that_is_not_can_be_fitted() -> None:
    trace = Scanner(delay_s=3e-5).trace(100.0, 3.3, 1200)
    assert abs(shapes(fitted(trace))[0] - 0.037) > 1e-3, "or the test would show nothing"
    assert shapes(fitted(trace, delay_s=3e-5)) == pytest.approx([0.037, 0.37, 0.080, 0.48], abs=1e-8)
    fit = fitted(trace, delay_s=None)
    assert fit.delay_s.value == pytest.approx(3e-5, rel=1e-6)
    assert shapes(fit) == pytest.approx([0.037, 0.37, 0.080, 0.48], abs=1e-6)


@pytest.mark.common
def test_the_timing_of_a_noisy_drive_counts_in_the_errors() -> None:
    """Noise on the drive alone: what it does to the branches is in their standard errors."""
    off = []
    for seed in range(20):
        both = noise(800, seed, 0.01)
        both[0] = 0.0
        fit = fitted(Scanner().trace(100.0, 3.3, 800, both))
        off.append((fit.forward.beta.value - 0.037) / fit.forward.beta.standard_error)
    assert 0.5 < float(np.sqrt(np.mean(np.square(off)))) < 1.4


def test_residuals_that_are_no_noise_widen_the_errors() -> None:
    """A third harmonic that the model lacks, and the correlation of it."""
    trace = Scanner().trace(100.0, 3.3, 1200, noise(1200, 1, 0.0005))
    phase = trace.time_s / 0.01 + 0.137
    crooked = replace(trace, displacement_nm=trace.displacement_nm + 10.0 * np.sin(6.0 * np.pi * phase))
    clean, bent = fitted(trace), fitted(crooked)
    assert clean.correlated < 1.3
    assert bent.correlated > 5.0
    assert bent.forward.beta.standard_error > 10.0 * clean.forward.beta.standard_error
    fit = fit_hysteresis([crooked], V_MAX)
    assert any("residuals are correlated over" in remark for remark in fit.remarks)


@pytest.mark.common
def test_errors_of_a_slow_sensor_are_honest() -> None:
    """Noise that is alike over nine samples tells nine times less: without that the distances would be 3 errors."""
    off = []
    for seed in range(20):
        slow = np.convolve(noise(1008, seed, 0.006)[0], np.full(9, 1.0 / 9.0), "valid")
        fit = fitted(Scanner().trace(100.0, 3.3, 1000, np.stack([slow, np.zeros(1000)])))
        off += [(value - truth) / e.standard_error for (value, truth, e) in _distances(fit)]
    assert 0.6 < float(np.sqrt(np.mean(np.square(off)))) < 1.5


def _distances(fit: TraceFit) -> list[tuple[float, float, Estimate]]:
    estimates = [e for side in (fit.forward, fit.backward) for e in (side.beta, side.u_peak)]
    return [(e.value, truth, e) for e, truth in zip(estimates, (0.037, 0.37, 0.080, 0.48), strict=True)]


def test_the_residual_is_the_papers() -> None:
    """Section 7: -3.5 % forward near 0.35 of the drive, +8.5 % backward near 0.55, sweep-aligned 0.45."""
    scanner = Scanner(forward=(0.035, 4.0, 0.37), backward=(0.085, 1.5, 0.45))
    fit = fit_hysteresis([scanner.trace(100.0, 3.3, 4000)], V_MAX)
    assert fit.before_percent == pytest.approx(8.5, abs=0.01)
    x, y = fit.curves[0].measured
    assert float(y.min()) == pytest.approx(-3.5, abs=0.05)
    assert float(x[np.argmin(y)]) == pytest.approx(0.37, abs=0.05)
    assert float(y.max()) == pytest.approx(8.5, abs=0.1)
    assert float(x[np.argmax(y)]) == pytest.approx(0.55, abs=0.05)
    assert fit.rms_percent < 1e-6


def test_samples_far_off_are_counted() -> None:
    trace = Scanner().trace(100.0, 3.3, 1000, noise(1000, 2))
    moved = trace.displacement_nm.copy()
    moved[[500, 800]] += 60.0
    fit = fitted(replace(trace, displacement_nm=moved))
    assert fit.strays == (500, 800)
    assert any(
        "2 samples are far off the curve (number 501, 801)" in r
        for r in fit_hysteresis([replace(trace, displacement_nm=moved)], V_MAX).remarks
    )
    assert fitted(trace).strays == ()


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (lambda t: replace(t, drive_v=np.full_like(t.drive_v, 5.0)), "the drive does not move"),
        (lambda t: replace(t, displacement_nm=np.zeros_like(t.time_s)), "the displacement does not move"),
        (lambda t: replace(t, drive_v=50.0 + t.time_s), "the drive has no complete sweep up and down"),
        (lambda t: replace(t, time_s=t.time_s[::-1]), "time does not ascend after"),
        (lambda t: replace(t, drive_v=t.drive_v + 30.0), "a drive of 30..130 V is outside the driver's 0..100 V"),
        (
            lambda t: Trace("", t.time_s[:20], t.drive_v[:20], t.displacement_nm[:20]),
            "20 samples are not enough for a trace",
        ),
        (
            lambda t: Trace("", t.time_s[::12], t.drive_v[::12], t.displacement_nm[::12]),
            "25.. samples a period are too few",
        ),
    ],
)
def test_traces_that_do_not_suffice(change: object, why: str) -> None:
    trace = Scanner().trace(100.0)
    with pytest.raises(Unphysical, match=why):
        fit_hysteresis([change(trace)], V_MAX)  # type: ignore[operator]


def test_fewer_periods_than_are_to_settle() -> None:
    with pytest.raises(
        Unphysical, match=r"100 V: 3.3 periods are recorded, which leaves no whole period after 3 to settle"
    ):
        fit_hysteresis([Scanner().trace(100.0)], V_MAX, settle_periods=3)


def test_a_drive_that_is_no_triangle_is_said() -> None:
    trace = Scanner().trace(80.0)
    wave = 3.0 * np.sin(4.0 * np.pi * (trace.time_s / 0.01 + 0.137))
    fit = fit_hysteresis([replace(trace, drive_v=trace.drive_v + wave)], V_MAX)
    assert any("the drive departs from a triangle by" in remark for remark in fit.remarks)


def test_a_sine_that_fills_the_range_is_refused_for_its_shape() -> None:
    """The triangle nearest to it is higher, and would leave the driver's range."""
    trace = Scanner().trace(100.0)
    sine = 50.0 - 50.0 * np.cos(2.0 * np.pi * trace.time_s / 0.02)
    with pytest.raises(Unphysical, match=r"not a triangle: .* 4\.2 % rms, as a sine does; .* `calibrate operator`"):
        fit_hysteresis([replace(trace, drive_v=sine, displacement_nm=10.0 * sine)], V_MAX)


def test_the_triangle_is_found_in_noise() -> None:
    trace = Scanner(turn=0.7).trace(80.0, 5.3, 4000, noise(4000, 3, 0.01))
    found = find_triangle(trace.time_s, trace.drive_v)
    errors = np.sqrt(np.diag(found.timing_covariance))
    off = np.array([found.period_s - 0.01, found.start_s - 0.01 * (1.0 - 0.137), found.turn - 0.7])
    assert np.all(np.abs(off) < 4.0 * errors)
    assert errors[2] < 1e-3
    assert found.departure == pytest.approx(0.01, rel=0.1)


# growth and turns


def test_amplitudes_give_growth_and_turns_give_sets() -> None:
    """Files in any order; a turn of 0.7 with other parameters is a set of its own."""
    other = Scanner(forward=(0.04, 3.0, 0.40), backward=(0.09, 1.2, 0.50), turn=0.7)
    traces = [scanner.trace(v) for v in (60.0, 100.0, 30.0) for scanner in (other, Scanner())]
    first, second = fit_hysteresis(traces, V_MAX).branches
    for fit, scanner in ((first, Scanner()), (second, other)):
        assert fit.turn.value == pytest.approx(scanner.turn, abs=1e-9)
        for growth, truth in ((fit.forward, scanner.forward), (fit.backward, scanner.backward)):
            assert [growth.beta_max.value, growth.rho.value, growth.u_peak.value] == pytest.approx(truth, rel=1e-6)
        assert [trace.v_scan for trace in fit.traces] == pytest.approx([30.0, 60.0, 100.0])


def test_what_comes_out_is_what_a_build_takes() -> None:
    (fit,) = fit_hysteresis([Scanner().trace(v) for v in AMPLITUDES], V_MAX).branches
    for growth, (beta, u_peak) in ((fit.forward, FULL[0]), (fit.backward, FULL[1])):
        shape = BranchShape.harmonic(float(growth.beta(np.array(1.0))), growth.u_peak.value)
        tau = np.linspace(0.0, 1.0, 50)
        assert shape.value(tau) == pytest.approx(branch(beta, u_peak)(tau), abs=1e-8)


def test_a_residual_that_hardly_grows_keeps_no_small_rho() -> None:
    """Through measurements that (22) describes as a step at best, the curve of the default rho would be 40 % off."""
    v = np.array([0.3, 0.6, 1.0])
    found = ((0.0354, 0.0013), (0.0431, 0.0023), (0.0336, 0.0013))
    measured = [MeasuredBranch(Estimate(*beta), Estimate(0.45, 0.01)) for beta in found]
    growth = fit_growth(v, measured, 1.5)
    assert growth.rho.value > 5.0
    assert np.isnan(growth.rho.standard_error)
    assert any("rho is only known to be large" in text for text in growth.remarks)
    assert growth.beta(v) == pytest.approx([beta for beta, _ in found], abs=0.008)
    # Negative control: one that grows as (22) has it is fitted, and one amplitude keeps what was given.
    grows = [
        MeasuredBranch(Estimate(grown(one * V_MAX, 0.08, 1.5), 0.0005), Estimate(0.45, 0.01)) for one in v.tolist()
    ]
    assert fit_growth(v, grows, 4.0).rho.value == pytest.approx(1.5, abs=1e-6)
    assert fit_growth(v[:1], measured[:1], 1.5).rho.value == 1.5


def test_one_amplitude_does_not_determine_rho() -> None:
    fit = fit_hysteresis([Scanner().trace(50.0, noise=noise(1000, 4))], V_MAX, rho=2.0)
    growth = fit.branches[0].backward
    assert growth.rho == Estimate(2.0, growth.rho.standard_error)
    assert np.isnan(growth.rho.standard_error)
    assert float(growth.beta(np.array(0.5))) == pytest.approx(grown(50.0, 0.08, 1.5), abs=0.002)
    said = " ".join(fit.remarks)
    assert "rho is not determined by these amplitudes and was set to 2" in said
    assert "beta_max is extrapolated from 0.5 of v_max" in said


def test_no_hysteresis_has_no_peak() -> None:
    """Whichever sign noise gives it."""
    scanner = Scanner(forward=(1e-5, 4.0, 0.4), backward=(1e-5, 4.0, 0.4))
    signs = set()
    for seed in range(4):
        trace = scanner.trace(100.0, noise=noise(1000, seed))
        signs.add(fit_trace(trace.time_s, trace.drive_v, trace.displacement_nm).forward.beta.value > 0.0)
        with pytest.raises(Unphysical, match=r"turn 0.\d+, (for|back)ward: no hysteresis above the noise"):
            fit_hysteresis([trace], V_MAX)
    assert signs == {True, False}, "or the test would show half"


def test_a_displacement_that_leads_is_refused() -> None:
    with pytest.raises(Unphysical, match="the displacement leads the drive"):
        fit_hysteresis([Scanner(delay_s=-3e-4).trace(100.0)], V_MAX)


def test_growth_that_is_not_22_is_said_and_widens() -> None:
    def seen(beta: float, u_peak: float) -> MeasuredBranch:
        return MeasuredBranch(Estimate(beta, 1e-4), Estimate(u_peak, 1e-3))

    v = np.array([0.2, 0.5, 0.8, 1.0])
    betas = [grown(100.0 * x, 0.08, 1.5) for x in v]
    plain = fit_growth(v, [seen(b, 0.48) for b in betas], 1.5)
    assert (plain.remarks, plain.rho.value) == ((), pytest.approx(1.5, rel=1e-6))
    bent = fit_growth(v, [seen(b + d, 0.48) for b, d in zip(betas, (0.002, -0.002, 0.002, -0.002), strict=True)], 1.5)
    assert bent.beta_max.standard_error > 5.0 * plain.beta_max.standard_error
    assert any("(22) misses the measured residuals" in remark for remark in bent.remarks)
    moving = fit_growth(v, [seen(b, u) for b, u in zip(betas, (0.51, 0.5, 0.49, 0.48), strict=True)], 1.5)
    assert any("u_peak differs from amplitude to amplitude, 0.48 to 0.51" in remark for remark in moving.remarks)
    assert moving.u_peak.standard_error > 5.0 * plain.u_peak.standard_error


# parts


@given(beta=st.floats(0.001, 0.12), at=st.floats(0.26, 0.74))
def test_the_peak_of_a_branch_is_where_the_model_put_it(beta: float, at: float) -> None:
    try:
        shape = BranchShape.harmonic(beta, at + beta)
    except Unphysical:
        return
    assert shape.peak() == pytest.approx((beta, at + beta), abs=1e-9)


def test_white_noise_is_not_correlated_and_its_mean_over_five_is() -> None:
    white = np.random.default_rng(6).standard_normal(20000)
    assert correlation_length(white) == pytest.approx(1.0, abs=0.1)
    assert correlation_length(np.convolve(white, np.ones(5), "valid")) == pytest.approx(5.0, rel=0.15)
    assert correlation_length(np.zeros(100)) == 1.0


# points


def turned(*amplitudes: tuple[float, float, float, float]) -> TurnFit:
    """One of volts, beta with its standard error, and the standard error of a u_peak of 0.3, both directions alike."""
    sides = [MeasuredBranch(Estimate(beta, error), Estimate(0.3, open_by)) for _, beta, error, open_by in amplitudes]
    growth = Growth(Estimate(0.04, 1e-3), Estimate(2.0, 0.1), Estimate(0.4, 1e-3), ())
    nothing = {"samples": 0, "noise_percent": 0.0, "drift_percent": 0.0, "residual_percent": np.zeros(0)}
    traces = tuple(
        AmplitudeFit(
            turn=Estimate(0.5),
            v_scan=v,
            forward=side,
            backward=side,
            scaling_percent=(0.0, 0.0),
            curves=(),
            **nothing,  # type: ignore[arg-type]
        )
        for (v, *_), side in zip(amplitudes, sides, strict=True)
    )
    return TurnFit(Estimate(0.5), growth, growth, traces)


def test_points_are_what_was_measured_where_it_was_determined() -> None:
    branch = turned(
        (10.0, -0.001, 1e-3, 0.01),  # noise
        (20.0, 0.002, 1e-3, 0.01),  # a beta that hides its peak
        (40.0, 0.02, 1e-3, 0.2),  # a peak that is open
        (60.0, 0.03, 1e-3, 0.01),
    )
    assert [(p["size_v"], p["beta"], p["u_peak"]) for p in measured_points(branch, "forward")] == [
        (20.0, 0.002, 0.4),
        (40.0, 0.02, 0.4),
        (60.0, 0.03, 0.3),
    ]


@pytest.mark.parametrize(
    ("volts", "beta", "said"),
    [
        (30.0, -0.01, "30 V, backward: the residual has the wrong sign"),
        (60.000001, 0.03, "60 V was measured twice"),
        (30.0, 0.4, "30 V, backward: "),
    ],
)
def test_points_that_make_no_branch_are_refused(volts: float, beta: float, said: str) -> None:
    with pytest.raises(Unphysical, match=said):
        measured_points(turned((60.0, 0.03, 1e-3, 0.01), (volts, beta, 1e-3, 0.01)), "backward")
