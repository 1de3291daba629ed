"""Checks that keep a meaningless fit out of a scanner file: insignificant parameters, and laws that miss the data.

A remark is advice; a doubt means that the correction would be noise, or worse than none. The limits are those of the
table in docs/calibration.md.
"""

from collections.abc import Iterator
from math import isfinite

from tablegen.calibration.laws.frequency import FrequencyFit
from tablegen.calibration.laws.hysteresis import HysteresisFit
from tablegen.calibration.laws.offset import OffsetFit
from tablegen.calibration.laws.offset_sizes import OffsetSizesFit
from tablegen.calibration.laws.resonance import ResonanceFit
from tablegen.calibration.laws.size import SizeFit
from tablegen.fitting.estimate import Estimate, Fit
from tablegen.fitting.growth import Growth

_ERRORS = 2.0  # standard errors of a 95 % interval
_LOOSE = 0.2  # relative error: a size or a frequency that may be wrong by a fifth is not calibrated
_LOOSE_BETA = 0.1  # of (6): a tenth of the size at full scale
_LOOSE_ALPHA = 0.01  # of (23), a decade
_LOOSE_PEAK = 0.5  # of the sweep: half of it leaves the peak anywhere
_LOOSE_DELAY = 0.1  # periods of the resonance
_SMALL_OFFSET = 0.01  # of the size
_LAW_ERRORS, _LAW_SHARE = 10.0, 0.25  # misfit of a law, in standard errors and as a share of the effect


def doubts(fit: Fit, points: bool = False) -> tuple[str, ...]:
    """List the reasons why a fit is meaningless, with what to do; empty for a fit that can be written.

    With ``points`` measured values are written in place of a law, so that a law that misses them does not count.

    Raises
    ------
    NotImplementedError
        If the fit is of no known kind.
    """
    match fit:
        case HysteresisFit():
            doubtful = _hysteresis(fit, points)
        case OffsetFit():
            doubtful = _offset(fit)
        case OffsetSizesFit():
            doubtful = (f"images of {one.size_v:g} V: {doubt}" for one in fit.sizes for doubt in _offset(one))
        case SizeFit():
            doubtful = _size(fit)
        case FrequencyFit():
            doubtful = _frequency(fit)
        case ResonanceFit():
            doubtful = iter(()) if points else _resonance(fit)
        case _:
            raise NotImplementedError(type(fit))
    return tuple(doubtful)


def _hysteresis(fit: HysteresisFit, points: bool) -> Iterator[str]:
    for branch in fit.branches:
        for side in ("forward", "backward"):
            growth: Growth = getattr(branch, side)
            name = f"turn {branch.turn.value:.3g}, {side}"
            beta = getattr(branch.traces[-1], side).beta if points else growth.beta_max
            what = f"beta of {branch.traces[-1].v_scan:.4g} V" if points else "beta_max"
            if _within(beta, beta.value):
                yield (
                    f"{name}: {what} = {_text(beta)} is less than {_ERRORS:g} standard errors from none; "
                    "average more periods, and drive further"
                )
            if _within(growth.u_peak, _LOOSE_PEAK):
                yield f"{name}: u_peak = {_text(growth.u_peak)} may be anywhere; average more periods"
            misses = growth.off_errors > _LAW_ERRORS and growth.off_share > _LAW_SHARE
            if misses and not points:
                yield (
                    f"{name}: (22) misses the measured residuals by {growth.off_errors:.3g} standard errors, "
                    f"{100.0 * growth.off_share:.0f} % of the largest; look at the traces one by one, or take --points"
                )


def _offset(fit: OffsetFit) -> Iterator[str]:
    both = (("m_minus", fit.m_minus), ("m_plus", fit.m_plus))
    for name, m in both:
        if _within(m, _LOOSE):
            yield f"{name} = {_text(m)} may be off by a fifth or more; {_MORE_OFFSETS}"
    if all(_within(m, max(abs(m.value - 1.0), _SMALL_OFFSET)) for _, m in both):
        values = f"m_minus = {_text(fit.m_minus)} and m_plus = {_text(fit.m_plus)}"
        yield f"{values} cannot be distinguished from 1; {_MORE_OFFSETS}"


_MORE_OFFSETS = "measure at more offsets, or a larger object"


def _size(fit: SizeFit) -> Iterator[str]:
    more = "measure more sizes, over most of the range"
    if _within(fit.k_nm_per_v, _LOOSE * fit.k_nm_per_v.value):
        yield f"k_nm_per_v = {_text(fit.k_nm_per_v)} may be off by a fifth or more; {more}"
    if _within(fit.beta, max(abs(fit.beta.value), _LOOSE_BETA)):
        yield f"beta = {_text(fit.beta)} cannot be distinguished from 0, the linear scanner; {more}"


def _frequency(fit: FrequencyFit) -> Iterator[str]:
    if _within(fit.alpha, max(fit.alpha.value, _LOOSE_ALPHA)):
        more = "measure over more decades, and more often"
        yield f"alpha = {_text(fit.alpha)} cannot be distinguished from 0, no loss; {more}"


def _resonance(fit: ResonanceFit) -> Iterator[str]:
    more = "measure more points around the resonance, or take --points"
    if _within(fit.frequency_hz, _LOOSE * fit.frequency_hz.value):
        yield f"frequency_hz = {_text(fit.frequency_hz)} may be off by a fifth or more; {more}"
    if _within(fit.quality, fit.quality.value):
        yield f"quality = {_text(fit.quality)} is less than {_ERRORS:g} standard errors from none; {more}"
    if _within(fit.delay_s, _LOOSE_DELAY / fit.frequency_hz.value):
        yield f"delay_s = {_text(fit.delay_s)} may be off by a tenth of the resonance's period or more; {more}"


def _within(estimate: Estimate, size: float) -> bool:
    """Return True if two standard errors exceed a size; an unknown error does not."""
    return isfinite(estimate.standard_error) and _ERRORS * estimate.standard_error >= size


def _text(estimate: Estimate) -> str:
    return f"{estimate.value:.3g} ± {estimate.standard_error:.2g}"
