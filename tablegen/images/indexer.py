"""Find the lattice of an image: the smallest cell that explains all significant spots of its spectrum.

Candidates come from the autocorrelation, whose maxima do not depend on which spots are strong; the spectrum decides
between them. What remains ambiguous is refused.
"""

from dataclasses import dataclass, replace

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.images.autocorrelation import (
    FINEST,
    WEAKEST,
    Spots,
    significant_spots,
)
from tablegen.images.cell_errors import fit_cell
from tablegen.images.cell_vectors import area, lattices_of_index, reduced, sides_and_angle, sublattice_index
from tablegen.images.fine_waves import whole_spots
from tablegen.images.hum import hum_waves, of_hum
from tablegen.images.image_views import (
    FAINT,
    FAINTEST,
    NEAR_SPOT,
    STRAIN,
    View,
    confirmed,
    image_views,
    least_contrast,
    together,
    view_spots,
)
from tablegen.images.lattice_candidates import Candidate, distinct
from tablegen.images.lattice_filters import filtered_images, valid_pixels
from tablegen.images.pair_checks import MIN_PIXELS
from tablegen.images.searched_part import (
    SearchedPart,
    aliased,
    blocks_of_whole,
    central_part,
    complete_part,
    largest_block,
)
from tablegen.numerics.arrays import Bools, Floats, Ints

_STRONG = 1.25  # times the contrast of a significant spot
_CLEAR = 1.3  # times that of a significant spot: the strongest one has to have it
_OFF = 0.12  # of an index: largest distance of a spot from a whole number
_INFORMATIVE = 0.25  # of an index: a spot with more uncertainty is not compared
_ORDERS = (2, 4, 6, 10)  # indices up to which a cell is fitted to spots, one after the other
_FRACTIONS = (2, 3, 4)  # of the waves of a cell, where a superstructure has its own
_NEAR_FRACTION = 0.045
_LONE_HARMONICS = 3  # of a wave that belongs to no lattice
_OWN_PER_STRANGE = 4  # spots of the cell to one of no lattice
_MOST_AREA_RATIO = 1.75  # of the measured cell and that of the sample by the size in the file
_PARALLEL = 0.1  # radians
_CORRECTED = 0.05  # share: what spots may change of the sides that the maxima have
_OWN_SHARE = 0.6  # of the spots that are near enough to 0
_ALONG = 0.5  # of a wave along the rows: slopes show it about as well as heights
_SLOW, _SLOW_SHARE = 4.0, 0.5  # periods in the image, and of the slowest wave of the cell: a terrace has waves below
_SPOT_WIDTH, _STRAY = 0.4, 0.02  # periods in the image; chance that a spot belongs to no lattice
_PRIMES = (2, 3, 5, 7)
_CLEARLY_LESS = 0.5  # of the autocorrelation at the cell's sides
_LEAST_DECIDING = 2  # spots
_STREAK = 4  # spots in one direction: the edge of a terrace
_NO_LATTICE = (
    "no lattice stands out of the noise; image more periods, average frames with --frames, or choose another --channel"
)
_SUPERCELLS = (2, 3, 4, 5, 6, 7)
_LEAST_CELLS = 4.0  # in the image
_LEAST_PERIODS = 2.2  # of each side's rows in the image
_LEAST_PERIODS_OF_CENTRE = 8.0  # in the centre of an image, which is searched alone because of its fine waves
_TOO_LARGE = "crop the image to a quarter, or save it with fewer pixels"
_MOST_ERROR = 0.05  # of a side
_LEAST_VALID = 0.25  # share of the pixels
_SAME_CELL = 0.12  # share
_LEAST_LEVEL = 0.04  # of the variance, at the lattice points
_LEAST_BLOCKS = 12.0  # to a side: the maxima of shorter ones lie on too few blocks for the errors of a large image


