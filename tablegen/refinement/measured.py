"""The interface of a measurement of the running scan, from a sensor's trace or from images."""

from collections.abc import Callable
from typing import Protocol

from tablegen.numerics.arrays import Floats


class LineMeasurement(Protocol):
    """One settled period in nm, linear in coefficients whose errors are known."""

    @property
    def detail(self) -> int:
        """About as many harmonics as its finest detail has."""

    @property
    def forward_only(self) -> bool:
        """True if the way back was not measured, as of the slow axis in images."""

    @property
    def covariance(self) -> Floats:
        """The covariance of the coefficients.

        Returns
        -------
        Matrix in nm^2, shape (coefficients, coefficients).
        """

    @property
    def groups(self) -> list[list[int]]:
        """Coefficients that are learnt or discarded as a group."""

    def value(self, times: Floats) -> Floats:
        """Return the position of the piezo in the imaged windows.

        Parameters
        ----------
        times
            Times in periods, shape (times,).

        Returns
        -------
        Positions in nm, shape (times,).
        """

    def basis(self, times: Floats) -> Floats:
        """Return the matrix from the coefficients to the displacement.

        Parameters
        ----------
        times
            Times in periods, shape (times,).

        Returns
        -------
        Matrix, shape (times, coefficients).
        """

    def error(self, requested: Callable[[Floats], Floats], size_nm: float) -> Floats:
        """Return the coefficients of the reached line less the requested one.

        Parameters
        ----------
        requested
            Returns the requested position, 0..1, at times in periods, of their shape.
        size_nm
            Length of the line in nm.

        Returns
        -------
        Coefficients in nm, shape (coefficients,).
        """
