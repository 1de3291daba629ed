"""Dependency files in the format of ``gcc -MD -MP``, which make, CMake and Ninja read."""

import os
import re
import sys
from collections.abc import Iterable
from pathlib import Path

from tablegen.base.installation import records
from tablegen.base.resources import PACKAGE
from tablegen.emit.formats import chosen, failing_as_format, own_names


def depfile(target: str, prerequisites: Iterable[Path]) -> bytes:
    """A rule for the target, and a target without a rule for each prerequisite.

    The latter are why a prerequisite that was removed makes its dependents be built again, and not make fail.
    """
    names = [_escaped(os.fsencode(path)) for path in prerequisites]
    rule = b" \\\n ".join([_escaped(os.fsencode(target)) + b":", *names])
    return b"\n".join([rule + b"\n", *(b"%s:\n" % name for name in names)])


def _escaped(name: bytes) -> bytes:
    """A file name as make reads it: a backslash counts only where it stands before what it escapes."""
    return re.sub(rb"(\\*)([ #:])", rb"\1\1\\\2", name).replace(b"$", b"$$")


# What no build reads, beside the commands: the independent side, and what works out the input of builds.
_OTHER_FOLDERS = (
    *("api", "calibration", "cli", "library", "link", "refinement", "sweep", "verification", "virtual"),
    "examples",
)
_OTHER_MODULES = ("manifest/read.py", "firmware_templates/__init__.py")


def deciding_files(formats: Iterable[str]) -> list[Path]:
    """What decides the bytes of a build in these formats, beside its input, in order of path.

    The modules of this package, those of the formats, their templates and their runtime. In an installed package the
    record of the installation too, whose path has the version: package managers that give files the times of an
    archive would otherwise hide a change of version from make.
    """
    wanted = chosen(formats)
    names = {each.name for each in wanted}
    others = {PACKAGE / name for name in (*_OTHER_FOLDERS, *_OTHER_MODULES)}
    others |= {PACKAGE / "emit" / "formats" / f"{n.replace('-', '_')}.py" for n in own_names() if n not in names}
    others.add(PACKAGE / "firmware_templates")
    modules = {path for path in PACKAGE.rglob("*.py") if not others.intersection((path, *path.parents))}
    for each in wanted:
        with failing_as_format(each):
            modules |= {Path(str(sys.modules[type(each).__module__].__file__)), *each.sources()}
    return sorted({*modules, *records(PACKAGE.parent)})
