"""``tablegen calibrate images``: fit (17)-(22) to trace and retrace images."""

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
from tablegen.cli.calibrate.run import Common, ended_by_input, output_fit, scanner_options, shared_options
from tablegen.cli.images.pairs import (
    CommandOfPairs,
    channel_option,
    frame_option,
    pair_option,
    require_readers,
    retrace_channel_option,
)
from tablegen.cli.shared.progress import Progress


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

    Scan a grating or a lattice with a triangle, with three periods or more in a line. Take a pair of images at each of
    several amplitudes.

    \b
    Files:   .asd, .ibw, .spm and .000 to .999, .jpk, .jpk-qi-image, .sxm, .gwy,
             .h5-jpk, .stp, .top, .nid, .mdt, .nc,
             .npy, .tif, .png, or a matrix of numbers: .txt, .asc, .csv, .dat.
    Columns: pixels at equal time steps within --window of each sweep.
    Rows:    scan lines in order of time. Both images have the left end of the line at the
             left; otherwise give --retrace-mirrored.
    Angle:   files of instruments state the scan angle. The fast axis is x at 0 degrees and y
             at 90; --axis must be the fast axis.

    \b
    Examples:
      tablegen calibrate images --axis x --v-max 100 --pair 50 t1.npy r1.npy --pair 100 t2.npy r2.npy
      tablegen calibrate images --axis x --v-max 100 --pair 50 1.ibw --pair 100 2.ibw --channel Height
    """
    from tablegen.api.calibrate import calibrate_images

    require_readers({path for _, *files in pairs for path in files})
    with ended_by_input(), Progress() as progress:
        progress.now("fitting")
        fit = calibrate_images(
            [(volts, trace, retrace) for volts, trace, retrace in pairs],
            axis=common.axis,
            points=points,
            channel=channel,
            retrace_channel=retrace_channel,
            frame=frame,
            retrace_mirrored=retrace_mirrored,
            window=window,
            turn=turn,
            delay_pixels=delay_pixels,
            rho=rho,
            **scanner_options(common),
        )
    return output_fit(common, fit)
