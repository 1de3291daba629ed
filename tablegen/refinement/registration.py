"""From trace and retrace of any sample to their mismatch along the line; it says nothing of an error that both share.

The sample is the same in both: T(x at column) = R(x at column). Both are interpolated on one grid of positions, each
shifted by half the mismatch, and the polynomial by which they agree best is fitted by Gauss-Newton, from coarse to
fine. Rows of the retrace are later, when the slow axis has moved: they are interpolated between the rows.
"""

from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates, spline_filter

from tablegen.base.input_errors import Unphysical
from tablegen.fitting.correlation import correlation_length
from tablegen.images.model_start import prepare_heights
from tablegen.images.pair_checks import check_mirrored
from tablegen.images.periodic_model import Geometry
from tablegen.numerics.arrays import Floats
from tablegen.planning.line_plan import Plan
from tablegen.refinement.departure import requested_position
from tablegen.refinement.lattice_line import ImageOptions, column_modes
from tablegen.refinement.window_line import WindowLine

_BLURS = (6.0, 3.0, 1.0)  # pixels, one after the other
_DEGREES = (3, 6, 12)  # of the polynomial meanwhile
_STEPS = 8
_SETTLED = 1e-3  # pixels
_EDGE = 1  # columns and rows at the edges that are not compared
_LEAST_MATCH = 0.3  # correlation of the compared pixels
_MOST_PIXELS = 12.0  # largest distance of trace and retrace, in columns


@dataclass(frozen=True, eq=False)
class SweepMismatch:
    """The mismatch of a pair of images; ``match`` is their correlation after the shift."""

    geometry: Geometry
    line: WindowLine
    match: float


def mismatch(plan: Plan, trace: Floats, retrace: Floats, options: ImageOptions) -> SweepMismatch:
    """Measure the mismatch of trace and retrace of x, half in each.

    Parameters
    ----------
    trace, retrace
        Heights in any unit, shape (rows, columns), rows in the order of time, the left end first.

    Raises
    ------
    Unphysical
        If the two images are not of one scan.
    """
    line = plan.x
    window = line.band_limit.window
    if options.retrace_mirrored:
        retrace = np.ascontiguousarray(retrace[:, ::-1])
    geometry, heights = prepare_heights(trace, retrace, line.drive.turn, window, options.delay)
    advice = "leave --retrace-mirrored out" if options.retrace_mirrored else "it needs --retrace-mirrored"
    check_mirrored(heights[0], heights[1], advice)
    modes = column_modes(plan, geometry, _DEGREES[-1])
    times = np.split(modes.time, 2)
    late = times[1] - times[0] if plan.y.program.hold == 1 else np.zeros(geometry.columns)
    rows = np.arange(geometry.rows)[:, None]
    across = np.broadcast_to(np.arange(geometry.columns), heights[0].shape)
    images = [heights[0], map_coordinates(heights[1], [rows - late, across], order=3, mode="nearest")]
    requested = np.split(modes.requested, 2)
    # Even positions, and polynomials there: of the trace's half of the difference.
    grid = np.linspace(max(a[0] for a in requested), min(a[-1] for a in requested), geometry.columns)
    place = np.interp(grid, requested[0], geometry.place)
    coefficients = np.zeros(_DEGREES[-1] + 1)
    influence, match = np.zeros((1, 1)), 0.0
    for blur, degree in zip(_BLURS, _DEGREES, strict=True):
        count = degree + 1
        at = 2.0 * (place - window[0]) / (window[1] - window[0]) - 1.0
        polynomials = np.polynomial.legendre.legvander(at, degree)
        smooth = [spline_filter(gaussian_filter(image, blur), order=3) for image in images]
        for _ in range(_STEPS):
            half = polynomials @ coefficients[:count]
            shifted_images = [
                _laid(image, np.interp(grid - sign * half, at_columns, np.arange(geometry.columns)))
                for image, at_columns, sign in zip(smooth, requested, (1.0, -1.0), strict=True)
            ]
            difference, slope = shifted_images[0] - shifted_images[1], 0.5 * (shifted_images[0] + shifted_images[1])
            steep = 2.0 * np.gradient(slope, grid, axis=1)[_EDGE:-_EDGE, _EDGE:-_EDGE]
            inner = difference[_EDGE:-_EDGE, _EDGE:-_EDGE]
            basis = polynomials[_EDGE:-_EDGE]
            normal = np.einsum("ij,jm,jn->mn", steep**2, basis, basis, optimize=True)
            scores = (steep * inner) @ basis
            inverse = np.linalg.pinv(normal, rcond=1e-10, hermitian=True)
            step = inverse @ np.sum(scores, axis=0)
            coefficients[:count] += step
            if float(np.max(np.abs(polynomials @ step))) * geometry.columns < _SETTLED:
                break
        influence = scores @ inverse
        one, other = (image[_EDGE:-_EDGE, _EDGE:-_EDGE].ravel() for image in shifted_images)
        match = float(np.corrcoef(one, other)[0, 1])
    _check(geometry, polynomials @ coefficients, match, grid)
    scale = np.maximum(np.sqrt(np.mean(influence**2, axis=0)), 1e-300)
    spread = influence.T @ influence * correlation_length(influence / scale)
    found_line = WindowLine(
        partial(requested_position, line),
        line.drive.size_nm,
        line.drive.turn,
        window,
        _DEGREES[-1],
        "difference",
        coefficients,
        np.asarray(spread, dtype=np.float64),
    )
    return SweepMismatch(geometry, found_line, match)


def _laid(spline: Floats, columns: Floats) -> Floats:
    """Evaluate an image, given by its spline coefficients, at fractional columns."""
    rows = np.broadcast_to(np.arange(spline.shape[0])[:, None], (spline.shape[0], len(columns)))
    shifted: Floats = map_coordinates(
        spline, [rows, np.broadcast_to(columns, rows.shape)], order=3, mode="nearest", prefilter=False
    )
    return shifted


def _check(geometry: Geometry, half: Floats, match: float, grid: Floats) -> None:
    pixel = float(grid[-1] - grid[0]) / (len(grid) - 1)
    distance = 2.0 * float(np.max(np.abs(half))) / pixel
    if match < _LEAST_MATCH or distance > _MOST_PIXELS:
        raise Unphysical(
            "the retrace does not show what the trace shows; are they of one scan, with contrast along the lines?"
        )
