"""The shipped example with keys replaced, loaded or planned in process; keys keep their lines."""

from collections.abc import Mapping
from pathlib import Path

from editing import SCAN, SCANNER, edited, write_pair

from tablegen.config.load import Setup, load
from tablegen.planning.line_plan import Plan, make_plan

Edits = Mapping[str, str]


def setup_of(folder: Path, scan: Edits | None = None, scanner: Edits | None = None) -> Setup:
    """The example with edits, by dotted key; values are TOML text, and "" takes a key out."""
    return load(write_pair(folder, edited(SCAN, *_lines(scan)), edited(SCANNER, *_lines(scanner))))


def plan_of(folder: Path, scan: Edits | None = None, scanner: Edits | None = None) -> Plan:
    """The plan of ``setup_of``."""
    return make_plan(setup_of(folder, scan, scanner))


def _lines(edits: Edits | None) -> list[str]:
    return [f"{key} = {value}" if value else f"- {key}" for key, value in (edits or {}).items()]
