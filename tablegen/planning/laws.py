"""Laws of the scanner file, from its tables: size (6)-(12), offset (1)-(4), dynamics."""

from pathlib import Path

from tablegen.compensation.dynamics import Response, SecondOrder
from tablegen.compensation.offset import OffsetLaw
from tablegen.compensation.offset_sizes import OffsetSurface, surface_of
from tablegen.compensation.size import SizeLaw
from tablegen.config.scanner import Offset, Resonance, Size
from tablegen.numerics.driver import Driver


def size_law_of(size: Size, driver: Driver) -> SizeLaw:
    """Return the size law of a scanner file, (6)-(12).

    Raises
    ------
    Unphysical
        If the calibrated size is beyond the driver's range.
    """
    return SizeLaw.calibrated(size.k_nm_per_v, driver.span, size.beta, size.base_nm, size.v_threshold)


def offset_surface(offset: Offset, driver: Driver, size: SizeLaw) -> OffsetSurface:
    """Return m of (1) of a scanner file over offset and size.

    Parameters
    ----------
    size
        The size law, needed for points with ``size_v``.

    Raises
    ------
    Unphysical
        If the points do not determine m, or it is not above 0.
    """
    if offset.sizes is not None:
        entries = sorted(offset.sizes, key=lambda entry: entry.size_v)
        laws = [(entry.size_v / driver.span, OffsetLaw.from_ends(entry.m_minus, entry.m_plus)) for entry in entries]
        return OffsetSurface(tuple(laws))
    if offset.points is not None:
        points = [(point.offset_v, point.apparent_nm, point.size_v or 0.0) for point in offset.points]
        if offset.points[0].size_v is not None:
            return surface_of(points, size, driver)
        p = [driver.p(volts) for volts, _, _ in points]
        return OffsetSurface.everywhere(OffsetLaw.fit(p, [apparent for _, apparent, _ in points]))
    if offset.m_minus is not None and offset.m_plus is not None:
        return OffsetSurface.everywhere(OffsetLaw.from_ends(offset.m_minus, offset.m_plus))
    return OffsetSurface.everywhere(OffsetLaw(offset.alpha or 0.0, offset.beta or 0.0))


def dynamics_of(resonance: Resonance, folder: Path) -> Response:
    """Return the dynamics of a scanner file in ``folder``.

    Raises
    ------
    Unphysical
        If the response file cannot be read.
    """
    if resonance.response is None:
        assert resonance.frequency_hz is not None
        assert resonance.quality is not None
        return SecondOrder(resonance.frequency_hz, resonance.quality, resonance.delay_s)
    from tablegen.compensation.response_file import read_response  # here: few scanners have one

    return read_response(folder / resonance.response)


def outside_driver(volts: float, driver: Driver) -> str:
    """Return a message that a voltage is outside the driver's range, and by how much."""
    return f"{volts:.6g} V is outside the driver's {driver}, by {driver.beyond(volts, volts):.4g} V"
