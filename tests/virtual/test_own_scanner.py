"""The scanner file's own operator as the virtual scanner: it is that operator, and wrong by what it is uncertain."""

from pathlib import Path

import numpy as np
import pytest
from editing import edited
from operator_files import REVERSIBLE, STROKES, THRESHOLDS, WEIGHTS, operator_file, write_operator_scan
from replacing import replace

from tablegen.base.input_errors import Unphysical
from tablegen.certificate.converter_errors import converter_errors
from tablegen.certificate.expected import expected_of
from tablegen.certificate.line_errors import EmittedPeriod
from tablegen.compensation.dynamics import SecondOrder
from tablegen.compensation.operator.file import read_operator
from tablegen.compensation.operator.operator import Operator
from tablegen.compensation.operator.piezo import OperatorPiezo, departing
from tablegen.config.load import load
from tablegen.numerics.arrays import Floats
from tablegen.planning.line_plan import LinePlan, make_plan
from tablegen.virtual.modes import second_order
from tablegen.virtual.own_run import errors_on, image_errors, own_piezo, simulate_own
from tablegen.virtual.simulation import run_line


@pytest.fixture(scope="module")
def line(tmp_path_factory: pytest.TempPathFactory) -> LinePlan:
    """x of a scan that was found on the operator."""
    return make_plan(load(write_operator_scan(tmp_path_factory.mktemp("own"), operator_file(creep=0.02)))).x


def stepped(u: Floats) -> Floats:
    """The plays by their definition, in nm, settled."""
    transforms = u, u * u, 1.0 - (1.0 - u) ** 2
    state = np.zeros((3, len(THRESHOLDS)))
    out = np.empty(len(u))
    for _ in range(2):
        for k in range(len(u)):
            g = np.array([[transform[k]] for transform in transforms])
            state = np.minimum(np.maximum(state, g - THRESHOLDS), g + THRESHOLDS)
            out[k] = float(np.array(WEIGHTS) @ np.sum(state, axis=1)) + REVERSIBLE[0] * u[k] + REVERSIBLE[1] * u[k] ** 2
    return out


def test_it_moves_as_plays_that_are_stepped(line: LinePlan) -> None:
    volts = 50.0 + 20.0 * np.sin(2.0 * np.pi * np.arange(1000) / 1000)
    axis = replace(piezo(line), response=None, factor=1.0)
    axis = replace(axis, operator=replace(axis.operator, creep=replace(axis.operator.creep, loss_per_decade=0.0)))
    moved, expected = axis.settled(volts, 1e-5), stepped(volts / 100.0)
    assert np.max(np.abs(np.ptp(moved) / np.ptp(expected) - 1.0)) < 1e-6
    assert np.max(np.abs((moved - np.mean(moved)) - (expected - np.mean(expected)))) < 2e-3 * np.ptp(expected)
    # m of (1) divides what it moves.
    assert np.ptp(replace(axis, factor=1.1).settled(volts, 1e-5)) == pytest.approx(np.ptp(expected) / 1.1)
    # A mode, as the other virtual scanners have it.
    late = replace(axis, response=SecondOrder(4e3, 5.0)).settled(volts, 1e-6)
    through = second_order(4e3, 5.0).settled(moved, 1e-6)
    assert np.max(np.abs(late - through)) < 2e-3 * np.ptp(moved)
    assert np.max(np.abs(late - moved)) > 2e-2 * np.ptp(moved)


def piezo(line: LinePlan) -> OperatorPiezo:
    """The operator of the line as a piezo."""
    own = own_piezo(line)
    assert isinstance(own, OperatorPiezo)
    return own


def read(line: LinePlan) -> Operator:
    """The operator of the line."""
    return piezo(line).operator


def plants(line: LinePlan, operator: Operator) -> list[OperatorPiezo]:
    """Scanners that depart from an operator."""
    return [replace(piezo(line), operator=departing(operator, (0, k))) for k in range(4)]


@pytest.mark.parametrize("damped", [True, False])
def test_without_a_departure_it_does_what_the_build_expects(line: LinePlan, tmp_path: Path, damped: bool) -> None:
    """The steps of the converter and the harmonics of the loop reach a resonance of quality 20; damped, they do not."""
    if damped:
        scan = write_operator_scan(tmp_path, operator_file(creep=0.02))
        scanner = tmp_path / "scanner.toml"
        scanner.write_text(edited(scanner.read_text("utf-8"), "x.resonance.quality = 2.0"), "utf-8")
        line = make_plan(load(scan)).x
    rms, scaling, mismatch, size = image_errors(run_line(line, piezo(line)))
    steps, expected = converter_errors(line, EmittedPeriod(line)), expected_of(line)
    assert expected is not None
    assert rms < 0.02
    assert scaling < max(one.value for one in expected.scaling.values()) + max(steps.scaling.values())
    assert scaling < 0.8 or not damped
    assert mismatch < 0.05
    assert abs(size) < 0.02


