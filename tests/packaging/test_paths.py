"""``tablegen paths``: what it names exists, from the tree as from a wheel."""

import re
from pathlib import Path

import pytest
from building import REPOSITORY
from editing import run
from installing import python

from tablegen import __version__
from tablegen.base.resources import c_runtime, verilog_runtime

OPTIONS = ("make", "cmake", "fusesoc", "runtime-c", "runtime-verilog")
HOLDS = {
    "fusesoc": {"tablegen_generator.core", "tablegen_generator.py"},
    "cmake": {"TablegenConfig.cmake", "TablegenConfigVersion.cmake"},
    "runtime-c": {path.name for path in c_runtime()},
    "runtime-verilog": {path.name for path in verilog_runtime()},
}


def paths(shown: str) -> dict[str, Path]:
    """The table of ``tablegen paths``."""
    return {name: Path(path) for name, path in (line.split(maxsplit=1) for line in shown.splitlines())}


def hold(found: dict[str, Path]) -> None:
    """Fail if a path does not lead to what it is named after."""
    assert tuple(found) == OPTIONS
    assert found["make"].name == "tablegen.mk"
    assert found["make"].is_file()
    for name, files in HOLDS.items():
        assert len(files) > 1, name
        assert files <= {path.name for path in found[name].iterdir()}, name


def test_without_an_option_all_of_them_are_a_table() -> None:
    outcome = run("paths")
    assert (outcome.status, outcome.err) == (0, "")
    found = paths(outcome.out)
    hold(found)
    assert {path.parents[0 if path.is_dir() else 1].parent for path in found.values()} == {REPOSITORY}
    assert len({line.index("/") for line in outcome.out.splitlines()}) == 1, "a column"


@pytest.mark.parametrize("option", OPTIONS)
def test_an_option_prints_that_path_and_nothing_else(option: str) -> None:
    """So that it stands in ``$(shell ...)`` and ``execute_process`` as it is."""
    outcome = run("paths", f"--{option}")
    assert (outcome.status, outcome.err) == (0, "")
    assert outcome.out == f"{paths(run('paths').out)[option]}\n"


def test_several_options_print_a_line_each_in_the_order_of_the_table() -> None:
    found = paths(run("paths").out)
    assert run("paths", "--runtime-c", "--make").out == f"{found['make']}\n{found['runtime-c']}\n"


def test_the_help_teaches_each_option_with_two_lines() -> None:
    shown = run("paths", "--help").out
    assert max(map(len, shown.splitlines())) <= 100
    examples = [line for line in shown.splitlines() if line.startswith("    ")]
    for option in OPTIONS:
        assert re.search(rf"^  --{option} +\S.*\.$", shown, re.MULTILINE), option
        assert f"$(tablegen paths --{option})" in shown.replace("$(shell ", "$("), option
    assert len(examples) == 2 * len(OPTIONS)


@pytest.mark.common
def test_a_wheel_names_its_own_files(installed: Path, tmp_path: Path) -> None:
    found = paths(python(tmp_path, "-m", "tablegen", "paths", path=installed))
    hold(found)
    assert all(path.is_relative_to(installed) for path in found.values())


def test_an_editable_installation_names_the_tree(tmp_path: Path) -> None:
    """From a folder from which the tree is not importable by itself."""
    assert paths(python(tmp_path, "-m", "tablegen", "paths")) == paths(run("paths").out)


@pytest.mark.common
def test_a_path_comes_out_as_it_is(installed: Path, tmp_path: Path) -> None:
    """Whatever the terminal could show: other programs read it."""
    link = tmp_path / "m\u00fcller's packages"
    link.symlink_to(installed)
    code = "import sys; from tablegen.cli import _run; sys.stdout.reconfigure(encoding='ascii'); _run()"
    shown = python(tmp_path, "-c", code, "paths", "--make", path=link)
    assert shown == f"{link}/tablegen/firmware_templates/make/tablegen.mk\n"


def test_the_cmake_package_has_the_version_of_tablegen() -> None:
    file = paths(run("paths").out)["cmake"] / "TablegenConfigVersion.cmake"
    assert f'set(PACKAGE_VERSION "{__version__}")' in file.read_text("ascii").splitlines()
