"""One operator for all rates: turns of fast traces, creep against (23), and loops that depend on the rate."""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from editing import SCAN, SCANNER, edited
from foreign_plants import (
    MODES,
    SIX,
    TEN,
    BoucWen,
    ForeignPlant,
    JilesAtherton,
    ManyPlays,
    RateDependentPlant,
    record,
    triangle,
)
from hypothesis import given, settings
from hypothesis import strategies as st
from replacing import replace
from sets import LONG_TEST
from test_operator_fit import Response, factor_of, identified

from tablegen.calibration.laws.hysteresis import Trace
from tablegen.calibration.operator import fit, plays_fit
from tablegen.calibration.operator.file_of_fit import operator_file
from tablegen.calibration.operator.fit import fit_operator
from tablegen.calibration.operator.periodic_line import PeriodicLine, periodic_line
from tablegen.calibration.operator.response_check import response_remarks
from tablegen.calibration.operator.turns import with_turns
from tablegen.compensation.dynamics import Response as Dynamics
from tablegen.compensation.dynamics import SecondOrder
from tablegen.compensation.operator.creep import LogarithmicCreep
from tablegen.compensation.operator.file import read_operator
from tablegen.compensation.operator.loop import Loop
from tablegen.compensation.operator.operator import Operator
from tablegen.compensation.operator.plays import NO_PLAYS
from tablegen.compensation.operator.settled import settled
from tablegen.compensation.operator.uncertainty import possible_errors
from tablegen.config.load import load
from tablegen.numerics.arrays import Floats
from tablegen.planning.line_plan import make_plan
from tablegen.virtual.played import played

PLANTS = {"plays": ManyPlays, "Bouc-Wen": BoucWen, "Jiles-Atherton": JilesAtherton}


def fast(plant: ForeignPlant, rate_hz: float, seed: int = 99, turn: float = 0.5) -> PeriodicLine:
    return periodic_line(Trace("fast.csv", *record(plant, 0.5, 0.3, rate_hz, seed, turn)), 100.0)


@pytest.mark.common
@pytest.mark.parametrize("turn", [0.5, 0.7])
@pytest.mark.parametrize("plant", PLANTS)
def test_the_size_of_a_fast_trace_is_that_without_the_dynamics(plant: str, turn: float) -> None:
    piezo = ForeignPlant(PLANTS[plant]())
    measured, response = fast(piezo, 1000.0, turn=turn), Response(piezo)
    piezo.dynamics = lambda f_hz: np.ones(len(f_hz), dtype=np.complex128)  # type: ignore[method-assign]
    true = float(np.ptp(piezo.settled(triangle(1000, 0.5, 0.3, turn), 1000.0)))
    bare = measured.without(response, None)
    mended = with_turns(bare, measured.highest_corrected_hz(response))
    assert abs(mended.span_nm / true - 1.0) < 1e-3
    assert abs(bare.span_nm / true - 1.0) > 5e-3  # the control: harmonics above a third of the resonance bend the turns


def test_rounded_turns_stay_as_they_are() -> None:
    piezo = ForeignPlant(BoucWen())
    time = np.arange(5000) / 1e6
    volts = 50.0 - 15.0 * np.cos(2.0 * np.pi * 1000.0 * time)
    moved = np.tile(piezo.settled(volts[:1000], 1000.0), 5)
    line = periodic_line(Trace("sine.csv", time, volts, moved), 100.0)
    bare = line.without(Response(piezo), None)
    assert with_turns(bare, 0.3 * MODES[0][0]) is bare


@pytest.mark.parametrize("plant", [pytest.param(name, marks=LONG_TEST if name != "plays" else ()) for name in PLANTS])
@pytest.mark.rest
def test_a_trace_at_another_rate_moves_no_size(plant: str) -> None:
    """Sizes between the traces, of the loops with the creep of the operator, at 100 Hz and at 1 kHz."""
    piezo = ForeignPlant(PLANTS[plant]())
    traces = [
        periodic_line(Trace(f"{number}.csv", *record(piezo, *each, seed=number)), 100.0)
        for number, each in enumerate(TEN)
    ]
    operator = fit_operator([*traces, fast(piezo, 1000.0)], Response(piezo), factor_of(piezo)).operator
    piezo.dynamics = lambda f_hz: np.ones(len(f_hz), dtype=np.complex128)  # type: ignore[method-assign]
    for rate_hz in (100.0, 1000.0):
        for stroke in (0.15, 0.35, 0.55, 0.75):
            loop = operator.at_rate(rate_hz).loop(0.5 - 0.5 * stroke, 0.5 + 0.5 * stroke)
            true = float(np.ptp(piezo.settled(triangle(2000, 0.5, stroke), rate_hz)))
            assert abs(extent(operator.creep, loop, rate_hz) / true - 1.0) < 3e-3


