"""The laws of two scanner files in the same charts: size, offset, hysteresis, rate."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from tablegen.base.input_errors import Problems, Unphysical
from tablegen.charts.chart import POSITION, Chart, Mark
from tablegen.comparison.operators import SIDES
from tablegen.comparison.overlay import overlay
from tablegen.compensation import models
from tablegen.compensation.branches import WithBranches
from tablegen.compensation.frequency import frequency_gain
from tablegen.compensation.line import LineRequest, LineShape
from tablegen.compensation.model_problems import ModelProblems
from tablegen.compensation.offset import OffsetLaw
from tablegen.config.scanner import Scanner, ScannerAxis
from tablegen.numerics.arrays import Floats
from tablegen.numerics.driver import Driver
from tablegen.planning.laws import offset_surface, size_law_of

_POINTS = 201
_DECADES = (0.1, 10.0)  # about the rates at which the scanners were calibrated
_SIZES = (0.2, 1.0)  # of full scale, at which branches are drawn
Pair = tuple[Floats, Floats]


def law_charts(a: Scanner, b: Scanner) -> Iterator[Chart]:
    """Yield a chart of each law that both files have."""
    for axis in ("x", "y"):
        one, other = getattr(a, axis), getattr(b, axis)
        sides = (one, a.driver), (other, b.driver)
        size = [_size(*side) for side in sides]
        yield from _chart(f"size-{axis}", f"{axis} size", "V_scan [V]", "size [nm]", size)
        offset = [_offset(*side) for side in sides]
        yield from _chart(f"offset-{axis}", f"{axis} amplitude factor m, small scans", "V_offset [V]", "m", offset)
        if one.frequency is not None and other.frequency is not None:
            middle = [side.frequency.reference_hz for side in (one, other)]
            hz = np.geomspace(_DECADES[0] * min(middle), _DECADES[1] * max(middle), _POINTS)
            gains = [(hz, _gain(side, hz)) for side in (one, other)]
            yield from _chart(f"rate-{axis}", f"{axis} factor g", "rate [Hz]", "g", gains, log_x=True)
        yield from _branches(axis, a, b)


def _chart(
    key: str, title: str, x_label: str, y_label: str, both: list[Pair | None] | list[Pair], **more: object
) -> Iterator[Chart]:
    if all(curve is not None for curve in both):
        yield overlay(key, title, x_label, y_label, both[0], both[1], **more)


def _size(axis: ScannerAxis, driver: Driver) -> Pair | None:
    try:
        law = size_law_of(axis.size, driver)
    except Unphysical:
        return None
    v = np.linspace(0.0, 1.0, _POINTS)
    return driver.span * v, np.array([law.size_nm(one) if one else 0.0 for one in v.tolist()])


def _offset(axis: ScannerAxis, driver: Driver) -> Pair | None:
    try:
        small = (
            OffsetLaw()
            if axis.offset is None
            else offset_surface(axis.offset, driver, size_law_of(axis.size, driver)).small
        )
    except Unphysical:
        return None
    volts = np.linspace(driver.v_min, driver.v_max, _POINTS)
    return volts, np.array([small.factor(driver.p(one)) for one in volts.tolist()])


def _gain(axis: ScannerAxis, hz: Floats) -> Floats:
    law = axis.frequency
    assert law is not None
    gains = np.full(len(hz), np.nan)
    for i, one in enumerate(hz.tolist()):
        try:
            gains[i] = frequency_gain(one, law.alpha, law.reference_hz)
        except Unphysical:
            continue
    return gains


def _branches(axis: str, a: Scanner, b: Scanner) -> Iterator[Chart]:
    """Draw the branches of a small line and of one of full scale, at a turn that both files have."""
    tables = [getattr(side, axis).hysteresis for side in (a, b)]
    if not all(isinstance(table, WithBranches) and table.branches for table in tables):
        return
    turns = [{branch.turn for branch in table.branches} for table in tables]
    for turn in sorted(turns[0] & turns[1]):
        for share in _SIZES:
            shapes = [_shape(axis, side, turn, share) for side in (a, b)]
            for side in SIDES:
                curves = [None if shape is None else _bent(shape, side) for shape in shapes]
                key = f"branch-{axis}-{turn:g}-{100 * share:.0f}-{side}"
                title = f"{axis} {side} at turn {turn:g}, {100 * share:.0f} % of full scale"
                label = "drive less line [% of V_scan]"
                yield from _chart(key, title, POSITION, label, curves, marks=(Mark(0.0, "", "y"),))


def _shape(axis: str, scanner: Scanner, turn: float, share: float) -> LineShape | None:
    """Return the line of a model that works with branches; an operator's table has them too, for its laws."""
    table = getattr(scanner, axis).hysteresis
    if table.identified:
        laws = models.laws_beside(table)
        table = None if laws is None else laws.like(table)
    problems = Problems()
    request = LineRequest(
        axis=axis,
        turn=turn,
        v=share,
        driver=scanner.driver,
        v_amplitude=share * scanner.driver.span,
        v_offset=scanner.driver.middle,
        size_nm=1.0,
        rate_hz=1.0,
        harmonics=1,
        window=(0.1, 0.9),
        both=True,
        response=None,
        max_boost_db=0.0,
        factor_at=lambda _: 1.0,
        rate_gain=None,
        folder=Path(),
    )
    line = None if table is None else table.line(request, ModelProblems.without_files(axis, problems))
    return None if problems.entries else line


def _bent(shape: LineShape, side: str) -> Pair:
    x = np.linspace(0.0, 1.0, _POINTS)
    return x, 100.0 * (shape.value(shape.times(side, x)) - x)
