"""Reasons to refuse a correction by a fit: an ambiguous cell, too large a displacement, no better agreement.

Each check raises ``Unphysical`` with the cause and a remedy. A wrong displacement looks as smooth as a right one, so a
correction that fails these checks is not written.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.correction.agreement import Agreement, levelled
from tablegen.correction.distortion import Distortion, Resampler
from tablegen.correction.periodic_scan import PeriodicScan
from tablegen.images.cell_errors import CellFit, fit_cell
from tablegen.images.cell_spots import same_lattice
from tablegen.images.cell_vectors import area, reduced, sides_and_angle
from tablegen.images.image_cell import ImageCell
from tablegen.images.indexer import find_cell
from tablegen.images.lattice_filters import filtered_images
from tablegen.images.measured_cell import IDEAL_ANGLES, MeasuredCell, measured_cell
from tablegen.numerics.arrays import Bools, Floats, Ints

_MOST_MOVED = 0.05  # of the picture, without the bow of hysteresis
_MOST_SHEARED = 0.15  # of the picture, from its first row to its last: a steady drift
_MOST_BOWED = 0.12  # of the picture: the sagitta of a sweep; hysteresis of piezos stays below 0.1
_BETTER = 0.95  # times the difference before: a better agreement
_WORSE = 1.02  # times the difference before: more than noise and resampling explain
_CLOSER = 0.5  # times the distance of trace and retrace before
_CLOSE = 0.5  # pixels: trace and retrace within this distance agree

_SIDE_OFF = 0.01  # share of a side of the straight cell
_ANGLE_OFF = 1.0  # degrees
_ERRORS = 3.0  # standard errors
_LEAST_LEVEL = 0.04  # of the variance, of the autocorrelation at the points of a lattice

_CLIPPED = 1.0  # percent of the heights at either end: debris has power at all frequencies
_LEAST_PERIODS = 2.5  # along the line; levelling the rows removes slower waves
_SLOWEST = 0.3  # of the slowest wave of the cell: cells of three times its sides have waves beyond that
_FINEST = 0.42  # of the sampling rate
_OWN_WAVE = 2.2, 3.0  # periods: radius around a wave of the cell that is its own, least and most
_OWN_SHARE = 0.35  # of the slowest wave of the cell, within these
_FEWEST = 2.0 * _OWN_WAVE[0]  # periods of a lattice: a wave of half the frequency is then outside that radius
_BESIDE = 14.0  # periods: radius around a spot in which its background is measured
_VISIBLE = 0.025  # of the strongest amplitude of the cell: weaker spots may be residual distortion
_STANDS_OUT = 4.0  # times the background's amplitude
_HIDDEN = 0.2  # of the strongest amplitude: a background as strong as that hides spots
_PADDING = 2
_MOST_PARTS = 6  # the largest denominator of a fraction of a wave that is recognised
_NEAR_PART = 0.12  # of a wave of the cell


@dataclass(frozen=True)
class StrangeSpot:
    """The strongest spot outside a cell.

    ``share`` is its amplitude over the strongest one of the cell, ``contrast`` over that of its background, ``index``
    its coordinates in waves of the cell.
    """

    share: float
    contrast: float
    index: tuple[float, ...]

    @property
    def area(self) -> int | None:
        """The area of the smallest cell with this spot, in areas of the cell; None where it is no small multiple."""
        for parts in range(2, _MOST_PARTS + 1):
            if all(abs(parts * one - round(parts * one)) < parts * _NEAR_PART / 2.0 for one in self.index):
                return parts
        return None


def check_cell(fit: PeriodicScan, heights: Floats, forward: bool) -> None:
    """Check that the image has no spots outside the fitted cell, nor hides them.

    Parameters
    ----------
    fit
        The fit, whose waves are straight in the picture that its distortion gives.
    heights
        The recorded image, shape (rows, columns).
    forward
        Its direction.

    Raises
    ------
    Unphysical
        If there is or may be such a spot, or the image has too few periods to show one.
    """
    distortion = fit.distortion
    (low_x, high_x), (low_y, high_y) = distortion.x_range, distortion.y_range
    waves = fit.waves * np.array([high_x - low_x, high_y - low_y])
    if len(waves) > 1 and _slowest(waves) < _FEWEST:
        raise Unphysical(
            f"the cell may be a multiple or a root of the sample's: with {_slowest(waves):.2g} periods across the "
            f"picture spots of a larger cell cannot be distinguished from its own; image {_FEWEST:g} periods or more, "
            f"or correct with --scanner"
        )
    spot = strange_spot(Resampler.of(distortion, forward)(heights), waves)
    if fit.indexed and (spot is None or spot.area is None or spot.contrast < _STANDS_OUT):
        return  # the indexer has judged what is at no fraction of the cell, such as terraces
    if spot is None or (spot.share < _VISIBLE or (spot.contrast < _STANDS_OUT and spot.share < _HIDDEN)):
        return
    place = ", ".join(f"{one:.2g}" for one in spot.index)
    advice = "image more periods with less noise, choose another --channel, or correct with --scanner"
    if spot.contrast < _STANDS_OUT:
        raise Unphysical(
            f"the cell may be a multiple or a root of the sample's: the non-periodic part reaches "
            f"{100.0 * spot.share:.0f} % of the strongest spot and would hide weaker ones; {advice}"
        )
    larger = "" if spot.area is None else f" with {spot.area} times the area"
    raise Unphysical(
        f"the cell may be a multiple or a root of the sample's: a spot at ({place}) of its waves, with "
        f"{100.0 * spot.share:.0f} % of the strongest, is that of another cell{larger}; {advice}"
    )


def strange_spot(picture: Floats, waves: Floats) -> StrangeSpot | None:
    """Return the strongest spot of a straight picture outside a cell; None where no frequency is searched.

    Parameters
    ----------
    picture
        Heights, shape (rows, columns); NaN where nothing was imaged.
    waves
        Base vectors of the cell, in periods across the picture along x and y, shape (1 or 2, 2).
    """
    rows, columns = picture.shape
    amplitude = _amplitudes(picture)
    u = np.fft.rfftfreq(columns * _PADDING)[None, :] * columns
    v = np.fft.fftfreq(rows * _PADDING)[:, None] * rows
    slowest = _slowest(waves)
    own_reach = float(np.clip(_OWN_SHARE * slowest, *_OWN_WAVE))
    own, strongest = np.zeros(amplitude.shape, bool), 0.0
    for along, across in _lattice(waves, rows, columns, own_reach):
        part = _around(rows, columns, along, across, own_reach)
        own[part] = True
        if np.hypot(along, across) > 0.5 and along > -0.5:
            near = amplitude[_around(rows, columns, along, across, 1.0)]
            strongest = max(strongest, float(np.max(near, initial=0.0)))
    searched = (u >= _LEAST_PERIODS) & (u < _FINEST * columns) & (np.abs(v) < _FINEST * rows)
    searched &= (np.hypot(u, v) > _SLOWEST * slowest) & ~own
    if not strongest or not np.any(searched):
        return None
    best: StrangeSpot | None = None
    remaining = np.where(searched, amplitude, 0.0)
    for _ in range(4):  # the strongest may be of a rough background, the next one a spot
        row, column = np.unravel_index(int(np.argmax(remaining)), remaining.shape)
        value = float(remaining[row, column])
        along, across = float(u[0, column]), float(v[row, 0])
        background = _background(amplitude, own, along, across, (rows, columns))
        index = tuple(np.linalg.lstsq(waves.T, np.array([along, across]), rcond=None)[0].tolist())
        spot = StrangeSpot(value / strongest, value / background, index)
        if best is None or (spot.contrast >= _STANDS_OUT > best.contrast and spot.share >= _VISIBLE):
            best = spot
        remaining[_around(rows, columns, along, across, own_reach)] = 0.0
    return best


def _amplitudes(picture: Floats) -> Floats:
    """Return amplitudes of waves in a picture with levelled rows and clipped extremes."""
    rows, columns = picture.shape
    imaged: Bools = np.isfinite(picture)
    flat = levelled(picture)
    ramp = levelled(np.where(imaged, np.linspace(-1.0, 1.0, columns), np.nan))
    slope = np.sum(flat * ramp, axis=1) / np.maximum(np.sum(ramp**2, axis=1), 1e-300)
    flat = flat - slope[:, None] * ramp
    low, high = np.percentile(flat[imaged], (_CLIPPED, 100.0 - _CLIPPED))
    window = np.hanning(rows + 2)[1:-1, None] * np.hanning(columns + 2)[1:-1] * imaged
    spectrum = np.fft.rfft2(np.clip(flat, low, high) * window, (rows * _PADDING, columns * _PADDING))
    return np.asarray(2.0 * np.abs(spectrum) / np.sum(window), dtype=np.float64)


def _slowest(waves: Floats) -> float:
    """Return the periods of the slowest wave of a cell: of the base vectors, their sum and their difference."""
    short = [waves[0]] if len(waves) == 1 else [waves[0], waves[1], waves[0] + waves[1], waves[0] - waves[1]]
    return min(float(np.hypot(*wave)) for wave in short)


def _lattice(waves: Floats, rows: int, columns: int, reach: float) -> list[tuple[float, float]]:
    """Return all waves of the cell that the pixels can show, and those within ``reach`` beyond."""
    most = max(rows, columns) / _slowest(waves)
    span = range(-int(min(most, 60.0)) - 1, int(min(most, 60.0)) + 2)
    count = np.array(list(product(span, repeat=len(waves))), dtype=np.float64)
    points = count @ waves
    visible = (points[:, 0] > -reach) & (points[:, 0] < 0.5 * columns + reach)
    visible &= np.abs(points[:, 1]) < 0.5 * rows + reach
    return [(float(along), float(across)) for along, across in points[visible]]


def _around(rows: int, columns: int, along: float, across: float, reach: float) -> tuple[Ints, ...]:
    """Return the indices of the amplitudes that are within ``reach`` periods of a wave."""
    count, last = rows * _PADDING, columns * _PADDING // 2
    low, high = (int(np.round(_PADDING * (along + off))) for off in (-reach, reach))
    bottom, top = (int(np.round(_PADDING * (across + off))) for off in (-reach, reach))
    return np.ix_(np.arange(bottom, top + 1) % count, np.arange(max(low, 0), min(high, last) + 1))


def _background(amplitude: Floats, own: Bools, along: float, across: float, shape: tuple[int, int]) -> float:
    """Return the rms amplitude around a spot, from the median, which other spots do not affect."""
    part = _around(*shape, along, across, _BESIDE)
    inner = np.zeros(amplitude.shape, bool)
    inner[_around(*shape, along, across, _OWN_WAVE[1])] = True
    beside = amplitude[part][~inner[part] & ~own[part]]
    return float(np.sqrt(1.44 * np.median(beside**2))) if len(beside) else float(np.inf)


def check_constant(fit: PeriodicScan, constant_nm: float, has_size: bool) -> None:
    """Check that the constant of a lattice is that of the whole cell, which nothing shows where its spots are weak.

    Parameters
    ----------
    constant_nm
        Constant of the lattice, or the pitch of its densest rows, in nm.
    has_size
        True if the file has a size, with which another cell would have been refused.

    Raises
    ------
    Unphysical
        If the strong spots are those of a smaller cell, whose constant may be meant, and there is no size.
    """
    if fit.indexed and fit.strong_index > 1 and not has_size:
        raise Unphysical(
            f"{constant_nm:.4g} nm may be the constant of the whole cell, or of one with 1/{fit.strong_index} of its "
            f"area, whose spots are the strong ones, and the file has no size that decides; correct images from a file "
            f"that has its size, or with --scanner"
        )


def check_straight_cell(
    fit: PeriodicScan,
    pictures: Sequence[Floats],
    size_nm: tuple[float, float] | None = None,
    constant_nm: float | None = None,
    kind: str = "hexagonal",
    by_size: bool = False,
) -> None:
    """Check by the indexer that the mean of the straight pictures has the cell of the sample, or else of the fit.

    A lattice of known constant may be off by 1 % and 1 degree, and three standard errors of the cell.

    Parameters
    ----------
    fit
        The fit; a grating, which has no cell, is not checked.
    pictures
        Straight trace, and retrace if there is one, shape (rows, columns) each; NaN where nothing was imaged.
    size_nm, constant_nm, kind
        Width and height of the pictures, and constant and kind of the lattice, where they are known.
    by_size
        True if the size in the file decided between cells of several sizes.

    Raises
    ------
    Unphysical
        If it has another cell, or none, or several cells explained the recorded image.
    """
    if not fit.tells_y:
        return
    if fit.several_cells:
        raise Unphysical(
            f"{fit.several_cells.partition('; ')[0]}; image more periods with less noise, give --lattice-nm with a "
            f"file that has its size, or correct with --scanner"
        )
    if size_nm is not None and constant_nm is not None:
        check_sample_cell(pictures, size_nm, constant_nm, kind, by_size)
        return
    rows, columns = pictures[0].shape
    (low_x, high_x), (low_y, high_y) = fit.distortion.x_range, fit.distortion.y_range
    own = np.linalg.inv(fit.waves).T / np.array([(high_x - low_x) / columns, (high_y - low_y) / rows])
    image_cell = _cell_of_mean(pictures, area(own) if by_size else None)
    if same_lattice(image_cell.vectors, own):
        return
    sides = "{:.4g} x {:.4g} pixels at {:.3g} degrees".format(*sides_and_angle(reduced(own)))
    raise _other_cell(measured_cell(image_cell.vectors, image_cell.covariance, (1.0, 1.0)), sides)


def check_sample_cell(
    pictures: Sequence[Floats],
    size_nm: tuple[float, float],
    constant_nm: float,
    kind: str,
    by_size: bool,
    start: Floats | None = None,
) -> None:
    """Check that the mean of straight pictures is a lattice of this constant and kind.

    A side may be off by 1 %, the angle by 1 degree, and each by three standard errors. The cell is that of the indexer;
    where ``start`` has fewer than 4.4 periods in the picture, it is that of the autocorrelation's maxima beside it.

    Parameters
    ----------
    pictures
        Straight trace, and retrace if there is one, shape (rows, columns) each; NaN where nothing was imaged.
    size_nm, constant_nm, kind
        Width and height of the pictures, and constant and kind of the lattice.
    by_size
        True if the size in the file decides between cells of several sizes.
    start
        The cell that the pictures should have, in their pixels, shape (2, 2).

    Raises
    ------
    Unphysical
        If it has another cell, or none.
    """
    rows, columns = pictures[0].shape
    pixel = size_nm[0] / columns, size_nm[1] / rows
    expected = constant_nm**2 * float(np.sin(np.radians(IDEAL_ANGLES[kind]))) / (pixel[0] * pixel[1])
    image_cell: ImageCell | CellFit
    if start is not None and _slowest(np.asarray(np.linalg.inv(start).T * [columns, rows], dtype=np.float64)) < _FEWEST:
        image_cell = _cell_beside(np.mean(pictures, axis=0), start)
    else:
        image_cell = _cell_of_mean(pictures, expected if by_size else None)
    cell = measured_cell(image_cell.vectors, image_cell.covariance, pixel)
    angle_off = abs(cell.angle_deg.value - IDEAL_ANGLES[kind])
    right = angle_off <= _ANGLE_OFF + _ERRORS * cell.angle_deg.standard_error
    for side in (cell.a, cell.b):
        right &= abs(side.value - constant_nm) <= _SIDE_OFF * constant_nm + _ERRORS * side.standard_error
    if not right:
        raise _other_cell(cell, f"{constant_nm:.4g} nm at {IDEAL_ANGLES[kind]:g} degrees")


def _cell_of_mean(pictures: Sequence[Floats], expected_area: float | None) -> ImageCell:
    """Return the cell of the mean of straight pictures. Raise ``Unphysical`` if there is none."""
    imaged = _imaged_rectangle(np.isfinite(np.sum(pictures, axis=0)))
    try:
        return find_cell(np.mean(pictures, axis=0)[imaged], None, expected_area)
    except Unphysical as reason:
        raise Unphysical(f"the corrected image does not show the sample's cell: {reason}") from None


def _cell_beside(picture: Floats, start: Floats) -> CellFit:
    """Return the cell of the autocorrelation's maxima beside ``start``, shape (2, 2) in pixels."""
    cell = fit_cell(filtered_images(picture)[0], start)
    if cell is None or cell.level < _LEAST_LEVEL or not same_lattice(cell.vectors, start):
        raise Unphysical(
            "the corrected image does not show the sample's cell: its autocorrelation has no maxima there; image more "
            "periods with less noise, or correct with --scanner"
        )
    return cell


