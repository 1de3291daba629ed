"""The slow axis on an operator: traces at the turn and the rates of frames, and what the emitted integers image."""

from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from editing import SCAN, SCANNER, edited
from foreign_plants import BoucWen, ForeignPlant, ManyPlays, record
from replacing import replace
from sets import LONG_TEST

from tablegen.calibration.laws.hysteresis import Trace
from tablegen.calibration.operator.creep_fit import creep_of_fields
from tablegen.calibration.operator.file_of_fit import operator_file
from tablegen.calibration.operator.fit import OperatorFit, _creep_of, fit_operator
from tablegen.calibration.operator.periodic_line import PeriodicLine, periodic_line
from tablegen.compensation.operator.creep import NO_CREEP, LogarithmicCreep
from tablegen.compensation.operator.plays import NO_PLAYS
from tablegen.config.load import load
from tablegen.numerics.arrays import Floats
from tablegen.planning.line_plan import make_plan
from tablegen.virtual.parameters import load_truth
from tablegen.virtual.played import played
from tablegen.virtual.scanner import VirtualScanner

pytestmark = pytest.mark.rest

V_MAX = 100.0
WINDOW = (0.05, 0.95)
STROKES = (0.10, 0.25, 0.45, 0.65, 0.82, 0.97)
# Stroke, rate, turn: six quick triangles; two more of frames; or none but the quick ones.
FRAMES = (*((stroke, 5.0, 0.5) for stroke in STROKES), (0.5, 0.5, 0.5), (0.5, 1.0, 0.95))
TURNED = tuple((stroke, 1.0, 0.95) for stroke in STROKES)
QUICK = tuple((stroke, 100.0, 0.5) for stroke in STROKES)
SLOW_TRIANGLES = tuple((stroke, 1.0, 0.5) for stroke in STROKES[3:])
Settled = Callable[[Floats, float], Floats]  # nm of a settled period of volts at the piezo, at a rate


def preisach(volts: Floats, rate_hz: float) -> Floats:
    return VirtualScanner.of(load_truth()).y.settled(volts, 1.0 / (rate_hz * len(volts)))


PLANTS: dict[str, Settled] = {
    "plays": ForeignPlant(ManyPlays()).settled,
    "Bouc-Wen": ForeignPlant(BoucWen()).settled,
    "Preisach": preisach,
}


class Recorded(ForeignPlant):
    """Any plant, for ``record``."""

    def __init__(self, settled: Settled) -> None:
        self.settled = settled  # type: ignore[method-assign]


def loss_between(creep: LogarithmicCreep, slow_hz: float, quick_hz: float) -> float:
    """Of the gain, from one rate to the other."""
    real, imaginary = creep.response(np.array([slow_hz, quick_hz]))
    slow, quick = np.hypot(real, imaginary).tolist()
    return float(1.0 - quick / slow)


def found_creep(lines: list[PeriodicLine]) -> LogarithmicCreep:
    return creep_of_fields(lines, NO_PLAYS, lambda _: 1.0, _creep_of(lines))


@cache
def traces(plant: str, protocol: tuple[tuple[float, float, float], ...]) -> list[PeriodicLine]:
    piezo = Recorded(PLANTS[plant])
    return [
        periodic_line(Trace(f"{stroke:g}", *record(piezo, 0.5, stroke, rate, seed, turn)), V_MAX)
        for seed, (stroke, rate, turn) in enumerate(protocol)
    ]


@cache
def identified(plant: str, protocol: tuple[tuple[float, float, float], ...]) -> OperatorFit:
    return fit_operator(traces(plant, protocol), None, lambda _: 1.0)


def forward_scaling(position: Floats, turn: float) -> float:
    """Percent peak to peak, of chords of 1/20 of the line inside the window."""
    t = (np.arange(len(position)) + 0.5) / len(position)
    edges = np.linspace(*WINDOW, 401)
    place = np.interp(edges, t / turn, position)
    chords = (place[22:] - place[:-22]) / (edges[22] - edges[0])
    return 100.0 * float(np.ptp(chords)) / float(np.mean(chords))


def first_lines(position: Floats, turn: float) -> float:
    """Percent of the line: the largest error of x = 0.05..0.1 about the best straight line of the window."""
    t = (np.arange(len(position)) + 0.5) / len(position)
    edges = np.linspace(*WINDOW, 401)
    place = np.interp(edges, t / turn, position)
    slope, offset = np.polyfit(edges, place, 1)
    return 100.0 * float(np.max(np.abs(place - offset - slope * edges)[edges <= 0.1])) / float(slope)


