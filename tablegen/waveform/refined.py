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
        """Return w(t) with t in periods, of the shape of ``t``."""

    def slope(self, t: FloatsLike) -> Floats:
        """Return dw/dt per period, of the shape of ``t``."""


class RefinedShape(Struct, frozen=True):
    """The sum u(t) + r(t) of the model's shape and the layer, both dimensionless, t in periods."""

    model: WaveformShape
    layer: FourierSeries

    @property
    def turn(self) -> float:
        """The time at which it turns, in periods."""
        return self.model.turn

    def value(self, t: FloatsLike) -> Floats:
        """Return w(t) with t in periods, of the shape of ``t``."""
        return self.model.value(t) + self.layer.value(t)

    def slope(self, t: FloatsLike) -> Floats:
        """Return dw/dt per period, of the shape of ``t``."""
        return self.model.slope(t) + self.layer.value(t, 1)
