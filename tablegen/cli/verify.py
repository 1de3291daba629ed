"""``tablegen verify``: simulate or run the emitted sequencer, and compare it with the manifest."""

import os
import signal
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Literal

import click

from tablegen.cli.shared.common import OutputFile, OutputFolder, fail
from tablegen.cli.shared.exit_status import ExitStatus
from tablegen.cli.shared.progress import Progress
from tablegen.cli.shared.terminal import tell

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tablegen.verification.build_report import Report
    from tablegen.verification.checks.played_checks import Check

_FAILED = "FAILED"


_MANY_CLOCKS = 200_000  # of a simulation that takes more than some seconds
_CLOCKS_A_SECOND = 20_000  # that Icarus simulates, more or less


@click.command(short_help="Simulate or run the sequencer of a build; check every sample.")
@click.argument("folder", type=click.Path(path_type=Path, file_okay=False), metavar="DIR")
@click.option(
    "--target",
    "target_name",
    type=click.Choice(("verilog", "c", "cortex-m", "files")),
    help="What to run: the Verilog in a simulator; the C code on this machine; the C code on an emulated Cortex-M4; "
    "or nothing, and check only the files.  [default: verilog, or c for a build without Verilog]",
)
@click.option(
    "--sim",
    "simulator",
    type=click.Choice(("icarus", "verilator")),
    help="Verilog simulator. verilator takes some seconds to compile, and then runs about 40 times as fast. "
    "It keeps the compiled model in ~/.cache/tablegen.  "
    "[default: icarus]",
)
@click.option(
    "--ticks",
    type=click.IntRange(min=1000, max=1 << 28),
    metavar="N",
    help="Play at most N ticks of the build's own program, after some 6000 for requests and faults.  [default: "
    "icarus 300000, verilator 3000000, both divided by the clocks from tick to tick: 41 with --axis serial, 2 with "
    "alternate, 11 with a cubic table, 90 with it and serial; c 3000000, cortex-m 1000000]",
)
@click.option(
    "--axis",
    type=click.Choice(("pipelined", "blocks", "serial", "alternate")),
    help="Verilog variant of dac_axis: pipelined, one sample per clock, multiplies in look-up tables; blocks "
    "(PLAIN_MULTIPLIER = 1), the same with multiplier blocks; serial (LOW_AREA = 1), smaller, 41 clocks per sample, "
    "90 with a cubic table; alternate (ALTERNATE = 1), both axes by turns, 2 clocks per sample.  [default: pipelined]",
)
@click.option(
    "--fourier",
    is_flag=True,
    help="Load Fourier words instead of tables; the device computes its tables (Verilog: FOURIER = 1; C: "
    "dac_synthesize).",
)
@click.option(
    "--seed",
    type=click.IntRange(min=0),
    default=1,
    show_default=True,
    metavar="N",
    help="Random seed, for example of the tick of the program change.",
)
@click.option(
    "--other-version",
    is_flag=True,
    help="Accept a build of another version of tablegen. Its runtime cannot be compared with the installed one: only "
    "the played checks can show whether it is correct. Without this option such a build fails.",
)
@click.option(
    "--junit",
    type=OutputFile(),
    metavar="FILE",
    help="Also write the results as JUnit XML to FILE, one test case per check.",
)
@click.option(
    "--keep",
    type=OutputFolder(),
    metavar="DIR",
    help="Run in DIR and keep its scripts, records and logs. By default they are deleted.",
)
def verify(
    folder: Path,
    target_name: Literal["verilog", "c", "cortex-m", "files"] | None,
    simulator: Literal["icarus", "verilator"] | None,
    ticks: int | None,
    axis: Literal["pipelined", "blocks", "serial", "alternate"] | None,
    fourier: bool,
    seed: int,
    other_version: bool,
    junit: Path | None,
    keep: Path | None,
) -> int:
    """Verify that the sequencer of the build in DIR plays the scan that its manifest describes, bit for bit.

    Of a scan at an angle, NAME_top.v alone plays in Verilog: its boot, a frame and a line; --axis, --fourier and --seed
    have no effect.

    If DIR is a library of tablegen sweep, every program of it is verified in this way, the index is compared with the
    programs, and each program plays as the index has it: picked by dac_library.v, or out of LIBRARY_library.c.

    This compiles and runs the code in DIR. Do not verify a directory whose code you would not run.

    First the command checks the files: that DIR has all files of such a build, their SHA-256, the constants and tables
    against the manifest, and the sequencer against the installed one. A build of another version of tablegen fails,
    unless --other-version is given. The command computes the certificate again from the words. Then it runs the
    sequencer of DIR. Short programs play every request and every fault on purpose: ramps, clamps and the slew guard
    in both directions, counted scans, refused writes. Then the tables of DIR play one frame and some lines, with a
    change of programs and back within a frame, and park.

    Every code, marker and fault must equal the integer model. Every code must be as close to the ideal waveform as the
    words of the manifest make it, and every code and step within its limits. A check without stimulus is
    "not exercised". "not played:" names the files and options that no check has played.

    \b
    verilog   runs dac_*.v with the .mem files under cocotb. Needs Icarus Verilog and the
              extra [hdl] of tablegen, or a C++ compiler and the extra [verilator]; and
              the shared library of Python (Debian: libpython3.11).
    c         runs dac_*.c with the other C files, one tick per call and many ticks per call,
              and also checks the converter words. Needs a C compiler: $CC $CFLAGS, or cc.
    cortex-m  runs the same on an emulated Cortex-M4. Needs arm-none-eabi-gcc and the
              extra [cortex-m].
    files     checks only the files.

    Icarus plays a long frame in a second process, with multiplier blocks (PLAIN_MULTIPLIER = 1), which it simulates
    twice as fast; with --ticks or --axis it plays the selected variant. If a frame has more ticks than --ticks, only a
    part of it is played, and a note reports this. With --fourier, rendering takes longer than all the rest.

    \b
    Examples:
      tablegen verify build
      tablegen verify build --target c
      tablegen verify library --target files
      tablegen verify build --sim verilator --junit verify.xml

    \b
    Exit status: 0 verified, 2 DIR contains neither a build nor a library, 4 cannot write,
    5 a check failed, 6 a simulator, compiler or library is missing.
    """
    for option, value in (("--sim", simulator), ("--axis", axis)):
        if target_name not in (None, "verilog") and value is not None:
            raise click.UsageError(f"{option} is for Verilog; --target {target_name} has no choice of it")
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from tablegen.manifest.read import NotABuild
    from tablegen.verification.failures import ToolMissing
    from tablegen.verification.run import verify as verify_build

    digest = _digest(folder)  # before it is played: a later change of the files is not verified
    try:
        if fourier and axis != "alternate" and target_name in (None, "verilog") and (simulator or "icarus") == "icarus":
            _say_how_long(folder, axis or "pipelined")
        with _terminated_as_interrupted(), Progress() as progress:
            report = verify_build(
                folder,
                target_name,
                simulator=simulator or "icarus",
                axis=axis or "pipelined",
                fourier=fourier,
                ticks=ticks,
                seed=seed,
                other_version=other_version,
                keep=keep,
                progress=progress.now,
            )
    except NotABuild as error:
        fail([error], ExitStatus.WRONG_INPUT)
    except ToolMissing as error:
        fail([error], ExitStatus.TOOL_MISSING)
    except OSError as error:
        place = error.filename or keep or tempfile.gettempdir()
        fail([f"cannot verify: {place}: {error.strerror or error}"], ExitStatus.CANNOT_WRITE)
    for line in _table(report.checks):
        tell(line, bold=line.endswith(_FAILED))
    for note in report.notes:
        click.echo(f"note: {note}")
    if report.unplayed:
        click.echo(f"not played: {'; '.join(report.unplayed)}")
    written = junit is None or _write(junit, report, digest)
    if report.failures:
        lines = ["", *report.failures]
        if report.difference is not None:
            lines += ["", f"first difference: {report.difference}"]
        count = len(report.failures)
        fail(
            [*lines, "", f"{folder}: {count} of {len(report.checks)} checks failed"],
            ExitStatus.MISMATCH,
        )
    click.echo(f"\n{folder}: verified, {len(report.checks)} checks")
    return ExitStatus.OK if written else ExitStatus.CANNOT_WRITE