def _other_cell(cell: MeasuredCell, sides: str) -> Unphysical:
    """Return the error of a straight image whose cell does not have these sides."""
    return Unphysical(
        f"the corrected image does not show the sample's cell: its sides are {cell.a.value:.4g} x {cell.b.value:.4g} "
        f"at {cell.angle_deg.value:.3g} degrees, and not {sides}; give --lattice-nm and --lattice, image more periods "
        f"with less noise, or correct with --scanner"
    )


def _imaged_rectangle(imaged: Bools) -> tuple[slice, slice]:
    """Return rows and columns that were imaged everywhere: the edge with the least share of pixels goes first."""
    top, left, bottom, right = 0, 0, *imaged.shape
    while top < bottom and left < right and not np.all(part := imaged[top:bottom, left:right]):
        shares = [float(np.mean(edge)) for edge in (part[0], part[-1], part[:, 0], part[:, -1])]
        worst = int(np.argmin(shares))
        top, bottom = top + (worst == 0), bottom - (worst == 1)
        left, right = left + (worst == 2), right - (worst == 3)
    return slice(top, bottom), slice(left, right)


def check_moves(distortion: Distortion) -> None:
    """Check that no row or column moves further than drift and hysteresis explain.

    Hysteresis bows the sweep of a direction, more on one side than on the other: a polynomial of the third order, which
    may be 12 % of the picture away from its chord. A steady drift shears the rows by up to 15 % of the picture. The
    remainder, including a larger shear and a shift within the line, may be 5 %.

    Raises
    ------
    Unphysical
        If a displacement is larger.
    """
    for axis, name, count in ((0, "columns", distortion.columns), (1, "rows", distortion.rows)):
        displacements = [distortion.displacement(way)[axis] for way, _ in distortion.sides]
        groups = displacements if axis == 0 else [np.concatenate(displacements, axis=1)]
        for one in groups:
            bowed, beside = _bow(_without_shear(one) if axis == 0 else one.T)
            for share, most, what in ((bowed, _MOST_BOWED, "in a bow"), (beside, _MOST_MOVED, "beside the bow")):
                if not share / count <= most:
                    raise Unphysical(
                        f"{name} would move by {100.0 * share / count:.1f} % of the picture {what} that hysteresis "
                        f"makes, and at most {100.0 * most:.0f} % is plausible; is the sample one lattice, of the "
                        f"kind that --lattice says? Image more periods with less drift, or correct with --scanner"
                    )


