"""Options that several calibrations share."""

from math import isfinite
from pathlib import Path

import click

RHO_HELP = "Exponent rho of (22); used if all data have the same amplitude, otherwise fitted."

points_option = click.option(
    "--points",
    is_flag=True,
    help="With --write, write the hysteresis of each measured amplitude instead of the fitted law (22).",
)
rho_option = click.option(
    "--rho", type=click.FloatRange(1e-6, 100.0), default=1.5, show_default=True, metavar="RHO", help=RHO_HELP
)
data_argument = click.argument("data", type=click.Path(path_type=Path), metavar="DATA.CSV")
optional_data = click.argument("data", type=click.Path(path_type=Path), metavar="[DATA.CSV]", required=False)
from_hz_option = click.option(
    "--from-hz", type=float, default=0.0, metavar="HZ", help="Ignore rows below this frequency in Hz."
)
to_hz_option = click.option(
    "--to-hz", type=float, default=float("inf"), metavar="HZ", help="Ignore rows above this frequency in Hz."
)
mirrored_option = click.option(
    "--retrace-mirrored",
    is_flag=True,
    help="The retrace image is stored in order of time: its left pixel is the right end of the line.",
)
window_option = click.option(
    "--window",
    type=(float, float),
    default=(0.0, 1.0),
    show_default=True,
    metavar="LOW HIGH",
    help="Imaged part of each sweep, as two fractions of its duration; 0 1 is the whole sweep.",
)
turn_option = click.option(
    "--turn",
    type=float,
    default=0.5,
    show_default=True,
    metavar="FRACTION",
    help="Turn of the triangle: forward fraction of the period.",
)
delay_pixels_option = click.option(
    "--delay-pixels",
    type=float,
    default=0.0,
    show_default=True,
    metavar="N",
    help="Delay of the images relative to the drive in pixels.",
)

delay_option = click.option(
    "--delay-s",
    default="0",
    show_default=True,
    metavar="S|fit",
    help="Delay of the sensor relative to the drive in seconds, or `fit` to fit it.",
)


def delay_of(text: str) -> float | None:
    """Return the delay in s that the option states; None where it is to be fitted.

    Raises
    ------
    click.UsageError
        If it is no number.
    """
    try:
        delay = None if text == "fit" else float(text)
        if delay is not None and not isfinite(delay):
            raise ValueError
    except ValueError:
        raise click.UsageError(f"--delay-s {text}: seconds, or fit") from None
    return delay
