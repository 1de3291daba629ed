"""The component of ESP-IDF: checked and packed by its component manager, and played from the package."""

import sys
from pathlib import Path

import pytest
import yaml
from building import NAME, run_clean
from formatted import Formatted, check_finds_a_flip, formatted
from packed_library import DEMANDING, MAIN, plays_the_model, run_offline, unpacked
from short_scans import short

from tablegen.version import __version__

MANAGER = Path(sys.executable).parent / "compote"
# What ESP-IDF does with a component, as far as its sources and headers go.
PROJECT = """
cmake_minimum_required(VERSION 3.16)
project(play C)
set(CMAKE_C_STANDARD 99)
function(idf_component_register)
    cmake_parse_arguments(given "" "" "SRCS;INCLUDE_DIRS" ${ARGN})
    add_library(component STATIC ${given_SRCS})
    target_include_directories(component PUBLIC ${given_INCLUDE_DIRS})
endfunction()
add_subdirectory(component)
add_executable(play main.c)
target_link_libraries(play component)
"""


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Formatted:
    return formatted(tmp_path_factory.mktemp("esp_idf"), "short", "esp-idf")


def test_it_names_the_c_files_of_the_build(built: Formatted) -> None:
    manifest = yaml.safe_load(built.files["idf_component.yml"])
    assert manifest["version"] == __version__
    c_files = {name for name in built.files if name.endswith((".c", ".h"))}
    own = {"CMakeLists.txt", "idf_component.yml", "manifest.json"}
    assert c_files == set(built.files) - own
    assert set(manifest["files"]["include"]) == {"CMakeLists.txt", *c_files}
    component = built.files["CMakeLists.txt"].decode("ascii").split()
    assert {word for word in component if word.endswith(".c")} == {name for name in c_files if name.endswith(".c")}


def test_a_changed_build_is_found(tmp_path: Path) -> None:
    built = formatted(tmp_path, "short", "esp-idf")
    check_finds_a_flip(built, "esp-idf", ["CMakeLists.txt", "idf_component.yml", "tablegen_options.h"])


@pytest.mark.rest
def test_what_the_component_manager_packs_plays_the_model(tmp_path: Path) -> None:
    """Without an option of the compiler, whatever the scan needs."""
    built = short(tmp_path, {"emit.formats": ["esp-idf", "verilog"], **DEMANDING})
    checked = run_offline([MANAGER, "manifest", "lint", "idf_component.yml"], built.folder)
    assert checked.returncode == 0, checked.stdout + checked.stderr
    command = [MANAGER, "component", "pack", "--name", NAME, "--dest-dir", tmp_path / "dist"]
    done = run_offline(command, built.folder)
    assert done.returncode == 0, done.stdout + done.stderr
    names = unpacked(tmp_path / "dist" / f"{NAME}_{__version__}.tgz", tmp_path / "project")
    assert any(name.endswith(".v") for name in built.files)
    assert not any(name.endswith((".v", ".vh", ".mem")) for name in names)
    (tmp_path / "project").rename(tmp_path / "component")
    (tmp_path / "CMakeLists.txt").write_text(PROJECT, "ascii")
    (tmp_path / "main.c").write_text(MAIN, "ascii")
    run_clean(["cmake", "-S", tmp_path, "-B", tmp_path / "made"])
    run_clean(["cmake", "--build", tmp_path / "made"])
    assert plays_the_model(tmp_path / "made" / "play", built.plan.program)


@pytest.mark.rest
def test_a_version_that_is_none_is_refused(tmp_path: Path) -> None:
    """A negative control: the component manager reads the manifest."""
    built = short(tmp_path, {"emit.formats": ["esp-idf"]})
    wrong = built.files["idf_component.yml"].replace(f'"{__version__}"'.encode(), b'"none"')
    (built.folder / "idf_component.yml").write_bytes(wrong)
    done = run_offline([MANAGER, "manifest", "lint", "idf_component.yml"], built.folder)
    assert done.returncode != 0
    assert "version" in done.stdout + done.stderr
