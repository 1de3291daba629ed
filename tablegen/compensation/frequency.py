"""Loss of amplitude with the scan rate, equation (23)."""

from tablegen.base.figures import at_most
from tablegen.base.input_errors import Unphysical
from tablegen.numerics.elementary import log10

_MIN_RESPONSE = 0.5


def frequency_gain(rate_hz: float, alpha: float, reference_hz: float) -> float:
    """Return g = 1 / (1 - alpha log10(f / f_DH)), which restores the amplitude of (23); R is 1 at f_DH.

    Raises
    ------
    Unphysical
        If (23) leaves less than half of the amplitude.
    """
    response = 1.0 - alpha * log10(rate_hz / reference_hz)
    if response < _MIN_RESPONSE:
        highest = reference_hz * 10.0 ** min(_MIN_RESPONSE / alpha, 300.0)
        raise Unphysical(
            f"at {rate_hz:g} Hz equation (23) leaves {response:.3g} of the amplitude; it was fitted to a few percent "
            f"a decade and serves down to {_MIN_RESPONSE}, that is up to {at_most(highest)} Hz"
        )
    return 1.0 / response
