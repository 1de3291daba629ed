"""The residual bends of a periodic sample in a straight image: the phases of its waves, pixel by pixel."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter

from tablegen.correction.agreement import levelled
from tablegen.numerics.arrays import Bools, Floats

_LEAST_PERIODS = 4.0  # in the picture, of a wave that is followed
_MOST_SHARE = 0.4  # of the sampling rate, of a wave that is followed
_STANDS_OUT = 200.0  # times the median power of what is searched
_SECOND = 0.01  # of the strongest power: another wave
_LEAST_ANGLE = 0.3  # sine of the angle between two waves
_PERIODS_A_MEAN = 0.7  # standard deviation of the window in which a phase is taken
_MARGIN = 1.5  # standard deviations from an edge, where half of a window is empty
_STRONG = 0.4  # of the median amplitude: where the sample is there


@dataclass(frozen=True, eq=False)
class ResidualLattice:
    """The deviation of a periodic sample from a perfect lattice in pixels; NaN at the edges.

    Shapes (rows, columns). ``y`` is None of a grating, whose ``x`` is the deviation of its bars.
    """

    x: Floats
    y: Floats | None

    @property
    def worst(self) -> tuple[float, float]:
        """The largest deviation in pixels, along x and y, without the outermost thousandth."""
        largest = [float(np.nanpercentile(np.abs(one), 99.9)) if one is not None else 0.0 for one in (self.x, self.y)]
        return largest[0], largest[1]


def residual_lattice(image: Floats) -> ResidualLattice | None:
    """Measure the deviation of a straight picture from the lattice that fits it best.

    The constants, angles and turn of that lattice are not checked.

    Parameters
    ----------
    image
        Heights, shape (rows, columns); NaN where nothing was imaged.

    Returns
    -------
    The deviation; None where no wave of a sample stands out.
    """
    imaged = np.isfinite(image)
    flat = levelled(image)
    waves = _strongest(flat)
    if not waves:
        return None
    phases = []
    inside: Bools = imaged
    for wave in waves:
        phase, good = _phase(flat, imaged, wave)
        phases.append(phase)
        inside = inside & good
    if int(np.sum(inside)) < image.size // 8:
        return None
    flattened = [_less_plane(phase, inside) for phase in phases]
    if len(waves) == 1:
        (along, across), (one,) = waves[0], flattened
        return ResidualLattice(-one / along, None) if abs(along) > abs(across) else None
    inverse = np.linalg.inv(np.array(waves))
    x, y = (-(row[0] * flattened[0] + row[1] * flattened[1]) for row in inverse)
    return ResidualLattice(x, y)


def _strongest(flat: Floats) -> list[tuple[float, float]]:
    """Return one or two waves, in periods per pixel along x and y."""
    rows, columns = flat.shape
    power = np.abs(np.fft.fft2(flat * np.hanning(rows)[:, None] * np.hanning(columns))) ** 2
    v, u = np.fft.fftfreq(rows)[:, None], np.fft.fftfreq(columns)[None, :]
    searched = (np.hypot(u * columns, v * rows) >= _LEAST_PERIODS) & (np.hypot(u, v) <= _MOST_SHARE)
    searched &= (u > 0.0) | ((u == 0.0) & (v > 0.0))
    usual = float(np.median(power[searched]))
    power = np.where(searched, power, 0.0)
    waves: list[tuple[float, float]] = []
    strongest = 0.0
    for _ in range(64):
        at = np.unravel_index(int(np.argmax(power)), power.shape)
        value = float(power[at])
        strongest = strongest or value
        if value < max(_STANDS_OUT * usual, _SECOND * strongest):
            return waves
        wave = float(u[0, at[1]]), float(v[at[0], 0])
        near = np.hypot((u - wave[0]) * columns, (v - wave[1]) * rows) < 3.0
        power = np.where(near, 0.0, power)
        if not waves:
            waves.append(wave)
        else:
            one = waves[0]
            sine = abs(one[0] * wave[1] - one[1] * wave[0]) / (np.hypot(*one) * np.hypot(*wave))
            if sine > _LEAST_ANGLE:
                return [one, wave]
    return waves


def _phase(flat: Floats, imaged: Bools, wave: tuple[float, float]) -> tuple[Floats, Bools]:
    """Return the phase less the wave's own in periods, unwrapped, and where it is reliable."""
    rows, columns = flat.shape
    y, x = np.mgrid[:rows, :columns]
    sigma = _PERIODS_A_MEAN / float(np.hypot(*wave))
    turned = flat * np.exp(-2j * np.pi * (wave[0] * x + wave[1] * y))
    mean = gaussian_filter(turned.real, sigma) + 1j * gaussian_filter(turned.imag, sigma)
    phase = np.unwrap(np.unwrap(np.angle(mean), axis=1)[:, :], axis=1)
    centre = phase[:, columns // 2]
    phase = phase + (np.unwrap(centre) - centre)[:, None]
    room = int(np.ceil(_MARGIN * sigma))
    good = np.zeros(flat.shape, bool)
    good[room : rows - room, room : columns - room] = True
    good &= np.abs(mean) > _STRONG * float(np.median(np.abs(mean)))
    full = gaussian_filter(imaged.astype(np.float64), sigma) > 0.999
    return phase / (2.0 * np.pi), good & full


def _less_plane(phase: Floats, inside: Bools) -> Floats:
    rows, columns = phase.shape
    y, x = np.mgrid[:rows, :columns]
    terms = np.stack([np.ones(int(np.sum(inside))), x[inside], y[inside]], axis=1)
    plane = np.linalg.lstsq(terms, phase[inside], rcond=None)[0]
    return np.where(inside, phase - plane[0] - plane[1] * x - plane[2] * y, np.nan)
