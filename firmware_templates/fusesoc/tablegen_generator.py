"""Build scans for FuseSoC, and write the core of their files: the generator ``tablegen``.

FuseSoC runs it as ``python3 tablegen_generator.py INPUT.yml`` in the folder of the generated core. The ``python3`` is
the first on PATH, of any version from 3.8 on, and need not be that of tablegen: nothing is imported from there.
"""

from __future__ import annotations

import json
import os
import shlex
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any

try:
    import yaml
except ImportError:
    yaml = None

_PARAMETERS = ("scan", "formats", "strict")
# What tools of FuseSoC read. Files of other formats are exported as "user", which no tool reads.
_FILE_TYPES = {
    ".v": "verilogSource-2005",
    ".vh": "verilogSource-2005",
    ".sv": "systemVerilogSource",
    ".vhd": "vhdlSource-2008",
    ".xdc": "xdc",
}
_MEMORY = ".mem"


class Refusal(Exception):
    """A request that cannot be built, in words for the user."""


class Request:
    """A validated instance of the generator: the scans, what they are built with, and the name of the core."""

    def __init__(self, content: dict[str, Any]):
        self.vlnv = str(content["vlnv"])
        self.root = Path(content["files_root"])
        self.parameters: dict[str, Any] = content.get("parameters") or {}
        self.place = _place(self.root, self.vlnv)
        if not str(content.get("gapi", "")).startswith("1."):
            raise Refusal(f"{self.place}: gapi {content.get('gapi')!r} is not 1.0, the interface of this generator")
        for name in self.parameters:
            if name not in _PARAMETERS:
                self.refuse(name, f"is no parameter of the generator tablegen; it has {', '.join(_PARAMETERS)}")
        self.scans = [self.root / name for name in self.names("scan")]
        if not self.scans:
            self.refuse("scan", "is missing: give the scan file, relative to the folder of the core")
        for scan in self.scans:
            if not scan.is_file():
                self.refuse("scan", f"there is no file {scan}")
        self.formats = self.names("formats")
        if "fusesoc" in self.formats:
            self.refuse("formats", "takes no fusesoc: this generator writes the core itself")
        self.strict = self.parameters.get("strict", False)
        if not isinstance(self.strict, bool):
            self.refuse("strict", f"is {self.strict!r}, and has to be true or false")

    def names(self, parameter: str) -> list[str]:
        """Return the names in a parameter that is a name or a list of names; none if it is not given."""
        value = self.parameters.get(parameter, [])
        names = value if isinstance(value, list) else [value]
        for name in names:
            if not isinstance(name, str) or not name:
                self.refuse(parameter, f"is {value!r}, and has to be a name or a list of names")
        return names

    def refuse(self, parameter: str, reason: str) -> None:
        """Raise the refusal of a parameter."""
        raise Refusal(f"{self.place}.parameters.{parameter}: {reason}")


def main(arguments: list[str]) -> int:
    """Run the generator, and return its exit status: that of ``tablegen build`` if it fails."""
    try:
        if len(arguments) != 1:
            raise Refusal("usage: tablegen_generator.py INPUT.yml, which FuseSoC writes")
        if yaml is None:
            raise Refusal(
                f"{sys.executable} has no PyYAML: put the folder of the python3 that has FuseSoC first on PATH, or "
                f"install PyYAML for this one"
            )
        request = Request(yaml.safe_load(Path(arguments[0]).read_text("utf-8")))
        program = _tablegen()
        options = [part for name in ("verilog", *request.formats) for part in ("--format", name)]
        options += ["--strict"] if request.strict else []
        built: dict[Path, Path] = {}
        for scan in request.scans:
            folder = _unused(scan.stem, built)
            status = _run([*program, "build", str(scan), "--output", str(folder), "--quiet", *options])
            if status != 0:
                return status
            built[folder] = scan
        core = _core(request, built)
    except Refusal as refusal:
        sys.stderr.write(f"error: {refusal}\n")
        return 2
    Path("generated.core").write_text("CAPI=2:\n" + yaml.safe_dump(core, sort_keys=False), "utf-8")
    return 0


