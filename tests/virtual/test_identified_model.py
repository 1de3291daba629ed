"""A model of another package that was identified on traces: it is simulated and reported as the operator is."""

from dataclasses import dataclass
from typing import ClassVar

import msgspec
import numpy as np
import pytest
from editing import EXAMPLES

from tablegen.base.input_errors import Unphysical
from tablegen.compensation.dynamics import Response
from tablegen.compensation.identification import Identification, MeasuredLine
from tablegen.compensation.line import LineRequest, LineShape, WholeLine
from tablegen.compensation.model import Hysteresis
from tablegen.compensation.model_problems import ModelProblems
from tablegen.config.load import Setup, load
from tablegen.html_report.basis import _traces
from tablegen.html_report.playing import played_axes
from tablegen.html_report.subject import PlannedScan
from tablegen.numerics.arrays import Floats
from tablegen.numerics.driver import Driver
from tablegen.planning.line_plan import make_plan
from tablegen.virtual.own_run import SEEDS, own_axes, simulate_own
from tablegen.waveform.window_fit import fit_window

TRACE = MeasuredLine("trace.csv", 0.2, 0.5, 100.0, (0.1, 1.0, 0.2, 0.3), (0.0, 0.0, 0.0, 0.0))


@dataclass(frozen=True)
class Linear:
    """A piezo without hysteresis, of so many nm per volt."""

    nm_per_v: float

    def settled(self, volts: Floats, tick_s: float) -> Floats:
        return self.nm_per_v * volts


class LinearPiezo(Identification, frozen=True, kw_only=True, eq=False):
    nm_per_v: float

    def piezo(self, driver: Driver, response: Response | None, seed: tuple[int, ...] | None = None) -> Linear:
        share = 0.0 if seed is None else 0.01 * float(np.random.default_rng(seed).standard_normal())
        return Linear(self.nm_per_v * (1.0 + share))


class Straight:
    """A triangle, to which a window is fitted."""

    def __init__(self, turn: float) -> None:
        self.turn = turn

    def value(self, t: Floats) -> Floats:
        return np.where(t <= self.turn, t / self.turn, (1.0 - t) / (1.0 - self.turn))

    def slope(self, t: Floats) -> Floats:
        return np.where(t <= self.turn, 1.0 / self.turn, -1.0 / (1.0 - self.turn))


class Identified(Hysteresis, frozen=True, tag="identified"):
    identified: ClassVar[bool] = True
    played: bool = True

    def line(self, request: LineRequest, problems: ModelProblems) -> LineShape:
        series = fit_window(Straight(request.turn), request.harmonics, request.window, request.both)
        nothing = Identification(traces=(TRACE,))
        linear = LinearPiezo(traces=(TRACE,), nm_per_v=request.size_nm / request.v_amplitude)
        return WholeLine.of(series, request.turn, identification=linear if self.played else nothing)


def setup_of(model: Identified) -> Setup:
    setup = load(EXAMPLES / "annexin_200nm.toml")
    x = msgspec.structs.replace(setup.scanner.x, hysteresis=model, resonance=None)
    return msgspec.structs.replace(setup, scanner=msgspec.structs.replace(setup.scanner, x=x))


@pytest.mark.common
def test_it_is_simulated_on_its_own_piezo() -> None:
    setup = setup_of(Identified())
    assert own_axes(setup) == ("x",)
    (run,) = simulate_own(setup, 0)
    assert run.traces == (TRACE,)
    plain, laws, own = run.rows
    assert [row.correction for row in run.rows] == ["uncompensated", "laws", "identified"]
    assert "no branches" in laws.rejected
    assert len(own.errors) == len(plain.errors) == SEEDS
    assert own.summary()["mismatch"][1] < 0.1
    assert 0.1 < abs(own.summary()["size"][1]) < 5.0  # by the departures


def test_it_is_reported_by_its_traces_and_its_piezo() -> None:
    setup = setup_of(Identified())
    plan = make_plan(setup)
    (grid,) = _traces(plan.x)
    assert [one.text for one in grid.rows[0][:2]] == ["trace.csv", "20"]
    x, y = played_axes(PlannedScan(setup, plan, {}))
    assert (x.on_operator, y.on_operator) == (True, False)


def test_a_model_without_a_piezo_is_refused_by_its_name() -> None:
    with pytest.raises(Unphysical, match="x: the identified model gives neither traces nor a piezo"):
        simulate_own(setup_of(Identified(played=False)), 0)
