"""What is applied, factor by factor, on the plan of the example; and that every trap of the paper is avoided there."""

from math import exp, log10, sqrt
from pathlib import Path

import numpy as np
import pytest
from variants import plan_of

from tablegen.planning.line_plan import Plan


@pytest.fixture(scope="module")
def example(tmp_path_factory: pytest.TempPathFactory) -> Plan:
    return plan_of(tmp_path_factory.mktemp("example"))


def test_the_examples_drive_by_hand(example: Plan) -> None:
    """Every number of x from the equations as printed, with K = 10 nm/V * 100 V."""
    drive = example.x.drive
    alpha = 1000.0 / (1 + 0.53 * 200.0 / 1000.0)  # (8)
    v = (sqrt(1 + 4 * 0.53 * 200.0 / alpha) - 1) / (2 * 0.53)  # (9)
    assert drive.v_scan_normalised == pytest.approx(v, rel=1e-12)
    assert drive.v_scan == pytest.approx(100.0 * v)
    assert drive.m == 1.0
    assert drive.g == pytest.approx(1 / (1 - 0.03 * log10(400.0 / 100.0)))  # (23)
    assert drive.forward.beta == pytest.approx(0.037 * (1 - exp(-4.0 * v)) / (1 - exp(-4.0)))  # (22)
    assert drive.backward.beta == pytest.approx(0.080 * (1 - exp(-1.5 * v)) / (1 - exp(-1.5)))
    assert (drive.forward.u_peak, drive.backward.u_peak, drive.turn, drive.model) == (0.37, 0.48, 0.5, "harmonic")
    assert drive.v_amplitude == pytest.approx(drive.m * drive.g * drive.v_scan)
    assert example.y.drive.g == pytest.approx(1 / (1 - 0.03 * log10(2.0 / 1.0)))


def test_beta_takes_the_voltage_before_m_and_g(tmp_path: Path) -> None:
    """The trap in (22): away from the centre m grows the drive, and beta must not grow with it."""
    centre = plan_of(tmp_path, {"x.offset_v": "50.0"}).x.drive
    edge = plan_of(tmp_path, {"x.offset_v": "85.0"}).x.drive
    assert edge.m > 1.1
    assert edge.forward.beta == centre.forward.beta
    slow = plan_of(tmp_path, {"timing.line_rate_hz": "100.0"}).x.drive
    assert slow.g == 1.0
    assert slow.forward.beta == centre.forward.beta


def test_the_scan_is_centred_on_the_offset(tmp_path: Path) -> None:
    for v_offset in (30.0, 50.0, 70.0):
        line = plan_of(tmp_path, {"x.offset_v": repr(v_offset)}).x
        codes = line.codes(0, line.program.ticks)
        volts = codes * line.converter.v_per_code + line.converter.v_zero
        ideal = v_offset + line.drive.v_amplitude * (np.array([0.0, 1.0]) - 0.5)
        assert float(volts.min()) > ideal[0]
        assert float(volts.max()) < ideal[1]
        assert float(volts.mean()) == pytest.approx(v_offset, abs=0.6)  # the branches are not symmetric


def test_an_offset_in_nm_is_the_offset_voltage_it_integrates_to(tmp_path: Path) -> None:
    by_volts = plan_of(tmp_path, {"x.offset_v": "63.0"}).x
    position = by_volts.drive.position_nm
    by_nm = plan_of(tmp_path, {"x.offset_v": "", "x.offset_nm": repr(position)}).x
    assert by_nm.drive.v_offset == pytest.approx(63.0, abs=1e-10)
    assert by_nm.drive.m == pytest.approx(by_volts.drive.m)
    assert position != pytest.approx(630.0, abs=1.0)  # not k V: the slope changes with the offset


def test_a_size_in_volts_is_the_size_it_reaches(tmp_path: Path) -> None:
    by_volts = plan_of(tmp_path, {"x.size_nm": "", "x.size_v": "31.0"}).x.drive
    by_nm = plan_of(tmp_path, {"x.size_nm": repr(by_volts.size_nm)}).x.drive
    assert by_nm.v_scan == pytest.approx(31.0)


def test_size_of_window_grows_the_drive_by_the_inverse_of_the_window(tmp_path: Path) -> None:
    window = plan_of(tmp_path, {"x.size_nm": "160.0", "x.size_of": '"window"'}).x.drive
    line = plan_of(tmp_path, {"x.size_nm": "200.0"}).x.drive
    assert window.size_nm == pytest.approx(200.0)
    assert window.window_nm == pytest.approx(160.0)
    assert window.v_scan == pytest.approx(line.v_scan)


