"""The shipped example and edits of it, planned in process."""

import re
from pathlib import Path

from tablegen.config.load import Setup, load
from tablegen.plan import Plan, make_plan

EXAMPLES = Path(__file__).parent.parent / "examples"


def setup_of(folder: Path, scan: dict[str, str] | None = None, scanner: dict[str, str] | None = None) -> Setup:
    """The example with keys replaced or added.

    Keys are written ``table.key`` ("" before the dot for the top), values as TOML text; a value of "" removes the key.
    """
    for name, edits in (("annexin_200nm.toml", scan), ("scanner.toml", scanner)):
        text = (EXAMPLES / name).read_text(encoding="utf-8")
        for key, value in (edits or {}).items():
            text = _edited(text, key, value)
        (folder / name).write_text(text, encoding="utf-8")
    return load(folder / "annexin_200nm.toml")


def plan_of(folder: Path, scan: dict[str, str] | None = None, scanner: dict[str, str] | None = None) -> Plan:
    """The plan of ``setup_of``."""
    return make_plan(setup_of(folder, scan, scanner))


def _edited(text: str, key: str, value: str) -> str:
    table, _, name = key.rpartition(".")
    head = f"[{table}]" if table else ""
    if head and not re.search(rf"^{re.escape(head)}", text, re.M):
        text += f"\n{head}\n"
    start = text.index(head) + len(head)
    stop = re.search(r"^\[", text[start:], re.M)
    end = start + stop.start() if stop else len(text)
    body, count = re.subn(rf"^{name} =.*$", f"{name} = {value}" if value else "", text[start:end], flags=re.M)
    if value and not count:
        body = f"\n{name} = {value}" + body
    return text[:start] + body + text[end:]
