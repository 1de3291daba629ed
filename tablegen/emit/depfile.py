"""Dependency files in the format of ``gcc -MD -MP``, which make, CMake and Ninja read."""

import os
import re
from collections.abc import Iterable
from pathlib import Path


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
