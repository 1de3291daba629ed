"""Three ways to limit the band of a line: the paper's low-pass, sigma factors, and a fit to the imaging window."""

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.compensation.line import LineShape
from tablegen.config.schema import BandLimit
from tablegen.numerics.turns import sinc
from tablegen.waveform.error_allowance import AllowedError
from tablegen.waveform.refined import RefinedShape
from tablegen.waveform.series import FourierSeries
from tablegen.waveform.window_fit import fit_window


def band_limited(
    shape: LineShape, limit: BandLimit, harmonics: int, layer: FourierSeries | None = None
) -> FourierSeries:
    """Return the line waveform in harmonics 1..``harmonics``.

    ``truncate`` keeps the Fourier coefficients as they are and rings; ``lanczos`` multiplies them by sigma factors
    sinc(n / (H + 1)); ``window`` is straight inside the imaging window and leaves the turnarounds free.
    A model that makes the whole waveform itself has done all this. A ``layer`` is added: inside the window to what is
    fitted, otherwise to the coefficients as it is.

    Raises
    ------
    Unphysical
        If the fit cannot stay inside [0, 1].
    """
    if shape.whole is not None:
        waveform = shape.whole.series
        return waveform if layer is None else waveform.plus(layer)
    if limit.method == "window":
        target = shape if layer is None else RefinedShape(shape, layer)
        return fit_window(target, harmonics, limit.window, limit.directions == "both")
    from tablegen.waveform.closed_form import fourier_series  # here: most scans have a window

    series = fourier_series(shape, harmonics)
    if limit.method == "lanczos":
        sigma = sinc(np.arange(1, harmonics + 1) / (harmonics + 1))
        series = FourierSeries(series.a0, series.a * sigma, series.b * sigma)
    return series if layer is None else series.plus(layer)


def minimum_acceleration_line(
    shape: LineShape, limit: BandLimit, harmonics: int, layer: FourierSeries | None, allowed: AllowedError
) -> tuple[FourierSeries, float | None]:
    """Return the line of minimum acceleration that keeps an error, and that error in percent.

    An allowance that is not firm is dropped where the harmonics cannot keep it: the result is then ``band_limited`` and
    None.

    Raises
    ------
    Unreachable
        If a firm error cannot be kept.
    """
    if shape.whole is None:
        from tablegen.planning.enough_harmonics import straightness  # here: most lines are fitted to their window
        from tablegen.waveform.minimum_acceleration import minimum_acceleration_series

        try:
            return minimum_acceleration_series(
                straightness(shape, limit, layer), harmonics, allowed.percent
            ), allowed.percent
        except Unphysical:
            if allowed.firm:
                raise
    trade = None if shape.whole is None else shape.whole.trade
    return band_limited(shape, limit, harmonics, layer), None if trade is None else trade.percent
