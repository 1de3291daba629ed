"""What an index has of a program: its record in ``program.json``, beside the files of the program."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec
from msgspec import Struct

from tablegen.base.reading import BUILD_FILE, file_sha256, other_than_folder, read_bytes
from tablegen.config.names import why_not_a_name
from tablegen.device.widths import least_widths
from tablegen.emit.content import AxisContent, Content
from tablegen.manifest.fields import BuildFileName, Digest
from tablegen.manifest.format import RECORD, read_json


class AxisEntry(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """Of an axis: what a device has to be made for, and what the certificate says. ``shaping_order`` 0: not shaped."""

    table_bits: int
    table_words: int
    index_bits: int
    interpolated: bool
    harmonics: int
    dac_bits: int
    word_bits: int
    coding: str
    align: str
    channel: str
    max_error_lsb: float
    scaling_error_percent: float
    cubic: bool = False
    shaping_order: int = 0


class Entry(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """A program of a library. ``inputs`` is the digest of all that it was made from, ``files`` those of its folder.

    ``table_pixels`` are the pixels of a sweep whose ticks are in a table; 0: all are equally long.
    """

    library: str
    name: str
    hash: Digest
    settings: dict[str, Any]
    formats: list[str]
    update_rate_hz: float
    line_ticks: int
    frame_lines: int
    widths: dict[str, int]
    x: AxisEntry
    y: AxisEntry
    warnings: list[str]
    inputs: Digest
    files: dict[BuildFileName, Digest]
    table_pixels: int = 0

    @property
    def axes(self) -> tuple[AxisEntry, AxisEntry]:
        """Both axes, fast first."""
        return self.x, self.y

    def described(self) -> dict[str, Any]:
        """Return what the index shows of the entry."""
        record: dict[str, Any] = msgspec.to_builtins(self)
        return {key: value for key, value in record.items() if key not in ("library", "inputs", "files", "formats")}


def make_entry(
    library: str,
    content: Content,
    errors: Mapping[str, tuple[float, float]],
    *,
    settings: Mapping[str, Any],
    formats: Sequence[str],
    warnings: Sequence[str],
    inputs: str,
    files: Mapping[str, bytes],
) -> Entry:
    """Make the entry of a build; ``errors`` are the largest error in LSB and the scaling error in percent, by axis."""

    def axis(one: AxisContent) -> AxisEntry:
        program, output = one.program, one.program.output
        return AxisEntry(
            table_bits=program.bits,
            table_words=len(program.words),
            index_bits=program.index_bits,
            interpolated=program.mode != "direct",
            harmonics=one.harmonics,
            dac_bits=output.dac_bits,
            word_bits=output.word_bits,
            coding=output.coding,
            align=output.align,
            channel=output.channel,
            max_error_lsb=float(f"{errors[one.axis][0]:.6g}"),
            scaling_error_percent=float(f"{errors[one.axis][1]:.6g}"),
            cubic=program.mode == "cubic",
            shaping_order=output.shaping.order,
        )

    schedule = content.schedule
    return Entry(
        library=library,
        name=content.name,
        hash=content.hash,
        settings=dict(settings),
        formats=list(formats),
        update_rate_hz=float(schedule.update_rate_hz),
        line_ticks=schedule.ticks,
        frame_lines=schedule.lines,
        widths=least_widths(schedule, content.y.program),
        x=axis(content.x),
        y=axis(content.y),
        warnings=list(warnings),
        inputs=inputs,
        files={name: hashlib.sha256(text).hexdigest() for name, text in sorted(files.items())},
        table_pixels=0 if schedule.pixel_table is None else schedule.pixels,
    )


def entry_file(entry: Entry) -> bytes:
    """``program.json``."""
    return (json.dumps(msgspec.to_builtins(entry), indent=1) + "\n").encode("ascii")


def read_record(folder: Path) -> bytes | None:
    """Read ``program.json`` in the folder of a program; None where it cannot be read."""
    try:
        return read_bytes(folder / RECORD, BUILD_FILE)
    except OSError:
        return None


def parse_entry(record: bytes | None, folder: Path) -> Entry | None:
    """Parse the record of the program in ``folder``; None for one that no sweep has written there."""
    if record is None:
        return None
    try:
        entry = msgspec.convert(read_json(record), Entry)
    except (ValueError, RecursionError):  # a ValidationError is a ValueError
        return None
    right = entry.name == folder.name and why_not_a_name(entry.name) is None and why_not_a_name(entry.library) is None
    return entry if right else None


def is_whole(folder: Path, entry: Entry) -> bool:
    """Whether all files of a program are there, as they were written."""
    return not changed_files(folder, entry)


def changed_files(folder: Path, entry: Entry) -> list[str]:
    """List the files of a program that are missing or not as they were written."""
    changed = []
    for name, digest in entry.files.items():
        try:
            same = other_than_folder(folder, name) is None and file_sha256(folder / name, BUILD_FILE) == digest
        except OSError:
            same = False
        if not same:
            changed.append(name)
    return changed
