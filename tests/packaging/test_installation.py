"""The name of the distribution: the advice to install made from it in one place, and the same name everywhere else."""

import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from building import REPOSITORY

from tablegen import __version__
from tablegen.base.installation import PROJECT, install_advice

METADATA = tomllib.loads((REPOSITORY / "pyproject.toml").read_text("utf-8"))["project"]
COMMAND = "tablegen.cli:main"


def read(*patterns: str) -> dict[str, str]:
    """The text files of the repository under some patterns."""
    found = (path for pattern in patterns for path in REPOSITORY.glob(pattern))
    paths = [path for path in found if path.is_file() and path.parent.name != "__pycache__"]
    assert paths
    return {str(path.relative_to(REPOSITORY)): path.read_text("utf-8", errors="replace") for path in paths}


def distribution(folder: Path, name: str, version: str = __version__, command: str = COMMAND) -> Path:
    """The metadata of an installed distribution in a folder, with a command called tablegen."""
    metadata = folder / f"{name.replace('-', '_')}-{version}.dist-info"
    metadata.mkdir(parents=True)
    (metadata / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n", "utf-8")
    (metadata / "entry_points.txt").write_text(f"[console_scripts]\ntablegen = {command}\n", "utf-8")
    return folder


def advice(*folders: Path) -> str:
    """What an interpreter without any installed package advises, from the source tree and folders of packages."""
    code = "from tablegen.base.installation import install_advice; print(install_advice('calibrate'))"
    path = os.pathsep.join(map(str, (*folders, REPOSITORY)))
    done = subprocess.run(
        [sys.executable, "-S", "-P", "-c", code],
        env=os.environ | {"PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.strip()


def test_the_installed_package_advises_its_own_name() -> None:
    assert METADATA["name"] == PROJECT
    assert install_advice("calibrate") == f"pip install '{METADATA['name']}[calibrate]'"


def test_the_advice_follows_the_metadata(tmp_path: Path) -> None:
    assert advice(distribution(tmp_path, "renamed-tablegen")) == "pip install 'renamed-tablegen[calibrate]'"


@pytest.mark.parametrize(
    ("version", "command"),
    [("1.1.0", "tablegen.main:run"), ("0.1.0", COMMAND)],
    ids=["another program", "the name that this one once had"],
)
def test_the_advice_is_never_another_distribution(version: str, command: str, tmp_path: Path) -> None:
    other = distribution(tmp_path / "other", "tablegen", version, command)
    assert advice(other) == f"pip install '{PROJECT}[calibrate]'"
    assert advice(other, distribution(tmp_path / "own", "Piezo.Tablegen")) == "pip install 'Piezo.Tablegen[calibrate]'"


def test_a_source_tree_that_is_not_installed_has_advice() -> None:
    """Nor does the metadata matter that an editable installation may leave in it."""
    assert advice() == f"pip install '{PROJECT}[calibrate]'"


def test_no_other_place_spells_the_advice() -> None:
    spelt = {name for name, text in read("tablegen/**/*").items() if re.search(r"pip3? install", text)}
    assert spelt == {"tablegen/base/installation.py"}


def test_extras_that_are_asked_for_exist() -> None:
    """In messages; an f-string or a keyword is where they are named."""
    sources = "".join(read("tablegen/**/*.py").values())
    asked = set(re.findall(r"install_advice\(['\"]([\w-]+)['\"]\)|extra=['\"]([\w-]+)['\"]", sources))
    names = {first or second for first, second in asked}
    assert {"calibrate", "images", "plot", "serial", "hdl", "verilator", "cortex-m"} <= names
    assert names <= set(METADATA["optional-dependencies"])


def test_pages_and_templates_name_the_distribution() -> None:
    """`pip install tablegen` would install another program."""
    texts = read("README.md", "CONTRIBUTING.md", "docs/**/*.md", "firmware_templates/*/*", "examples/**/*")
    installs = [
        (name, match[1])
        for name, text in texts.items()
        for match in re.finditer(r"pip install (?:-\S+ )*['\"]?([\w.-]*tablegen[\w-]*)", text)
    ]
    assert {name for _, name in installs} == {METADATA["name"]}, installs
    extras = {
        (name, match[0], match[2])
        for name, text in texts.items()
        for match in re.finditer(r"([\w-]*tablegen)\[([\w-]+)\]", text)
    }
    assert {full.partition("[")[0] for _, full, _ in extras} == {METADATA["name"]}, extras
    assert {extra for _, _, extra in extras} <= set(METADATA["optional-dependencies"])


def test_extras_of_extras_are_of_this_distribution() -> None:
    required = [text for texts in METADATA["optional-dependencies"].values() for text in texts]
    own = [text.partition("[")[0] for text in required if "tablegen" in text]
    assert len(own) == 3
    assert set(own) == {METADATA["name"]}


def test_what_answers_at_once_loads_no_metadata() -> None:
    code = "import sys, tablegen.cli, tablegen.link.device, tablegen.base.resources"
    code += "\nprint('importlib.metadata' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "False\n"


# The version stands in tablegen/version.py; what cannot read it there is held against it.


def test_the_version_is_the_same_everywhere() -> None:
    cmake = (REPOSITORY / "firmware_templates" / "cmake" / "TablegenConfigVersion.cmake").read_text("utf-8")
    assert f'set(PACKAGE_VERSION "{__version__}")' in cmake
    generator = (REPOSITORY / "firmware_templates" / "fusesoc" / "tablegen_generator.core").read_text("utf-8")
    assert f"\nname: tablegen:utils:generator:{__version__}\n" in generator
    assert f"\nversion: {__version__}\n" in (REPOSITORY / "CITATION.cff").read_text("utf-8")
    notes = (REPOSITORY / "docs" / "releases" / f"{__version__}.md").read_text("utf-8")
    assert notes.startswith(f"# {__version__}\n")


def test_supported_pythons_are_classified() -> None:
    versions = [text.rpartition(" ")[2] for text in METADATA["classifiers"] if re.search(r":: 3\.\d+$", text)]
    assert versions == ["3.11", "3.12", "3.13"]
    assert METADATA["requires-python"] == f">={versions[0]}"
