"""Fit the creep and the loss angle that a measured response contains, by its points far below the resonance.

There dynamics are a dead time and the slow rise of the gain towards the resonance. What falls with the logarithm of the
frequency is creep, and a lag that does not vanish towards 0 Hz is the loss angle of hysteresis and creep.
"""

from collections.abc import Callable

import numpy as np

from tablegen.compensation.dynamics import Measured, Response
from tablegen.compensation.operator.creep import LogarithmicCreep
from tablegen.compensation.operator.sweep_loss import SweepLoss
from tablegen.numerics.arrays import Floats

_HIGHEST = 0.2  # of the resonance: points above do not count
_LEAST_POINTS = 12
_LEAST_RANGE = 3.0  # ratio of the highest frequency to the lowest
_LEAST_LOSS, _MOST_LOSS = 0.003, 0.06  # of creep, per decade
_START, _STEP = 0.02, 0.001
_ROUNDS = 4
_SURE = 6.0  # standard errors of a loss or an angle that is taken out
_LEAST_TURNS = 1.5e-4  # smallest angle that matters: 0.05 degrees, 0.03 % of the line between trace and retrace
_MOST_TURNS = 0.04  # a larger angle is no loss of a piezo

CreepOf = Callable[[float], LogarithmicCreep]


def fit_sweep_loss(response: Response | None, creep_of: CreepOf) -> SweepLoss | None:
    """Return the creep and the loss angle in a response; None where it has none, or does not tell.

    ``creep_of`` gives the creep of a loss per decade.
    """
    if not isinstance(response, Measured):
        return None
    low = response.f_hz <= _HIGHEST * response.resonance_hz
    f = response.f_hz[low]
    if len(f) < _LEAST_POINTS or f[-1] < _LEAST_RANGE * f[0]:
        return None
    loss = _loss_of(f, np.log(response.gain[low]), creep_of)
    creep = creep_of(loss) if loss else None
    phase = response.phase_turns[low] - round(2.0 * float(response.phase_turns[0])) / 2.0
    if creep is not None:
        phase = phase - np.angle(_response(creep, f)) / (2.0 * np.pi)
    x = f / f[-1]
    (start, *_), errors = _least_squares(np.stack([np.ones(len(f)), x, x**3], axis=1), phase)
    angle = -float(start)
    if abs(angle) > _MOST_TURNS or not (creep or abs(angle) > max(_SURE * float(errors[0]), _LEAST_TURNS)):
        return None
    return SweepLoss(round(angle, 9), creep)


def _loss_of(f: Floats, log_gain: Floats, creep_of: CreepOf) -> float:
    """Return the loss per decade with which the gain falls, 0 where it is not sure."""
    x = f / f[-1]
    loss, error = _START, np.inf
    for _ in range(_ROUNDS):
        here, ahead = (np.log(np.abs(_response(creep_of(one), f))) for one in (loss, loss + _STEP))
        basis = np.stack([(ahead - here) / _STEP, np.ones(len(f)), x**2, x**4], axis=1)
        values, errors = _least_squares(basis, log_gain - here)
        loss, error = float(np.clip(loss + values[0], 0.5 * _LEAST_LOSS, 2.0 * _MOST_LOSS)), float(errors[0])
    return loss if _LEAST_LOSS <= loss <= _MOST_LOSS and loss > _SURE * error else 0.0


def _response(creep: LogarithmicCreep, f: Floats) -> np.ndarray[tuple[int], np.dtype[np.complex128]]:
    real, imaginary = creep.response(f)
    return np.asarray(real + 1j * imaginary, dtype=np.complex128)


def _least_squares(basis: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Return the best coefficients, and their standard errors by what is left; each of shape (coefficients,)."""
    best = np.asarray(np.linalg.lstsq(basis, values, rcond=None)[0], dtype=np.float64)
    residual = values - basis @ best
    variance = float(residual @ residual) / (len(values) - len(best))
    errors: Floats = np.sqrt(variance * np.diag(np.linalg.pinv(basis.T @ basis)))
    return best, errors