def _say_how_long(folder: Path, axis: Literal["pipelined", "blocks", "serial", "alternate"]) -> None:
    """Print how long Icarus will render, before it does."""
    from tablegen.verification.run import rendering_clocks

    clocks = rendering_clocks(folder, axis)
    if clocks > _MANY_CLOCKS:
        click.echo(
            f"note: Icarus simulates {clocks} clocks in which the tables are rendered, some "
            f"{clocks / _CLOCKS_A_SECOND:.0f} s; --sim verilator is some 40 times as fast",
            err=True,
        )


@contextmanager
def _terminated_as_interrupted() -> Iterator[None]:
    """Treat SIGTERM as Ctrl-C, so that a runner that cancels a job leaves no files behind."""

    def interrupt(_number: int, _frame: FrameType | None) -> None:
        """Handle the signal.

        Raises
        ------
        KeyboardInterrupt
            Always.
        """
        raise KeyboardInterrupt

    try:
        before = signal.signal(signal.SIGTERM, interrupt)
    except ValueError:  # not in the main thread
        yield
        return
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _digest(folder: Path) -> str:
    """Return the SHA-256 of the manifest, or of a library's index; empty if neither can be read."""
    from tablegen.base.reading import file_sha256
    from tablegen.manifest.format import INDEX, MANIFEST

    for name in (MANIFEST, INDEX):
        with suppress(OSError):
            return file_sha256(folder / name)
    return ""


def _write(path: Path, report: "Report", digest: str) -> bool:
    from tablegen.verification.junit import junit

    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(junit(report.name, report.checks, report.seconds, digest), "utf-8")
    except OSError as error:
        click.echo(f"{path}: {error.strerror or error}", err=True)
        return False
    return True


def _table(checks: "Sequence[Check]") -> list[str]:
    head = ("", "against", "compared", "worst", "limit", "")
    rows = [(c.subject, c.against, c.compared, c.worst, c.limit, c.verdict) for c in checks]
    widths = [max(len(row[i]) for row in [head, *rows]) for i in range(len(head))]
    lines = []
    for row in [head, *rows]:
        cells = [
            cell.rjust(width) if i in (3, 4) else cell.ljust(width)
            for i, (cell, width) in enumerate(zip(row[:-1], widths[:-1], strict=True))
        ]
        lines.append(("  ".join([*cells, row[-1]])).rstrip())
    return lines
