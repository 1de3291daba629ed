"""The position of each pixel of a frame whose axes both follow the line and the frame: no row or column is straight.

The pixel at a point of the straight grid is found by a fixed-point iteration: the displacement of the pixels is small
against their distance from each other over the image, and smooth.
"""

from dataclasses import dataclass, field

import numpy as np
from scipy.ndimage import map_coordinates

from tablegen.base.input_errors import Unphysical
from tablegen.correction.distortion import Distortion, Sweep1D
from tablegen.numerics.arrays import Bools, Floats

_ROUNDS = 60
_CLOSE = 1e-4  # of a pixel: a fixed point
_ROUNDING = 1e-3  # of a pixel


@dataclass(frozen=True, eq=False)
class FrameDistortion(Distortion):
    """A distortion of which ``places`` has the positions of all pixels, along the lines and across them.

    They are by direction, shape (rows, columns) each. ``forward``, ``backward``, ``y`` and ``drift`` are their means.
    """

    places: dict[bool, tuple[Floats, Floats]] = field(default_factory=dict)

    @classmethod
    def of(cls, places: dict[bool, tuple[Floats, Floats]], times: dict[bool, Floats]) -> "FrameDistortion":
        """Return the distortion of pixels at these places, and at these times in the line, the left ones first."""
        sweeps = {way: Sweep1D(np.mean(along, axis=0), times[way]) for way, (along, _) in places.items()}
        rows, columns = next(iter(places.values()))[0].shape
        middles = np.mean([np.mean(across, axis=1) for _, across in places.values()], axis=0)
        inner = 0.5 * (middles[1:] + middles[:-1])
        edges = [1.5 * middles[0] - 0.5 * middles[1]], inner, [1.5 * middles[-1] - 0.5 * middles[-2]]
        y = np.concatenate(edges)
        still = np.zeros(rows + 1)
        return cls(rows, columns, sweeps.get(True), sweeps.get(False), y, still, 1.0, places)

    def mirrored(self) -> "FrameDistortion":
        """Return the distortion of the mirror image: left and right, and forward and backward, are exchanged."""
        low, high = self.x_range
        places = {not way: (low + high - u[:, ::-1], v[:, ::-1]) for way, (u, v) in self.places.items()}
        return FrameDistortion.of(places, {not way: one.time[::-1] for way, one in self.sides})

    def sources(self, forward: bool) -> tuple[Floats, Floats, Bools]:
        """Return the source of each pixel of the straight image, as ``Distortion.sources``.

        Raises
        ------
        KeyError
            If the direction was not imaged.
        Unphysical
            If the pixels do not follow each other.
        """
        along, across = self.places[forward]
        x, y = self.grid
        own_row, own_column = np.mgrid[: self.rows, : self.columns].astype(np.float64)
        per_column, per_row = (x[-1] - x[0]) / (self.columns - 1), (y[-1] - y[0]) / (self.rows - 1)
        moved = (across - y[0]) / per_row - own_row, (along - x[0]) / per_column - own_column
        row, column = own_row.copy(), own_column.copy()
        for _ in range(_ROUNDS):
            at = np.stack([row, column])
            next_row, next_column = (
                own - map_coordinates(by, at, order=1, mode="nearest")
                for own, by in zip((own_row, own_column), moved, strict=True)
            )
            change = max(float(np.max(np.abs(next_row - row))), float(np.max(np.abs(next_column - column))))
            row, column = next_row, next_column
            if change < _CLOSE:
                break
        else:
            raise Unphysical("the pixels of the frame do not follow each other; is this the scanner of the image?")
        inside = np.ones(row.shape, dtype=np.bool_)
        for values, last in ((row, self.rows - 1.0), (column, self.columns - 1.0)):
            inside &= (values >= -_ROUNDING) & (values <= last + _ROUNDING)
        return np.clip(row, 0.0, self.rows - 1.0), np.clip(column, 0.0, self.columns - 1.0), inside
