"""The hysteresis models: a module here has the name of its model and a ``MODEL``; entry points add others.

Another distribution adds one as an entry point of the group ``tablegen.models``: its name is the model's, its
object a subclass of ``tablegen.compensation.model.Hysteresis`` with that tag.
"""

from functools import cache
from importlib import import_module
from pathlib import Path

from tablegen.base.input_errors import Rejected, Unphysical
from tablegen.base.plugins import PluginFailed, distribution, guarded
from tablegen.compensation.line import LineRequest, LineShape
from tablegen.compensation.model import Hysteresis
from tablegen.compensation.model_problems import ModelProblems

GROUP = "tablegen.models"
DEFAULT = "harmonic"  # of a table that names none
UNCOMPENSATED = "triangle"  # of an axis without a table
IDENTIFIED = "operator"  # which a scan at an angle needs


class UnknownModel(ValueError):
    """No model has this name, or it cannot be used; the message lists the names, or gives the reason."""


def names() -> list[str]:
    """Return the names of tablegen's own models, in order."""
    return sorted(path.stem for path in Path(__file__).parent.glob("*.py") if path.stem != "__init__")


def own() -> list[type[Hysteresis]]:
    """Return tablegen's own models, as types of their tables."""
    return [get(name) for name in names()]


@cache
def get(name: str) -> type[Hysteresis]:
    """Return the model of a name: the type of its table.

    Raises
    ------
    UnknownModel
        If there is no such model, or it cannot be loaded.
    """
    if name in names():
        model: object = import_module(f"{__name__}.{name}").MODEL
        home = "tablegen"
    else:
        model, home = _of_others(name)
    if not (isinstance(model, type) and issubclass(model, Hysteresis) and model.model() == name):
        raise UnknownModel(f"{name!r} of {home} is no tablegen.compensation.model.Hysteresis of that name")
    return model


def laws_beside(table: Hysteresis) -> type[Hysteresis] | None:
    """Return the most detailed model of the laws that the table of an identified model has branches for."""
    simpler = [kind for kind in own() if kind.compensates and kind.order < table.order]
    return max((kind for kind in simpler if kind.like(table) is not None), key=lambda kind: kind.order, default=None)


def line_of(table: Hysteresis, request: LineRequest, problems: ModelProblems) -> LineShape | None:
    """Return the line that a model makes; None where ``problems`` grew.

    Raises
    ------
    PluginFailed
        If the model of another distribution fails, or returns anything else.
    """
    if type(table).__module__.startswith(f"{__name__}."):
        return table.line(request, problems)
    name = table.model()
    home = _home(name, type(table).__module__)
    with guarded(name, home, "failed", Rejected, Unphysical):
        line: object = table.line(request, problems)
    if line is not None and not isinstance(line, LineShape):
        raise PluginFailed(f"{name!r} of {home}: line() returned an object of type {type(line).__name__}, no LineShape")
    if line is None and not problems.count:
        raise PluginFailed(f"{name!r} of {home}: line() returned None, and no problem that says why")
    return line


@cache
def _home(name: str, module: str) -> str:
    try:
        return _of_others(name)[1]
    except UnknownModel:  # a class that was made in this process
        return module


def _of_others(name: str) -> tuple[object, str]:
    """Return the object of the one entry point of a name, and its distribution."""
    from importlib.metadata import entry_points  # a good part of what a build costs, and seldom needed

    entries = list(entry_points(group=GROUP, name=name))
    homes = sorted(map(distribution, entries))
    if not entries:
        raise UnknownModel(f"{name!r} is not one of {', '.join(map(repr, names()))}")
    if len(entries) > 1:
        raise UnknownModel(f"{name!r} is a model of {' and '.join(homes)}; uninstall all of them but one")
    try:
        with guarded(name, homes[0], "cannot be loaded"):
            return entries[0].load(), homes[0]
    except PluginFailed as failure:
        raise UnknownModel(*failure.args) from failure.__cause__
