"""What learning takes of a measurement of the running scan, be it a sensor's trace or images."""

from collections.abc import Callable
from typing import Protocol

from tablegen.numerics.arrays import Floats


class LineMeasurement(Protocol):
    """One settled period in nm, linear in coefficients whose errors are known."""

    @property
    def detail(self) -> int:
        """About as many harmonics as the finest of it has."""

    @property
    def covariance(self) -> Floats:
        """Of the coefficients, in nm^2."""

    @property
    def groups(self) -> list[list[int]]:
        """Coefficients that are noise or not together."""

    def value(self, times: Floats) -> Floats:
        """Where the piezo was, in nm, at times in periods, in the imaged windows."""

    def basis(self, times: Floats) -> Floats:
        """Return the matrix from the coefficients to the displacement: (times, coefficients)."""

    def error(self, asked: Callable[[Floats], Floats], size_nm: float) -> Floats:
        """Return the coefficients of the reached line less the line ``asked`` at times, in nm."""
