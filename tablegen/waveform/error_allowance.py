"""The error that a waveform may have in exchange for less acceleration."""

from msgspec import Struct


class AllowedError(Struct, frozen=True):
    """A scaling error in percent, peak to peak; one that is not ``firm`` is kept where the harmonics can keep it."""

    percent: float
    firm: bool
