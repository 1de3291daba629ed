"""Operators of a virtual scanner, identified from simulated traces as a laboratory would, beside the other laws.

It needs scipy, of the extra ``calibrate``.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Literal

import msgspec
from msgspec.structs import replace

from tablegen.calibration.laws.hysteresis import Trace
from tablegen.calibration.operator.file_of_fit import MODEL, operator_file
from tablegen.calibration.operator.fit import fit_operator
from tablegen.calibration.operator.periodic_line import periodic_line
from tablegen.compensation import models
from tablegen.compensation.offset import OffsetLaw
from tablegen.compensation.offset_sizes import OffsetSurface
from tablegen.config.load import Setup
from tablegen.config.scanner import ScannerAxis
from tablegen.planning.laws import dynamics_of, offset_surface, size_law_of
from tablegen.virtual.calibration_day import NOISE, PERIODS, calibrate
from tablegen.virtual.experiments import sensor_trace
from tablegen.virtual.scanner import VirtualAxis, VirtualScanner
from tablegen.virtual.sensor import Sensor

STROKES = (0.10, 0.25, 0.45, 0.65, 0.97)  # of the traces, about the middle of the driver's range, of its span
_SAMPLES = 500  # of a period
_SEEDS = 500_000  # of the traces, which are after those of the other measurements


def with_operators(
    setup: Setup,
    scanner: VirtualScanner,
    folder: Path,
    noise: float = NOISE,
    seed: int = 0,
    tell: Callable[[str], object] = lambda _: None,
) -> Setup:
    """Calibrate both axes, and identify an operator of each from five traces at the line rate.

    Parameters
    ----------
    folder
        Where the files of the operators are written. The setup reads them again.
    noise
        Rms noise of every reading, relative.

    Returns
    -------
    Setup
        The scan with the calibrated scanner, without refinement. Coupling and drift stay.

    Raises
    ------
    Unphysical
        If a fit fails.
    """
    tell("calibrating the laws")
    day = calibrate(setup, scanner, noise, seed).setup
    axes = {}
    names: tuple[Literal["x", "y"], ...] = ("x", "y")
    for number, name in enumerate(names):
        tell(f"identifying the operator of {name}")
        axis: ScannerAxis = getattr(day.scanner, name)
        first = _SEEDS + 1000 * (2 * seed + number)
        data = _identified(setup, axis, getattr(scanner, name), name, noise, first)
        file = f"operator_{name}.toml"
        (folder / file).write_bytes(data)
        resonance = axis.resonance
        if resonance is not None and resonance.response is not None:
            resonance = replace(resonance, response=str((setup.scanner_folder / resonance.response).absolute()))
        model = msgspec.convert({"model": MODEL, "file": file}, models.get(MODEL))
        axes[name] = replace(axis, hysteresis=model, resonance=resonance)
    return replace(day, scanner=msgspec.structs.replace(day.scanner, **axes), scanner_folder=folder)


def _identified(
    setup: Setup, axis: ScannerAxis, piezo: VirtualAxis, name: Literal["x", "y"], noise: float, seed: int
) -> bytes:
    driver, rate_hz = setup.scanner.driver, setup.scan.timing.line_rate_hz
    lines = []
    for k, stroke in enumerate(STROKES):
        volts = stroke * driver.span
        sensor = Sensor(noise_nm=noise * volts * axis.size.k_nm_per_v, seed=seed + k)
        trace = sensor_trace(piezo, volts, driver.middle, rate_hz, PERIODS, _SAMPLES, turn=0.5, sensor=sensor)
        record = Trace(f"{volts:g} V", trace["time_s"], trace["drive_v"], trace["displacement_nm"])
        lines.append(periodic_line(record, driver))
    response = None if axis.resonance is None else dynamics_of(axis.resonance, setup.scanner_folder)
    law = OffsetSurface.everywhere(OffsetLaw())
    if axis.offset is not None:
        law = offset_surface(axis.offset, driver, size_law_of(axis.size, driver))
    fit = fit_operator(lines, response, lambda centre: law.small.factor(2.0 * centre - 1.0))
    return operator_file(fit, name, driver)
