"""Fit alpha to gains at scan frequencies, equation (23)."""

from dataclasses import dataclass
from math import sqrt

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.base.warnings import Remark, spoils
from tablegen.fitting.estimate import Curve, Estimate, Fit
from tablegen.fitting.least_squares import few_points, solve
from tablegen.fitting.outliers import outliers
from tablegen.numerics.arrays import Floats

_MIN_SCATTER = 1e-7
_LARGEST_ALPHA = 0.5  # as in the schema


@dataclass(frozen=True, kw_only=True)
class FrequencyFit(Fit):
    """The share alpha of the amplitude at ``reference_hz`` that a decade takes, and the gain there."""

    alpha: Estimate
    reference_hz: float
    gain: Estimate


def fit_frequency(frequency_hz: Floats, gain: Floats, reference_hz: float | None = None) -> FrequencyFit:
    """Fit the law of (23) to gains at frequencies, with errors in proportion to the gains.

    Parameters
    ----------
    frequency_hz
        Frequencies in Hz, shape (points,).
    gain
        Gains in any unit, shape (points,).
    reference_hz
        The rate at which the scan size was calibrated, which no fit can know; the lowest frequency by default.

    Raises
    ------
    Unphysical
        If the points make no law: too few, or no resonance above them.
    """
    remarks: list[Remark] = []
    if len(np.unique(frequency_hz)) < 2:
        raise Unphysical("one frequency does not determine alpha; measure over two decades")
    if reference_hz is None:
        reference_hz = float(np.min(frequency_hz))
        remarks.append(
            Remark(
                f"the reference is the lowest frequency, {reference_hz:g} Hz; give that of the size calibration",
                code="assumed-value",
            )
        )
    decades = np.log10(frequency_hz / reference_hz)
    scale = float(np.mean(gain))

    def residuals(x: Floats) -> Floats:
        """Compute the relative errors of (23).

        Returns
        -------
        Floats
            Dimensionless, shape (points,).
        """
        errors: Floats = x[1] * (1.0 - x[0] * decades) * scale / gain - 1.0
        return errors

    solution = solve(residuals, [0.03, 1.0], ("alpha", "gain"), [0.1, 1.0])
    alpha, height = solution.estimate("alpha"), solution.estimate("gain")
    raw = alpha.value
    if alpha.value < 0.0:
        if not -alpha.value <= 2.0 * alpha.standard_error:
            raise Unphysical(
                f"the gain rises by {-100.0 * alpha.value:.3g} % a decade, where (23) has it fall; leave out what "
                f"is near the resonance (--to-hz), above a tenth of it"
            )
        remarks.append(Remark("the gain does not fall with frequency; alpha is set to 0", code="assumed-value"))
        alpha = Estimate(0.0, alpha.standard_error)
    if alpha.value > _LARGEST_ALPHA:
        raise Unphysical(f"alpha = {alpha.value:.3g} is not a loss of a few percent per decade; are these gains?")
    expected = solution.values[1] * scale * (1.0 - raw * decades)
    if solution.freedom == 0:
        remarks.append(Remark("two points fit exactly, so errors cannot be estimated", code="few-points"))
    if "alpha" in solution.undetermined:
        remarks.append(
            spoils(
                "alpha is not determined by these points; measure over two decades or more",
                code="undetermined-parameter",
            )
        )
    if _rises(frequency_hz, solution.residuals, solution.jacobian):
        remarks.append(
            spoils(
                "the gain bends up towards high frequencies, as below a resonance; leave those out (--to-hz), what is "
                "above a tenth of the resonance",
                float(np.max(np.abs(100.0 * (gain / expected - 1.0)))),
                code="poor-fit",
            )
        )
    line = np.geomspace(float(np.min(frequency_hz)), float(np.max(frequency_hz)), 101)
    fitted = 1.0 - raw * np.log10(line / reference_hz)
    measured = gain / (solution.values[1] * scale)
    return FrequencyFit(
        points=len(gain),
        residual_percent=100.0 * (gain / expected - 1.0),
        before_percent=float(np.max(np.abs(100.0 * (measured - 1.0)))),
        remarks=tuple(remarks),
        outliers=outliers(solution.jacobian, solution.residuals, _MIN_SCATTER),
        curves=(Curve("gain", "frequency [Hz]", "gain [ratio]", (frequency_hz, measured), (line, fitted)),),
        alpha=alpha,
        reference_hz=reference_hz,
        gain=Estimate(height.value * scale, height.standard_error * scale),
    )


def _rises(frequency_hz: Floats, residuals: Floats, jacobian: Floats) -> bool:
    """Return True if a term in f^2, as of a resonance above, would take a significant part of the residuals."""
    freedom = len(residuals) - jacobian.shape[1] - 1
    if freedom < 2:
        return False
    bend = (frequency_hz / float(np.max(frequency_hz))) ** 2
    orthogonal, _ = np.linalg.qr(jacobian)
    bend = bend - orthogonal @ (orthogonal.T @ bend)
    deviation = -(residuals - orthogonal @ (orthogonal.T @ residuals))  # the residuals are model less data
    if float(bend @ bend) < 1e-12:
        return False
    height = float(bend @ deviation) / float(bend @ bend)
    rest = deviation - height * bend
    error = sqrt(float(rest @ rest) / freedom / float(bend @ bend)) * few_points(freedom)
    return height > max(3.0 * error, 1e-6)
