"""The certificate against measurements by other means, and the controls that show that each figure can be bad."""

from pathlib import Path

import numpy as np
import pytest
from replacing import replace
from variants import plan_of, setup_of

from tablegen.base.remedies import CAUSE_REMEDIES, REMEDIES
from tablegen.certificate.certificate import EmittedPeriods, broken_limits, certify, limited_figures
from tablegen.certificate.certified_scan import breaks_limit, certify_planned
from tablegen.certificate.line_errors import EmittedPeriod
from tablegen.compensation.hysteresis import BranchShape
from tablegen.config.schema import Limits
from tablegen.fixedpoint import runs as runs_module
from tablegen.fixedpoint.runs import runs_of
from tablegen.planning.line_plan import LinePlan, Plan, make_plan

FREE = {"limits.max_error_lsb": "", "limits.max_scaling_error_percent": ""}


@pytest.fixture(scope="module")
def example(tmp_path_factory: pytest.TempPathFactory) -> Plan:
    return plan_of(tmp_path_factory.mktemp("example"))


def series_by_numpy(line: LinePlan, t: np.ndarray) -> np.ndarray:
    n = np.arange(1, line.series.harmonics + 1)
    angle = 2 * np.pi * np.outer(t, n)
    return line.series.a0 + np.cos(angle) @ line.series.a + np.sin(angle) @ line.series.b


def with_words(plan: Plan, words: np.ndarray) -> Plan:
    return replace(plan, x=replace(plan.x, program=replace(plan.x.program, words=words)))


@pytest.mark.common
def test_errors_are_those_of_every_tick(example: Plan) -> None:
    certificates = certify(example)
    for line in example.lines:
        ticks = line.program.ticks
        codes = line.program.codes(np.arange(ticks))
        volts = line.drive.v_offset + line.drive.v_amplitude * (series_by_numpy(line, np.arange(ticks) / ticks) - 0.5)
        asked = ((volts - 50.0) / 10.0 + 5.0) / 10.0 * 65536
        error = codes - asked
        c = certificates[line.axis]
        assert c.ticks == ticks
        assert c.max_error_lsb == pytest.approx(float(np.max(np.abs(error))), abs=1e-6)
        assert c.rms_error_lsb == pytest.approx(float(np.sqrt(np.mean(error**2))), rel=1e-6)
        assert (c.lowest_code, c.highest_code) == (codes.min(), codes.max())
        assert c.largest_step == int(np.max(np.abs(np.diff(np.append(codes, codes[0])))))
        power = np.abs(np.fft.rfft(codes - codes.mean())) ** 2
        beyond = 10 * np.log10(power[line.series.harmonics + 1 :].sum() / power.sum())
        # The figure also holds what quantisation leaves below the cutoff, so it may only be the larger one.
        assert beyond - 0.01 <= c.beyond_cutoff_db <= beyond + 0.5


def test_the_example_is_within_its_numbers(example: Plan) -> None:
    certificates = certify(example)
    assert certificates["x"].max_error_lsb <= 0.60
    assert certificates["y"].max_error_lsb <= 0.80
    for c in certificates.values():
        assert c.max_error_lsb <= 1.0
        assert abs(c.size_error_percent) < 0.001
        assert all(error.band_limit <= 0.02 for error in c.scaling.values())


def test_scaling_error_is_that_of_the_modelled_scanner(example: Plan) -> None:
    """Play the codes through the model exactly: quasi-static drive by DFT, position by bisection, chords of 1/20."""
    line = example.x
    ticks = line.program.ticks
    codes = line.program.codes(np.arange(ticks)).astype(float)
    w = (codes * line.converter.v_per_code + line.converter.v_zero - line.drive.v_offset) / line.drive.v_amplitude + 0.5
    # The dynamics undo the inverse on the played harmonics; the noise of quantisation is taken as it is.
    n = np.arange(1, 33)
    r = n * 400.0 / 40e3
    spectrum = np.fft.rfft(w)
    spectrum[1:33] /= 1 - r**2 + 1j * r / 20.0
    spectrum[1:33] *= np.sinc(n / ticks)  # the converter's hold; its half tick is the middle of each tick
    w = np.fft.irfft(spectrum, ticks)
    for side, branch in (("forward", line.drive.shape.forward), ("backward", line.drive.shape.backward)):
        k = np.arange(62, 562) if side == "forward" else np.arange(688, 1188)
        sweep = (k + 0.5) / 625 if side == "forward" else (k + 0.5 - 625) / 625
        drive = w[k] if side == "forward" else 1 - w[k]
        position = bisect(branch, drive)
        chords = (position[31:] - position[:-31]) / (sweep[31:] - sweep[:-31])
        total = 100 * (chords.max() - chords.min())
        # The noise at the resonance itself differs (it is attenuated or raised a little); the figure is chord noise.
        assert certify(example)["x"].scaling[side].total == pytest.approx(total, rel=0.08)


