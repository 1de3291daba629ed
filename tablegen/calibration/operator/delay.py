"""Fit the delay of the sensor after the drive from the lines themselves: hysteresis and creep turn with the drive.

A late sensor shows a position that goes on after the turn. As a function of the drive both branches then have a hook at
their ends, which takes many more Chebyshev orders than the hysteresis of a piezo. So the delay is the one with which
the rows of all lines are the likeliest, each order of a strength of its own, whatever the hysteresis.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.calibration.operator.branches import DEGREE, branch_residual
from tablegen.calibration.operator.periodic_line import PHASES, PeriodicLine
from tablegen.compensation.dynamics import Response
from tablegen.compensation.operator.creep import LogarithmicCreep
from tablegen.compensation.operator.family import Family
from tablegen.compensation.operator.field import Lengths, covariance
from tablegen.compensation.operator.plays import NO_PLAYS
from tablegen.fitting.estimate import Estimate

_MOST = 0.02  # of the shortest period: larger delays are not searched
_COARSE, _FINE = 0.002, 0.0004  # steps of it
_LOSSES = (0.0, 0.02, 0.04)  # of creep, per decade, on which the delay hardly depends
_STROKE_LENGTHS = (0.4, 1.5)
_CENTRE_LENGTH = 1.0
_POWERS = np.geomspace(1e-2, 1e10, 49)  # variance of an order over that of its noise
_FLOOR = 1e-14  # least variance of a coefficient
_NEAR, _SHARP = 0.01, 0.01  # a triangle is 0.02 of its stroke from its turns after 0.01 of the period, a sine 0.001
_PHASE_SHARE = 0.9  # of the resonance, up to which phases are corrected; ``without`` corrects up to 0.3


def fit_delay(lines: Sequence[PeriodicLine], response: Response | None) -> Estimate:
    """Fit the delay in s of the sensor that recorded all lines, beyond the dynamics of ``response``.

    Raises
    ------
    Unphysical
        If no delay is the likeliest.
    """
    for line in lines:
        if _sharpness(line) < _SHARP:
            raise Unphysical(
                f"{line.name}: the drive is rounded at its turns, where a delay shows; fit the delay to triangles, "
                "or give it with --delay-s S"
            )
    still = [_in_phase(line.without(response, None), response) for line in lines]
    gain = float(np.mean([np.ptp(line.displacement_nm) / line.stroke for line in still]))
    straight = Family(NO_PLAYS).over(np.array([gain]))
    period_s = min(1.0 / line.rate_hz for line in lines)
    count = round(_MOST / _COARSE)
    misfit_at: dict[float, float] = {}

    def best_of(steps: Sequence[int], step: float, losses: Sequence[float]) -> float:
        delays = [period_s * step * i for i in steps]
        misfits = [min(_unlikelihood(still, straight, delay, loss) for loss in losses) for delay in delays]
        misfit_at.update(zip(delays, misfits, strict=True))
        return delays[int(np.argmin(misfits))]

    coarse = best_of(range(-count, count + 1), _COARSE, _LOSSES[1:2])
    if abs(coarse) > period_s * (_MOST - 0.5 * _COARSE):
        raise Unphysical(
            f"no delay below {_MOST * period_s:.3g} s, {100.0 * _MOST:g} % of the shortest period, fits; give it with "
            "--delay-s S, or shift the column of the sensor"
        )
    misfit_at.clear()
    near, half = round(coarse / (period_s * _FINE)), round(0.75 * _COARSE / _FINE)
    best_of(range(near - half, near + half + 1), _FINE, _LOSSES)
    delays, values = np.array(list(misfit_at)), np.array(list(misfit_at.values()))
    at = int(np.clip(np.argmin(values), 1, len(values) - 2))
    before, middle, after = values[at - 1 : at + 2]
    bend = float(before - 2.0 * middle + after)
    step = period_s * _FINE
    if not bend > 0.0:
        raise Unphysical("the traces do not determine the delay of the sensor; give it with --delay-s S")
    return Estimate(float(delays[at] + 0.5 * step * (before - after) / bend), float(step * np.sqrt(2.0 / bend)))


def _sharpness(line: PeriodicLine) -> float:
    """Return the share of the stroke by which the drive is away from its turns, ``_NEAR`` of the period around them."""
    at = round(_NEAR * PHASES)
    high, low = int(np.argmax(line.drive)), int(np.argmin(line.drive))
    around = [abs(line.drive[turn] - line.drive[(turn + by) % PHASES]) for turn in (high, low) for by in (-at, at)]
    return float(np.mean(around)) / line.stroke


def _in_phase(line: PeriodicLine, response: Response | None) -> PeriodicLine:
    """Correct the phases, but not the sizes, of frequencies that ``without`` does not correct for the dynamics."""
    if response is None:
        return line
    f_hz = line.rate_hz * np.arange(PHASES // 2 + 1, dtype=np.float64)
    inside = (f_hz > line.highest_corrected_hz(response)) & (f_hz <= _PHASE_SHARE * response.resonance_hz)
    spectrum = np.fft.rfft(line.displacement_nm)
    if np.any(inside):
        real, imaginary = response.inverse(f_hz[inside])
        inverse = real + 1j * imaginary
        spectrum[inside] *= inverse / np.abs(inverse)
    return replace(line, displacement_nm=np.fft.irfft(spectrum, PHASES))


def _unlikelihood(lines: Sequence[PeriodicLine], straight: Family, delay_s: float, loss: float) -> float:
    """Return -2 log of the likelihood of the lines' residuals beside straight ones, of the best length."""
    creep = None
    if loss > 0.0:
        rates = [line.rate_hz for line in lines]
        creep = LogarithmicCreep(loss, 1e-3 / max(rates), 10.0 / min(rates), max(rates))
    residuals = [branch_residual(line.earlier(delay_s).without(None, creep), straight) for line in lines]
    points = np.array([(line.stroke, line.centre) for line in lines])
    noise = np.maximum(np.mean([one.variance for one in residuals], axis=0), _FLOOR)
    rows = np.stack([one.coefficients for one in residuals]) / np.sqrt(noise)
    misfits = []
    for stroke in _STROKE_LENGTHS:
        prior = covariance(points, points, Lengths(stroke, _CENTRE_LENGTH, 0.0), straight=True)
        values, vectors = np.linalg.eigh(prior)
        along = vectors.T @ rows
        spread = 1.0 + _POWERS[:, None] * np.maximum(values, 0.0)
        each = (1.0 / spread) @ (along * along) + np.sum(np.log(spread), axis=1)[:, None]
        both = each[:, : DEGREE + 1] + each[:, DEGREE + 1 :]
        misfits.append(float(np.sum(np.min(both, axis=0))) + len(lines) * float(np.sum(np.log(noise))))
    return min(misfits)
