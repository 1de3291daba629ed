"""docs/formats.md says what the formats are."""

import re

from building import REPOSITORY

from tablegen.emit.format import Format
from tablegen.emit.formats import get, own_names
from tablegen.emit.waveforms import MOST_TICKS

PAGE = (REPOSITORY / "docs" / "formats.md").read_text("utf-8")


def test_the_table_is_what_the_formats_say() -> None:
    table = PAGE.split("| format | files | content |\n|---|---|---|\n")[1].split("\n\n")[0]
    rows = re.findall(r"^\| `([a-z-]+)` \| `(.*?)` \| (.*) \|$", table, re.MULTILINE)
    assert len(rows) == len(table.splitlines())
    assert rows == [(name, get(name).file_names, get(name).purpose) for name in own_names()]


def test_the_example_in_the_page_is_the_file() -> None:
    shown = re.search(r"```python\n(.*?)```", PAGE, re.DOTALL)
    assert shown
    lines = [line.removeprefix("   ") for line in shown[1].splitlines()]
    code = (REPOSITORY / "tablegen" / "emit" / "formats" / "bin.py").read_text("utf-8")
    documented = re.sub(r'^ *""".*"""\n\n?', "", code, flags=re.MULTILINE)
    assert "\n".join(lines).strip() == documented[documented.index("class") :].strip()


def test_the_limit_of_samples_is_the_one_that_is_checked() -> None:
    assert f"more than {MOST_TICKS} ticks (2^{MOST_TICKS.bit_length() - 1})" in PAGE


def test_the_length_of_the_example_outside_is_right() -> None:
    code = (REPOSITORY / "examples" / "custom_format" / "tablegen_rust.py").read_text("utf-8")
    assert f"such a package: {len(code.splitlines())} lines" in " ".join(PAGE.split())


def test_the_parts_of_a_format_are_documented() -> None:
    for part in ("purpose", "file_names", "comment", "check"):
        assert hasattr(Format, part) or part in Format.__annotations__
        assert f"`{part}`" in PAGE
