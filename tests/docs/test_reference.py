"""Pages of commands and of Python, and the manual, are what the program says; completion works in the shell."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from building import REPOSITORY, tool
from editing import run

import tablegen
from tablegen.cli import cli

DOCS = REPOSITORY / "docs"
sys.path.insert(0, str(DOCS))
try:
    import command_pages
    import make_man
    import make_reference
finally:
    sys.path.pop(0)

PAGES = command_pages.pages()


def test_the_pages_are_those_of_the_program() -> None:
    made = make_reference.files()
    shown = {name: (DOCS / name).read_text("utf-8") for name in made if (DOCS / name).exists()}
    assert shown == made, "run `make reference`"
    assert {path.name for path in (DOCS / "commands").glob("*.md")} == {
        Path(name).name for name in made if name.startswith("commands/")
    }


def test_every_command_and_option_of_the_help_has_its_row() -> None:
    assert {page.name.split()[1] for page in PAGES if len(page.name.split()) == 2} == set(cli.list_commands(None))  # type: ignore[arg-type]
    for page in PAGES:
        text = run(*page.name.split()[1:], "--help").out
        options = re.findall(r"^  (-[^ ,]+(?:, --[^ ]+)?)", text, re.MULTILINE)
        written = (DOCS / "commands" / f"{page.file}.md").read_text("utf-8")
        assert "-h, --help" in options
        assert [option for option in options if f"| `{option}" not in written] == [], page.name


def test_every_public_name_is_on_the_page_of_python() -> None:
    titles = re.findall(r"^### (\w+)$", (DOCS / "api.md").read_text("utf-8"), re.MULTILINE)
    assert sorted([*titles, "__version__"]) == sorted(tablegen.__all__)


def complaints(folder: Path) -> str:
    """What groff and man have against manual pages."""
    found = ""
    for page in sorted(folder.glob("man1/*.1")):
        for command in (["groff", "-man", "-ww", "-z"], ["man", "--warnings", "-E", "UTF-8", "-l", "-Tutf8", "-Z"]):
            done = subprocess.run([tool(command[0]), *command[1:], page], capture_output=True, text=True, check=False)
            found += done.stderr
    return found


@pytest.mark.common
def test_the_manual_is_clean_and_whole(tmp_path: Path) -> None:
    make_man.main(tmp_path)
    assert complaints(tmp_path) == ""
    environment = {
        **os.environ,
        "MANPATH": str(tmp_path),
        "MANWIDTH": "200",
        "MANPAGER": "cat",
        "MAN_KEEP_FORMATTING": "",
    }
    for page in PAGES:
        done = subprocess.run([tool("man"), page.file], env=environment, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        shown = " ".join(re.sub(r".\x08", "", done.stdout).split())
        assert page.short in shown
        assert [row.name for row in page.options if " ".join(row.name.split()) not in shown] == []


@pytest.mark.rest
@pytest.mark.parametrize("wrong", [".NOSUCH macro", "\\[nosuchglyph]"])
def test_a_wrong_manual_page_is_found(tmp_path: Path, wrong: str) -> None:
    make_man.main(tmp_path)
    page = tmp_path / "man1" / "tablegen-build.1"
    page.write_text(f"{page.read_text('utf-8')}{wrong}\n", "utf-8")
    assert "tablegen-build.1" in complaints(tmp_path)


def typed(line: str, folder: Path) -> list[str]:
    """What bash completes at the end of a line, by the line of docs/shell.md."""
    (start,) = re.findall(r"\| `(eval .*?bash_source.*?)` \|", (DOCS / "shell.md").read_text("utf-8"))
    words = line.split(" ")
    script = f"""{start}
COMP_WORDS=({" ".join(word or "''" for word in words)}); COMP_CWORD={len(words) - 1}
_tablegen_completion tablegen
printf '%s\\n' "${{COMPREPLY[@]}}"
"""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(
        ["bash", "--norc", "-c", script],
        env={**os.environ, "PATH": path},
        cwd=folder,
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stderr == ""
    return done.stdout.split()


@pytest.mark.common
@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("tablegen cal", ["calibrate"]),
        ("tablegen calibrate of", ["offset"]),
        ("tablegen build --dep", ["--depfile", "--depfile-target"]),
        ("tablegen verify --target ", ["verilog", "c", "cortex-m", "files"]),
        ("tablegen nosuch", []),
    ],
)
def test_bash_completes(line: str, words: list[str], tmp_path: Path) -> None:
    assert typed(line, tmp_path) == words


@pytest.mark.common
@pytest.mark.parametrize("shell", ["zsh", "fish"])
def test_the_scripts_for_other_shells_ask_the_program(shell: str) -> None:
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    environment = {**os.environ, "PATH": path, "_TABLEGEN_COMPLETE": f"{shell}_source"}
    script = subprocess.run(["tablegen"], env=environment, capture_output=True, text=True, check=True).stdout
    assert f"_TABLEGEN_COMPLETE={shell}_complete" in script
    asked = {"_TABLEGEN_COMPLETE": f"{shell}_complete", "COMP_WORDS": "tablegen cal", "COMP_CWORD": "1"}
    if shell == "fish":
        asked["COMP_CWORD"] = "cal"
    done = subprocess.run(["tablegen"], env={**environment, **asked}, capture_output=True, text=True, check=True)
    assert "calibrate" in done.stdout
