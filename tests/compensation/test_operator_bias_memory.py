"""After a change of offset the sensitivity of a piezo follows late: fitted to a record of it, and then predicted."""

import csv
import json
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from editing import run
from foreign_plants import SIX, V_MAX, BoucWen, ForeignPlant, ManyPlays, record, triangle
from msgspec import structs
from stepped_plants import scan_through_steps
from test_operator_waveform import operator

from tablegen.base.input_errors import Unphysical
from tablegen.calibration.laws.hysteresis import Trace
from tablegen.calibration.operator.bias_memory_fit import BiasMemoryFit, Stretch, fit_bias_memory, stretches
from tablegen.calibration.operator.fit import fit_operator
from tablegen.calibration.operator.periodic_line import periodic_line
from tablegen.compensation.operator.bias_memory import BiasMemory, late_terms
from tablegen.compensation.operator.creep import LogarithmicCreep
from tablegen.compensation.operator.in_time import OperatorInTime, Start
from tablegen.compensation.operator.operator import Operator
from tablegen.compensation.operator.transient import SettledLine, after_offset, after_size, transient_between
from tablegen.numerics.arrays import Floats
from tablegen.numerics.driver import Driver
from tablegen.planning.settling import Settling, settling_text

pytestmark = pytest.mark.rest

LINE_S = 0.01
LATE = LogarithmicCreep(0.03, 1e-4, 1e3, 100.0)
REMEMBERING = replace(operator(LATE), bias_memory=BiasMemory(0.2, 20.0, 0.1, 12.0))
UP = (0.5, 0.7)
FRAME = 256  # lines


def one(_: float) -> float:
    return 1.0


def means(model: Operator, before: float, now: float, count: int) -> list[Stretch]:
    """Lines as the model has them."""
    lines = [SettledLine.about(0.2, at, 0.5, LINE_S) for at in (before, now)]
    off = transient_between(model, *lines, 1.0).off_nm(LINE_S, count, 0.0)
    return [Stretch(lines[0], 0.0, np.zeros(count)), Stretch(lines[1], count * LINE_S, off + 100.0)]


def test_a_memory_is_fitted_to_the_lines_that_have_it() -> None:
    both = [means(REMEMBERING, 0.5, 0.7, 3000), means(REMEMBERING, 0.7, 0.5, 3000)]
    fit = fit_bias_memory(both, REMEMBERING, one)
    assert fit.memory is not None
    assert (fit.memory.rise_time_s, fit.memory.fall_time_s) == pytest.approx((20.0, 12.0), rel=0.05)  # of trials
    assert (fit.memory.rise_share, fit.memory.fall_share) == pytest.approx((0.2, 0.1), rel=0.05)
    assert fit.rms_nm < 0.02 * fit.without_nm


def test_a_direction_that_no_record_has_takes_the_share_of_the_other() -> None:
    fit = fit_bias_memory([means(REMEMBERING, 0.7, 0.5, 3000)], REMEMBERING, one)
    assert fit.memory is not None
    assert fit.memory.late(1.0) == fit.memory.late(-1.0) == pytest.approx((0.1, 12.0), rel=0.05)
    assert fit.memory.late(0.0)[0] == 0.0


def test_lines_that_only_creep_have_no_memory_and_a_drift_that_goes_on_is_refused() -> None:
    random = np.random.default_rng(1)
    before, now = means(replace(REMEMBERING, bias_memory=None), 0.5, 0.7, 1000)
    noisy = replace(now, means_nm=now.means_nm + 0.05 * random.standard_normal(1000))
    assert fit_bias_memory([[before, noisy]], REMEMBERING, one).memory is None
    slow = replace(REMEMBERING, bias_memory=BiasMemory(0.2, 200.0, 0.2, 200.0))
    with pytest.raises(Unphysical, match="longer than the record shows; record for longer after the change"):
        fit_bias_memory([means(slow, 0.5, 0.7, 1000)], slow, one)


