"""Three ways to limit the band of a line: the paper's low-pass, sigma factors, and a fit to the imaging window."""

import numpy as np

from tablegen.compensation.hysteresis import LineShape
from tablegen.config.schema import BandLimit
from tablegen.numerics.turns import sinc
from tablegen.waveform.closed_form import fourier_series
from tablegen.waveform.series import FourierSeries
from tablegen.waveform.window_fit import fit_window


def band_limited(shape: LineShape, limit: BandLimit, harmonics: int) -> FourierSeries:
    """The line waveform in harmonics 1..``harmonics``.

    ``truncate`` keeps the Fourier coefficients as they are and rings; ``lanczos`` multiplies them by sigma factors
    sinc(n / (H + 1)); ``window`` is straight inside the imaging window and leaves the turnarounds free.
    Raises ``Unphysical`` where the fit cannot stay inside [0, 1].
    """
    if limit.method == "window":
        return fit_window(shape, harmonics, limit.window, limit.directions == "both")
    series = fourier_series(shape, harmonics)
    if limit.method == "truncate":
        return series
    sigma = sinc(np.arange(1, harmonics + 1) / (harmonics + 1))
    return FourierSeries(series.a0, series.a * sigma, series.b * sigma)
