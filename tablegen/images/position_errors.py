"""How well a fitted periodic sample tells positions: covariances from the lines, and what the model leaves."""

from dataclasses import dataclass

import numpy as np

from tablegen.fitting.correlation import correlation_length
from tablegen.fitting.measured_branch import BINS
from tablegen.images.periodic_model import FitState, Geometry, PeriodicModel
from tablegen.numerics.arrays import Bools, Floats, Ints

_ARITHMETIC_ERROR = 1e-7  # share of the line that rounding may leave


@dataclass(frozen=True, eq=False)
class BinnedResidual:
    """How far an image is off its model in each twentieth of its columns, as a share of the line, and the error.

    ``place`` is the bin of each column; ``clean`` the image that is left without that.
    """

    place: Ints
    off: Floats
    error: Floats
    clean: Floats

    @classmethod
    def of(cls, geometry: Geometry, residual: Floats, steep: Floats) -> "BinnedResidual":
        """From what is left of an image, and how steep it is."""
        place = np.minimum((np.arange(geometry.columns) * BINS) // geometry.columns, BINS - 1)
        bins = np.arange(BINS)[:, None] == place
        weights, products = (bins @ values.T for values in (steep**2, steep * residual))  # (bins, rows)
        weight = np.maximum(np.sum(weights, axis=1), 1e-300)
        off = np.sum(products, axis=1) / weight
        spread = np.sum((products - off[:, None] * weights) ** 2, axis=1)
        error = np.sqrt(spread / weight**2 + _ARITHMETIC_ERROR**2)
        return cls(place, off, error, residual - steep * off[place])


def covariance(
    model: PeriodicModel, state: FitState, free: Bools, watched: Bools, misfit: float, clean: list[Floats]
) -> tuple[Floats, float]:
    """Return the covariance of all parameters, 0 for those that are not free, and its widening factor.

    It comes from each line by itself, so that noise may have any spectrum along the line. It is widened where
    neighbouring lines agree on the error of the ``watched`` parameters, and by ``misfit``; ``clean`` are the images
    less the model.
    """
    joint = np.concatenate([free, np.ones(2 * len(model.spots), bool)])
    inverse = np.linalg.pinv(state.hessian[np.ix_(joint, joint)], rcond=1e-13, hermitian=True)
    count = int(np.sum(free))
    influence = (model.scores_of(state, clean)[:, joint] @ inverse)[:, :count]
    lines = len(influence)
    seen = influence[:, watched[free]]
    widened = max(correlation_length(seen / np.maximum(np.sqrt(np.mean(seen**2, axis=0)), 1e-300)), misfit)
    part = influence.T @ influence * (widened * lines / max(lines - len(inverse), 1))
    whole = np.zeros((len(free), len(free)))
    whole[np.ix_(free, free)] = part
    return whole, widened


def loud_rows(state: FitState) -> tuple[int, ...]:
    """Rows, counted from 0, that leave far more than the others do."""
    power = np.sqrt(np.mean(np.stack(state.residuals) ** 2, axis=(0, 2)))
    middle = float(np.median(power))
    spread = 1.4826 * float(np.median(np.abs(power - middle)))
    return tuple(np.flatnonzero(power > middle + max(8.0 * spread, 0.5 * middle)).tolist())


def pixel_noise(state: FitState) -> float:
    """Noise of a pixel, rms, from the differences of neighbouring pixels."""
    residuals = np.concatenate(state.residuals)
    return float(np.sqrt(np.mean(np.diff(residuals, axis=1) ** 2) / 2.0))
