"""Folders of files that ship inside the package."""

import os
from importlib import import_module
from pathlib import Path
from typing import Literal

PACKAGE = Path(__file__).parent


def resource_folder(name: Literal["examples", "firmware_templates"]) -> Path:
    """Where the example files, or the templates and the runtime, are installed."""
    return Path(str(import_module(f"tablegen.{name}").__file__)).parent


def verilog_runtime() -> list[Path]:
    """The Verilog sequencer and its link, one module a file, in order of name; every build copies them."""
    return _runtime("verilog", "", (".v",))


def c_runtime() -> list[Path]:
    """The C sequencer, headers and sources, in order of name; every build copies it."""
    link = c_link()
    return [path for path in _runtime("c", "dac_", (".c", ".h")) if path not in link]


def c_link() -> list[Path]:
    """The device's end of the serial link in C, which needs the sequencer; every build copies it too."""
    return _runtime("c", "dac_link", (".c", ".h"))


def own_runtime_folders() -> tuple[Path, ...]:
    """Where all of these files stand."""
    return tuple(resource_folder("firmware_templates") / language for language in ("c", "verilog"))


def _runtime(language: str, beginning: str, endings: tuple[str, ...]) -> list[Path]:
    folder = resource_folder("firmware_templates") / language
    names = sorted(os.listdir(folder))
    return [folder / name for name in names if name.startswith(beginning) and name.endswith(endings)]
