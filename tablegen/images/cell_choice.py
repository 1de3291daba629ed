"""Choose between the candidate cells of an image: the smallest that explains all significant spots.

What remains ambiguous is refused.
"""

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.images.ambiguous_cell import AmbiguousCell
from tablegen.images.autocorrelation import Spots
from tablegen.images.cell_spots import (
    STREAK,
    at_fractions,
    explained_spots,
    fitted_to_spots,
    of_an_edge,
    one_direction,
    parallel_waves,
    same_lattice,
    supercell,
)
from tablegen.images.cell_vectors import lattices_of_index, reduced, sublattice_index
from tablegen.images.hum import of_hum
from tablegen.images.image_views import View, confirmed, together
from tablegen.images.lattice_candidates import Candidate, distinct
from tablegen.numerics.arrays import Floats

_STRONG = 1.25  # times the contrast of a significant spot
_LONE_HARMONICS = 3  # of a wave that belongs to no lattice
_OWN_PER_STRANGE = 4  # spots of the cell to one of no lattice
_MOST_AREA_RATIO = 1.75  # of the measured cell and that of the sample by the size in the file
_OWN_SHARE = 0.6  # of the spots that are near enough to 0
_ALONG = 0.5  # of a wave along the rows: slopes show it about as well as heights
_PRIMES = (2, 3, 5, 7)
_CLEARLY_LESS = 0.5  # of the autocorrelation at the cell's sides
_LEAST_DECIDING = 2  # spots
NO_LATTICE = (
    "no lattice stands out of the noise; image more periods, average frames with --frames, or choose another --channel"
)
_SUPERCELLS = (2, 3, 4, 5, 6, 7)


def chosen_cell(views: list[View], hum: Floats, expected_area: float | None) -> Floats:
    """Return the smallest cell that explains all spots. Raise ``Unphysical`` if there is none, or more than one."""
    extent = views[0].extent
    strong, every = together(views, _STRONG), together(views, 1.0)
    if len(strong.waves) < 2 or one_direction(strong.waves):
        raise Unphysical(_why_none([], strong))
    cells = distinct([cell for view in views for cell in view.cells])
    if expected_area is not None:
        cells = [cell for cell in cells if abs(np.log(cell.area / expected_area)) < np.log(_MOST_AREA_RATIO)]
        if not cells:
            raise Unphysical(
                "no cell of the autocorrelation has the area that the sample's constant and the size in the file give; "
                "is the constant that of this sample, and the lattice of this kind?"
            )
    sure, all_of_them = (_smallest(cells, spots, hum, extent, expected_area) for spots in (strong, every))
    if sure is None:
        raise Unphysical(_why_none(cells, strong))
    if all_of_them is not None and not same_lattice(sure, all_of_them):
        raise AmbiguousCell([sure, all_of_them], every, extent, "weak spots are at the waves of one alone")
    if all_of_them is None:
        explained, informative = explained_spots(sure, every)
        waves = every.waves[informative & ~explained]
        waves = waves[~of_an_edge(waves, every.waves[explained], extent)]
        missing = int(np.sum(~of_hum(waves, hum, sure)))
        if missing > 2 + len(explained) // 20:
            raise Unphysical(unexplained(missing, len(explained)))
    explained, informative = explained_spots(sure, every)
    _check_sublattice(sure, every.waves[informative & explained], every, extent)
    if expected_area is None:
        _check_deciding(sure, strong, views)
        for view in views:
            _check_fractions(sure, view.spots, views, hum)
    return sure


def _smallest(
    cells: list[Candidate], spots: Spots, hum: Floats, extent: Floats, expected_area: float | None
) -> Floats | None:
    """Return the smallest cell that explains all spots: a candidate, or a supercell of the smallest ones."""
    for fractions_explained in (False, True)[: 1 if expected_area is None else 2]:
        for cell in cells:
            vectors = fitted_to_spots(cell.vectors, spots)
            if _explains(vectors, spots, hum, extent, fractions_explained):
                return reduced(vectors)
    if expected_area is not None:
        return None
    for cell in cells[:3]:
        for index in _SUPERCELLS:
            for basis in lattices_of_index(index):
                vectors = fitted_to_spots(reduced(basis @ cell.vectors), spots)
                if _explains(vectors, spots, hum, extent):
                    return reduced(vectors)
    return None


