"""Warnings of a fit, the worst first: reasons why it is meaningless, outliers, remarks."""

from collections.abc import Sequence

from tablegen.base.warnings import Finding, of_remarks, worst_first
from tablegen.calibration.fit_checks import doubts
from tablegen.fitting.estimate import Fit


def fit_findings(fit: Fit, places: Sequence[str], points: bool = False) -> list[Finding]:
    """Return the warnings of a fit.

    Parameters
    ----------
    places
        File and line of each outlier.
    points
        True if measured values are written in place of a law.
    """
    findings = [
        Finding("limit", 0.0, text, "\u2717 means nothing", "warning", "insignificant-fit")
        for text in doubts(fit, points)
    ]
    findings += [
        Finding(
            "spoils",
            abs(float(fit.residual_percent[row])) if row < len(fit.residual_percent) else 0.0,
            f"{place}: far from the other points, but used",
            "! outlier",
            "outlier",
            "outlying-samples",
        )
        for row, place in zip(fit.outliers, places, strict=True)
    ]
    return worst_first([*findings, *of_remarks(fit.remarks)])