def _without_shear(displacement: Floats) -> Floats:
    """Subtract the shear from displacements along x, shape (rows, columns), if a steady drift explains it."""
    rows, columns = displacement.shape
    imaged = np.isfinite(displacement)
    offset = np.where(imaged, displacement, 0.0).sum(axis=1) / np.maximum(imaged.sum(axis=1), 1)
    place = (np.arange(rows) + 0.5) / rows - 0.5
    use = imaged.any(axis=1)
    slope = float(np.polyfit(place[use], offset[use], 1)[0])
    if abs(slope) > _MOST_SHEARED * columns:
        return displacement
    return np.asarray(displacement - slope * place[:, None], dtype=np.float64)


def _bow(displacement: Floats) -> tuple[float, float]:
    """Return the sagitta of the best cubic along the columns, and the largest deviation from the cubic, in pixels."""
    count = displacement.shape[1]
    powers = np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, count), 3)
    there = np.isfinite(displacement)
    weighted = powers.T * np.sum(there, axis=0)  # the lines of a column have one place: their sums are enough
    sums = np.sum(np.where(there, displacement, 0.0), axis=0)
    bow = powers @ np.linalg.lstsq(weighted @ powers, powers.T @ sums, rcond=None)[0]
    chord = np.linspace(bow[0], bow[-1], count)
    return float(np.max(np.abs(bow - chord))), float(np.nanmax(np.abs(displacement - bow)))


def check_agreement(agreement: Agreement | None) -> None:
    """Check that trace and retrace agree better than before; a trace alone passes.

    Raises
    ------
    Unphysical
        If they do not.
    """
    if agreement is None:
        return
    before, after = agreement.difference
    worst = agreement.worst
    closer = worst is not None and worst[1] <= max(_CLOSER * worst[0], _CLOSE)
    if after <= _BETTER * before or (closer and after <= _WORSE * before):
        return
    raise Unphysical(
        f"trace and retrace do not agree better after the correction: they differ by {100.0 * before:.3g} % of the "
        f"contrast before and {100.0 * after:.3g} % after; are both of one scan, and --turn and --window right? Choose "
        f"another --channel, or correct with --scanner"
    )
