"""The slew guard over many ticks at once: codes that follow a moving target by at most a step a tick."""

import numpy as np

from tablegen.numerics.arrays import Ints

_AHEAD = 256  # ticks of a ramp that are examined at a time


def limit_slew(targets: Ints, code: int, step: int) -> Ints:
    """Return codes that follow their targets by at most ``step`` a tick.

    Parameters
    ----------
    targets
        Codes that are to be played, one a tick, shape (ticks,).
    code
        The code that was played before the first tick.
    step
        Codes a tick, at least 1.

    Returns
    -------
    Ints
        Codes that are played, shape (ticks,).
    """
    codes = targets.copy()
    jumps = np.flatnonzero(np.abs(np.diff(targets)) > step) + 1  # ticks before which the output may be at the target
    at = 0
    while at < len(targets):
        way = int(targets[at]) - code
        if abs(way) <= step:  # from here on codes are the targets, up to the next jump
            next_one = int(np.searchsorted(jumps, at, side="right"))
            at = int(jumps[next_one]) if next_one < len(jumps) else len(targets)
            code = int(targets[at - 1])
            continue
        # A ramp, for as long as its target is more than a step ahead.
        stride = step if way > 0 else -step
        ramp = code + stride * np.arange(len(targets[at : at + _AHEAD]), dtype=np.int64)
        ahead = (targets[at : at + _AHEAD] - ramp) * (1 if way > 0 else -1) > step
        ticks = len(ahead) if ahead.all() else int(np.argmin(ahead))
        codes[at : at + ticks] = ramp[:ticks] + stride
        code += stride * ticks
        at += ticks
    return codes
