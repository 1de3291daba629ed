"""The factor m of (1) where it depends on the scan size too: (1)-(4) as measured at several scan voltages."""

from collections.abc import Sequence
from itertools import pairwise

from msgspec import Struct

from tablegen.base.input_errors import Unphysical
from tablegen.compensation.offset import OffsetLaw
from tablegen.compensation.size import SizeLaw
from tablegen.numerics.driver import Driver

_ROUNDS = 40  # of a contraction that leaves a third of an error


class OffsetSurface(Struct, frozen=True):
    """The factor m(p, v) = 1 + alpha(v) p + beta(v) p^2 with v = V_scan / V_max in [0, 1].

    ``laws`` are (1) as measured at scan voltages, shares of v_max, ascending. Between two of them alpha and beta are
    linear in v; below the first and above the last they stay. With one law m does not depend on the size.
    """

    laws: tuple[tuple[float, OffsetLaw], ...]

    @classmethod
    def everywhere(cls, law: OffsetLaw) -> "OffsetSurface":
        """Return the surface of one law for all sizes."""
        return cls(((0.0, law),))

    @property
    def small(self) -> OffsetLaw:
        """The law of the smallest size, for small scans."""
        return self.laws[0][1]

    def at(self, v: float) -> OffsetLaw:
        """Return the law (1) at a normalised scan voltage."""
        if v <= self.laws[0][0]:
            return self.laws[0][1]
        for (low, left), (high, right) in pairwise(self.laws):
            if v <= high:
                share = (v - low) / (high - low)
                alpha = left.alpha + share * (right.alpha - left.alpha)
                return OffsetLaw(alpha, left.beta + share * (right.beta - left.beta))
        return self.laws[-1][1]


def law_of_sizes(p: list[float], apparent: list[float], size: SizeLaw, v: float) -> OffsetLaw:
    """Return (1) from apparent sizes (any unit) of one object in images of one scan voltage at three or more p.

    The apparent sizes are in proportion to R(V) / R(V / m), R of (6) and (10), since the scan was not changed.

    Parameters
    ----------
    v
        Scan voltage of the images, of v_max.

    Raises
    ------
    Unphysical
        If the sizes do not determine the law.
    """
    centre, scan_nm = 1.0, size.size_nm(v)
    law, middle = OffsetLaw.fitted(p, apparent)
    for _ in range(_ROUNDS):
        centre *= middle
        law, middle = OffsetLaw.fitted(p, [v / size.voltage(scan_nm * centre / size_seen) for size_seen in apparent])
    return law


def surface_of(points: Sequence[tuple[float, float, float]], size: SizeLaw, driver: Driver | float) -> OffsetSurface:
    """Return the surface of points (offset in V, apparent size in any unit, scan voltage of the image in V).

    The images of one scan voltage have to show one object.

    Raises
    ------
    Unphysical
        If the points of one scan voltage do not determine its law.
    """
    driver, laws = Driver.of(driver), []
    for volts in sorted({size_v for _, _, size_v in points}):
        p = [driver.p(at) for at, _, size_v in points if size_v == volts]
        apparent = [size_seen for _, size_seen, size_v in points if size_v == volts]
        try:
            laws.append((volts / driver.span, law_of_sizes(p, apparent, size, volts / driver.span)))
        except Unphysical as reason:
            raise Unphysical(f"at a size_v of {volts:g} V: {reason}") from None
    return OffsetSurface(tuple(laws))
