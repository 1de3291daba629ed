"""From samples of a displacement, each at its own phase, to one period as a Fourier series with its covariance."""

from collections.abc import Callable
from dataclasses import dataclass
from math import pi

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.fitting.correlation import correlation_length
from tablegen.numerics.arrays import Floats
from tablegen.waveform.series import FourierSeries

_CHUNK_SAMPLES = 1 << 12  # samples that are evaluated at a time
_OUTLIER_SIGMAS = 7.0  # standard deviations
_GRID = 1024  # points of a period at which the requested position is evaluated


@dataclass(frozen=True, eq=False)
class Displacement:
    """One settled period in nm, as the sensor reads it.

    ``covariance`` is of (a0, a, b) in nm^2, shape (2 H + 1, 2 H + 1), widened where residuals are correlated over
    ``correlated`` samples. ``noise_nm`` is that of a reading, ``drift_nm`` the drift over the trace, ``stray`` the
    sample farthest from the others, counted from 0, if it is an outlier.
    """

    series: FourierSeries
    covariance: Floats
    noise_nm: float
    drift_nm: float
    correlated: float
    periods: float
    samples: int
    left_out: int
    stray: int | None = None

    @property
    def forward_only(self) -> bool:
        """False: a trace has the whole period."""
        return False

    @property
    def detail(self) -> int:
        """The highest harmonic of the series."""
        return self.series.harmonics

    def value(self, times: Floats) -> Floats:
        """Return the displacement at times.

        Parameters
        ----------
        times
            Times in periods, of any shape.

        Returns
        -------
        Displacement in nm, of that shape.
        """
        return self.series.value(times)

    def basis(self, times: Floats) -> Floats:
        """Return the matrix from (a0, a, b) to the displacement.

        Parameters
        ----------
        times
            Times in periods, shape (times,).

        Returns
        -------
        Matrix, shape (times, 2 H + 1).
        """
        return harmonic_basis(times, self.series.harmonics)

    def error(self, requested: Callable[[Floats], Floats], size_nm: float) -> Floats:
        """Return the coefficients of the displacement less the requested line; that of the mean is arbitrary.

        Parameters
        ----------
        requested
            Returns the position on the line, 0..1, at times in periods, of their shape.
        size_nm
            Length of the line in nm.

        Returns
        -------
        Coefficients (a0, a, b) in nm, shape (2 H + 1,).
        """
        times = (np.arange(_GRID) + 0.5) / _GRID
        series = np.concatenate([[0.0], self.series.a, self.series.b])
        coefficients: Floats = series - size_nm * (2.0 / _GRID) * (self.basis(times).T @ requested(times))
        return coefficients

    @property
    def groups(self) -> list[list[int]]:
        """Coefficients that are learnt or discarded as a group: cosine and sine of a harmonic."""
        count = self.series.harmonics
        return [[n, count + n] for n in range(1, count + 1)]


def harmonic_basis(times: Floats, harmonics: int) -> Floats:
    """Return 1, cosines and sines.

    Parameters
    ----------
    times
        Times in periods, shape (times,).

    Returns
    -------
    Matrix, shape (times, 2 harmonics + 1).
    """
    angle = 2.0 * pi * np.outer(times, np.arange(1, harmonics + 1))
    basis: Floats = np.column_stack([np.ones(len(times)), np.cos(angle), np.sin(angle)])
    return basis


