"""The option for the delay of a sensor against the drive."""

from math import isfinite

import click

delay_option = click.option(
    "--delay-s",
    default="0",
    show_default=True,
    metavar="S|fit",
    help="Delay of the sensor relative to the drive in seconds, or `fit` to fit it.",
)


def delay_of(text: str) -> float | None:
    """In s, as the option has it; None where it is to be fitted."""
    try:
        delay = None if text == "fit" else float(text)
        if delay is not None and not isfinite(delay):
            raise ValueError
    except ValueError:
        raise click.UsageError(f"--delay-s {text}: seconds, or fit") from None
    return delay
