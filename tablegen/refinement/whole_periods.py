"""Whole periods between trace and retrace of a grating: by what is not periodic in them, or by a delay that is known.

The fit takes trace and retrace to be less than half a period apart. A delay of the images, or a scanner that is far
from its model, moves them further apart, and the waves of a grating look the same a period further. So do those of a
lattice with a row along the lines. What is not periodic, such as debris, defects and rough edges, does not.
"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d

from tablegen.calibration.record_checks import WrongRecord
from tablegen.numerics.arrays import Floats
from tablegen.refinement.lattice_line import LatticeLine

_PERIODS = 3  # shifts that are compared: so many whole periods to either side
_ALIKE_SHIFTS = (1, 2)  # periods after which a lattice may look the same
_ALIKE = 0.15  # share of the contrast that such a shift leaves; 0.12 is refused as waves at different places
_ROWS = 1.5  # standard deviation in rows over which residuals are averaged
_BACKGROUND = 2.0  # periods; slower structure is of the levelling
_CLEAR = 6.0  # standard errors; images without such content have up to 3.5
_BESIDE = 0.6  # of the correlation at the best shift: another one has less
_FEWEST_SHIFTS = 3
_OVERLAP = 0.5  # share of the compared line that both images show after a shift


@dataclass(frozen=True, eq=False)
class PeriodsApart:
    """Correlations of what is not periodic in trace and retrace, after shifts of whole periods.

    ``shifts`` in periods, positive where the images are late, (n,); ``correlations`` in standard errors, (n,).
    """

    shifts: Floats
    correlations: Floats

    @property
    def decided(self) -> int | None:
        """The whole periods that trace and retrace are apart beside the fit; None if the images do not show them."""
        if len(self.shifts) < _FEWEST_SHIFTS:
            return None
        best = int(np.argmax(self.correlations))
        highest, second = float(self.correlations[best]), float(np.max(np.delete(self.correlations, best)))
        return int(self.shifts[best]) if highest > _CLEAR and second < _BESIDE * highest else None


def check_periods_apart(frames: tuple[LatticeLine, ...], delay_pixels: float | None) -> None:
    """Check that trace and retrace belong together as fitted, and not a period of the sample further.

    Parameters
    ----------
    delay_pixels
        The known delay of the images in columns; None if it is not known.

    Raises
    ------
    WrongRecord
        If they are whole periods apart, or nothing shows whether they are.
    """
    frame = frames[0]
    if not _alike_after_a_period(frame):
        return
    columns = 0.5 * _columns_per_period(frame)  # a delay moves trace and retrace in opposite directions
    decided = {apart for apart in (periods_apart(one).decided for one in frames) if apart is not None}
    if decided == {0}:
        return
    if decided:
        apart = max(decided, key=abs)
        raise WrongRecord(
            f"trace and retrace are {_periods(apart)} of the sample further apart than its waves show, by debris or "
            f"defects in both; if the images are late, give --delay-pixels "
            f"{(delay_pixels or 0.0) + apart * columns:.3g}; else calibrate first, or take a sample of a longer period",
            "ambiguous-shift",
        )
    if delay_pixels is None:
        raise WrongRecord(
            f"ambiguous shift of the sample: images that are {columns:.2g} pixels later would show the same waves, and "
            f"there is no debris or defect that tells them apart. If the delay of the images is known to half of that, "
            f"give --delay-pixels, 0 if they are not late; else take a sample of a longer period, or one with debris",
            "ambiguous-shift",
        )
    if apart := round(_apart_at_turns(frame)):
        raise WrongRecord(
            f"ambiguous shift of the sample: trace and retrace would be {_periods(apart)} of it apart at the turns, "
            f"where they meet; calibrate first, or take a sample of a longer period",
            "ambiguous-shift",
        )


def _periods(count: int) -> str:
    return "a period" if abs(count) == 1 else f"{abs(count)} periods"


def _carrying(frame: LatticeLine) -> float:
    """Return the periods in the line of the wave that determines x best."""
    along = np.abs(frame.start.spots @ frame.fit.state.q)
    return float(along[np.argmax(along * frame.amplitudes)])


def _columns_per_period(frame: LatticeLine) -> float:
    low, high = frame.geometry.window
    return frame.geometry.columns / ((high - low) * _carrying(frame))


def _alike_after_a_period(frame: LatticeLine) -> bool:
    """Return True if the waves are nearly the same after a shift by whole periods of one of them."""
    power = frame.amplitudes**2
    turns = (frame.start.spots @ frame.fit.state.q) / _carrying(frame)
    lost = [float(power @ np.sin(np.pi * shift * turns) ** 2) for shift in _ALIKE_SHIFTS]
    return min(lost) * min(frame.fit.explained) < _ALIKE * float(np.sum(power))


def _apart_at_turns(frame: LatticeLine) -> float:
    """Return the distance of trace and retrace at the turns in periods, by a parabola along the line."""
    error = frame.fit.state.modes @ frame.rows_model.modes.values
    forward, backward = np.split(error, 2)
    place = frame.geometry.place
    parabola = np.polyfit(place, (forward - backward) * _carrying(frame), 2)
    return float(np.mean(np.polyval(parabola, [0.0, 1.0])))


def periods_apart(frame: LatticeLine) -> PeriodsApart:
    """Correlate what the waves leave in trace and retrace, after shifts of whole periods.

    Means over a period of the wave that determines x are compared, in which what remains of the waves cancels. The
    standard error of a correlation is that of two independent images with the same spectra (Bartlett).
    """
    period = 1.0 / _carrying(frame)
    places = np.split(frame.rows_model.positions(frame.fit.state), 2)
    low, high = max(float(x.min()) for x in places) + 0.5 * period, min(float(x.max()) for x in places) - 0.5 * period
    step = (places[0][-1] - places[0][0]) / (frame.geometry.columns - 1)
    grid = np.arange(low, high, step)
    if len(grid) * step < period:
        return PeriodsApart(np.zeros(0), np.zeros(0))
    images = [_averaged(rest, x, grid, period, step) for rest, x in zip(frame.fit.residuals, places, strict=True)]
    shape = (2 * len(images[0]), 2 * len(grid))
    trace, retrace = (np.fft.rfft2(image, shape) for image in images)
    cross = np.fft.irfft2(trace * np.conj(retrace), shape)[0]
    own = [np.fft.irfft2(np.abs(one) ** 2, shape) for one in (trace, retrace)]
    error = float(np.sqrt(max(float(np.sum(own[0] * own[1])) / images[0].size, 1e-300)))
    shifts = np.arange(-_PERIODS, _PERIODS + 1)
    shifts = shifts[np.abs(shifts) * period <= (1.0 - _OVERLAP) * len(grid) * step]
    at = shifts * period / step
    before = np.floor(at).astype(np.int64)
    values = (1.0 - at + before) * cross[before % shape[1]] + (at - before) * cross[(before + 1) % shape[1]]
    return PeriodsApart(shifts.astype(np.float64), values / error)


def _averaged(rest: Floats, x: Floats, grid: Floats, period: float, step: float) -> Floats:
    """Return means over a period at each point of a grid, less what all rows share and what varies slowly.

    Parameters
    ----------
    rest
        Residual heights, shape (rows, columns); ``x`` their positions, ascending, shape (columns,).
    """
    total = np.concatenate(
        [np.zeros((len(rest), 1)), np.cumsum(0.5 * (rest[:, 1:] + rest[:, :-1]) * np.diff(x), axis=1)], axis=1
    )
    means = (_between(total, x, grid + 0.5 * period) - _between(total, x, grid - 0.5 * period)) / period
    means = gaussian_filter1d(means, _ROWS, axis=0)
    means = means - gaussian_filter1d(means, _BACKGROUND * period / step, axis=1)
    return np.asarray(means - np.mean(means, axis=0), dtype=np.float64)


def _between(values: Floats, x: Floats, at: Floats) -> Floats:
    """Interpolate the columns of values at positions."""
    left = np.clip(np.searchsorted(x, at) - 1, 0, len(x) - 2)
    share = (at - x[left]) / (x[left + 1] - x[left])
    return np.asarray(values[:, left] * (1.0 - share) + values[:, left + 1] * share, dtype=np.float64)
