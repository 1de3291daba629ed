"""Name traces of the running scan that are wrong by what they look like: units, delay, hum, volts of the controller."""

import numpy as np

from tablegen.base.warnings import Remark, spoils
from tablegen.calibration.laws.hysteresis import Trace
from tablegen.calibration.operator.periodic_line import PHASES, PeriodicLine
from tablegen.calibration.record_checks import WrongRecord, hum_remarks, refuse_clipped
from tablegen.numerics.arrays import Floats
from tablegen.planning.line_plan import LinePlan
from tablegen.refinement.departure import requested_position
from tablegen.refinement.displacement import Displacement
from tablegen.refinement.learning import LayerUpdate
from tablegen.refinement.phase import Phase

_LEAST_GAIN, _MOST_GAIN = 4.0, 250.0  # of amplifiers that are looked for
_THOUSAND = (500.0, 2000.0)
_DELAY, _EXPLAINED = 0.005, 0.93  # of the period; share of the error's square that a delay explains
_STEP = 1e-4  # of the period


def refuse_wrong_trace(line: LinePlan, trace: Trace, states_gain: bool) -> None:
    """Refuse a trace with a clipped sensor, or the controller's volts in place of those at the piezo.

    Raises
    ------
    WrongRecord
        If it is one of these.
    """
    volts = float(np.ptp(trace.drive_v)) if len(trace.drive_v) else 0.0
    planned = line.drive.v_amplitude * float(np.ptp(line.drive_series.value(np.arange(PHASES) / PHASES)))
    gain = planned / volts if volts > 0.0 else 0.0
    if not states_gain and _LEAST_GAIN < gain < _MOST_GAIN:
        raise WrongRecord(
            f"the recorded drive spans {volts:.4g} V where this scan has {planned:.4g} V at the piezo: "
            f"this looks like volts of the controller, before an amplifier of a gain near {gain:.3g}. Give "
            "--drive-gain G, volts at the piezo for a recorded volt, and --drive-offset V if 0 V is not 0 V there",
            "controller-volts",
        )
    if volts > 0.0 and len(trace.displacement_nm) and np.ptp(trace.displacement_nm) > 0.0:
        refuse_clipped(trace)


def size_remark(line: LinePlan, size_nm: float) -> Remark | None:
    """Return a remark if the line is about 1000 times as long, or as short, as the scan file says."""
    ratio = size_nm / line.drive.size_nm
    small, large = _THOUSAND[0] < 1.0 / ratio < _THOUSAND[1], _THOUSAND[0] < ratio < _THOUSAND[1]
    if not small and not large:
        return None
    looks, unit = ("micrometres called nanometres", "um") if small else ("nanometres called micrometres", "nm")
    return spoils(
        f"the line is {size_nm:.5g} nm where the scan file asks for {line.drive.size_nm:.5g} nm: this looks like "
        f"{looks}. Name the column displacement_{unit} or Position ({unit}), or give --columns "
        f"displacement=COLUMN:{unit}; sizes are not learnt, only the shape of the line",
        100.0 * abs(ratio - 1.0),
        "wrong-length-unit",
    )


def trace_remarks(
    line: LinePlan, trace: Trace, phase: Phase, measured: Displacement, update: LayerUpdate, delay_s: float
) -> list[Remark]:
    """Return remarks on a late sensor and on mains hum."""
    points = update.before.points
    slopes = (
        requested_position(line, (points.times + _STEP) % 1.0) - requested_position(line, (points.times - _STEP) % 1.0)
    ) / (2.0 * _STEP)
    error: Floats = update.before.error - np.mean(update.before.error)
    slopes = slopes - np.mean(slopes)
    remarks: list[Remark] = []
    delay = -float(error @ slopes) / float(slopes @ slopes)
    rest = float(np.sum((error + delay * slopes) ** 2)) / max(float(error @ error), 1e-30)
    if abs(delay) > _DELAY and rest < 1.0 - _EXPLAINED:
        seconds = delay * phase.period_s
        side = "behind" if delay > 0.0 else "ahead of"
        remarks.append(
            spoils(
                f"the whole line is {abs(seconds):.3g} s {side} the scan: this looks like a delay of "
                f"{100.0 * abs(delay):.2g} % of the period, of the sensor's filter or of the recorder, which would be "
                f"learnt as an error of the scanner. Give --delay-s {delay_s + seconds:.3g} if the sensor is late",
                100.0 * abs(delay),
                "sensor-delay",
            )
        )
    grid = np.arange(PHASES) / PHASES
    period = PeriodicLine(
        trace.name, 1.0 / phase.period_s, 1, line.drive_series.value(grid), measured.value(grid), 0.0, 0.0
    )
    return remarks + hum_remarks(trace, period)
