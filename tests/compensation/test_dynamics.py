"""Inverse dynamics: responses, the cap on the boost, and measured responses from CSV."""

from pathlib import Path

import numpy as np
import pytest

from tablegen.base.input_errors import Unphysical
from tablegen.compensation.dynamics import Measured, SecondOrder, capped_inverse
from tablegen.compensation.response_file import read_response


def test_second_order_with_delay_is_inverted() -> None:
    response = SecondOrder(40e3, 20.0, 1e-6)
    f = np.array([0.0, 100.0, 12.8e3, 40e3, 80e3])
    r = f / 40e3
    exact = (1 - r**2 + 1j * r / 20.0) * np.exp(2j * np.pi * f * 1e-6)
    real, imaginary = response.inverse(f)
    assert real + 1j * imaginary == pytest.approx(exact, rel=1e-12, abs=1e-14)


@pytest.mark.common
def test_a_driven_oscillator_follows_the_target() -> None:
    """Independent of the formula: integrate the equation of motion under the inverted drive of one harmonic."""
    from oscillator import runge_kutta_oscillator

    frequency, quality, f = 40e3, 5.0, 12.8e3
    real, imaginary = SecondOrder(frequency, quality).inverse(np.array([f]))
    target, reached = runge_kutta_oscillator(frequency, quality, f, complex(real[0], imaginary[0]))
    assert reached == pytest.approx(target, abs=2e-4)


def test_the_boost_is_capped_in_size_and_kept_in_phase() -> None:
    response = SecondOrder(1000.0, 10.0)
    f = np.array([500.0, 1000.0, 3000.0])
    free = np.array(response.inverse(f))
    real, imaginary, held = capped_inverse(response, f, 6.0)
    assert held.tolist() == [False, False, True]
    assert np.hypot(real[2], imaginary[2]) == pytest.approx(10 ** (6 / 20))
    assert np.arctan2(imaginary, real) == pytest.approx(np.arctan2(free[1], free[0]))


def test_a_measured_response_is_that_of_its_points() -> None:
    f = np.array([1e3, 1e4, 2e4])
    response = Measured(f, np.array([1.0, 1.2, 2.0]), np.array([0.0, -10.0, -40.0]) / 360.0)
    real, imaginary = response.inverse(f)
    assert 1 / (real + 1j * imaginary) == pytest.approx(
        np.array([1.0, 1.2, 2.0]) * np.exp(1j * np.deg2rad([0.0, -10.0, -40.0]))
    )
    assert response.inverse(np.array([1.0]))[0] == pytest.approx(1.0)
    assert response.resonance_hz == 2e4


@pytest.mark.parametrize("first_hz", [500.0, 3000.0])
@pytest.mark.parametrize("turns", [0.0, -0.5, 2.0])
def test_below_its_first_point_a_response_is_late_by_the_same_time(first_hz: float, turns: float) -> None:
    """A phase that stayed would move trace against retrace: by 0.75 % of a line at 100 Hz, of points from 1 kHz on."""
    model = SecondOrder(50e3, 20.0, 2e-6)
    f = np.geomspace(first_hz, 40e3, 300)
    h = 1 / (np.array([1, 1j]) @ np.array(model.inverse(f)))
    response = Measured(f, np.abs(h), np.unwrap(np.angle(h)) / (2 * np.pi) + turns)
    low = np.array([1.0, 100.0, 0.7 * first_hz, first_hz])
    found, expected = (1 / (np.array([1, 1j]) @ np.array(one.inverse(low))) for one in (response, model))
    inverted = np.exp(2j * np.pi * turns)
    assert found == pytest.approx(expected * inverted, rel=5e-3)
    assert np.angle(found / inverted) == pytest.approx(np.angle(expected), rel=2e-3)