def test_only_a_change_of_offset_has_a_memory_and_it_is_not_extrapolated() -> None:
    after = after_offset(REMEMBERING, 0.2, 0.7, 1.0, 0.5, LINE_S)
    without = structs.replace(after, bias=())
    gained = after.off_nm(LINE_S, 512, 0.0) - without.off_nm(LINE_S, 512, 0.0)
    late = after.bias[0]
    assert late.tau_s == 20.0
    assert gained[256] - gained[0] == pytest.approx(late.nm * (1.0 - np.exp(-256 * LINE_S / 20.0)), rel=0.12)  # creeps
    assert np.array_equal(after.off_nm(LINE_S, 512, 0.1), without.off_nm(LINE_S, 512, 0.1))
    assert after_size(REMEMBERING, 0.2, 0.7, 1.0, 0.5, LINE_S).bias == ()
    down = after_offset(REMEMBERING, 0.2, 0.3, 1.0, 0.5, LINE_S).bias[0]
    assert (down.tau_s, down.nm < 0.0 < late.nm) == (12.0, True)


def test_what_is_late_creeps_too() -> None:
    """The terms are the motion 1 - exp(-t / T) behind creep, which is stepped here."""
    time, dt = 5.0, 2e-3
    t = dt * np.arange(1, 5001)
    state = np.zeros(len(LATE.terms()))
    shares, taus = np.array(LATE.terms()).T
    decay, out = np.exp(-dt / taus), []
    for here in (1.0 - np.exp(-(t - 0.5 * dt) / time)).tolist():
        state = decay * state + (1.0 - decay) * here
        out.append(float(shares @ state))
    stepped = LATE.direct * (1.0 - np.exp(-t / time)) + np.array(out)
    terms = late_terms(LATE, time)
    lacking = np.sum([share * np.exp(-t / tau_s) for share, tau_s in terms], axis=0)
    assert np.sum([share for share, _ in terms]) - lacking == pytest.approx(stepped, abs=2e-3)


def test_without_a_record_the_drift_that_may_come_is_stated() -> None:
    forgetful = operator(LATE)
    late = after_offset(forgetful, 0.2, 0.7, 1.0, 0.5, LINE_S, lambda at: 1.0 + 0.2 * (0.7 - at))
    assert late.unknown_nm == pytest.approx(6.31, rel=1e-3)  # nm: 1.1 % of the way from 0 V
    assert after_offset(REMEMBERING, 0.2, 0.7, 1.0, 0.5, LINE_S, lambda at: 1.0 + 0.2 * (0.7 - at)).unknown_nm == 0.0
    assert after_offset(forgetful, 0.2, 0.7, 1.0, 0.5, LINE_S, one).unknown_nm == 0.0  # no law of (1)
    text = "; ".join(settling_text(Settling(9, 10.0, 1.0, 5.0, 0.0, 0.5, 0.0, 0.1, 0.0, late.unknown_nm)))
    assert f"may drift by up to {late.unknown_nm:.3g} nm more after a change of offset" in text
    assert "`calibrate operator --step` measures it" in text
    assert "may drift" not in "; ".join(settling_text(Settling(9, 10.0, 1.0, 5.0, 0.0, 0.5, 0.0, 0.1, 0.0, 0.9)))


def test_lines_at_each_offset_are_cut_out_of_a_record() -> None:
    plant = ForeignPlant(ManyPlays(count=20))
    some = stretches(Trace("s", *scan_through_steps(plant, (*UP, 0.5), 0.2, (30, 40, 50), None)), Driver(100.0))
    assert [part.centre for part in some] == pytest.approx((*UP, 0.5), abs=1e-9)
    lines = np.array([len(part.means_nm) for part in some])
    assert np.all(np.abs(lines - (30, 40, 50)) <= 2)  # the first has no turn before it, the last none behind it
    assert [part.line.turn for part in some] == pytest.approx([0.5] * 3, abs=2e-3)
    assert [part.line.period_s for part in some] == pytest.approx([LINE_S] * 3, rel=2e-3)
    assert float(np.ptp(some[0].means_nm)) < 1e-6


@pytest.mark.parametrize(
    ("centres", "lines", "why"),
    [((0.5, 0.5), (30, 30), "no change of offset"), ((0.5, 0.7), (30, 10), "with 20 lines before and after it")],
)
def test_records_without_a_change_are_refused(centres: tuple[float, ...], lines: tuple[int, ...], why: str) -> None:
    plant = ForeignPlant(ManyPlays(count=20))
    with pytest.raises(Unphysical, match=why):
        stretches(Trace("s", *scan_through_steps(plant, centres, 0.2, lines, None)), Driver(100.0))


