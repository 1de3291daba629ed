"""tablegen as its users have it: a wheel or an sdist of this tree, installed outside of it, and its command line.

The tree is copied before it is packed, since setuptools works inside the folder that it packs. What ``pip install``
would fetch is already there: nothing here needs a network.
"""

import os
import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

from building import REPOSITORY

_PARTS = ("tablegen", "examples", "firmware_templates")
_NOT_SOURCE = (".git", ".venv*", "build", "dist", "*.egg-info", "__pycache__", ".*_cache", ".hypothesis")
METADATA = tomllib.loads((REPOSITORY / "pyproject.toml").read_text("utf-8"))["project"]


def python(
    folder: Path, *arguments: str | Path | int, path: Path | None = None, program: str | Path = sys.executable
) -> str:
    """Run this interpreter, or another program, in a folder; with a folder of packages before its own."""
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    if path is not None:
        environment["PYTHONPATH"] = str(path)
    command = [str(program), *map(str, arguments)]
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


def copy_repository(folder: Path) -> Path:
    """A copy of the whole tree without what git ignores, below a folder; of an unpacked sdist too."""
    return Path(shutil.copytree(REPOSITORY, folder / "repository", ignore=shutil.ignore_patterns(*_NOT_SOURCE)))


def make_sdist(source: Path, folder: Path) -> Path:
    """Pack the sources of a tree, which this changes, into a folder: what ``python -m build --sdist`` calls."""
    code = f"from setuptools import build_meta; print(build_meta.build_sdist({str(folder)!r}))"
    return folder / python(source, "-c", code).splitlines()[-1]


def wheel_of_sdist(sdist: Path, folder: Path) -> Path:
    """What pip makes of an sdist first when it installs it."""
    _pip(folder, "wheel", "--no-build-isolation", "--wheel-dir", folder / "of_sdist", sdist)
    (built,) = (folder / "of_sdist").glob("*.whl")
    return built


def unpack(sdist: Path, folder: Path) -> Path:
    """Unpack an sdist below a folder, and return its one folder."""
    with tarfile.open(sdist) as archive:
        archive.extractall(folder)  # our own; filters came with Python 3.11.4
    return folder / sdist.name.removesuffix(".tar.gz")


def install(wheel: Path, folder: Path) -> Path:
    """Install a wheel below a folder, and return where its packages are."""
    _pip(folder, "install", "--target", folder / "packages", wheel)
    return folder / "packages"


def requirements(folder: Path) -> Path:
    """Make a folder of packages: links to what the distribution requires without an extra, and to nothing else."""
    folder.mkdir()
    names, seen = list(METADATA["dependencies"]), set()
    while names:
        required = names.pop()
        name = re.split(r"[^\w.-]", required)[0]
        if name in seen or "extra ==" in required:
            continue
        seen.add(name)
        try:
            found = distribution(name)
        except PackageNotFoundError:
            if ";" in required:  # for another system or another Python
                continue
            raise
        names += found.requires or []
        for top in {file.parts[0] for file in found.files or ()} - {"..", "__pycache__"}:
            (folder / top).symlink_to(Path(str(found.locate_file(top))))
    return folder


def clean_environment(wheel: Path, folder: Path, packages: Path, program: str | Path = sys.executable) -> Path:
    """Install a wheel into a new virtual environment of an interpreter, and return the folder of its commands.

    The environment finds what the wheel requires in a folder of packages, which a ``.pth`` file names, so that no
    network is needed. Nothing else is in it, not even pip: that of ``program`` installs into it, since the pip of an
    older Python need not run under a newer one.
    """
    python(folder, "-m", "venv", "--without-pip", folder / "environment", program=program)
    interpreter = folder / "environment" / "bin" / "python"
    _pip(folder, "install", wheel, interpreter=interpreter, program=program)
    where = python(folder, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))", program=interpreter)
    (Path(where.strip()) / "requirements.pth").write_text(f"{packages}\n", "utf-8")
    return interpreter.parent


def further_pythons() -> dict[str, Path]:
    """Environments of other Pythons with what the package requires, by version; ``make pythons`` makes them."""
    found = {version: Path(sys.prefix) / f"python{version}" / "bin" / "python" for version in further_versions()}
    return {version: path for version, path in found.items() if path.exists()}


def further_versions() -> list[str]:
    """The Pythons that the package supports, without that of the tests."""
    supported = re.findall(r"Python :: (3\.\d+)\b", "\n".join(METADATA["classifiers"]))
    return [version for version in supported if version != "{}.{}".format(*sys.version_info)]


def told_pythons() -> str:
    """Which other Pythons the tests can run the wheel under, and which are not here."""
    found = further_pythons()
    absent = " or ".join(version for version in further_versions() if version not in found)
    told = [f"the wheel is run under Python {' and '.join(found)} too"] if found else []
    return "; ".join(told + [f"no Python {absent} here, or `make pythons` has not run"] * bool(absent))


def _pip(
    folder: Path, *arguments: str | Path, interpreter: Path | None = None, program: str | Path = sys.executable
) -> None:
    for_another = () if interpreter is None else ("--python", interpreter)
    options = ("--no-deps", "--no-index", "--disable-pip-version-check", "--quiet")
    python(folder, "-m", "pip", *for_another, arguments[0], *options, *arguments[1:], program=program)


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
