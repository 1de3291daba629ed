"""The formats of a build: a module here has the name of its format and a ``FORMAT``; entry points add others.

A third-party package adds one as an entry point of the group ``tablegen.formats``: its name is the format's, its
object an instance of ``tablegen.emit.format.Format``.
"""

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from tablegen.base.input_errors import Unphysical
from tablegen.base.plugins import PluginFailed, distribution, guarded
from tablegen.emit.content import Content
from tablegen.emit.format import Format

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

GROUP = "tablegen.formats"


class UnknownFormat(ValueError):
    """A format that does not exist or cannot be used; the message lists the formats, or has the reason."""


class FormatFailed(UnknownFormat, PluginFailed):
    """The failure of a format of another distribution, or a result of it that cannot be written."""


def names() -> list[str]:
    """List all formats of a build in order: those of tablegen, and those that other packages add."""
    return sorted({*_own(), *_others()})


def own_names() -> list[str]:
    """List the formats of tablegen."""
    return sorted(_own())


@cache
def get(name: str) -> Format:
    """Return the format of a name.

    Raises
    ------
    UnknownFormat
        If no format has that name, or an installed package has no ``Format`` under it.
    """
    if name in _own():
        candidate: object = import_module(f"{__name__}.{_own()[name]}").FORMAT
    elif name in _others():
        candidate = _loaded(name, _others()[name])
    else:
        raise UnknownFormat(f"{name!r} is not a format; formats are {', '.join(names())}")
    if not isinstance(candidate, Format) or candidate.name != name:
        raise UnknownFormat(
            f"{name!r} of {distribution(_others()[name][0])} is no tablegen.emit.format.Format of that name"
        )
    for attribute in ("purpose", "file_names"):
        if not isinstance(getattr(candidate, attribute, None), str):
            raise UnknownFormat(f"{name!r} of {distribution(_others()[name][0])}: its {attribute} is not a text")
    return candidate


def files_of(one: Format, content: Content) -> dict[str, bytes]:
    """Render the files of a format by name, without its runtime.

    Raises
    ------
    Unphysical
        If the format cannot hold the build.
    FormatFailed
        If a format of another distribution fails, or returns anything but names with bytes.
    """
    if one.name in _own():
        return one.files(content)
    with failing_as_format(one):
        files: object = one.files(content)
    if not isinstance(files, Mapping):
        raise FormatFailed(f"{_described(one)}: files() returned {_kind(files)}; a dict of names and bytes is needed")
    for name, text in files.items():
        if not isinstance(name, str) or not isinstance(text, bytes):
            wrong = f"the name {name!r}" if not isinstance(name, str) else f"{_kind(text)} for {name!r}"
            raise FormatFailed(f"{_described(one)}: files() returned {wrong}; names are text, and contents bytes")
    return dict(files)


def runtime_paths(of: Format, with_z: bool) -> list[Path]:
    """List the files that go with a format unchanged, in a build with the output z or in one without."""
    return [*of.runtime(), *(of.runtime_of_z() if with_z else ())]


@contextmanager
def failing_as_format(one: Format) -> Iterator[None]:
    """Report an exception inside a format of another distribution; one of an own format is a fault of the program.

    Raises
    ------
    FormatFailed
        If the format raises anything but ``Unphysical`` and ``UnknownFormat``.
    """
    if one.name in _own():
        yield
        return
    try:
        with guarded(one.name, _home(one), "failed", Unphysical, UnknownFormat):
            yield
    except PluginFailed as failure:
        raise FormatFailed(*failure.args) from failure.__cause__


def _described(one: Format) -> str:
    return f"{one.name!r} of {_home(one)}"


def _home(one: Format) -> str:
    entries = _others().get(one.name)
    return distribution(entries[0]) if entries else type(one).__module__


def _kind(value: object) -> str:
    return f"an object of type {type(value).__name__}"


def chosen(names: Iterable[str]) -> list[Format]:
    """Return the formats of these names, and those that they need, each once.

    Raises
    ------
    UnknownFormat
        If a name is unknown.
    """
    return [get(name) for name in dict.fromkeys(each for name in names for each in (name, *get(name).needs))]


@cache
def _own() -> dict[str, str]:
    """Return the modules of this folder by the names of their formats."""
    modules = (path.stem for path in Path(__file__).parent.glob("*.py"))
    return {module.replace("_", "-"): module for module in modules if module != "__init__"}


@cache
def _others() -> "dict[str, list[EntryPoint]]":
    from importlib.metadata import entry_points  # a good part of what a build costs, and seldom needed

    entry_points_by_name: dict[str, list[EntryPoint]] = {}
    for entry in entry_points(group=GROUP):
        if entry.name not in _own():
            entry_points_by_name.setdefault(entry.name, []).append(entry)
    return entry_points_by_name


def _loaded(name: str, entries: "list[EntryPoint]") -> object:
    """Load what the one entry point of a name leads to."""
    entry, *more = entries
    if more:
        packages = " and ".join(sorted(map(distribution, entries)))
        raise UnknownFormat(f"{name!r} is a format of {packages}; uninstall all of them but one")
    try:
        with guarded(name, distribution(entry), "cannot be loaded"):
            return entry.load()
    except PluginFailed as failure:
        raise FormatFailed(*failure.args) from failure.__cause__