def test_sampled_second_order_and_its_formula_agree(tmp_path: Path) -> None:
    model = SecondOrder(40e3, 8.0, 2e-6)
    f = np.geomspace(10.0, 30e3, 4000)
    inverse = np.array(model.inverse(f))
    h = 1 / (inverse[0] + 1j * inverse[1])
    rows = ["hz,gain,phase_deg"]
    # A sensor with any gain: only the shape counts.
    rows += [
        f"{a!r},{3.7 * abs(b)!r},{p!r}"
        for a, b, p in zip(f.tolist(), h.tolist(), np.rad2deg(np.unwrap(np.angle(h))).tolist(), strict=True)
    ]
    path = tmp_path / "response.csv"
    path.write_text("\n".join(rows) + "\n")
    at = np.arange(1.0, 32.0) * 400.0
    assert np.array(read_response(path).inverse(at)) == pytest.approx(np.array(model.inverse(at)), rel=1e-3, abs=1e-3)


def points_of(f: np.ndarray, h: np.ndarray) -> Measured:
    return Measured(f, np.abs(h), np.unwrap(np.angle(h)) / (2 * np.pi))


@pytest.mark.parametrize("delay_s", [0.0, 2e-6, 50e-6])
def test_between_points_a_sharp_resonance_is_followed(delay_s: float) -> None:
    """By the formula of the mode. Lines between gains and phases, as a control, miss it by a twentieth and more."""
    model = SecondOrder(60e3, 14.0, delay_s)
    f, at = np.geomspace(50.0, 150e3, 200), np.linspace(1e3, 149e3, 4001)
    h, exact = (1 / (np.array([1, 1j]) @ np.array(model.inverse(one))) for one in (f, at))
    response = points_of(f, h)
    followed = 1 / (np.array([1, 1j]) @ np.array(response.inverse(at)))
    straight = np.interp(at, f, response.gain) * np.exp(2j * np.pi * np.interp(at, f, response.phase_turns))
    assert np.max(np.abs(followed / exact - 1.0)) < 2e-3
    assert np.max(np.abs(straight / exact - 1.0)) > 0.05


def test_through_two_modes_the_error_falls_with_the_third_power_of_the_step() -> None:
    """Where a small mode makes 1 / H no polynomial; lines gain a factor of 4 from half the step."""
    worst = []
    at = np.linspace(20e3, 45e3, 4001)
    for count in (1000, 2000):
        f = np.geomspace(50.0, 150e3, count)
        h, exact = (
            sum(
                share / (1 - (one / hz) ** 2 + 1j * one / hz / quality)
                for hz, quality, share in ((60e3, 14.0, 0.96), (31e3, 20.0, 0.04))
            )
            for one in (f, at)
        )
        found = 1 / (np.array([1, 1j]) @ np.array(points_of(f, h).inverse(at)))
        worst.append(float(np.max(np.abs(found / exact - 1.0))))
    assert worst[0] < 4e-3
    assert worst[1] < worst[0] / 8.0


def test_points_that_are_too_far_apart_make_no_resonance() -> None:
    """1 / H would pass near 0 between two points of opposite phase, and the gain would be any; it is between both."""
    response = Measured(
        np.array([1e3, 10e3, 20e3, 30e3, 80e3]), np.array([1.0, 1.1, 2.0, 1.8, 0.4]), np.array([0.0, 0, 0, -0.5, -0.5])
    )
    real, imaginary = response.inverse(np.linspace(20e3, 30e3, 101))
    gain = 1 / np.hypot(real, imaginary)
    assert np.all((gain >= 1.8 - 1e-12) & (gain <= 2.0 + 1e-12))


def test_beyond_the_measured_range_nothing_is_guessed() -> None:
    response = Measured(np.array([1.0, 10e3]), np.array([1.0, 1.1]), np.array([0.0, 0.0]))
    with pytest.raises(Unphysical, match=r"measured up to 10000 Hz; the scan plays up to 12800 Hz"):
        response.inverse(np.array([400.0, 12800.0]))
