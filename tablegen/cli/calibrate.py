"""``tablegen calibrate``: measurements to parameters of the scanner file, with standard errors."""

from functools import partial
from math import isfinite
from pathlib import Path
from typing import Literal

import click

from tablegen.cli.calibration_run import (
    Common,
    finish,
    full_scale,
    in_file,
    read_columns,
    read_heights,
    shared_options,
    size_law,
    within,
)
from tablegen.cli.common import fail, require
from tablegen.cli.exit_status import ExitStatus

_points = click.option("--points", is_flag=True, help="Write each amplitude as measured, in place of (22).")
_data = click.argument("data", type=click.Path(path_type=Path), metavar="DATA.CSV")
_from_hz = click.option("--from-hz", type=float, default=0.0, metavar="HZ", help="Leave out what is below.")
_to_hz = click.option("--to-hz", type=float, default=float("inf"), metavar="HZ", help="Leave out what is above.")


@click.group(
    short_help="Measurements to a scanner file, with standard errors.",
    epilog="""\b
  tablegen calibrate offset --axis x offsets.csv --scanner scanner.toml
  tablegen calibrate offset --axis x offsets.csv --scanner scanner.toml --write
  tablegen calibrate hysteresis --axis x 30v.csv 60v.csv 100v.csv --v-max 100 --plot x.png
  tablegen calibrate images --axis x --v-max 100 --pair 100 trace.npy retrace.npy""",
)
def calibrate() -> None:
    """Calibrate a scanner from CSV files, whose header has units in its names, or from images.

    Prints parameters with standard errors, and what they leave of the paper's errors. With --write the scanner file is
    updated in place; a comment says from which bytes. Points that do not fit are named, and never dropped.
    """


@calibrate.command(short_help="Apparent sizes at several offsets: m_minus, m_plus.")
@shared_options
@_data
@click.option(
    "--size-v",
    type=click.FloatRange(min=0.0, min_open=True),
    metavar="V",
    help="Scan voltage of the images: with the size law of FILE, m is then exact.",
)
def offset(common: Common, data: Path, size_v: float | None) -> int:
    """Apparent sizes of one object, or lattice constants, at three or more offset voltages.

    Columns: offset_v, apparent_nm. They give m_minus and m_plus, (1)-(4). A drive m times as large makes a scan more
    than m times as large, (6): calibrate the size first, and give --size-v.
    """
    from tablegen.calibration.columns import APPARENT, OFFSET
    from tablegen.calibration.offset import fit_offset

    table = read_columns(data, [OFFSET, APPARENT])
    v_max = full_scale(common)
    law = None if size_v is None else size_law(common, v_max, size_v)
    return finish(common, [table], lambda: fit_offset(table[OFFSET], table[APPARENT], v_max, law, size_v))


@calibrate.command(short_help="Actual scan sizes: k, beta, threshold.")
@shared_options
@_data
@click.option("--k", type=click.FloatRange(min=1e-6), metavar="NM/V", help="What nominal_nm were set with.")
@click.option("--base-nm", type=click.FloatRange(min=1e-6), metavar="NM", help="Base size.  [default: FILE's, or 200]")
@click.option("--threshold", type=float, metavar="V/V_MAX", help="Keep it at this.  [default: fitted, or 0.5]")
@click.option(
    "--noise",
    type=click.Choice(("relative", "absolute")),
    default="relative",
    show_default=True,
    help="Errors in proportion to the size, as in images, or the same for all, as of a sensor.",
)
def size(
    common: Common,
    data: Path,
    k: float | None,
    base_nm: float | None,
    threshold: float | None,
    noise: Literal["relative", "absolute"],
) -> int:
    """Actual scan sizes at several drives.

    \b
    Columns: drive_v, the scan voltage peak to peak at the piezo,
             or nominal_nm and --k, the linear constant that made it a voltage;
    and      actual_nm, from a sensor,
             or apparent_nm and true_nm of a lattice, and nominal_nm.

    They give k_nm_per_v at the base size, beta and v_threshold, (6)-(12).
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


@calibrate.command(short_help="Sensor traces: beta_max, rho, u_peak.")
@shared_options
@click.argument("data", type=click.Path(path_type=Path), metavar="DATA.CSV...", nargs=-1, required=True)
@click.option("--rho", type=click.FloatRange(1e-6, 100.0), default=1.5, show_default=True, help="With one amplitude.")
@click.option(
    "--settle", type=click.IntRange(min=0), metavar="N", help="Periods left out.  [default: 1 of three or more]"
)
@click.option(
    "--drift", type=click.IntRange(0, 5), metavar="N", help="Order of the drift.  [default: 1 to 3, by periods]"
)
@click.option("--delay-s", default="0", show_default=True, metavar="S|fit", help="Of the sensor against the drive.")
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
    """Displacement against a triangular drive, over one period or more, at several amplitudes.

    Columns: time_s, drive_v, displacement_nm; where a file has several traces, trace, or a time that begins anew.
    A trace an amplitude gives beta_max and rho, (22), and u_peak, (17); traces of another turn give a set of their own.
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


