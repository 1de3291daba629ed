"""Wheel and sdist, each installed alone into a clean environment outside the checkout, and under further Pythons."""

import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import building
import pytest
from building import EXAMPLE, REPOSITORY
from installing import (
    METADATA,
    clean_environment,
    copy_repository,
    further_pythons,
    make_sdist,
    python,
    requirements,
    unpack,
    wheel_of_sdist,
)
from sets import common

from tablegen import __version__

pytestmark = pytest.mark.common

NAME = f"piezo_tablegen-{__version__}"
MADE = (
    "tests/__pycache__/test_cli.cpython-311.pyc",
    "examples/build_step/build/main.o",
    "tablegen/x.pyc",
    "docs/a.md~",
)
MADE_AT_THE_TOP = ("build/lib/tablegen/cli.py", ".venv-3.13/bin/python", ".hypothesis/a", "dist/a", "notes.txt")


@pytest.fixture(scope="module")
def packed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """The sdist of a tree in which people have worked, and what that tree held before."""
    folder = tmp_path_factory.mktemp("sdist")
    source = copy_repository(folder)
    before = folder / "before"
    shutil.copytree(source, before)
    for name in (*MADE, *MADE_AT_THE_TOP):
        (source / name).parent.mkdir(parents=True, exist_ok=True)
        (source / name).write_text("made\n", "utf-8")
    return make_sdist(source, folder), before


@pytest.fixture(scope="module")
def sdist(packed: tuple[Path, Path]) -> Path:
    return packed[0]


