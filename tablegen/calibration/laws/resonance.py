"""Fit resonance, quality and delay of the second-order model to a frequency response."""

from dataclasses import dataclass
from math import log, pi

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.base.warnings import Remark, spoils
from tablegen.fitting.estimate import Curve, Estimate, Fit
from tablegen.fitting.least_squares import Solution, solve
from tablegen.fitting.outliers import outliers
from tablegen.numerics.arrays import Floats

_MIN_SCATTER = 1e-7
_POOR_PERCENT, _POOR_DEGREES = 5.0, 5.0


@dataclass(frozen=True, kw_only=True)
class ResonanceFit(Fit):
    """The undamped resonance in Hz, the quality factor, the delay in s, and the gain at 0 Hz.

    ``response`` is the measurement, for ``resonance.response`` of the scanner file: rows of ascending Hz, gain, and
    phase in degrees, unwrapped and without an inversion; None where no phase was measured.
    """

    frequency_hz: Estimate
    quality: Estimate
    delay_s: Estimate
    gain: Estimate
    response: Floats | None = None


def fit_resonance(frequency_hz: Floats, gain: Floats, phase_deg: Floats | None = None) -> ResonanceFit:
    """Fit ``SecondOrder`` to gain and phase; without a phase the delay is 0.

    Parameters
    ----------
    frequency_hz
        Frequencies in Hz, shape (points,).
    gain
        Gains in any unit, with errors in proportion, shape (points,).
    phase_deg
        Phases in degrees, a lag negative, shape (points,).

    Raises
    ------
    Unphysical
        If the points show no resonance.
    """
    order = np.argsort(frequency_hz, kind="stable")
    f, g = frequency_hz[order], gain[order]
    needed = 4 if phase_deg is None else 2
    if len(np.unique(f)) < needed:
        raise Unphysical(f"{len(np.unique(f))} frequencies do not determine a resonance; measure 20 or more around it")
    phase = None
    remarks: list[Remark] = []
    if phase_deg is None:
        remarks.append(
            Remark("without phase_deg the delay is not determined; delay_s is set to 0", code="assumed-value")
        )
    else:
        phase = _unwrapped(phase_deg[order], remarks)
    solution = _best(f, g, phase)
    at, quality = float(np.exp(solution.values[1])), float(np.exp(solution.values[2]))
    if not f[0] < at < f[-1]:
        raise Unphysical(
            f"the resonance would be at {at:.4g} Hz, outside the {f[0]:g}..{f[-1]:g} Hz that were measured; "
            f"measure through it"
        )
    frequency, q = (_of_logarithm(solution.estimate(name)) for name in ("frequency_hz", "quality"))
    delay = Estimate(0.0) if phase is None else _delay(solution, at, remarks)
    for name in solution.undetermined:
        remarks.append(
            spoils(
                f"{name} is not determined by these points; measure more of them around the resonance",
                code="undetermined-parameter",
            )
        )
    near = np.abs(f - at) <= at / quality
    if np.sum(near) < 3:
        remarks.append(
            spoils(
                f"fewer than three points lie on the resonance, within {at / quality:.3g} Hz of {at:.5g} Hz",
                code="few-points",
            )
        )
    line = np.geomspace(float(f[0]), float(f[-1]), 301)
    model, model_phase = _response(line, solution.values)
    expected, lag = _response(f, solution.values)
    residual = 100.0 * (g / expected - 1.0)
    if (rms := float(np.sqrt(np.mean(residual**2)))) > _POOR_PERCENT:
        text = (
            "one resonance does not describe this response; take the measurement itself: "
            "--write --points writes it beside the scanner file and names it there"
        )
        remarks.append(spoils(text, rms, code="poor-fit"))
    decibels = 20.0 * np.log10(g), 20.0 * np.log10(model)
    if phase is not None:
        phase_error = float(np.degrees(np.sqrt(np.mean((lag - phase) ** 2))))
        if phase_error > _POOR_DEGREES:
            text = f"the phase is missed by {phase_error:.2g} degrees rms; are the points near enough to follow it?"
            remarks.append(spoils(text, 100.0 * float(np.radians(phase_error)), code="poor-fit"))  # of a harmonic
    curves = [Curve("gain", "frequency [Hz]", "gain [dB]", (f, decibels[0]), (line, decibels[1]))]
    if phase is not None:
        degrees = (line, np.degrees(model_phase))
        curves.append(Curve("phase", "frequency [Hz]", "phase [degrees]", (f, np.degrees(phase)), degrees))
    rows = outliers(solution.jacobian, solution.residuals, _MIN_SCATTER)
    return ResonanceFit(
        points=len(f),
        residual_percent=residual,
        before_percent=float(np.max(np.abs(100.0 * (g / np.exp(solution.values[0]) - 1.0)))),
        remarks=tuple(remarks),
        outliers=tuple(dict.fromkeys(int(order[row % len(f)]) for row in rows)),
        curves=tuple(curves),
        frequency_hz=frequency,
        quality=q,
        delay_s=delay,
        gain=_of_logarithm(solution.estimate("gain")),
        response=None if phase is None else np.stack([f, g, np.degrees(phase)], axis=1),
    )


