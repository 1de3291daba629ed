"""The waveform that an operator follows straight: what it leaves on its own operator, and where it is refused."""

import numpy as np
import pytest
from replacing import replace

from tablegen.base.input_errors import Unphysical
from tablegen.compensation.dynamics import Measured, Response, SecondOrder, capped_inverse
from tablegen.compensation.hysteresis import BranchShape
from tablegen.compensation.line import LineShape
from tablegen.compensation.operator import scan_line
from tablegen.compensation.operator.creep import NO_CREEP, LogarithmicCreep
from tablegen.compensation.operator.family import Family
from tablegen.compensation.operator.field import Field, Lengths
from tablegen.compensation.operator.operator import Operator
from tablegen.compensation.operator.plays import FIXED_BENDS, Plays, envelopes
from tablegen.compensation.operator.scan_line import LearntWaveform, TargetLine, learn_waveform
from tablegen.numerics.arrays import Floats
from tablegen.waveform.series import FourierSeries
from tablegen.waveform.window_fit import fit_window

HARMONICS = 24
WINDOW = (0.1, 0.9)
_NOTHING = Field(np.zeros((0, 2)), np.zeros((0, 42)), Lengths(1.0, 1.0, 1.0))
_NO_SIZES = Field(np.zeros((0, 2)), np.zeros((0, 1)), Lengths(1.0, 1.0, 1.0))
THRESHOLDS = np.geomspace(0.01, 0.4, 30)
WEIGHTS = np.stack([np.full(30, 12.0), np.full(30, 3.0), np.full(30, 5.0)])


def operator(creep: LogarithmicCreep = NO_CREEP) -> Operator:
    family = Family(Plays(THRESHOLDS, WEIGHTS, np.array([700.0, 60.0])))
    return Operator(family, _NOTHING, _NO_SIZES, creep, 0.5, ())


def wanted(size_nm: float = 400.0, turn: float = 0.5, rate_hz: float = 500.0) -> TargetLine:
    return TargetLine(size_nm, turn, WINDOW, True, rate_hz, 0.5, 1.0)


def straight(turn: float) -> FourierSeries:
    return fit_window(LineShape(turn, BranchShape(), BranchShape()), HARMONICS, WINDOW, both=True)


def same(series: FourierSeries) -> FourierSeries:
    return series


def stepped(u: Floats) -> Floats:
    """The plays of the operator by their definition, and the line that they lie over, in nm; settled."""
    transforms = [envelopes(u, bend)[0] for bend in FIXED_BENDS]
    state = np.zeros((3, len(THRESHOLDS)))
    out = np.empty(len(u))
    for _ in range(2):
        for k in range(len(u)):
            g = np.array([[transform[k]] for transform in transforms])
            state = np.minimum(np.maximum(state, g - THRESHOLDS), g + THRESHOLDS)
            out[k] = float(np.sum(WEIGHTS * state)) + 700.0 * u[k] + 60.0 * u[k] ** 2
    return out


@pytest.mark.common
@pytest.mark.parametrize("turn", [0.5, 0.7])
@pytest.mark.parametrize("size_nm", [100.0, 600.0])
def test_plays_that_are_stepped_follow_it_straight(turn: float, size_nm: float) -> None:
    found = learn_waveform(operator(), wanted(size_nm, turn), straight(turn), same, None)
    t = np.arange(4096) / 4096
    position = stepped(0.5 + found.v_amplitude * (found.series.on_grid(4096) - 0.5))
    x = np.where(t <= turn, t / turn, (1.0 - t) / (1.0 - turn))
    inside = (x >= WINDOW[0]) & (x <= WINDOW[1])
    slope, offset = np.polyfit(x[inside], position[inside], 1)
    assert slope == pytest.approx(size_nm, rel=1e-3)
    assert float(np.std(position[inside] - slope * x[inside] - offset)) < 3e-4 * size_nm
    assert max(found.expected.rms) < 0.03
    assert found.expected.mismatch < 0.1
    # Not so before: the same drive without hysteresis in mind.
    before = stepped(0.5 + found.v_amplitude * (straight(turn).on_grid(4096) - 0.5))
    slope, offset = np.polyfit(x[inside], before[inside], 1)
    assert float(np.std(before[inside] - slope * x[inside] - offset)) > 20 * 3e-4 * size_nm


def test_creep_and_dynamics_are_undone() -> None:
    late = LogarithmicCreep(0.05, 1e-5, 10.0, 500.0)
    response = SecondOrder(40e3, 12.0, 4e-6)
    real, imaginary = response.inverse(np.arange(1.0, HARMONICS + 1.0) * 500.0)

    def inverse(series: FourierSeries) -> FourierSeries:
        return series.times(real, imaginary)

    found = learn_waveform(operator(late), wanted(), straight(0.5), inverse, response)
    without = learn_waveform(operator(), wanted(), straight(0.5), same, None)
    assert max(found.expected.rms) < 0.03
    assert found.expected.mismatch < 0.1
    assert float(np.max(np.abs(found.series.b - without.series.b))) > 1e-3


FAST_HZ, FEW = 5e3, 12  # the highest harmonic of the drive is on the resonance, those of the loop are beyond it


def fast(dynamics: Response) -> LearntWaveform:
    """A line of few harmonics at a high rate, through the inverse of the dynamics."""
    real, imaginary, _ = capped_inverse(dynamics, np.arange(1.0, FEW + 1.0) * FAST_HZ, 20.0)
    start = fit_window(LineShape(0.5, BranchShape(), BranchShape()), FEW, WINDOW, both=True)

    def inverse(series: FourierSeries) -> FourierSeries:
        return series.times(real, imaginary)

    return learn_waveform(operator(), wanted(rate_hz=FAST_HZ), start, inverse, dynamics)


