"""Compensated scan waveforms for piezo scanners, as fixed-point tables in C, Verilog and other formats.

From a scan file to arrays and files in two lines::

    scan = tablegen.build("scan.toml", "build")     # plan, certificate, files
    plot(scan.x.time_s, scan.x.volts)               # numpy arrays of one line, a value a tick

What is public stands in ``tablegen.__all__`` and docs/python.md: ``load``, ``plan``, ``certify`` and ``build`` make a
scan, ``variants`` and ``build_many`` many, ``read_build`` and ``verify`` take one from its directory, ``Device`` talks
to an instrument. ``calibrate``, ``refine`` and ``correct`` take measurements and images; ``Laboratory`` simulates them.
Every command is one function of its name. Everything else may change. Names are loaded when they are first used, so
that importing tablegen costs nothing.
"""

import re
from importlib import import_module
from pathlib import Path

from tablegen.version import __version__

# The stub beside this file is the list: type checkers read it as it is.
_STUB = Path(__file__).with_suffix(".pyi").read_text("ascii")
_HOMES = {
    name: module
    for module, names in re.findall(r"^from (\S+) import (\([^)]*\)|.+)$", _STUB, re.MULTILINE)
    for name in re.findall(r"(\w+) as ", names)
    if name != "__version__"
}

__all__ = [*_HOMES, "__version__"]


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module 'tablegen' has no attribute {name!r}; it has {', '.join(_HOMES)}")
    value = getattr(import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*__all__, "__doc__"])
