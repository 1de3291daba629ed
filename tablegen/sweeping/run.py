"""A sweep: the programs that are up to date, the results of the others, and the index of the existing ones."""

from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np

from tablegen.api.build import BrokenLimit
from tablegen.api.result import Result
from tablegen.base.input_errors import Problem, Rejected
from tablegen.base.interruption import ENDINGS, defer_signals
from tablegen.base.reading import BUILD_FILE, file_sha256, holds, read_bytes
from tablegen.base.workers import results
from tablegen.charts.picture_file import PlottedCharts
from tablegen.config.names import of_the_runtime
from tablegen.config.variants import Variant
from tablegen.emit.formats import UnknownFormat
from tablegen.emit.write import CannotWrite, names_of_build, remove_files, write_files
from tablegen.library.entry import Entry, changed_files, is_whole, parse_entry, read_record
from tablegen.library.index import is_indexed, listed_files, make_index
from tablegen.manifest.format import INDEX, MANIFEST, RECORD
from tablegen.manifest.read import NotABuild, StoredBuild, read_build
from tablegen.planning.sine_setup import default_formats
from tablegen.sweeping.inputs import Inputs
from tablegen.sweeping.job import BuiltProgram, Job, StrictWarnings, build_program
from tablegen.sweeping.written_records import WrittenRecords

_SHOWN = 20  # scans with the same reason, by name
Kind = Literal["wrong input", "limit", "error"]


@dataclass(frozen=True)
class Failed:
    """A scan that could not be built, and why."""

    variant: Variant
    kind: Kind
    reasons: list[str]


@dataclass(repr=False)
class ScanLibrary(Result):
    """The scans of a library, and the result of each."""

    library: str
    variants: list[Variant]
    folder: Path
    entries: dict[str, Entry] = field(default_factory=dict)
    """Existing programs, by name."""
    built: list[str] = field(default_factory=list)
    current: list[str] = field(default_factory=list)
    """Names of programs that were up to date."""
    failed: list[Failed] = field(default_factory=list)
    different: list[str] = field(default_factory=list)
    """With ``only_check``: paths that a sweep would write or remove, below ``folder``."""
    notes: list[str] = field(default_factory=list)
    removed: list[str] = field(default_factory=list)
    """Programs of an earlier sweep that are not in this one."""
    memories: dict[tuple[str, str], bytes] = field(default_factory=dict)
    """With ``only_check``: memory files that are on no disk, by program and name."""

    @property
    def done(self) -> int:
        """The number of scans that have a result."""
        return len(self.built) + len(self.current) + len(self.failed)

    @property
    def in_order(self) -> list[Entry]:
        """The existing programs, as the index numbers them."""
        return [self.entries[variant.name] for variant in self.variants if variant.name in self.entries]

    @property
    def record(self) -> dict[str, Any]:
        """Names of the scans by result, and the reasons of those that failed."""
        failed = [{"name": one.variant.name, "kind": one.kind, "reasons": one.reasons} for one in self.failed]
        return {
            "library": self.library,
            "folder": str(self.folder),
            "scans": [variant.name for variant in self.variants],
            "built": self.built,
            "current": self.current,
            "failed": failed,
            "removed": self.removed,
            "different": self.different,
            "notes": self.notes,
        }

    def verdict(self) -> str:
        """Return the results of the scans in one line, as ``tablegen sweep`` prints it."""
        count, failed = len(self.variants), len(self.failed)
        parts = [f"{len(self.built)} built"] * bool(self.built)
        parts += [f"{len(self.current)} up to date"] * bool(self.current)
        parts += [f"{failed} failed"] * bool(failed) + [f"{len(self.removed)} removed"] * bool(self.removed)
        return f"{self.folder}: {count} scan{'s' if count != 1 else ''}: {', '.join(parts)}"

    def remarks(self) -> list[str]:
        """Return warnings, the reasons of scans that failed, and notes, as ``tablegen sweep`` prints them."""
        warnings = [f"warning: {entry.name}: {text}" for entry in self.in_order for text in entry.warnings]
        return [*warnings, *self._reasons(), *(f"note: {note}" for note in self.notes)]

    def _reasons(self) -> list[str]:
        """Return each reason once, with the scans to which it applies."""
        by_reason: dict[str, list[str]] = {}
        for failed in self.failed:
            by_reason.setdefault("\n".join(failed.reasons), []).append(failed.variant.name)
        lines = []
        for reason, names in by_reason.items():
            more = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
            lines.append(f"failed: {', '.join(names[:_SHOWN])}{more}:\n  " + reason.replace("\n", "\n  "))
        return lines

    def summary(self) -> str:
        """Return what ``tablegen sweep`` prints."""
        return "\n".join([*self.remarks(), self.verdict()])

    def charts(self) -> PlottedCharts:
        """Return the largest scaling error of each program, in the order of the index."""
        from tablegen.charts.chart import Chart, DrawnCurve

        errors = [max(axis.scaling_error_percent for axis in entry.axes) for entry in self.in_order]
        numbers = np.arange(float(len(errors)))
        curve = DrawnCurve("", "before", numbers, np.array(errors), "points")
        chart = Chart("scaling", "scaling error of each program", "program [number]", "scaling error [%]", (curve,))
        return PlottedCharts(self.library, (chart,))

    def _lines(self) -> Sequence[str]:
        names = ", ".join(variant.name for variant in self.variants[:4])
        more = f" and {len(self.variants) - 4} more" if len(self.variants) > 4 else ""
        return f"library {self.library!r}", self.verdict(), names + more


