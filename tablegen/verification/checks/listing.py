"""The files that a build of given formats has, whatever its manifest lists, and how they are written here."""

from hashlib import sha256
from pathlib import Path

from tablegen.base.reading import BUILD_FILE, read_bytes
from tablegen.emit.content import Content
from tablegen.emit.format import Format
from tablegen.emit.formats import UnknownFormat, files_of, get, runtime_paths
from tablegen.manifest.format import MANIFEST
from tablegen.manifest.read import StoredBuild

_RUNTIME = ("dac_*.v", "dac_*.c", "dac_*.h")  # patterns of command lines that take the runtime
_REWRITTEN = ("c", "verilog")  # formats that are compared constant by constant and word by word, not as they stand


def known_formats(stored: StoredBuild) -> tuple[list[Format], list[str]]:
    """Return the formats of a build that are installed here, and why others are not."""
    formats, unknown = [], []
    for name in stored.formats:
        try:
            formats.append(get(name))
        except UnknownFormat as error:
            unknown.append(str(error))
    return formats, unknown


Written = list[tuple[Format, dict[str, bytes]]]


def written_files(content: Content, formats: list[Format]) -> Written:
    """Write the files that follow from a manifest, by format and name.

    Raises
    ------
    Unphysical
        If the manifest describes no possible scan.
    FormatFailed
        If a format cannot write its files.
    """
    return [(one, files_of(one, content)) for one in formats]


def listed_files(
    folder: Path, stored: StoredBuild, written: Written, same_version: bool, all_known: bool
) -> tuple[int, list[str]]:
    """Return how many files such a build has, and those that the manifest does not list, or lists beyond them.

    Which files the runtime has depends on the version: where that is another one, a runtime of any files will do.
    """
    formats_by_name: dict[str, str] = {}  # name: format
    for one, own in written:
        formats_by_name |= dict.fromkeys(own, one.name)
        if same_version:
            formats_by_name |= {path.name: one.name for path in runtime_paths(one, stored.z is not None)}
    listed = set(stored.manifest.files)
    wrong = [
        f"{name}: a build of {formats_by_name[name]} has it, the manifest does not list it"
        for name in sorted(formats_by_name.keys() - listed)
    ]
    runtime = {name for name in listed if not same_version and _is_runtime(name)}
    if all_known:
        wrong += [
            f"{name}: the manifest lists it, no build of {', '.join(stored.formats)} has it"
            for name in sorted(listed - formats_by_name.keys() - runtime)
        ]
    present = {path.name for pattern in _RUNTIME for path in folder.glob(pattern)}
    wrong += [
        f"{name}: not a file of the build, but compilers that are given a pattern take it in"
        for name in sorted(present - listed)
    ]
    return len(formats_by_name.keys() | listed), wrong


def _is_runtime(name: str) -> bool:
    return name.startswith(("dac_", "program_loader")) and name != MANIFEST


def unlike_installed(folder: Path, stored: StoredBuild, written: Written) -> tuple[int, list[str]]:
    """Return how many files are alike in every build of this version, or follow from the manifest, and which differ.

    A comment at the beginning of a file that is made again is passed over: no manifest has its words.
    """
    count, wrong = 0, []
    for one, own in written:
        for path in runtime_paths(one, stored.z is not None):
            count += 1
            content = _content(folder / path.name)
            if content is not None and sha256(content).digest() != sha256(path.read_bytes()).digest():
                wrong.append(f"{path.name}: is not the one that is installed")
        for name, right in (own if one.name in _REWRITTEN else {}).items():
            count += 1
            content = _content(folder / name)
            if content is not None and (at := _first_difference(content, right)) is not None:
                wrong.append(f"{name}: line {at} is not as this version writes it")
    return count, wrong


def _content(path: Path) -> bytes | None:
    """Read a file; None if it is missing, which another check reports."""
    try:
        return read_bytes(path, BUILD_FILE)
    except OSError:
        return None


def _first_difference(text: bytes, right: bytes) -> int | None:
    """Return the first line that differs, counted from 1, after the comment at the beginning of both."""
    skipped, ours = _after_comment(text)
    others = _after_comment(right)[1]
    if ours == others:
        return None
    same = next((at for at, pair in enumerate(zip(ours, others, strict=False)) if pair[0] != pair[1]), None)
    return skipped + 1 + (min(len(ours), len(others)) if same is None else same)


def _after_comment(content: bytes) -> tuple[int, list[bytes]]:
    """Return the number of the lines of comment with which a file of C or Verilog begins, and the lines after them."""
    lines = content.splitlines(keepends=True)
    at, inside = 0, False
    while at < len(lines):
        line = lines[at].strip()
        opens, closes = line.count(b"/*"), line.count(b"*/")
        if inside or line.startswith(b"/*"):
            if opens != (0 if inside else 1) or closes > 1 or (closes and not line.endswith(b"*/")):
                break  # there is more than the comment on it
            inside = not closes
        elif line and not line.startswith(b"//"):
            break
        at += 1
    return at, lines[at:]
