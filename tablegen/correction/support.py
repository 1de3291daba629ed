"""Apply a fitted displacement only where its errors support it: noise alone bends a line by some of its own error."""

from dataclasses import replace

import numpy as np

from tablegen.correction.distortion import Distortion, Sweep1D
from tablegen.fitting.measured_branch import BINS
from tablegen.images.periodic_model import FitState, Geometry, PeriodicModel
from tablegen.images.position_errors import BinnedResidual
from tablegen.numerics.arrays import Floats

_SUPPORTED = 4.0  # standard deviations of the mean square over its expectation of 1


def supported(distortion: Distortion, model: PeriodicModel, state: FitState, tells_y: bool) -> tuple[Distortion, str]:
    """Return a distortion whose axes are straight where the displacement is within its errors.

    The displacement from the best line and its standard errors are compared in twentieths of the columns, and of the
    rows: the sum of squares of their ratios has to be more than noise makes of it.

    Parameters
    ----------
    distortion
        The fitted one, in lines and frames.
    model, state
        The fit that it comes from.
    tells_y
        True if y is that of the sample.

    Returns
    -------
    tuple
        The distortion, and the axes that were not bent: "", "x", "y" or "xy".
    """
    straight = ""
    place = model.geometry.place
    sweeps = [one for _, one in distortion.sides]
    line = np.polynomial.Polynomial.fit(np.tile(place, len(sweeps)), np.concatenate([one.x for one in sweeps]), 1)
    ratios = [
        _binned(one.x - line(place)) / BinnedResidual.of(model.geometry, residual, steep).error
        for one, residual, steep in zip(sweeps, state.residuals, state.steepness, strict=True)
    ]
    if not _significant(np.concatenate(ratios)):
        straight += "x"
        forward, backward = (
            None if one is None else Sweep1D(line(place), one.time) for one in (distortion.forward, distortion.backward)
        )
        distortion = replace(distortion, forward=forward, backward=backward)
    if tells_y and not _significant(_row_ratios(distortion, model, state)):
        straight += "y"
        y, drift = distortion.y, np.zeros(distortion.rows + 1)
        distortion = replace(distortion, y=np.linspace(0.0, 1.0, len(y)) * (y[-1] - y[0]) + y[0], drift=drift)
    return distortion, straight


def _row_ratios(distortion: Distortion, model: PeriodicModel, state: FitState) -> Floats:
    """Return the displacements of the rows along y, and along x by drift, over their standard errors."""
    turned = Geometry(distortion.columns, distortion.rows)
    times = np.linspace(0.0, 1.0, distortion.rows + 1)
    y = distortion.y - np.polynomial.Polynomial.fit(times, distortion.y, 1)(times)
    upward = [np.tensordot(model.s(state.parameters)[:, 0], slope, axes=1) for slope in model.phase_slopes(state)]
    ratios = []
    for displacement, slopes in ((y, upward), (distortion.drift, state.steepness)):
        errors = [
            BinnedResidual.of(turned, residual.T, slope.T).error
            for residual, slope in zip(state.residuals, slopes, strict=True)
        ]
        weight = np.sum(np.array(errors) ** -2.0, axis=0)
        there = weight > 0.0  # others have no row with data
        ratios.append(_binned(0.5 * (displacement[1:] + displacement[:-1]))[there] / weight[there] ** -0.5)
    return np.concatenate(ratios)


def _binned(values: Floats) -> Floats:
    """Return the means of twentieths."""
    place = np.minimum(np.arange(len(values)) * BINS // len(values), BINS - 1)
    return np.bincount(place, values, BINS) / np.bincount(place, minlength=BINS)


def _significant(ratios: Floats) -> bool:
    return bool(np.mean(ratios**2) > 1.0 + _SUPPORTED * np.sqrt(2.0 / len(ratios)))
