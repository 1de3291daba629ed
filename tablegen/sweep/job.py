"""One program of a library: built, certified, and written into its folder, in a worker."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tablegen.api.build import Build, build
from tablegen.config.load import Setup
from tablegen.emit.render import plan_content
from tablegen.emit.write import outdated_files, write_files
from tablegen.interruption import ENDINGS, held
from tablegen.library.entry import Entry, entry_file, make_entry
from tablegen.manifest.format import RECORD, read_json
from tablegen.reading import holds


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
class Made:
    """What became of it; ``different`` are the files that were written, or with ``only_check`` would be."""

    entry: Entry
    different: list[str]


class Doubtful(Exception):
    """A scan has warnings, which are errors with ``--strict``."""

    def __init__(self, warnings: Sequence[str]) -> None:
        self.warnings = list(warnings)
        super().__init__("\n".join(self.warnings))

    def __reduce__(self) -> tuple[type["Doubtful"], tuple[list[str]]]:
        return type(self), (self.warnings,)


def make(job: Job) -> Made:
    """Build a program. Raises ``Rejected``, ``BrokenLimit``, ``Doubtful`` or ``CannotWrite``.

    An interruption waits until its files are in place.
    """
    built = build(job.setup, formats=job.formats)
    warnings = built.warnings
    if job.strict and warnings:
        raise Doubtful(warnings)
    runtime = built.runtime
    files = {name: text for name, text in built.files.items() if name not in runtime}
    entry = _entry(job, built, files)
    record = entry_file(entry)
    if job.only_check:
        return Made(entry, [name for name, text in files.items() if not holds(job.folder / name, text)])
    with held(*ENDINGS) as came:
        changed = write_files(job.folder, {RECORD: record, **files}, lambda: _outdated(job.folder, files))
    if came:
        raise KeyboardInterrupt
    return Made(entry, changed)


def _outdated(folder: Path, files: dict[str, bytes]) -> list[str]:
    return outdated_files(folder, {*files, RECORD})


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
