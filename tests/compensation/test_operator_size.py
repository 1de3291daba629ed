"""The size of a line whose turns are not even about the mean of its drive, against piezos that are moved."""

import numpy as np
import pytest
from foreign_plants import BoucWen, Core, ManyPlays, triangle
from hypothesis import given
from hypothesis import strategies as st

from tablegen.compensation.operator.creep import NO_CREEP
from tablegen.compensation.operator.family import Family
from tablegen.compensation.operator.field import Field, Lengths
from tablegen.compensation.operator.loop import POINTS, Loop
from tablegen.compensation.operator.operator import Operator
from tablegen.compensation.operator.plays import Plays
from tablegen.numerics.arrays import Floats
from tablegen.virtual.parameters import load_truth

NOTHING = Field(np.zeros((0, 2)), np.zeros((0, 42)), Lengths(1.0, 1.0, 1.0))
NO_SIZES = Field(np.zeros((0, 2)), np.zeros((0, 1)), Lengths(1.0, 1.0, 1.0))


@given(st.floats(0.2, 0.9), st.floats(-0.05, 0.05), st.floats(-0.4, 0.4), st.floats(0.0, 0.1))
def test_of_a_bent_line_with_even_hysteresis_the_bend_says_it(
    stroke: float, way: float, bend: float, width: float
) -> None:
    low, high = 0.5 + way - 0.5 * stroke, 0.5 + way + 0.5 * stroke
    u = np.linspace(low, high, POINTS)
    x = 2.0 * (u - low) / stroke - 1.0
    line = (u + bend * u * u - (low + bend * low * low)) / (stroke * (1.0 + bend * (low + high)))
    even = width * (1.0 - x * x)
    grown = Loop(low, high, line - even, line + even, 1.0).grown(0.5)
    # A line about 0.5 is larger or smaller by the slope of u + bend u^2, which is linear.
    assert grown == pytest.approx(2.0 * bend * way / (1.0 + 2.0 * bend * (0.5 + way)), abs=1e-6)


def moved(core: Core, centre: float, stroke: float) -> Floats:
    return core.settled(triangle(1024, centre, stroke) / 100.0)


@pytest.mark.parametrize("core", [ManyPlays(), BoucWen(), "default", "duhem"], ids=str)
def test_piezos_of_four_kinds_grow_about_as_their_bend_says(core: Core | str) -> None:
    """By less than 0.7 of it they are off, which is the uncertainty; without it they were by all."""
    axis = load_truth(core).x.hysteresis.operator() if isinstance(core, str) else core
    stroke, way = 0.85, -0.02
    here, there = moved(axis, 0.5, stroke), moved(axis, 0.5 + way, stroke)
    branches = there[:513], np.append(there[512:], there[0])[::-1]
    grid = np.linspace(0.0, 512.0, POINTS)
    extent = float(np.ptp(there))
    rising, falling = (np.interp(grid, np.arange(513), (one - there.min()) / extent) for one in branches)
    low = 0.5 + way - 0.5 * stroke
    predicted = Loop(low, low + stroke, rising, falling, extent).grown(0.5)
    grown = extent / float(np.ptp(here)) - 1.0
    assert abs(grown - predicted) < 0.7 * abs(predicted)
    assert abs(grown - predicted) < 0.7 * abs(grown)


def test_m_goes_with_the_mean_and_the_family_with_the_turns() -> None:
    """Nothing but a reversible bend: where m of (1) is flat, a sensitivity with the mean makes up for it."""
    family = Family(Plays(np.array([0.1]), np.zeros((1, 1)), np.array([1000.0, 200.0]), np.zeros((1, 4))))
    operator = Operator(family, NOTHING, NO_SIZES, NO_CREEP, 0.5, ())
    stroke, way = 0.8, 0.03
    low, high = 0.5 + way - 0.5 * stroke, 0.5 + way + 0.5 * stroke
    even, uneven = operator.loop(0.1, 0.9), operator.loop(low, high, 1.0, 0.5)
    assert even.extent_nm == pytest.approx(stroke * (1000.0 + 200.0))
    assert uneven.extent_nm == pytest.approx(stroke * (1000.0 + 200.0 * (low + high)), rel=2e-4)
    # About another offset, with turns that are even about it, m alone says how large it is.
    assert operator.loop(low, high).extent_nm == pytest.approx(even.extent_nm)
    assert operator.loop(low, high, 1.1).extent_nm == pytest.approx(even.extent_nm / 1.1)
