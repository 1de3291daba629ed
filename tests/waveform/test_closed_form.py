"""Fourier coefficients in closed form against quadrature, every harmonic to 512, every model, any turn."""

import mpmath as mp
import numpy as np
import pytest

from tablegen.compensation.hysteresis import BranchShape
from tablegen.compensation.line import LineShape
from tablegen.waveform.closed_form import fourier_series

TURNS = [0.05, 0.3, 0.5, 0.7, 0.9, 0.95, 0.999]
MODELS = {
    "triangle": (BranchShape(), BranchShape()),
    "sinusoidal": (BranchShape.sinusoidal(0.037), BranchShape.sinusoidal(0.08)),
    "harmonic": (BranchShape.harmonic(0.035, 0.37), BranchShape.harmonic(0.085, 0.48)),
}
HARMONICS = 512


def branch_by_hand(shape: BranchShape, s: np.ndarray) -> np.ndarray:
    """u(s) from the printed equation, with numpy's own trigonometry."""
    wiggle = shape.xi * np.sin(np.pi * s) + shape.xi_gamma * (np.cos(np.pi * s) - 1)
    return (1 + 2 * shape.xi_gamma) * s + wiggle


def by_quadrature(forward: BranchShape, backward: BranchShape, turn: float) -> np.ndarray:
    """c_n for n = 0..512 by composite Gauss-Legendre on each branch, more than 10 nodes a period of harmonic 512."""
    node, weight = np.polynomial.legendre.leggauss(20)
    n = np.arange(HARMONICS + 1)
    total = np.zeros(HARMONICS + 1, complex)
    for begin, length, shape, rising in ((0.0, turn, forward, True), (turn, 1.0 - turn, backward, False)):
        edges = np.linspace(0.0, 1.0, max(8, int(300 * length)) + 1)
        half = np.diff(edges)[:, None] / 2
        s = ((edges[1:] + edges[:-1])[:, None] / 2 + half * node).ravel()
        w = (half * weight).ravel()
        u = branch_by_hand(shape, s)
        u = u if rising else 1.0 - u
        for m in n:
            total[m] += length * np.sum(w * u * np.exp(-2j * np.pi * m * (begin + length * s)))
    return total


@pytest.mark.common
@pytest.mark.parametrize("turn", TURNS)
@pytest.mark.parametrize("model", MODELS)
def test_closed_form_is_the_integral(model: str, turn: float) -> None:
    forward, backward = MODELS[model]
    series = fourier_series(LineShape(turn, forward, backward), HARMONICS)
    c = by_quadrature(forward, backward, turn)
    assert abs(series.a0 - c[0].real) < 1e-12
    assert np.max(np.abs(series.a - 2 * c[1:].real)) < 1e-12
    assert np.max(np.abs(series.b + 2 * c[1:].imag)) < 1e-12


@pytest.mark.common
@pytest.mark.parametrize(("turn", "n"), [(0.5, 1), (0.05, 10), (0.3, 5), (0.7, 3), (0.95, 10), (0.999, 100)])
def test_closed_form_against_mpmath(turn: float, n: int) -> None:
    """Arbitrary precision, at and near the removable singularities n = 1/(2 turn) and n = 1/(2 (1 - turn))."""
    mp.mp.dps = 30
    forward, backward = MODELS["harmonic"]

    def u(shape: BranchShape, s: mp.mpf) -> mp.mpf:
        wiggle = shape.xi * mp.sin(mp.pi * s) + shape.xi_gamma * (mp.cos(mp.pi * s) - 1)
        return (1 + 2 * mp.mpf(shape.xi_gamma)) * s + wiggle

    a = mp.mpf(turn)
    pieces = [a * mp.mpf(k) / max(2 * n, 8) for k in range(max(2 * n, 8) + 1)]
    up = mp.quad(lambda t: u(forward, t / a) * mp.expj(-2 * mp.pi * n * t), pieces, maxdegree=4)
    pieces = [a + (1 - a) * mp.mpf(k) / max(2 * n, 8) for k in range(max(2 * n, 8) + 1)]
    down = mp.quad(lambda t: (1 - u(backward, (t - a) / (1 - a))) * mp.expj(-2 * mp.pi * n * t), pieces, maxdegree=4)
    c = up + down
    series = fourier_series(LineShape(turn, forward, backward), n)
    assert abs(series.a[n - 1] - 2 * c.real) < 1e-14
    assert abs(series.b[n - 1] + 2 * c.imag) < 1e-14


def test_the_triangle_has_its_textbook_coefficients() -> None:
    """Odd harmonics -4 / (pi n)^2 of a triangle from 0 to 1, even ones and sines exactly 0."""
    series = fourier_series(LineShape(0.5, BranchShape(), BranchShape()), 64)
    n = np.arange(1, 65)
    assert series.a == pytest.approx(np.where(n % 2 == 1, -4 / (np.pi * n) ** 2, 0.0), abs=1e-16)
    assert np.max(np.abs(series.b)) < 1e-16
    assert series.a0 == 0.5


def test_the_series_converges_to_the_line() -> None:
    shape = LineShape(0.7, *MODELS["harmonic"])
    t = np.linspace(0.02, 0.68, 301)
    assert fourier_series(shape, HARMONICS).value(t) == pytest.approx(shape.value(t), abs=2e-4)