def extent(creep: LogarithmicCreep, loop: Loop, rate_hz: float) -> float:
    """The stroke of a triangle on a loop, behind creep."""
    half = 500
    u = loop.low + (loop.high - loop.low) * np.linspace(0.0, 1.0, half, endpoint=False)
    down = loop.low + loop.high - u
    position = loop.extent_nm * np.concatenate([loop.position(u, True), loop.position(down, False)])
    spectrum = np.fft.rfft(position)
    real, imaginary = creep.response(rate_hz * np.arange(1.0, len(spectrum)))
    spectrum[1:] *= real + 1j * imaginary
    return float(np.ptp(np.fft.irfft(spectrum, len(position))))


@pytest.mark.rest
def test_creep_gives_the_size_at_other_rates_and_equation_23_where_it_is_uncertain(tmp_path: Path) -> None:
    _, found = identified(BoucWen, TEN)

    def volts(*changes: str, straight: bool = False) -> Floats:
        kept = found
        if straight:  # of no family, from traces of one rate
            family = replace(
                found.operator.family, plays=replace(NO_PLAYS, reversible=np.array([1000.0])), bouc_wen=None
            )
            kept = replace(found, operator=replace(found.operator, family=family))
        (tmp_path / "x_operator.toml").write_bytes(operator_file(kept, "x", 100.0))
        table = '+ [x.hysteresis]\nmodel = "operator"\nfile = "x_operator.toml"'
        scanner = edited(SCANNER, "- [x.hysteresis]", "- [[x.hysteresis.branches]]", *changes, table)
        (tmp_path / "scanner.toml").write_text(scanner, "utf-8")
        (tmp_path / "scan.toml").write_text(edited(SCAN, "timing.line_rate_hz = 400.0", "- [limits]"), "utf-8")
        return played(make_plan(load(tmp_path / "scan.toml")).x, 1 << 10).volts

    def moved(straight: bool) -> float:
        one, other = volts(straight=straight), volts("x.frequency.alpha = 0.08", straight=straight)
        return float(np.max(np.abs(one - other)) / np.ptp(one))

    assert moved(straight=False) < 1e-3
    assert moved(straight=True) > 5e-3


ONE_FAST = ((0.3, 1000.0),)
THREE_FAST = ((0.2, 1000.0), (0.5, 1000.0), (0.8, 1000.0))
RATES_HZ = (100.0, 300.0, 1000.0)


def fitted(plant: ForeignPlant, fast_lines: Sequence[tuple[float, float]]) -> Operator:
    """Of six strokes at 100 Hz, and of others at another rate."""
    lines = [*((*each, 100.0) for each in SIX), *((0.5, *each) for each in fast_lines)]
    traces = [Trace(f"{i}.csv", *record(plant, *each, seed=i)) for i, each in enumerate(lines)]
    periods = [periodic_line(trace, 100.0) for trace in traces]
    return fit_operator(periods, Response(plant), factor_of(plant)).operator


def left_of(plant: ForeignPlant, operator: Operator) -> tuple[float, float]:
    """The largest rms of what a settled line leaves of the plant's, and of the size, in percent; without dynamics."""
    plant.dynamics = lambda f_hz: np.ones(len(f_hz), dtype=np.complex128)  # type: ignore[method-assign]
    left = []
    for rate_hz in RATES_HZ:
        at_rate = operator.at_rate(rate_hz)
        for stroke in (0.15, 0.35, 0.55, 0.75):
            volts = triangle(2000, 0.5, stroke)
            true = plant.settled(volts, rate_hz)
            loop = at_rate.loop(0.5 - 0.5 * stroke, 0.5 + 0.5 * stroke)
            model = settled(loop, volts / 100.0, rate_hz, operator.creep, None)
            scale = float(np.polyfit(model, true, 1)[0])
            rest = true - np.mean(true) - scale * (model - np.mean(model))
            left.append((100.0 * float(np.std(rest) / np.ptp(true)), 100.0 * abs(np.ptp(model) / np.ptp(true) - 1.0)))
    rms, size = np.max(left, axis=0).tolist()
    return rms, size


