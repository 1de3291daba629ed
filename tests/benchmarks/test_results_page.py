"""benchmarks/results.md: its form, and how a section is put into it."""

import re
from pathlib import Path

import pytest
import results
from building import REPOSITORY
from click.testing import CliRunner
from result_rows import BENCHMARKS, PAGE, tables
from sections import section as sections
from sections import startup
from sections.section import Section, wrapped

from tablegen.cli import cli

TEXT = PAGE.read_text("utf-8")
ONE = Section("One", "What it is.", ("a", "b"), [["1", "2"]], ["A note."], {"tool": "1.0"})


def text_of(name: str) -> str:
    found = re.search(results.marked(name), TEXT, re.DOTALL)
    assert found is not None, name
    return found[0]


def test_the_page_has_all_sections_in_their_order() -> None:
    assert tuple(re.findall(r"^<!-- (\w+) -->$", TEXT, re.MULTILINE)) == results.SECTIONS
    assert results.changed(TEXT, "line", text_of("line")) == TEXT


@pytest.mark.parametrize("name", results.SECTIONS)
def test_a_section_says_how_it_was_run_and_where(name: str) -> None:
    text = text_of(name)
    assert f"Run: `python benchmarks/results.py --only {name}`." in text
    assert re.search(r"^On .+ with \d+ cores?; Python \d[\d.]+, numpy \d[\d.]+[,.]", text, re.MULTILINE)
    assert not re.search(r"/(home|tmp|root|work|usr)/|\b20\d\d-\d\d|of unknown version", text)
    rows = tables(name)
    assert rows
    assert all(any(list(row.values())[1:]) for row in rows), "no row is empty"


def test_every_command_of_a_row_exists() -> None:
    pinned = [line.split("==")[0] for line in (BENCHMARKS / "others.txt").read_text("utf-8").splitlines()]
    rows = [row for name in results.SECTIONS for row in tables(name) if "run" in row]
    assert len(rows) >= 20
    for row in rows:
        program, *words = (word for word in row["run"].strip("`").split() if "=" not in word)  # no variables
        if program == "python" and words[0] != "-m":
            assert (REPOSITORY / words[0]).is_file(), row
        elif program in ("python", "tablegen"):
            command = words[2] if program == "python" else words[0]
            assert command == "--version" or CliRunner().invoke(cli, [command, "--help"]).exit_code == 0, row
        else:
            assert program in pinned, row


def test_the_others_have_the_versions_that_make_installs() -> None:
    text = " ".join(text_of("startup").split())
    pins = re.findall(r"^([\w-]+)==([\d.]+)$", (BENCHMARKS / "others.txt").read_text("utf-8"), re.MULTILINE)
    assert len(pins) == 5
    for name, version in pins:
        assert f"{name} {version}" in text


def test_ratios_of_instructions_are_those_of_their_rows() -> None:
    ours = {row["processor"]: row for row in tables("instructions") if row["chain"].startswith("ours")}
    assert len(ours) == 5
    for row in tables("instructions"):
        ratio = float(row["instructions"]) / float(ours[row["processor"]]["instructions"])
        assert float(row["over ours"]) == pytest.approx(ratio, rel=5e-3, abs=0.01)


def test_a_section_takes_the_place_of_its_former_self() -> None:
    page = results.changed("", "line", ONE.markdown("line"))
    page = results.changed(page, "startup", ONE.markdown("startup"))
    assert page.index("<!-- startup -->") < page.index("<!-- line -->")
    other = results.changed(page, "line", ONE.markdown("line").replace("A note", "Another note"))
    assert other == page[: page.index("<!-- line -->")] + ONE.markdown("line").replace("A note", "Another note")


@pytest.mark.parametrize("row", [["1"], ["1", "2", "3"], ["1", "2|3"]])
def test_a_row_that_does_not_fit_is_refused(row: list[str]) -> None:
    with pytest.raises(ValueError, match="does not fit"):
        Section("One", "", ("a", "b"), [row], [], {}).markdown("one")


def test_lines_are_wrapped_but_no_code() -> None:
    lines = wrapped("word " * 40 + "`a piece of code that stays together`", "- ", 40)
    assert max(map(len, lines)) <= 40
    assert all(line.startswith("  " if at else "- ") for at, line in enumerate(lines))
    assert any("`a piece of code that stays together`" in line for line in lines)


def test_a_missing_tool_fails_its_section_by_name_and_leaves_the_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    page = tmp_path / "results.md"
    page.write_text(TEXT, "utf-8")
    monkeypatch.setattr(results, "PAGE", page)
    monkeypatch.setattr(startup, "OTHERS", tmp_path / "nowhere")
    monkeypatch.setattr("sys.argv", ["results.py", "--only", "startup"])
    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "1")
    assert results.main() == 1
    assert "startup: FileNotFoundError: cantools" in capsys.readouterr().err
    assert page.read_text("utf-8") == TEXT


def test_the_machine_is_a_kind_of_processor_and_cores() -> None:
    assert re.fullmatch(r".+ with \d+ cores?", sections.machine())
