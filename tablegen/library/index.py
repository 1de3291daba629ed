"""The index of a library: which files it has, and what could not be indexed."""

import hashlib
import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tablegen.base.reading import BUILD_FILE, read_bytes
from tablegen.config.names import of_the_runtime, why_not_a_name
from tablegen.emit.formats import chosen
from tablegen.emit.render import runtime_files
from tablegen.library.c_index import c_index
from tablegen.library.entry import Entry
from tablegen.library.sameness import why_not_one_c, why_not_one_sequencer
from tablegen.library.verilog_index import verilog_index
from tablegen.manifest.format import INDEX, read_json
from tablegen.version import __version__

_PLAIN = re.compile(r"[A-Za-z0-9_]+\.[A-Za-z0-9]+")
_INDEX_FILE = re.compile(r"[A-Za-z0-9_]+_library(\.(h|c|vh)|_(tables|fourier|sine)\.mem)")


@dataclass(frozen=True)
class Index:
    """The files of the directory of a library beside its programs, by name, and why one of them is not there."""

    files: dict[str, bytes]
    notes: list[str]


def make_index(
    library: str,
    entries: Sequence[Entry],
    failed: Sequence[Mapping[str, Any]],
    formats: Sequence[str],
    content: Callable[[str, str], bytes],
) -> Index:
    """Make the index of programs, numbered as they come, and the runtime of their formats.

    ``failed`` are the scans that could not be built, as the index shows them; ``content`` of the name of a program and
    that of a file is what the file holds, and may raise ``OSError``.
    """
    chosen_formats = chosen(formats)
    names = {each.name for each in chosen_formats}
    runtime: dict[str, bytes] = {}
    for each in chosen_formats:
        runtime |= runtime_files(each)
    files, notes = dict(runtime), []
    if entries and "c" in names:
        if why := why_not_one_c(entries):
            notes.append(f"no index in C: {why}")
        else:
            files |= c_index(library, entries, __version__)
    if entries and "verilog" in names:
        if why := why_not_one_sequencer(entries):
            notes.append(f"no index in Verilog: {why}")
        else:
            files |= verilog_index(library, entries, content, __version__)
    rates = sorted({entry.update_rate_hz for entry in entries})
    if len(rates) > 1:
        few = ", ".join(f"{rate:g}" for rate in rates[:4])
        notes.append(f"programs of different update rates ({few} Hz): the timer of the firmware has to follow")
    record = {
        "tablegen": __version__,
        "library": library,
        "formats": list(formats),
        "notes": notes,
        "files": {name: hashlib.sha256(text).hexdigest() for name, text in sorted(files.items())},
        "programs": [{"number": number, **entry.described()} for number, entry in enumerate(entries)],
        "failed": list(failed),
    }
    files[INDEX] = (json.dumps(record, indent=1) + "\n").encode("ascii")
    return Index(files, notes)


def listed_files(folder: Path) -> dict[str, str]:
    """Read the files that the index in a directory lists, with their digests; nothing without an index of tablegen.

    Only names that an index of that library can list are among them, whatever else stands in it.
    """
    try:
        record = read_json(read_bytes(folder / INDEX, BUILD_FILE))
    except (OSError, ValueError):
        return {}
    if not isinstance(record, dict) or not {"tablegen", "library", "programs", "files"} <= record.keys():
        return {}
    library, files = record["library"], record["files"]
    if not isinstance(library, str) or why_not_a_name(library) is not None or not isinstance(files, dict):
        return {}
    own = [name for name in files if name.startswith(f"{library}_library") or of_the_runtime(name)]
    return {name: files[name] for name in own if isinstance(files[name], str) and is_indexed(name)}


def is_indexed(name: str) -> bool:
    """Whether a file of this name can be one of an index, or of the runtime beside it."""
    return _INDEX_FILE.fullmatch(name) is not None or (of_the_runtime(name) and _PLAIN.fullmatch(name) is not None)
