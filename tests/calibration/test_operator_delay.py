"""The delay of a sensor, fitted from lines of foreign piezos: what was put in comes out, whatever the hysteresis."""

from collections.abc import Sequence
from functools import cache

import numpy as np
import pytest
from foreign_plants import SIX, V_MAX, BoucWen, Core, ForeignPlant, ManyPlays, record
from replacing import replace

from tablegen.base.input_errors import Unphysical
from tablegen.calibration.laws.hysteresis import Trace
from tablegen.calibration.operator.delay import fit_delay
from tablegen.calibration.operator.periodic_line import PeriodicLine, periodic_line
from tablegen.compensation.dynamics import SecondOrder


class Modes:
    """The plant's dynamics as `calibrate resonance --points` would have measured them."""

    resonance_hz = 60e3
    half_width_hz = 2e3
    highest_hz = 100e3

    def inverse(self, f_hz: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        response = 1.0 / ForeignPlant(ManyPlays()).dynamics(f_hz)
        return response.real, response.imag


@cache
def recorded(kind: type[Core], rate_hz: float, turn: float) -> tuple[Trace, ...]:
    plant = ForeignPlant(kind())
    return tuple(Trace(f"{k}", *record(plant, *at, rate_hz, k, turn)) for k, at in enumerate(SIX))


def late(traces: Sequence[Trace], delay_s: float) -> list[PeriodicLine]:
    """The same by a sensor that is behind."""
    moved = [np.interp(one.time_s - delay_s, one.time_s, one.displacement_nm) for one in traces]
    return [periodic_line(replace(one, displacement_nm=nm), V_MAX) for one, nm in zip(traces, moved, strict=True)]


@pytest.mark.rest
@pytest.mark.parametrize("kind", [ManyPlays, BoucWen])
@pytest.mark.parametrize(
    ("rate_hz", "turn", "share"), [(100.0, 0.5, 0.0), (100.0, 0.5, 0.002), (1000.0, 0.5, -0.01), (100.0, 0.8, 0.002)]
)
def test_the_delay_comes_out(kind: type[Core], rate_hz: float, turn: float, share: float) -> None:
    found = fit_delay(late(recorded(kind, rate_hz, turn), share / rate_hz), Modes())
    assert found.value * rate_hz == pytest.approx(share, abs=0.0005)
    assert 1e-5 < found.standard_error * rate_hz < 5e-4


def test_a_line_is_as_much_earlier_as_its_sensor_was_late() -> None:
    (trace,) = recorded(ManyPlays, 100.0, 0.5)[3:4]
    straight, (behind,) = periodic_line(trace, V_MAX), late([trace], 3e-5)
    distance = np.abs(behind.earlier(3e-5).displacement_nm - straight.displacement_nm)
    assert float(np.max(distance)) < 1.5  # of 800 nm, of which noise is 0.8
    assert float(np.max(np.abs(behind.displacement_nm - straight.displacement_nm))) > 4.0


@pytest.mark.common
def test_round_turns_and_large_delays_are_refused() -> None:
    t = np.arange(5000) / 1000.0
    drive = 50.0 - 30.0 * np.cos(2.0 * np.pi * t)
    wave = periodic_line(Trace("sine.csv", t, drive, 12.0 * drive), V_MAX)
    with pytest.raises(Unphysical, match=r"sine\.csv: the drive is rounded at its turns, where a delay shows"):
        fit_delay([wave], None)
    with pytest.raises(Unphysical, match=r"no delay below 0\.0002 s, 2 % of the shortest period, fits"):
        fit_delay(late(recorded(BoucWen, 100.0, 0.5), 4e-4), SecondOrder(60e3, 14.0, 2e-6))
