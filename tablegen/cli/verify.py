"""``tablegen verify``: the emitted sequencer, simulated or compiled, against the manifest."""

import os
import signal
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Literal

import click

from tablegen.cli.common import fail
from tablegen.cli.exit_status import ExitStatus
from tablegen.cli.progress import Progress

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tablegen.verification.build import Report
    from tablegen.verification.checks import Check


@click.command(short_help="Play a build's sequencer, and hold every sample against it.")
@click.argument("folder", type=click.Path(path_type=Path, file_okay=False), metavar="DIR")
@click.option(
    "--target",
    "target_name",
    type=click.Choice(("verilog", "c", "cortex-m", "files")),
    help="Which sequencer to play: the dac_*.v in a simulator, the dac_*.c compiled for this machine, the same for a "
    "Cortex-M4 in an emulator, or none and only the files.  [default: verilog, or c in a build without Verilog]",
)
@click.option(
    "--sim",
    "simulator",
    type=click.Choice(("icarus", "verilator")),
    help="The simulator of Verilog; verilator compiles for some seconds and is then some forty times as fast.  "
    "[default: icarus]",
)
@click.option(
    "--ticks",
    type=click.IntRange(min=1000, max=1 << 28),
    metavar="N",
    help="Play at most N ticks.  [default: icarus 300000, verilator 3000000, of these serial a 41st; c 3000000, "
    "cortex-m 1000000]",
)
@click.option(
    "--axis",
    type=click.Choice(("pipelined", "blocks", "serial")),
    help="The axis that you place in Verilog: a sample a clock in look-up tables (pipelined) or with multiplier blocks "
    "(blocks, PLAIN_MULTIPLIER = 1), or in low area (serial, LOW_AREA = 1).  [default: pipelined]",
)
@click.option(
    "--fourier",
    is_flag=True,
    help="Let the device render its tables from Fourier words (FOURIER = 1; in C dac_synthesize).",
)
@click.option("--seed", type=click.IntRange(min=0), default=1, show_default=True, help="Of what is left to chance.")
@click.option(
    "--junit", type=click.Path(path_type=Path, dir_okay=False), metavar="FILE", help="Write JUnit XML, a case a check."
)
@click.option(
    "--keep",
    type=click.Path(path_type=Path, file_okay=False),
    metavar="DIR",
    help="Play there, and leave script, record and logs. Without it nothing is left.",
)
def verify(
    folder: Path,
    target_name: Literal["verilog", "c", "cortex-m", "files"] | None,
    simulator: Literal["icarus", "verilator"] | None,
    ticks: int | None,
    axis: Literal["pipelined", "blocks", "serial"] | None,
    fourier: bool,
    seed: int,
    junit: Path | None,
    keep: Path | None,
) -> int:
    """Verify the build in DIR: does its sequencer play what its manifest says, bit for bit?

    Files are held against their SHA-256, the header's constants and the tables against the manifest. Then the sequencer
    of DIR plays the program and the tables of DIR: power-up, a frame and some lines, a swap in mid-frame at a random
    tick, park. Every code, marker and fault has to equal the integer model, every code to be as near to the float
    waveform as the certificate promises, every step and code inside its limits.

    \b
    verilog   the dac_*.v with the .mem files, under cocotb. Needs Icarus Verilog and the
              extra hdl, or a C++ compiler and the extra verilator.
    c         the dac_*.c with NAME.h and NAME.c, a tick a call and many ticks a call,
              converter words too. Needs a C compiler: $CC $CFLAGS, or cc.
    cortex-m  the same for a Cortex-M4. Needs arm-none-eabi-gcc and the extra cortex-m.

    In C what is swapped in has half the amplitude and clamps, so that neither a mixture of two programs nor a missing
    limit goes unseen. A frame that has more ticks than are played is played in part; a note says so.

    \b
      tablegen verify build
      tablegen verify build --target c
      tablegen verify build --sim verilator --junit verify.xml     in CI
    Exit status: 0 verified, 5 a check failed, 2 DIR holds no build, 6 a tool is missing.
    """
    for option, value in (("--sim", simulator), ("--axis", axis)):
        if target_name not in (None, "verilog") and value is not None:
            raise click.UsageError(f"{option} is for Verilog; --target {target_name} has no choice of it")
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from tablegen.manifest.read import NotABuild
    from tablegen.verification.run import verify as verify_build
    from tablegen.verification.simulate import ToolMissing

    try:
        with _terminated_as_interrupted(), Progress() as progress:
            report = verify_build(
                folder,
                target_name,
                simulator=simulator or "icarus",
                axis=axis or "pipelined",
                fourier=fourier,
                ticks=ticks,
                seed=seed,
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
    click.echo("\n".join(_table(report.checks)))
    for note in report.notes:
        click.echo(f"note: {note}")
    written = junit is None or _write(junit, report)
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


@contextmanager
def _terminated_as_interrupted() -> Iterator[None]:
    """A runner that cancels a job with SIGTERM leaves nothing behind either."""

    def interrupt(_number: int, _frame: FrameType | None) -> None:
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


def _write(path: Path, report: "Report") -> bool:
    from tablegen.verification.junit import junit

    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(junit(report.name, report.checks), "utf-8")
    except OSError as error:
        click.echo(f"{path}: {error.strerror or error}", err=True)
        return False
    return True


def _table(checks: "Sequence[Check]") -> list[str]:
    head = ("", "against", "compared", "worst", "limit", "")
    rows = [
        (c.subject, c.against, c.compared, c.worst, c.limit, "ok" if c.failure is None else "FAILED") for c in checks
    ]
    widths = [max(len(row[i]) for row in [head, *rows]) for i in range(len(head))]
    lines = []
    for row in [head, *rows]:
        cells = [
            cell.rjust(width) if i in (3, 4) else cell.ljust(width)
            for i, (cell, width) in enumerate(zip(row[:-1], widths[:-1], strict=True))
        ]
        verdict = row[-1]
        if verdict == "FAILED":
            verdict = click.style(verdict, bold=True)
        lines.append(("  ".join([*cells, verdict])).rstrip())
    return lines
