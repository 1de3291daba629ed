"""Verify a library: its programs, each as a build, and its index against them."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
from msgspec import Struct

from tablegen.base.input_errors import Unphysical, shortened
from tablegen.base.reading import BUILD_FILE, read_bytes
from tablegen.config.names import why_not_a_name
from tablegen.emit.formats import UnknownFormat
from tablegen.emit.stored import stored_content
from tablegen.library.entry import Entry, changed_files, make_entry, parse_entry, read_record
from tablegen.library.index import Index, make_index
from tablegen.library.verilog_index import MODULE
from tablegen.manifest.fields import Digest, FileName
from tablegen.manifest.format import INDEX, MANIFEST, RECORD, read_json
from tablegen.manifest.read import NotABuild, StoredBuild, read_build
from tablegen.verification.build_report import Report, Stopwatch, differing_check
from tablegen.verification.checks.played_checks import Check
from tablegen.version import __version__

_REMEDY = "write the library again with `tablegen sweep`"


class IndexedProgram(Struct, frozen=True):
    """A program as the index shows it; the rest of it is compared as text."""

    number: int
    name: str


class IndexRecord(Struct, frozen=True):
    """The content of ``library.json``."""

    tablegen: str
    library: str
    formats: list[str]
    notes: list[str]
    files: dict[FileName, Digest]
    programs: list[IndexedProgram]
    failed: list[dict[str, Any]]


def is_library(folder: Path) -> bool:
    """Return True if a directory holds the index of a library, and no build."""
    return (folder / INDEX).is_file() and not (folder / MANIFEST).exists()


def read_index(folder: Path) -> IndexRecord:
    """Read the index of a library.

    Raises
    ------
    NotABuild
        If it cannot be read, or no sweep writes such an index.
    """
    path = folder / INDEX
    try:
        record = msgspec.convert(read_json(read_bytes(path, BUILD_FILE)), IndexRecord)
    except OSError as error:
        raise NotABuild(f"{path}: cannot be read: {error.strerror or error}; {_REMEDY}") from None
    except (ValueError, RecursionError) as error:  # a ValidationError is a ValueError
        raise NotABuild(f"{path}: is damaged: {shortened(str(error))}; {_REMEDY}") from None
    if not record.programs:
        raise NotABuild(f"{path}: has no program; {_REMEDY}")
    names = [record.library, *(program.name for program in record.programs)]
    for name in names:
        if (why := why_not_a_name(name)) is not None:
            raise NotABuild(f"{path}: is damaged: {shortened(name)}: {why}; {_REMEDY}")
    return record


PlayIndex = Callable[[IndexRecord, list[StoredBuild]], list[Check]]
"""What plays the programs of a library by its index: their builds, by number."""


def verify_library(folder: Path, verify_program: Callable[[Path], Report], play_index: PlayIndex) -> Report:
    """Verify every program of the library in ``folder`` as a build, and the index against the programs.

    Parameters
    ----------
    verify_program
        Verifies the build in a directory.
    play_index
        Plays the programs by the index; not called where one of them is damaged.

    Raises
    ------
    NotABuild
        If the index is damaged, or a program cannot be played on the target.
    ToolMissing
        If a compiler or simulator is not installed.
    """
    record, watch = read_index(folder), Stopwatch()
    checks: list[Check] = []
    notes, differences, stored = [], [], {}
    unplayed: list[list[str]] = []
    for program in record.programs:
        try:
            stored[program.name] = read_build(folder / program.name)
        except NotABuild as error:
            checks.append(Check(program.name, "its manifest", "0 files", failure=str(error)))
            continue
        report = verify_program(folder / program.name)
        checks += [_of_program(program.name, check) for check in report.checks]
        notes += [f"{program.name}: {note}" for note in report.notes]
        unplayed.append(report.unplayed)
        differences += [] if report.difference is None else [f"{program.name}: {report.difference}"]
    watch.timed([])
    checks += watch.timed(_index_checks(folder, record, stored))
    played: list[Check] = []
    if len(stored) == len(record.programs):
        played = play_index(record, [stored[program.name] for program in record.programs])
        checks += watch.timed(played) if played else []
    notes += [f"{path.name}: not in the index, and not verified" for path in _unindexed(folder, record)]
    difference = next(iter(differences), None)
    return Report(record.library, checks, difference, notes, watch.seconds, _unplayed(record, unplayed, played))


def _unplayed(record: IndexRecord, unplayed: list[list[str]], played: list[Check]) -> list[str]:
    """List what no program has played, of the runtime once, and the files of the programs and of the index."""
    own = tuple(f"{program.name}_" for program in record.programs)
    parts = dict.fromkeys(part for parts in unplayed for part in parts)
    listed = [part for part in parts if part.startswith(own) or all(part in each for each in unplayed)]
    subjects = {check.subject for check in played}
    source = MODULE if any(".v" in part for part in listed) else f"{record.library}_library.c"
    index = [source] if listed and source in record.files and f"library {source}" not in subjects else []
    return [*index, *listed]


def _of_program(name: str, check: Check) -> Check:
    failure = None if check.failure is None else f"{name}: {check.failure}"
    return replace(check, subject=f"{name}: {check.subject}", failure=failure)


def _index_checks(folder: Path, record: IndexRecord, stored: dict[str, StoredBuild]) -> list[Check]:
    """Compare the records of the programs with their manifests, and the index with what a sweep writes of both."""
    entries: list[Entry] = []
    wrong: list[str] = []
    for program in record.programs:
        entry = parse_entry(read_record(folder / program.name), folder / program.name)
        if entry is None:
            wrong.append(f"{program.name}/{RECORD}: is missing or damaged; {_REMEDY}")
        elif program.name in stored:
            entries.append(entry)
            wrong += _wrong_entry(folder, record.library, entry, stored[program.name])
    numbers = [program.number for program in record.programs]
    if numbers != list(range(len(numbers))):
        wrong.append(f"{INDEX}: its programs have other numbers than 0 to {len(numbers) - 1}; {_REMEDY}")
    checks = [differing_check("library records", "manifests", f"{len(record.programs)} programs", wrong)]
    if wrong or len(entries) != len(record.programs):
        why = f"library index: was not compared, since a program of it is damaged; {_REMEDY}"
        return [*checks, Check("library index", "programs", "0 files", failure=why)]
    try:
        index = make_index(
            record.library,
            entries,
            record.failed,
            record.formats,
            lambda program, name: read_bytes(folder / program / name, BUILD_FILE),
        )
    except (OSError, ValueError, OverflowError, Unphysical) as error:  # UnknownFormat is a ValueError
        why = f"library index: cannot be made again: {shortened(str(error))}"
        if not isinstance(error, UnknownFormat):
            why += f"; {_REMEDY}"
        return [*checks, Check("library index", "programs", "0 files", failure=why)]
    count, differing = _wrong_index(folder, record, index, entries)
    return [*checks, differing_check("library index", "programs", f"{count} files", differing)]


def _wrong_entry(folder: Path, library: str, entry: Entry, stored: StoredBuild) -> list[str]:
    """List what a record has otherwise than the manifest and the files of its program."""
    errors = {}
    for axis, content in (("x", entry.x), ("y", entry.y)):
        certificate = getattr(stored.manifest.axes, axis).certificate
        errors[axis] = (certificate.max_error_lsb, content.scaling_error_percent)
    # Of the formats by default a manifest does not keep the order.
    same_formats = sorted(entry.formats) == sorted(stored.formats)
    expected = make_entry(
        library,
        stored_content(stored),
        errors,
        settings=entry.settings,
        formats=entry.formats if same_formats else stored.formats,
        warnings=entry.warnings,
        inputs=entry.inputs,
        files={},
    )
    record, other = msgspec.to_builtins(entry), msgspec.to_builtins(expected)
    wrong = [
        f"{entry.name}/{RECORD}: {key} is not that of {MANIFEST}; {_REMEDY}"
        for key in record.keys() | other.keys()
        if key != "files" and record.get(key) != other.get(key)
    ]
    return sorted(wrong) + [
        f"{entry.name}/{name}: is missing, or not as {RECORD} has it; {_REMEDY}"
        for name in changed_files(folder / entry.name, entry)
    ]


def _wrong_index(folder: Path, record: IndexRecord, index: Index, entries: list[Entry]) -> tuple[int, list[str]]:
    """Compare the files of the index; of another version only the memories, which have no text of tablegen."""
    same = record.tablegen == __version__
    files = {name: text for name, text in index.files.items() if same or name.endswith(".mem")}
    wrong = []
    for name, text in sorted(files.items(), key=lambda file: (file[0] == INDEX, file[0])):
        try:
            actual = read_bytes(folder / name, BUILD_FILE)
        except OSError as error:
            wrong.append(f"{name}: {'missing' if isinstance(error, FileNotFoundError) else error.strerror or error}")
            continue
        if actual != text:
            why = _memory_difference(actual, text, entries) if name.endswith(".mem") else "is not that of the programs"
            wrong.append(f"{name}: {why}; {_REMEDY}")
    own = [name for name in record.files if f"{record.library}_library" in name]
    wrong += [f"{name}: {INDEX} lists it, no such library has it; {_REMEDY}" for name in own if name not in index.files]
    return len(files), wrong


def _memory_difference(actual: bytes, expected: bytes, entries: list[Entry]) -> str:
    """Describe the first line of a memory that differs: its number, its place in the records, and both words."""
    lines, right = actual.splitlines(), expected.splitlines()
    at = next((i for i, (one, other) in enumerate(zip(lines, right, strict=False)) if one != other), None)
    if at is None:
        return f"has {len(lines)} words, not {len(right)}"
    starts = [int(line, 16) for line in right[: len(entries)]]
    if at < len(entries):
        place = f"the address of {entries[at].name}"
    else:
        number = max(i for i, start in enumerate(starts) if start <= at)
        end = starts[number + 1] if number + 1 < len(starts) else len(right)
        of = entries[number].name
        place = f"the CRC of {of}" if at == end - 1 else f"word {at - starts[number]} of {of}"
    word = lines[at].decode("ascii", "replace")
    return f"line {at + 1}, {place}: is {shortened(word)}, not {right[at].decode('ascii')}"


def _unindexed(folder: Path, record: IndexRecord) -> list[Path]:
    """List the folders of programs that the index does not have."""
    names = {program.name for program in record.programs}
    return sorted(path for path in folder.iterdir() if path.name not in names and (path / RECORD).is_file())
