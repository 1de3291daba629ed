"""``tablegen calibrate``: measurements to parameters of the scanner file, with standard errors."""

from functools import partial
from math import isfinite
from pathlib import Path
from typing import Literal

import click

from tablegen.cli.calibrate_operator import operator
from tablegen.cli.calibration_run import (
    Common,
    finish,
    full_scale,
    in_file,
    read_columns,
    shared_options,
    size_law,
    within,
)
from tablegen.cli.common import fail
from tablegen.cli.exit_status import ExitStatus
from tablegen.cli.image_pairs import (
    CommandOfPairs,
    channel_option,
    frame_option,
    pair_option,
    read_both,
    retrace_channel_option,
)

_RHO_HELP = "Exponent rho of (22); used if all data have the same amplitude, otherwise fitted."
_REFERENCE_HELP = (
    "Frequency in Hz at which the size was calibrated.  [default: reference_hz of the scanner file, or the lowest "
    "frequency in DATA.CSV]"
)
_points = click.option(
    "--points",
    is_flag=True,
    help="With --write, write the hysteresis of each measured amplitude instead of the fitted law (22).",
)
_data = click.argument("data", type=click.Path(path_type=Path), metavar="DATA.CSV")
_from_hz = click.option(
    "--from-hz", type=float, default=0.0, metavar="HZ", help="Ignore rows below this frequency in Hz."
)
_to_hz = click.option(
    "--to-hz", type=float, default=float("inf"), metavar="HZ", help="Ignore rows above this frequency in Hz."
)


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

    The header of a CSV file names the columns; each name contains the unit. Each command prints the parameters with
    standard errors, and the scan error that remains. Outliers are reported, and never removed.

    With --write, the command updates the scanner file, and adds a comment that names the data files and their SHA-256.
    Without --write, it changes no file. A fit that says nothing, such as a parameter below two standard errors, is not
    written; --force writes it. Numbers in parentheses, such as (22), are equations of the paper.
    """


@calibrate.command(short_help="Fit m_minus, m_plus to apparent sizes at several offsets.")
@shared_options
@_data
@click.option(
    "--size-v",
    type=click.FloatRange(min=0.0, min_open=True),
    metavar="V",
    help="Scan voltage of the images in volts, peak to peak. The fit then uses the size calibration of the scanner "
    "file.",
)
def offset(common: Common, data: Path, size_v: float | None) -> int:
    """Fit m_minus and m_plus, equations (1)-(4), to apparent sizes at three or more offset voltages.

    \b
    Columns: offset_v, apparent_nm: the size in the image of one object, or of a lattice constant;
    and      size_v, optional: the scan voltage of the image, in place of --size-v.

    The scan size grows faster than the drive, (6). For exact values, calibrate the size first and give --size-v.

    With images of several scan voltages, each at three or more offsets, m is fitted for each of them. Builds then use
    m of their scan size.

    \b
    Example:
      tablegen calibrate offset --axis x offsets.csv --scanner scanner.toml --size-v 20 --write
    """
    from tablegen.calibration.columns import APPARENT, OFFSET, SIZE
    from tablegen.calibration.offset import fit_offset
    from tablegen.calibration.offset_sizes import fit_offset_sizes

    table = read_columns(data, [OFFSET, APPARENT], [SIZE])
    v_max = full_scale(common)
    if SIZE in table:
        if size_v is not None:
            raise click.UsageError(f"--size-v is for files without the column size_v; {table.file} has it")
        law = size_law(common, v_max, f"the column size_v of {table.file}")
        return finish(
            common, [table], lambda: fit_offset_sizes(table[OFFSET], table[APPARENT], table[SIZE], v_max, law)
        )
    of_file = None
    if size_v is not None:
        of_file = size_law(common, v_max, "--size-v")
        if not size_v <= v_max:
            fail([f"--size-v {size_v:g} is above v_max = {v_max:g} V"], ExitStatus.WRONG_INPUT)
    return finish(common, [table], lambda: fit_offset(table[OFFSET], table[APPARENT], v_max, of_file, size_v))


@calibrate.command(short_help="Fit k_nm_per_v, beta, v_threshold to actual scan sizes.")
@shared_options
@_data
@click.option(
    "--k",
    type=click.FloatRange(min=1e-6),
    metavar="NM/V",
    help="Linear constant of the controller that converted nominal_nm to volts, in nm/V.",
)
@click.option(
    "--base-nm",
    type=click.FloatRange(min=1e-6),
    metavar="NM",
    help="Base size in nm, at which k_nm_per_v applies.  [default: base_nm of the scanner file, or 200]",
)
@click.option(
    "--threshold",
    type=float,
    metavar="V/V_MAX",
    help="Fix v_threshold at this fraction of v_max.  [default: fitted; 0.5 if the data do not determine it]",
)
@click.option(
    "--noise",
    type=click.Choice(("relative", "absolute")),
    default="relative",
    show_default=True,
    help="Error model of the sizes: relative to the size (images), or the same for all sizes (sensor).",
)
def size(
    common: Common,
    data: Path,
    k: float | None,
    base_nm: float | None,
    threshold: float | None,
    noise: Literal["relative", "absolute"],
) -> int:
    """Fit k_nm_per_v, beta and v_threshold, equations (6)-(12), to actual scan sizes at several drives.

    \b
    Columns: drive_v (scan voltage at the piezo, peak to peak),
             or nominal_nm (size set at the controller) with the option --k;
    and      actual_nm (size measured by a sensor),
             or apparent_nm and true_nm (a lattice in the image) with nominal_nm.

    \b
    Example:
      tablegen calibrate size --axis x sizes.csv --scanner scanner.toml --write
    """
    from tablegen.calibration.columns import ACTUAL, APPARENT, DRIVE, NOMINAL, TRUE
    from tablegen.calibration.size import fit_size

    table = read_columns(data, [], [DRIVE, NOMINAL, ACTUAL, APPARENT, TRUE])
    if DRIVE not in table and (NOMINAL not in table or k is None):
        fail([f"{table.file}: drive_v is missing; or give nominal_nm, and --k NM/V"], ExitStatus.WRONG_INPUT)
    if DRIVE in table and k is not None:
        raise click.UsageError("--k is for nominal sizes; the file has drive_v")
    if ACTUAL not in table and any(column not in table for column in (APPARENT, TRUE, NOMINAL)):
        fail(
            [f"{table.file}: actual_nm is missing; or give nominal_nm, apparent_nm and true_nm"], ExitStatus.WRONG_INPUT
        )
    actual = table[ACTUAL] if ACTUAL in table else table[NOMINAL] * table[TRUE] / table[APPARENT]
    drive = table[DRIVE] if DRIVE in table else table[NOMINAL] / (k or 1.0)
    v_max = full_scale(common)
    base = base_nm or in_file(common, "size", "base_nm") or 200.0
    return finish(common, [table], lambda: fit_size(drive, actual, v_max, base, threshold, noise))


@calibrate.command(short_help="Fit beta_max, rho, u_peak to sensor traces.")
@shared_options
@click.argument("data", type=click.Path(path_type=Path), metavar="DATA.CSV...", nargs=-1, required=True)
@click.option(
    "--rho", type=click.FloatRange(1e-6, 100.0), default=1.5, show_default=True, metavar="RHO", help=_RHO_HELP
)
@click.option(
    "--settle",
    type=click.IntRange(min=0),
    metavar="N",
    help="Ignore the first N periods of each trace.  [default: 1 if a trace has three periods or more, otherwise 0]",
)
@click.option(
    "--drift",
    type=click.IntRange(0, 5),
    metavar="N",
    help="Order of the polynomial that describes drift.  [default: 1 to 3, more with more periods]",
)
@click.option(
    "--delay-s",
    default="0",
    show_default=True,
    metavar="S|fit",
    help="Delay of the sensor relative to the drive in seconds, or `fit` to fit it.",
)
@_points
def hysteresis(
    common: Common,
    data: tuple[Path, ...],
    rho: float,
    settle: int | None,
    drift: int | None,
    delay_s: str,
    points: bool,
) -> int:
    """Fit beta_max and rho, (22), and u_peak, (17), to sensor traces with a triangular drive.

    Record one period or more at each of several amplitudes.

    \b
    Columns: time_s, drive_v, displacement_nm. A file with several traces also has the column
    trace, a number for each trace; without it, a new trace starts where time_s goes back.

    Traces with different turn (the forward fraction of the period) give separate parameter sets.

    \b
    Example:
      tablegen calibrate hysteresis --axis x 30v.csv 60v.csv 100v.csv --scanner scanner.toml --write
    """
    from tablegen.calibration.columns import DISPLACEMENT, DRIVE, TIME, TRACE
    from tablegen.calibration.hysteresis import fit_hysteresis
    from tablegen.calibration.traces import split_traces

    try:
        delay = None if delay_s == "fit" else float(delay_s)
        if delay is not None and not isfinite(delay):
            raise ValueError
    except ValueError:
        raise click.UsageError(f"--delay-s {delay_s}: seconds, or fit") from None
    tables = [read_columns(path, [TIME, DRIVE, DISPLACEMENT], [TRACE]) for path in data]
    v_max = full_scale(common)
    traces = [trace for table in tables for trace in split_traces(table)]
    return finish(common, tables, lambda: fit_hysteresis(traces, v_max, rho, settle, drift, delay), points)


calibrate.add_command(operator)


@calibrate.command(cls=CommandOfPairs, short_help="Fit beta_max, rho, u_peak to trace and retrace images.")
@shared_options
@pair_option
@channel_option
@retrace_channel_option
@frame_option
@click.option(
    "--retrace-mirrored",
    is_flag=True,
    help="The retrace image is stored in order of time: its left pixel is the right end of the line.",
)
@click.option(
    "--window",
    type=(float, float),
    default=(0.0, 1.0),
    show_default=True,
    metavar="LOW HIGH",
    help="Imaged part of each sweep, as two fractions of its duration; 0 1 is the whole sweep.",
)
@click.option(
    "--turn",
    type=float,
    default=0.5,
    show_default=True,
    metavar="FRACTION",
    help="Turn of the triangle: forward fraction of the period.",
)
@click.option(
    "--delay-pixels",
    type=float,
    default=0.0,
    show_default=True,
    metavar="N",
    help="Delay of the images relative to the drive in pixels.",
)
@click.option(
    "--rho", type=click.FloatRange(1e-6, 100.0), default=1.5, show_default=True, metavar="RHO", help=_RHO_HELP
)
@_points
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

    \b
    Example:
      tablegen calibrate images --axis x --v-max 100 --pair 50 t1.npy r1.npy --pair 100 t2.npy r2.npy
      tablegen calibrate images --axis x --v-max 100 --pair 50 1.ibw --pair 100 2.ibw --channel Height
    """
    from tablegen.calibration.images import Pair, fit_images

    read = [read_both(trace, retrace, channel, retrace_channel, frame) for _, trace, retrace in pairs]
    v_max = full_scale(common)
    taken = [
        Pair(
            " and ".join(dict.fromkeys((trace.source.name, retrace.source.name))), volts, trace.heights, retrace.heights
        )
        for (volts, *_), (trace, retrace) in zip(pairs, read, strict=True)
    ]
    files = [image for both in read for image in both]
    fit = partial(fit_images, taken, v_max, rho, turn, window, retrace_mirrored, delay_pixels)
    return finish(common, files, fit, points)


