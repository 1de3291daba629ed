"""Options that several calibrations share."""

from collections.abc import Callable
from functools import wraps
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from tablegen.cli.shared.common import fail, finite
from tablegen.cli.shared.exit_status import ExitStatus

if TYPE_CHECKING:
    from tablegen.calibration.tables.recorder import Recorder

F = TypeVar("F", bound=Callable[..., Any])

RHO_HELP = "Decay constant rho of (22); used if all data have the same amplitude, otherwise fitted."

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

columns_option = click.option(
    "--columns",
    metavar="QUANTITY=COLUMN,...",
    help="The column of each quantity: its number, from 1, or its name in the header; a unit may follow, such as "
    "time=3,drive=2,position=1:um. Without a header, the values are in s, V and nm unless a unit is given.",
)
_drive_options = (
    click.option(
        "--drive-gain",
        type=float,
        callback=finite,
        metavar="V/V",
        help="Gain of the amplifier between the voltage that was recorded and the piezo. Scopes often record the "
        "controller's output, before the amplifier; all other voltages are at the piezo. 1 says that the columns are "
        "at the piezo.  [default: 1, and the data are checked]",
    ),
    click.option(
        "--drive-offset",
        type=float,
        callback=finite,
        metavar="V",
        help="Voltage at the piezo in volts where the recorded one is 0.  [default: 0]",
    ),
)


def recorder_options(command: F) -> F:
    """Add the options on the columns of a recorder and on where its voltages were measured, as ``recorder``."""

    @wraps(command)
    def run(columns: str | None, drive_gain: float | None, drive_offset: float | None, **rest: Any) -> Any:
        return command(recorder=recorder_of(columns, drive_gain, drive_offset), **rest)

    for option in reversed((columns_option, *_drive_options)):
        run = option(run)
    return run  # type: ignore[return-value]


def columns_only(command: F) -> F:
    """Add the option on the columns of a table without voltages, as ``recorder``."""

    @wraps(command)
    def run(columns: str | None, **rest: Any) -> Any:
        return command(recorder=recorder_of(columns), **rest)

    return columns_option(run)  # type: ignore[return-value]


def recorder_of(columns: str | None, drive_gain: float | None = None, drive_offset: float | None = None) -> "Recorder":
    """Return the recorder that the options describe; a gain or an offset of none ends the command."""
    from tablegen.calibration.tables.recorder import Recorder

    try:
        return Recorder(columns, drive_gain, drive_offset)
    except ValueError as error:
        fail([f"--drive-gain, --drive-offset: {error}"], ExitStatus.WRONG_INPUT)


def refuse_recorder(recorder: "Recorder") -> None:
    """Check that no option on the columns of a file is given where there is no file of columns.

    Raises
    ------
    click.UsageError
        If one is.
    """
    from tablegen.calibration.tables.recorder import AS_WRITTEN

    if recorder != AS_WRITTEN:
        raise click.UsageError("--columns, --drive-gain and --drive-offset are for files of columns, not for images")


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
