"""``examples/custom_format``: installed beside tablegen, it is listed, built, verified, and finds a changed word."""

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from building import NAME, REPOSITORY, constants
from editing import SCAN, edited, write_pair
from formatted import flipped, replace_file
from installing import python
from manifest_integers import memories

from tablegen.emit.formats import own_names

FOLDER = REPOSITORY / "examples" / "custom_format"
ARRAYS = {
    "x": "X_TABLE",
    "x_fourier": "X_FOURIER",
    "y": "Y_TABLE",
    "y_fourier": "Y_FOURIER",
    "program": "PROGRAM_REGISTERS",
    "sine": "SINE_QUARTER",
}


@pytest.fixture(scope="module")
def packages(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The example, installed into a folder of its own without a network."""
    folder = tmp_path_factory.mktemp("custom")
    shutil.copytree(FOLDER, folder / "source", ignore=shutil.ignore_patterns("__pycache__", "build", "*.egg-info"))
    options = ("--no-deps", "--no-index", "--no-build-isolation", "--disable-pip-version-check", "--quiet")
    python(folder, "-m", "pip", "install", *options, "--target", folder / "packages", folder / "source")
    return folder / "packages"


@pytest.fixture(scope="module")
def built(packages: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The example scan as Rust, chosen by the scan file."""
    folder = tmp_path_factory.mktemp("rust")
    write_pair(folder, edited(SCAN, '+ [emit]\nformats = ["rust"]'))
    python(folder, "-m", "tablegen", "build", "scan.toml", "-o", "out", "--quiet", path=packages)
    return folder / "out"


@pytest.mark.common
def test_it_is_listed_with_the_others(packages: Path, tmp_path: Path) -> None:
    listed = python(tmp_path, "-m", "tablegen", "formats", path=packages)
    names = [line.split()[0] for line in listed.splitlines() if line[:1].strip()]
    assert names == sorted([*own_names(), "rust"])


@pytest.mark.common
def test_the_module_has_the_numbers_of_the_manifest(built: Path) -> None:
    manifest = json.loads((built / "manifest.json").read_bytes())
    assert manifest["formats"] == ["rust"]
    assert {path.name for path in built.iterdir()} == {f"{NAME}.rs", "manifest.json"}
    text = (built / f"{NAME}.rs").read_text("ascii")
    found = {name: (kind, value) for name, kind, value in re.findall(r"pub const (\w+): (\S+) = (.+);", text)}
    assert found.pop("HASH") == ("&str", f'"{manifest["hash"]}"')
    assert {name: int(value) for name, (_, value) in found.items()} == constants(manifest)
    assert all(abs(int(value)) < 2 ** (int(kind[1:]) - 1) for kind, value in found.values())
    arrays = re.findall(r"pub static (\w+): \[(\w+); (\d+)\] = \[(.*?)\];", text, re.DOTALL)
    read = {name: [int(word) for word in body.split(",")[:-1]] for name, _, _, body in arrays}
    assert read == {ARRAYS[name]: words for name, (words, _) in memories(manifest).items()}
    assert all(int(count) == len(read[name]) for name, _, count, _ in arrays)


@pytest.mark.common
def test_verify_finds_a_changed_word(packages: Path, built: Path, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    shutil.copytree(built, folder)
    command = ["-m", "tablegen", "verify", "--target", "files", folder]
    assert "rust files" in python(tmp_path, *command, path=packages)
    replace_file(folder, f"{NAME}.rs", flipped((folder / f"{NAME}.rs").read_bytes(), 0.6))
    environment = {"PYTHONPATH": str(packages), "PATH": ""}
    done = subprocess.run(
        [sys.executable, *map(str, command)], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 5
    assert f"rust files: {NAME}.rs: line " in done.stderr


def test_it_is_as_short_as_the_page_says() -> None:
    """Some sixty lines, and nothing of tablegen that the page does not name."""
    text = (FOLDER / "tablegen_rust.py").read_text("utf-8")
    assert len(text.splitlines()) <= 70
    page = (REPOSITORY / "docs" / "formats.md").read_text("utf-8")
    for module in re.findall(r"^from (tablegen\S+) import", text, re.MULTILINE):
        assert f"`{module}`" in page, module
