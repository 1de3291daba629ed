"""Values of a Fourier series at many times as a linear map of its coefficients, by tables and sums in a fixed order.

Unknowns are those of its acceleration: y = (a0, (2 pi n)^2 a_n, (2 pi n)^2 b_n), n = 1..H, so that value, slope and
acceleration are of one size. With rows of weights W and of derivative d, ``times(y)`` is W w^(d)(t_j), ``gram(d)`` the
matrix B^T diag(d) B of this map B: products of two harmonics depend on the sum and the difference of their numbers
alone, so that 4 H + 2 sums over the times make all of it.
"""

from math import tau

import numpy as np

from tablegen.numerics.arrays import Floats, folded_sum
from tablegen.numerics.turns import sine_and_cosine
from tablegen.waveform.series import FourierSeries


class HarmonicRows:
    """Rows ``weight`` times derivative 0, 1 or 2 at ``times`` (periods); both (m,). The series has ``harmonics``."""

    def __init__(self, times: Floats, weight: Floats, harmonics: int, derivative: int) -> None:
        n = np.arange(2 * harmonics + 1, dtype=np.float64)
        self._s, self._c = sine_and_cosine(n[:, None] * times[None, :])
        low = slice(0, harmonics + 1)
        self._by_time = np.ascontiguousarray(self._c[low].T), np.ascontiguousarray(self._s[low].T)
        self._weight, self._derivative, self._harmonics = weight, derivative, harmonics
        rate = tau * np.arange(1, harmonics + 1)
        over = 1.0 / (rate * rate) if derivative == 0 else 1.0 / rate if derivative == 1 else np.ones(harmonics)
        self._factor = np.concatenate([[1.0 if derivative == 0 else 0.0], over])
        order = np.arange(harmonics + 1)
        minus = order[:, None] - order[None, :]
        self._difference, self._sign, self._sum = np.abs(minus), np.sign(minus), order[:, None] + order[None, :]

    def times(self, y: Floats) -> Floats:
        """Return the rows applied to unknowns.

        Parameters
        ----------
        y
            Unknowns, shape (2 H + 1,).

        Returns
        -------
        Floats
            Shape (m,).
        """
        c, s = self._by_time
        h = self._harmonics
        p = self._factor * y[: h + 1]
        q = self._factor * np.concatenate([[0.0], y[h + 1 :]])
        if self._derivative == 1:
            return self._weight * folded_sum(c * q - s * p)
        sign = 1.0 if self._derivative == 0 else -1.0
        return sign * self._weight * folded_sum(c * p + s * q)

    def transposed(self, z: Floats) -> Floats:
        """Return the transposed rows applied to z.

        Parameters
        ----------
        z
            One value a row, shape (m,).

        Returns
        -------
        Floats
            Shape (2 H + 1,).
        """
        low = slice(0, self._harmonics + 1)
        z = self._weight * z
        cosines, sines = folded_sum(self._c[low] * z), folded_sum(self._s[low] * z)
        if self._derivative == 1:
            cosines, sines = -sines, cosines
        elif self._derivative == 2:
            cosines, sines = -cosines, -sines
        return np.concatenate([self._factor * cosines, (self._factor * sines)[1:]])

    def gram(self, diagonal: Floats) -> Floats:
        """Return the matrix B^T diag(diagonal) B of the rows B.

        Parameters
        ----------
        diagonal
            One weight a row, shape (m,).

        Returns
        -------
        Floats
            Shape (2 H + 1, 2 H + 1), symmetric.
        """
        weight = diagonal * self._weight * self._weight
        cosines, sines = folded_sum(self._c * weight), folded_sum(self._s * weight)
        near, far = cosines[self._difference], cosines[self._sum]
        cos_cos, sin_sin = 0.5 * (near + far), 0.5 * (near - far)
        sin_cos = 0.5 * (sines[self._sum] + self._sign * sines[self._difference])  # sine of the row
        if self._derivative == 1:
            cos_cos, sin_sin, sin_cos = sin_sin, cos_cos, -sin_cos.T
        scale = self._factor[:, None] * self._factor[None, :]
        h = self._harmonics
        out = np.empty((2 * h + 1, 2 * h + 1))
        out[: h + 1, : h + 1] = scale * cos_cos
        out[h + 1 :, h + 1 :] = (scale * sin_sin)[1:, 1:]
        mixed = (scale * sin_cos)[1:, :]
        out[h + 1 :, : h + 1] = mixed
        out[: h + 1, h + 1 :] = mixed.T
        return out


def unknowns(series: FourierSeries) -> Floats:
    """Return the unknowns y of a series.

    Returns
    -------
    Floats
        Shape (2 H + 1,).
    """
    rate = tau * np.arange(1, series.harmonics + 1)
    return np.concatenate([[series.a0], rate * rate * series.a, rate * rate * series.b])


def series_of(y: Floats) -> FourierSeries:
    """Return the series of unknowns, the inverse of ``unknowns``.

    Parameters
    ----------
    y
        Shape (2 H + 1,).

    Returns
    -------
    FourierSeries
        Of H harmonics.
    """
    harmonics = len(y) // 2
    rate = tau * np.arange(1, harmonics + 1)
    return FourierSeries(float(y[0]), y[1 : harmonics + 1] / (rate * rate), y[harmonics + 1 :] / (rate * rate))
