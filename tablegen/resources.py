"""Folders of files that ship inside the package."""

from importlib import import_module
from pathlib import Path
from typing import Literal


def resource_folder(name: Literal["examples", "firmware_templates"]) -> Path:
    """Where the example files, or the templates and the runtime, are installed."""
    return Path(str(import_module(f"tablegen.{name}").__file__)).parent


def verilog_runtime() -> list[Path]:
    """The Verilog sequencer, one module a file, in order of name; every build copies it."""
    return sorted((resource_folder("firmware_templates") / "verilog").glob("dac_*.v"))