def _place(root: Path, vlnv: str) -> str:
    """Name the instance of the generator by its core file, or by the name of its core if that is not found."""
    for path in sorted(root.glob("*.core")):
        try:
            content = yaml.safe_load(path.read_text("utf-8"))
            name = str(content["name"]).split(":")
            instances = [key for key, value in content["generate"].items() if value["generator"] == "tablegen"]
        except (OSError, ValueError, LookupError, TypeError, AttributeError, yaml.YAMLError):
            continue  # another core, or one that FuseSoC does not read either
        for instance in instances:
            generated = [*name[:2], f"{name[2]}-{instance}", *name[3:]] if len(name) > 2 else []
            if generated and vlnv.split(":")[: len(generated)] == generated:
                return f"{path}: generate.{instance}"
    return f"{root}: generated core {vlnv}"


def _tablegen() -> list[str]:
    """Return the command that runs tablegen."""
    given = os.environ.get("TABLEGEN")
    if given:
        return shlex.split(given)
    for folder in Path(os.path.abspath(__file__)).parents:
        if folder.name in ("site-packages", "dist-packages"):
            # PREFIX is 1 to 3 folders up: lib/python3.x/site-packages, Lib/site-packages or, of a user, site-packages.
            for prefix in list(folder.parents)[:3]:
                for name in ("bin/tablegen", "Scripts/tablegen.exe"):
                    if (prefix / name).is_file():
                        return [str(prefix / name)]
    on_path = shutil.which("tablegen")
    if on_path is not None:
        return [on_path]
    if find_spec("tablegen") is not None:
        return [sys.executable, "-m", "tablegen"]
    raise Refusal(
        "tablegen is not found: put it on PATH ('pip install piezo-tablegen' does), or set the environment variable "
        "TABLEGEN to its path"
    )


def _run(command: list[str]) -> int:
    """Run tablegen, whose messages go to the user, and return its exit status; 1 if a signal ended it."""
    try:
        status = subprocess.call(command)
    except OSError as error:
        raise Refusal(f"{command[0]} does not run: {error.strerror}") from None
    return status if status >= 0 else 1


def _unused(name: str, built: dict[Path, Path]) -> Path:
    """Return a folder of a name, with a number if another scan of the request has the name."""
    count = 1
    folder = Path(name)
    while folder in built:
        count += 1
        folder = Path(f"{name}_{count}")
    return folder


def _core(request: Request, built: dict[Path, Path]) -> dict[str, Any]:
    """Describe the files of builds, whose scans are given by folder, as one core; shared modules stand there once."""
    sources: list[Any] = []
    memories: list[Any] = []
    others: list[Any] = []
    places: dict[str, Path] = {}
    for folder, scan in built.items():
        manifest = json.loads((folder / "manifest.json").read_text("ascii"))
        for name in sorted(manifest["files"]):
            path, suffix = (folder / name).as_posix(), Path(name).suffix
            if suffix not in _FILE_TYPES and suffix != _MEMORY:
                others.append(path)
                continue
            earlier = places.setdefault(name, folder)
            if earlier is not folder:
                if (earlier / name).read_bytes() != (folder / name).read_bytes():
                    request.refuse("scan", f"{built[earlier]} and {scan} both write {name}: give them different names")
            elif suffix == _MEMORY:
                memories.append({path: {"copyto": name}})  # $readmemh looks in the folder where the tool runs
            else:
                include = {"is_include_file": True} if suffix == ".vh" else {}
                sources.append({path: {"file_type": _FILE_TYPES[suffix], **include}})
    filesets: dict[str, Any] = {
        "rtl": {"files": sources},
        "memories": {"files": memories, "file_type": "user"},
    }
    if others:  # FuseSoC refuses a fileset without files
        filesets["others"] = {"files": others, "file_type": "user"}
    return {"name": request.vlnv, "filesets": filesets, "targets": {"default": {"filesets": list(filesets)}}}


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
