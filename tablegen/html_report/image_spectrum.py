"""The spectrum of an image as a chart: its significant spots, and the waves of the cell."""

import numpy as np

from tablegen.charts.chart import Arrows, Chart, DrawnCurve, Raster
from tablegen.images.autocorrelation import power_spectrum
from tablegen.images.lattice_filters import FilteredImage
from tablegen.numerics.arrays import Bools, Floats

_ROOM = 1.25  # times the fastest wave of a spot
_MOST_CELLS = 256  # of the picture, along and across: more would not be visible
_FAINTEST = -40.0  # dB


def spectrum_chart(
    image: FilteredImage,
    waves: Floats,
    explained: Bools,
    base: Floats,
    pixel: tuple[float, float],
    unit: str,
    bottom_first: bool,
) -> Chart:
    """Draw the power of both halves of a spectrum, and the spots of the right one; the left half has the same power.

    Parameters
    ----------
    image
        The view of the image in which the spots were found.
    waves
        Waves per pixel of the significant spots along x and y, shape (n, 2), x from 0.
    explained
        True for the spots of the cell, shape (n,).
    base
        The base waves of the cell, or that of a grating, per pixel, shape (2, 2) or (1, 2); drawn as arrows.
    pixel
        Width and height of a pixel in ``unit``.
    unit
        Unit of lengths.
    bottom_first
        True if the first row is the lowest one.
    """
    power, u, v = power_spectrum(image)
    upwards = 1.0 if bottom_first else -1.0
    scale = np.array([1.0 / pixel[0], upwards / pixel[1]])
    spots = waves * scale
    furthest = _ROOM * float(np.max(np.abs(np.concatenate([spots, base * scale]))))
    columns = u / pixel[0] <= furthest
    rows = np.abs(v) / pixel[1] <= furthest
    rows[0] = False  # -0.5 has no counterpart
    half = power[np.ix_(rows, columns)]
    both = np.concatenate([half[::-1, :0:-1], half], axis=1)
    strongest = float(np.max([_power_at(power, u, v, wave) for wave in waves], initial=0.0)) or float(np.max(both))
    values = 10.0 * np.log10(np.maximum(_thinned(both), 1e-12 * strongest) / strongest)
    width, height = float(u[columns][-1]) / pixel[0], float(v[rows][-1]) / pixel[1]
    raster = Raster(
        values[::-1] if bottom_first else values,
        (-width, width),
        (-height, height),
        _FAINTEST,
        0.0,
        "grey",
        f"power of the {image.name} over the strongest spot [dB]",
    )
    arrows = Arrows(np.zeros(len(base)), np.zeros(len(base)), *(base * scale).T)
    sample = "cell" if len(base) > 1 else "grating"
    curves = [DrawnCurve(f"spots of the {sample}", "limit", spots[explained, 0], spots[explained, 1], kind="points")]
    if not np.all(explained):
        curves.append(DrawnCurve("other spots", "backward", spots[~explained, 0], spots[~explained, 1], kind="points"))
    title = f"spectrum: {int(np.sum(explained))} of {len(explained)} spots are the {sample}'s"
    label = "waves along {} [1/{}]"
    return Chart(
        "spectrum",
        title,
        label.format("x", unit),
        label.format("y", unit),
        tuple(curves),
        raster=raster,
        arrows=arrows,
        equal=True,
    )


def _power_at(power: Floats, u: Floats, v: Floats, wave: Floats) -> float:
    sign = 1.0 if wave[0] >= 0.0 else -1.0
    return float(power[np.argmin(np.abs(v - sign * wave[1])), np.argmin(np.abs(u - sign * wave[0]))])


def _thinned(values: Floats) -> Floats:
    """Return the largest value of each block, so that no spot is lost."""
    rows, columns = (max(1, -(-count // _MOST_CELLS)) for count in values.shape)
    return np.asarray(
        np.maximum.reduceat(
            np.maximum.reduceat(values, np.arange(0, values.shape[0], rows), axis=0),
            np.arange(0, values.shape[1], columns),
            axis=1,
        )
    )
