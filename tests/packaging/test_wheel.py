"""The wheel against the source tree: what is inside, and that it builds the same bytes as the tree does."""

import shutil
import zipfile
from pathlib import Path

import pytest
from building import EXAMPLE, REPOSITORY
from installing import python

pytestmark = pytest.mark.common


def shipped_files() -> set[str]:
    """What the tree says should be inside: all modules, and what lies beside them and is no module."""
    found = {path.relative_to(REPOSITORY).as_posix() for path in REPOSITORY.glob("tablegen/**/*.py")}
    found |= {
        "tablegen/__init__.pyi",
        "tablegen/py.typed",
        "tablegen/examples/__init__.py",
        "tablegen/firmware_templates/__init__.py",
        "tablegen/planning/table_costs.json",
        "tablegen/planning/frame_costs.json",
    }
    found |= {f"tablegen/examples/{path.name}" for path in REPOSITORY.glob("examples/*.toml")}
    for kind in ("[chv]", "ld"):
        benches = REPOSITORY.glob(f"tablegen/verification/*/*.{kind}")
        found |= {path.relative_to(REPOSITORY).as_posix() for path in benches}
    found |= {
        f"tablegen/library/{path.name}"
        for kind in ("v", "j2")
        for path in REPOSITORY.glob(f"tablegen/library/*.{kind}")
    }
    found |= {f"tablegen/html_report/page.{kind}" for kind in ("css", "html.j2", "js")}
    found |= {f"tablegen/virtual/{path.name}" for path in REPOSITORY.glob("tablegen/virtual/*.toml")}
    for folder in (REPOSITORY / "firmware_templates").rglob("*"):
        if folder.is_dir() and folder.name != "__pycache__":
            paths = (path for path in folder.iterdir() if path.is_file())
            found |= {f"tablegen/{path.relative_to(REPOSITORY).as_posix()}" for path in paths}
    return found


def test_wheel_holds_the_package_and_nothing_else(wheel: Path) -> None:
    """A folder of modules, or of templates, that pyproject.toml does not name is missing here."""
    inside = {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}
    assert inside == shipped_files()


def test_wheel_is_for_every_machine_and_carries_its_licence(wheel: Path) -> None:
    assert wheel.name.endswith("-py3-none-any.whl")
    metadata = [name.split(".dist-info/")[1] for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" in name]
    assert any(name.endswith("LICENSE") for name in metadata)
    assert "entry_points.txt" in metadata


def test_installed_wheel_builds_what_the_tree_builds(installed: Path, tmp_path: Path) -> None:
    """From a folder outside the repository, from the examples that it brings along."""
    where = python(tmp_path, "-c", "import tablegen; print(tablegen.__file__)", path=installed)
    assert Path(where.strip()).is_relative_to(installed)
    python(tmp_path, "-m", "tablegen", "init", "scan", path=installed)
    python(tmp_path, "-m", "tablegen", "build", f"scan/{EXAMPLE.name}", "-o", "wheel", path=installed)
    python(tmp_path, "-m", "tablegen", "init", "own")
    python(tmp_path, "-m", "tablegen", "build", f"own/{EXAMPLE.name}", "-o", "tree")
    wheel, tree = ({path.name: path.read_bytes() for path in (tmp_path / name).iterdir()} for name in ("wheel", "tree"))
    assert wheel == tree
    assert (tmp_path / "scan" / EXAMPLE.name).read_bytes() == (tmp_path / "own" / EXAMPLE.name).read_bytes()


def test_installed_wheel_verifies_a_build(installed: Path, tmp_path: Path) -> None:
    """Outside the repository: command, simulation and the cocotb side inside the simulator are those of the wheel."""
    python(tmp_path, "-m", "tablegen", "init", "scan", path=installed)
    python(tmp_path, "-m", "tablegen", "build", f"scan/{EXAMPLE.name}", "-o", "out", path=installed)
    shown = python(tmp_path, "-m", "tablegen", "verify", "out", "--ticks", 3000, "--axis", "blocks", path=installed)
    assert shown.splitlines()[-1].startswith("out: verified, ")
    # Negative control: without its cocotb side the copy fails, so that nothing came from the tree.
    copy = tmp_path / "copy"
    shutil.copytree(installed, copy)
    (copy / "tablegen" / "verification" / "verilog" / "cocotb_stream.py").unlink()
    with pytest.raises(AssertionError, match="simulation: "):
        python(tmp_path, "-m", "tablegen", "verify", "out", "--ticks", 3000, "--axis", "blocks", path=copy)


def test_installed_command_is_the_module(installed: Path, tmp_path: Path) -> None:
    script = installed / "bin" / "tablegen"
    shown = python(tmp_path, script, "--version", path=installed)
    assert shown == python(tmp_path, "-m", "tablegen", "--version", path=installed)
