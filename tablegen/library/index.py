"""The index of a library: which files it has, and what could not be indexed."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tablegen.emit.formats import chosen
from tablegen.emit.render import runtime_files
from tablegen.library.c_index import c_index
from tablegen.library.entry import Entry
from tablegen.library.sameness import why_not_one_c, why_not_one_sequencer
from tablegen.library.verilog_index import verilog_index
from tablegen.manifest.format import INDEX, read_json
from tablegen.reading import BUILD_FILE, read_bytes
from tablegen.version import __version__


@dataclass(frozen=True)
class Index:
    """The files of the directory of a library beside its programs, by name, and why one of them is not there."""

    files: dict[str, bytes]
    notes: list[str]


def make_index(
    library: str, entries: Sequence[Entry], failed: Sequence[Mapping[str, Any]], formats: Sequence[str], folder: Path
) -> Index:
    """The index of the programs in ``folder``, numbered as they come, and the runtime of their formats.

    ``failed`` are the scans that could not be built, as the index shows them. Raises ``OSError`` where a file of a
    program cannot be read.
    """
    wanted = chosen(formats)
    names = {each.name for each in wanted}
    runtime: dict[str, bytes] = {}
    for each in wanted:
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
            files |= verilog_index(library, entries, folder, __version__)
    rates = sorted({entry.update_rate_hz for entry in entries})
    if len(rates) > 1:
        few = ", ".join(f"{rate:g}" for rate in rates[:4])
        notes.append(f"programs of different update rates ({few} Hz): the timer of the firmware has to follow")
    shown = {
        "tablegen": __version__,
        "library": library,
        "formats": list(formats),
        "notes": notes,
        "files": {name: hashlib.sha256(text).hexdigest() for name, text in sorted(files.items())},
        "programs": [{"number": number, **entry.described()} for number, entry in enumerate(entries)],
        "failed": list(failed),
    }
    files[INDEX] = (json.dumps(shown, indent=1) + "\n").encode("ascii")
    return Index(files, notes)


def listed_files(folder: Path) -> dict[str, str]:
    """The files that the index in a directory lists, with their digests; nothing where there is none."""
    try:
        found = read_json(read_bytes(folder / INDEX, BUILD_FILE))
    except (OSError, ValueError):
        return {}
    files = found.get("files") if isinstance(found, dict) else None
    pairs = files.items() if isinstance(files, dict) else ()
    return {name: digest for name, digest in pairs if isinstance(digest, str) and name == Path(name).name}
