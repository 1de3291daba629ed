"""What a waveform may err by for the sake of less acceleration."""

from msgspec import Struct


class AllowedError(Struct, frozen=True):
    """A scaling error in percent, peak to peak; one that is not ``firm`` is kept where the harmonics can keep it."""

    percent: float
    firm: bool
