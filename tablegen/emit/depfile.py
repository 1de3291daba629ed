"""Dependency files in the format of ``gcc -MD -MP``, which make, CMake and Ninja read."""

import os
import re
import sys
from collections.abc import Iterable
from pathlib import Path

from tablegen.base.installation import records
from tablegen.base.resources import PACKAGE
from tablegen.emit.formats import chosen, failing_as_format, own_names

# Of ASCII, what make or Ninja takes for something else and cannot be told not to: ends of commands and of names,
# patterns, and assignments. They were tried in GNU make 4.3 and Ninja 1.11, as tests/emit/test_depfile.py does.
_UNSAFE = frozenset("\"%&'*;<=>?[^`|")
_SUFFIX_RULE = re.compile(
    r"(\.(out|a|ln|o|c|cc|C|cpp|p|f|F|m|r|y|l|ym|yl|s|S|mod|sym|def|h|info|dvi|tex|texinfo|texi|"
    r"txinfo|w|ch|web|sh|elc|el)){1,2}"
)  # the suffixes that make knows by itself


def depfile(target: str, prerequisites: Iterable[Path]) -> bytes:
    """Write a rule for the target, and a target without a rule for each prerequisite.

    Because of the latter a removed prerequisite makes its dependents be built again, instead of make fail. All names
    are safe by ``why_unsafe``.
    """
    names = [_escaped(os.fsencode(path)) for path in prerequisites]
    rule = b" \\\n ".join([_escaped(os.fsencode(target)) + b":", *names])
    return b"\n".join([rule + b"\n", *(b"%s:\n" % name for name in names)])


def _escaped(name: bytes) -> bytes:
    """Escape a file name for make: a backslash counts only where it stands before what it escapes."""
    return re.sub(rb"(\\*)([ #:])", rb"\1\1\\\2", name).replace(b"$", b"$$")


def why_unsafe(name: str) -> str | None:
    """Return why make or Ninja would misread a file name or run a part of it; None if neither would.

    An escape serves only where both read it alike: Ninja has none for most characters, and reads a backslash before
    another escaped character as a part of the name.
    """
    for character in name:
        if character in _UNSAFE or ord(character) < 0x20 or character == "\x7f":
            return f"has {character!r}, which make or Ninja does not take for a part of a name"
    if name.endswith((" ", "\\", ":", ")")):
        return f"ends in {name[-1]!r}, which make or Ninja does not take for a part of a name"
    if pair := re.search(r"\\[#$:]", name):
        return f"has {pair[0]!r}, which make and Ninja read differently"
    if name.startswith("~"):
        return "begins with '~', which make takes for a home directory"
    if re.fullmatch(r"\.[A-Z_]+", name) or _SUFFIX_RULE.fullmatch(name):
        return "is the name of a special target of make"
    return None


# Packages that no build reads, beside the commands: the independent side, and those that prepare the input.
_OTHER_FOLDERS = (
    *("api", "calibration", "charts", "cli", "comparison", "correction", "fitting", "images", "library", "link"),
    *("refinement", "report", "sweep", "verification", "virtual"),
    "examples",
)
_OTHER_MODULES = ("firmware_templates/__init__.py",)


def deciding_files(formats: Iterable[str]) -> list[Path]:
    """List what decides the bytes of a build in these formats, beside its input, in order of path.

    The modules of this package, those of the formats, their templates and their runtime. In an installed package the
    record of the installation too, whose path has the version: package managers that give files the times of an
    archive would otherwise hide a change of version from make.
    """
    formats_used = chosen(formats)
    names = {each.name for each in formats_used}
    others = {PACKAGE / name for name in (*_OTHER_FOLDERS, *_OTHER_MODULES)}
    others |= {PACKAGE / "emit" / "formats" / f"{n.replace('-', '_')}.py" for n in own_names() if n not in names}
    others.add(PACKAGE / "firmware_templates")
    modules = {path for path in PACKAGE.rglob("*.py") if not others.intersection((path, *path.parents))}
    for each in formats_used:
        with failing_as_format(each):
            modules |= {Path(str(sys.modules[type(each).__module__].__file__)), *each.sources()}
    return sorted({*modules, *records(PACKAGE.parent)})
