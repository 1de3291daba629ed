"""Folders of files that ship inside the package."""

from importlib import import_module
from pathlib import Path
from typing import Literal

from tablegen.installation import records


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


def deciding_files() -> list[Path]:
    """What of this package decides the bytes of a build: its modules, the templates and the runtime, in order of path.

    In an installed package the record of the installation too, whose path has the version: package managers that give
    files the times of an archive would otherwise hide a change of version from make.
    """
    package = Path(str(import_module("tablegen").__file__)).parent
    apart = ("calibration", "cli", "link", "refinement", "verification", "virtual", "examples", "firmware_templates")
    others = {package / name for name in (*apart, "manifest/read.py")}
    modules = {path for path in package.rglob("*.py") if not others.intersection((path, *path.parents))}
    templates = resource_folder("firmware_templates")
    emitted = {path for language in ("c", "verilog") for path in (templates / language).iterdir() if path.is_file()}
    return sorted({*modules, *emitted, *records(package.parent)})
