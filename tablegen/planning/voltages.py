"""Voltages of one axis, factor by factor: V(t) = V_offset + m g V_scan (w(t) - 1/2), without the shape w."""

from msgspec import Struct

from tablegen.base.figures import at_most
from tablegen.base.input_errors import Problems, Unphysical
from tablegen.compensation import models
from tablegen.compensation.dynamics import Response
from tablegen.compensation.frequency import frequency_gain
from tablegen.compensation.model import Hysteresis
from tablegen.compensation.offset import OffsetLaw
from tablegen.compensation.offset_sizes import OffsetSurface
from tablegen.compensation.size import SizeLaw
from tablegen.config.load import Setup
from tablegen.config.scanner import Frequency, Offset, ScannerAxis
from tablegen.config.schema import FastAxis, SlowAxis
from tablegen.fixedpoint.converter import Converter
from tablegen.numerics.driver import Driver
from tablegen.planning.allowed_error import allowed_error
from tablegen.planning.laws import dynamics_of, offset_surface, outside_driver, size_law_of
from tablegen.waveform.error_allowance import AllowedError

# An axis at rest plays w = 1/2 throughout; gain and table refer to so small a share of v_max.
RESTING_SHARE = 2.0**-24


class Voltages(Struct, frozen=True, eq=False):
    """Size, offset and rate of one axis as voltages at the piezo, and the models that gave them.

    ``v`` is the normalised scan voltage of (9)/(12), in [0, 1], before ``m`` of (1) and ``g`` of (23). ``size_nm`` is
    the ideal triangle's full range, 0 of an axis at rest. ``rate_law`` is (23) of the scanner file. ``allowed`` is the
    scaling error that the waveform may have for less acceleration, None where none is.
    """

    driver: Driver
    v_offset: float
    position_nm: float
    size_nm: float
    v: float
    p_offset: float
    m: float
    g: float
    size_law: SizeLaw
    offset_law: OffsetLaw
    small_scans: OffsetLaw
    rate_law: Frequency | None
    response: Response | None
    max_boost_db: float
    hysteresis: Hysteresis
    allowed: AllowedError | None

    @property
    def v_amplitude(self) -> float:
        """The amplitude m g V_scan: volts peak to peak at the piezo for w from 0 to 1."""
        return self.m * self.g * self.v * self.driver.span


def axis_voltages(setup: Setup, axis: str, rate_hz: float, problems: Problems) -> Voltages:
    """Apply (1)-(12) and (23) to one axis ("x" or "y") at its rate in Hz.

    What contradicts the calibration goes to ``problems``, at its key. A linear size law stands for one that is refused,
    so that the rest is examined too.
    """
    scan: FastAxis = getattr(setup.scan, axis)
    scanner: ScannerAxis = getattr(setup.scanner, axis)
    driver, scanner_file = setup.scanner.driver, setup.scanner_file
    size_law = None
    with problems.at(scanner_file, f"{axis}.size.base_nm"):
        size_law = size_law_of(scanner.size, driver)
    surface = _offset_surface(setup, axis, size_law, problems)
    v_offset = _offset_voltage(setup, axis, surface, problems)
    resting = isinstance(scan, SlowAxis) and scan.off
    v, size_nm = (RESTING_SHARE, 0.0) if resting else _scan_voltage(setup, axis, size_law, problems)

    g, response, max_boost_db = 1.0, None, 0.0
    if scanner.frequency is not None and not resting:
        with problems.at(scanner_file, f"{axis}.frequency.alpha"):
            g = frequency_gain(rate_hz, scanner.frequency.alpha, scanner.frequency.reference_hz)
    if scanner.resonance is not None and not resting:
        max_boost_db = scanner.resonance.max_boost_db
        key = f"{axis}.resonance.response" if scanner.resonance.response is not None else f"{axis}.resonance"
        with problems.at(scanner_file, key):
            response = dynamics_of(scanner.resonance, setup.scanner_folder)
    if size_law is None:
        size_law = SizeLaw(scanner.size.k_nm_per_v * driver.span, 0.0, 1.0)

    p, offset_law = driver.p(v_offset), surface.at(v)
    m = offset_law.factor(p)
    hysteresis = scanner.hysteresis
    if hysteresis is None or resting:
        hysteresis = models.get(models.UNCOMPENSATED)()
    hardware = setup.hardware(axis)
    codes = abs(m * g * v * driver.span / Converter.of(hardware.dac, hardware.amplifier).v_per_code)
    return Voltages(
        driver=driver,
        v_offset=v_offset,
        position_nm=surface.small.position_nm(v_offset, driver, scanner.size.k_nm_per_v),
        size_nm=size_nm,
        v=v,
        p_offset=p,
        m=m,
        g=g,
        size_law=size_law,
        offset_law=offset_law,
        small_scans=surface.small,
        rate_law=scanner.frequency,
        response=response,
        max_boost_db=max_boost_db,
        hysteresis=hysteresis,
        allowed=None if resting else allowed_error(scan.band_limit, setup.scan.limits, codes, hysteresis.counts_turns),
    )


