"""Creep and loss angle in a response of a swept sine: found, taken out once, and given to the operator."""

from pathlib import Path

import numpy as np
import pytest
from editing import edited
from foreign_plants import V_MAX, ForeignPlant, ManyPlays, record
from operator_files import operator_file, write_operator_scan
from replacing import replace

from tablegen.calibration.laws.hysteresis import Trace
from tablegen.calibration.operator.file_of_fit import operator_file as file_of
from tablegen.calibration.operator.fit import fit_operator
from tablegen.calibration.operator.periodic_line import periodic_line
from tablegen.calibration.operator.sweep_loss_fit import fit_sweep_loss
from tablegen.compensation.dynamics import Measured, SecondOrder
from tablegen.compensation.operator.creep import LogarithmicCreep
from tablegen.compensation.operator.file import ResponseTable, read_operator
from tablegen.config.load import load
from tablegen.planning.line_plan import make_plan
from tablegen.waveform.series import FourierSeries

DYNAMICS = SecondOrder(60e3, 14.0, 2e-6)
DEGREES = 0.7  # the loss angle of hysteresis


def creep_of(loss: float) -> LogarithmicCreep:
    return LogarithmicCreep(loss, 1e-5, 10.0, 100.0)


def swept(from_hz: float, loss: float, degrees: float, noise: float = 0.001, count: int = 400) -> Measured:
    """A sweep up to 80 kHz over a piezo with creep and a loss angle."""
    f, random = np.geomspace(from_hz, 80e3, count), np.random.default_rng(5)
    real, imaginary = DYNAMICS.inverse(f)
    h = np.exp(-1j * np.radians(degrees)) / (real + 1j * imaginary)
    if loss:
        real, imaginary = creep_of(loss).response(f)
        h = h * (real + 1j * imaginary)
    gain = np.abs(h) / np.abs(h[0]) * (1.0 + noise * random.standard_normal(count))
    return Measured(f, gain, (np.unwrap(np.angle(h)) + noise * random.standard_normal(count)) / (2.0 * np.pi))


@pytest.mark.parametrize("from_hz", [50.0, 1000.0])
def test_creep_and_loss_angle_are_found_and_taken_out(from_hz: float) -> None:
    response = swept(from_hz, 0.024, DEGREES)
    sweep = fit_sweep_loss(response, creep_of)
    assert sweep is not None
    assert sweep.creep is not None
    assert sweep.creep.loss_per_decade == pytest.approx(0.024, abs=0.0015)
    assert 360.0 * sweep.loss_turns == pytest.approx(DEGREES, abs=0.08)
    clean = sweep.without(response)
    real, imaginary = DYNAMICS.inverse(response.f_hz)
    below = response.f_hz < 20e3
    error = clean.gain * np.exp(2j * np.pi * clean.phase_turns) * (real + 1j * imaginary) - 1.0
    assert float(np.max(np.abs(error[below]))) < 6e-3  # of which noise is 4e-3
    assert abs(float(np.mean(error[below].imag))) < 1e-3
    before = response.gain * np.exp(2j * np.pi * response.phase_turns) * (real + 1j * imaginary) - 1.0
    assert abs(float(np.mean(before[below].imag))) > 0.02


def test_a_loss_angle_without_creep_is_taken_out() -> None:
    sweep = fit_sweep_loss(swept(50.0, 0.0, DEGREES), creep_of)
    assert sweep is not None
    assert sweep.creep is None
    assert 360.0 * sweep.loss_turns == pytest.approx(DEGREES, abs=0.08)


def test_a_response_of_dynamics_alone_stays() -> None:
    assert fit_sweep_loss(swept(50.0, 0.0, 0.0), creep_of) is None
    assert fit_sweep_loss(DYNAMICS, creep_of) is None
    assert fit_sweep_loss(None, creep_of) is None


@pytest.mark.parametrize(
    "response",
    [
        swept(50.0, 0.024, DEGREES, count=15),  # eleven points far below the resonance
        swept(8000.0, 0.024, DEGREES),
        swept(50.0, 0.024, 60.0),  # no loss of a piezo
    ],
)
def test_a_response_that_does_not_tell_stays(response: Measured) -> None:
    assert fit_sweep_loss(response, creep_of) is None


def test_noise_is_no_loss() -> None:
    assert fit_sweep_loss(swept(1000.0, 0.0, 0.0, noise=0.02), creep_of) is None


def played(folder: Path, response: Measured, table: ResponseTable | None) -> FourierSeries:
    """The target of the example's line at 1 kHz through the inverse of its response, on an operator with creep."""
    folder.mkdir()
    file = replace(operator_file(creep=0.024), response=table)
    scan = write_operator_scan(folder, file, "timing.line_rate_hz = 1000", "x.band_limit.harmonics = 16")
    rows = zip(response.f_hz, response.gain, 360.0 * response.phase_turns, strict=True)
    lines = ["hz,gain,phase_deg", *(f"{f:.12g},{gain:.12g},{phase:.12g}" for f, gain, phase in rows)]
    (folder / "response.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    text = edited((folder / "scanner.toml").read_text("utf-8"), "- [x.resonance]", "+ [x.resonance]")
    (folder / "scanner.toml").write_text(f"{text}response = 'response.csv'\n", encoding="utf-8")
    return make_plan(load(scan)).x.series


def test_a_build_counts_creep_and_loss_angle_once(tmp_path: Path) -> None:
    sweep = swept(1000.0, 0.024, DEGREES, noise=0.0)
    clean = played(tmp_path / "clean", swept(1000.0, 0.0, 0.0, noise=0.0), None)
    once = played(tmp_path / "once", sweep, ResponseTable(loss_deg=DEGREES, creep=True))
    twice = played(tmp_path / "twice", sweep, None)

    def apart(series: FourierSeries) -> float:
        """The largest difference of the drives, of their stroke."""
        difference = series.on_grid(512) - clean.on_grid(512)
        return float(np.ptp(difference) / np.ptp(clean.on_grid(512)))

    assert apart(once) < 5e-4
    assert apart(twice) > 5e-3


@pytest.mark.common
def test_the_fit_takes_the_creep_of_the_response_and_the_file_keeps_it(tmp_path: Path) -> None:
    plant = ForeignPlant(ManyPlays(seed=3, count=60), creep=0.022)
    f = np.geomspace(500.0, 80e3, 300)
    h = plant.crept(f) * plant.dynamics(f) * np.exp(-1j * np.radians(DEGREES))
    response = Measured(f, np.abs(h) / np.abs(h[0]), np.unwrap(np.angle(h)) / (2.0 * np.pi))
    columns = [record(plant, 0.5, stroke, samples=400, periods=3) for stroke in (0.2, 0.5, 0.9)]
    lines = [periodic_line(Trace(f"{i}", *one), V_MAX) for i, one in enumerate(columns)]
    fit = fit_operator(lines, response, lambda _: 1.0)
    operator = fit.operator
    assert operator.sweep is not None
    assert operator.creep == operator.sweep.creep
    assert operator.creep.loss_per_decade == pytest.approx(0.022, rel=0.05)
    (tmp_path / "operator.toml").write_bytes(file_of(fit, "x", V_MAX))
    read, _ = read_operator(tmp_path / "operator.toml", "operator.toml")
    assert read.sweep is not None
    assert read.sweep.loss_turns == pytest.approx(operator.sweep.loss_turns, abs=1e-9)
    assert read.sweep.creep == read.creep
