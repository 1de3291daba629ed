"""``tablegen calibrate``: fit parameters of the scanner file to measurements, with standard errors."""

import click

from tablegen.cli.calibrate.coupling import coupling
from tablegen.cli.calibrate.frequency import frequency
from tablegen.cli.calibrate.hysteresis import hysteresis
from tablegen.cli.calibrate.images import images
from tablegen.cli.calibrate.offset import offset
from tablegen.cli.calibrate.operator import operator
from tablegen.cli.calibrate.resonance import resonance
from tablegen.cli.calibrate.size import size


@click.group(
    short_help="Fit scanner parameters to measurements.",
    epilog="""\b
Examples:
  tablegen calibrate offset --axis x offsets.csv --scanner scanner.toml
  tablegen calibrate offset --axis x offsets.csv --scanner scanner.toml --write
  tablegen calibrate hysteresis --axis x 30v.csv 60v.csv 100v.csv --v-max 100 --plot x.png
  tablegen calibrate images --axis x --v-max 100 --pair 100 trace.npy retrace.npy

\b
Exit status: 0 done, 2 wrong input, 4 cannot write, 6 a library is missing.""",
)
def calibrate() -> None:
    """Fit the parameters of a scanner to measurements, in CSV files or images.

    The header of a CSV file names the columns; each name contains the unit. The commands also read .npz files of numpy,
    with one array for each column. Each command prints the parameters with standard errors, and the scan error that
    remains. Outliers are reported, and never removed.

    With --write, the command updates the scanner file, and adds a comment that names the data files and their SHA-256.
    Without --write, it changes no file. An insignificant fit, such as a parameter below two standard errors, is not
    written; --force writes it. Numbers in parentheses, such as (22), are equations of the paper.
    """


for command in (offset, size, hysteresis, operator, images, frequency, resonance, coupling):
    calibrate.add_command(command)