PLANTS = {"plays": ForeignPlant(ManyPlays()), "Bouc-Wen": ForeignPlant(BoucWen())}


@cache
def small_extent(name: str, centre: float) -> float:
    """nm of a small scan, to which m of (1) refers."""
    return float(np.ptp(PLANTS[name].settled(triangle(200, centre, 0.1), 100.0)))


def offset_law(name: str) -> Callable[[float], float]:
    """m of (1): the apparent size at a centre over that in the middle."""
    return lambda centre: small_extent(name, 0.5) / small_extent(name, centre)


@cache
def calibrated(name: str) -> tuple[Operator, BiasMemoryFit]:
    """An operator of six traces, and the memory of a record of 40 s up and one of 40 s down."""
    plant = PLANTS[name]
    traces = [Trace(f"{k}", *record(plant, *at, 100.0, k, samples=400)) for k, at in enumerate(SIX)]
    fitted = fit_operator([periodic_line(trace, V_MAX) for trace in traces], None, offset_law(name)).operator
    fitted = replace(fitted, creep=fitted.creep.down_to(0.01))
    steps = [scan_through_steps(plant, step, 0.2, (30, 4000), 20.0, noise_nm=0.5) for step in (UP, UP[::-1])]
    parts = [stretches(Trace("step", *step), Driver(V_MAX)) for step in steps]
    return fitted, fit_bias_memory(parts, fitted, offset_law(name))


def drifts(means_nm: Floats) -> Floats:
    """Drift of the second, third and fifth frame."""
    return np.array([means_nm[(k + 1) * FRAME] - means_nm[k * FRAME] for k in (1, 2, 4)])


@pytest.mark.common
@pytest.mark.parametrize("name", PLANTS)
@pytest.mark.parametrize("centres", [UP, UP[::-1]], ids=["up", "down"])
def test_frames_after_a_step_of_20_v_drift_as_predicted(name: str, centres: tuple[float, float]) -> None:
    fitted, late = calibrated(name)
    assert late.memory is not None
    truth = scan_through_steps(PLANTS[name], centres, 0.1, (30, 1600), 20.0)  # of another size
    measured = drifts(truth[2][30 * 20 :].reshape(1600, 20).mean(axis=1))
    lines = [SettledLine.about(0.1, at, 0.5, LINE_S) for at in centres]

    def predicted(memory: BiasMemory | None) -> Floats:
        after = transient_between(replace(fitted, bias_memory=memory), *lines, offset_law(name)(centres[1]))
        return drifts(after.off_nm(LINE_S, 1600, 0.0))

    assert float(np.max(np.abs(predicted(late.memory) - measured))) < 0.5
    assert float(np.max(np.abs(predicted(None) - measured))) > 3.0

    def in_time(memory: BiasMemory | None) -> Floats:
        at_main = offset_law(name)(fitted.centre)
        axis = OperatorInTime(replace(fitted, bias_memory=memory), lambda mean: offset_law(name)(mean) / at_main)
        moved = axis.position(truth[0], truth[1] / V_MAX, Start.LINE)
        return moved[30 * 20 :].reshape(1600, 20)

    lines_nm = in_time(late.memory)
    assert float(np.max(np.abs(drifts(lines_nm.mean(axis=1)) - measured))) < 0.4
    assert float(np.max(np.abs(drifts(in_time(None).mean(axis=1)) - measured))) > 2.7
    sizes = np.ptp(lines_nm, axis=1) / np.ptp(truth[2][30 * 20 :].reshape(1600, 20), axis=1)
    assert np.all(np.abs(sizes[5:] - 1.0) < {"plays": 0.06, "Bouc-Wen": 0.25}[name])  # as docs/operator.md says


@pytest.mark.parametrize("start", [Start.SETTLED, Start.LINE])
def test_a_memory_does_not_change_settled_lines(start: Start) -> None:
    model, without = REMEMBERING, replace(REMEMBERING, bias_memory=None)
    u = np.append(np.tile(0.5 + 0.2 * np.abs(np.arange(40) / 20.0 - 1.0), 60), 0.7)
    for first in (0, 13, 20):
        u = np.append(np.roll(u[:-1], -first), np.roll(u[:-1], -first)[0])
        t = 2.5e-4 * np.arange(len(u))
        one, other = (OperatorInTime(each, law_of_size).position(t, u, start) for each in (model, without))
        assert np.max(np.abs(one - other)) < 1e-9 * np.ptp(other)