class AmbiguousCell(Unphysical):
    """Several cells explain an image.

    Parameters
    ----------
    cells
        Cells in pixels, shape (2, 2) each.
    spots
        The significant spots, by which the cells have their likelihoods.
    extent
        Columns and rows of the image.
    reason
        Why they are possible.
    """

    def __init__(self, cells: list[Floats], spots: Spots, extent: Floats, reason: str) -> None:
        """Name the cells, each with its likelihood."""
        super().__init__(ambiguous(cells, likelihoods(cells, spots, extent), reason))
        self.cells, self.spots, self._shown = cells, spots, (extent, reason)

    def in_pixels(self, block: int) -> "AmbiguousCell":
        """Return the same reason in pixels, where cells and spots are in blocks."""
        extent, reason = self._shown
        spots = Spots(self.spots.waves / block, self.spots.contrast, self.spots.power)
        return AmbiguousCell([block * cell for cell in self.cells], spots, block * extent, reason)

    def common_cell(self) -> Floats | None:
        """Return the cell that has the waves of all the others; None if there is none."""
        largest = max(self.cells, key=area)
        for cell in self.cells:
            change = largest @ np.linalg.inv(cell)
            if np.max(np.abs(change - np.round(change))) > _SAME_CELL:
                return None
        return largest


@dataclass(frozen=True, eq=False)
class ImageCell:
    """The cell of an image in pixels.

    ``vectors`` are its reduced sides, shape (2, 2), x and y; ``covariance`` that of a_x, a_y, b_x, b_y; ``spots`` the
    significant ones of the spectrum, ``explained`` those that the cell explains; ``filter_name`` how it was found,
    ``part`` where.
    """

    vectors: Floats
    covariance: Floats
    spots: Spots
    explained: Bools
    level: float
    part: SearchedPart
    filter_name: str

    @property
    def cells(self) -> float:
        """Cells in the part of the image that was searched."""
        return self.part.pixels / area(self.vectors)


_ViewCell = tuple[Floats, Floats, Spots, Bools, float, str]  # vectors to level of a cell, and the name of the filter


def find_cell(heights: Floats, other: Floats | None = None, expected_area: float | None = None) -> ImageCell:
    """Find the cell of a two-dimensional lattice.

    Parameters
    ----------
    heights
        Heights in any unit, shape (rows, columns); NaN where a pixel is missing.
    other
        The image of the other direction, with its left end on the left: it tells hum from the sample.
    expected_area
        Area of the sample's cell in square pixels by the size in the file: it decides between cells of which one is a
        multiple of the other.

    Returns
    -------
    ImageCell
        The reduced cell with its errors. More than 2^20 pixels are searched in blocks, or in their centre.

    Raises
    ------
    Unphysical
        If the image has no significant lattice, one direction only, too few periods, spots that no cell explains, or
        several cells that explain them as well.
    """
    _check(heights)
    part = complete_part(heights)
    if part.large:
        return _cell_of_many_pixels(heights, part, other, expected_area)
    return _cell_of_part(heights, part, image_views(part.of(heights)), other, expected_area)


def _cell_of_many_pixels(
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
        cell = _cell_of_part(heights, searched, views, other, expected_area)
        if before is not None and not same_lattice(cell.vectors, before.vectors):
            cells, extent = [before.vectors, cell.vectors], np.array(part.size[::-1], dtype=np.float64)
            raise AmbiguousCell(cells, before.spots, extent, "the image shows one and its centre the other")
        side = float(np.min(np.hypot(*cell.vectors.T)))
        if block == 1 or side >= _LEAST_BLOCKS * block:
            seen = searched if before is None else before.part
            if seen.cropped:
                _check_slow_waves(heights, part, cell.vectors)
                seen = blocks_of_whole(part)
            _check_fine_waves(heights, part, cell.vectors, FINEST / seen.block)
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
            f"the image has slow waves of a large cell beside fine ones, too many pixels for both: {_TOO_LARGE}"
        )


def _check_fine_waves(heights: Floats, part: SearchedPart, vectors: Floats, finest: float) -> None:
    """Check that the cell explains the waves of all pixels that are faster than ``finest`` periods per pixel."""
    highest = (_INFORMATIVE - _OFF) / STRAIN * np.array([[1.0, 1.0], [1.0, -1.0]])
    if np.max(np.abs(highest @ np.linalg.inv(vectors).T)) <= finest:
        return
    views = whole_spots(heights, part)
    every, extent = together(views, 1.0), views[0].extent
    fine = np.max(np.abs(every.waves), axis=1, initial=0.0) > finest
    every = Spots(every.waves[fine], every.contrast[fine], every.power[fine])
    explained, informative = explained_spots(vectors, every)
    waves = every.waves[informative & ~explained]
    waves = waves[_beside(waves) < _STREAK]
    fractional = waves[_fractional(waves @ vectors.T)]
    if len(fractional):
        larger = _supercell(vectors, fractional)
        cells = [vectors] if larger is None else [vectors, larger]
        raise AmbiguousCell(cells, every, extent, "a fine spot is at a fraction of the smaller cell's waves")
    if len(waves) > 2 + len(explained) // 20:
        raise Unphysical(_unexplained(len(waves), len(explained)))