def bisect(branch: BranchShape, u: np.ndarray) -> np.ndarray:
    low, high = np.zeros_like(u), np.ones_like(u)
    for _ in range(60):
        middle = (low + high) / 2
        below = branch.value(middle) < u
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return low


def test_uncompensated_is_the_slope_of_a_triangle_through_the_scanner(example: Plan) -> None:
    error = certify(example)["x"].scaling["forward"].uncompensated
    x = np.linspace(0.1, 0.9, 4001)
    position = bisect(example.x.drive.shape.forward, x)
    slope = np.gradient(position, x)
    middle = np.interp(0.5, x, slope)
    assert error == pytest.approx(100 * (slope.max() - slope.min()) / middle, rel=2e-3)


def test_one_wrong_word_is_seen(example: Plan) -> None:
    words = example.x.program.words.copy()
    words[500] += 60  # 12 codes at a gain of 0.2
    bad = certify(with_words(example, words))["x"]
    assert bad.max_error_lsb > 8.0
    assert bad.scaling["forward"].total > 1.0


def test_a_truncating_table_is_seen(example: Plan) -> None:
    """Truncation instead of rounding: half an LSB of the table, all of one sign."""
    coarse = (example.x.program.words >> 8) << 8
    good, bad = certify(example)["x"], certify(with_words(example, coarse))["x"]
    assert bad.rms_error_lsb > 20 * good.rms_error_lsb


def test_band_limit_and_boost_limit_are_told_apart(tmp_path: Path) -> None:
    ringing = certify(plan_of(tmp_path, {**FREE, "x.band_limit.method": '"truncate"'}))["x"].scaling["forward"]
    assert ringing.band_limit > 10.0
    assert ringing.model == 0.0
    held = plan_of(tmp_path, FREE, {"x.resonance.frequency_hz": "4000.0", "x.resonance.max_boost_db": "3.0"})
    error = certify(held)["x"].scaling["forward"]
    assert error.band_limit < 0.02
    assert error.model > 1.0
    assert error.total > 0.8 * error.model


def test_a_scan_of_the_wrong_size_is_seen(tmp_path: Path) -> None:
    """Too few harmonics for a wide window: the extent of the image is off, not only its straightness."""
    edits = {**FREE, "x.band_limit.harmonics": "3", "x.band_limit.window": "[0.02, 0.98]"}
    assert abs(certify(plan_of(tmp_path, edits))["x"].size_error_percent) > 1.0


def test_coarse_converter_shows_in_quantisation(tmp_path: Path) -> None:
    fine = certify(plan_of(tmp_path, FREE))["x"].scaling["forward"].quantisation
    coarse = certify(plan_of(tmp_path, {**FREE, "dac.bits": "12"}))["x"].scaling["forward"].quantisation
    assert coarse == pytest.approx(16 * fine, rel=0.4)


@pytest.mark.common
@pytest.mark.parametrize("mode", ["interpolated", "cubic"])
def test_runs_and_ticks_measure_the_same(
    example: Plan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, mode: str
) -> None:
    """Long frames are measured by runs of one code. Forced to single ticks, every figure has to come out again."""
    cubic = {"timing.line_rate_hz": "20.0", "y.table.mode": '"cubic"', "y.table.length": "256", "y.table.bits": "14"}
    plan = example if mode == "interpolated" else plan_of(tmp_path, {**FREE, **cubic})
    by_runs = certify(plan)["y"]
    assert len(runs_of(plan.y.program).starts) < 0.2 * plan.y.program.ticks
    monkeypatch.setattr(runs_module, "_MIN_TICKS_PER_RUN", 10**9)
    assert len(runs_of(plan.y.program).starts) == plan.y.program.ticks
    by_ticks = certify(plan)["y"]
    exact = ("max_error_lsb", "lowest_code", "highest_code", "largest_step", "headroom_low")
    for name in exact:
        assert getattr(by_runs, name) == pytest.approx(getattr(by_ticks, name), rel=1e-9), name
    assert by_runs.rms_error_lsb == pytest.approx(by_ticks.rms_error_lsb, rel=1e-5)
    assert by_runs.beyond_cutoff_db == pytest.approx(by_ticks.beyond_cutoff_db, abs=1e-3)
    for part in ("total", "quantisation", "band_limit", "size"):
        runs, ticks = (getattr(c.scaling["forward"], part) for c in (by_runs, by_ticks))
        assert runs == pytest.approx(ticks, rel=1e-6), part


def test_the_largest_error_may_stand_in_the_middle_of_a_run(example: Plan) -> None:
    """Held by the clamp, the code rests while the waveform turns above it: the error peaks between the run's ends."""
    top = int(example.y.codes(0, example.y.program.ticks).max())
    output = replace(example.y.program.output, code_max=top - 300)
    line = replace(example.y, program=replace(example.y.program, output=output))
    ticks = np.arange(line.program.ticks)
    error = line.program.codes(ticks) - line.float_codes(line.series.on_grid(line.program.ticks))
    assert EmittedPeriod(line).largest_error() == pytest.approx(float(np.max(np.abs(error))), abs=1e-6)
    assert EmittedPeriod(line).largest_error() > 299.0


