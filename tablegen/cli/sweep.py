"""``tablegen sweep``: many scans, as a library of programs."""

import json
from pathlib import Path
from typing import TYPE_CHECKING

import click

from tablegen.cli.shared.common import OutputFolder, fail, format_option, scan_argument, strict_option
from tablegen.cli.shared.exit_status import ExitStatus

if TYPE_CHECKING:
    from tablegen.sweep.run import ScanLibrary

_SHOWN = 20  # scans with the same reason, by name


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
    type=OutputFolder(),
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
    listed with their reasons, and the others are built. Programs of an earlier sweep that are no longer asked for are
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
    from tablegen.base.workers import default_jobs
    from tablegen.cli.shared.common import quiet_blas
    from tablegen.cli.shared.progress_bar import Bar

    quiet_blas()
    from tablegen.emit.write import CannotWrite, NoPlace
    from tablegen.sweep.run import run

    found = _asked(scan, texts, output)
    chosen = list(formats) or None
    if only_list:
        return _listed(found, chosen)
    bar = Bar(unit="scans")
    try:
        run(found, formats=chosen, jobs=jobs or default_jobs(), strict=strict, only_check=only_check, progress=bar)
    except KeyboardInterrupt:
        bar.close()
        again = "" if only_check else "; what was built stays, and the same command goes on from there"
        fail([f"interrupted after {found.done} of {len(found.variants)} scans{again}"], ExitStatus.INTERRUPTED)
    except NoPlace as error:
        fail([error], ExitStatus.WRONG_INPUT)
    except CannotWrite as error:
        fail([error], ExitStatus.CANNOT_WRITE)
    except OSError as error:
        fail([f"{output}: {error.strerror or error}"], ExitStatus.CANNOT_WRITE)
    finally:
        bar.close()
    return _told(found, only_check, quiet)


def _asked(scan: Path, texts: tuple[str, ...], output: Path) -> "ScanLibrary":
    """The scans that are asked for; a file that cannot be read, or a wrong setting, ends the command."""
    from tablegen.base.input_errors import Rejected
    from tablegen.config.settings import parse_setting
    from tablegen.config.variants import variants
    from tablegen.sweep.run import ScanLibrary

    try:
        library, found = variants(scan, [parse_setting(text) for text in texts])
    except Rejected as rejected:
        fail(rejected.problems, ExitStatus.WRONG_INPUT)
    return ScanLibrary(library, found, output)


def _listed(found: "ScanLibrary", formats: list[str] | None) -> int:
    """A line a scan: what a sweep would do with it."""
    from tablegen.base.input_errors import Rejected
    from tablegen.library.entry import Entry
    from tablegen.sweep.inputs import Inputs
    from tablegen.sweep.run import state
    from tablegen.sweep.written_records import WrittenRecords

    inputs, written, wrong = Inputs(), WrittenRecords(), 0
    width = max(len(variant.name) for variant in found.variants)
    for variant in found.variants:
        told = ", ".join(f"{key} = {json.dumps(value, default=str)}" for key, value in variant.settings.items())
        try:
            what = "up to date" if isinstance(state(found, variant, formats, inputs, written), Entry) else "to build"
        except Rejected as rejected:
            wrong += 1
            what = f"wrong: {rejected.problems[0]}"
        click.echo(f"{variant.name:<{width}}  {told}: {what}" if told else f"{variant.name:<{width}}  {what}")
    if not wrong:
        return ExitStatus.OK
    return ExitStatus.WRONG_INPUT if wrong == len(found.variants) else ExitStatus.PARTIAL


def _told(found: "ScanLibrary", only_check: bool, quiet: bool) -> int:
    """Print what became of a sweep, and return the status."""
    for entry in found.in_order:
        for warning in entry.warnings:
            click.echo(f"warning: {entry.name}: {warning}", err=True)
    for lines in _reasons(found):
        click.echo(lines, err=True)
    for note in found.notes:
        click.echo(f"note: {note}", err=True)
    count, failed = len(found.variants), len(found.failed)
    status = _status(found)
    if only_check and found.different:
        click.echo("\n".join(f"{found.folder / name}: not up to date" for name in found.different))
        click.echo(f"{found.folder} is stale; run the same command without --check", err=True)
        return status if status not in (ExitStatus.OK, ExitStatus.PARTIAL) else ExitStatus.STALE
    if not quiet:
        parts = [f"{len(found.built)} built"] * bool(found.built)
        parts += [f"{len(found.current)} up to date"] * bool(found.current)
        parts += [f"{failed} failed"] * bool(failed) + [f"{len(found.removed)} removed"] * bool(found.removed)
        click.echo(f"{found.folder}: {count} scan{'s' if count != 1 else ''}: {', '.join(parts)}")
    return status


def _reasons(found: "ScanLibrary") -> list[str]:
    """Each reason once, with the scans that it holds for."""
    by_reason: dict[str, list[str]] = {}
    for failed in found.failed:
        by_reason.setdefault("\n".join(failed.reasons), []).append(failed.variant.name)
    lines = []
    for reason, names in by_reason.items():
        more = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
        lines.append(f"failed: {', '.join(names[:_SHOWN])}{more}:\n  " + reason.replace("\n", "\n  "))
    return lines


def _status(found: "ScanLibrary") -> ExitStatus:
    if not found.failed:
        return ExitStatus.OK
    if found.entries:
        return ExitStatus.PARTIAL
    limits = any(failed.kind == "limit" for failed in found.failed)
    return ExitStatus.BROKEN_LIMIT if limits else ExitStatus.WRONG_INPUT
