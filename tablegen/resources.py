"""Folders of files that ship inside the package."""

from importlib import import_module
from pathlib import Path
from typing import Literal

PACKAGE = Path(__file__).parent


def resource_folder(name: Literal["examples", "firmware_templates"]) -> Path:
    """Where the example files, or the templates and the runtime, are installed."""
    return Path(str(import_module(f"tablegen.{name}").__file__)).parent


def verilog_runtime() -> list[Path]:
    """The Verilog sequencer and its link, one module a file, in order of name; every build copies them."""
    return sorted((resource_folder("firmware_templates") / "verilog").glob("*.v"))


def c_runtime() -> list[Path]:
    """The C sequencer, headers and sources, in order of name; every build copies it."""
    return sorted(set((resource_folder("firmware_templates") / "c").glob("dac_*.[ch]")) - set(c_link()))


def c_link() -> list[Path]:
    """The device's end of the serial link in C, which needs the sequencer; every build copies it too."""
    return sorted((resource_folder("firmware_templates") / "c").glob("dac_link*.[ch]"))
