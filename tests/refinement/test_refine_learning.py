"""Iterative learning on linear scanners: it converges inside its bound, not outside, and learns no noise."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from editing import SCANNER, edited, write_pair
from hypothesis import example, given, settings
from hypothesis import strategies as st
from refining import scan_text
from replacing import replace

from tablegen.base.input_errors import Unphysical
from tablegen.compensation.dynamics import SecondOrder
from tablegen.config.load import load
from tablegen.planning.band_limit import band_limited
from tablegen.planning.line_plan import LinePlan, make_plan
from tablegen.refinement.bound import MAX_ERROR_LEFT, bound, plausible_ratios, remaining_error
from tablegen.refinement.displacement import Displacement
from tablegen.refinement.learning import learn
from tablegen.refinement.round import Options, refine
from tablegen.waveform.series import FourierSeries

N, GAIN = 6, 0.7
STEADY_PHASE = 0.085  # turns of harmonic N, below which 1,400 disturbances end below 2 %, beyond below 7
PLAIN = edited(SCANNER, "- [x.hysteresis]", "- [[x.hysteresis.branches]]", "- [x.resonance]", "- [x.frequency]")
H = 20


def line_of(folder: Path, *edits: str, scanner: str = PLAIN) -> LinePlan:
    scan = scan_text(f"x.band_limit.harmonics = {H}", *edits)
    return make_plan(load(write_pair(folder, scan, scanner))).x


@pytest.fixture(scope="module")
def line(tmp_path_factory: pytest.TempPathFactory) -> LinePlan:
    return line_of(tmp_path_factory.mktemp("linear"))


def with_layer(line: LinePlan, layer: FourierSeries) -> LinePlan:
    target = band_limited(line.drive.shape, line.band_limit, H, layer)
    return replace(line, layer=layer, target=target, series=target)


def seen(line: LinePlan, ratio: np.ndarray, disturbance: FourierSeries, noise: float = 1e-7) -> Displacement:
    """A linear scanner, 200 nm a line: what the layer adds, times a ratio each harmonic, and what no drive causes.

    The line itself it makes right: a gain that all harmonics share is no error of the position, but one of the size.
    """
    plain = band_limited(line.drive.shape, line.band_limit, H)
    moved = plain.plus(line.target.less(plain).times(ratio.real, ratio.imag)).plus(disturbance)
    series = FourierSeries(200.0 * moved.a0, 200.0 * moved.a, 200.0 * moved.b)
    return Displacement(series, np.eye(2 * H + 1) * (200.0 * noise) ** 2, 200.0 * noise, 0.0, 1.0, 5.0, 5000, 0)


def disturbed(seed: int, size: float = 0.01) -> FourierSeries:
    generator = np.random.default_rng(seed)
    c = size * generator.standard_normal((2, N))
    return FourierSeries(0.0, c[0], c[1])


def delayed(gain: float, phase_turns: float) -> np.ndarray:
    """A delay that turns harmonic N by so much."""
    return gain * np.exp(-2j * np.pi * phase_turns * np.arange(1, H + 1) / N)


def history(line: LinePlan, ratio: np.ndarray, disturbance: FourierSeries, rounds: int) -> list[float]:
    """The residual before each round; it ends where the drive leaves its range."""
    found = []
    for _ in range(rounds):
        try:
            update = learn(line, seen(line, ratio, disturbance), GAIN, N)
            found.append(update.before.rms_percent)
            line = with_layer(line, update.layer)
        except Unphysical:
            found.append(np.inf)
            break
    return found


@pytest.mark.common
@given(st.floats(0.3, 2.7), st.floats(-0.2, 0.2), st.integers(0, 99))
@example(1.0, -0.1875, 16)  # a phase of 0.1125, and one of the 20 of 1,350 disturbances that stay above 2 %
@settings(max_examples=8, deadline=None)
def test_inside_the_bound_it_converges(line: LinePlan, gain: float, phase: float, seed: int) -> None:
    ratio, used = delayed(gain, phase), phase
    left = float(np.max(remaining_error(GAIN, ratio[:N])))
    if left > 0.85:  # too near the bound to wait for, or outside of it
        used = 0.6 * phase
        ratio = delayed(1.0, used)
        left = float(np.max(remaining_error(GAIN, ratio[:N])))
    assert left <= 0.85
    # More rounds than left**8 would take: smoothing learns slowly what the windows hardly see.
    found = history(line, ratio, disturbed(seed), 32)
    # The windows couple harmonics: a round may raise the rms by a little (0.6 % of its start in 300 trials).
    assert all(after <= before + 0.02 * found[0] for before, after in pairwise(found))
    # It ends where smoothing and learning balance, in harmonics that the windows hardly see, not at 0.
    assert abs(found[20] - found[-1]) < found[0] * max(left**8, 1e-3)
    assert found[20] < found[0] * max(left**8, 0.02 if abs(used) < STEADY_PHASE else 0.1)


@pytest.mark.common
@given(st.booleans(), st.floats(1.35, 1.8), st.integers(0, 99))
@settings(max_examples=8, deadline=None)
def test_outside_the_bound_it_does_not(line: LinePlan, by_gain: bool, left: float, seed: int) -> None:
    """Either the gain alone or the phase alone: |1 - gain G| = left at harmonic N."""
    if by_gain:
        ratio = delayed((1.0 + left) / GAIN, 0.0)
    else:
        left = min(left, 0.95 + GAIN)  # no phase leaves more than 1 + GAIN
        ratio = delayed(1.0, float(np.arccos((1.0 + GAIN**2 - left**2) / (2.0 * GAIN)) / (2.0 * np.pi)))
    assert remaining_error(GAIN, ratio[:N])[-1] == pytest.approx(left)
    found = history(line, ratio, disturbed(seed), 14)
    assert found[-1] > 2.0 * found[0]


def test_the_error_that_a_round_leaves_is_the_bounds(line: LinePlan) -> None:
    """Of a gain error alone, in the window, apart from what harmonics 1 to N cannot describe there."""
    for gain in (0.5, 1.0, 1.6):
        found = history(line, delayed(gain, 0.0), disturbed(4), 3)
        assert found[1] / found[0] == pytest.approx(abs(1.0 - GAIN * gain), abs=0.02)


@pytest.mark.rest
@pytest.mark.parametrize("turn", [0.5, 0.7, 0.95])
@pytest.mark.parametrize("both", [True, False])
def test_the_coupled_loop_is_no_worse_than_its_harmonics(tmp_path: Path, turn: float, both: bool) -> None:
    """Smoothing, windows and the best line couple harmonics: the spectral radius of the whole loop."""
    direction = "both" if both else "forward"
    line = line_of(tmp_path, f"x.turn = {turn}", f'x.band_limit.directions = "{direction}"')
    zero = FourierSeries(0.0, np.zeros(N), np.zeros(N))
    line = replace(line, layer=zero)

    def change(ratio: np.ndarray, layer: np.ndarray) -> np.ndarray:
        """What is learnt: linear in the layer but for the size of the best line, hence a small one."""
        drawn = FourierSeries(0.0, layer[:N], layer[N:])
        moved = line.target.plus(drawn.times(ratio[:N].real, ratio[:N].imag))
        scaled = FourierSeries(200.0 * moved.a0, 200.0 * moved.a, 200.0 * moved.b)
        found = learn(
            line, Displacement(scaled, np.eye(2 * H + 1) * 1e-20, 0.0, 0.0, 1.0, 5.0, 5000, 0), GAIN, N
        ).change
        return np.concatenate([found.a, np.zeros(N - found.harmonics), found.b, np.zeros(N - found.harmonics)])

    for gain, phase in ((0.5, 0.2), (1.0, 0.15), (1.0, 0.19), (2.0, 0.1), (2.7, 0.0), (2.7, 0.04)):
        ratio = delayed(gain, phase)
        diagonal = float(np.max(remaining_error(GAIN, ratio[:N])))
        start = change(ratio, np.zeros(2 * N))
        steps = 1e-5 * np.eye(2 * N)
        response = np.stack([(change(ratio, step) - start) / 1e-5 for step in steps], axis=1)
        radius = float(np.max(np.abs(np.linalg.eigvals(np.eye(2 * N) + response))))
        assert radius < max(diagonal, 1.0) + 0.01, (gain, phase)


@pytest.mark.common
def test_noise_is_not_learnt(line: LinePlan) -> None:
    """Of traces with nothing but noise in them few are learnt from, and little."""
    generator = np.random.default_rng(8)
    learnt, noise = [], 1e-4
    for _ in range(100):
        c = noise * generator.standard_normal((2, H))
        shown = seen(line, np.ones(H, complex), FourierSeries(0.0, c[0], c[1]), noise)
        update = learn(line, shown, GAIN, N)
        learnt.append(update.harmonics)
        assert np.max(np.abs(update.after.error - update.before.error)) < 10.0 * noise
    assert np.mean(np.array(learnt) == 0) > 0.5
    assert update.noise_percent == pytest.approx(100.0 * noise * np.sqrt(2 * H) / np.sqrt(2.0), rel=0.4)


def test_what_noise_explains_is_taken_off(line: LinePlan) -> None:
    """Of harmonics that are nothing but noise, against a sensor that is taken to have none; what is clear stays."""
    only = FourierSeries(0.0, np.array([0.0, 0.002, 0.0, 0.0]), np.zeros(4))
    generator = np.random.default_rng(9)
    learnt: dict[float, list[np.ndarray]] = {2e-5: [], 1e-9: []}
    for _ in range(12):
        c = 2e-5 * generator.standard_normal((2, H))
        for noise, changes in learnt.items():
            shown = seen(line, np.ones(H, complex), only.plus(FourierSeries(0.0, c[0], c[1])), noise)
            change = learn(line, shown, GAIN, N).change
            changes.append(np.concatenate([change.a, change.b]))
    shrunk, whole = (np.array(learnt[noise]) for noise in (2e-5, 1e-9))
    assert shrunk[:, 1] == pytest.approx(whole[:, 1], rel=0.02)
    assert shrunk[:, 1] == pytest.approx(-GAIN * 0.002, rel=0.1)
    above = np.r_[2:N, N + 2 : 2 * N]
    assert np.mean(shrunk[:, above] ** 2) < 0.5 * np.mean(whole[:, above] ** 2)


def test_what_a_resonance_allows(tmp_path: Path) -> None:
    """Against |1 - gain G| worked out here for a resonance that is off by a quarter, and a quality by half."""
    resonant = edited(
        SCANNER, "x.resonance.frequency_hz = 2000", "x.resonance.quality = 10", "x.resonance.delay_s = 2e-5"
    )
    line = line_of(tmp_path, scanner=resonant)
    n = np.arange(1, H + 1)
    worst = np.zeros(H)
    for f0 in (1600.0, 2000.0, 2500.0):
        for quality in (5.0, 10.0, 20.0):
            model, true = (
                1.0 / (1.0 - (n * 100 / f) ** 2 + 1j * n * 100 / f / q) for f, q in ((2e3, 10.0), (f0, quality))
            )
            size = np.minimum(np.abs(1.0 / model), 10 ** (6.0 / 20.0))
            played = size * np.exp(-1j * np.angle(model))
            worst = np.maximum(worst, np.abs(1.0 - 0.7 * true * played))
    found = bound(line, 0.7, 16)
    most = int(np.flatnonzero(worst > MAX_ERROR_LEFT)[0])
    assert 3 < most < H
    assert (found.harmonics, found.used) == (most, min(most, 16))
    assert found.remaining == pytest.approx(float(np.max(worst[: found.used])))
    assert found.phase_deg == pytest.approx(np.degrees(np.arccos(0.35)))
    assert found.delay_s == pytest.approx(np.arccos(0.35) / (2.0 * np.pi * found.used * 100.0))
    assert bound(line, 0.3, 16).harmonics > most

    setup = load(tmp_path / "scan.toml")
    time = np.arange(1000) * 1e-4
    with pytest.raises(Unphysical, match=f"the error of harmonic {most + 1} might not shrink.*learn up to {most} harm"):
        refine(setup, "x", time, np.sin(time), None, Options(harmonics=most + 1))


def test_without_dynamics_nothing_is_known(line: LinePlan) -> None:
    assert plausible_ratios(line, np.arange(1.0, 5.0)).tolist() == [[1.0, 1.0, 1.0, 1.0]]
    found = bound(line, 0.7, 16)
    assert (found.dynamics, found.harmonics, found.remaining) == (False, H, pytest.approx(0.3))
    assert found.largest_gain == pytest.approx(2.0 / 0.7)


def test_a_measured_response_may_be_wrong_too(tmp_path: Path) -> None:
    f = np.arange(50.0, 60e3, 50.0)
    real, imaginary = SecondOrder(40e3, 20.0).inverse(f)
    h = 1.0 / (real + 1j * imaginary)
    rows = [f"{a},{b:.9g},{c:.9g}" for a, b, c in zip(f, np.abs(h), np.degrees(np.angle(h)), strict=True)]
    (tmp_path / "response.csv").write_text("hz,gain,phase_deg\n" + "\n".join(rows), "utf-8")
    scanner = edited(SCANNER, "- [x.resonance]", '+ [x.resonance]\nresponse = "response.csv"')
    line = line_of(tmp_path, scanner=scanner)
    ratios = plausible_ratios(line, np.array([100.0, 2000.0]))
    # Far below the resonance it is gain and phase that may be off.
    assert np.max(np.abs(ratios[:, 0])) == pytest.approx(1.25, rel=1e-3)
    assert np.max(np.degrees(np.angle(ratios[:, 0]))) == pytest.approx(20.0, abs=0.1)
    assert bound(line, 0.7, 16).harmonics == H


def test_a_displacement_of_something_else(line: LinePlan) -> None:
    other = FourierSeries(0.0, np.zeros(3), np.array([0.0, 0.0, 200.0]))
    with pytest.raises(Unphysical, match="of the line away from this scan"):
        learn(line, Displacement(other, np.eye(7), 0.0, 0.0, 1.0, 5.0, 5000, 0), GAIN, N)


def test_a_sensor_that_counts_the_other_way(line: LinePlan) -> None:
    right = seen(line, delayed(1.0, 0.05), disturbed(2))
    turned = replace(right, series=FourierSeries(-right.series.a0, -right.series.a, -right.series.b))
    one, other = learn(line, right, GAIN, N), learn(line, turned, GAIN, N)
    assert other.layer.b == pytest.approx(one.layer.b, abs=1e-7)
    assert other.before.size_nm == pytest.approx(-one.before.size_nm)
