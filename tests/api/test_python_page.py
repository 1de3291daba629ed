"""docs/python.md: its code runs, its output is what it says, and it names what is public."""

import re
from pathlib import Path

import pytest
from building import EXAMPLE, REPOSITORY

import tablegen

PAGE = (REPOSITORY / "docs" / "python.md").read_text("utf-8")
BLOCKS = re.findall(r"^```(\w+)( no-run)?\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)


@pytest.mark.common
def test_the_code_of_the_page_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """In order, in one namespace, beside the shipped example."""
    text = EXAMPLE.read_text("utf-8")
    (tmp_path / "scan.toml").write_text(text, "utf-8")
    (tmp_path / "scanner.toml").write_text((EXAMPLE.parent / "scanner.toml").read_text("utf-8"), "utf-8")
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    ran = 0
    for language, skipped, code in BLOCKS:
        if language == "python" and not skipped:
            exec(compile(code, "docs/python.md", "exec"), names)
            ran += 1
    assert ran == 14
    printed = capsys.readouterr().out
    (shown,) = (code for language, _, code in BLOCKS if language == "text")
    assert shown in printed
    assert "scan 0 dac missing; this table is required" in printed


def test_what_is_not_run_is_python() -> None:
    (code,) = (code for _, skipped, code in BLOCKS if skipped)
    compile(code, "docs/python.md", "exec")


def test_the_page_names_what_is_public() -> None:
    table = PAGE[PAGE.index("## What is public") :]
    rows = [row.split("|")[1] for row in table.splitlines() if row.startswith("| `")]
    named = [name for row in rows for name in re.findall(r"`(\w+)`", row)]
    assert sorted(named) == sorted(tablegen.__all__)
