"""Guard formats and models of other distributions: a failure in one ends in a message with the distribution's name."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import TYPE_CHECKING

from tablegen.base.input_errors import shortened

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

GROUPS = ("tablegen.formats", "tablegen.models")


class PluginFailed(Exception):
    """A plug-in does not do what it should; the message names its distribution, and why."""


def distribution(entry: "EntryPoint") -> str:
    """Return the name of the distribution of an entry point, or its object where it has none."""
    name = None if entry.dist is None else entry.dist.name
    return str(name) if name else entry.value


def cause(error: BaseException) -> str:
    """Return an exception in one line: its type and its text."""
    text = shortened(str(error), 500)
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


@contextmanager
def guarded(name: str, of: str, what: str, *passed: type[BaseException]) -> Iterator[None]:
    """Turn whatever the plug-in ``name`` of the distribution ``of`` raises inside into ``PluginFailed``.

    Exceptions of the types ``passed`` go through; ``what`` names the failure, as in "cannot be loaded". ``SystemExit``
    would end the command with the plug-in's status.

    Raises
    ------
    PluginFailed
        If the block raises; the message has plug-in, distribution and cause.
    KeyboardInterrupt
        If it was interrupted; the message names the plug-in.
    """
    try:
        yield
    except PluginFailed:
        raise
    except KeyboardInterrupt as interruption:
        raise KeyboardInterrupt(f"in {name!r} of {of}") from interruption
    except BaseException as error:
        if isinstance(error, passed):
            raise
        raise PluginFailed(f"{name!r} of {of} {what}: {cause(error)}") from error


def responsible(trace: TracebackType | None) -> str | None:
    """Return the distribution of the innermost frame that is a plug-in's; None where no plug-in took part."""
    homes = _homes()
    name = None
    while trace is not None:
        module = str(trace.tb_frame.f_globals.get("__name__", ""))
        name = homes.get(module) or homes.get(module.partition(".")[0]) or name
        trace = trace.tb_next
    return name


def loaded() -> list[str]:
    """Return the distributions whose plug-ins this process has imported, in order."""
    return sorted({name for module, name in _homes().items() if module in sys.modules})


def _homes() -> dict[str, str]:
    """Return distributions by module, and by its package where that is not tablegen itself."""
    from importlib.metadata import entry_points  # seldom needed

    homes: dict[str, str] = {}
    for group in GROUPS:
        for entry in entry_points(group=group):
            for module in (entry.module, entry.module.partition(".")[0]):
                if module != "tablegen":
                    homes[module] = distribution(entry)
    return homes