def _offset_surface(setup: Setup, axis: str, size_law: SizeLaw | None, problems: Problems) -> OffsetSurface:
    """Return m of (1) over offset and size; 1 everywhere where it is not calibrated."""
    offset: Offset | None = getattr(setup.scanner, axis).offset
    surface = OffsetSurface.everywhere(OffsetLaw())
    if offset is not None and size_law is not None:
        _check_points(setup, axis, offset, problems)
        key = f"{axis}.offset{'.points' if offset.points is not None else ''}"
        with problems.at(setup.scanner_file, key):
            surface = offset_surface(offset, setup.scanner.driver, size_law)
    return surface


def _check_points(setup: Setup, axis: str, offset: Offset, problems: Problems) -> None:
    """Check that every point was measured inside the driver's range."""
    driver = setup.scanner.driver
    for i, point in enumerate(offset.points or []):
        if driver.beyond(point.offset_v, point.offset_v) > 0.0:
            key = f"{axis}.offset.points[{i}].offset_v"
            problems.add(setup.scanner_file, key, outside_driver(point.offset_v, driver))
    sizes = [("points", i, point.size_v) for i, point in enumerate(offset.points or [])]
    sizes += [("sizes", i, entry.size_v) for i, entry in enumerate(offset.sizes or [])]
    for name, i, size_v in sizes:
        if size_v is not None and size_v > driver.span:
            why = f"{size_v:g} V is above {driver.full_scale}"
            problems.add(setup.scanner_file, f"{axis}.offset.{name}[{i}].size_v", why)


def _offset_voltage(setup: Setup, axis: str, surface: OffsetSurface, problems: Problems) -> float:
    """Return V_offset: as written, from a position in nm by the integral of the local slope, or the driver's middle."""
    scan: FastAxis = getattr(setup.scan, axis)
    driver = setup.scanner.driver
    v_offset = driver.middle
    if scan.offset_v is not None:
        v_offset = scan.offset_v
        with problems.at(setup.scan_file, f"{axis}.offset_v"):
            if driver.beyond(v_offset, v_offset) > 0.0:
                raise Unphysical(outside_driver(v_offset, driver))
    elif scan.offset_nm is not None:
        with problems.at(setup.scan_file, f"{axis}.offset_nm"):
            k_nm_per_v = getattr(setup.scanner, axis).size.k_nm_per_v
            v_offset = surface.small.voltage_at(scan.offset_nm, driver, k_nm_per_v)
    return v_offset


def _scan_voltage(setup: Setup, axis: str, size_law: SizeLaw | None, problems: Problems) -> tuple[float, float]:
    """Return the normalised scan voltage by (9)/(12), and the size in nm of the whole line."""
    scan: FastAxis = getattr(setup.scan, axis)
    driver = setup.scanner.driver
    low, high = scan.band_limit.window
    v, size_nm = 0.0, 0.0
    if size_law is not None and scan.size_nm is not None:
        with problems.at(setup.scan_file, f"{axis}.size_nm"):
            size_nm = scan.size_nm / (high - low) if scan.size_of == "window" else scan.size_nm
            try:
                v = size_law.voltage(size_nm)
            except Unphysical as reason:
                if scan.size_of == "line":
                    raise
                window_nm = at_most(size_law.size_nm(1.0) * (high - low), 6)
                raise Unphysical(f"its line of {reason}, a window of {window_nm} nm") from None
    elif size_law is not None and scan.size_v is not None:
        with problems.at(setup.scan_file, f"{axis}.size_v"):
            if scan.size_v > driver.span:
                raise Unphysical(f"{scan.size_v:g} V is above {driver.full_scale}")
            v = scan.size_v / driver.span
            size_nm = size_law.size_nm(v)
    return v, size_nm
