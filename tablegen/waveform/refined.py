"""What the drive is to follow: a shape of the model, or one with a layer over it that was learnt from a measurement."""

from typing import Protocol

from msgspec import Struct

from tablegen.numerics.arrays import Floats, FloatsLike
from tablegen.waveform.series import FourierSeries


class WaveformShape(Protocol):
    """A periodic normalised waveform; see ``LineShape``."""

    @property
    def turn(self) -> float:
        """Where it turns, in periods."""

    def value(self, t: FloatsLike) -> Floats:
        """w(t) with t in periods."""

    def slope(self, t: FloatsLike) -> Floats:
        """dw/dt per period."""


class RefinedShape(Struct, frozen=True):
    """u(t) + r(t): the model's shape, and the layer, both dimensionless, t in periods."""

    model: WaveformShape
    layer: FourierSeries

    @property
    def turn(self) -> float:
        """Where it turns, in periods."""
        return self.model.turn

    def value(self, t: FloatsLike) -> Floats:
        """w(t)."""
        return self.model.value(t) + self.layer.value(t)

    def slope(self, t: FloatsLike) -> Floats:
        """dw/dt per period."""
        return self.model.slope(t) + self.layer.value(t, 1)
