"""What is applied to one axis, factor by factor: V(t) = V_offset + m g V_scan (w(t) - 1/2)."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

from msgspec import Struct
from msgspec.structs import replace

from tablegen.compensation import models
from tablegen.compensation.dynamics import Response, SecondOrder
from tablegen.compensation.frequency import frequency_gain
from tablegen.compensation.line import AppliedBranch, LineShape, WantedLine
from tablegen.compensation.model import Hysteresis
from tablegen.compensation.offset import OffsetLaw
from tablegen.compensation.offset_sizes import OffsetSurface, surface_of
from tablegen.compensation.size import SizeLaw
from tablegen.config.load import Setup
from tablegen.config.scanner import Offset, Resonance, ScannerAxis, Size
from tablegen.config.schema import FastAxis, SlowAxis
from tablegen.driver import Driver
from tablegen.figures import at_most
from tablegen.fixedpoint.converter import Converter
from tablegen.planning.allowed_error import allowed_error
from tablegen.problems import Problems, Unphysical
from tablegen.waveform.allowed_error import AllowedError

# An axis at rest plays w = 1/2 throughout; gain and table refer to so small a share of v_max.
RESTING_SHARE = 2.0**-24


class Drive(Struct, frozen=True, eq=False):
    """The voltages at the piezo, and every factor that went into them.

    ``v_scan`` is from (9)/(12), before ``m`` of (1) and ``g`` of (23). The amplitude played is m g v_scan, peak to
    peak, for w from 0 to 1. ``position_nm`` is that of the offset, above the one at 0 V. ``line_at`` is the line that
    the model makes at another normalised scan voltage, None where it makes none; ``model_files`` has the files that the
    model names, and their SHA-256. ``harmonics`` is the highest that is played, ``allowed`` the scaling error that may
    be left for less acceleration.
    """

    driver: Driver
    v_offset: float
    position_nm: float
    size_nm: float
    window_nm: float
    v_scan: float
    v_scan_normalised: float
    p_offset: float
    m: float
    g: float
    hysteresis: Hysteresis
    turn: float
    offset_law: OffsetLaw
    size_law: SizeLaw
    shape: LineShape
    response: Response | None
    max_boost_db: float
    line_at: Callable[[float], LineShape | None]
    harmonics: int
    allowed: AllowedError | None
    model_files: tuple[tuple[str, str], ...] = ()

    @property
    def resting(self) -> bool:
        """Whether the axis stays at its offset: w is 1/2 throughout, and the line has no size."""
        return self.size_nm == 0.0

    @property
    def model(self) -> str:
        """The name of the hysteresis model."""
        return self.hysteresis.model()

    @property
    def forward(self) -> AppliedBranch:
        """The residual that is applied on the way there."""
        return self.shape.peaks[0]

    @property
    def backward(self) -> AppliedBranch:
        """And on the way back."""
        return self.shape.peaks[1]

    @property
    def v_amplitude(self) -> float:
        """m g V_scan: volts peak to peak at the piezo for w from 0 to 1."""
        return self.m * self.g * self.v_scan

    def v_amplitude_at(self, v_offset: float) -> float:
        """What ``v_amplitude`` would be at another offset voltage."""
        return self.offset_law.factor(self.driver.p(v_offset)) * self.g * self.v_scan


def compensate(
    setup: Setup, axis: str, rate_hz: float, harmonics: Callable[[AllowedError | None], int], problems: Problems
) -> Drive | None:
    """Apply the scanner's calibration to one axis ("x" or "y") at its rate; None where ``problems`` grew.

    ``harmonics`` gives the highest that is played, where so much of a scaling error is allowed.
    """
    scan: FastAxis = getattr(setup.scan, axis)
    scanner: ScannerAxis = getattr(setup.scanner, axis)
    driver = setup.scanner.driver
    scan_file, scanner_file = setup.scan_file, setup.scanner_file
    before = len(problems.found)

    size_law = None
    with problems.at(scanner_file, f"{axis}.size.base_nm"):
        size_law = size_law_of(scanner.size, driver)
    surface = OffsetSurface.everywhere(OffsetLaw())
    if scanner.offset is not None and size_law is not None:
        _check_points(setup, axis, problems)
        with problems.at(scanner_file, f"{axis}.offset{'.points' if scanner.offset.points is not None else ''}"):
            surface = offset_surface(scanner.offset, driver, size_law)

    v_offset = _offset_v(setup, axis, surface, problems)
    low, high = scan.band_limit.window
    resting = isinstance(scan, SlowAxis) and scan.off
    v, size_nm = (RESTING_SHARE, 0.0) if resting else _size(setup, axis, size_law, problems)

    g = 1.0
    if scanner.frequency is not None and not resting:
        with problems.at(scanner_file, f"{axis}.frequency.alpha"):
            g = frequency_gain(rate_hz, scanner.frequency.alpha, scanner.frequency.reference_hz)

    p = driver.p(v_offset)
    offset_law = surface.at(v)
    m = offset_law.factor(p)
    response, max_boost_db, law = None, 0.0, scanner.frequency
    if scanner.resonance is not None and not resting:
        max_boost_db = scanner.resonance.max_boost_db
        key = f"{axis}.resonance.response" if scanner.resonance.response is not None else f"{axis}.resonance"
        with problems.at(scanner_file, key):
            response = dynamics_of(scanner.resonance, setup.scanner_folder)
    uncompensated = scanner.hysteresis is None or resting
    hysteresis = models.get(models.UNCOMPENSATED)() if uncompensated else scanner.hysteresis
    assert hysteresis is not None
    v_amplitude = m * g * v * driver.span
    hardware = setup.hardware(axis)
    codes = abs(v_amplitude / Converter.of(hardware.dac, hardware.amplifier).v_per_code)
    allowed = None if resting else allowed_error(scan.band_limit, setup.scan.limits, codes, hysteresis.counts_turns)
    most = harmonics(allowed)
    wanted = WantedLine(
        axis=axis,
        turn=scan.turn,
        v=v,
        driver=driver,
        v_amplitude=v_amplitude,
        v_offset=v_offset,
        size_nm=size_nm,
        rate_hz=rate_hz,
        harmonics=most,
        window=(low, high),
        both=scan.band_limit.directions == "both",
        response=response,
        max_boost_db=max_boost_db,
        factor_at=partial(_factor_at, surface.small, driver),
        rate_gain=None if law is None else partial(frequency_gain, alpha=law.alpha, reference_hz=law.reference_hz),
        folder=setup.scanner_folder,
        scan_file=scan_file,
        scanner_file=scanner_file,
        problems=problems,
        allowed=allowed,
    )

    shape = models.line_of(hysteresis, wanted)
    if len(problems.found) > before or shape is None or size_law is None:
        return None
    return Drive(
        driver=driver,
        v_offset=v_offset,
        position_nm=surface.small.position_nm(v_offset, driver, scanner.size.k_nm_per_v),
        size_nm=size_nm,
        window_nm=size_nm * (high - low),
        v_scan=v * driver.span,
        v_scan_normalised=v,
        p_offset=p,
        m=m,
        g=g,
        hysteresis=hysteresis,
        turn=scan.turn,
        offset_law=offset_law,
        size_law=size_law,
        shape=shape,
        response=response,
        max_boost_db=max_boost_db,
        line_at=partial(_line_at, hysteresis, wanted),
        harmonics=most,
        allowed=allowed,
        model_files=tuple(
            (Path(name).name, digest)
            for name, digest in zip(hysteresis.files(), hysteresis.contents(setup.scanner_folder), strict=True)
        ),
    )


def _offset_v(setup: Setup, axis: str, surface: OffsetSurface, problems: Problems) -> float:
    """Return the offset voltage that the scan asks for, in V; the middle of the driver where it asks for none."""
    scan: FastAxis = getattr(setup.scan, axis)
    scanner: ScannerAxis = getattr(setup.scanner, axis)
    driver = setup.scanner.driver
    v_offset = driver.middle
    if scan.offset_v is not None:
        v_offset = scan.offset_v
        with problems.at(setup.scan_file, f"{axis}.offset_v"):
            if driver.beyond(v_offset, v_offset) > 0.0:
                raise Unphysical(outside_driver(v_offset, driver))
    elif scan.offset_nm is not None:
        with problems.at(setup.scan_file, f"{axis}.offset_nm"):
            v_offset = surface.small.voltage_at(scan.offset_nm, driver, scanner.size.k_nm_per_v)
    return v_offset


def _size(setup: Setup, axis: str, size_law: SizeLaw | None, problems: Problems) -> tuple[float, float]:
    """Return the share of v_max that the size of a line needs, (9)-(12), and that size in nm; 0 where it has none."""
    scan: FastAxis = getattr(setup.scan, axis)
    driver = setup.scanner.driver
    low, high = scan.band_limit.window
    v = size_nm = 0.0
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


def outside_driver(volts: float, driver: Driver) -> str:
    """Say that a voltage is outside the driver's range, and by how much."""
    return f"{volts:.6g} V is outside the driver's {driver}, by {driver.beyond(volts, volts):.4g} V"