def fit_displacement(
    turns: Floats, displacement_nm: Floats, harmonics: int, settle_periods: int | None = None, order: int | None = None
) -> Displacement:
    """Fit harmonics 0..``harmonics`` and a polynomial drift to a trace.

    Parameters
    ----------
    turns
        Times in periods, ascending, shape (samples,).
    displacement_nm
        Readings in nm, shape (samples,).
    settle_periods
        Periods at the beginning that are left out; the first one of three or more if None.
    order
        Order of the drift over the record. By default 0 below two periods, which do not determine a drift, 1 from two
        on, 2 from four, 3 from six.

    Raises
    ------
    Unphysical
        If less than a period is left, the displacement is constant, or the samples do not determine the harmonics.
    """
    per_turn = (len(turns) - 1) / float(turns[-1] - turns[0])
    periods = float(turns[-1] - turns[0]) + 1.0 / per_turn
    settle = settle_periods if settle_periods is not None else (1 if periods >= 2.99 else 0)
    periods -= settle
    if periods < 0.99:
        raise Unphysical(
            f"{periods + settle:.3g} periods are recorded, which leaves no whole period after {settle} to settle"
        )
    left_out = int(np.searchsorted(turns, turns[0] + settle - 0.5 / per_turn)) if settle else 0
    if order is None:
        order = int(np.searchsorted([1.99, 3.99, 5.99], periods, side="right"))
    t, measured = turns[left_out:], displacement_nm[left_out:]
    middle, height = float(np.mean(measured)), float(np.ptp(measured))
    if not height > 0.0:
        raise Unphysical("the displacement does not move")
    count = min(harmonics, int(per_turn / 2.5))
    span = float(t[-1] - t[0])

    def basis(rows: slice) -> Floats:
        """Return 1, cosines, sines and the drift, a row each."""
        angle = 2.0 * pi * (t[rows] % 1.0)
        s = 2.0 * (t[rows] - t[0]) / span - 1.0
        out = np.empty((1 + 2 * count + order, len(s)))
        out[0] = 1.0
        once = np.cos(angle) + 1j * np.sin(angle)
        wave = once.copy()
        for n in range(1, count + 1):
            out[n], out[count + n] = wave.real, wave.imag
            wave *= once
        if order:
            out[1 + 2 * count] = s
        for n in range(2, order + 1):  # 0 at both ends, and so nearly independent of the line
            out[2 * count + n] = s**n - s ** (n % 2)
        return out

    normal: Floats = np.zeros((1 + 2 * count + order,) * 2)
    right = np.zeros(len(normal))
    parts = [slice(first, first + _CHUNK_SAMPLES) for first in range(0, len(t), _CHUNK_SAMPLES)]
    for rows in parts:
        b = basis(rows)
        normal += b @ b.T
        right += b @ ((measured[rows] - middle) / height)
    size = np.linalg.eigvalsh(normal)
    if len(t) <= len(normal) or size[0] <= 1e-9 * size[-1]:
        raise Unphysical(
            f"{len(t)} samples at these times do not determine {count} harmonics; record more of them, or more periods"
        )
    inverse = np.linalg.inv(normal)
    c = inverse @ right
    residual, drift = np.empty(len(t)), []
    for rows in parts:
        b = basis(rows)
        residual[rows] = (measured[rows] - middle) / height - c @ b
        there = c[1 + 2 * count :] @ b[1 + 2 * count :]
        drift += [float(np.min(there)), float(np.max(there))]
    correlated = correlation_length(residual)
    freedom = max(len(t) / correlated - len(c), 1.0)
    covariance: Floats = np.array(
        inverse[: 1 + 2 * count, : 1 + 2 * count] * float(float(residual @ residual) / freedom * height**2),
        dtype=np.float64,
    )
    scaled: Floats = height * c[: 1 + 2 * count]
    series = FourierSeries(middle + float(scaled[0]), scaled[1 : count + 1].copy(), scaled[count + 1 :].copy())
    noise = height * float(np.sqrt(residual @ residual / max(len(t) - len(c), 1)))
    distance = np.abs(residual)
    farthest = int(np.argmax(distance))  # it pulls the fit, and the others seem off too
    most = float(distance[farthest])
    stands_out = most > max(_OUTLIER_SIGMAS * 1.4826 * float(np.median(distance, overwrite_input=True)), 1e-6)
    stray = left_out + farthest if stands_out else None
    drift_nm = height * (max(drift) - min(drift))
    return Displacement(series, covariance, noise, drift_nm, correlated, periods, len(t), left_out, stray)
