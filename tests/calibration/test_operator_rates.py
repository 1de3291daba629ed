"""One operator for all rates: turns of fast traces, creep against (23), and a trace at 1 kHz beside ten at 100 Hz."""

from pathlib import Path

import numpy as np
import pytest
from editing import SCAN, SCANNER, edited
from foreign_plants import MODES, TEN, BoucWen, ForeignPlant, JilesAtherton, ManyPlays, record, triangle
from replacing import replace
from sets import LONG_TEST
from test_operator_fit import Response, factor_of, identified

from tablegen.calibration.laws.hysteresis import Trace
from tablegen.calibration.operator.file_of_fit import operator_file
from tablegen.calibration.operator.fit import fit_operator
from tablegen.calibration.operator.periodic_line import PeriodicLine, periodic_line
from tablegen.calibration.operator.turns import with_turns
from tablegen.compensation.operator.creep import LogarithmicCreep
from tablegen.compensation.operator.loop import Loop
from tablegen.compensation.operator.plays import NO_PLAYS
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
    fit = fit_operator([*traces, fast(piezo, 1000.0)], Response(piezo), factor_of(piezo))
    piezo.dynamics = lambda f_hz: np.ones(len(f_hz), dtype=np.complex128)  # type: ignore[method-assign]
    for rate_hz in (100.0, 1000.0):
        for stroke in (0.15, 0.35, 0.55, 0.75):
            loop = fit.operator.loop(0.5 - 0.5 * stroke, 0.5 + 0.5 * stroke)
            true = float(np.ptp(piezo.settled(triangle(2000, 0.5, stroke), rate_hz)))
            assert abs(extent(fit.operator.creep, loop, rate_hz) / true - 1.0) < 3e-3


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
    _, fit = identified(BoucWen, TEN)

    def volts(*changes: str, straight: bool = False) -> Floats:
        kept = fit
        if straight:  # of no family, from traces of one rate
            family = replace(fit.operator.family, plays=replace(NO_PLAYS, reversible=np.array([1000.0])), bouc_wen=None)
            kept = replace(fit, operator=replace(fit.operator, family=family))
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