# Functions of a module, not of a call: a plan that travels to another process takes them along.
def _factor_at(law: OffsetLaw, driver: Driver, share: float) -> float:
    return law.factor(driver.p(driver.volts(share)))


def _line_at(hysteresis: Hysteresis, wanted: WantedLine, v: float) -> LineShape | None:
    apart = Problems()
    made = models.line_of(hysteresis, replace(wanted, v=v, problems=apart))
    return None if apart.found else made


def _check_points(setup: Setup, axis: str, problems: Problems) -> None:
    """No point can have been measured where the driver does not reach."""
    driver = setup.scanner.driver
    offset: Offset = getattr(setup.scanner, axis).offset
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


def size_law_of(size: Size, driver: Driver) -> SizeLaw:
    """The law of a scanner file. Raises ``Unphysical``."""
    return SizeLaw.calibrated(size.k_nm_per_v, driver.span, size.beta, size.base_nm, size.v_threshold)


def offset_surface(offset: Offset, driver: Driver, size: SizeLaw) -> OffsetSurface:
    """m of a scanner file over offset and size; ``size`` serves points with ``size_v`` alone. Raises ``Unphysical``."""
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
    """The dynamics of a scanner file in ``folder``. Raises ``Unphysical``."""
    if resonance.response is None:
        assert resonance.frequency_hz is not None
        assert resonance.quality is not None
        return SecondOrder(resonance.frequency_hz, resonance.quality, resonance.delay_s)
    from tablegen.compensation.response_file import read_response  # here: few scanners have one

    return read_response(folder / resonance.response)