@pytest.fixture(scope="module")
def sdist_wheel(sdist: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel that pip makes of the sdist when it installs it."""
    return wheel_of_sdist(sdist, tmp_path_factory.mktemp("wheel_of_sdist"))


@pytest.fixture(scope="module")
def packages(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What the distribution requires, and nothing else."""
    return requirements(tmp_path_factory.mktemp("requirements") / "packages")


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What the tree builds."""
    folder = tmp_path_factory.mktemp("tree")
    python(folder, "-m", "tablegen", "init", "scan")
    python(folder, "-m", "tablegen", "build", f"scan/{EXAMPLE.name}", "-o", "out")
    return folder / "out"


def under(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


def test_the_sdist_holds_the_repository_and_nothing_that_was_made(packed: tuple[Path, Path]) -> None:
    sdist, before = packed
    assert sdist.name == f"{NAME}.tar.gz"
    with tarfile.open(sdist) as archive:
        inside = {member.name: member for member in archive.getmembers() if member.isfile()}
    held = {name.removeprefix(f"{NAME}/") for name in inside}
    generated = {name for name in held if name.startswith("piezo_tablegen.egg-info/")} | {"PKG-INFO", "setup.cfg"}
    assert held - generated <= under(before)
    assert inside[f"{NAME}/.ci/run"].mode & 0o100
    if (REPOSITORY / ".git").exists():
        listed = subprocess.run(["git", "ls-files", "-z"], cwd=REPOSITORY, capture_output=True, text=True, check=True)
        known = {name for name in listed.stdout.split("\0") if name and (REPOSITORY / name).exists()}
        assert known - held == set()


@pytest.mark.long
@pytest.mark.timeout(86_400)
def test_tests_of_the_sdist_are_collected(
    sdist: Path, installed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All that the repository has, with the package installed, not taken from the sdist or the checkout."""
    monkeypatch.setenv("TABLEGEN_REAL", str(tmp_path))  # tests of real files are not collected without a folder
    source = unpack(sdist, tmp_path)
    files = {path.relative_to(source).as_posix() for path in source.glob("*tests/**/test_*.py")}
    assert collected(source, path=installed) == files
    # Negative control: a helper that is missing is an error of the collection.
    this, helper = (Path(file).resolve().relative_to(REPOSITORY) for file in (__file__, str(building.__file__)))
    (source / helper).unlink()
    with pytest.raises(AssertionError, match="ModuleNotFoundError"):
        collected(source, str(this), path=installed)


def collected(tree: Path, *names: str, path: Path) -> set[str]:
    """The files of a tree of which tests are collected, slow ones too."""
    options = ("--collect-only", "-m", "", "-p", "no:cacheprovider", "-p", "no:xdist")
    shown = python(tree, "-P", "-B", "-m", "pytest", *options, *names, path=path)
    return {line.partition("::")[0] for line in shown.splitlines() if "::" in line}


@pytest.mark.rest
def test_the_wheel_of_the_sdist_is_the_wheel_of_the_tree(sdist_wheel: Path, wheel: Path) -> None:
    inside = [zipfile.ZipFile(path) for path in (sdist_wheel, wheel)]
    texts = [{name: archive.read(name) for name in archive.namelist()} for archive in inside]
    for text in texts:
        del text[f"{NAME}.dist-info/RECORD"]  # it lists the rest in the order of the archive
    assert texts[0] == texts[1]


@pytest.mark.rest
@pytest.mark.parametrize("kind", common(["wheel"], ["wheel", "sdist_wheel"]))
def test_in_a_clean_environment_it_builds_verifies_and_imports(
    kind: str, packages: Path, tree: Path, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    commands = clean_environment(request.getfixturevalue(kind), tmp_path, packages)
    check_environment(commands, tmp_path, tree)
    # Of the extras nothing is there; the advice is what installs them, and takes this distribution.
    command = [commands / "tablegen", "calibrate", "offset", "--axis", "x", EXAMPLE]
    missing = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (missing.returncode, missing.stdout) == (6, "")
    assert missing.stderr.endswith(f"pip install '{METADATA['name']}[calibrate]'\n")
    assert has_pip_taken(commands / "python", missing.stderr.split("'")[1])
    assert not has_pip_taken(commands / "python", "tablegen")


def has_pip_taken(interpreter: Path, requirement: str) -> bool:
    """Whether pip, without a network, finds a requirement met by what is installed, but for what it needs itself."""
    options = ("--no-index", "--no-deps", "--disable-pip-version-check", "--dry-run")
    command = [sys.executable, "-m", "pip", "--python", interpreter, "install", *options, requirement]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return done.returncode == 0 and "Would install" not in done.stdout


@pytest.mark.parametrize("version", further_pythons())
def test_under_a_further_python_it_builds_verifies_and_imports(
    version: str, wheel: Path, tree: Path, tmp_path: Path
) -> None:
    """`make pythons` makes an environment for each one that the machine has; the summary tells which."""
    program = further_pythons()[version]
    where = python(tmp_path, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))", program=program)
    commands = clean_environment(wheel, tmp_path, Path(where.strip()), program)
    shown = python(tmp_path, "-c", "import sys; print('%d.%d' % sys.version_info[:2])", program=commands / "python")
    assert shown == f"{version}\n"
    check_environment(commands, tmp_path, tree)
    where = python(tmp_path, "-c", "import tablegen; print(tablegen.__path__[0])", program=commands / "python")
    python(tmp_path, "-W", "error", "-m", "compileall", "-q", "-f", where.strip(), program=commands / "python")


def check_environment(commands: Path, folder: Path, tree: Path) -> None:
    """Build the bytes that the tree builds, verify them and import the package, all from a folder outside."""
    tablegen, interpreter = commands / "tablegen", commands / "python"
    assert python(folder, "--version", program=tablegen) == f"tablegen {__version__}\n"
    python(folder, "init", "scan", program=tablegen)
    # No warning: what a newer Python will refuse is one first.
    python(folder, "-W", "error", tablegen, "build", f"scan/{EXAMPLE.name}", "-o", "out", program=interpreter)
    built, expected = ({path.name: path.read_bytes() for path in where.iterdir()} for where in (folder / "out", tree))
    assert built == expected
    shown = python(folder, "verify", "out", "--target", "c", program=tablegen)
    assert shown.splitlines()[-1].startswith("out: verified, ")
    code = (
        "import importlib.metadata, importlib.util, tablegen; print(tablegen.__file__);"
        "print(importlib.metadata.version('piezo-tablegen')); print(importlib.util.find_spec('scipy'))"
    )
    where, version, other = python(folder, "-W", "error", "-c", code, program=interpreter).splitlines()
    assert Path(where).is_relative_to(commands.parent)
    assert (version, other) == (__version__, "None")
