"""The closed loop: a scan on the virtual scanner, before and after a calibration on the scanner's own data."""

from collections.abc import Sequence

import msgspec
import numpy as np
from msgspec.structs import replace

from tablegen.config.load import Setup
from tablegen.config.scanner import ScannerAxis
from tablegen.config.schema import BandLimit
from tablegen.numerics.arrays import Floats
from tablegen.planning.line_plan import make_plan
from tablegen.virtual.calibration_day import OFFSETS
from tablegen.virtual.scanner import VirtualScanner
from tablegen.virtual.simulation import AxisRun, run_line

# As the paper measured its waveforms: turns as sharp as the drive, nothing near the resonance.
SHARP = BandLimit(method="lanczos", harmonics=256)
SHARP_RATE_HZ = 20.0
# Nominal, of k v_max: the largest, with m and all, just fits between an outermost offset and the end of the range.
MAP_SIZES = (0.02, 0.04, 0.06, 0.08, 0.1)


def with_scan(
    setup: Setup,
    size_v: float | None = None,
    size_nm: float | None = None,
    offset_v: float | None = None,
    rate_hz: float | None = None,
    band_limit: BandLimit | None = None,
) -> Setup:
    """Return the same scan with another fast axis and without a refinement; None keeps what the scan file has.

    Parameters
    ----------
    size_v, size_nm
        Size of the line in V or in nm; one of the two.
    offset_v
        Offset in V.
    rate_hz
        Line rate in Hz.
    """
    scan = setup.scan
    x = msgspec.structs.replace(
        scan.x,
        size_v=size_v,
        size_nm=size_nm,
        size_of="line",
        offset_v=scan.x.offset_v if offset_v is None else offset_v,
        offset_nm=scan.x.offset_nm if offset_v is None else None,
        band_limit=scan.x.band_limit if band_limit is None else band_limit,
        refinement=None,
    )
    rate = scan.timing.line_rate_hz if rate_hz is None else rate_hz
    timing = msgspec.structs.replace(scan.timing, line_rate_hz=rate)
    return replace(setup, scan=msgspec.structs.replace(scan, x=x, timing=timing))


def uncorrected(setup: Setup) -> Setup:
    """Return the scan on a scanner file that knows k of x alone, as controllers without correction do."""
    x: ScannerAxis = setup.scanner.x
    size = msgspec.structs.replace(x.size, beta=0.0)
    return replace(
        setup,
        scanner=msgspec.structs.replace(setup.scanner, x=ScannerAxis(size=size, dac=x.dac, amplifier=x.amplifier)),
    )


def play_x(setup: Setup, scanner: VirtualScanner) -> AxisRun:
    """Simulate the fast axis of a scan.

    Raises
    ------
    Rejected
        If the scan cannot be built.
    """
    return run_line(make_plan(setup).x, scanner.x)


def size_map(
    setup: Setup,
    scanner: VirtualScanner,
    offsets: Sequence[float] = OFFSETS,
    sizes: Sequence[float] = MAP_SIZES,
) -> Floats:
    """Return the size error of the image at each offset and size.

    Parameters
    ----------
    offsets, sizes
        Offset and nominal size (k times the scan voltage), as shares of the driver's range.

    Returns
    -------
    Errors in percent, shape (offsets, sizes).

    Raises
    ------
    Rejected
        If one of the scans cannot be built.
    """
    driver, k = setup.scanner.driver, setup.scanner.x.size.k_nm_per_v
    return np.array(
        [
            [
                play_x(
                    with_scan(setup, size_nm=share * k * driver.span, offset_v=driver.volts(at)), scanner
                ).size_error_percent
                for share in sizes
            ]
            for at in offsets
        ]
    )