def test_branches_are_interpolated_between_calibrated_turns(tmp_path: Path) -> None:
    text = (
        "\n[[x.hysteresis.branches]]\nturn = 0.7\n"
        "forward = { beta_max = 0.041, rho = 3.0, u_peak = 0.39 }\n"
        "backward = { beta_max = 0.088, rho = 1.7, u_peak = 0.5 }\n"
    )
    from variants import setup_of

    from tablegen.config.load import load
    from tablegen.planning.line_plan import make_plan

    setup_of(tmp_path, {"x.turn": "0.6"})
    path = tmp_path / "scanner.toml"
    path.write_text(path.read_text().replace("\n[x.frequency]", text + "\n[x.frequency]"))
    drive = make_plan(load(tmp_path / "scan.toml")).x.drive
    v = drive.v_scan_normalised
    assert drive.forward.u_peak == pytest.approx(0.38)
    assert drive.forward.beta == pytest.approx(0.039 * (1 - exp(-3.5 * v)) / (1 - exp(-3.5)))
    assert drive.backward.beta == pytest.approx(0.084 * (1 - exp(-1.6 * v)) / (1 - exp(-1.6)))


def test_measured_offsets_serve_as_calibration(tmp_path: Path) -> None:
    sizes = {7.0: 16.3, 50.0: 17.7, 93.0: 22.3}
    points = "[" + ", ".join(f"{{ offset_v = {v}, apparent_nm = {nm} }}" for v, nm in sizes.items()) + "]"
    scanner = {"x.offset.m_minus": "", "x.offset.m_plus": "", "x.offset.points": points}
    drive = plan_of(tmp_path, {"x.offset_v": "75.0"}, scanner).x.drive
    parabola = np.polyfit([-0.86, 0.0, 0.86], [16.3 / 17.7, 1.0, 22.3 / 17.7], 2)
    assert drive.m == pytest.approx(float(np.polyval(parabola, 0.5)))


def test_a_plan_cannot_be_changed(example: Plan) -> None:
    for array in (example.x.program.words, example.x.series.a, example.x.target.b, example.y.fourier.a):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1


def test_each_harmonic_is_divided_by_the_dynamics(example: Plan) -> None:
    line = example.x
    n = np.arange(1, 33)
    target = (line.target.a - 1j * line.target.b) / 2
    played = (line.series.a - 1j * line.series.b) / 2
    r = n * 400.0 / 40e3
    response = 1 / (1 - r**2 + 1j * r / 20.0)
    held = np.exp(-1j * np.pi * n / 1250) * np.sinc(n / 1250)  # what a converter makes of samples at k / 1250
    assert played * held * response == pytest.approx(target, rel=1e-12, abs=1e-15)
    at_piezo = (line.drive_series.a - 1j * line.drive_series.b) / 2
    assert at_piezo * response == pytest.approx(target, rel=1e-12, abs=1e-15)
    assert line.held_harmonics == ()
    assert example.y.drive_series is example.y.target


def test_an_axis_that_steps_is_in_the_middle_of_its_line_where_a_ramp_would_be(tmp_path: Path) -> None:
    """The hold is a line long: the code of line j is what the target has at j + 1/2, and a row is at its code."""
    ramp, step = (plan_of(tmp_path, {"y.motion": f'"{motion}"'}).y for motion in ("ramp", "step"))
    j = np.arange(200)
    assert step.series.value(j / 200) == pytest.approx(step.target.value((j + 0.5) / 200), abs=1e-12)
    assert step.codes(0, 250_000)[::1250] == pytest.approx(ramp.codes(0, 250_000)[625::1250], abs=2.0)


def test_the_boost_limit_holds_back_and_says_so(tmp_path: Path) -> None:
    limits = {"limits.max_scaling_error_percent": ""}
    line = plan_of(tmp_path, limits, {"x.resonance.frequency_hz": "4000.0", "x.resonance.max_boost_db": "3.0"}).x
    first = line.held_harmonics[0]
    r = np.array([first - 1, first]) * 400.0 / 4000.0
    boost = 20 * np.log10(np.abs(1 - r**2 + 1j * r / 20.0))
    assert boost[0] <= 3.0 < boost[1]
    assert line.held_harmonics == tuple(range(first, 33))


