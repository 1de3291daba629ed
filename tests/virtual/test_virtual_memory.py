"""What the Duhem scanner has beside its hysteresis: a memory of the offset, a second resonance, a dead time."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tablegen.numerics.driver import Driver
from tablegen.virtual.experiments import apparent_sizes, frequency_response, triangle_size
from tablegen.virtual.line_error import ideal_triangle
from tablegen.virtual.modes import Modes, delay, low_pass, second_order, side_by_side
from tablegen.virtual.parameters import load_truth
from tablegen.virtual.preisach import Preisach
from tablegen.virtual.scanner import VirtualAxis, VirtualScanner

SCANNER = VirtualScanner.of(load_truth("duhem"))
STRAIGHT = Modes(1.0)
TAU_S = 20.0
PARTS = 64


@settings(max_examples=30)
@given(st.floats(0.0, 25.0), st.booleans())
def test_a_dead_time_is_that_of_a_finer_grid(ticks: float, periodic: bool) -> None:
    """Against stairs of 64 parts a tick that come late by whole parts, as means over each tick."""
    held = np.random.default_rng(1).random(20)
    parts = round(ticks * PARTS)
    fine = np.repeat(held, PARTS)
    late = np.roll(fine, parts) if periodic else np.append(np.full(parts, 0.25), fine)[: len(fine)]
    found = delay(held, parts / PARTS, None if periodic else 0.25)
    assert found == pytest.approx(late.reshape(-1, PARTS).mean(axis=1), abs=1e-12)


def test_two_modes_add_up() -> None:
    f = np.geomspace(10.0, 2e5, 500)

    def mode(hz: float, quality: float) -> np.ndarray:
        return 1.0 / (1.0 - (f / hz) ** 2 + 1j * f / hz / quality)

    both = side_by_side(second_order(50e3, 14.0), second_order(31e3, 25.0), 0.05)
    assert both.response(f) == pytest.approx(0.95 * mode(50e3, 14.0) + 0.05 * mode(31e3, 25.0), rel=1e-9)
    found = frequency_response(SCANNER.x, f)
    assert f[np.argmax(found["gain"])] == pytest.approx(50e3, rel=0.03)
    near = (f > 28e3) & (f < 34e3)
    assert found["gain"][near].max() > 1.3 * found["gain"][(f > 24e3) & (f < 26e3)].max()  # the second one
    # The dead time alone, below the modes: a phase in proportion to f.
    slow = np.array([1e3, 2e3])
    late = SCANNER.x.response(slow)
    prompt = SCANNER.x.amplifier.response(slow) * SCANNER.x.creep.response(slow) * SCANNER.x.resonance.response(slow)
    assert np.degrees(np.angle(late / prompt)) == pytest.approx(-360.0 * 2e-6 * slow)


def with_memory() -> VirtualAxis:
    """10 nm/V, half as much a volt more at the end of the range, and nothing else but the memory."""
    memory = low_pass(0.5 / (np.pi * TAU_S))
    return VirtualAxis(Driver(100.0), STRAIGHT, Preisach((1000.0,), ()), (0.5,), STRAIGHT, STRAIGHT, memory)


def test_the_size_drifts_after_a_step_of_the_offset() -> None:
    """In closed form: the size goes from that of the old offset to that of the new one by e^(-t/tau)."""
    axis, ticks, size_v = with_memory(), 100, 10.0
    line = size_v * (ideal_triangle(ticks, 0.5) - 0.5)
    before, after = np.tile(30.0 + line, 5), np.tile(70.0 + line, 60)
    moved = axis.follow(np.concatenate((before, after)), 1.0 / ticks, mean_v=30.0)[len(before) :]
    # A line a second. What departs from the remembered drive is scaled, so that its place does not move.
    seconds = np.arange(60.0) + np.array([[0.0], [0.5]])
    p = 0.4 - 0.8 * np.exp(-seconds / TAU_S)
    ends = np.array([[650.0], [750.0]])
    about = 500.0 * (1.0 + p)
    expected = about + (1.0 + 0.5 * p) * (ends - about)
    turned = moved.reshape(60, ticks)
    assert turned[:, 0] == pytest.approx(expected[0], abs=0.7)
    assert turned[:, ticks // 2] == pytest.approx(expected[1], abs=0.7)
    assert turned[-1, ticks // 2] - turned[-1, 0] == pytest.approx(100.0 * (1.0 + 0.5 * p[0, -1]), abs=1.0)
    # Negative control: without a memory the sensitivity is that of the whole drive's mean, at once.
    plain = VirtualAxis(Driver(100.0), STRAIGHT, axis.hysteresis, axis.sensitivity, STRAIGHT, STRAIGHT)
    still = plain.follow(after, 1.0 / ticks).reshape(60, ticks)
    assert np.ptp(still[:, ticks // 2] - still[:, 0]) < 1e-9


def test_settled_is_what_the_memory_ends_at() -> None:
    axis = with_memory()
    assert axis.hysteresis.middle(0.3) == pytest.approx(300.0)
    period = 60.0 + 20.0 * (ideal_triangle(50, 0.5) - 0.5)
    followed = axis.follow(np.tile(period, 400), 0.02, mean_v=10.0)[-50:]
    assert followed == pytest.approx(axis.settled(period, 0.02), abs=1e-5)


def test_sizes_over_the_offset_and_the_drive() -> None:
    """What it was identified on: figure 2, and (6) and (10) to 1.1 %."""
    found = apparent_sizes(SCANNER.x, [7.0, 50.0, 93.0], 13.0, 100.0, true_nm=1.0)
    assert found["apparent_nm"] == pytest.approx([0.92, 1.0, 1.25], abs=0.003)
    assert triangle_size(SCANNER.x, 20.0, 50.0, 100.0) == pytest.approx(200.0, rel=0.011)


def test_the_whole_scanner_settles() -> None:
    """All parts of the Duhem scanner together: line after line comes to the steady state; creep alone still drifts."""
    ticks, rate = 500, 100.0
    period = 55.0 + 20.0 * (ideal_triangle(ticks, 0.5) - 0.5)
    moved = SCANNER.x.follow(np.tile(period, 40), 1.0 / (rate * ticks), mean_v=55.0)[-ticks:]
    apart = moved - SCANNER.x.settled(period, 1.0 / (rate * ticks))
    line = np.arange(ticks)
    assert np.ptp(apart - np.polyval(np.polyfit(line, apart, 1), line)) < 0.01
