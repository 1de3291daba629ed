"""``tablegen sweep``: build many scans as a library of programs."""

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING

import click

from tablegen.cli.shared.common import OutputFolder, check_place, fail, format_option, scan_argument, strict_option
from tablegen.cli.shared.exit_status import ExitStatus

if TYPE_CHECKING:
    from tablegen.sweeping.run import ScanLibrary


@click.command(short_help="Build many scans as a library of programs with one index.")
@scan_argument
@click.option(
    "--set",
    "texts",
    multiple=True,
    metavar="KEY=VALUES",
    help="Values of a key of the scan file: numbers, words, and ranges START:STOP:STEP with both ends. Repeat the "
    "option for several keys: every combination is built.",
)
@click.option(
    "-o",
    "--output",
    type=OutputFolder(always=False),
    default=Path("library"),
    show_default=True,
    metavar="DIR",
    help="Directory of the library. It is created if it does not exist.",
)
@format_option
@click.option(
    "-j",
    "--jobs",
    type=click.IntRange(min=1),
    metavar="N",
    help="Number of processes.  [default: 90 % of the cores]",
)
@click.option("--list", "--dry-run", "only_list", is_flag=True, help="Print the scans and their state. Build nothing.")
@click.option(
    "--check",
    "only_check",
    is_flag=True,
    help="Write nothing. Make all programs again; exit with status 1 and print the files in DIR that differ.",
)
@strict_option
@click.option("-q", "--quiet", is_flag=True, help="Print failures and warnings only.")
def sweep(
    scan: Path,
    texts: tuple[str, ...],
    output: Path,
    formats: tuple[str, ...],
    jobs: int | None,
    only_list: bool,
    only_check: bool,
    strict: bool,
    quiet: bool,
) -> int:
    """Build many scans of one scan file into a library: a folder each, one runtime, one index in JSON, C and Verilog.

    The scans are those of [[scans]] in the file, each with the keys that differ, and every combination of the values of
    --set. A firmware picks a program by its number or its name.

    Scans are built in parallel. A second run builds only what is missing or has changed. Scans that cannot be built are
    listed with their reasons, and the others are built. Programs of an earlier sweep that this one does not have are
    removed from DIR.

    \b
    Examples:
      tablegen sweep scan.toml --set x.size_nm=50:1000:50 --set x.offset_v=10,50,90 -o out
      tablegen sweep scan.toml --set x.size_nm=50:1000:50 --list    show the scans and their names
      tablegen sweep library.toml -o out                            build the [[scans]] of a file
      tablegen sweep library.toml -o out --check                    for CI: check that out is up to date

    \b
    Exit status: 0 done, 1 DIR is not up to date (--check), 2 wrong input: no scan could be built,
    3 no scan could be built, and some for a limit of the certificate (with --strict: or a
    warning), 4 cannot write, 11 some scans could not be built.
    """
    from tablegen.cli.shared.common import quiet_blas
    from tablegen.cli.shared.progress_bar import Bar

    quiet_blas()
    if not (only_check or only_list or os.path.exists(output)):
        check_place(output)
    from tablegen.emit.write import CannotWrite, NoPlace
    from tablegen.sweeping.sweep import build_library

    library = _library(scan, texts, output)
    names = list(formats) or None
    if only_list:
        return _listed(library, names)
    bar = Bar(unit="scans")
    try:
        build_library(library, formats=names, jobs=jobs, strict=strict, only_check=only_check, progress=bar)
    except KeyboardInterrupt:
        bar.close()
        again = "" if only_check else "; what was built stays, and the same command goes on from there"
        fail([f"interrupted after {library.done} of {len(library.variants)} scans{again}"], ExitStatus.INTERRUPTED)
    except NoPlace as error:
        fail([error], ExitStatus.WRONG_INPUT)
    except CannotWrite as error:
        fail([error], ExitStatus.CANNOT_WRITE)
    except OSError as error:
        fail([f"{output}: {error.strerror or error}"], ExitStatus.CANNOT_WRITE)
    finally:
        bar.close()
    return _report_outcome(library, only_check, quiet)


def _library(scan: Path, texts: tuple[str, ...], output: Path) -> "ScanLibrary":
    """Read the scans of the library; a file that cannot be read, or a wrong setting, ends the command."""
    from tablegen.base.input_errors import Rejected
    from tablegen.config.settings import parse_setting
    from tablegen.sweeping.sweep import planned_library

    try:
        return planned_library(scan, [parse_setting(text) for text in texts], output)
    except Rejected as rejected:
        fail(rejected.problems, ExitStatus.WRONG_INPUT)


def _listed(library: "ScanLibrary", formats: list[str] | None) -> int:
    """Print a line for each scan: its settings, and what a sweep would do."""
    from tablegen.base.input_errors import Rejected
    from tablegen.library.entry import Entry
    from tablegen.sweeping.inputs import Inputs
    from tablegen.sweeping.run import state
    from tablegen.sweeping.written_records import WrittenRecords

    inputs, written, wrong = Inputs(), WrittenRecords(), 0
    width = max(len(variant.name) for variant in library.variants)
    for variant in library.variants:
        settings = ", ".join(f"{key} = {json.dumps(value, default=str)}" for key, value in variant.settings.items())
        try:
            what = "up to date" if isinstance(state(library, variant, formats, inputs, written), Entry) else "to build"
        except Rejected as rejected:
            wrong += 1
            what = f"wrong: {rejected.problems[0]}"
        click.echo(f"{variant.name:<{width}}  {settings}: {what}" if settings else f"{variant.name:<{width}}  {what}")
    if not wrong:
        return ExitStatus.OK
    return ExitStatus.WRONG_INPUT if wrong == len(library.variants) else ExitStatus.PARTIAL


def _report_outcome(library: "ScanLibrary", only_check: bool, quiet: bool) -> int:
    """Print the outcome of a sweep, and return the status."""
    for line in library.remarks():
        click.echo(line, err=True)
    status = _status(library)
    if only_check and library.different:
        click.echo("\n".join(f"{library.folder / name}: not up to date" for name in library.different))
        click.echo(f"{library.folder} is stale; run the same command without --check", err=True)
        return status if status not in (ExitStatus.OK, ExitStatus.PARTIAL) else ExitStatus.STALE
    if not quiet:
        click.echo(library.verdict())
    return status


def _status(library: "ScanLibrary") -> ExitStatus:
    if not library.failed:
        return ExitStatus.OK
    if library.entries:
        return ExitStatus.PARTIAL
    limits = any(failed.kind == "limit" for failed in library.failed)
    return ExitStatus.BROKEN_LIMIT if limits else ExitStatus.WRONG_INPUT