def state(
    sweep: ScanLibrary, variant: Variant, formats: Sequence[str] | None, inputs: Inputs, written: WrittenRecords
) -> Entry | tuple[Any, str]:
    """Return the entry of a program that is up to date; otherwise the setup to build, and the digest of its inputs.

    Its record must have been written by a sweep of this user, whatever else is in the directory.

    Raises
    ------
    Rejected
        If the setup of the scan is faulty.
    """
    setup, digest = _inputs(variant, formats, inputs)
    folder = sweep.folder / variant.name
    record = read_record(folder)
    entry = parse_entry(record, folder)
    if entry is None or record is None or entry.library != sweep.library or entry.inputs != digest:
        return setup, digest
    return entry if record in written and is_whole(folder, entry) else (setup, digest)


def _inputs(variant: Variant, formats: Sequence[str] | None, inputs: Inputs) -> tuple[Any, str]:
    """Load the setup of a scan, and compute the digest of its inputs."""
    setup = variant.setup
    names = list(formats or default_formats(setup.scan))
    try:
        return setup, inputs.digest(setup, variant.values, names)
    except UnknownFormat as error:
        raise Rejected([Problem("formats", 0, "", str(error))]) from None
    except OSError:
        return setup, ""  # the build reports the error


def run(
    sweep: ScanLibrary,
    *,
    formats: Sequence[str] | None = None,
    jobs: int,
    strict: bool = False,
    only_check: bool = False,
    progress: Callable[[int, int], object] = lambda _count, _total: None,
) -> None:
    """Build programs that are missing or outdated, and write the index.

    ``progress`` is called with the number of finished scans and that of all. With ``only_check`` every program is built
    again and compared, whatever the directory contains. However a sweep ends, finished programs stay; the index
    exists only if all programs that it lists are as it says.

    Raises
    ------
    CannotWrite
        If the directory cannot be written.
    """
    pending: list[Variant] = []
    before = listed_files(sweep.folder)
    inputs, written = Inputs(), WrittenRecords()

    def tasks() -> Iterator[tuple[Job]]:
        for variant in sweep.variants:
            try:
                if only_check:
                    state_or_result: Entry | tuple[Any, str] = _inputs(variant, formats, inputs)
                else:
                    state_or_result = state(sweep, variant, formats, inputs, written)
            except Rejected as rejected:
                sweep.failed.append(Failed(variant, "wrong input", list(map(str, rejected.problems))))
                continue
            if isinstance(state_or_result, Entry):
                _current(sweep, variant, state_or_result, strict)
                progress(sweep.done, len(sweep.variants))
                continue
            setup, digest = state_or_result
            if not pending and not only_check:
                _remove_index(sweep.folder, before)
            pending.append(variant)
            requested = None if formats is None else tuple(formats)
            folder = sweep.folder / variant.name
            yield (Job(sweep.library, setup, variant.settings, folder, requested, digest, strict, only_check),)

    progress(0, len(sweep.variants))
    for number, state_or_result in results(build_program, tasks(), jobs):
        _note(sweep, pending[number], state_or_result, only_check)
        progress(sweep.done, len(sweep.variants))
    _finish(sweep, before, only_check)
    written.prune()


def _current(sweep: ScanLibrary, variant: Variant, entry: Entry, strict: bool) -> None:
    if strict and entry.warnings:
        sweep.failed.append(Failed(variant, "limit", entry.warnings))
        return
    sweep.entries[variant.name] = entry
    sweep.current.append(variant.name)


def _note(sweep: ScanLibrary, variant: Variant, result: "BuiltProgram | Exception", only_check: bool) -> None:
    """Note the result of a worker for a program."""
    match result:
        case BuiltProgram():
            sweep.entries[variant.name] = result.entry
            (sweep.built if result.different else sweep.current).append(variant.name)
            if only_check:
                sweep.different += [f"{variant.name}/{name}" for name in result.different]
                _note_leftovers(sweep, [f"{variant.name}/{name}" for name in result.leftovers], only_check)
                sweep.memories |= {(variant.name, name): text for name, text in result.memories.items()}
        case CannotWrite():
            raise result
        case StrictWarnings():
            sweep.failed.append(Failed(variant, "limit", result.warnings))
        case Rejected():
            kind: Kind = "limit" if isinstance(result, BrokenLimit) else "wrong input"
            sweep.failed.append(Failed(variant, kind, list(map(str, result.problems))))
        case Exception():
            sweep.failed.append(Failed(variant, "error", [f"{type(result).__name__}: {result}"]))


