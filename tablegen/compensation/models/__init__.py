"""The models of what a piezo does: a module here has the name of its model and a ``MODEL``; entry points add others.

A package of somebody else adds one as an entry point of the group ``tablegen.models``: its name is the model's, its
object a subclass of ``tablegen.compensation.model.Hysteresis`` with that tag.
"""

from functools import cache
from importlib import import_module
from pathlib import Path

from tablegen.compensation.model import Hysteresis

GROUP = "tablegen.models"
DEFAULT = "harmonic"  # of a table that names none
UNCOMPENSATED = "triangle"  # of an axis without a table


class UnknownModel(ValueError):
    """There is no model of this name, or it cannot be used; the message says what there is, or why."""


def names() -> list[str]:
    """The models of tablegen, in order."""
    return sorted(path.stem for path in Path(__file__).parent.glob("*.py") if path.stem != "__init__")


def own() -> list[type[Hysteresis]]:
    """The same, as types of their tables."""
    return [get(name) for name in names()]


@cache
def get(name: str) -> type[Hysteresis]:
    """The model of a name: the type of its table. Raises ``UnknownModel``."""
    if name in names():
        found: object = import_module(f"{__name__}.{name}").MODEL
        home = "tablegen"
    else:
        found, home = _of_others(name)
    if not (isinstance(found, type) and issubclass(found, Hysteresis) and found.model() == name):
        raise UnknownModel(f"{name!r} of {home} is no tablegen.compensation.model.Hysteresis of that name")
    return found


def _of_others(name: str) -> tuple[object, str]:
    """What the one entry point of a name leads to, and its package."""
    from importlib.metadata import entry_points  # a good part of what a build costs, and seldom needed

    entries = list(entry_points(group=GROUP, name=name))
    homes = sorted(entry.dist.name if entry.dist is not None else entry.value for entry in entries)
    if not entries:
        raise UnknownModel(f"{name!r} is not one of {', '.join(map(repr, names()))}")
    if len(entries) > 1:
        raise UnknownModel(f"{name!r} is a model of {' and '.join(homes)}; uninstall all of them but one")
    try:
        return entries[0].load(), homes[0]
    except Exception as error:
        why = f"{type(error).__name__}: {error}"
        raise UnknownModel(f"{name!r} of {homes[0]} cannot be loaded: {why}") from error
