"""Creep, and the loss of gain with frequency that belongs to it: first-order terms of equal weight, log-spaced.

After a step the displacement grows by a constant share per decade of time, and the gain falls by that share per decade
of frequency. By Kramers and Kronig a phase lag belongs to it: (pi/2) of the loss in nepers, 1.2 degrees at 3 % per
decade, which widens every loop by about 1 % of the scan.
"""

import numpy as np

from tablegen.numerics.arrays import Floats
from tablegen.virtual.modes import Modes


def logarithmic_creep(
    loss_per_decade: float, reference_hz: float, fastest_s: float, slowest_s: float, terms_per_decade: int
) -> Modes:
    """Return terms with gain 1 at ``reference_hz``, which falls by ``loss_per_decade`` between the two times."""
    decades = np.log10(slowest_s / fastest_s)
    count = max(round(decades * terms_per_decade), 1)
    times = fastest_s * (slowest_s / fastest_s) ** (np.arange(count + 1) / count)
    share = loss_per_decade * decades / count
    gain = _gain(share, times, reference_hz)
    # The loss is a share of the gain at the reference, which the terms themselves raise above 1.
    for _ in range(50):
        share = loss_per_decade * decades / count * gain
        gain = _gain(share, times, reference_hz)
    return Modes(1.0 / gain, tuple((-1.0 / times).astype(complex)), tuple((share / gain / times).astype(complex)))


def _gain(share: float, times: Floats, f_hz: float) -> float:
    return float(abs(1.0 + np.sum(share / (1.0 + 2j * np.pi * f_hz * times))))
