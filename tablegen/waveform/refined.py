"""The target of a drive: the shape of the model, or that shape with a layer learnt from a measurement."""

from typing import Protocol

from msgspec import Struct

from tablegen.numerics.arrays import Floats, FloatsLike
from tablegen.waveform.series import FourierSeries


class WaveformShape(Protocol):
    """A periodic normalised waveform; see ``LineShape``."""

    @property
    def turn(self) -> float:
        """The time at which it turns, in periods."""

    def value(self, t: FloatsLike) -> Floats:
        """Return w(t).

        Parameters
        ----------
        t
            Times in periods, any shape.

        Returns
        -------
        Floats
            Dimensionless, shape of ``t``.
        """

    def slope(self, t: FloatsLike) -> Floats:
        """Return dw/dt.

        Parameters
        ----------
        t
            Times in periods, any shape.

        Returns
        -------
        Floats
            Per period, shape of ``t``.
        """


class RefinedShape(Struct, frozen=True):
    """The sum u(t) + r(t) of the model's shape and the layer, both dimensionless, t in periods."""

    model: WaveformShape
    layer: FourierSeries

    @property
    def turn(self) -> float:
        """The time at which it turns, in periods."""
        return self.model.turn

    def value(self, t: FloatsLike) -> Floats:
        """Return w(t).

        Parameters
        ----------
        t
            Times in periods, any shape.

        Returns
        -------
        Floats
            Dimensionless, shape of ``t``.
        """
        return self.model.value(t) + self.layer.value(t)

    def slope(self, t: FloatsLike) -> Floats:
        """Return dw/dt.

        Parameters
        ----------
        t
            Times in periods, any shape.

        Returns
        -------
        Floats
            Per period, shape of ``t``.
        """
        return self.model.slope(t) + self.layer.value(t, 1)
