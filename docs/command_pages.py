"""What every command says of itself, for make_reference.py and make_man.py: one source, the command line."""

import inspect
import re
from collections.abc import Iterator
from dataclasses import dataclass

import click

from tablegen.cli import cli


@dataclass(frozen=True)
class Row:
    """An option or a subcommand: its name, what it does, and its default or range."""

    name: str
    text: str
    extra: str = ""


@dataclass(frozen=True)
class Part:
    """A paragraph, or lines that stay as they are."""

    text: str
    as_it_is: bool = False


@dataclass(frozen=True)
class CommandPage:
    """``name`` is what is typed, such as "tablegen build"."""

    name: str
    short: str
    usage: str
    parts: list[Part]
    options: list[Row]
    commands: list[Row]

    @property
    def file(self) -> str:
        """Its name as a file, without a suffix."""
        return self.name.replace(" ", "-")


def pages() -> list[CommandPage]:
    """Of every command and subcommand, each group before its own."""
    return list(_pages(cli, "tablegen", None))


def _pages(command: click.Command, name: str, parent: click.Context | None) -> Iterator[CommandPage]:
    word = name.rpartition(" ")[2]
    context = click.Context(command, info_name=word, parent=parent, **command.context_settings)
    names = command.list_commands(context) if isinstance(command, click.Group) else []
    inner = [(one, command.get_command(context, one)) for one in names] if isinstance(command, click.Group) else []
    known = [(one, found) for one, found in inner if found is not None and not found.hidden]
    yield CommandPage(
        name=name,
        short=command.get_short_help_str(1000).rstrip("."),
        usage=" ".join([name, *command.collect_usage_pieces(context)]),
        parts=[*_parts(command.help or ""), *_parts(command.epilog or "")],
        options=[row for parameter in command.get_params(context) if (row := _row(parameter, context)) is not None],
        commands=[Row(one, found.get_short_help_str(1000)) for one, found in known],
    )
    for one, found in known:
        yield from _pages(found, f"{name} {one}", context)


def _parts(text: str) -> list[Part]:
    """Paragraphs of a help text, in which a line with a backspace says that the lines below stay as they are."""
    found = []
    for block in re.split(r"\n\s*\n", inspect.cleandoc(text)):
        lines = block.strip("\n").splitlines()
        if lines and lines[0].strip() == "\b":
            found.append(Part("\n".join(lines[1:]), as_it_is=True))
        elif lines:
            found.append(Part(" ".join(line.strip() for line in lines)))
    return found


def _row(parameter: click.Parameter, context: click.Context) -> Row | None:
    record = parameter.get_help_record(context)
    if record is None or not isinstance(parameter, click.Option):
        return None
    name, text = record
    match = re.fullmatch(r"(.*?)\s*\[([^\[\]]*)\]", text, re.DOTALL)
    both = (match[1], match[2]) if match else (text, "")
    return Row(name, " ".join(both[0].split()), both[1].removeprefix("default: "))
