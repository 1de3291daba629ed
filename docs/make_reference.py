"""Write docs/commands/ from the command line and docs/api.md from the docstrings, so that they cannot differ.

Usage: python docs/make_reference.py
"""

import dataclasses
import inspect
import re
import sys
from collections.abc import Callable
from pathlib import Path
from textwrap import fill

sys.path.insert(0, str(Path(__file__).parent))

import msgspec
from command_pages import CommandPage, Row, pages

import tablegen

DOCS = Path(__file__).parent
COMMANDS = "commands"
API_HEAD = """\
# The Python interface

All that `import tablegen` offers, from the docstrings. [tablegen in Python](python.md) explains how to use it, with
examples. `python docs/make_reference.py` writes this page.
"""
COMMANDS_HEAD = """\
# Commands

Every command with its options, from `tablegen COMMAND --help`. `python docs/make_reference.py` writes these pages.
"""


def files() -> dict[str, str]:
    """Every page by its name in docs/."""
    found = {f"{COMMANDS}/{page.file}.md": command_page(page) for page in pages()}
    rows = [f"| [{page.name}]({page.file}.md) | {_inline(page.short)} |" for page in pages()]
    found[f"{COMMANDS}/README.md"] = "\n".join([COMMANDS_HEAD, "| command | what it does |", "|---|---|", *rows, ""])
    found["api.md"] = api_page()
    return found


def command_page(page: CommandPage) -> str:
    """The page of a command."""
    parts = [f"# {page.name}", f"```text\n{page.usage}\n```"]
    for part in page.parts:
        parts.append(f"```text\n{part.text}\n```" if part.as_it_is else _filled(part.text))
    if page.commands:
        rows = [f"| [{row.name}]({page.file}-{row.name}.md) | {_inline(row.text)} |" for row in page.commands]
        parts.append("\n".join(["| command | what it does |", "|---|---|", *rows]))
    if page.options:
        head = ["## Options", "", "| option | meaning | default, range |", "|---|---|---|"]
        parts.append("\n".join([*head, *(_option(row) for row in page.options)]))
    return "\n\n".join(parts) + "\n"


def _option(row: Row) -> str:
    extra = f"`{row.extra}`" if row.extra else ""
    name = row.name.replace("|", "\\|")
    return f"| `{name}` | {_inline(row.text)} | {extra} |"


def _filled(text: str) -> str:
    return fill(_inline(text), 120, break_long_words=False, break_on_hyphens=False)


def _inline(text: str) -> str:
    """Names of files and keys as code, since Markdown would read their stars and underscores."""
    pieces = re.split(r"(`[^`]*`)", text)
    return "".join(piece if piece.startswith("`") else _coded(piece) for piece in pieces).replace("|", "\\|")


def _coded(text: str) -> str:
    return re.sub(r"[\w./-]*[*_<>\[\]][^\s,;()]*?(?=[.:]?(?:[\s,;()]|$))", lambda match: f"`{match[0]}`", text)


def api_page() -> str:
    """Functions, then classes, then exceptions, each in the order of ``tablegen.__all__``."""
    things = [(name, getattr(tablegen, name)) for name in tablegen.__all__ if name != "__version__"]
    functions = [thing for thing in things if inspect.isfunction(thing[1])]
    errors = [thing for thing in things if inspect.isclass(thing[1]) and issubclass(thing[1], Exception)]
    classes = [thing for thing in things if thing not in functions and thing not in errors]
    parts = [API_HEAD]
    for title, group in (("Functions", functions), ("Classes", classes), ("Exceptions", errors)):
        parts.append(f"## {title}\n")
        parts += [_thing(name, thing) for name, thing in group]
    return "\n".join(parts)


def _thing(name: str, thing: object) -> str:
    parts = [f"### {name}", ""]
    if inspect.isfunction(thing):
        parts += [f"```text\ntablegen.{name}{_signature(thing)}\n```", ""]
    parts += [_docstring(thing), ""]
    if inspect.isclass(thing):
        rows = [*_fields(thing), *_members(thing)]
        if rows:
            parts += ["| | |", "|---|---|", *rows, ""]
    return "\n".join(parts)


