"""The cell of a large image: of blocks, if need be of the centre alone, and checked against the waves of all pixels."""

from dataclasses import replace

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.images.ambiguous_cell import AmbiguousCell
from tablegen.images.autocorrelation import FINEST, Spots
from tablegen.images.cell_choice import unexplained
from tablegen.images.cell_spots import (
    INFORMATIVE,
    OFF,
    STREAK,
    at_fractions,
    explained_spots,
    of_an_edge,
    one_direction,
    parallel_waves,
    same_lattice,
    supercell,
)
from tablegen.images.fine_waves import whole_spots
from tablegen.images.image_cell import TOO_LARGE, ImageCell, cell_of_part
from tablegen.images.image_views import STRAIN, image_views, together, view_spots
from tablegen.images.lattice_filters import filtered_images
from tablegen.images.searched_part import SearchedPart, aliased, blocks_of_whole, central_part, largest_block
from tablegen.numerics.arrays import Floats

_LEAST_BLOCKS = 12.0  # to a side: the maxima of shorter ones lie on too few blocks for the errors of a large image


def cell_of_many_pixels(
    heights: Floats, part: SearchedPart, other: Floats | None, expected_area: float | None
) -> ImageCell:
    """Return the cell in blocks that show all waves and are small against the cell, if need be of the centre alone."""
    block, before = largest_block(heights, part), None
    while True:
        searched = central_part(part, block)
        views = image_views(searched.of(heights))
        if np.any(aliased(heights, searched, [view.spots.waves for view in views])):
            block = 1
            continue
        cell = cell_of_part(heights, searched, views, other, expected_area)
        if before is not None and not same_lattice(cell.vectors, before.vectors):
            cells, extent = [before.vectors, cell.vectors], np.array(part.size[::-1], dtype=np.float64)
            raise AmbiguousCell(cells, before.spots, extent, "the image shows one and its centre the other")
        side = float(np.min(np.hypot(*cell.vectors.T)))
        if block == 1 or side >= _LEAST_BLOCKS * block:
            view_part = searched if before is None else before.part
            if view_part.cropped:
                _check_slow_waves(heights, part, cell.vectors)
                view_part = blocks_of_whole(part)
            _check_fine_waves(heights, part, cell.vectors, FINEST / view_part.block)
            return cell
        block, before = max(1, int(side / _LEAST_BLOCKS)), cell


def _check_slow_waves(heights: Floats, part: SearchedPart, vectors: Floats) -> None:
    """Check that the cell of the centre explains the slow waves of the whole image, of which the centre has few."""
    blocks = blocks_of_whole(part)
    views = [view_spots(image) for image in filtered_images(blocks.of(heights))]
    slow = ~aliased(heights, blocks, [view.spots.waves for view in views])
    ends = np.cumsum([len(view.spots.waves) for view in views])[:-1]
    every = together(
        [
            replace(view, spots=Spots(view.spots.waves[use], view.spots.contrast[use], view.spots.power[use]))
            for view, use in zip(views, np.split(slow, ends), strict=True)
        ],
        1.0,
    )
    explained, informative = explained_spots(vectors / blocks.block, every)
    waves = every.waves[informative & ~explained]
    waves = waves[~of_an_edge(waves, every.waves[explained], views[0].extent)]
    if len(waves) > 1 and not one_direction(waves):
        raise Unphysical(
            f"the image has slow waves of a large cell beside fine ones, too many pixels for both: {TOO_LARGE}"
        )


def _check_fine_waves(heights: Floats, part: SearchedPart, vectors: Floats, finest: float) -> None:
    """Check that the cell explains the waves of all pixels that are faster than ``finest`` periods per pixel."""
    highest = (INFORMATIVE - OFF) / STRAIN * np.array([[1.0, 1.0], [1.0, -1.0]])
    if np.max(np.abs(highest @ np.linalg.inv(vectors).T)) <= finest:
        return
    views = whole_spots(heights, part)
    every, extent = together(views, 1.0), views[0].extent
    fine = np.max(np.abs(every.waves), axis=1, initial=0.0) > finest
    every = Spots(every.waves[fine], every.contrast[fine], every.power[fine])
    explained, informative = explained_spots(vectors, every)
    waves = every.waves[informative & ~explained]
    waves = waves[parallel_waves(waves) < STREAK]
    fractional = waves[at_fractions(waves @ vectors.T)]
    if len(fractional):
        larger = supercell(vectors, fractional)
        cells = [vectors] if larger is None else [vectors, larger]
        raise AmbiguousCell(cells, every, extent, "a fine spot is at a fraction of the smaller cell's waves")
    if len(waves) > 2 + len(explained) // 20:
        raise Unphysical(unexplained(len(waves), len(explained)))
