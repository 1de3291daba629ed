"""Verify a build of a scan at an angle: its files, its certificate, and what its C or its Verilog plays."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Literal

from tablegen.base.input_errors import shortened
from tablegen.base.reading import BUILD_FILE, read_bytes
from tablegen.device.dual_program import AxisProgram
from tablegen.emit.banner import different_files
from tablegen.emit.turned import turned_files, turned_options, turned_runtime
from tablegen.emit.turned_content import TurnedContent
from tablegen.fixedpoint.frame_program import FrameProgram, played_extremes
from tablegen.manifest.read import NotABuild
from tablegen.manifest.turned import StoredTurned, read_turned
from tablegen.verification.build_report import Report, Stopwatch, differing_check
from tablegen.verification.c.bench import require_compiler
from tablegen.verification.c.frame_play import frame_checks
from tablegen.verification.c.host import host_compiler
from tablegen.verification.checks.directory import copies, wrong_digests
from tablegen.verification.checks.played_checks import Check
from tablegen.verification.verilog.outputs import played_outputs
from tablegen.verification.verilog.simulate import require
from tablegen.verification.verilog.turned_play import USUAL_TICKS, TurnedPlay
from tablegen.version import __version__

_FRAMES = 2
_MOST_TICKS = {"c": 3_000_000, **USUAL_TICKS}  # unless they are given


def verify_turned(
    folder: Path,
    work: Path,
    target: Literal["verilog", "c", "cortex-m", "files"] | None,
    most_ticks: int | None,
    progress: Callable[[str | Callable[[], str]], None],
    *,
    simulator: Literal["icarus", "verilator"] = "icarus",
    other_version: bool = False,
) -> Report:
    """Verify the build of a scan at an angle in ``folder``.

    Parameters
    ----------
    work
        Empty directory in which the build is played.
    target
        "verilog", the default where the build has it; "c"; or "files", which plays nothing.
    most_ticks
        Bound of the ticks that are played; by default those of ``_MOST_TICKS``.
    simulator
        What plays the Verilog.
    other_version
        True to accept a build of another version, whose runtime cannot be compared with the installed one.

    Raises
    ------
    NotABuild
        If the folder holds no such build, or the target cannot play one.
    ToolMissing
        If a compiler or simulator is not installed.
    """
    stored = read_turned(folder)
    target = _target(folder, stored.manifest.formats, target)
    if target == "c":
        require_compiler(host_compiler())
    if target == "verilog":
        require(simulator)
    watch, manifest = Stopwatch(), stored.manifest
    progress("hashing the files")
    checks = watch.timed(_file_checks(folder, stored, other_version))
    progress("measuring the codes of a frame")
    checks += watch.timed([_code_check(stored)])
    notes: list[str] = []
    difference = None
    if target != "files":
        schedule = manifest.sequence.schedule
        whole = schedule.frame_ticks
        session = _FRAMES * whole if target == "c" else whole + schedule.ticks
        ticks = min(
            session, _MOST_TICKS[simulator if target == "verilog" else target] if most_ticks is None else most_ticks
        )
        if ticks < whole:
            notes.append(f"{ticks} of the {whole} ticks of a frame were played; --ticks {whole} plays them all")
        if target == "c":
            progress("compiling the C, and playing it")
            played, difference = _played_checks(folder, work, stored, ticks)
        else:
            progress(f"{simulator} plays {ticks} ticks")
            content = _content_of(stored)
            outputs = played_outputs(manifest.formats)
            played = TurnedPlay(content, ticks, outputs=outputs).checks(folder, work / "verilog", simulator)
            if (of_z := content.content_of_z) is not None:
                progress(f"{simulator} plays {ticks} ticks of z")
                played += TurnedPlay(of_z, ticks, ", z").checks(folder, work / "verilog_z", simulator)
        checks += watch.timed(played)
    return Report(manifest.name, checks, difference, notes, watch.seconds)


def _target(folder: Path, formats: Sequence[str], target: str | None) -> Literal["c", "verilog", "files"]:
    """Return what plays a build of these formats.

    Raises
    ------
    NotABuild
        If the target cannot play it.
    """
    if target == "files":
        return "files"
    if target is None:
        return "verilog" if "verilog" in formats else "c"
    if target == "cortex-m":
        raise NotABuild(f"{folder}: is a scan at an angle, which no emulator plays; verify it with another --target")
    if target not in formats:
        raise NotABuild(
            f"{folder}: this build has the formats {', '.join(formats)}, and no {target}; verify it with another "
            f"--target, or build it with --format {target}"
        )
    return "verilog" if target == "verilog" else "c"


def _content_of(stored: StoredTurned) -> TurnedContent:
    manifest = stored.manifest
    return TurnedContent(
        manifest.name,
        manifest.hash,
        stored.program,
        manifest.tablegen,
        clocks_per_tick=manifest.clocks_per_tick,
        z=stored.z,
    )


def _file_checks(folder: Path, stored: StoredTurned, other_version: bool) -> list[Check]:
    manifest = stored.manifest
    edited = None
    if stored.own_hash != manifest.hash:
        edited = "manifest: edited: its plan does not match its hash; build it again"
    checks = [Check("manifest", "its own hash", "1 plan", failure=edited)]
    wrong = wrong_digests(folder, manifest.files)
    checks.append(differing_check("files", "SHA-256 in the manifest", f"{len(manifest.files)} files", wrong))
    own: dict[str, bytes] = {}
    for each in manifest.formats:
        files = turned_files(_content_of(stored), [each])
        different = different_files(folder, files)
        checks.append(differing_check(f"{each} files", "manifest", f"{len(files)} files", different))
        own |= files
    if manifest.tablegen == __version__:
        runtime = turned_runtime(manifest.formats)
        unlike = [f"{name}: is not that of tablegen" for name in runtime if _content(folder / name) != runtime[name]]
        unlike += [f"{name}: is not listed" for name in (*own, *runtime) if name not in manifest.files]
        checks.append(differing_check("files", f"tablegen {__version__}", f"{len(runtime)} files", unlike))
    elif not other_version:
        why = (
            f"files: built by tablegen {shortened(manifest.tablegen)}, and this is {__version__}: its runtime cannot "
            "be compared with the installed one; build it again, or use --other-version"
        )
        checks.append(Check("files", f"tablegen {__version__}", "0 files", failure=why))
    return checks


def _content(path: Path) -> bytes | None:
    try:
        return read_bytes(path, BUILD_FILE)
    except OSError:
        return None


def _code_check(stored: StoredTurned) -> Check:
    """Check that no code of a frame is clamped, and no step held back."""
    wrong = []
    axes: list[tuple[Literal["x", "y", "z", "aux"], AxisProgram]] = [("x", stored.program.x), ("y", stored.program.y)]
    if stored.z is not None:
        axes += zip(stored.manifest.turned.tilts, (stored.z.x, stored.z.y), strict=False)  # y rests without aux
    for name, axis in axes:
        assert isinstance(axis, FrameProgram)
        least, most, steepest = played_extremes(axis)
        output = axis.output
        if least < output.code_min or most > output.code_max:
            wrong.append(f"{name}: codes {least}..{most} leave {output.code_min}..{output.code_max}")
        if steepest > output.max_step:
            wrong.append(f"{name}: a step of {steepest} codes is above the limit of {output.max_step}")
        certified = stored.certified(name)
        if certified is not None and certified != (least, most, steepest):
            wrong.append(f"{name}: codes {least}..{most}, steps of {steepest}; the certificate has {certified}")
    count = len(axes) * stored.program.schedule.frame_ticks
    return differing_check("codes", "limits, certificate", f"{count} codes", wrong)


def _played_checks(folder: Path, work: Path, stored: StoredTurned, ticks: int) -> tuple[list[Check], str | None]:
    """Play some frames and a park, a tick a call and many ticks a call, and compare every tick with the model."""
    name = stored.manifest.name
    names = [each for each in stored.manifest.files if each.endswith((".c", ".h")) and not each.startswith("dac_link")]
    names = [each for each in names if not each.startswith("dac_store")]
    files, missing = copies(folder, sorted({*names, f"{name}.h", f"{name}.c", f"{name}_program.c"}), work / "c")
    if missing:
        return [Check("c", "the model", "0 ticks", failure=f"c: {'; '.join(missing)}")], None
    content = _content_of(stored)
    checks, differences = [], []
    for label, each in (("c", content), ("c, z", content.content_of_z)):
        if each is not None:
            options = turned_options(stored.program, stored.z)
            played, difference = frame_checks(label, each.name, each.program, files, options, work, ticks)
            checks += played
            differences.append(difference)
    return checks, next(filter(None, differences), None)
