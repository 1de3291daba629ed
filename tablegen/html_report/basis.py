"""The calibration of a scan: comments and values of the scanner file, and the traces of its operators."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec

from tablegen.base.input_errors import Document, shortened
from tablegen.base.reading import CONFIGURATION, read_text
from tablegen.base.warnings import Tone
from tablegen.config.load import Setup
from tablegen.html_report.blocks import Grid, Paragraph, Section, TableCell, row
from tablegen.html_report.subject import PlannedScan
from tablegen.planning.line_plan import LinePlan

_MARK = re.compile(r"# (calibrate|refine) (.*?): (.*)$")
_TABLE = re.compile(r"\[\[?([xy](?:\.\w+)+)\]\]?")
_KINDS = ("size", "offset", "hysteresis", "frequency", "resonance")


def basis(planned: PlannedScan) -> Section:
    """Return the origin of each table, its values, and the errors of an operator on its traces."""
    setup = planned.setup
    comments = [*_comments(setup.scanner_file), *_comments(setup.scan_file)]
    commented = {key.split(".branches")[0] for key, _, _ in comments}
    rows = [row(key, text, sources or "-") for key, text, sources in comments]
    missing: dict[Tone, list[str]] = {"warn": [], "quiet": []}
    for axis in ("x", "y"):
        tables = getattr(setup.scanner, axis)
        for kind in _KINDS:
            key = f"{axis}.{kind}"
            if getattr(tables, kind, None) is None:
                missing["quiet" if kind in ("frequency", "resonance") else "warn"].append(key)
            elif key not in commented:
                rows.append(row(key, TableCell("no comment of `tablegen calibrate`: origin not known", "quiet"), "-"))
    rows += [
        row(", ".join(keys), TableCell("not in the scanner file: not corrected", tone), "-")
        for tone, keys in missing.items()
        if keys
    ]
    blocks: list[Grid | Paragraph] = [
        Grid("Origin", ("", "fit", "measurements, with the beginning of their SHA-256"), tuple(rows)),
    ]
    for line in planned.plan.lines:
        blocks += _traces(line)
    blocks.append(
        Paragraph(
            "The scanner file has the number of points of a fit, their residuals, their files, and the standard "
            "errors, which `tablegen compare` reads. `tablegen calibrate` prints outliers, and `--report` shows them.",
            "quiet",
        )
    )
    values = tuple(row(key, value) for key, value in _values(setup))
    blocks.append(Grid(f"Values of the scanner file {setup.scanner.name!r}", ("key", "value"), values, folded=True))
    return Section("calibration", "The calibration", tuple(blocks))


def _comments(file: Document) -> Iterator[tuple[str, str, str]]:
    """Yield the table below a comment of `calibrate` or `refine`, the text of the comment, and its files."""
    if file.lines is None:
        return
    try:
        text = read_text(file.name, CONFIGURATION)
    except (OSError, UnicodeDecodeError):  # it was read a moment ago
        return
    pending: list[tuple[str, list[str]]] = []
    for line in map(str.strip, text.splitlines()):
        if mark := _MARK.match(line):
            pending.append((f"{mark[1]} {mark[2]}: {mark[3]}", []))
        elif line.startswith("# from ") and pending:
            pending[-1][1].append(line.removeprefix("# from "))
        elif header := _TABLE.match(line):
            yield from (
                (header[1], shortened(fit_text), shortened("; ".join(sources), 600)) for fit_text, sources in pending
            )
            pending = []
        elif not line.startswith("#"):
            pending = []


def _traces(line: LinePlan) -> list[Grid]:
    traces, driver = line.drive.shape.identification.traces, line.drive.driver
    if not traces:
        return []
    rows = tuple(
        row(
            Path(one.name).name,
            f"{one.stroke * driver.span:.4g}",
            f"{driver.volts(one.centre):.4g}",
            f"{one.rate_hz:.4g}",
            *(f"{value:.2g}" for value in one.left_out[:3]),
            f"{one.left_out[3]:+.2g}",
        )
        for one in traces
    )
    head = ("trace", "stroke [V]", "centre [V]", "rate [Hz]", "rms [%]", "scaling [%]", "mismatch [%]", "size [%]")
    return [Grid(f"{line.axis}: error of the operator on each trace when that is left out", head, rows)]


def _values(setup: Setup) -> Iterator[tuple[str, str]]:
    yield "v_max", f"{setup.scanner.v_max:g} V"
    if setup.scanner.v_min != 0.0:
        yield "v_min", f"{setup.scanner.v_min:g} V"
    for part in ("dac", "amplifier"):
        yield from _flat(part, msgspec.to_builtins(getattr(setup.scanner, part)))
    for axis in ("x", "y"):
        yield from _flat(axis, msgspec.to_builtins(getattr(setup.scanner, axis)))


def _flat(key: str, value: Any) -> Iterator[tuple[str, str]]:
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from _flat(f"{key}.{name}", inner)
    elif isinstance(value, list):
        for i, inner in enumerate(value):
            yield from _flat(f"{key}[{i}]", inner)
    elif value is not None:
        yield key, f"{value:.12g}" if isinstance(value, float) else shortened(str(value))
