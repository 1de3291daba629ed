"""A sweep: which programs are up to date, what becomes of the others, and the index of those that are there."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from tablegen.api.build import BrokenLimit
from tablegen.api.workers import results
from tablegen.config.schema import DEFAULT_FORMATS
from tablegen.config.variants import Variant
from tablegen.emit.formats import UnknownFormat
from tablegen.emit.write import CannotWrite, write_files
from tablegen.interruption import ENDINGS, held
from tablegen.library.entry import Entry, changed_files, is_whole, read_entry
from tablegen.library.index import listed_files, make_index
from tablegen.manifest.format import INDEX, RECORD
from tablegen.problems import Problem, Rejected
from tablegen.reading import file_sha256, holds
from tablegen.sweep.inputs import Inputs
from tablegen.sweep.job import Doubtful, Job, Made, make

Kind = Literal["wrong input", "limit", "error"]


@dataclass(frozen=True)
class Failed:
    """A scan that could not be built, and why."""

    variant: Variant
    kind: Kind
    reasons: list[str]


@dataclass
class ScanLibrary:
    """The scans of a library, and what became of them."""

    library: str
    variants: list[Variant]
    folder: Path
    entries: dict[str, Entry] = field(default_factory=dict)
    """What can be played, by name."""
    built: list[str] = field(default_factory=list)
    current: list[str] = field(default_factory=list)
    """What was up to date."""
    failed: list[Failed] = field(default_factory=list)
    different: list[str] = field(default_factory=list)
    """With ``only_check``: paths that a sweep would write or remove, below ``folder``."""
    notes: list[str] = field(default_factory=list)
    removed: list[str] = field(default_factory=list)
    """Programs of an earlier sweep that nobody asked for now."""

    @property
    def done(self) -> int:
        """How many scans are dealt with."""
        return len(self.built) + len(self.current) + len(self.failed)

    @property
    def in_order(self) -> list[Entry]:
        """What can be played, as the index numbers it."""
        return [self.entries[variant.name] for variant in self.variants if variant.name in self.entries]


def state(
    sweep: ScanLibrary, variant: Variant, formats: Sequence[str] | None, inputs: Inputs
) -> Entry | tuple[Any, str]:
    """The entry of a program that is up to date; otherwise the setup to build, and the digest of its inputs.

    Raises ``Rejected``.
    """
    setup = variant.setup
    wanted = list(formats or setup.scan.emit.formats or DEFAULT_FORMATS)
    try:
        digest = inputs.digest(setup, variant.values, wanted)
    except UnknownFormat as error:
        raise Rejected([Problem("formats", 0, "", str(error))]) from None
    except OSError:
        return setup, ""  # the build says what is wrong
    folder = sweep.folder / variant.name
    entry = read_entry(folder)
    if entry is not None and entry.inputs == digest and is_whole(folder, entry):
        return entry
    return setup, digest


def run(
    sweep: ScanLibrary,
    *,
    formats: Sequence[str] | None = None,
    jobs: int,
    strict: bool = False,
    only_check: bool = False,
    progress: Callable[[int, int], object] = lambda _done, _all: None,
) -> None:
    """Build what is missing or has changed, and write the index. ``progress`` is told how many of all are done.

    Raises ``CannotWrite`` where the directory cannot be written. Whatever ends it, programs that were built stay,
    and no index: it exists only where all programs that it lists are as it says.
    """
    pending: list[Variant] = []
    before = listed_files(sweep.folder)
    inputs = Inputs()

    def tasks() -> Iterator[tuple[Job]]:
        for variant in sweep.variants:
            try:
                found = state(sweep, variant, formats, inputs)
            except Rejected as rejected:
                sweep.failed.append(Failed(variant, "wrong input", list(map(str, rejected.problems))))
                continue
            if isinstance(found, Entry):
                _current(sweep, variant, found, strict)
                progress(sweep.done, len(sweep.variants))
                continue
            setup, digest = found
            if not pending and not only_check:
                _remove_index(sweep.folder, before)
            pending.append(variant)
            chosen = None if formats is None else tuple(formats)
            folder = sweep.folder / variant.name
            yield (Job(sweep.library, setup, variant.settings, folder, chosen, digest, strict, only_check),)

    progress(0, len(sweep.variants))
    for number, found in results(make, tasks(), jobs):
        _note(sweep, pending[number], found, only_check)
        progress(sweep.done, len(sweep.variants))
    _finish(sweep, before, only_check)


def _current(sweep: ScanLibrary, variant: Variant, entry: Entry, strict: bool) -> None:
    if strict and entry.warnings:
        sweep.failed.append(Failed(variant, "limit", entry.warnings))
        return
    sweep.entries[variant.name] = entry
    sweep.current.append(variant.name)


def _note(sweep: ScanLibrary, variant: Variant, found: "Made | Exception", only_check: bool) -> None:
    """What a worker has said of a program."""
    match found:
        case Made():
            sweep.entries[variant.name] = found.entry
            (sweep.built if found.different or not only_check else sweep.current).append(variant.name)
            if only_check:
                sweep.different += [f"{variant.name}/{name}" for name in found.different]
        case CannotWrite():
            raise found
        case Doubtful():
            sweep.failed.append(Failed(variant, "limit", found.warnings))
        case Rejected():
            kind: Kind = "limit" if isinstance(found, BrokenLimit) else "wrong input"
            sweep.failed.append(Failed(variant, kind, list(map(str, found.problems))))
        case Exception():
            sweep.failed.append(Failed(variant, "error", [f"{type(found).__name__}: {found}"]))


def _finish(sweep: ScanLibrary, before: dict[str, str], only_check: bool) -> None:
    """Write the index and the runtime, and remove what an earlier sweep has left; or say what would be."""
    order = {variant.name: number for number, variant in enumerate(sweep.variants)}
    sweep.failed.sort(key=lambda failed: order[failed.variant.name])
    entries = sweep.in_order
    formats = list(dict.fromkeys(name for entry in entries for name in entry.formats))
    failed = [
        {"name": one.variant.name, "settings": one.variant.settings, "reasons": one.reasons} for one in sweep.failed
    ]
    index = make_index(sweep.library, entries, failed, formats, sweep.folder)
    sweep.notes += index.notes
    outdated = [name for name, digest in before.items() if name not in index.files]
    outdated = [name for name in outdated if _digest(sweep.folder / name) == before[name]]
    if only_check:
        sweep.different += [name for name, text in index.files.items() if not holds(sweep.folder / name, text)]
        sweep.different += [*outdated, *(f"{entry.name}/{RECORD}" for entry in _dropped(sweep))]
        return
    for entry in _dropped(sweep):
        _remove_program(sweep, entry)
    with held(*ENDINGS) as came:
        write_files(sweep.folder, index.files, outdated)
    if came:
        raise KeyboardInterrupt


def _remove_index(folder: Path, listed: dict[str, str]) -> None:
    """Remove the index of an earlier sweep, but not the runtime: its programs are about to change."""
    for name in (INDEX, *(name for name in listed if "_library" in name)):
        with suppress(FileNotFoundError):
            (folder / name).unlink()


def _dropped(sweep: ScanLibrary) -> list[Entry]:
    """Programs of this library in its directory that are not among the scans."""
    wanted = {variant.name for variant in sweep.variants}
    try:
        folders = sorted(path for path in sweep.folder.iterdir() if path.name not in wanted and path.is_dir())
    except OSError:
        return []
    found = [(path.name, read_entry(path)) for path in folders]
    return [
        entry for name, entry in found if entry is not None and entry.library == sweep.library and entry.name == name
    ]


def _remove_program(sweep: ScanLibrary, entry: Entry) -> None:
    folder = sweep.folder / entry.name
    edited = changed_files(folder, entry)
    for name in [*(name for name in entry.files if name not in edited), RECORD]:
        if name == Path(name).name:
            (folder / name).unlink(missing_ok=True)
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
