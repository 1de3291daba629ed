"""Compare the response of the scanner file with the harmonics of the traces, to find one of another piezo.

Where the drive has sharp turns, the harmonics of the position are those of the drive times the response, but for
hysteresis, which changes the corners by less than a factor of 2.
"""

from collections.abc import Sequence
from math import exp, log, sqrt

import numpy as np

from tablegen.base.warnings import Remark
from tablegen.calibration.operator.periodic_line import PHASES, PeriodicLine
from tablegen.compensation.dynamics import Response
from tablegen.numerics.arrays import Floats

_MOST_RATIO = 3.0  # of measured and expected gain, by which they may differ
_ADJACENT = 6  # harmonics that have to differ, one after the other
_NOISE = 5.0  # least strength of a pair of harmonics over the noise
_LEAST_CORNER = 1e-3  # of the fundamental: n^2 times a harmonic of a drive with sharp turns
_LEAST_NOISE = 1e-9  # of the fundamental
_SAMPLES = 6.0  # of the record, a period of the highest harmonic


def response_remarks(lines: Sequence[PeriodicLine], response: Response | None) -> tuple[Remark, ...]:
    """Return a remark if a line moved otherwise than the response says; the one that differs most.

    Parameters
    ----------
    lines
        Settled lines, with their dynamics.
    response
        The response of the scanner file; None: nothing is compared.
    """
    if response is None:
        return ()
    departures = [one for line in lines if (one := _largest(line, response)) is not None]
    if not departures:
        return ()
    departure, f_hz, name = max(departures, key=lambda one: abs(one[0]))
    text = (
        f"{name}: at {f_hz:.3g} Hz the axis moved {exp(departure):.2g} times as much as the response of the scanner "
        "file says; it is of another piezo, or the recorder has a filter"
    )
    return (Remark(text, "spoils", 0.0, "other-response"),)


def _largest(line: PeriodicLine, response: Response) -> tuple[float, float, str] | None:
    """Return the largest departure of adjacent harmonics, as a logarithm, its frequency in Hz, and the line's name."""
    n = np.arange(1.0, min(line.samples / _SAMPLES, response.highest_hz / line.rate_hz, PHASES / 4) + 1.0)
    if len(n) < _ADJACENT:
        return None
    last = len(n)
    drive, moved = (_pairs(values)[1 : last + 1] for values in (line.drive, line.displacement_nm))
    real, imaginary = response.inverse(n * line.rate_hz)
    inverse = np.hypot(real, imaginary)
    expected = drive * (moved[0] / drive[0]) * inverse[0] / inverse
    noise = max(line.noise_nm * PHASES / sqrt(min(line.samples, PHASES)), _LEAST_NOISE * float(moved[0]))
    clear = (n * n * drive > _LEAST_CORNER * drive[0]) & (np.maximum(moved, expected) > _NOISE * noise)
    departure = np.log(np.maximum(moved, noise) / np.maximum(expected, noise))
    worst: tuple[float, float, str] | None = None
    for sign in (1.0, -1.0):
        differs = clear & (sign * departure > log(_MOST_RATIO))
        runs = np.convolve(differs, np.ones(_ADJACENT), "valid") == _ADJACENT
        for at in np.flatnonzero(runs).tolist():
            middle = at + _ADJACENT // 2
            one = float(departure[middle])
            if worst is None or abs(one) > abs(worst[0]):
                worst = one, float(n[middle]) * line.rate_hz, line.name
    return worst


def _pairs(values: Floats) -> Floats:
    """Return the strength of each harmonic and the next one: those of one parity may be missing."""
    spectrum = np.abs(np.fft.rfft(values))
    pairs: Floats = np.hypot(spectrum, np.append(spectrum[1:], 0.0))
    return pairs
