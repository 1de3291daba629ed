"""Folders of files that ship inside the package."""

import os
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Literal

PACKAGE = Path(__file__).parent.parent
_C_LINK, _C_STORE = "dac_link", "dac_store"


def resource_folder(name: Literal["examples", "firmware_templates"]) -> Path:
    """Return the folder where the example files, or the templates and the runtime, are installed."""
    return Path(str(import_module(f"tablegen.{name}").__file__)).parent


def verilog_runtime() -> list[Path]:
    """Return the Verilog sequencer and its link, one module a file, in order of name; every build copies them."""
    return list(_runtime("verilog", ".v"))


def verilog_slow_part() -> list[Path]:
    """Return the modules of a slow part, in order of name; a build of a scan at an angle copies them too."""
    folder = resource_folder("firmware_templates") / "verilog" / "slow"
    return sorted(folder.glob("*.v"))


def verilog_by_turns() -> list[Path]:
    """Return the modules that play both axes by turns, in order of name; builds copy them, except at an angle."""
    folder = resource_folder("firmware_templates") / "verilog" / "pair"
    return sorted(folder.glob("*.v"))


def c_runtime() -> list[Path]:
    """Return the C sequencer, headers and sources, in order of name; every build copies it."""
    return [path for path in _runtime("c", ".c", ".h") if not path.name.startswith((_C_LINK, _C_STORE))]


def c_link() -> list[Path]:
    """Return the device's end of the serial link in C, which needs the sequencer; every build copies it too."""
    return [path for path in _runtime("c", ".c", ".h") if path.name.startswith(_C_LINK)]


def c_store() -> list[Path]:
    """Return the kept programs in C, which need ``dac_link_frame.c``; every build copies them too."""
    return [path for path in _runtime("c", ".c", ".h") if path.name.startswith(_C_STORE)]


def own_runtime_folders() -> tuple[Path, ...]:
    """Return the folders of all of these files."""
    return tuple(resource_folder("firmware_templates") / language for language in ("c", "verilog"))


@cache
def _runtime(language: str, *endings: str) -> tuple[Path, ...]:
    folder = resource_folder("firmware_templates") / language
    return tuple(folder / name for name in sorted(os.listdir(folder)) if name.endswith(endings))
