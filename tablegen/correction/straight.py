"""The corrected channels of a scan, with the recorded ones and the record of the correction, for the files."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tablegen.correction.agreement import Agreement, agreement
from tablegen.correction.distortion import Distortion, Resampler
from tablegen.correction.residual_lattice import ResidualLattice, residual_lattice
from tablegen.numerics.arrays import Floats
from tablegen.version import __version__


@dataclass(frozen=True, eq=False)
class ScanPicture:
    """One channel of one direction, (rows, columns), rows in the order of time, the left end of the line first.

    ``bottom_first`` is true if the first row in time is the lowest of the picture.
    """

    title: str
    forward: bool
    heights: Floats
    unit: str = ""
    bottom_first: bool = False


@dataclass(frozen=True, eq=False)
class StraightScan:
    """Corrected pictures, NaN where nothing was imaged; their size in nm, or None; and the record of the correction.

    ``raw`` are the recorded pictures, ``reference`` the numbers of those that were compared. ``distortion`` is the one
    that was corrected, ``agreement`` that of the reference pictures, None without a retrace. ``lattice`` has the
    residual bends, None without a period.
    """

    pictures: tuple[ScanPicture, ...]
    size_nm: tuple[float, float] | None
    distortion: Distortion
    agreement: Agreement | None
    lattice: ResidualLattice | None
    raw: tuple[ScanPicture, ...]
    reference: tuple[int, ...]
    record: dict[str, Any] = field(default_factory=dict)

    @property
    def moved_pixels(self) -> tuple[float, float]:
        """The largest displacement along x and y, relative to the mean one."""
        spreads = []
        for axis in (0, 1):
            parts = np.concatenate(
                [self.distortion.displacement(way)[axis].ravel() for way, _ in self.distortion.sides]
            )
            parts = parts[np.isfinite(parts)]
            spreads.append(float(np.max(np.abs(parts - np.mean(parts)))))
        return spreads[0], spreads[1]


def corrected_scan(
    raw: Sequence[ScanPicture],
    distortion: Distortion,
    size_nm: tuple[float, float] | None,
    reference: Sequence[int],
    how: dict[str, Any],
) -> StraightScan:
    """Resample every picture once; ``reference`` are the numbers of the trace and the retrace that are compared.

    ``how`` describes the correction, for the record. All pictures have the rows and columns of the distortion.
    """
    ways = {way: Resampler.of(distortion, way) for way in {picture.forward for picture in raw}}
    pictures = tuple(
        ScanPicture(one.title, one.forward, ways[one.forward](one.heights), one.unit, one.bottom_first) for one in raw
    )
    match = None
    if len(reference) == 2:
        first, second = reference
        recorded, straight = ((group[first].heights, group[second].heights) for group in (tuple(raw), pictures))
        match = agreement(recorded, straight, distortion)
    before_and_after: dict[str, Any] = {}
    if match is not None:
        names = ("before", "after")
        before_and_after["difference"] = dict(zip(names, (round(v, 6) for v in match.difference), strict=True))
        if match.worst is not None:
            before_and_after["apart_pixels"] = dict(zip(names, (round(v, 4) for v in match.worst), strict=True))
    rows, columns = distortion.rows, distortion.columns
    lattice = residual_lattice(pictures[reference[0]].heights)
    record: dict[str, Any] = {
        "program": f"tablegen {__version__}",
        "command": "correct",
        **how,
        "interpolation": "cubic splines, once; nothing beyond the scan",
        "pixels": [columns, rows],
    }
    if size_nm is not None:
        record["size_nm"] = [round(value, 6) for value in size_nm]
    if before_and_after:
        record["trace_retrace"] = before_and_after
    if lattice is not None:
        off = (100.0 * worst / count for worst, count in zip(lattice.worst, (columns, rows), strict=True))
        record["lattice_off_percent"] = [round(value, 4) for value in off]
    return StraightScan(pictures, size_nm, distortion, match, lattice, tuple(raw), tuple(reference), record)
