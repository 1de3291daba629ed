"""How far a prediction may be off: of settled lines as a build states it, and more on ways between lines."""

import numpy as np
import pytest
from replacing import replace
from test_operator_uncertainty import SIX, lines
from test_operator_waveform import operator

from tablegen.compensation.operator.in_time import OperatorInTime, Start
from tablegen.compensation.operator.operator import Operator
from tablegen.compensation.operator.prediction_uncertainty import possible_prediction_errors
from tablegen.compensation.operator.uncertainty import possible_errors
from tablegen.numerics.arrays import Floats

ERRORS = [(0.05, 1.0, 0.1, 0.3)] * 6
LINE = np.concatenate([np.linspace(0.2, 0.7, 50, endpoint=False), np.linspace(0.7, 0.2, 51)])
INNER = np.concatenate(
    [LINE, np.linspace(0.2, 0.5, 30), np.linspace(0.5, 0.3, 30), np.linspace(0.3, 0.7, 30), LINE[50:]]
)


def traced() -> Operator:
    """An operator of six settled traces."""
    return replace(operator(), lines=tuple(lines(SIX, [*ERRORS])))


def bounds(model: Operator, u: Floats, start: Start) -> Floats:
    return possible_prediction_errors(model, u, OperatorInTime(model).hysteresis(u, start), start)


@pytest.mark.parametrize("misfit", [None, 0.2])
def test_a_settled_line_is_as_uncertain_as_in_a_build(misfit: float | None) -> None:
    model = replace(traced(), misfit_percent=misfit)
    rms, _, _, size = possible_errors(model, 0.5, 0.45)
    nm = float(np.ptp(OperatorInTime(model).hysteresis(LINE)))
    stated = bounds(model, LINE, Start.SETTLED)
    assert stated == pytest.approx(np.full(len(LINE), 0.01 * nm * np.hypot(rms, 0.5 * size)), rel=1e-12)


def test_ways_between_lines_and_starts_from_rest_are_less_certain() -> None:
    model = traced()
    settled, rest = (bounds(model, INNER, start) for start in (Start.SETTLED, Start.REST))
    inside = slice(len(LINE) + 30, len(LINE) + 55)  # from 0.5 to 0.3
    assert np.all(settled[inside] > 2.0 * settled[20])
    assert np.all(rest > settled)
    assert rest[20] > 1.5 * settled[20]


def test_records_in_time_know_the_ways_between_lines() -> None:
    """Their misfit contains them, so that a start from rest is no reason to state more."""
    model = replace(traced(), misfit_percent=0.2)
    settled, rest = (bounds(model, INNER, start) for start in (Start.SETTLED, Start.REST))
    assert np.all(rest < 1.1 * settled)
    assert np.all(bounds(replace(model, misfit_percent=5.0), INNER, Start.REST) > 2.0 * rest)


def test_a_drive_that_rests_has_the_uncertainty_of_the_widest_line() -> None:
    model = replace(traced(), misfit_percent=0.2)
    u = np.append(LINE, np.full(200, LINE[-1]))
    stated = bounds(model, u, Start.REST)
    assert stated[-1] == pytest.approx(stated[20], rel=1e-12)