def law_of_size(mean: float) -> float:
    return 1.0 - 0.1 * (mean - 0.5) + 0.04 * (mean - 0.5) ** 2


def law_of_family(mean: float) -> float:
    """Return the factor with which the sensitivity does not depend on the mean of the drive, beside its memory."""
    return operator().sensitivity(mean, 1.0)


def test_the_sensitivity_follows_by_share_and_time_of_either_direction() -> None:
    """Of lines whose offset goes up and down again: what is late is a share of the step, and decays."""
    model = replace(operator(), bias_memory=BiasMemory(0.2, 20.0, 0.1, 12.0))
    line = 0.05 * np.abs(np.arange(20) / 10.0 - 1.0)
    u = np.concatenate([np.tile(line + at, 3000) for at in (0.4, 0.6, 0.4)])
    t = 5e-4 * np.arange(len(u))
    y, settled = (OperatorInTime(one, law_of_family).position(t, u, Start.LINE) for one in (model, operator()))
    late = (settled - y).reshape(-1, 20).mean(axis=1)
    lines = settled.reshape(-1, 20).mean(axis=1)
    up, down = lines[5900] - lines[100], lines[8900] - lines[5900]
    assert np.max(np.abs(late[:2999])) < 1e-9
    assert late[3002] == pytest.approx(0.2 * up, rel=0.02)
    assert late[5000] / late[3002] == pytest.approx(np.exp(-1998 * LINE_S / 20.0), rel=1e-2)
    rest = 0.2 * up * np.exp(-1.5)  # the way up was not over
    assert late[6002] == pytest.approx(0.1 * (down + rest / 0.2), rel=0.02)
    assert late[8000] / late[6002] == pytest.approx(np.exp(-1998 * LINE_S / 12.0), rel=1e-2)


def test_a_drive_that_rests_is_followed_too() -> None:
    """Steps without lines: the position goes on by the share of a step, and creeps by no more."""
    model = replace(operator(), bias_memory=BiasMemory(0.2, 5.0, 0.1, 5.0))
    u = np.concatenate([np.full(100, 0.3), np.full(900, 0.6)])
    t = 0.1 * np.arange(1000)
    y, at_once = (OperatorInTime(one, law_of_family).position(t, u, Start.REST) for one in (model, operator()))
    step = at_once[-1] - at_once[0]
    assert at_once[100] - y[100] == pytest.approx(0.2 * step, rel=1e-6)
    assert at_once[150] - y[150] == pytest.approx(0.2 * step * np.exp(-1.0), rel=1e-6)
    assert y[-1] == pytest.approx(at_once[-1], abs=1e-4)


@pytest.mark.common
def test_the_command_writes_the_memory_and_builds_read_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    run("init", ".")
    plant = PLANTS["plays"]

    def write(name: str, columns: tuple[Floats, Floats, Floats]) -> str:
        with open(name, "w", newline="") as file:
            csv.writer(file).writerows([("time_s", "drive_v", "displacement_nm"), *zip(*columns, strict=True)])
        return name

    names = [write(f"{k}.csv", record(plant, *at, 100.0, k, samples=200)) for k, at in enumerate(SIX[1::2])]
    step = write("step.csv", scan_through_steps(plant, UP, 0.2, (30, 2500), 20.0, noise_nm=0.5))
    base = ("calibrate", "operator", "--axis", "x", *names, "--scanner", "scanner.toml", "--no-plot")
    done = run(*base, "--step", step, "--write", "--force")
    assert done.status == 0, done.err
    assert "% of a step up follow with" in done.out
    text = (tmp_path / "scanner_x_operator.toml").read_text("utf-8")
    assert "[bias_memory]\nrise_share = " in text
    fit = json.loads(run(*base, "--step", step, "--json").out)
    assert fit["bias_memory"]["rise_share"] == fit["bias_memory"]["fall_share"] > 0.1
    assert [one["file"] for one in fit["sources"]][-1] == "step.csv"
    with_memory = run("show", "annexin_200nm.toml", "--all", "--no-plot").out
    assert "may drift by up to" not in with_memory
    refused = run(*base, "--step", names[0])
    assert refused.status == 2
    assert f"{names[0]}: has no change of offset" in refused.err