def left_by(waveform: LearntWaveform, dynamics: Response) -> tuple[float, float]:
    """Rms and mismatch in percent of the line that stepped plays leave behind dynamics on all of their harmonics."""
    count = 4096
    real, imaginary, _ = capped_inverse(dynamics, np.arange(1.0, FEW + 1.0) * FAST_HZ, 20.0)
    u = 0.5 + waveform.v_amplitude * (waveform.series.times(real, imaginary).on_grid(count) - 0.5)
    spectrum = np.fft.rfft(stepped(u))
    real, imaginary = dynamics.inverse(FAST_HZ * np.arange(1.0, count // 2 + 1.0))
    spectrum[1:] /= real + 1j * imaginary
    position = np.fft.irfft(spectrum, count)
    t = np.arange(count) / count
    x = np.where(t <= 0.5, 2.0 * t, 2.0 - 2.0 * t)
    inside = (x >= WINDOW[0]) & (x <= WINDOW[1])
    slope, offset = np.polyfit(x[inside], position[inside], 1)
    error = 100.0 * ((position - offset) / slope - x)
    half = error[: count // 2][inside[: count // 2]], error[count // 2 :][inside[count // 2 :]][::-1]
    apart = np.abs(half[0][: len(half[1])] - half[1])
    return max(float(np.sqrt(np.mean(side * side))) for side in half), float(np.max(apart))


def test_the_loop_has_more_harmonics_than_the_drive() -> None:
    dynamics = SecondOrder(60e3, 14.0, 2e-6)
    waveform = fast(dynamics)
    rms, mismatch = left_by(waveform, dynamics)
    assert max(waveform.expected.rms) == pytest.approx(rms, rel=0.05)
    assert waveform.expected.mismatch == pytest.approx(mismatch, rel=0.1)
    assert rms > 0.05  # not what the drive's own harmonics leave, which is far less
    assert waveform.unmeasured_percent == 0.0


def test_harmonics_above_the_measured_response_are_bounded() -> None:
    dynamics = SecondOrder(60e3, 14.0, 2e-6)
    f = np.geomspace(50.0, 80e3, 4000)
    real, imaginary = dynamics.inverse(f)
    h = 1.0 / (real + 1j * imaginary)
    measured = Measured(f, np.abs(h), np.unwrap(np.angle(h)) / (2.0 * np.pi))
    waveform = fast(measured)
    rms, mismatch = left_by(waveform, dynamics)
    expected, beyond = waveform.expected, waveform.unmeasured
    assert 0.001 < waveform.unmeasured_percent < 0.5
    assert 0.0 < beyond.mismatch < 2.0 * mismatch
    assert abs(max(expected.rms) - rms) < max(beyond.rms) + 0.005
    assert abs(expected.mismatch - mismatch) < beyond.mismatch + 0.02


def test_the_expected_size_is_the_wanted_one() -> None:
    found = learn_waveform(operator(), wanted(), straight(0.5), same, None)
    assert found.expected.size == pytest.approx(0.0, abs=0.05)
    again = learn_waveform(operator(), wanted(), straight(0.5), same, None)
    assert again.series.a.tobytes() == found.series.a.tobytes()


def test_a_factor_makes_the_drive_larger() -> None:
    found, more = (
        learn_waveform(operator(), replace(wanted(), factor=factor), straight(0.5), same, None) for factor in (1.0, 1.1)
    )
    assert more.v_amplitude / found.v_amplitude == pytest.approx(1.1, abs=0.03)


def test_a_scan_beyond_the_driver_is_refused() -> None:
    with pytest.raises(Unphysical, match=r"take \d+ % of v_max by the operator; at this offset 100 % are left"):
        learn_waveform(operator(), wanted(5000.0), straight(0.5), same, None)


# Of the size of those that were fitted to the records of a real stage, docs/evidence.md: few thresholds, heavy ones.
FEW_THRESHOLDS = 0.495 * (np.arange(1, 13) / 12) ** 1.5
HEAVY = np.array(
    [
        [0.0, 0.0, 0.0, 0.0, 0.0, 2000.0, 0.0, 4000.0, 600.0, 5700.0, 0.0, 29000.0],
        [4600.0, 2100.0, 1800.0, 0.0, 300.0, 2200.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [4800.0, 5700.0, 900.0, 1600.0, 900.0, 1000.0, 1600.0, 0.0, 1200.0, 300.0, 0.0, 2800.0],
    ]
)


def heavy_operator() -> Operator:
    family = Family(Plays(FEW_THRESHOLDS, HEAVY, np.array([11700.0, 6100.0, -2300.0])))
    return Operator(family, _NOTHING, _NO_SIZES, LogarithmicCreep(0.1, 0.005, 120.0, 1.0), 0.5, ())


SIZES = (700.0, 1200.0, 2000.0, 5000.0, 10e3, 20e3)


def learn_all(turn: float) -> list[LearntWaveform]:
    return [
        learn_waveform(heavy_operator(), wanted(size_nm, turn, 1.0), straight(turn), same, None) for size_nm in SIZES
    ]


@pytest.mark.common
@pytest.mark.parametrize("turn", [0.5, 0.8])
def test_a_line_settles_at_every_size(turn: float) -> None:
    for size_nm, settled in zip(SIZES, learn_all(turn), strict=True):
        assert max(settled.expected.rms) < 0.12, size_nm
        assert abs(settled.expected.size) < 0.05


@pytest.mark.common
def test_whole_corrections_go_to_and_fro(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scan_line, "_WHOLE_ROUNDS", 1000)
    with pytest.raises(Unphysical, match="did not settle"):
        learn_all(0.5)
