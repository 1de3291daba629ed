"""The name of the installed distribution, for advice and for its record.

The distribution is not called like the package: on PyPI ``tablegen`` is another program, which would replace this one.
"""

import re
from pathlib import Path

from tablegen.version import __version__

PROJECT = "piezo-tablegen"  # as in pyproject.toml; for a source tree that is not installed
_COMMAND = ("tablegen", "tablegen.cli:main")


def distribution_name() -> str:
    """Return the name under which this package is installed: that of the distribution with its command and its version.

    Any other may be an older installation, or another program of the same name. An editable installation
    has the same name as an ordinary one.
    """
    from importlib.metadata import entry_points  # takes as long as everything else that `tablegen --version` loads

    for entry in entry_points(group="console_scripts", name=_COMMAND[0]):
        if entry.value == _COMMAND[1] and entry.dist is not None and entry.dist.version == __version__:
            return entry.dist.name
    return PROJECT


def install_advice(extra: str) -> str:
    """Return the command that installs what an extra needs."""
    return f"pip install '{distribution_name()}[{extra}]'"


def records(packages: Path) -> list[Path]:
    """Return the record of this distribution in a folder of packages; empty for an editable one.

    It is found by its name, since importing importlib.metadata for this alone would slow every build.
    """
    return sorted(packages.glob(f"{re.sub('[-_.]+', '_', PROJECT).lower()}-*.dist-info/RECORD"))
