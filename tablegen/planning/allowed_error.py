"""The scaling error that a waveform may keep in exchange for less acceleration: as requested, or below what shows."""

from tablegen.config.schema import BandLimit, Limits
from tablegen.waveform.error_allowance import AllowedError

CHORD = 0.05  # share of the line over which the certificate measures emitted integers
_UNLIMITED_PERCENT = 1.0  # the error that is not reported
MOST_HARMONICS = 256  # a search among more takes many seconds


def allowed_error(limit: BandLimit, limits: Limits, codes: float, counts_turns: bool) -> AllowedError | None:
    """Return the scaling error that one axis may keep; None where none is allowed.

    Where neither harmonics nor an error are requested it is what rounding to codes leaves: up to half a code at
    either end of a chord, with either sign. It is then at most half of what the limits of the scan leave. This holds
    for models that count with the turns of the waveform (``counts_turns``): rounder turns move a line by the others.

    Parameters
    ----------
    codes
        Codes of the converter that the drive spans from w = 0 to 1.
    """
    if limit.max_scaling_error_percent is not None:
        return AllowedError(limit.max_scaling_error_percent, True)
    free = limit.harmonics == "fewest" or (limit.harmonics is None and counts_turns)
    if limit.method != "window" or limit.cutoff_hz is not None or not free or not codes > 0.0:
        return None
    most = 0.5 * min(limits.max_scaling_error_percent or _UNLIMITED_PERCENT, _UNLIMITED_PERCENT)
    return AllowedError(min(100.0 * 2.0 / (CHORD * codes), most), limit.harmonics == "fewest")


def chosen_by_build(limit: BandLimit) -> bool:
    """Return True if the build finds the number of harmonics: the fewest, or an error without any limit of the band."""
    alone = limit.harmonics is None and limit.cutoff_hz is None
    return limit.harmonics == "fewest" or (alone and limit.max_scaling_error_percent is not None)
