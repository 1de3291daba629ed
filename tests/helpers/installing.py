"""tablegen as its users have it: a wheel of this tree, installed outside of it, and a command line in front of that.

The tree is copied before it is packed, since setuptools works inside the folder that it packs. What ``pip install``
would fetch is already there: nothing here needs a network.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path

from building import REPOSITORY

_PARTS = ("tablegen", "examples", "firmware_templates")


def python(folder: Path, *arguments: str | Path | int, path: Path | None = None) -> str:
    """Run this interpreter in a folder, with a folder of packages before its own."""
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    if path is not None:
        environment["PYTHONPATH"] = str(path)
    command = [sys.executable, *map(str, arguments)]
    result = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert result.returncode == 0, f"{' '.join(command)}\n{result.stdout}{result.stderr}"
    return result.stdout


def make_wheel(folder: Path) -> Path:
    """Pack this tree, below a folder."""
    source = folder / "source"
    source.mkdir()
    for part in _PARTS:
        shutil.copytree(REPOSITORY / part, source / part, ignore=shutil.ignore_patterns("__pycache__"))
    for file in ("pyproject.toml", "LICENSE", "README.md"):
        if (REPOSITORY / file).exists():
            shutil.copy(REPOSITORY / file, source)
    _pip(folder, "wheel", "--no-build-isolation", "--wheel-dir", folder, source)
    (built,) = folder.glob("*.whl")
    return built


def install(wheel: Path, folder: Path) -> Path:
    """Install a wheel below a folder, and return where its packages are."""
    _pip(folder, "install", "--target", folder / "packages", wheel)
    return folder / "packages"


def _pip(folder: Path, *arguments: str | Path) -> None:
    options = ("--no-deps", "--no-index", "--disable-pip-version-check", "--quiet")
    python(folder, "-m", "pip", arguments[0], *options, *arguments[1:])


def write_command(folder: Path, packages: Path) -> Path:
    """A program ``tablegen`` that runs installed packages, and return its path.

    It writes its arguments into a file ``log`` beside it, and kills itself where a file ``kill`` stands there.
    """
    folder.mkdir(parents=True)
    program = folder / "tablegen"
    program.write_text(
        f"""#!/bin/sh
echo "$*" >> '{folder}/log'
[ ! -e '{folder}/kill' ] || kill -9 $$
PYTHONPATH='{packages}' exec '{sys.executable}' -m tablegen "$@"
""",
        "utf-8",
    )
    program.chmod(0o755)
    return program