def _explains(vectors: Floats, spots: Spots, hum: Floats, extent: Floats, supercells_known: bool = False) -> bool:
    """Return True if a cell explains all spots but for hum, or for one wave that belongs to no lattice.

    A wave of a superstructure is at fractions of the cell's waves. With ``supercells_known`` the sample's constant
    tells that the cell is not one of these.
    """
    explained, informative = explained_spots(vectors, spots)
    own = informative & explained
    if np.linalg.matrix_rank(np.round(spots.waves[own] @ vectors.T)) < 2:
        return False
    if np.sum(own) < _OWN_SHARE * np.sum(informative):
        return False
    strange = informative & ~explained
    strange[strange] = ~of_hum(spots.waves[strange], hum, vectors)
    strange[strange] = ~of_an_edge(spots.waves[strange], spots.waves[own], extent)
    if not np.any(strange):
        return True
    fractional = at_fractions(spots.waves[strange] @ vectors.T)
    if supercells_known:
        strange[strange] = ~fractional
        fractional = fractional[~fractional]
    if np.any(fractional):
        return False
    if not np.any(strange):
        return True
    strongest = np.flatnonzero(strange)[np.argmax(spots.contrast[strange])]
    alone = of_hum(spots.waves[strange], spots.waves[[strongest]], vectors, _LONE_HARMONICS)
    return bool(np.all(alone) and np.sum(strange) <= np.sum(own) / _OWN_PER_STRANGE)


def _check_deciding(vectors: Floats, spots: Spots, views: list[View]) -> None:
    """Check that a smaller cell leaves two spots or more, or is none of the autocorrelation: one may be an artefact."""
    explained, informative = explained_spots(vectors, spots)
    index = np.round(spots.waves[explained & informative] @ vectors.T).astype(np.int64)
    index[(index[:, 0] < 0) | ((index[:, 0] == 0) & (index[:, 1] < 0))] *= -1
    index = np.unique(index, axis=0)
    for part in _PRIMES:
        for u, v in [(1, k) for k in range(part)] + [(0, 1)]:
            sides = np.arange(1, part)[:, None] * (np.array([[u, v]]) @ vectors) / part
            if any(
                np.nanmin(view.correlation.at(sides)) < _CLEARLY_LESS * float(np.min(view.correlation.at(vectors)))
                for view in views
            ):
                continue
            if int(np.sum((index @ np.array([u, v])) % part != 0)) < _LEAST_DECIDING:
                other = vectors[1] if u else vectors[0]
                smaller = np.array([np.array([u, v]) @ vectors / part, other])
                reason = "one spot alone tells them apart"
                raise AmbiguousCell([vectors, smaller], spots, views[0].extent, reason)


def _check_fractions(vectors: Floats, spots: Spots, views: list[View], hum: Floats) -> None:
    """Check that no spot of one view, which the other one does not show, is that of a larger cell."""
    explained, informative = explained_spots(vectors, spots)
    waves = spots.waves[informative & ~explained]
    waves = waves[~of_hum(waves, hum, vectors)]
    waves = waves[at_fractions(waves @ vectors.T)]
    waves = waves[~of_an_edge(waves, spots.waves[explained], views[0].extent)]
    for other in views:
        if other.name == "slopes":  # where a wave along the rows shows, unless it is the edge of a terrace
            steep = np.abs(waves[:, 0]) < _ALONG * np.hypot(*waves.T)
            waves = waves[steep | confirmed(waves, other)]
    if np.any(parallel_waves(waves) < STREAK):
        larger = supercell(vectors, waves)
        cells = [vectors] if larger is None else [vectors, larger]
        reason = "a weak spot is at a fraction of the smaller cell's waves"
        raise AmbiguousCell(cells, spots, views[0].extent, reason)


def _check_sublattice(vectors: Floats, waves: Floats, spots: Spots, extent: Floats) -> None:
    numbers = np.round(waves @ vectors.T).astype(np.int64)
    index = sublattice_index(numbers)
    if index == 1:
        return
    cells = [vectors]
    for basis in lattices_of_index(index) if index else []:
        parts = numbers @ np.linalg.inv(basis)
        if np.allclose(parts, np.round(parts), atol=1e-6):
            cells.append(np.linalg.inv(basis).T @ vectors)
    raise AmbiguousCell(cells, spots, extent, f"all spots are those of 1/{index} of the area too")


def _why_none(cells: list[Candidate], spots: Spots) -> str:
    waves = spots.waves
    if not len(waves):
        return NO_LATTICE
    if one_direction(waves):
        return (
            "the image is periodic in one direction only, as a grating; give --lattice grating, or choose another "
            "--channel"
        )
    if not cells:
        return (
            "the autocorrelation has no maxima of a lattice; image more periods, average frames with --frames, or "
            "choose another --channel"
        )
    return unexplained(min(_remaining(cell.vectors, spots) for cell in cells), len(waves))


def _remaining(vectors: Floats, spots: Spots) -> int:
    """Return how many spots a cell does not explain: all of them, if it explains few of those that tell."""
    explained, informative = explained_spots(fitted_to_spots(vectors, spots), spots)
    if np.sum(informative & explained) < _OWN_SHARE * np.sum(informative):
        return len(spots.waves)
    return max(1, int(np.sum(informative & ~explained)))


def unexplained(count: int, total: int) -> str:
    """Return the text that refuses an image of which no cell explains so many of the significant spots."""
    return (
        f"no cell explains the spectrum: {count} of {total} significant spots remain; is the sample one lattice, and "
        f"the image without hum? Give trace and retrace, which tell hum; crop to a region with one lattice, or choose "
        f"another --channel"
    )
