"""Position errors of a fitted periodic sample: covariances from the lines, and residuals of the model."""

from dataclasses import dataclass

import numpy as np

from tablegen.fitting.correlation import correlation_length
from tablegen.fitting.measured_branch import BINS
from tablegen.images.periodic_model import FitState, Geometry, PeriodicModel
from tablegen.numerics.arrays import Bools, Floats, Ints

_NO_WEIGHT = 1e-150
_ARITHMETIC_ERROR = 1e-7  # share of the line that rounding may leave


@dataclass(frozen=True, eq=False)
class BinnedResidual:
    """Position error of the model in each twentieth of the columns, as a share of the line, and its standard error.

    The error is infinite where no row has data.
    ``place`` is the bin of each column; ``clean`` the residual of the image without that error.
    """

    place: Ints
    off: Floats
    error: Floats
    clean: Floats

    @classmethod
    def of(cls, geometry: Geometry, residual: Floats, steep: Floats) -> "BinnedResidual":
        """Average the residual of an image in bins of its columns.

        Parameters
        ----------
        residual
            Heights less the model, shape (rows, columns).
        steep
            d height / dx of the model, shape (rows, columns).
        """
        place = np.minimum((np.arange(geometry.columns) * BINS) // geometry.columns, BINS - 1)
        bins = np.arange(BINS)[:, None] == place
        weights, products = (bins @ values.T for values in (steep**2, steep * residual))  # (bins, rows)
        weight = np.maximum(np.sum(weights, axis=1), 1e-300)
        off = np.sum(products, axis=1) / weight
        spread = np.sum((products - off[:, None] * weights) ** 2, axis=1)
        empty = weight <= _NO_WEIGHT  # of missing rows
        error = np.where(empty, np.inf, np.sqrt(spread / np.where(empty, 1.0, weight) ** 2 + _ARITHMETIC_ERROR**2))
        return cls(place, off, error, residual - steep * off[place])


def covariance(
    model: PeriodicModel, state: FitState, free: Bools, watched: Bools, misfit: float, clean: list[Floats]
) -> tuple[Floats, float]:
    """Return the covariance of all parameters, and its widening factor.

    It comes from each line by itself, so that noise may have any spectrum along the line. It is widened where
    neighbouring lines agree on the error of the ``watched`` parameters, and by ``misfit``.

    Parameters
    ----------
    free, watched
        Parameters that were fitted, and those whose correlation widens the errors, shape (parameters,) each.
    misfit
        Least widening factor of the variance.
    clean
        Images less the model, shape (rows, columns) each.

    Returns
    -------
    tuple
        The covariance, 0 for parameters that are not free, shape (parameters, parameters), and the factor on it.
    """
    joint = np.concatenate([free, np.ones(2 * len(model.spots), bool)])
    inverse = np.linalg.pinv(state.hessian[np.ix_(joint, joint)], rcond=1e-13, hermitian=True)
    count = int(np.sum(free))
    influence = (model.scores_of(state, clean)[:, joint] @ inverse)[:, :count]
    lines = model.geometry.lines
    watched_influence = influence[:, watched[free]]
    widened = max(
        correlation_length(watched_influence / np.maximum(np.sqrt(np.mean(watched_influence**2, axis=0)), 1e-300)),
        misfit,
    )
    part = influence.T @ influence * (widened * lines / max(lines - len(inverse), 1))
    whole = np.zeros((len(free), len(free)))
    whole[np.ix_(free, free)] = part
    return whole, widened


def loud_rows(geometry: Geometry, state: FitState) -> tuple[int, ...]:
    """Return the rows of the frame, counted from 0, whose residuals are far larger than those of the others."""
    power = np.sqrt(np.mean(np.stack(state.residuals) ** 2, axis=(0, 2)))
    there = power[power > 0.0]  # missing rows have no residual
    middle = float(np.median(there))
    spread = 1.4826 * float(np.median(np.abs(there - middle)))
    loud = np.flatnonzero(power > middle + max(8.0 * spread, 0.5 * middle))
    return tuple((loud + geometry.part.first_row).tolist())


def pixel_noise(state: FitState) -> float:
    """Return the noise of a pixel, rms, from the differences of neighbouring pixels."""
    residuals = np.concatenate(state.residuals)
    return float(np.sqrt(np.mean(np.diff(residuals, axis=1) ** 2) / 2.0))
