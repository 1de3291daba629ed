"""``tablegen calibrate images``: trace and retrace images to (17)-(22)."""

from functools import partial
from pathlib import Path

import click

from tablegen.cli.calibrate.options import (
    delay_pixels_option,
    mirrored_option,
    points_option,
    rho_option,
    turn_option,
    window_option,
)
from tablegen.cli.calibrate.run import Common, driver_of, finish, shared_options
from tablegen.cli.images.pairs import (
    CommandOfPairs,
    channel_option,
    frame_option,
    pair_option,
    read_both,
    retrace_channel_option,
)
from tablegen.cli.shared.common import fail
from tablegen.cli.shared.exit_status import ExitStatus


@click.command(cls=CommandOfPairs, short_help="Fit beta_max, rho, u_peak to trace and retrace images.")
@shared_options
@pair_option
@channel_option
@retrace_channel_option
@frame_option
@mirrored_option
@window_option
@turn_option
@delay_pixels_option
@rho_option
@points_option
def images(
    common: Common,
    pairs: tuple[tuple[float, Path, Path], ...],
    channel: str | None,
    retrace_channel: str | None,
    frame: int | None,
    retrace_mirrored: bool,
    window: tuple[float, float],
    turn: float,
    delay_pixels: float,
    rho: float,
    points: bool,
) -> int:
    """Fit beta_max and rho, (22), and u_peak, (17), to trace and retrace images. No sensor is needed.

    Scan a grating or a lattice with a triangle, three periods of it or more in a line. Take a pair of images at each of
    several amplitudes.

    \b
    Files:   .asd, .ibw, .spm and .000 to .999, .jpk, .jpk-qi-image, .sxm, .gwy,
             .npy, .tif, .png, or a matrix of numbers: .txt, .asc, .csv, .dat.
    Columns: pixels at equal time steps within --window of each sweep.
    Rows:    scan lines in order of time. Both images have the left end of the line at the
             left; otherwise give --retrace-mirrored.
    Angle:   files of instruments state the scan angle. The fast axis is x at 0 degrees and y
             at 90; --axis has to be that one.

    \b
    Example:
      tablegen calibrate images --axis x --v-max 100 --pair 50 t1.npy r1.npy --pair 100 t2.npy r2.npy
      tablegen calibrate images --axis x --v-max 100 --pair 50 1.ibw --pair 100 2.ibw --channel Height
    """
    from tablegen.base.input_errors import Rejected
    from tablegen.calibration.laws.images import Pair, fit_images
    from tablegen.images.scan_angle import require_fast_axis

    read = [read_both(trace, retrace, channel, retrace_channel, frame) for _, trace, retrace in pairs]
    files = [image for both in read for image in both]
    try:
        require_fast_axis(files, common.axis)
    except Rejected as rejected:
        fail(rejected.problems, ExitStatus.WRONG_INPUT)
    driver = driver_of(common)
    taken = [
        Pair(
            " and ".join(dict.fromkeys((trace.source.name, retrace.source.name))), volts, trace.heights, retrace.heights
        )
        for (volts, *_), (trace, retrace) in zip(pairs, read, strict=True)
    ]
    fit = partial(fit_images, taken, driver, rho, turn, window, retrace_mirrored, delay_pixels)
    return finish(common, files, fit, points)
