"""Loss of amplitude with the scan rate, equation (23)."""

from tablegen.numerics.elementary import log10
from tablegen.problems import Unphysical


def frequency_gain(rate_hz: float, alpha: float, reference_hz: float) -> float:
    """g = 1 / (1 - alpha log10(f / f_DH)): what restores the amplitude of (23), R normalised to its value at f_DH."""
    response = 1.0 - alpha * log10(rate_hz / reference_hz)
    if response < 0.5:
        raise Unphysical(
            f"at {rate_hz:g} Hz equation (23) leaves {response:.3g} of the amplitude; it was fitted to a few percent "
            f"a decade and holds down to 0.5"
        )
    return 1.0 / response
