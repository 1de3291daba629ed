"""Scans on an identified operator: of piezos that the project does not contain, and of the virtual scanners."""

from pathlib import Path

import numpy as np
from editing import SCAN, SCANNER, edited, write_pair
from foreign_plants import SIX, V_MAX, Floats, ForeignPlant, record

from tablegen.calibration.laws.hysteresis import Trace
from tablegen.calibration.operator.file_of_fit import operator_file
from tablegen.calibration.operator.fit import OperatorFit, fit_operator
from tablegen.calibration.operator.periodic_line import periodic_line
from tablegen.compensation.dynamics import Response
from tablegen.config.load import Setup, load
from tablegen.virtual.experiments import sensor_trace
from tablegen.virtual.scanner import VirtualAxis
from tablegen.virtual.sensor import Sensor

SAMPLES = 2000  # of a period, on which foreign piezos are integrated


class Played:
    """A foreign piezo as an axis on which emitted integers are played."""

    def __init__(self, plant: ForeignPlant) -> None:
        self._plant = plant

    def settled(self, volts: Floats, tick_s: float) -> Floats:
        ticks = (np.arange(len(volts)) + 0.5) / len(volts)
        at = (np.arange(SAMPLES) + 0.5) / SAMPLES
        moved = self._plant.settled(np.interp(at, ticks, volts, period=1.0), 1.0 / (len(volts) * tick_s))
        return np.interp(ticks, at, moved, period=1.0)


def fitted(traces: list[Trace], response: Response | None = None) -> OperatorFit:
    """Of traces with 100 V at most, on an axis whose sensitivity is not known to change.

    ``response`` is that of the scanner file, which is taken out of the traces.
    """
    return fit_operator([periodic_line(trace, V_MAX) for trace in traces], response, lambda _: 1.0)


def foreign_traces(plant: ForeignPlant) -> list[Trace]:
    """The six of the docs."""
    return [Trace(f"{stroke:g}", *record(plant, at, stroke, seed=k)) for k, (at, stroke) in enumerate(SIX)]


def virtual_traces(axis: VirtualAxis, rate_hz: float = 100.0, turn: float = 0.5) -> list[Trace]:
    """The same sizes on a virtual scanner, whose sensor has 0.2 nm of noise."""
    found = []
    for k, (at, stroke) in enumerate(SIX):
        sensor = Sensor(noise_nm=0.2, seed=k)
        columns = sensor_trace(axis, V_MAX * stroke, V_MAX * at, rate_hz, periods=5, turn=turn, sensor=sensor)
        found.append(Trace(f"{stroke:g}", columns["time_s"], columns["drive_v"], columns["displacement_nm"]))
    return found


def scan_on(folder: Path, fit: OperatorFit, size_nm: float, offset_v: float, *scanner: str) -> Setup:
    """The example at 100 Hz, whose x axis has the operator; ``scanner`` edits the rest of its file."""
    (folder / "operator.toml").write_bytes(operator_file(fit, "x", V_MAX))
    scan = edited(SCAN, f"x.size_nm = {size_nm}", f"x.offset_v = {offset_v}", "timing.line_rate_hz = 100", "- [limits]")
    model = ("x.hysteresis.model = 'operator'", "x.hysteresis.file = 'operator.toml'", "- [x.resonance]")
    scan = edited(scan, "timing.lines = 20", "y.band_limit.harmonics = 16")
    return load(write_pair(folder, scan, edited(SCANNER, *model, *scanner)))