def _beside(waves: Floats) -> Ints:
    """Return how many waves have the direction of each, with itself."""
    direction = np.arctan2(waves[:, 1], waves[:, 0])
    beside = np.abs((direction[:, None] - direction[None] + np.pi / 2) % np.pi - np.pi / 2) < _PARALLEL
    return np.asarray(np.sum(beside, axis=1), dtype=np.int64)


def _cell_of_part(
    heights: Floats, part: SearchedPart, views: list[View], other: Floats | None, expected_area: float | None
) -> ImageCell:
    """Return the cell of the views of a part, in pixels of the image."""
    block = part.block
    expected = None if expected_area is None else expected_area / block**2
    try:
        cell = _cell_of_views(views, None if other is None else part.of(other), expected)
        if part.cropped:
            _check_periods(cell[0], views[0].extent, _LEAST_PERIODS_OF_CENTRE, _TOO_LARGE)
    except AmbiguousCell as reason:
        raise reason.in_pixels(block) from None
    except Unphysical as reason:
        if not part.cropped:
            raise
        raise Unphysical(f"{reason}; so large an image is searched in its centre, {part}") from None
    vectors, covariance, spots, explained, level, name = cell
    spots = Spots(spots.waves / block, spots.contrast, spots.power)
    return ImageCell(block * vectors, block**2 * covariance, spots, explained, level, part, name)


def _cell_of_views(views: list[View], other: Floats | None, expected_area: float | None) -> _ViewCell:
    """Return the cell of the views of an image. Raise ``Unphysical`` if there is none, or more than one."""
    shape = views[0].image.values.shape
    hum = np.zeros((0, 2))
    if other is not None:
        beside = np.concatenate(
            [
                significant_spots(image, FAINT * least_contrast(float(image.values.size)), FAINTEST * WEAKEST).waves
                for image in filtered_images(other)
            ]
        )
        hum = hum_waves(together(views, 1.0).waves, beside, (shape[0], shape[1]))
    if not any(len(view.spots.contrast) and view.spots.contrast[0] >= _CLEAR * view.least for view in views):
        raise Unphysical(_NO_LATTICE)
    vectors = _chosen(views, hum, expected_area)
    _check_periods(vectors, np.array([shape[1], shape[0]]), _LEAST_PERIODS, "scan more of them")
    reasons: list[Unphysical] = []
    # A view whose own maxima gave the cell comes first.
    for view in sorted(views, key=lambda view: not any(same_lattice(cell.vectors, vectors) for cell in view.cells)):
        try:
            return _fitted(view, vectors)
        except Unphysical as reason:
            reasons.append(reason)
    raise reasons[-1]


def ambiguous(cells: list[Floats], shares: Floats, reason: str) -> str:
    """Return the text that refuses several cells.

    Parameters
    ----------
    cells
        Cells in pixels, shape (2, 2) each.
    shares
        The likelihood of each.
    reason
        Why they are possible.
    """
    order = np.argsort(-shares, kind="stable")
    names = []
    for number in order.tolist():
        one, other, angle = sides_and_angle(reduced(cells[number]))
        share = _percent(float(shares[number]))
        names.append(f"{one:.4g} x {other:.4g} pixels at {angle:.3g} degrees ({share})")
    sizes = " or ".join(names)
    return (
        f"the lattice is ambiguous: the cell may be {sizes}, as {reason}; give the sample's --lattice-nm, or image "
        f"more periods with less noise"
    )


def _percent(share: float) -> str:
    return "below 1 %" if share < 0.01 else "above 99 %" if share > 0.99 else f"{100.0 * share:.0f} %"


