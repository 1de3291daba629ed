"""Virtual scanners of other kinds than the default one, to see which results hold for that one alone. Needs scipy."""

import msgspec

from paper.identify import X_TARGETS, identify
from tablegen.virtual.parameters import HysteresisTruth, Truth


def same_numbers(truth: Truth) -> Truth:
    """x identified on the same numbers of the paper, without the choice that one m of (1) serves all sizes."""
    found = identify(X_TARGETS, elsewhere=())
    hysteresis = HysteresisTruth(
        reversible_nm=[*found.hysteresis.reversible], density_nm=[[*row] for row in found.hysteresis.density]
    )
    x = msgspec.structs.replace(truth.x, hysteresis=hysteresis, sensitivity=[*found.sensitivity])
    return msgspec.structs.replace(truth, name="same numbers", x=x)


def uniform_density(truth: Truth) -> Truth:
    """x with the simplest hysteresis there is, loops of parabolas (Rayleigh), and offset factors of another sign."""
    hysteresis = HysteresisTruth(reversible_nm=[700.0], density_nm=[[900.0]])
    x = msgspec.structs.replace(truth.x, hysteresis=hysteresis, sensitivity=[0.12, 0.05])
    return msgspec.structs.replace(truth, name="uniform density", x=x)