def _signature(function: Callable[..., object]) -> str:
    signature = inspect.signature(function)
    shown, keywords = [], False
    for parameter in signature.parameters.values():
        if parameter.kind is parameter.KEYWORD_ONLY and not keywords:
            shown.append("*")
            keywords = True
        default = parameter.default
        value = "..." if callable(default) else repr(default)
        given = "" if default is parameter.empty else f" = {value}"
        shown.append(f"{parameter.name}: {_type(parameter.annotation)}{given}")
    back = f" -> {_type(signature.return_annotation)}"
    line = f"({', '.join(shown)}){back}"
    return line if len(line) < 90 else "(\n" + "".join(f"    {one},\n" for one in shown) + f"){back}"


def _type(annotation: object) -> str:
    """Without the modules of names."""
    if isinstance(annotation, str):
        return annotation
    return re.sub(r"\b(?:[A-Za-z_]+\.)+(?=[A-Z])", "", inspect.formatannotation(annotation))


_SECTION = re.compile(r"^(Parameters|Returns|Yields|Raises|Examples)\n-+\n", re.MULTILINE)


def _docstring(thing: object) -> str:
    """The text, then each section of the numpy convention: lists of what a function takes, and its example as code."""
    text, *sections = _SECTION.split(inspect.getdoc(thing) or "")
    parts = [_paragraphs(text.strip().replace("``", "`"))]
    for title, body in zip(sections[::2], sections[1::2], strict=True):
        if title == "Examples":
            parts.append(f"```pycon\n{body.strip()}\n```")
        else:
            parts += [f"**{title}**", "\n".join(_entries(body.replace("``", "`")))]
    return "\n\n".join(parts)


def _paragraphs(text: str) -> str:
    return "\n\n".join(
        block if block.startswith(("    ", "- ", "|")) else fill(" ".join(block.split()), 120, break_on_hyphens=False)
        for block in re.split(r"\n\n", text)
    )


def _entries(body: str) -> list[str]:
    """A line of a list for each name or type of a section, with what stands below it."""
    found = []
    for head, *rest in (entry.splitlines() for entry in re.split(r"\n(?=\S)", body.strip())):
        names, colon, kind = head.partition(" : ")
        title = f"`{names}`" + (f" ({kind})" if colon else "")
        words = " ".join(line.strip() for line in rest)
        text = fill(f"- {title}: {words}", 120, subsequent_indent="  ", break_on_hyphens=False, break_long_words=False)
        found.append(text)
    return found


def _fields(kind: type) -> list[str]:
    """The fields of a struct or a dataclass; what they are says the docstring of the class."""
    if issubclass(kind, msgspec.Struct):
        found: tuple[str, ...] = kind.__struct_fields__
    else:
        found = tuple(field.name for field in dataclasses.fields(kind)) if dataclasses.is_dataclass(kind) else ()
    names = [f"`{name}`" for name in found if not name.startswith("_")]
    return [f"| {', '.join(names)} | fields |"] if names else []


def _members(kind: type) -> list[str]:
    rows = []
    for name, member in vars(kind).items():
        if name.startswith("_") or not (inspect.getdoc(member) and _is_member(member)):
            continue
        summary = _summary(inspect.getdoc(member) or "").replace("|", "\\|")
        shown = name if isinstance(member, property) or not callable(_function(member)) else f"{name}()"
        rows.append(f"| `{shown}` | {summary} |")
    return rows


def _summary(docstring: str) -> str:
    """Return a docstring as one line of a table: its text, its parameters, and what it raises."""
    text, *sections = _SECTION.split(docstring)
    words = [*text.split()]
    for title, body in zip(sections[::2], sections[1::2], strict=True):
        if title in ("Parameters", "Raises"):
            for head, *rest in (entry.splitlines() for entry in re.split(r"\n(?=\S)", body.strip())):
                words += [*(["Raises"] if title == "Raises" else []), f"`{head.strip()}`:", *" ".join(rest).split()]
    return " ".join(words).replace("``", "`")


def _is_member(member: object) -> bool:
    return isinstance(member, property | classmethod | staticmethod) or inspect.isfunction(member) or _cached(member)


def _cached(member: object) -> bool:
    return type(member).__name__ == "cached_property"


def _function(member: object) -> object:
    return None if _cached(member) else getattr(member, "__func__", member)


def main() -> None:
    """Write what differs, and remove pages of commands that are no more."""
    made = files()
    for name, text in made.items():
        (DOCS / name).parent.mkdir(exist_ok=True)
        (DOCS / name).write_text(text, encoding="utf-8")
    for path in (DOCS / COMMANDS).glob("*.md"):
        if f"{COMMANDS}/{path.name}" not in made:
            path.unlink()


if __name__ == "__main__":
    main()