@calibrate.command(short_help="Fit alpha to gains at several frequencies.")
@shared_options
@_data
@click.option("--reference-hz", type=click.FloatRange(min=1e-6), metavar="HZ", help=_REFERENCE_HELP)
@_from_hz
@_to_hz
def frequency(common: Common, data: Path, reference_hz: float | None, from_hz: float, to_hz: float) -> int:
    """Fit alpha, equation (23), to gains at several frequencies below a tenth of the resonance frequency.

    \b
    Columns: frequency_hz; gain or gain_db.

    \b
    Example:
      tablegen calibrate frequency --axis x gains.csv --scanner scanner.toml --write
    """
    from tablegen.calibration.columns import FREQUENCY, GAIN
    from tablegen.calibration.frequency import fit_frequency

    table = within(read_columns(data, [FREQUENCY, GAIN]), from_hz, to_hz)
    reference = reference_hz or in_file(common, "frequency", "reference_hz")
    return finish(common, [table], lambda: fit_frequency(table[FREQUENCY], table[GAIN], reference))


@calibrate.command(short_help="Fit resonance frequency, quality and delay to a response.")
@shared_options
@_data
@_from_hz
@_to_hz
@click.option(
    "--points",
    is_flag=True,
    help="With --write, write the measured response as a CSV file beside the scanner file, and name it there, instead "
    "of the fitted resonance.",
)
def resonance(common: Common, data: Path, from_hz: float, to_hz: float, points: bool) -> int:
    """Fit frequency_hz, quality and delay_s to a frequency response that covers the resonance.

    \b
    Columns: frequency_hz; gain or gain_db; optionally phase_deg or phase_rad, for delay_s.

    \b
    Example:
      tablegen calibrate resonance --axis x response.csv --scanner scanner.toml --write
    """
    from tablegen.calibration.columns import FREQUENCY, GAIN, PHASE
    from tablegen.calibration.resonance import fit_resonance

    table = within(read_columns(data, [FREQUENCY, GAIN], [PHASE]), from_hz, to_hz)
    phase = table.columns.get(PHASE.name)
    return finish(common, [table], lambda: fit_resonance(table[FREQUENCY], table[GAIN], phase), points)