def test_a_resonance_inside_the_band_is_seen(tmp_path: Path) -> None:
    quiet = certify(plan_of(tmp_path, FREE))["x"].at_resonance_db
    plan = plan_of(tmp_path, FREE, {"x.resonance.frequency_hz": "6000.0"})
    loud = certify(plan)["x"].at_resonance_db
    assert quiet is not None
    assert loud is not None
    assert quiet < -95.0
    power = plan.x.series.a**2 + plan.x.series.b**2
    assert loud == pytest.approx(10 * np.log10(power[14] / power.sum()), abs=0.5)
    assert loud > quiet + 10.0


def test_a_line_that_touches_its_own_guard_is_refused(tmp_path: Path) -> None:
    setup = setup_of(tmp_path)
    plan = make_plan(setup)
    output = replace(plan.x.program.output, max_step=20)
    tight = replace(plan, x=replace(plan.x, program=replace(plan.x.program, output=output)))
    problems = broken_limits(tight, certify(tight), setup.scan_file)
    assert [(one.code, one.axis) for one in problems] == [("step-guard", "x")]
    text = list(map(str, problems))
    assert "amplifier.max_slew_v_per_s: the x axis steps by 24 codes, above its guard of 20; a lower" in text[0]


@pytest.mark.parametrize(
    "edits",
    [
        {},
        {"x.offset_v": "41.3", "y.offset_v": "57.7", "x.size_nm": "137"},
        {"x.table.mode": '"cubic"', "x.table.length": "256", "x.band_limit.method": '"truncate"'},
        {
            "y.motion": '"step"',
            "y.table.mode": '"direct"',
            "y.table.length": "",
            "y.band_limit.harmonics": "16",
            "amplifier.max_slew_v_per_s": "",
        },
    ],
)
def test_limits_are_decided_before_the_certificate(tmp_path: Path, edits: dict[str, str]) -> None:
    """By the same figures: a limit just below any of them is exceeded, and one just above is not."""
    setup = setup_of(tmp_path, {**FREE, "timing.lines": "40", **edits})
    plan = make_plan(setup)
    certificates, periods = certify(plan), EmittedPeriods(plan)
    figures = limited_figures(periods)
    for axis, certificate in certificates.items():
        assert figures[axis] == replace(certificate.limited, expected=None)
    assert certify(plan, periods) == certificates  # what was measured before is not another figure
    error = max(one.max_error_lsb for one in certificates.values())
    scaling = max(max(one.scaling_error_percent, abs(one.size_error_percent)) for one in certificates.values())
    steps = certificates["x"].largest_step
    for share, broken in ((1.0 - 1e-9, True), (1.0, False)):
        for limits in (Limits(max_error_lsb=share * error), Limits(max_scaling_error_percent=share * scaling)):
            limited = replace(plan, limits=limits)
            assert breaks_limit(setup, EmittedPeriods(limited)) is broken
            assert bool(certify_planned(setup, limited, remedies=False).broken) is broken
        output = replace(plan.x.program.output, max_step=steps - broken)
        guarded = replace(plan, x=replace(plan.x, program=replace(plan.x.program, output=output)))
        assert breaks_limit(setup, EmittedPeriods(guarded)) is broken


def test_a_coarse_table_is_told_from_a_coarse_converter(tmp_path: Path) -> None:
    for edits, cause in (({"x.table.bits": "8"}, "table"), ({"dac.bits": "12"}, "converter")):
        setup = setup_of(tmp_path, {**edits, "limits.max_error_lsb": ""})
        plan = make_plan(setup)
        text = str(broken_limits(plan, certify(plan), setup.scan_file)[0])
        assert f"most of it is the {cause}: {CAUSE_REMEDIES[cause]}" in text


def test_broken_limits_name_the_part_and_the_remedy(tmp_path: Path) -> None:
    edits = {"x.band_limit.method": '"truncate"', "limits.max_error_lsb": "0.7"}
    setup = setup_of(tmp_path, edits)
    plan = make_plan(setup)
    problems = broken_limits(plan, certify(plan), setup.scan_file)
    assert [(one.code, one.axis) for one in problems] == [("scaling-error", "x"), ("converter-error", "y")]
    text = list(map(str, problems))
    assert text[1].endswith(f"the y axis errs by up to 0.7406 LSB, above 0.7; {REMEDIES['converter-error']}")
    assert "limits.max_scaling_error_percent: the x axis has a scaling error of " in text[0]
    assert f"above 0.5 %; most of it is the band limit: {CAUSE_REMEDIES['band limit']}" in text[0]
