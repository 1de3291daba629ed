"""The formats of a build: a module here has the name of its format and a ``FORMAT``; entry points add others.

A package of somebody else adds one as an entry point of the group ``tablegen.formats``: its name is the format's, its
object an instance of ``tablegen.emit.format.Format``.
"""

from collections.abc import Iterable
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from tablegen.emit.format import Format

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

GROUP = "tablegen.formats"


class UnknownFormat(ValueError):
    """There is no format of this name, or it cannot be used; the message says what there is, or why."""


def names() -> list[str]:
    """All formats that a build can have, in order: those of tablegen, and those that other packages add."""
    return sorted({*_own(), *_others()})


def own_names() -> list[str]:
    """The formats of tablegen."""
    return sorted(_own())


@cache
def get(name: str) -> Format:
    """The format of a name. Raises ``UnknownFormat``."""
    if name in _own():
        found: object = import_module(f"{__name__}.{_own()[name]}").FORMAT
    elif name in _others():
        found = _loaded(name, _others()[name])
    else:
        raise UnknownFormat(f"{name!r} is not a format; formats are {', '.join(names())}")
    if not isinstance(found, Format) or found.name != name:
        raise UnknownFormat(
            f"{name!r} of {_package(_others()[name][0])} is no tablegen.emit.format.Format of that name"
        )
    return found


def chosen(wanted: Iterable[str]) -> list[Format]:
    """The formats of these names, each once. Raises ``UnknownFormat``."""
    return [get(name) for name in dict.fromkeys(wanted)]


@cache
def _own() -> dict[str, str]:
    """Modules of this folder by the names of their formats."""
    modules = (path.stem for path in Path(__file__).parent.glob("*.py"))
    return {module.replace("_", "-"): module for module in modules if module != "__init__"}


@cache
def _others() -> "dict[str, list[EntryPoint]]":
    from importlib.metadata import entry_points  # a good part of what a build costs, and seldom needed

    found: dict[str, list[EntryPoint]] = {}
    for entry in entry_points(group=GROUP):
        if entry.name not in _own():
            found.setdefault(entry.name, []).append(entry)
    return found


def _loaded(name: str, entries: "list[EntryPoint]") -> object:
    """What the one entry point of a name leads to."""
    entry, *more = entries
    if more:
        packages = " and ".join(sorted(map(_package, entries)))
        raise UnknownFormat(f"{name!r} is a format of {packages}; uninstall all of them but one")
    try:
        return entry.load()
    except Exception as error:
        why = f"{type(error).__name__}: {error}"
        raise UnknownFormat(f"{name!r} of {_package(entry)} cannot be loaded: {why}") from error


def _package(entry: "EntryPoint") -> str:
    return entry.dist.name if entry.dist is not None else entry.value