def test_rates_are_exact_fractions(tmp_path: Path) -> None:
    plan = plan_of(tmp_path, {"timing.line_rate_hz": "333.0"})
    assert plan.schedule.ticks == 1502
    assert (plan.x.rate.numerator, plan.x.rate.denominator) == (250000, 751)
    assert plan.x.requested_hz == 333.0
    assert plan.y.rate == plan.x.rate / 200


def test_ticks_per_pixel_choose_the_line(tmp_path: Path) -> None:
    """Pixels x ticks per pixel over the imaging fraction: 200 x 3 / (0.8 x 0.5)."""
    plan = plan_of(tmp_path, {"timing.ticks_per_pixel": "3"})
    assert plan.schedule.ticks == 1500
    assert plan.schedule.pixel_ticks == 3
    assert plan.schedule.forward.count == plan.schedule.backward.count == 600


def test_windows_are_decided_in_exact_fractions(example: Plan) -> None:
    """0.1 of a branch of 625 ticks is tick 62.5; pixels begin a quarter of a tick late on average, so that the window
    begins at 62. Both directions hold 500 ticks."""
    schedule = example.schedule
    assert (schedule.forward.first, schedule.forward.stop) == (62, 562)
    assert (schedule.backward.first, schedule.backward.stop) == (688, 1188)
    assert (schedule.turn_tick, schedule.turn_line) == (625, 190)
    # Lines count where they begin and end inside 0.05..0.95 of 190 lines: 9.5 to 180.5.
    assert (schedule.up.first, schedule.up.stop) == (10, 180)
    assert schedule.down.count == 0


def test_an_inverting_amplifier_inverts_the_codes_and_nothing_else(tmp_path: Path, example: Plan) -> None:
    inverted = plan_of(tmp_path, {"amplifier.gain": "-10.0"}).x
    straight = example.x
    assert inverted.program.output.gain_word == -straight.program.output.gain_word
    a, b = inverted.codes(0, 1250), straight.codes(0, 1250)
    volts = [line.converter.v_zero + line.converter.v_per_code * c for line, c in ((inverted, a), (straight, b))]
    assert volts[0] == pytest.approx(volts[1], abs=2.0 * abs(straight.converter.v_per_code))


def test_a_code_is_the_voltage_of_an_ideal_converter(example: Plan) -> None:
    """Code 0 is -5 V at the converter, 0 V at the piezo; half scale is 0 V, 50 V; one LSB 10 V / 65536 times 10."""
    converter = example.x.converter
    assert converter.code(0.0) == 0.0
    assert converter.code(50.0) == 32768.0
    assert converter.v_per_code == pytest.approx(10.0 * 10.0 / 65536)
    assert example.x.program.output.offset_code == 32768


def test_park_is_where_it_was_asked_to_be(tmp_path: Path, example: Plan) -> None:
    assert example.x.program.output.park_code == example.x.program.output.offset_code
    output = plan_of(tmp_path, {"x.park_v": "10.0", "y.park_v": "0.0"})
    assert output.x.program.output.park_code == round(0.1 * 65536)
    assert output.y.program.output.park_code == 0


def test_an_offset_between_two_codes_is_kept(tmp_path: Path) -> None:
    """Half a code beside code 32768: rounded to a code by itself it would cost half an LSB on every sample."""
    line = plan_of(tmp_path, {"x.offset_v": repr(50.0 + 0.5 * 100.0 / 65536)}).x
    codes = line.codes(0, line.program.ticks)
    asked = line.float_codes(line.series.value(np.arange(1250) / 1250))
    assert float(np.max(np.abs(codes - asked))) < 0.62
    assert abs(float(np.mean(codes - asked))) < 0.03


def test_the_step_guard_is_the_amplifiers_slew_rate(example: Plan, tmp_path: Path) -> None:
    assert example.x.program.output.max_step == int(2e6 / 500e3 / (100.0 / 65536))
    free = plan_of(tmp_path, {"amplifier.max_slew_v_per_s": ""}).x.program
    steps = np.abs(np.diff(free.codes(np.arange(1250))))
    assert steps.max() <= free.output.max_step <= 2 * (steps.max() + 2)


def test_slow_axis_steps_once_a_line(tmp_path: Path) -> None:
    scan = {"y.motion": '"step"', "y.band_limit.harmonics": "40"}
    plan = plan_of(tmp_path, scan)
    codes = plan.y.codes(0, plan.schedule.frame_ticks).reshape(200, 1250)
    assert np.all(codes == codes[:, :1])
    w = plan.y.series.value(np.arange(200) / 200)
    assert codes[:, 0] == pytest.approx(plan.y.float_codes(w), abs=1.0)
