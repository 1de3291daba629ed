"""The range of the piezo driver, to which all voltages are normalised: equation (2)."""

from typing import TypeVar

from msgspec import Struct

from tablegen.numerics.arrays import Floats

V = TypeVar("V", float, Floats)  # a voltage or many


class Driver(Struct, frozen=True):
    """The output range v_min..v_max in V at the piezo, v_min <= 0 < v_max.

    The paper's V_max is ``span``, and its offset voltage counts from v_min: with v_min = 0 they are those of the paper.
    """

    v_max: float
    v_min: float = 0.0

    @classmethod
    def of(cls, driver: "Driver | float") -> "Driver":
        """Return a driver unchanged; a number is the maximum of one that begins at 0 V."""
        return driver if isinstance(driver, Driver) else cls(driver)

    @property
    def span(self) -> float:
        """The full scale in V, to which scan voltages are normalised."""
        return self.v_max - self.v_min

    @property
    def middle(self) -> float:
        """The offset in V at which m(p) of (1) is 1."""
        return self.v_min + 0.5 * self.span

    def share(self, volts: V) -> V:
        """Return voltages as shares of the range: 0 at v_min, 1 at v_max."""
        return (volts - self.v_min) / self.span

    def volts(self, share: V) -> V:
        """Return the voltages of shares of the range, the inverse of ``share``."""
        return self.v_min + share * self.span

    def p(self, v_offset: V) -> V:
        """Return p of (2): -1 at v_min, +1 at v_max."""
        return 2.0 * (v_offset - self.v_min) / self.span - 1.0

    def beyond(self, low: float, high: float) -> float:
        """Return by how many V low..high leaves the range; negative inside."""
        return max(self.v_min - low, high - self.v_max)

    @property
    def unit(self) -> str:
        """The name in messages of what shares of ``span`` refer to."""
        return "v_max" if self.v_min == 0.0 else "v_max - v_min"

    @property
    def full_scale(self) -> str:
        """The span in words, for a scan voltage that is above it."""
        return f"{self.unit} = {self.span:g} V"

    def __str__(self) -> str:
        return f"{self.v_min:g}..{self.v_max:g} V"
