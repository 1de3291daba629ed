"""Which shaping a plan gets, what it needs of converter and amplifier, and what refuses it."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from building import Variant, write_variant
from hypothesis import given, settings
from hypothesis import strategies as st

from tablegen.base.input_errors import Rejected
from tablegen.compensation.dynamics import Measured, SecondOrder
from tablegen.config.load import load
from tablegen.fixedpoint.shaping import OFF, Shaping
from tablegen.planning.line_plan import Plan, make_plan
from tablegen.planning.shaping_choice import best_shaping

RESONANCE = {"frequency_hz": 1000.0, "quality": 10.0}
FULL = {"x.size.k_nm_per_v": 10.0}


def plan(folder: Path, scan: dict[str, Any] | None = None, scanner: dict[str, Any] | None = None) -> Plan:
    return make_plan(load(write_variant(folder, Variant({"timing.lines": 40, **(scan or {})}, scanner or {}))))


def refused(folder: Path, scan: dict[str, Any], scanner: dict[str, Any] | None = None) -> str:
    with pytest.raises(Rejected) as found:
        plan(folder, scan, scanner)
    return "\n".join(map(str, found.value.problems))


def shapings(one: Plan) -> tuple[Shaping, Shaping]:
    return one.x.program.output.shaping, one.y.program.output.shaping


def left(response: SecondOrder, shaping: Shaping, rate_hz: float) -> float:
    """Rms of white roundings behind noise filter and response: a sum over many evenly spread frequencies."""
    f = (np.arange(1 << 20) + 0.5) * (0.5 * rate_hz / (1 << 20))
    noise = np.polyval(shaping.noise[::-1], np.exp(-2j * np.pi * f / rate_hz))
    r = f / response.frequency_hz
    return float(np.sqrt(np.mean(np.abs(noise / (1.0 - r * r + 1j * r / response.quality)) ** 2) / 12.0))


@pytest.mark.rest
@settings(max_examples=15)
@given(st.floats(300.0, 200e3), st.floats(2.0, 60.0))
def test_nothing_that_could_be_chosen_leaves_less(hz: float, quality: float) -> None:
    response = SecondOrder(hz, quality)
    chosen = best_shaping(response, 500e3)
    best = left(response, chosen, 500e3)
    others = [Shaping(1), Shaping(2)]
    others += [Shaping(3, zero) for zero in range(max(chosen.zero - 2, 0), min(chosen.zero + 3, 129))]
    assert best <= 1.001 * min(left(response, other, 500e3) for other in others)


def test_a_measured_response_chooses_as_its_resonance_does() -> None:
    second = SecondOrder(40e3, 20.0)
    f = np.linspace(100.0, 240e3, 4000)
    real, imaginary = second.inverse(f)
    h = 1.0 / (real + 1j * imaginary)
    measured = Measured(f, np.abs(h) / abs(h[0]), np.unwrap(np.angle(h)) / (2.0 * np.pi))
    assert best_shaping(measured, 500e3) == best_shaping(second, 500e3) == Shaping(3, 110)


def test_off_unless_it_is_asked_for(tmp_path: Path) -> None:
    assert shapings(plan(tmp_path)) == (OFF, OFF)


def test_both_axes_by_one_key_or_each_by_its_own(tmp_path: Path) -> None:
    both = plan(tmp_path / "both", {"dac.shaping": "second"})
    assert shapings(both) == (Shaping(2), Shaping(2))
    own = plan(tmp_path / "own", {}, {"x.dac": {"shaping": "scanner"}, "y.dac": {"shaping": "first"}})
    assert shapings(own) == (Shaping(3, 110), Shaping(1))


def test_an_axis_at_rest_is_not_shaped(tmp_path: Path) -> None:
    y = {"motion": "off", "offset_v": 50.0}
    assert shapings(plan(tmp_path, {"dac.shaping": "second", "y": y})) == (Shaping(2), OFF)


def test_a_response_that_is_missing_is_named(tmp_path: Path) -> None:
    text = refused(tmp_path, {"dac.shaping": "scanner"})
    assert "dac.shaping: 'scanner' goes by the response of the y axis" in text
    assert "calibrate resonance --axis y" in text
    assert "[y.dac] in the scanner file" in text


@pytest.mark.common
def test_room_to_the_end_of_the_driver(tmp_path: Path) -> None:
    """Without shaping the drive may end within a code of the driver's range."""
    at = {"x.offset_v": 89.0, "x.park_v": 50.0, "timing.lines": 40}

    def with_size(size_v: float, shaping: str) -> dict[str, Any]:
        sizes = {"x": {**BASE_X, "size_v": size_v}}
        return {**sizes, **at, "dac.shaping": shaping}

    low, high = 1.0, 30.0
    for _ in range(60):  # the largest drive that fits without shaping
        middle = 0.5 * (low + high)
        try:
            plan(tmp_path / "off", with_size(middle, "off"))
            low = middle
        except Rejected:
            high = middle
    for shaping in ("first", "second", "scanner"):
        scanner = {"y.resonance": RESONANCE}
        text = refused(tmp_path / shaping, with_size(low, shaping), scanner)
        assert f"dac.shaping: '{shaping}' moves codes by up to" in text
        assert "codes of an end" in text
        plan(tmp_path / "less", with_size(low - 0.05, shaping), scanner)


BASE_X = {
    "turn": 0.5,
    "band_limit": {"method": "window", "harmonics": 32, "window": [0.1, 0.9], "directions": "both"},
    "table": {"mode": "interpolated", "length": 2048, "bits": 16},
}


def test_steps_that_the_amplifier_does_not_carry(tmp_path: Path) -> None:
    """24 codes a tick and the guard's own are within; what shaping adds is not."""
    slew = 27.4 * 500e3 * 100.0 / 65536
    assert plan(tmp_path / "off", {"amplifier.max_slew_v_per_s": slew}).x.program.output.max_step == 27
    text = refused(tmp_path / "second", {"amplifier.max_slew_v_per_s": slew, "dac.shaping": "second"})
    assert "dac.shaping: 'second' adds up to 4 codes to a step of the x axis" in text
    slower = float(text.split("an update_rate_hz of about ")[1].split(",")[0])
    assert 200e3 < slower < 500e3
    scan = {"amplifier.max_slew_v_per_s": slew, "dac.shaping": "second", "dac.update_rate_hz": slower}
    assert shapings(plan(tmp_path / "slower", scan)) == (Shaping(2), Shaping(2))


def test_without_a_slew_rate_the_guard_is_above_every_step(tmp_path: Path) -> None:
    from building import REMOVED

    one = plan(tmp_path, {"amplifier.max_slew_v_per_s": REMOVED, "dac.shaping": "second"})
    codes = one.x.codes(0, 40 * one.schedule.ticks)
    assert np.max(np.abs(np.diff(codes))) <= one.x.program.output.max_step < 100
