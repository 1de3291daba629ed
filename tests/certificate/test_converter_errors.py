"""What the emitted integers leave behind the dynamics of an axis, against poles that are stepped in time."""

from pathlib import Path

import numpy as np
import pytest
from building import REPOSITORY
from editing import SCAN, SCANNER, edited, write_pair

from tablegen.certificate.converter_errors import ConverterErrors, converter_errors
from tablegen.certificate.line_errors import EmittedPeriod, scaling_error
from tablegen.config.load import load
from tablegen.numerics.arrays import Floats
from tablegen.planning.line_plan import LinePlan, make_plan

FREE = ("- [limits]",)


def planned(folder: Path, *scan: str, scanner: tuple[str, ...] = ()) -> LinePlan:
    return make_plan(load(write_pair(folder, edited(SCAN, *FREE, *scan), edited(SCANNER, *scanner)))).x


def of(line: LinePlan) -> ConverterErrors:
    return converter_errors(line, EmittedPeriod(line))


def stepped(line: LinePlan, frequency_hz: float, quality: float) -> dict[str, Floats]:
    """A spring, a mass and a damper that the rounding errors push, by small steps; percent of the line."""
    ticks = line.program.ticks
    tick = np.arange(ticks)
    asked = line.float_codes(line.series.value(tick / ticks))
    push = (line.codes(0, ticks) - asked) / line.codes_per_unit
    steps, omega = 40, 2.0 * np.pi * frequency_hz
    dt = 1.0 / (float(line.rate) * ticks * steps)
    place, speed, out = 0.0, 0.0, np.empty(ticks)
    for _ in range(40):
        for k in range(ticks):
            for i in range(steps):
                speed += dt * omega * (omega * (push[k] - place) - speed / quality)
                place += dt * speed
                if i == steps // 2:
                    out[k] = place
    x = np.linspace(*line.band_limit.window, 801)
    shape = line.drive.shape
    found = {}
    for side, branch in (("forward", shape.forward), ("backward", shape.backward)):
        times = shape.times(side, x) * ticks - 0.5
        found[side] = 100.0 * np.interp(times, tick, out) / branch.slope(x if side == "forward" else 1.0 - x)
    return found


def test_a_resonance_that_is_stepped_in_time_makes_as_much_of_them(tmp_path: Path) -> None:
    line = planned(tmp_path, "timing.line_rate_hz = 2000", "timing.pixels = 50", scanner=("x.resonance.quality = 8",))
    found, expected = of(line), stepped(line, 40e3, 8.0)
    for side, error in expected.items():
        assert found.rms[side] == pytest.approx(float(np.std(error)), rel=0.1)
        assert found.scaling[side] == pytest.approx(float(np.ptp(error[50:] - error[:-50])) / 0.05, rel=0.2)
    apart = float(np.max(np.abs(expected["forward"] - expected["backward"])))
    assert found.mismatch == pytest.approx(apart, rel=0.2, abs=0.002)


def test_without_a_resonance_they_are_those_of_the_certificate_and_a_bit_is_half(tmp_path: Path) -> None:
    line = planned(tmp_path, scanner=("- [x.resonance]",))
    played = EmittedPeriod(line)
    plain = scaling_error(line, played, "forward", line.drive.shape.forward).quantisation
    assert of(line).scaling["forward"] == pytest.approx(plain, rel=0.25)
    finer = of(planned(tmp_path, "dac.bits = 20", scanner=("- [x.resonance]",)))
    assert finer.scaling["forward"] < 0.25 * of(line).scaling["forward"]
    assert finer.rms["backward"] < 0.25 * of(line).rms["backward"]


def test_a_resonance_makes_more_of_them(tmp_path: Path) -> None:
    """With the example's resonance several times what the codes themselves say: why it has to be worked out."""
    with_one, without = of(planned(tmp_path)), of(planned(tmp_path, scanner=("- [x.resonance]",)))
    assert max(with_one.scaling.values()) > 2.0 * max(without.scaling.values())


def test_a_measured_response_counts_as_far_as_it_goes_and_forward_lines_have_no_mismatch(tmp_path: Path) -> None:
    rows = "".join(f"{f:g},{1.0 / abs(1 - (f / 40e3) ** 2 + 1j * f / 800e3):.9g},0\n" for f in range(100, 60001, 100))
    (tmp_path / "x.csv").write_text("hz,gain,phase_deg\n" + rows, "ascii")
    table = '+ [x.resonance]\nresponse = "x.csv"\nmax_boost_db = 6.0'
    line = planned(tmp_path, 'x.band_limit.directions = "forward"', scanner=("- [x.resonance]", table))
    found = of(line)
    assert (set(found.rms), set(found.scaling), found.mismatch) == ({"forward"}, {"forward"}, 0.0)
    assert found.rms["forward"] > 0.0


def test_a_frame_of_many_ticks_is_looked_at_without_its_spectrum() -> None:
    plan = make_plan(load(REPOSITORY / "examples" / "annexin_200nm.toml"))
    found = converter_errors(plan.y, EmittedPeriod(plan.y))
    assert 0.1 < found.scaling["forward"] < 1.0