@calibrate.command(short_help="Trace and retrace images: beta_max, rho, u_peak.")
@shared_options
@click.option(
    "--pair",
    "pairs",
    type=(click.FloatRange(min=0.0, min_open=True), click.Path(path_type=Path), click.Path(path_type=Path)),
    metavar="VOLTS TRACE RETRACE",
    multiple=True,
    required=True,
    help="Two images, and the scan voltage peak to peak at the piezo. Once for every amplitude.",
)
@click.option("--channel", metavar="NAME|N", help="The data to take from files that have several.")
@click.option("--retrace-channel", metavar="NAME|N", help="Another one for the retrace.  [default: --channel]")
@click.option("--retrace-mirrored", is_flag=True, help="The retrace is stored in the order of time, right to left.")
@click.option(
    "--window",
    type=(float, float),
    default=(0.0, 1.0),
    show_default=True,
    metavar="LOW HIGH",
    help="Part of the sweep.",
)
@click.option("--turn", type=float, default=0.5, show_default=True, help="Of the triangle.")
@click.option("--delay-pixels", type=float, default=0.0, show_default=True, metavar="N", help="By which images lag.")
@click.option("--rho", type=click.FloatRange(1e-6, 100.0), default=1.5, show_default=True, help="With one amplitude.")
@_points
def images(
    common: Common,
    pairs: tuple[tuple[float, Path, Path], ...],
    channel: str | None,
    retrace_channel: str | None,
    retrace_mirrored: bool,
    window: tuple[float, float],
    turn: float,
    delay_pixels: float,
    rho: float,
    points: bool,
) -> int:
    """Images of a grating or a lattice, three periods in the line or more, scanned with a triangle. No sensor.

    \b
    Files:   .npy, .tif, .png, .gwy, or numbers as .txt, .asc, .csv, .dat;
    Columns: evenly spread in time over --window of each sweep, 0 1 for all of it;
    Rows:    in the order of time. Left is left in both, or --retrace-mirrored.

    A pair an amplitude gives what sensor traces give: beta_max and rho, (22), and u_peak, (17).
    """
    from tablegen.calibration.image_files import MODULES
    from tablegen.calibration.images import Pair, fit_images

    needed = {MODULES.get(path.suffix.lower()) for _, *paths in pairs for path in paths} - {None}
    require(*sorted(filter(None, needed)), extra="images")
    read = [
        (read_heights(trace, channel), read_heights(retrace, retrace_channel or channel)) for _, trace, retrace in pairs
    ]
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


@calibrate.command(short_help="Gain against frequency: alpha.")
@shared_options
@_data
@click.option("--reference-hz", type=click.FloatRange(min=1e-6), metavar="HZ", help="[default: FILE's, or the lowest]")
@_from_hz
@_to_hz
def frequency(common: Common, data: Path, reference_hz: float | None, from_hz: float, to_hz: float) -> int:
    """Gain at several frequencies below a tenth of the resonance.

    Columns: frequency_hz, gain or gain_db. They give alpha, (23). The reference is the rate of the size calibration.
    """
    from tablegen.calibration.columns import FREQUENCY, GAIN
    from tablegen.calibration.frequency import fit_frequency

    table = within(read_columns(data, [FREQUENCY, GAIN]), from_hz, to_hz)
    reference = reference_hz or in_file(common, "frequency", "reference_hz")
    return finish(common, [table], lambda: fit_frequency(table[FREQUENCY], table[GAIN], reference))


@calibrate.command(short_help="Frequency response: resonance, quality, delay.")
@shared_options
@_data
@_from_hz
@_to_hz
def resonance(common: Common, data: Path, from_hz: float, to_hz: float) -> int:
    """Gain and phase through the resonance.

    Columns: frequency_hz, gain or gain_db, phase_deg or phase_rad. They give frequency_hz, quality and delay_s.
    """
    from tablegen.calibration.columns import FREQUENCY, GAIN, PHASE
    from tablegen.calibration.resonance import fit_resonance

    table = within(read_columns(data, [FREQUENCY, GAIN], [PHASE]), from_hz, to_hz)
    phase = table.columns.get(PHASE.name)
    return finish(common, [table], lambda: fit_resonance(table[FREQUENCY], table[GAIN], phase))
