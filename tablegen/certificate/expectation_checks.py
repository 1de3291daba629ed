"""Checks of the expectation on the scanner: where it is doubtful, or worse than the errors of the codes."""

from typing import Literal

import numpy as np
from msgspec import Struct

from tablegen.certificate.certificate import Certificate
from tablegen.certificate.excess import LARGEST_PERCENT
from tablegen.certificate.shaped_periods import Passage
from tablegen.planning.line_plan import LinePlan

FAR_PERCENT = 10.0  # of v_max, from the nearest measured line; the traces of `calibrate operator` are closer than twice
# Behind a resonance: above 1 % even if its quality is half of that in the scanner file, which is uncertain.
RESONANCE_PERCENT = 2.0
_GRID = 32  # points per period of the highest harmonic


class ExpectationWarning(Struct, frozen=True):
    """A warning about one axis: its sentence, and a figure in percent above ``limit``; ``code`` names the figure."""

    code: Literal["expected-scaling-error", "operator-distance", "resonance"]
    text: str
    percent: float
    limit: float


def expectation_warnings(line: LinePlan, certificate: Certificate) -> list[ExpectationWarning]:
    """List the warnings about the expectation of an axis.

    The uncertainty is not counted: it stands beside the figure, and no change of the scan makes it smaller.
    """
    warnings, axis, expected = [], line.axis, certificate.expected
    figures = {} if expected is None else expected.scaling
    side = max(figures, key=lambda one: figures[one].value, default="")
    if side and figures[side].value > LARGEST_PERCENT:
        text = (
            f"on the scanner the {axis} axis is expected to have a scaling error of {figures[side].value:.3g} % "
            f"{side}, above {LARGEST_PERCENT:g} %, since these harmonics do not make the waveform that its operator "
            "needs over the window"
        )
        warnings.append(ExpectationWarning("expected-scaling-error", text, figures[side].value, LARGEST_PERCENT))
    position = certificate.position
    if position is not None and max(position.scaling.values(), default=0.0) > RESONANCE_PERCENT:
        side, percent = position.worst
        text = (
            f"the steps of the {axis} codes drive the resonance at {_hz(position.passage)}: behind it the scaling "
            f"error is {percent:.3g} % {side}, above {RESONANCE_PERCENT:g} %; of the codes alone it is "
            f"{certificate.scaling[side].total:.3g} %"
        )
        warnings.append(ExpectationWarning("resonance", text, percent, RESONANCE_PERCENT))
    if expected is not None and expected.distance is not None and expected.distance > FAR_PERCENT:
        w = line.drive_series.on_grid(_GRID * line.drive_series.harmonics)
        stroke = line.drive.v_amplitude * float(np.max(w) - np.min(w))
        here = f"{stroke:.3g} V about {line.drive.v_offset:.3g} V"
        text = (
            f"the {axis} axis moves by {here}, {expected.distance:.2g} % of {line.drive.driver.unit} from the nearest "
            f"trace of its operator, so that little is known there; record a trace of {here}, and give it to "
            "`tablegen calibrate operator` with the others"
        )
        warnings.append(ExpectationWarning("operator-distance", text, expected.distance, FAR_PERCENT))
    return warnings


def _hz(passage: Passage) -> str:
    response = passage.response
    return f"{passage.frequency_hz if response is None else response.resonance_hz:.6g} Hz"
