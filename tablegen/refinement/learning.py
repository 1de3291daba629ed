"""One round of iterative learning: a measured period -> the correction of the layer, by the slope of the model."""

from dataclasses import dataclass
from functools import partial
from math import pi

import numpy as np

from tablegen.certificate.line_errors import CHORD
from tablegen.numerics.arrays import Floats
from tablegen.planning.line_plan import LinePlan
from tablegen.refinement.departure import Departure, asked_position, departure, straight_line
from tablegen.refinement.displacement import harmonic_basis
from tablegen.refinement.measured import LineMeasurement
from tablegen.waveform.series import FourierSeries
from tablegen.waveform.window_fit import normal_equations

DEFAULT_GAIN = 0.7
DEFAULT_HARMONICS = 16
DIGITS = 8  # digits of a coefficient in the scan file: a 24-bit converter has 7
# Weight of the mean square acceleration: it decides what the windows leave open, and costs nothing inside them.
_SMOOTHNESS = 1e-9
_AKAIKE_COST = 4.0  # cost of the two numbers of a harmonic, after Akaike: the noise that learning it adds


@dataclass(frozen=True, eq=False)
class LayerUpdate:
    """What a round learns: ``layer`` is the new one, ``change`` by how much it differs from the one that was played.

    ``before`` was measured, ``after`` is what the model predicts. ``harmonics`` is 0 where nothing stands out of the
    noise, which after all averaging is ``noise_percent`` rms of the position, in percent of the line, and
    ``chord_noise_percent`` of its slope over a chord.
    """

    layer: FourierSeries
    change: FourierSeries
    harmonics: int
    before: Departure
    after: Departure
    noise_percent: float
    chord_noise_percent: float


def learn(line: LinePlan, measured: LineMeasurement, gain: float, harmonics: int) -> LayerUpdate:
    """Learn harmonics 1..``harmonics`` at most from a period of the running scan, at a gain in (0, 2).

    The position error in the imaged windows, times the slope of the model's branch there, is what the drive lacks. It
    is fitted by harmonics, the gentlest of those that fit, after what noise explains of each harmonic of the error was
    taken off.

    Raises
    ------
    Unphysical
        If the displacement is not that of the scan.
    """
    before = departure(line, measured)
    nodes = 4 * max(harmonics, measured.detail) + 32
    share = 0.5 - 0.5 * np.cos((np.arange(nodes) + 0.5) * pi / nodes)
    seen = departure(line, measured, share)
    points = seen.points
    # From coefficients of the displacement to the drive that is lacking, for the covariance.
    basis = measured.basis(points.times)
    line_of = np.column_stack([np.ones_like(points.asked), points.asked])
    errors: Floats = (basis - line_of @ (straight_line(points.asked) @ basis)) / seen.size_nm
    noisy = -gain * points.steepness * seen.error
    fits = _fits(points.times, harmonics)
    spread = [fit @ (gain * points.steepness[:, None] * errors) for fit in fits]
    stands_out = _stands_out([fit @ noisy for fit in fits], [s @ measured.covariance @ s.T for s in spread])
    learnt = harmonics if stands_out else 0
    noise_part = _noise_share(line, measured, seen.size_nm)
    lacking = noisy + gain * points.steepness * (errors @ noise_part)
    # The mean is not learnt: no sensor sees an origin.
    c = fits[-1] @ lacking if learnt else np.zeros(1)
    change = FourierSeries(0.0, c[1 : learnt + 1].copy(), c[learnt + 1 :].copy())
    old = line.layer if line.layer is not None else FourierSeries(0.0, np.zeros(0), np.zeros(0))
    whole = old.plus(change)
    layer = FourierSeries(0.0, np.round(whole.a, DIGITS), np.round(whole.b, DIGITS))
    after = before.moved(change.value(before.points.times))
    noise = np.sqrt(np.mean(np.sum((errors @ measured.covariance) * errors, axis=1)))
    chords = _chords(line, before, measured) / seen.size_nm
    chord_noise = np.sqrt(np.mean(np.sum((chords @ measured.covariance) * chords, axis=1)))
    return LayerUpdate(layer, change, learnt, before, after, 100.0 * float(noise), 100.0 * float(chord_noise))


def _chords(line: LinePlan, seen: Departure, measured: LineMeasurement) -> Floats:
    """From coefficients of the displacement to slopes over chords, in nm a line, at some places of the forward line."""
    x = seen.points.by_side(seen.points.position)["forward"]
    middle = np.linspace(float(x[0]) + 0.5 * CHORD, float(x[-1]) - 0.5 * CHORD, 41)
    ends = [measured.basis(line.drive.turn * (middle + by)) for by in (-0.5 * CHORD, 0.5 * CHORD)]
    slopes: Floats = (ends[1] - ends[0]) / CHORD
    return slopes


def _stands_out(coefficients: list[Floats], covariances: list[Floats]) -> bool:
    """Whether there is more than noise, by fits with 1, 2, ... harmonics.

    The highest harmonic of each fit explains chi squared of its cosine and sine, and costs as much as noise would on
    average, after Akaike; there is nothing to learn where no number of harmonics explains more than it costs.
    """
    explained = []
    for count, (c, covariance) in enumerate(zip(coefficients, covariances, strict=True), 1):
        top = [count, 2 * count]
        explained.append(float(c[top] @ np.linalg.solve(covariance[np.ix_(top, top)], c[top])))
    cost = np.cumsum([_AKAIKE_COST - chi for chi in explained])
    return bool(np.min(cost) < 0.0)


def _noise_share(line: LinePlan, measured: LineMeasurement, size_nm: float) -> Floats:
    """Return the part of the coefficients of the position error, in nm, that its noise explains.

    The error of a harmonic is taken for Gaussian, with a variance of its own. The likeliest variance is what chi
    squared of cosine and sine exceeds 2 by, which noise alone has on average; the mean of the error is then
    max(0, 1 - 2 / chi squared) of what was measured (empirical Bayes, as James and Stein). The rest is noise. The same
    goes for any group of n coefficients, with n for 2.
    """
    error = measured.error(partial(asked_position, line), size_nm)
    share = np.zeros(len(error))
    for group in measured.groups:
        explained = float(error[group] @ np.linalg.solve(measured.covariance[np.ix_(group, group)], error[group]))
        share[group] = min(len(group) / explained, 1.0) if explained > 0.0 else 1.0
    noise: Floats = share * error
    return noise


def _fits(times: Floats, harmonics: int) -> list[Floats]:
    """For 1, 2, ... harmonics the matrix from values at the times to the coefficients of their gentlest fit."""
    none, ones = np.zeros(len(times)), np.ones(len(times))
    normal, _ = normal_equations(times, none, none, ones, none, harmonics, _SMOOTHNESS)
    basis = harmonic_basis(times, harmonics)
    fits = []
    for count in range(1, harmonics + 1):
        first = np.r_[0 : count + 1, harmonics + 1 : harmonics + 1 + count]
        fit = np.linalg.solve(normal[np.ix_(first, first)], basis[:, first].T / len(times))
        fits.append(np.asarray(fit, dtype=np.float64))
    return fits