def likelihoods(cells: list[Floats], spots: Spots, extent: Floats) -> Floats:
    """Return the likelihood of each cell by the places of the spots; they add to 1.

    A spot is with a chance of ``_STRAY`` anywhere, else near one of the waves of the cell. A large cell has many waves,
    so that each is less likely to be the place of a spot by itself.

    Parameters
    ----------
    cells
        Cells in pixels, shape (2, 2) each.
    spots
        Spots of both views: each counts half.
    extent
        Columns and rows of the image.
    """
    pixels = float(np.prod(extent))
    logarithms = []
    for cell in cells:
        index = spots.waves @ cell.T
        distance = np.hypot(*(((index - np.round(index)) @ np.linalg.inv(cell).T) * extent).T)
        width = _SPOT_WIDTH + 0.5 * STRAIN * np.hypot(*(spots.waves * extent).T)
        near = np.exp(-0.5 * (distance / width) ** 2) / (2.0 * np.pi * width**2) / max(area(cell), 1.0)
        logarithms.append(0.5 * float(np.sum(np.log((1.0 - _STRAY) * near + _STRAY / pixels))))
    shares = np.exp(np.array(logarithms) - max(logarithms))
    return np.asarray(shares / np.sum(shares))


def _size(shape: tuple[int, ...]) -> str:
    return " x ".join(map(str, shape))


def _check(heights: Floats) -> None:
    if heights.ndim != 2 or min(heights.shape) < MIN_PIXELS:
        size = _size(heights.shape)
        raise Unphysical(f"{size} pixels are too few for a lattice; {MIN_PIXELS} rows and columns do")
    share = float(np.mean(valid_pixels(heights)))
    if share < _LEAST_VALID:
        raise Unphysical(f"{100.0 * share:.2g} % of the pixels have heights; crop the image to what was scanned")


def _fitted(view: View, vectors: Floats) -> _ViewCell:
    """Fit a cell to the maxima of a view's autocorrelation. Raise ``Unphysical`` if it is none of them."""
    spots = view.spots
    fit = fit_cell(view.image, vectors)
    if fit is None or fit.level < _LEAST_LEVEL or not same_lattice(fit.vectors, vectors):
        raise Unphysical(
            "the maxima of the autocorrelation are no lattice; is the sample one lattice? Crop to a region with "
            "one, or choose another --channel"
        )
    errors = np.sqrt(np.array([np.trace(fit.covariance[:2, :2]), np.trace(fit.covariance[2:, 2:])]))
    share = float(np.max(errors / np.array(sides_and_angle(vectors)[:2])))
    if not share <= _MOST_ERROR:
        raise Unphysical(
            f"the cell differs between parts of the image by {100.0 * share:.2g} % of a side; is the sample one "
            f"lattice? Crop to a region with one, or scan with less drift"
        )
    explained = explained_spots(fit.vectors, spots)[0]
    return fit.vectors, fit.covariance, spots, explained, fit.level, view.image.name


def _chosen(views: list[View], hum: Floats, expected_area: float | None) -> Floats:
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
            raise Unphysical(_unexplained(missing, len(explained)))
    explained, informative = explained_spots(sure, every)
    _check_sublattice(sure, every.waves[informative & explained], every, extent)
    if expected_area is None:
        _check_deciding(sure, strong, views)
        for view in views:
            _check_fractions(sure, view.spots, views, hum)
    return sure


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
    waves = waves[_fractional(waves @ vectors.T)]
    waves = waves[~of_an_edge(waves, spots.waves[explained], views[0].extent)]
    for other in views:
        if other.name == "slopes":  # where a wave along the rows shows, unless it is the edge of a terrace
            steep = np.abs(waves[:, 0]) < _ALONG * np.hypot(*waves.T)
            waves = waves[steep | confirmed(waves, other)]
    if np.any(_beside(waves) < _STREAK):
        larger = _supercell(vectors, waves)
        cells = [vectors] if larger is None else [vectors, larger]
        reason = "a weak spot is at a fraction of the smaller cell's waves"
        raise AmbiguousCell(cells, spots, views[0].extent, reason)


def _supercell(vectors: Floats, waves: Floats) -> Floats | None:
    """Return the smallest multiple of a cell of which these waves are; None if it has more than 16 times the area."""
    for index in range(2, max(_FRACTIONS) ** 2 + 1):
        for basis in lattices_of_index(index):
            numbers = waves @ (basis @ vectors).T
            if np.all(np.abs(numbers - np.round(numbers)) <= index * _NEAR_FRACTION):
                return reduced(basis @ vectors)
    return None


