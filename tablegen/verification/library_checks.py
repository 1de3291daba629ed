"""The checks of a library's index that is played: in Verilog by ``dac_library``, in C by its array of programs."""

from collections.abc import Callable
from pathlib import Path
from typing import Literal

from tablegen.library.verilog_index import MODULE
from tablegen.manifest.read import StoredBuild
from tablegen.verification.checks.played_checks import Check
from tablegen.verification.library_report import IndexRecord
from tablegen.verification.play.library_session import MOST_TICKS


def library_checks(
    folder: Path,
    work: Path,
    record: IndexRecord,
    programs: list[StoredBuild],
    target: Literal["verilog", "c", "cortex-m", "files"],
    *,
    simulator: Literal["icarus", "verilator"],
    axis: Literal["pipelined", "blocks", "serial", "alternate"],
    fourier: bool,
    ticks: int | None,
    progress: Callable[[str], object],
) -> list[Check]:
    """Play the programs of the library in ``folder`` by its index, each from a pick on.

    Parameters
    ----------
    work
        Empty directory in which they are played.
    programs
        Builds of the programs, by number.
    target
        What plays them; nothing where the library has no index for it.
    simulator, axis, fourier
        How the Verilog is simulated and placed; of "pipelined" axes those with multiplier blocks play.
    ticks
        Most ticks after a pick, at most and by default ``MOST_TICKS``.

    Raises
    ------
    ToolMissing
        If a compiler or simulator is not installed.
    """
    most = MOST_TICKS if ticks is None else min(ticks, MOST_TICKS)
    name, count = record.library, len(programs)
    names, played = [program.name for program in record.programs], [program.program for program in programs]
    if target == "verilog" and MODULE in record.files:
        from tablegen.verification.play.placement import Placement
        from tablegen.verification.verilog.library_play import LibraryPlay

        harmonics = max(content.fourier.harmonics for stored in programs for _, content in stored.axes)
        rendered = fourier and f"{name}_library_fourier.mem" in record.files
        placement = Placement("blocks" if axis == "pipelined" else axis, rendered)
        progress(f"{simulator} picks each of {count} programs")
        play = LibraryPlay(name, names, played, harmonics, placement, most)
        return [play.check(folder, work, simulator)]
    if target == "c" and f"{name}_library.c" in record.files:
        from tablegen.verification.c.library_play import CLibraryPlay
        from tablegen.verification.c.program import library_choices

        progress(f"compiling and playing each of {count} programs")
        hashes = [stored.manifest.hash for stored in programs]
        return [CLibraryPlay(name, names, hashes, played, library_choices(programs), most).check(folder, work)]
    return []
