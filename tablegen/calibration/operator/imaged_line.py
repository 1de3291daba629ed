"""Fit one settled line, as from a sensor, to trace and retrace images of a sample of known constant."""

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.calibration.laws.image_sizes import Acquisition, KnownSample, SampleImage
from tablegen.calibration.operator.periodic_line import PHASES, PeriodicLine
from tablegen.fitting.estimate import LineSize
from tablegen.images.fast_axis_line import fit_line
from tablegen.images.line_length import size_of_line
from tablegen.numerics.driver import Driver

_SPANNED = (0.05, 0.95)  # of each sweep: the rest is extrapolated, with errors up to 0.4 % of the line in the tests


def imaged_line(
    image: SampleImage, rate_hz: float, driver: Driver | float, sample: KnownSample, acquisition: Acquisition
) -> tuple[PeriodicLine, LineSize]:
    """Fit the line of a triangle of ``v_scan`` about ``v_offset``, at ``rate_hz``, and its size.

    ``noise_nm`` of the line is the rms standard error of the position without that of the size, which the size has. The
    columns have to show both sweeps almost from turn to turn.

    Raises
    ------
    Unphysical
        If the image shows no such line; the message leaves the image's name to the caller.
    """
    if image.retrace is None:
        raise Unphysical("the retrace is missing: an operator needs both directions")
    if image.v_offset is None:
        raise Unphysical("the offset is missing: an operator is of the offset too")
    driver = Driver.of(driver)
    low, high = image.v_offset - 0.5 * image.v_scan, image.v_offset + 0.5 * image.v_scan
    if driver.beyond(low, high) > 0.02 * driver.span:
        raise Unphysical(f"a drive of {low:.4g}..{high:.4g} V is outside the driver's {driver}")
    line = fit_line(
        image.trace,
        image.retrace,
        acquisition.turn,
        acquisition.window,
        acquisition.retrace_mirrored,
        acquisition.delay_pixels,
    )
    if not _SPANNED[0] >= acquisition.window[0] or not acquisition.window[1] >= _SPANNED[1]:
        raise Unphysical(
            f"the turns are too far outside the images; they have to span {_SPANNED[0]:g} to {_SPANNED[1]:g} of each "
            f"sweep, or more: save lines without overscan"
        )
    size = size_of_line(line, sample.cell, sample.grating, acquisition.aspect or image.aspect)
    time = np.arange(PHASES) / PHASES
    rising = time < acquisition.turn
    drive = np.where(rising, time / acquisition.turn, (1.0 - time) / (1.0 - acquisition.turn))
    position = np.where(rising, line.position(drive, True), line.position(drive, False))
    error = np.where(rising, line.position_error(drive, True), line.position_error(drive, False))
    nm = size.nm.value
    bent = line.model.s(line.state.parameters)[0, 1:] @ line.model.y_powers[2:] / line.waves[0, 0]
    return PeriodicLine(
        image.name,
        rate_hz,
        line.geometry.rows,
        driver.share(low + image.v_scan * drive),
        nm * position,
        nm * float(np.sqrt(np.mean(error**2))),
        nm * float(np.ptp(bent)),
    ), size