def explained_spots(vectors: Floats, spots: Spots) -> tuple[Bools, Bools]:
    """Return which spots are at whole numbers of a cell's reciprocal, and which are near enough to 0 to tell.

    Parameters
    ----------
    vectors
        The cell in pixels, shape (2, 2).
    """
    index = spots.waves @ vectors.T
    off = np.max(np.abs(index - np.round(index)), axis=1)
    tolerance = _OFF + STRAIN * np.max(np.abs(index), axis=1)
    return np.asarray(off <= tolerance), np.asarray(tolerance <= _INFORMATIVE)


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


def fitted_to_spots(vectors: Floats, spots: Spots) -> Floats:
    """Fit a cell, shape (2, 2) in pixels, to spots, from the low indices to the high ones."""
    for most in _ORDERS:
        index = spots.waves @ vectors.T
        whole = np.round(index)
        near = np.all(np.abs(index - whole) <= _OFF, axis=1) & (np.max(np.abs(whole), axis=1) <= most)
        if np.linalg.matrix_rank(whole[near]) < 2:
            continue
        base = np.linalg.lstsq(whole[near], spots.waves[near], rcond=None)[0]
        if np.max(np.abs(base @ vectors.T - np.eye(2))) > _CORRECTED:
            return vectors
        vectors = np.linalg.inv(base).T
    return vectors


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
    fractional = _fractional(spots.waves[strange] @ vectors.T)
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


def of_an_edge(waves: Floats, own: Floats, extent: Floats) -> Bools:
    """Return True for slow waves if all slow ones are in one direction: those of a step, a facet or a bow.

    A larger cell would have slow waves in two directions, or faster ones beside those of the smaller cell.

    Parameters
    ----------
    waves, own
        Waves per pixel that a cell does not explain, and that it does, shape (n, 2) and (m, 2).
    extent
        Columns and rows of the image.
    """
    periods, least = waves * extent, np.min(np.hypot(*(own * extent).T), initial=np.inf)
    slow: Bools = np.hypot(*periods.T) < min(_SLOW, _SLOW_SHARE * float(least))
    if not np.any(slow):
        return slow
    unit = np.linalg.svd(periods[slow], full_matrices=False)[2][0]
    across = np.abs(periods @ np.array([-unit[1], unit[0]]))
    return np.asarray(slow & np.all(across[slow] <= NEAR_SPOT))


def _fractional(index: Floats) -> Bools:
    """Return True for indices, shape (n, 2), at small fractions."""
    fractional = np.zeros(len(index), dtype=np.bool_)
    for parts in _FRACTIONS:
        fractional |= np.all(np.abs(parts * index - np.round(parts * index)) <= parts * _NEAR_FRACTION, axis=1)
    return fractional


def _why_none(cells: list[Candidate], spots: Spots) -> str:
    waves = spots.waves
    if not len(waves):
        return _NO_LATTICE
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
    return _unexplained(len(waves), len(waves))


def one_direction(waves: Floats) -> bool:
    """Return True if waves, shape (n, 2), are parallel."""
    if not len(waves):
        return False
    unit = waves / np.hypot(*waves.T)[:, None]
    return bool(np.linalg.svd(unit, compute_uv=False)[-1] < _PARALLEL * len(waves) ** 0.5) if len(waves) > 1 else True


def _unexplained(count: int, total: int) -> str:
    return (
        f"no cell explains the spectrum: {count} of {total} significant spots remain; is the sample one lattice, and "
        f"the image without hum? Crop to a region with one lattice, or choose another --channel"
    )


def _check_periods(vectors: Floats, extent: Floats, least: float, advice: str) -> None:
    cells = float(np.prod(extent)) / area(vectors)
    waves = np.linalg.inv(vectors).T * extent  # periods of each base wave along x and y, summed over the image
    periods = float(np.min(np.hypot(*waves.T)))
    if cells < _LEAST_CELLS or periods < least:
        raise Unphysical(
            f"the image has {periods:.2g} periods of its lattice; at least {least:g} in each direction are needed: "
            f"{advice}"
        )


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


def same_lattice(one: Floats, other: Floats) -> bool:
    """Return True if two cells are bases of nearly one lattice."""
    change = one @ np.linalg.inv(other)
    whole = np.round(change)
    return bool(abs(abs(np.linalg.det(whole)) - 1.0) < 1e-6 and np.max(np.abs(change - whole)) < _SAME_CELL)
