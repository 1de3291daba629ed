"""Fit a lattice to images without the steps of terraces, which the parabola of a row cannot follow."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tablegen.images.periodic_model import FitState, Geometry, PeriodicModel
from tablegen.images.terraces import without_steps, without_terraces
from tablegen.numerics.arrays import Bools, Floats

Fit = tuple[PeriodicModel, FitState, Bools]
_ODD = 7.0  # times the median rms that a fit leaves in a row; a first row in which creep runs fast has 4.5
_STEP_ROUNDS = 2  # fits to images without the steps that the fit before left


@dataclass(frozen=True, eq=False)
class SteplessFit:
    """A fit to images without steps: the model, its state, and the free parameters.

    ``scaled`` are the recorded images in the unit of the model; ``has_terraces`` is True if rows have edges of
    terraces, ``stepped`` if the last fit left steps.
    """

    model: PeriodicModel
    state: FitState
    free: Bools
    scaled: list[Floats]
    has_terraces: bool
    stepped: bool


def have_terraces(recorded: list[Floats]) -> bool:
    """Return True if an image has edges of terraces.

    Parameters
    ----------
    recorded
        Heights in any unit, shape (rows, columns) each, all finite.
    """
    return any(without_terraces(image) is not None for image in recorded)


def fit_without_steps(geometry: Geometry, recorded: list[Floats], fit: Callable[[list[Floats]], Fit]) -> SteplessFit:
    """Fit to images less the steps of their heights, then less the steps that the fit leaves.

    Parameters
    ----------
    recorded
        Trace, and retrace if there is one, without gaps: heights in any unit, shape (rows, columns) each.
    fit
        The fit to levelled images of unit variance.

    Raises
    ------
    Unphysical
        If ``fit`` does.
    """
    flat = [without_terraces(image) for image in recorded]
    has_terraces = any(image is not None for image in flat)
    levelled = [image if one is None else one for one, image in zip(flat, recorded, strict=True)]
    heights = [_level(geometry, image) for image in levelled]
    heights, scaled = in_unit(heights, heights), in_unit(recorded, heights)
    model, state, free = fit(heights)
    stepped = False
    # Without terraces, what a first fit leaves is its own error, and would pass for steps.
    for _ in range(_STEP_ROUNDS if has_terraces or _has_odd_rows(state) else 0):
        without, stepped = stepless_images(model, state, scaled)
        if not stepped:
            break
        model, state, free = fit([_level(geometry, image) for image in without])
    return SteplessFit(model, state, free, scaled, has_terraces, stepped)


def _has_odd_rows(state: FitState) -> bool:
    """Return True if a fit leaves far more in some rows than in the others: the edge of a terrace along the rows."""
    spread = np.sqrt(np.mean([np.mean(residual**2, axis=1) for residual in state.residuals], axis=0))
    return bool(np.max(spread) > _ODD * np.median(spread))


def _level(geometry: Geometry, image: Floats) -> Floats:
    return geometry.weighted(np.asarray(geometry.levelled(image), dtype=np.float64))


def in_unit(images: list[Floats], level: list[Floats]) -> list[Floats]:
    """Divide images by the rms of levelled ones.

    Parameters
    ----------
    images, level
        Heights in one unit, shape (rows, columns) each.
    """
    spread = float(np.sqrt(np.mean([np.var(image) for image in level])))
    return [image / spread for image in images]


def stepless_images(model: PeriodicModel, state: FitState, recorded: list[Floats]) -> tuple[list[Floats], bool]:
    """Return images without the steps that a fit leaves, and True if one has steps.

    Parameters
    ----------
    recorded
        Heights in the unit of the model, shape (rows, columns) each.
    """
    pairs = zip(recorded, model.periodic_parts(state), strict=True)
    images, stepped = zip(*(without_steps(image, part) for image, part in pairs), strict=True)
    return list(images), any(stepped)
