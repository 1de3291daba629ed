"""Results of the virtual scanner, computed once: emitted integers at full scale, triangles, calibrations."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import msgspec
import numpy as np
from msgspec.structs import replace

from paper.printed_numbers import SECTION_8, default_x, played_line
from tablegen.calibration.laws.hysteresis import HysteresisFit, Trace, fit_hysteresis
from tablegen.calibration.operator.file_of_fit import operator_file
from tablegen.calibration.operator.fit import OperatorFit, fit_operator
from tablegen.calibration.operator.periodic_line import periodic_line
from tablegen.compensation.branch import Branch
from tablegen.compensation.branches import Branches
from tablegen.compensation.hysteresis import BranchShape
from tablegen.compensation.line import LineShape
from tablegen.compensation.models.operator import OperatorModel
from tablegen.compensation.models.sinusoidal import SinusoidalModel
from tablegen.config.load import load
from tablegen.numerics.arrays import Floats
from tablegen.planning.line_plan import make_plan
from tablegen.virtual.experiments import triangle_size
from tablegen.virtual.line_error import LineError, about_window_line, ideal_triangle, line_error
from tablegen.virtual.played import PlayedDrive, played
from tablegen.virtual.scanner import VirtualAxis
from tablegen.virtual.simulation import with_model

SCAN = Path(__file__).parent / "full_scale.toml"
V_MAX, MIDDLE_V = 100.0, 50.0
RATE_HZ = 100.0  # where the virtual scanner's gain is 1
VELOCITY_NM_PER_S = 100e3  # section 9
TICKS = 8000
OPERATOR_V = (10.0, 25.0, 45.0, 65.0, 82.0, 100.0)  # traces of the operator
GROWTH_V = tuple(float(v) for v in range(10, 101, 10))  # sizes of figure 5k, peak to peak


@dataclass(frozen=True, eq=False)
class Played:
    """A line of full scale: what was put out, where the virtual scanner went, and its errors against the triangle."""

    drive: PlayedDrive
    displacement_nm: Floats
    error: LineError


@cache
def axis() -> VirtualAxis:
    """The fast axis of the default virtual scanner."""
    return default_x()


@cache
def full_scale(model: str) -> Played:
    """Figures 5a to 5j: 100 V, every tick an emitted 16-bit integer."""
    setup = load(SCAN)
    if model == SinusoidalModel.model():
        forward, backward = (Branch(beta_max=beta, rho=1.0) for beta in optimised())
        branches = [Branches(turn=0.5, forward=forward, backward=backward)]
        x = msgspec.structs.replace(setup.scanner.x, hysteresis=SinusoidalModel(branches=branches))
        setup = replace(setup, scanner=msgspec.structs.replace(setup.scanner, x=x))
    drive = played(make_plan(with_model(setup, model)).x)
    moved = axis().settled(drive.volts, drive.tick_s)
    return Played(drive, moved, line_error(moved, 0.5, first=0.5))


@cache
def optimised() -> tuple[float, float]:
    """The beta of (15), forward and backward, that leave the least peak residual: the paper does not print its own."""
    tried = np.arange(61) * 5e-4
    found = []
    for forward, backward in zip(0.02 + tried, 0.065 + tried, strict=True):
        shape = LineShape(0.5, BranchShape.sinusoidal(float(forward)), BranchShape.sinusoidal(float(backward)))
        error = played_line(axis(), shape.value(np.arange(4000) / 4000), V_MAX)
        found.append([abs(branch.peak[0]) for branch in (error.forward, error.backward)])
    best = np.argmin(np.array(found), axis=0)
    return float(round(0.02 + tried[best[0]], 6)), float(round(0.065 + tried[best[1]], 6))


@cache
def operator() -> OperatorFit:
    """``tablegen calibrate operator`` on settled triangles, without noise."""
    time = np.arange(2 * TICKS) / (TICKS * RATE_HZ)
    lines = []
    for v in OPERATOR_V:
        volts = MIDDLE_V + v * (ideal_triangle(TICKS, 0.5) - 0.5)
        moved = axis().settled(volts, 1.0 / (RATE_HZ * TICKS))
        lines.append(periodic_line(Trace(f"{v:g} V", time, np.tile(volts, 2), np.tile(moved, 2)), V_MAX))
    return fit_operator(lines, None, lambda _: 1.0)


def sizes_by_operator(sizes_v: Floats) -> Floats:
    """Nanometres between the turns of triangles, as the operator has them."""
    low, high = (MIDDLE_V + sign * 0.5 * sizes_v for sign in (-1.0, 1.0))
    loops = [operator().operator.loop(*ends) for ends in zip(low / V_MAX, high / V_MAX, strict=True)]
    return np.array([loop.extent_nm for loop in loops])


@cache
def by_operator() -> LineError:
    """The same line on the operator.

    Its turnarounds are rounded; so the errors are about the best line through both windows.
    """
    setup = load(SCAN)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "operator.toml"
        path.write_bytes(operator_file(operator(), "x", V_MAX))
        x = msgspec.structs.replace(setup.scanner.x, hysteresis=OperatorModel(file=str(path)))
        drive = played(make_plan(replace(setup, scanner=msgspec.structs.replace(setup.scanner, x=x))).x)
    return about_window_line(line_error(axis().settled(drive.volts, drive.tick_s), 0.5, first=0.5))


def modelled(shape: LineShape) -> LineError:
    """The error that a drive leaves on a piezo that follows (17) with section 8's parameters: no simulation."""
    t = np.arange(TICKS) / TICKS
    w = shape.value(t)
    forward, backward = SECTION_8.forward.inverse(w), 1.0 - SECTION_8.backward.inverse(1.0 - w)
    return line_error(np.where(t <= 0.5, forward, backward), 0.5)


def matched_rate(size_v: float, turn: float = 0.5) -> float:
    """Line rate in Hz at which the forward scan has section 9's velocity."""
    return VELOCITY_NM_PER_S * turn / triangle_size(axis(), size_v, MIDDLE_V, RATE_HZ)


@cache
def triangle(size_v: float, turn: float = 0.5) -> LineError:
    """A settled triangle or sawtooth of a size in V, at section 9's velocity."""
    drive = MIDDLE_V + size_v * (ideal_triangle(TICKS, turn) - 0.5)
    return line_error(axis().settled(drive, 1.0 / (matched_rate(size_v, turn) * TICKS)), turn)


@cache
def calibrated() -> HysteresisFit:
    """``tablegen calibrate hysteresis`` on two settled periods of these triangles, without noise."""
    time = np.arange(2 * TICKS) / TICKS
    triangles = []
    for v in GROWTH_V:
        volts = MIDDLE_V + v * (ideal_triangle(TICKS, 0.5) - 0.5)
        moved = axis().settled(volts, 1.0 / (matched_rate(v) * TICKS))
        triangles.append(Trace(f"{v:g} V", time / matched_rate(v), np.tile(volts, 2), np.tile(moved, 2)))
    return fit_hysteresis(triangles, V_MAX, settle_periods=0, drift_order=0)
