"""Creep and resonance of the virtual scanner, against closed forms, scipy, and a recursion tick by tick."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import integrate, signal

from tablegen.numerics.arrays import Floats
from tablegen.virtual.creep import logarithmic_creep
from tablegen.virtual.modes import Modes, low_pass, second_order

CREEP = logarithmic_creep(0.03, 100.0, 1e-6, 1e3, 2)
RESONANCE = second_order(50e3, 20.0)
TICK = 2e-6
NODES, WEIGHTS = np.polynomial.legendre.leggauss(12)
WEIGHTS = 0.5 * WEIGHTS  # of a mean over a tick
GENERATOR = np.random.default_rng(3)
NOISE = GENERATOR.standard_normal(300)


def ticked(modes: Modes, drive: Floats, tick_s: float, rest: float) -> Floats:
    """One recursion a term and tick, from the differential equation x' = p x + u; the mean over each tick."""
    state = [rest / -p for p in modes.poles]
    out = []
    for u in drive:
        y = modes.direct * u
        for i, (p, r) in enumerate(zip(modes.poles, modes.residues, strict=True)):
            at = tick_s * np.append(0.5 + 0.5 * NODES, 1.0)
            x = np.exp(p * at) * state[i] + np.expm1(p * at) / p * u
            state[i] = x[-1]
            y += (2.0 if p.imag else 1.0) * (r * (x[:-1] @ WEIGHTS)).real
        out.append(y)
    return np.array(out)


@pytest.mark.parametrize("modes", [CREEP, RESONANCE, low_pass(100e3)], ids=["creep", "resonance", "low pass"])
@pytest.mark.parametrize("ticks", [1, 63, 64, 65, 300])
def test_blocks_are_the_recursion(modes: Modes, ticks: int) -> None:
    found = modes.follow(NOISE[:ticks], TICK, 0.7)
    assert found == pytest.approx(ticked(modes, NOISE[:ticks], TICK, 0.7), abs=1e-11)


@pytest.mark.common
@pytest.mark.parametrize(("frequency_hz", "quality"), [(50e3, 20.0), (3e3, 0.8), (120e3, 5.0)])
def test_resonance_is_scipys(frequency_hz: float, quality: float) -> None:
    """The zero-order hold of a state space, in parts of a tick, and the frequency response of its transfer function."""
    w = 2.0 * np.pi * frequency_hz
    modes = second_order(frequency_hz, quality)
    system = signal.TransferFunction([w * w], [1.0, w / quality, w * w])
    space = system.to_ss()
    parts = 64
    a, b, c, d, _ = signal.cont2discrete((space.A, space.B, space.C, space.D), TICK / parts)
    _, at, _ = signal.dlsim((a, b, c, d, TICK / parts), np.append(np.repeat(NOISE, parts), 0.0))
    in_tick = np.arange(len(NOISE))[:, None] * parts + np.arange(parts + 1)
    expected = integrate.simpson(at[in_tick, 0], dx=1.0 / parts)
    assert modes.follow(NOISE, TICK, 0.0) == pytest.approx(expected, abs=1e-7)
    f = np.geomspace(1.0, 1e6, 200)
    _, h = signal.freqs([w * w], [1.0, w / quality, w * w], 2.0 * np.pi * f)
    assert modes.response(f) == pytest.approx(h, rel=1e-9)


def test_step_of_the_resonance_is_its_closed_form() -> None:
    w, q = 2.0 * np.pi * 50e3, 20.0
    damped, rate = w * np.sqrt(1.0 - 0.25 / q**2), 0.5 * w / q
    t = TICK * (np.arange(200)[:, None] + 0.5 + 0.5 * NODES)
    at = 1.0 - np.exp(-rate * t) * (np.cos(damped * t) + rate / damped * np.sin(damped * t))
    expected = at @ WEIGHTS
    assert RESONANCE.follow(np.ones(200), TICK, 0.0) == pytest.approx(expected, abs=1e-10)


@given(st.integers(2, 40), st.integers(0, 1000))
def test_a_period_settles_to_what_many_periods_do(ticks: int, seed: int) -> None:
    drive = np.random.default_rng(seed).standard_normal(ticks)
    modes = Modes(0.3, (complex(-4e4), complex(-5e4, 2e5)), (complex(1e4), complex(3e4, -7e4)))
    long = modes.follow(np.tile(drive, 2 + 600 // ticks), TICK)
    assert modes.settled(drive, TICK) == pytest.approx(long[-ticks:], abs=1e-9)


def test_a_sine_settles_to_the_response() -> None:
    """Slow against the tick, so that the hold does not count."""
    ticks, f = 4000, 10.0
    t = np.arange(1, ticks + 1) / ticks
    found = CREEP.settled(np.sin(2.0 * np.pi * t), 1.0 / (f * ticks))
    h = CREEP.response(f)
    assert found == pytest.approx(np.imag(h * np.exp(2j * np.pi * t)), abs=1e-4)


@pytest.mark.parametrize("loss", [0.0, 0.01, 0.03, 0.06])
def test_gain_falls_by_the_loss_every_decade(loss: float) -> None:
    """Equation (23), between the time constants: 1 - alpha log10(f / f_DH)."""
    modes = logarithmic_creep(loss, 100.0, 1e-6, 1e3, 2)
    f = np.geomspace(0.1, 1e4, 41)
    assert abs(modes.response(100.0)) == pytest.approx(1.0, abs=1e-9)
    assert np.abs(modes.response(f)) == pytest.approx(1.0 - loss * np.log10(f / 100.0), abs=0.02 * loss + 1e-12)


def test_loss_cannot_be_had_without_a_lag() -> None:
    """Kramers and Kronig: the phase is pi/2 of d ln gain / d ln f."""
    f = np.geomspace(1.0, 1e4, 30)
    h = CREEP.response(f)
    slope = -0.03 / np.log(10.0) / np.abs(h)
    assert np.angle(h) == pytest.approx(0.5 * np.pi * slope, rel=0.03)


def test_a_step_creeps_by_the_loss_every_decade() -> None:
    """Each decade of time adds the same; 12 ms to 120 s here."""
    tick = 0.01
    step = CREEP.follow(np.ones(20_000), tick, 0.0)
    at = np.array([12, 120, 1200, 12_000]) - 1
    assert np.diff(step[at]) == pytest.approx([0.03] * 3, rel=0.03)
    assert step[-1] < float(CREEP.response(0.0).real)


def test_rest_is_rest() -> None:
    for modes in (CREEP, RESONANCE):
        at_rest = 5.0 * float(modes.response(0.0).real)
        assert modes.follow(np.full(200, 5.0), TICK) == pytest.approx(at_rest, rel=1e-9)


def test_a_wrong_pole_is_seen() -> None:
    """Negative control of the comparison with scipy: a conjugate that is left out."""
    half = Modes(RESONANCE.direct, tuple(complex(p.real, 0.0) for p in RESONANCE.poles), RESONANCE.residues)
    assert np.max(np.abs(half.response([50e3]) - RESONANCE.response([50e3]))) > 1.0