def test_the_operator_of_another_piezo_is_clearly_worse(line: LinePlan, tmp_path: Path) -> None:
    path = write_operator_scan(tmp_path, operator_file(creep=0.02, weights=(5.0, 0.0, 12.0))).parent / "operator.toml"
    other, _ = read_operator(path, "other")
    own, foreign = (np.array(errors_on(line, plants(line, operator))) for operator in (read(line), other))
    assert np.all(np.mean(foreign, axis=0)[:3] > 2.0 * np.max(own, axis=0)[:3])
    assert np.mean(foreign, axis=0)[0] > 4.0 * np.max(own, axis=0)[0]
    assert np.min(np.abs(foreign[:, 3])) > 2.0 * np.max(np.abs(own[:, 3]))


@pytest.mark.common
def test_departures_are_as_large_as_the_uncertainty(line: LinePlan) -> None:
    rms, size = 0.2, 0.3
    lines = tuple(replace(one, left_out=(rms, 4.0, 0.6, size)) for one in read(line).lines)
    operator = replace(read(line), lines=lines)
    x = np.linspace(-0.8, 0.8, 161)
    seen, sizes = [], []
    for seed in range(200):
        found = departing(operator, (7, seed))
        stroke = STROKES[seed % len(STROKES)] + 0.1 * (seed % 3)  # at traces, and between them
        row = found.residual.at(stroke, 0.5)
        branches = row.reshape(2, -1)
        values = np.array([np.polynomial.chebyshev.chebval(x, one) for one in branches])
        assert np.polynomial.chebyshev.chebval([-1.0, 1.0], branches.T) == pytest.approx(0.0, abs=1e-12)
        straight = np.polynomial.chebyshev.chebval(x, np.polynomial.chebyshev.chebfit(x, values.mean(0), 1))
        seen.append(float(np.mean((values - straight) ** 2)))
        sizes.append(float(found.size.at(stroke, 0.5)[0]))
    assert 100.0 * np.sqrt(np.mean(seen)) == pytest.approx(rms, rel=0.1)
    assert 100.0 * np.std(sizes) == pytest.approx(size, rel=0.15)
    again = departing(operator, (7, 3)).residual.at(0.3, 0.5)
    assert np.array_equal(again, departing(operator, (7, 3)).residual.at(0.3, 0.5))
    assert not np.array_equal(again, departing(operator, (8, 3)).residual.at(0.3, 0.5))


@pytest.mark.common
def test_what_is_gained(tmp_path: Path) -> None:
    """Laws are better than nothing, the operator than the laws; and a larger uncertainty leaves more."""
    scan = write_operator_scan(tmp_path, operator_file(creep=0.02))
    (run,) = simulate_own(load(scan), 0)
    assert (run.axis, len(run.traces), run.distance, run.refined) == ("x", len(STROKES), 0.0, False)
    plain, laws, operator = (row.summary() for row in run.rows)
    assert [row.correction for row in run.rows] == ["uncompensated", "laws", "operator"]
    assert [row.model for row in run.rows] == ["triangle", "harmonic", "operator"]
    assert plain["mismatch"][0] > laws["mismatch"][0] > operator["mismatch"][0]
    assert plain["rms"][0] > laws["rms"][0] > operator["rms"][0]
    assert 0.5 * 0.05 < operator["rms"][0] < 2.0 * 0.05
    assert all(abs(worst) >= abs(mean) for mean, worst in operator.values())
    write_operator_scan(tmp_path, operator_file(rms=0.2, size=2.0, creep=0.02))
    (loose,) = simulate_own(load(scan), 0)
    worse = loose.rows[2].summary()
    assert worse["rms"][0] == pytest.approx(4.0 * operator["rms"][0], rel=0.2)
    assert abs(worse["size"][1]) > 1.0 > abs(operator["size"][1])


def test_a_slow_axis_that_images_forward_only(tmp_path: Path) -> None:
    scan = write_operator_scan(tmp_path, operator_file("y"), "y.offset_v = 60", branches=False)
    (run,) = simulate_own(load(scan), 3)
    assert (run.axis, run.distance) == ("y", pytest.approx(0.1))
    plain, laws, operator = run.rows
    assert not laws.errors
    assert "no branches" in laws.rejected
    assert set(operator.summary()) == {"rms", "scaling", "size"}
    assert operator.summary()["rms"][0] < 0.2 * plain.summary()["rms"][0]


def test_what_departs_too_far_is_refused(tmp_path: Path) -> None:
    scan = write_operator_scan(tmp_path, operator_file(rms=60.0))
    with pytest.raises(
        Unphysical, match=r"x: with a random departure of its own uncertainty, .* measure a trace there"
    ):
        simulate_own(load(scan), 0)


def test_a_departure_is_that_of_the_nearest_trace(line: LinePlan) -> None:
    """What one trace is missed by counts near it alone; far from it the median of all, which is 0 here."""
    operator = read(line)
    first, *others = operator.lines
    lines = (replace(first, left_out=(1.0, 9.0, 2.0, 3.0)), *(replace(one, left_out=(0.0,) * 4) for one in others))
    found = departing(replace(operator, lines=lines), (0,))
    near, far = (float(np.max(np.abs(found.residual.at(stroke, 0.5)))) for stroke in (STROKES[0], STROKES[-1]))
    assert near > 0.002
    assert far < 0.02 * near
