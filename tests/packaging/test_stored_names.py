"""Stored names are nouns of the field: no variable, argument or field of the package is a bare participle."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

import tablegen

PACKAGE = Path(tablegen.__file__).parent
# Participles that say what happened to a value, and not what it is. ``left`` is not here: it is a side.
BANNED = frozenset(
    "asked done drawn found given held judged kept learnt made said seen shown taken told wanted".split()  # noqa: SIM905
)
# Keys of files that were written before: a field has the name of its key.
KEYS = {("manifest/fields.py", "asked")}


def stored_names(source: str) -> Iterator[tuple[int, str]]:
    """Yield the line and the name of each variable, argument and attribute that a source stores."""
    for node in ast.walk(ast.parse(source)):
        match node:
            case ast.Name(id=name, ctx=ast.Store()) | ast.Attribute(attr=name, ctx=ast.Store()) | ast.arg(arg=name):
                yield node.lineno, name
            case ast.ExceptHandler(name=str(name)) | ast.MatchAs(name=str(name)) | ast.MatchStar(name=str(name)):
                yield node.lineno, name
            case ast.alias(asname=str(name)):
                yield node.lineno, name


def banned_names(source: str) -> list[tuple[int, str]]:
    """Return the banned names that a source stores; a leading or trailing underscore does not make one a noun."""
    return sorted((line, name) for line, name in stored_names(source) if name.strip("_") in BANNED)


def test_no_stored_name_is_a_participle() -> None:
    names = []
    for path in sorted(PACKAGE.rglob("*.py")):
        module = path.relative_to(PACKAGE).as_posix()
        for line, name in banned_names(path.read_text("utf-8")):
            if (module, name) not in KEYS:
                names.append(f"tablegen/{module}:{line}: {name}")
    assert names == []


def test_exceptions_are_needed() -> None:
    for module, name in KEYS:
        assert name in [one for _, one in banned_names((PACKAGE / module).read_text("utf-8"))]


@pytest.mark.parametrize(
    "source",
    [
        "found = 1",
        "found: int = 1",
        "found, other = 1, 2",
        "(found := 1)",
        "for found in (): pass",
        "[found for found in ()]",
        "def f(found): pass",
        "def f(*, _found=0): pass",
        "lambda found: 0",
        "class C:\n    found: int",
        "self._found = 1",
        "with open('') as found: pass",
        "try: pass\nexcept ValueError as found: pass",
        "import numpy as found",
        "match 1:\n    case found: pass",
        "match []:\n    case [*found]: pass",
    ],
)
def test_a_participle_is_found_wherever_it_is_stored(source: str) -> None:
    assert [name.strip("_") for _, name in banned_names(source)] == ["found"]


def test_nouns_sides_and_uses_pass() -> None:
    assert banned_names("left = right = peaks = 1\nfound_peaks = other.found(found)\n") == []