def _note_leftovers(sweep: ScanLibrary, names: Sequence[str], only_check: bool) -> None:
    """Note files that no sweep writes or removes, which a compiler with a file pattern would read."""
    sweep.notes += [f"{sweep.folder / name}: is not of this library; remove it" for name in names]
    if only_check:
        sweep.different += names


def _finish(sweep: ScanLibrary, before: dict[str, str], only_check: bool) -> None:
    """Write the index and the runtime, and remove the rest of an earlier sweep; or list what would change."""
    order = {variant.name: number for number, variant in enumerate(sweep.variants)}
    sweep.failed.sort(key=lambda failed: order[failed.variant.name])
    entries = sweep.in_order
    formats = list(dict.fromkeys(name for entry in entries for name in entry.formats))
    failed = [
        {"name": one.variant.name, "settings": one.variant.settings, "reasons": one.reasons} for one in sweep.failed
    ]

    def content(program: str, name: str) -> bytes:
        memory = sweep.memories.get((program, name))
        return read_bytes(sweep.folder / program / name, BUILD_FILE) if memory is None else memory

    index = make_index(sweep.library, entries, failed, formats, content)
    sweep.notes += index.notes
    outdated = [name for name, digest in before.items() if name not in index.files]
    outdated = [name for name in outdated if _digest(sweep.folder / name) == before[name]]
    dropped, others = _dropped(sweep)
    if only_check:
        sweep.different += [name for name, text in index.files.items() if not holds(sweep.folder / name, text)]
        sweep.different += [*outdated, *(f"{entry.name}/{RECORD}" for entry in dropped)]
    _note_leftovers(sweep, [*others, *_unlisted(sweep, {*index.files, *outdated})], only_check)
    if only_check:
        return
    for entry in dropped:
        _remove_program(sweep, entry)
    with defer_signals(*ENDINGS) as came:
        write_files(sweep.folder, index.files, outdated)
    if came:
        raise KeyboardInterrupt


def _remove_index(folder: Path, listed: dict[str, str]) -> None:
    """Remove the index of an earlier sweep, but not the runtime: its programs are about to change."""
    for name in (INDEX, *(name for name in listed if "_library" in name)):
        with suppress(FileNotFoundError):
            (folder / name).unlink()


def _dropped(sweep: ScanLibrary) -> tuple[list[Entry], list[str]]:
    """Return programs in the directory that are not among the scans: those of this library, and the folders of others.

    Folders without a build are ignored.
    """
    names = {variant.name for variant in sweep.variants}
    try:
        folders = sorted(path for path in sweep.folder.iterdir() if path.name not in names and path.is_dir())
    except OSError:
        return [], []
    dropped, others = [], []
    for path in folders:
        entry, stored = parse_entry(read_record(path), path), _stored(path)
        if entry is not None and _is_of(sweep, path, entry, stored):
            dropped.append(entry)
        elif stored is not None or (path / RECORD).is_file():
            others.append(path.name)
    return dropped, others


def _is_of(sweep: ScanLibrary, folder: Path, entry: Entry, stored: StoredBuild | None) -> bool:
    """Return true if a sweep of this library built a folder: its manifest is ours and that of the plan in the record.

    Links are not followed: their targets are outside the directory.
    """
    if stored is None or entry.library != sweep.library or folder.is_symlink():
        return False
    return stored.own_hash == stored.manifest.hash == entry.hash and stored.manifest.name == entry.name


def _stored(folder: Path) -> StoredBuild | None:
    try:
        return read_build(folder)
    except NotABuild:
        return None


def _unlisted(sweep: ScanLibrary, files: Collection[str]) -> list[str]:
    """Return files with a name of this library's index or of the runtime that are not in ``files``."""
    try:
        present = sorted(path.name for path in sweep.folder.iterdir() if path.is_file() and path.name not in files)
    except OSError:
        return []
    alike = (name for name in present if name.startswith(f"{sweep.library}_library") or of_the_runtime(name))
    return [name for name in alike if is_indexed(name)]


def _remove_program(sweep: ScanLibrary, entry: Entry) -> None:
    folder = sweep.folder / entry.name
    edited = changed_files(folder, entry)
    own = {MANIFEST, *names_of_build(entry.name, entry.files)}
    remove_files(folder, [*(name for name in entry.files if name in own and name not in edited), RECORD])
    try:
        folder.rmdir()
    except OSError:
        sweep.notes.append(f"{folder}: left over from an earlier sweep, and has other files or edited ones; remove it")
        return
    sweep.removed.append(entry.name)


def _digest(path: Path) -> str | None:
    try:
        return file_sha256(path)
    except OSError:
        return None
