"""Measure the bow of lines and rows in a picture of a lattice, by its cell at opposite ends of the picture.

An affine map leaves a bow as it is: a parabola of hysteresis or creep stretches one half of the picture and shortens
the other.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.correction.agreement import Agreement
from tablegen.fitting.estimate import Estimate
from tablegen.images.cell_errors import CellFit, fit_cell
from tablegen.images.cell_spots import same_lattice
from tablegen.images.lattice_filters import filtered_images
from tablegen.numerics.arrays import Floats

_DRAWS = 200
_PARTS = 1.0 / 2.0, 2.0 / 3.0  # of the picture, at either end: the larger ones where halves have too few periods
_MOST_BOW = 0.01  # of the picture: its ends are then off the best line by two thirds of that
_ERRORS = 2.0  # standard errors, for a bow that is more than its error
_LARGEST_ERROR = 0.02  # of the picture
_MOST_APART = 0.01, 1.0  # of the columns, and pixels: trace and retrace after the map


@dataclass(frozen=True)
class LatticeBows:
    """Sagittas of parabolas with standard errors, as shares of the picture.

    ``line`` is the bow of the lines along x, ``rows_x`` and ``rows_y`` that of the rows along x and y: a drift that
    changes.
    """

    line: Estimate
    rows_x: Estimate
    rows_y: Estimate

    @property
    def named(self) -> list[tuple[str, Estimate]]:
        """The bows, with words for each."""
        return [("lines along x", self.line), ("rows along x", self.rows_x), ("rows along y", self.rows_y)]

    @property
    def record(self) -> dict[str, Any]:
        """The bows in percent of the picture, as plain data."""
        return {
            name.replace(" ", "_"): {
                "value": round(100.0 * one.value, 4),
                "standard_error": round(100.0 * one.standard_error, 4),
            }
            for name, one in self.named
        }


def lattice_bows(picture: Floats, cell: Floats) -> LatticeBows | None:
    """Measure the bows of a picture; None where the ends have too few periods.

    Parameters
    ----------
    picture
        Heights, shape (rows, columns); NaN where nothing was imaged.
    cell
        The cell of the whole picture in pixels, shape (2, 2).
    """
    rows, columns = picture.shape
    for part in _PARTS:
        width, height = round(part * columns), round(part * rows)
        sides = _gradient(picture[:, :width], picture[:, columns - width :], cell)
        ends = _gradient(picture[:height], picture[rows - height :], cell)
        if sides is not None and ends is not None:
            slope = rows / columns  # a share of the height in one of the width
            return LatticeBows(*(_bow(one, part) for one in (sides[:, 0, 0], ends[:, 1, 0] * slope, ends[:, 1, 1])))
    return None


def _gradient(first: Floats, second: Floats, cell: Floats) -> Floats | None:
    """Return the change of the cell from one part to the other, less 1, shape (draws, 2, 2).

    The first draw is the measurement, the others are spread by the errors of both cells.
    """
    fits = [fit_cell(filtered_images(part)[0], cell) for part in (first, second)]
    random = np.random.default_rng(26)
    cells = [_drawn(fit, random) for fit in fits if fit is not None and same_lattice(fit.vectors, cell)]
    return np.linalg.solve(cells[0], cells[1]) - np.eye(2) if len(cells) == 2 else None


def _drawn(fit: CellFit, random: np.random.Generator) -> Floats:
    draws = random.multivariate_normal(fit.vectors.ravel(), fit.covariance, _DRAWS)
    return np.concatenate([fit.vectors[None], draws.reshape(-1, 2, 2)])


def _bow(change: Floats, part: float) -> Estimate:
    """Return the sagitta over its chord: a parabola is stretched by 8 (1 - part) of it more in one part."""
    bows = change / (8.0 * (1.0 - part))
    return Estimate(float(bows[0]), float(np.std(bows[1:])))


def check_bows(pictures: Sequence[Floats], cell: Floats, agreement: Agreement | None) -> list[LatticeBows]:
    """Check that lines and rows are straight enough for an affine map, and return the bows of each picture.

    Parameters
    ----------
    pictures
        Pictures after the map, shape (rows, columns) each; NaN where nothing was imaged.
    cell
        The cell that they should have, in pixels, shape (2, 2).
    agreement
        That of trace and retrace; None without a retrace.

    Raises
    ------
    Unphysical
        If a bow is above 1 % of the picture and twice its error, or is not known within 2 % (of lines: without a
        retrace); or if trace and retrace remain apart by 1 % of the line.
    """
    remedy = "correct with --fit without --affine, or with --scanner"
    measured = []
    for picture in pictures:
        bows = lattice_bows(picture, cell)
        if bows is None:
            raise Unphysical(
                f"the ends of the picture do not show the cell, by which a bow of lines and rows would be seen; "
                f"image more periods with less noise, or {remedy}"
            )
        for name, bow in bows.named:
            # With a retrace, its distance bounds the bow of the lines, which is opposite there.
            largest = np.inf if bow is bows.line and agreement is not None else _LARGEST_ERROR
            if bow.standard_error > largest or abs(bow.value) > max(_MOST_BOW, _ERRORS * bow.standard_error):
                raise Unphysical(
                    f"the {name} are bent by {100.0 * bow.value:.2g} +- {100.0 * bow.standard_error:.2g} % of the "
                    f"picture, which an affine map leaves; at most {100.0 * _MOST_BOW:g} % is accepted, and an error "
                    f"of {100.0 * _LARGEST_ERROR:g} %; {remedy}"
                )
        measured.append(bows)
    if agreement is not None:
        share, pixels = _MOST_APART
        most = max(share * pictures[0].shape[1], pixels)
        if agreement.worst is None or agreement.worst[1] > most:
            worst = agreement.worst
            apart = "have too little in common" if worst is None else f"are {worst[1]:.3g} pixels apart"
            raise Unphysical(
                f"trace and retrace {apart} after the affine map, and at most {most:.3g} pixels are accepted; {remedy}"
            )
    return measured