@pytest.mark.long
@pytest.mark.timeout(86_400)
def test_plays_that_grow_with_the_rate_are_found_from_one_fast_trace(monkeypatch: pytest.MonkeyPatch) -> None:
    """Thresholds that are a tenth larger at 1 kHz; the control is without them: 0.2 % rms, 0.24 % of the size."""
    plant = RateDependentPlant(ManyPlays())
    operator = fitted(plant, ONE_FAST)
    rms, size = left_of(plant, operator)
    assert rms < 0.03
    assert size < 0.1
    assert operator.family.plays.growth == pytest.approx(np.log10(1.1), abs=0.005)
    del plant.dynamics  # type: ignore[misc]
    monkeypatch.setattr(plays_fit, "_WORTH_GROWTH", 0.0)
    assert left_of(plant, fitted(plant, ONE_FAST))[0] > 0.1


@pytest.mark.rest
def test_plays_that_do_not_grow_have_no_growth() -> None:
    """It would take a part of the creep: the drift after a step would be 4 % wrong by 0.5 % of growth."""
    operator = fitted(ForeignPlant(ManyPlays()), ONE_FAST)
    assert operator.family.plays.growth == 0.0
    assert operator.creep.loss_per_decade == pytest.approx(0.026, abs=0.001)


@pytest.mark.parametrize(
    ("core", "number", "growth"),
    [
        pytest.param(BoucWen, "depth", 0.1),
        pytest.param(BoucWen, "beta", -0.2, marks=LONG_TEST),
        pytest.param(JilesAtherton, "pinning", 0.2, marks=LONG_TEST),
    ],
)
@pytest.mark.rest
def test_the_field_follows_other_loops_from_three_fast_traces(
    core: type, number: str, growth: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Loops that grow in another way than plays do; the control is without a share of the field for the rate."""
    plant = RateDependentPlant(core(), number=number, growth=growth)
    rms, size = left_of(plant, fitted(plant, THREE_FAST))
    assert rms < 0.03
    assert size < 0.15
    del plant.dynamics  # type: ignore[misc]
    monkeypatch.setattr(fit, "_RATE_SHARE", 0.0)
    assert left_of(plant, fitted(plant, THREE_FAST))[0] > 0.1


@pytest.mark.rest
def test_a_file_keeps_the_rate(tmp_path: Path) -> None:
    plant = RateDependentPlant(ManyPlays(count=40))
    lines = [(0.5, 0.2, 100.0), (0.5, 0.9, 100.0), (0.5, 0.4, 1000.0)]
    periods = [periodic_line(Trace(f"{i}.csv", *record(plant, *each, seed=i)), 100.0) for i, each in enumerate(lines)]
    found = fit_operator(periods, Response(plant), factor_of(plant))
    # So that both are in the file, whichever family was chosen.
    plays = replace(found.operator.family.plays, growth=0.05)
    found = replace(found, operator=replace(found.operator, family=replace(found.operator.family, plays=plays)))
    (tmp_path / "x_operator.toml").write_bytes(operator_file(found, "x", 100.0))
    read, _ = read_operator(tmp_path / "x_operator.toml", "x_operator.toml")
    for rate_hz in RATES_HZ:
        ours, its = (one.at_rate(rate_hz) for one in (found.operator, read))
        assert its.residual.at(0.5, 0.5) == pytest.approx(ours.residual.at(0.5, 0.5), rel=1e-6, abs=1e-9)
        assert its.loop(0.2, 0.8).extent_nm == pytest.approx(ours.loop(0.2, 0.8).extent_nm, rel=1e-6)
        assert its.family.plays.stretch == pytest.approx(10.0 ** (0.05 * np.log10(rate_hz / read.creep.reference_hz)))
    assert read.at_rate(100.0).loop(0.2, 0.8).extent_nm != read.at_rate(1000.0).loop(0.2, 0.8).extent_nm
    assert read.at_rate(1e3).at_rate(1e2).family.plays.stretch == read.at_rate(1e2).family.plays.stretch
    # A decade beyond the measured rates nothing grows further, and the uncertainty is larger than between them.
    assert read.at_rate(1e6).family.plays.stretch == read.at_rate(1e4).family.plays.stretch
    far, near = (possible_errors(read.at_rate(rate_hz), 0.4, 0.5)[0] for rate_hz in (1e4, 1e3))
    assert far > near


@pytest.mark.common
def test_a_family_that_leaves_much_to_the_field_does_not_know_rates() -> None:
    _, found = identified(BoucWen, TEN)
    assert found.operator.knows_rates
    residual = found.operator.residual
    assert not replace(found.operator, residual=replace(residual, weights=100.0 * residual.weights)).knows_rates


@pytest.mark.common
def test_traces_of_one_rate_serve_all_rates_alike() -> None:
    _, found = identified(BoucWen, TEN)
    assert found.operator.at_rate(5000.0) is found.operator
    assert found.operator.residual.lengths.rate_share == 0.0


def response_doubts(plant: ForeignPlant, response: Dynamics, rate_hz: float, samples: int) -> tuple[str, ...]:
    trace = Trace("a.csv", *record(plant, 0.5, 0.65, rate_hz, seed=3, samples=samples))
    return response_remarks([periodic_line(trace, 100.0)], response)


@pytest.mark.common
@given(
    st.sampled_from([BoucWen, JilesAtherton]),
    st.floats(1.0, 3000.0),
    st.integers(60, 1000),
    st.floats(0.2, 0.8),
)
@settings(max_examples=10, deadline=None)
def test_the_response_of_the_piezo_is_not_doubted(core: type, rate_hz: float, samples: int, turn: float) -> None:
    plant = ForeignPlant(core())
    trace = Trace("a.csv", *record(plant, 0.5, 0.4, rate_hz, seed=3, samples=samples, turn=turn))
    line = periodic_line(trace, 100.0)
    for response in (Response(plant), SecondOrder(60e3, 14.0, 2e-6), SecondOrder(60e3, 5.0)):
        assert response_remarks([line], response) == ()


@pytest.mark.common
@pytest.mark.parametrize(
    ("resonance_hz", "rate_hz", "samples"),
    [(2e3, 100.0, 200), (8e3, 100.0, 1000), (8e3, 1000.0, 200), (45e3, 1e3, 1000)],
)
def test_the_response_of_another_piezo_is_named(resonance_hz: float, rate_hz: float, samples: int) -> None:
    plant = ForeignPlant(BoucWen())
    (doubt,) = response_doubts(plant, SecondOrder(resonance_hz, 20.0), rate_hz, samples)
    found = re.fullmatch(
        r"a.csv: at (\S+) Hz the axis moved (\S+) times as much as the response of the scanner file says; it is of "
        "another piezo, or the recorder has a filter",
        doubt,
    )
    assert found
    f_hz, times = map(float, found.groups())
    (true,) = np.abs(plant.dynamics(np.array([f_hz])))
    real, imaginary = SecondOrder(resonance_hz, 20.0).inverse(np.array([f_hz]))
    assert times == pytest.approx(true * np.hypot(real, imaginary)[0], rel=0.6)


@pytest.mark.common
def test_a_filter_of_the_recorder_is_named_and_a_sine_says_nothing() -> None:
    plant = ForeignPlant(BoucWen())
    sharp, slow = Response(plant), plant.dynamics
    plant.dynamics = lambda f_hz: slow(f_hz) / (1.0 + 1j * f_hz / 1e3)  # type: ignore[method-assign]
    sharp.inverse = SecondOrder(60e3, 14.0).inverse  # type: ignore[method-assign]
    assert response_doubts(plant, sharp, 100.0, 1000)
    time = np.arange(5000) / 1e5
    volts = np.tile(50.0 - 30.0 * np.cos(2.0 * np.pi * np.arange(1000) / 1000.0), 5)
    line = periodic_line(Trace("sine.csv", time, volts, np.tile(plant.settled(volts[:1000], 100.0), 5)), 100.0)
    assert response_remarks([line], SecondOrder(2e3, 20.0)) == ()
