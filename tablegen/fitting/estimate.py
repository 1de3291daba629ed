"""Results of a calibration: estimates with standard errors, residuals, remarks, and curves to draw."""

from dataclasses import dataclass
from math import isfinite, nan
from typing import Literal

from tablegen.base.warnings import Remark
from tablegen.numerics.arrays import Floats


@dataclass(frozen=True, slots=True)
class Estimate:
    """A value and its standard error: twice of it covers the truth in 95 % of measurements, however few the points.

    The error is nan where it is unknown: with no more points than parameters, or for a value that was set, not fitted.
    """

    value: float
    standard_error: float = nan

    @property
    def rounded(self) -> float:
        """The value in its significant digits: rounded by at most a hundredth of its standard error."""
        digits = 9
        if isfinite(self.standard_error) and self.standard_error > 0.0 and self.value:
            while digits > 3 and abs(_significant(self.value, digits - 1) - self.value) <= 0.01 * self.standard_error:
                digits -= 1
        return _significant(self.value, digits)


@dataclass(frozen=True)
class Curve:
    """Points and the fitted line through them, for a plot; as (x, y). Labels contain the unit.

    ``backward`` has the first points of the backward direction, measured and fitted, where a curve has both directions;
    ``direction`` is that of a curve that has one.
    """

    title: str
    x_label: str
    y_label: str
    measured: tuple[Floats, Floats]
    fitted: tuple[Floats, Floats]
    backward: tuple[int, int] | None = None
    direction: Literal["forward", "backward", ""] = ""


@dataclass(frozen=True)
class LineSize:
    """Size of a line from turn to turn, in nm, with the error of this image.

    ``shared`` is the relative error of all such images. ``angle_deg`` is that of the first wave, or the cell's first
    side, from the fast axis; ``aspect`` the frame's height over the line's length as a lattice shows it, and ``drift``
    along x in the frame, of the line; nan of a grating.
    """

    nm: Estimate
    shared: float
    angle_deg: float
    aspect: float
    drift: float


@dataclass(frozen=True)
class ImageSize:
    """Size of an image's line: ``size``, the periods of its first wave, the noise in percent of the contrast.

    ``open_percent`` is the distance of trace and retrace at the turns, of the line; nan where nothing shows it.
    """

    name: str
    v_scan: float
    v_offset: float | None
    size: LineSize
    periods: float
    noise_percent: float
    open_percent: float


@dataclass(frozen=True, kw_only=True)
class Fit:
    """Fields that all calibrations have in common.

    ``residual_percent`` is in the paper's metric: scale error of each point in percent for sizes and gains, position
    error in percent of the scan for hysteresis. ``before_percent`` is the largest error without the correction.
    ``outliers`` are the rows, counted from 0, far from the other points; they stay in the fit. ``images`` are the
    images from which sizes were measured, a row each; none where sizes were given.
    """

    points: int
    residual_percent: Floats
    before_percent: float
    remarks: tuple[Remark, ...]
    outliers: tuple[int, ...]
    curves: tuple[Curve, ...]
    images: tuple[ImageSize, ...] = ()

    @property
    def rms_percent(self) -> float:
        """Root mean square of the residuals, in percent."""
        return float((self.residual_percent**2).mean() ** 0.5)

    @property
    def largest_percent(self) -> float:
        """The largest residual, in percent."""
        return float(abs(self.residual_percent).max())


def _significant(value: float, digits: int) -> float:
    return float(f"{value:.{digits}g}")