def imaged(folder: Path, plant: str, fit: OperatorFit, size_nm: float, frame_hz: float = 0.5) -> Floats:
    """Where y is in a settled frame of the emitted integers, in nm."""
    (folder / "y_operator.toml").write_bytes(operator_file(fit, "y", V_MAX))
    table = '+ [y.hysteresis]\nmodel = "operator"\nfile = "y_operator.toml"'
    scanner = edited(SCANNER, "- [y.hysteresis]", "- [[y.hysteresis.branches]]", "- [y.frequency]", table)
    (folder / "scanner.toml").write_text(scanner, "utf-8")
    rate = [f"timing.line_rate_hz = {200.0 * frame_hz!r}", "timing.lines = 200", "- [limits]"]
    window = ["y.band_limit.window = [0.05, 0.95]", 'y.band_limit.directions = "forward"', "y.turn = 0.95"]
    (folder / "scan.toml").write_text(edited(SCAN, *rate, *window, f"y.size_nm = {size_nm!r}"), "utf-8")
    line = make_plan(load(folder / "scan.toml")).y
    drive = played(line, 1 << 12)
    return PLANTS[plant](drive.volts, 1.0 / drive.period_s)


def scanned(folder: Path, plant: str, fit: OperatorFit, size_nm: float, frame_hz: float = 0.5) -> float:
    """The forward scaling error of y."""
    return forward_scaling(imaged(folder, plant, fit, size_nm, frame_hz), 0.95)


@pytest.mark.parametrize(
    ("protocol", "plant"),
    [
        *(pytest.param(FRAMES, plant, id=f"frames-{plant}", marks=LONG_TEST) for plant in PLANTS),
        pytest.param(TURNED, "plays", id="turned-plays"),
        pytest.param(QUICK, "Bouc-Wen", id="quick-Bouc-Wen"),
        pytest.param(TURNED, "Bouc-Wen", id="turned-Bouc-Wen", marks=LONG_TEST),
        pytest.param(TURNED, "Preisach", id="turned-Preisach", marks=LONG_TEST),
        pytest.param(QUICK, "plays", id="quick-plays", marks=LONG_TEST),
        pytest.param(QUICK, "Preisach", id="quick-Preisach", marks=LONG_TEST),
    ],
)
def test_y_at_half_a_hertz(plant: str, protocol: tuple[tuple[float, float, float], ...], tmp_path: Path) -> None:
    fit = identified(plant, protocol)
    for size_nm in (150.0, 500.0, 850.0):
        position = imaged(tmp_path, plant, fit, size_nm)
        assert forward_scaling(position, 0.95) < 2.5, size_nm
        assert first_lines(position, 0.95) < 0.1, size_nm


def test_y_at_other_frame_rates(tmp_path: Path) -> None:
    fit = identified("plays", FRAMES)
    for frame_hz in (1.0, 2.0):
        assert scanned(tmp_path, "plays", fit, 500.0, frame_hz) < 2.5, frame_hz


def test_creep_is_what_misses(tmp_path: Path) -> None:
    fit = identified("Bouc-Wen", FRAMES)
    without = fit_operator([line.without(None, None) for line in traces("Bouc-Wen", QUICK)], None, lambda _: 1.0)
    no_creep = replace(without, operator=replace(without.operator, creep=NO_CREEP))
    assert scanned(tmp_path, "Bouc-Wen", no_creep, 500.0) > 3.0 * scanned(tmp_path, "Bouc-Wen", fit, 500.0)


@pytest.mark.parametrize("protocol", [FRAMES, TURNED, QUICK], ids=["frames", "turned", "quick"])
def test_creep_is_found_without_plays(protocol: tuple[tuple[float, float, float], ...]) -> None:
    creep = found_creep(traces("Bouc-Wen", protocol))
    slow, quick = np.abs(ForeignPlant(BoucWen()).crept(np.array([1.0, 10.0])))
    assert loss_between(creep.down_to(1.0), 1.0, 10.0) == pytest.approx(float(1.0 - quick / slow), rel=0.15)


def test_turns_that_differ_at_one_rate_leave_creep_open() -> None:
    lines = [*traces("Bouc-Wen", TURNED)[:3], *(line for line in traces("Bouc-Wen", SLOW_TRIANGLES))]
    assert found_creep(lines).loss_per_decade == 0.0


def test_creep_goes_on_below_the_rates_that_were_measured() -> None:
    creep = LogarithmicCreep(0.025, 1e-4, 0.1, 100.0)
    assert loss_between(creep, 0.05, 0.5) < 0.001
    assert loss_between(creep.down_to(0.05), 0.05, 0.5) == pytest.approx(0.025, rel=0.2)
    assert creep.down_to(200.0) == creep
