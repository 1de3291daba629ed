"""Fit beta_max, rho and u_peak of each branch to trace and retrace images of a periodic sample, at several amplitudes.

Each pair of images is one amplitude.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.base.warnings import Remark, spoils
from tablegen.calibration.laws.hysteresis import TYPICAL_RHO, HysteresisFit, combined
from tablegen.images.missing import missing_text
from tablegen.images.pair_fit import ImageFit, fit_pair
from tablegen.numerics.arrays import Floats
from tablegen.numerics.driver import Driver

_POOR_FIT_PERCENT = 1.0
_MIN_PIXELS_PER_PERIOD = 4.0  # pixels in the shortest period


@dataclass(frozen=True)
class Pair:
    """Two images of one scan at ``v_scan`` V peak to peak, heights in any unit, rows x columns each; and a name."""

    name: str
    v_scan: float
    trace: Floats
    retrace: Floats


def fit_images(
    pairs: Sequence[Pair],
    v_max: Driver | float,
    rho: float = TYPICAL_RHO,
    turn: float = 0.5,
    window: tuple[float, float] = (0.0, 1.0),
    retrace_mirrored: bool = False,
    delay_pixels: float = 0.0,
) -> HysteresisFit:
    """Fit both branches to images of a triangle's scan; see ``fit_pair`` for the treatment of a pair.

    Parameters
    ----------
    rho
        Decay constant of (22) where there is one amplitude only.

    Raises
    ------
    Unphysical
        If a pair does not support the fit; the message has its name.
    """
    driver = Driver.of(v_max)
    fits: list[ImageFit] = []
    remarks: list[Remark] = []
    for pair in pairs:
        try:
            if not 0.0 < pair.v_scan <= 1.02 * driver.span:
                raise Unphysical(f"a scan of {pair.v_scan:g} V is outside the driver's {driver}")
            fit = fit_pair(pair.trace, pair.retrace, pair.v_scan, turn, window, retrace_mirrored, delay_pixels)
        except Unphysical as reason:
            raise Unphysical(f"{pair.name}: {reason}" if pair.name else str(reason)) from None
        fits.append(fit)
        if lacking := missing_text([pair.trace, pair.retrace]):
            remarks.append(Remark(lacking, code="missing-pixels").under(pair.name))
        remarks += [text.under(pair.name) for text in _remarks(fit)]
    for one, other in combinations(pairs, 2):
        if np.array_equal(one.trace, other.trace) or np.array_equal(one.retrace, other.retrace):
            name = f"{other.name}: " if other.name else ""
            raise Unphysical(f"{name}images of {one.v_scan:g} V and of {other.v_scan:g} V are the same")
    volts = [pair.v_scan for pair in pairs]
    if len(set(volts)) < len(volts):
        remarks.append(
            spoils(
                "some pairs have the same voltage",
                code="pair-voltages",
            )
        )
    for less, more in pairwise(sorted(fits, key=lambda fit: fit.v_scan)):
        if more.periods < less.periods and more.registration_percent < less.registration_percent:
            remarks.append(
                spoils(
                    f"{more.v_scan:g} V have fewer periods in the line and less hysteresis than {less.v_scan:g} V; "
                    f"are the voltages those of their pairs?",
                    code="pair-voltages",
                )
            )
    return combined(fits, driver.span, rho, remarks)


def _remarks(fit: ImageFit) -> list[Remark]:
    remarks: list[Remark] = []
    worst = float(np.max(np.abs(fit.residual_percent)))
    if worst > _POOR_FIT_PERCENT:
        remarks.append(
            spoils(
                f"the harmonic model leaves {worst:.2g} % of the line; was the drive the triangle itself, is --window "
                f"what the columns span, and does the feedback follow?",
                worst,
                code="poor-fit",
            )
        )
    if fit.widened > 3.0:
        remarks.append(
            Remark(
                f"the rest is not only noise, but also what the model does not describe; standard errors were "
                f"widened by a factor of {fit.widened:.3g}; a --window that is not that of the images does that too",
                code="widened-errors",
            )
        )
    if fit.pixels_a_period < _MIN_PIXELS_PER_PERIOD:
        remarks.append(
            Remark(
                f"the shortest period has {fit.pixels_a_period:.2g} pixels",
                code="few-pixels",
            )
        )
    if fit.explained < 0.5:
        remarks.append(
            Remark(
                f"{100.0 * fit.explained:.0f} % of the contrast is periodic, the rest noise, debris or defects",
                code="aperiodic-contrast",
            )
        )
    if fit.strays:
        numbers = ", ".join(str(i + 1) for i in fit.strays[:5]) + (", ..." if len(fit.strays) > 5 else "")
        remarks.append(
            Remark(
                f"{len(fit.strays)} lines differ from the others (row {numbers}); they were used",
                code="outlying-samples",
            )
        )
    for name, side in (("forward", fit.forward), ("backward", fit.backward)):
        if side.u_peak.standard_error > 0.1:
            remarks.append(
                spoils(
                    f"u_peak {name} is not determined by these images; scan more periods, or average",
                    code="undetermined-parameter",
                )
            )
    return remarks
