"""One round of iterative learning: from a measured period to the correction of the layer, by the slope of the model."""

from dataclasses import dataclass
from functools import partial
from math import pi

import numpy as np

from tablegen.certificate.line_errors import CHORD
from tablegen.numerics.arrays import Floats
from tablegen.planning.line_plan import LinePlan
from tablegen.refinement.departure import Departure, departure, imaged, requested_position, straight_line
from tablegen.refinement.displacement import harmonic_basis
from tablegen.refinement.measured import LineMeasurement
from tablegen.waveform.series import FourierSeries
from tablegen.waveform.window_fit import normal_equations

DEFAULT_GAIN = 0.7
DEFAULT_HARMONICS = 16
DIGITS = 8  # digits of a coefficient in the scan file: a 24-bit converter has 7
# Weight of the mean square acceleration, which determines the turnarounds and costs nothing inside the windows.
_SMOOTHNESS = 1e-9
_AKAIKE_COST = 4.0  # cost of the two numbers of a harmonic, after Akaike: the noise that learning it adds


@dataclass(frozen=True, eq=False)
class LayerUpdate:
    """The result of a round: ``layer`` is the new one, ``change`` its difference from the one that was played.

    ``before`` was measured, ``after`` is the prediction of the model. ``harmonics`` is 0 where no error stands out of
    the noise, which after all averaging is ``noise_percent`` rms of the position, in percent of the line, and
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

    The position error in the imaged windows, times the slope of the model's branch there, is the missing drive. It is
    fitted by harmonics, with the minimum acceleration among those that fit, after the noise's share of each harmonic of
    the error was subtracted.

    Raises
    ------
    Unphysical
        If the displacement is not that of the scan.
    """
    before = departure(line, measured)
    nodes = 4 * max(harmonics, measured.detail) + 32
    share = 0.5 - 0.5 * np.cos((np.arange(nodes) + 0.5) * pi / nodes)
    windowed = departure(line, measured, share)
    points = windowed.points
    # From coefficients of the displacement to the missing drive, for the covariance.
    basis = measured.basis(points.times)
    line_of = np.column_stack([np.ones_like(points.requested), points.requested])
    errors: Floats = (basis - line_of @ (straight_line(points.requested) @ basis)) / windowed.size_nm
    noisy = -gain * points.steepness * windowed.error
    # Nothing is added on a way back that was not measured: it is fitted to zero, which only shortens the matrices.
    fits = [fit[:, : len(points.times)] for fit in _fits(imaged(line, share).times, harmonics)]
    spread = [fit @ (gain * points.steepness[:, None] * errors) for fit in fits]
    stands_out = _stands_out([fit @ noisy for fit in fits], [s @ measured.covariance @ s.T for s in spread])
    count = harmonics if stands_out else 0
    noise_part = _noise_share(line, measured, windowed.size_nm)
    lacking = noisy + gain * points.steepness * (errors @ noise_part)
    # The mean is not learnt: a sensor has no absolute origin.
    c = fits[-1] @ lacking if count else np.zeros(1)
    change = FourierSeries(0.0, c[1 : count + 1].copy(), c[count + 1 :].copy())
    old = line.layer if line.layer is not None else FourierSeries(0.0, np.zeros(0), np.zeros(0))
    whole = old.plus(change)
    layer = FourierSeries(0.0, np.round(whole.a, DIGITS), np.round(whole.b, DIGITS))
    after = before.with_drive_change(change.value(before.points.times))
    noise = np.sqrt(np.mean(np.sum((errors @ measured.covariance) * errors, axis=1)))
    chords = _chords(line, before, measured) / windowed.size_nm
    chord_noise = np.sqrt(np.mean(np.sum((chords @ measured.covariance) * chords, axis=1)))
    return LayerUpdate(layer, change, count, before, after, 100.0 * float(noise), 100.0 * float(chord_noise))


def _chords(line: LinePlan, departure: Departure, measured: LineMeasurement) -> Floats:
    """Return the matrix from coefficients to slopes over chords, in nm per line, along the forward line."""
    x = departure.points.by_side(departure.points.position)["forward"]
    middle = np.linspace(float(x[0]) + 0.5 * CHORD, float(x[-1]) - 0.5 * CHORD, 41)
    ends = [measured.basis(line.drive.turn * (middle + by)) for by in (-0.5 * CHORD, 0.5 * CHORD)]
    slopes: Floats = (ends[1] - ends[0]) / CHORD
    return slopes


def _stands_out(coefficients: list[Floats], covariances: list[Floats]) -> bool:
    """Return true if the error is more than noise, by fits with 1, 2, ... harmonics.

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

    The error of a harmonic is taken for Gaussian, with a variance of its own. The likeliest variance is the excess of
    chi squared of cosine and sine over 2, its mean for noise alone; the mean of the error is then max(0, 1 - 2 / chi
    squared) of the measured one (empirical Bayes, as James and Stein). The rest is noise. The same holds for any group
    of n coefficients, with n for 2.
    """
    error = measured.error(partial(requested_position, line), size_nm)
    share = np.zeros(len(error))
    for group in measured.groups:
        explained = float(error[group] @ np.linalg.solve(measured.covariance[np.ix_(group, group)], error[group]))
        share[group] = min(len(group) / explained, 1.0) if explained > 0.0 else 1.0
    noise: Floats = share * error
    return noise


def _fits(times: Floats, harmonics: int) -> list[Floats]:
    """Return for 1, 2, ... harmonics the matrix from values to the coefficients of their minimum-acceleration fit."""
    none, ones = np.zeros(len(times)), np.ones(len(times))
    normal, _ = normal_equations(times, none, none, ones, none, harmonics, _SMOOTHNESS)
    basis = harmonic_basis(times, harmonics)
    fits = []
    for count in range(1, harmonics + 1):
        first = np.r_[0 : count + 1, harmonics + 1 : harmonics + 1 + count]
        fit = np.linalg.solve(normal[np.ix_(first, first)], basis[:, first].T / len(times))
        fits.append(np.asarray(fit, dtype=np.float64))
    return fits
