"""Verify a build with one call: choose what plays it, and a directory to play it in."""

import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Literal

from tablegen.library.whole import whole_build
from tablegen.manifest.read import StoredBuild, read_build
from tablegen.manifest.turned import is_turned
from tablegen.verification.build_report import Report, Target, verify_build
from tablegen.verification.checks.played_checks import Check
from tablegen.verification.files_target import FilesTarget
from tablegen.verification.library_checks import library_checks
from tablegen.verification.library_report import IndexRecord, is_library, read_index, verify_library
from tablegen.verification.turned_report import verify_turned

TargetName = Literal["verilog", "c", "cortex-m", "files"]
DEFAULT_TICKS = {"icarus": 300_000, "verilator": 3_000_000, "c": 3_000_000, "cortex-m": 1_000_000, "files": 0}


def verify(
    folder: str | Path,
    target: TargetName | None = None,
    *,
    simulator: Literal["icarus", "verilator"] = "icarus",
    axis: Literal["pipelined", "blocks", "serial", "alternate"] = "pipelined",
    fourier: bool = False,
    ticks: int | None = None,
    seed: int = 1,
    keep: str | Path | None = None,
    other_version: bool = False,
    progress: Callable[[str | Callable[[], str]], None] = lambda _: None,
) -> Report:
    """Hold a build's files, and what its own sequencer plays, against its manifest; or all builds of a library.

    Parameters
    ----------
    folder : str or Path
        Directory of a build, of a library, or of a program of one. What it holds is compiled and run.
    target : {"files", "c", "cortex-m", "verilog"}, optional
        What plays it: "verilog" where the build has it, else "c", else "files", which plays nothing.
    simulator, axis, fourier : optional
        How the Verilog is simulated and placed.
    ticks, seed : int, optional
        Most ticks to play, and the random seed of the session.
    keep : str or Path, optional
        Directory to play in, which is kept.
    other_version : bool
        True to accept a build of another version, whose runtime is then not compared.
    progress : callable
        Called with what is being done.

    Returns
    -------
    Report
        ``failures`` is empty if all is well.

    Raises
    ------
    NotABuild
        The directory holds no build.
    ToolMissing
        A simulator or compiler is not installed.
    OSError
        Nothing can be written.

    Examples
    --------
    >>> _ = tablegen.build("scan.toml", "build")
    >>> tablegen.verify("build", "files").failures
    []
    """
    folder = Path(folder)
    if is_library(folder):

        def verify_program(program: Path) -> Report:
            """Verify a program in a directory of its own."""
            return verify(
                program,
                target,
                simulator=simulator,
                axis=axis,
                fourier=fourier,
                ticks=ticks,
                seed=seed,
                keep=None if keep is None else Path(keep) / program.name,
                other_version=other_version,
                progress=progress,
            )

        def play_index(record: IndexRecord, programs: list[StoredBuild]) -> list[Check]:
            """Play the programs by the index, on the target of the first."""
            with _work_folder(None if keep is None else Path(keep) / "library") as work:
                return library_checks(
                    folder,
                    work,
                    record,
                    programs,
                    target or default_target(folder / record.programs[0].name),
                    simulator=simulator,
                    axis=axis,
                    fourier=fourier,
                    ticks=ticks,
                    progress=progress,
                )

        return verify_library(folder, verify_program, play_index)
    if is_turned(folder):
        with _work_folder(None if keep is None else Path(keep)) as work:
            return verify_turned(
                folder, work, target, ticks, progress, simulator=simulator, other_version=other_version
            )
    player, most_ticks = _target(folder, target or default_target(folder), simulator, axis, fourier, ticks is None)
    with _work_folder(None if keep is None else Path(keep)) as work, whole_build(folder) as whole:
        most = most_ticks if ticks is None else ticks
        return verify_build(whole, work, player, most, seed, progress, other_version=other_version)


def default_target(folder: Path) -> TargetName:
    """Return the target that a build is verified on by default.

    Raises
    ------
    NotABuild
        If the folder has no readable manifest.
    """
    formats = read_build(folder).formats
    return "verilog" if "verilog" in formats else "c" if "c" in formats else "files"


def rendering_clocks(folder: Path, axis: Literal["pipelined", "blocks", "serial", "alternate"]) -> int:
    """Return the clocks in which the Verilog of a build, or of all programs of a library, renders its tables once.

    Raises
    ------
    NotABuild
        If the folder has no readable manifest.
    """
    from tablegen.verification.play.placement import Placement

    if is_library(folder):
        return sum(rendering_clocks(folder / program.name, axis) for program in read_index(folder).programs)
    stored, placement = read_build(folder), Placement(axis, fourier=True)
    tables = [
        (len(one.words), content.fourier.harmonics if placement.renders(one) else 0)
        for one, (_, content) in zip((stored.program.x, stored.program.y), stored.axes, strict=True)
    ]
    return placement.commit_clocks(*tables)


def _target(
    folder: Path,
    name: TargetName,
    simulator: Literal["icarus", "verilator"],
    axis: Literal["pipelined", "blocks", "serial", "alternate"],
    fourier: bool,
    as_usual: bool,
) -> tuple[Target, int]:
    """Return the target, and how many ticks it plays quickly; ``as_usual`` a long frame is played apart."""
    if name == "files":
        return FilesTarget(), DEFAULT_TICKS[name]
    if name != "verilog":
        from tablegen.verification.c.target import CTarget

        return CTarget(name, fourier), DEFAULT_TICKS[name]
    from tablegen.verification.play.placement import Placement
    from tablegen.verification.verilog.target import VerilogTarget
    from tablegen.verification.verilog.turned_play import USUAL_TICKS

    placement = Placement(axis, fourier)
    separate_frame = simulator == "icarus" and axis == "pipelined" and not fourier and as_usual
    tick_clocks = placement.playing(read_build(folder).program).tick_clocks
    of_z = USUAL_TICKS[simulator] if as_usual else None
    return VerilogTarget(simulator, placement, separate_frame, of_z), DEFAULT_TICKS[simulator] // tick_clocks


@contextmanager
def _work_folder(keep: Path | None) -> Iterator[Path]:
    """Yield the directory of the playback, which is removed at the end unless it is to be kept."""
    if keep is not None:
        keep.mkdir(parents=True, exist_ok=True)
        yield keep.resolve()
        return
    with tempfile.TemporaryDirectory(prefix="tablegen-", ignore_cleanup_errors=True) as folder:
        yield Path(folder).resolve()