def _unwrapped(phase_deg: Floats, remarks: list[Remark]) -> Floats:
    """Return the phase in radians, from near 0 at the lowest frequency."""
    phase = np.unwrap(np.radians(phase_deg))
    turned = round(float(phase[0]) / pi)  # 180 degrees at low frequency: an inverting amplifier or sensor
    if turned % 2:
        remarks.append(
            Remark(
                "the response is inverted at the lowest frequency; 180 degrees were subtracted", code="inverted-sensor"
            )
        )
    return np.asarray(phase - pi * turned)


def _delay(solution: Solution, resonance_hz: float, remarks: list[Remark]) -> Estimate:
    """Return the delay in s, 0 where none can be measured. Raises ``Unphysical`` for a phase that leads."""
    fitted = solution.estimate("delay_s")
    delay = Estimate(fitted.value / resonance_hz, fitted.standard_error / resonance_hz)
    if delay.value >= 0.0:
        return delay
    if not -delay.value <= 2.0 * delay.standard_error:
        raise Unphysical(f"the phase leads as by a delay of {delay.value:.3g} s; a lag has to be negative in phase_deg")
    remarks.append(Remark("no delay is measurable; delay_s is set to 0", code="assumed-value"))
    return Estimate(0.0, delay.standard_error)


def _response(f: Floats, x: Floats) -> tuple[Floats, Floats]:
    """Return gain and unwrapped phase in radians; x has ln gain, ln resonance, ln quality, delay times resonance."""
    at = np.exp(x[1])
    r = f / at
    real, imaginary = 1.0 - r * r, r / np.exp(x[2])
    phase = -np.arctan2(imaginary, real) - 2.0 * pi * r * (x[3] if len(x) > 3 else 0.0)
    return np.exp(x[0]) / np.hypot(real, imaginary), phase


def _best(f: Floats, g: Floats, phase: Floats | None) -> Solution:
    """Return the best of several starts: the highest point is the resonance unless another one fits better."""
    weight = np.ones(2)

    def residuals(x: Floats) -> Floats:
        """Compute the misfit: the logarithm of the gain, then the phase in radians, each weighted.

        Returns
        -------
        Floats
            Shape (points,), or (2 points,) with a phase.
        """
        gain, lag = _response(f, x)
        amplitude: Floats = weight[0] * np.log(gain / g)
        return amplitude if phase is None else np.concatenate([amplitude, weight[1] * (lag - phase)])

    peak = float(f[np.argmax(g)])
    low = float(np.median(g[: max(len(g) // 10, 1)]))
    quality = max(float(np.max(g)) / low, 0.7)
    names = ("gain", "frequency_hz", "quality", "delay_s")[: 3 if phase is None else 4]
    best: Solution | None = None
    for at in (peak, float(np.sqrt(f[0] * f[-1])), float(f[-1]) / 1.2):
        start = [log(low), log(at), log(quality)]
        if phase is not None:
            # The delay takes the phase at the highest frequency beyond the half turn of a second-order lag.
            start.append(max(-(float(phase[-1]) + (pi if f[-1] > at else 0.0)) / (2.0 * pi * float(f[-1]) / at), 0.0))
        try:
            solution = solve(residuals, start, names, [1.0, 0.3, 1.0, 1.0][: len(start)])
        except Unphysical:
            continue
        if best is None or solution.residuals @ solution.residuals < best.residuals @ best.residuals:
            best = solution
    if best is None:
        raise Unphysical("no resonance fits this response; is it gain, and phase_deg, against frequency?")
    for _ in range(2 if phase is not None else 0):  # gain and phase each by its own scatter
        spread = [float(np.sqrt(np.mean(part**2))) for part in np.split(best.residuals, 2)]
        if min(spread) <= _MIN_SCATTER:
            break
        weight *= np.clip(max(spread) / np.array(spread), 1.0, 100.0)
        best = solve(residuals, best.values, names, [1.0, 0.3, 1.0, 1.0])
    return best


def _of_logarithm(estimate: Estimate) -> Estimate:
    value = float(np.exp(estimate.value))
    return Estimate(value, value * estimate.standard_error)
