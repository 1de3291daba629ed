"""Follow plays, creep and a resonance in time: the columns of a least-squares fit to records."""

from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from tablegen.calibration.operator.time_record import TimeRecord
from tablegen.compensation.dynamics import Response, SecondOrder
from tablegen.compensation.operator.in_time import resonance_modes, turns_of
from tablegen.compensation.operator.plays import envelopes
from tablegen.numerics.arrays import Floats

Modes = tuple[NDArray[np.complex128], NDArray[np.complex128]]  # complex time constants in s, and gains
_LOW_FREQUENCY = 0.01  # of the resonance, at which a response measured in points is taken as a delay


class Begin(StrEnum):
    """State of the plays before the first sample: after v_min, without a past, after v_max, or of a settled loop."""

    AFTER_LOW = "after v_min"
    VIRGIN = "without a past"
    AFTER_HIGH = "after v_max"
    SETTLED = "settled"


@dataclass(frozen=True, eq=False)
class PlayBasis:
    """Plays of all ``thresholds``, shape (k,), for each row of ``bends``, shape (n, 4), and powers of the drive."""

    thresholds: Floats
    bends: Floats
    degree: int

    @property
    def plays(self) -> int:
        """The number of plays."""
        return len(self.thresholds) * len(self.bends)

    def penalty(self, ridge: float, smooth: float) -> Floats:
        """Return the penalty on squares of all weights, and on steps of the density of plays along the threshold.

        So loops that are smaller than those of the records follow from the density of plays that these have moved.

        Parameters
        ----------
        ridge
            Weight of the weights.
        smooth
            Weight of the steps: of neighbours, each weight over the way to the next lower threshold, relative to the
            mean way.

        Returns
        -------
        Floats
            Shape (plays + degree, plays + degree).
        """
        count = len(self.thresholds)
        ways = np.diff(self.thresholds, prepend=0.0)
        steps = np.diff(np.diag(np.mean(ways) / ways), axis=0)
        out = ridge * ridge * np.eye(self.plays + self.degree)
        for first in range(0, self.plays, count):
            part = slice(first, first + count)
            out[part, part] += smooth * smooth * steps.T @ steps
        return out

    def columns(self, u: Floats, begin: Begin) -> Floats:
        """Return the positions of the plays, then the powers of the drive.

        Parameters
        ----------
        u
            Normalised drives, shape (samples,).
        begin
            The state before the first of them.

        Returns
        -------
        Floats
            Shape (samples, plays + degree).
        """
        turns = turns_of(u)
        parts = [_plays(u, turns, bend, self.thresholds, begin) for bend in self.bends]
        return np.hstack([*parts, np.stack([u**n for n in range(1, self.degree + 1)], axis=1)])


def _plays(u: Floats, turns: list[int], bend: Floats, r: Floats, begin: Begin) -> Floats:
    lower, upper = envelopes(u, bend)
    rest = {Begin.AFTER_LOW: 0.0, Begin.AFTER_HIGH: 1.0}.get(begin, float(u[0]))
    least, most = (float(one) for one in envelopes(rest, bend))
    first = {Begin.AFTER_LOW: most + r, Begin.AFTER_HIGH: least - r}.get(begin, np.full(len(r), 0.5 * (least + most)))
    out = np.empty((len(u), len(r)))
    for _ in range(2 if begin is Begin.SETTLED else 1):
        state = np.minimum(np.maximum(first, lower[0] - r), upper[0] + r)
        out[0] = state
        for start, end in pairwise(turns):
            part = slice(start + 1, end + 1)
            if u[end] >= u[start]:
                out[part] = np.maximum(state, np.maximum.accumulate(lower[start : end + 1])[1:, None] - r)
            else:
                out[part] = np.minimum(state, np.minimum.accumulate(upper[start : end + 1])[1:, None] + r)
            state = out[end]
        first = state.copy()
    return out


def late_sum(
    time_s: Floats,
    columns: Floats,
    taus_s: Floats | NDArray[np.complex128],
    weights: NDArray[np.complex128] | None = None,
) -> Floats:
    """Return the sum over the time constants of s, of tau s' = y - s, for columns that are linear between the times.

    Parameters
    ----------
    time_s
        Ascending times in s, shape (samples,).
    columns
        Inputs y, shape (samples, columns); before the first time they are taken to have rested at their first values.
    taus_s
        Time constants in s, complex ones of complex modes, shape (terms,).
    weights
        Of each term, shape (terms,); 1 by default.

    Returns
    -------
    Floats
        Shape (samples, columns).
    """
    taus = np.asarray(taus_s)[:, None]
    share = np.ones(len(taus)) if weights is None else weights
    x = np.diff(time_s)[:, None, None] / taus
    decay, lost = np.exp(-x), -np.expm1(-x)
    first = np.where(np.abs(x) > 1e-5, lost / np.where(x == 0.0, 1.0, x), 1.0 - 0.5 * x)
    before, after = first - decay, 1.0 - first
    state = np.repeat(columns[:1], len(taus), axis=0).astype(decay.dtype)
    out = np.empty_like(columns)
    out[0] = (share @ state).real
    for i in range(len(x)):
        state = decay[i] * state + before[i] * columns[i] + after[i] * columns[i + 1]
        out[i + 1] = (share @ state).real
    return out


def transients(time_s: Floats, taus_s: Floats) -> Floats:
    """Return exp(-t / tau), whose weights are the unknown states of creep at the start.

    Returns
    -------
    Floats
        Shape (samples, terms).
    """
    out: Floats = np.exp(-time_s[:, None] / taus_s)
    return out


def resonance_and_delay(response: Response | None, delay_s: float) -> tuple[Modes | None, float]:
    """Return the two modes of a resonance, as complex time constants and weights, and the delay of all channels in s.

    Of a response that was measured in points only the delay at low frequencies is known in time.
    """
    if response is None:
        return None, delay_s
    if not isinstance(response, SecondOrder):
        f_hz = np.array([_LOW_FREQUENCY * response.resonance_hz])
        real, imaginary = response.inverse(f_hz)
        return None, delay_s + float(np.arctan2(imaginary, real)[0] / (2.0 * np.pi * f_hz[0]))
    taus, gains = resonance_modes(response)
    return (np.array(taus), np.array(gains)), delay_s + response.delay_s


def modal(record: TimeRecord, columns: Floats, modes: Modes | None) -> Floats:
    """Return the columns behind a resonance; without one as they are.

    Parameters
    ----------
    columns
        Shape (samples, columns).
    """
    if modes is None:
        return columns
    taus, gains = modes
    return late_sum(record.time_s, columns, taus, gains)
