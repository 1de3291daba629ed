"""Every `tablegen` command line on every page, run or not: the command is there, and so are its options."""

import re
import shlex
from pathlib import Path

import click
import pytest
from test_markdown import names, pages

from tablegen.cli import cli

_BLOCK = re.compile(r"^ *```(\w*)[^\n]*\n(.*?)^ *```$", re.MULTILINE | re.DOTALL)


def command_lines(text: str) -> list[str]:
    """Of fenced code, with lines that go on put together."""
    code = "\n".join(code for language, code in _BLOCK.findall(text) if language in {"", "sh", "text"})
    code = code.replace("\\\n", " ").replace(" && ", "\n")
    return [line for line in re.findall(r"^ *(?:\$ )?(tablegen .*)$", code, re.MULTILINE) if "|" not in line]


def wrong(line: str) -> str | None:
    """What the program does not have of a line: a command or an option."""
    words = [word for word in shlex.split(line, comments=True)[1:] if word not in {">", "&"}]
    command: click.Command = cli
    context = click.Context(cli)
    known = {"--help", "-h", "--version"}
    for word in words:
        if isinstance(command, click.Group) and not word.startswith("-"):
            found = command.get_command(context, word)
            if found is None:
                return None if "..." in line or word in {"COMMAND", "[OPTIONS]"} else word
            command = found
            known |= {name for option in command.params for name in (*option.opts, *option.secondary_opts)}
        elif re.match(r"--?[a-z]", word) and word.partition("=")[0] not in known:
            return word
    return None


@pytest.mark.parametrize("page", [page for page in pages() if "tablegen " in page.read_text("utf-8")], ids=names)
def test_its_commands_and_options_exist(page: Path) -> None:
    assert [(line, wrong(line)) for line in command_lines(page.read_text("utf-8")) if wrong(line)] == []


def test_there_are_many() -> None:
    assert sum(len(command_lines(page.read_text("utf-8"))) for page in pages()) > 150


@pytest.mark.parametrize(
    ("line", "what"),
    [
        ("tablegen bild scan.toml", "bild"),
        ("tablegen build scan.toml --outptu x", "--outptu"),
        ("tablegen calibrate offset --axis x a.csv --wriet", "--wriet"),
        ("tablegen build scan.toml -o build  # --nothing", None),
    ],
)
def test_a_wrong_line_is_found(line: str, what: str | None) -> None:
    assert wrong(line) == what
