"""One program of a library, which a worker builds, certifies and writes into its folder."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tablegen.api.build import Build, build
from tablegen.base.input_errors import Rejected
from tablegen.base.interruption import ENDINGS, defer_signals
from tablegen.base.reading import holds
from tablegen.config.load import Setup
from tablegen.config.names import of_the_runtime
from tablegen.emit.render import plan_content
from tablegen.emit.write import leftover_files, outdated_files, write_files
from tablegen.library.entry import Entry, entry_file, make_entry
from tablegen.manifest.format import RECORD, read_json
from tablegen.sweeping.written_records import WrittenRecords


@dataclass(frozen=True)
class Job:
    """A program to build into ``folder``; with ``only_check`` nothing is written."""

    library: str
    setup: Setup
    settings: dict[str, Any]
    folder: Path
    formats: tuple[str, ...] | None
    inputs: str
    strict: bool
    only_check: bool


@dataclass(frozen=True)
class BuiltProgram:
    """The result of a job; ``different`` are the files that were written, or with ``only_check`` would be.

    With ``only_check``, ``leftovers`` are files that no sweep writes or removes, and ``memories`` the memory files that
    are on no disk, by name.
    """

    entry: Entry
    different: list[str]
    leftovers: list[str] = field(default_factory=list)
    memories: dict[str, bytes] = field(default_factory=dict)


class StrictWarnings(Exception):
    """A scan has warnings, which are errors with ``--strict``."""

    def __init__(self, warnings: Sequence[str]) -> None:
        self.warnings = list(warnings)
        super().__init__("\n".join(self.warnings))

    def __reduce__(self) -> tuple[type["StrictWarnings"], tuple[list[str]]]:
        return type(self), (self.warnings,)


def build_program(job: Job) -> BuiltProgram:
    """Build a program; an interruption waits until its files are in place.

    Raises
    ------
    Rejected
        If the scan cannot be built.
    BrokenLimit
        If the program breaks a limit of the scan file.
    StrictWarnings
        If it has warnings, with ``strict``.
    CannotWrite
        If its files cannot be written.
    """
    if job.setup.scan.z is not None:
        why = "a library plays no output z; build this scan alone, or leave [z] out"
        raise Rejected([job.setup.scan_file.problem("z", why)])
    built = build(job.setup, formats=job.formats)
    warnings = built.warnings
    if job.strict and warnings:
        raise StrictWarnings(warnings)
    runtime = built.runtime
    files = {name: text for name, text in built.files.items() if name not in runtime}
    entry = _entry(job, built, files)
    files[RECORD] = entry_file(entry)
    if job.only_check:
        return _compared(job, entry, files)
    with defer_signals(*ENDINGS) as came:
        changed = write_files(job.folder, files, lambda: outdated_files(job.folder, files))
        WrittenRecords().note(files[RECORD])
    if came:
        raise KeyboardInterrupt
    return BuiltProgram(entry, changed)


def _compared(job: Job, entry: Entry, files: dict[str, bytes]) -> BuiltProgram:
    """Compare the folder of a program with the files that a sweep would write and remove, as ``build --check`` does."""
    different = [name for name, text in files.items() if not holds(job.folder / name, text)]
    memories = {name: files[name] for name in different if name.endswith(".mem")}
    outdated = outdated_files(job.folder, files)
    try:
        present = {path.name for path in job.folder.iterdir() if of_the_runtime(path.name)}
    except OSError:
        present = set()
    leftovers = {*present, *leftover_files(job.folder, files)} - {*files, *outdated}
    return BuiltProgram(entry, [*different, *outdated], sorted(leftovers), memories)


def _entry(job: Job, built: Build, files: dict[str, bytes]) -> Entry:
    manifest = read_json(built.files["manifest.json"])
    content = plan_content(built.plan, built.certificates, manifest["hash"])
    errors = {
        axis: (manifest["axes"][axis]["certificate"]["max_error_lsb"], certificate.scaling_error_percent)
        for axis, certificate in built.certificates.items()
    }
    return make_entry(
        job.library,
        content,
        errors,
        settings=job.settings,
        formats=built.formats,
        warnings=built.warnings,
        inputs=job.inputs,
        files=files,
    )
