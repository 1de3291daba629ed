"""The module of Zephyr: Kconfiglib evaluates its options, and CMake compiles its library with a stand-in for Zephyr."""

import shutil
from pathlib import Path

import kconfiglib
import pytest
import yaml
import zephyr_tree
from building import NAME, Build
from editing import run, write_pair
from formatted import Formatted, check_finds_a_flip, formatted
from packed_library import MAIN, plays_the_model
from short_scans import CUBIC, short
from zephyr_tree import options

SYMBOL = f"TABLEGEN_{NAME.upper()}"
FILES = ("zephyr/module.yml", "zephyr/Kconfig", "zephyr/CMakeLists.txt")
# That of docs/start/projects.md, with C alone.
PROJECT = """
cmake_minimum_required(VERSION 3.20)
list(APPEND ZEPHYR_EXTRA_MODULES ${CMAKE_CURRENT_SOURCE_DIR}/module)
find_package(Zephyr REQUIRED HINTS $ENV{ZEPHYR_BASE})
project(play C)
target_sources(app PRIVATE main.c)
"""


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Formatted:
    return formatted(tmp_path_factory.mktemp("zephyr"), "short", "zephyr")


def values(loaded: kconfiglib.Kconfig) -> dict[str, str]:
    return {name: symbol.str_value for name, symbol in loaded.syms.items() if name.startswith(SYMBOL)}


def test_it_names_the_c_files_of_the_build(built: Formatted) -> None:
    c_files = {name for name in built.files if name.endswith((".c", ".h"))}
    assert c_files == set(built.files) - {*FILES, "manifest.json"}
    module = built.files["zephyr/CMakeLists.txt"].decode("ascii").split()
    assert {word for word in module if word.endswith(".c")} == {f"../{name}" for name in c_files if name.endswith(".c")}


def test_its_keys_are_those_of_a_module_and_lead_to_its_files(built: Formatted) -> None:
    """By the documentation of modules: ``cmake`` is a folder with a CMakeLists.txt, ``kconfig`` a file."""
    module = yaml.safe_load(built.files["zephyr/module.yml"])
    assert module == {"name": NAME, "build": {"cmake": "zephyr", "kconfig": "zephyr/Kconfig"}}
    assert f"{module['build']['cmake']}/CMakeLists.txt" in built.files
    assert module["build"]["kconfig"] in built.files


def test_a_changed_build_is_found(tmp_path: Path) -> None:
    check_finds_a_flip(formatted(tmp_path, "short", "zephyr"), "zephyr", ["zephyr/Kconfig", "zephyr/CMakeLists.txt"])


def test_its_options_begin_at_what_the_scan_needs(built: Formatted) -> None:
    off = options(built.folder)
    assert values(off) == {SYMBOL: "n", f"{SYMBOL}_SHAPING": "", f"{SYMBOL}_SPLINE": "n"}
    assert off.syms[f"ZEPHYR_{NAME.upper()}_MODULE"].str_value == "y"
    on = options(built.folder, f"CONFIG_{SYMBOL}=y")
    assert values(on) == {SYMBOL: "y", f"{SYMBOL}_SHAPING": "0", f"{SYMBOL}_SPLINE": "n"}
    more = options(built.folder, f"CONFIG_{SYMBOL}=y", f"CONFIG_{SYMBOL}_SHAPING=3", f"CONFIG_{SYMBOL}_SPLINE=y")
    assert values(more) == {SYMBOL: "y", f"{SYMBOL}_SHAPING": "3", f"{SYMBOL}_SPLINE": "y"}
    assert off.warnings == on.warnings == more.warnings == []


def test_no_option_goes_below_what_the_scan_needs(tmp_path: Path) -> None:
    changes = {"emit.formats": ["zephyr"], "dac.shaping": "second", "x.table": CUBIC}
    folder = short(tmp_path, changes).folder
    less = (f"CONFIG_{SYMBOL}=y", f"CONFIG_{SYMBOL}_SHAPING=1", f"CONFIG_{SYMBOL}_SPLINE=n")
    assert values(options(folder, *less)) == {SYMBOL: "y", f"{SYMBOL}_SHAPING": "2", f"{SYMBOL}_SPLINE": "y"}


def test_kconfiglib_refuses_a_file_that_is_none(built: Formatted, tmp_path: Path) -> None:
    """A negative control: Kconfiglib reads the file that the module names."""
    (tmp_path / "module" / "zephyr").mkdir(parents=True)
    for name in FILES:
        (tmp_path / "module" / name).write_bytes(built.files[name].replace(b"\trange 0 3", b"\trange 0"))
    with pytest.raises(kconfiglib.KconfigError, match=r"zephyr/Kconfig:\d+"):
        options(tmp_path / "module")


def compiled(tmp_path: Path, folder: Path, *settings: str) -> Path:
    """Compile an application with a module, and return it."""
    shutil.copytree(folder, tmp_path / "module")
    (tmp_path / "CMakeLists.txt").write_text(PROJECT, "ascii")
    (tmp_path / "main.c").write_text(MAIN, "ascii")
    return zephyr_tree.compiled(tmp_path, tmp_path / "module", tmp_path / "made", *settings)


def module_of(tmp_path: Path, changes: dict[str, object]) -> Build:
    return short(tmp_path / "built", {"emit.formats": ["zephyr", "verilog"], **changes})


@pytest.mark.rest
@pytest.mark.parametrize(
    "changes",
    [{"dac.bits": 18, "x.table.bits": 18, "y.table.bits": 18}, {"dac.shaping": "second", "x.table": CUBIC}],
    ids=["18 bits", "shaped and cubic"],
)
def test_an_application_plays_the_model(tmp_path: Path, changes: dict[str, object]) -> None:
    """With one line in its settings: macros of the runtime are those of the module.

    ``tests/docs/test_firmware_projects.py`` has one of 16 bits.
    """
    built = module_of(tmp_path, changes)
    assert plays_the_model(compiled(tmp_path, built.folder, f"CONFIG_{SYMBOL}=y"), built.plan.program)


@pytest.mark.rest
def test_more_options_play_the_model_too(tmp_path: Path) -> None:
    built = module_of(tmp_path, {})
    settings = (f"CONFIG_{SYMBOL}=y", f"CONFIG_{SYMBOL}_SHAPING=3", f"CONFIG_{SYMBOL}_SPLINE=y")
    assert plays_the_model(compiled(tmp_path, built.folder, *settings), built.plan.program)


@pytest.mark.rest
def test_a_module_that_is_off_compiles_nothing(tmp_path: Path) -> None:
    """A negative control: without the setting the application lacks the headers."""
    built = module_of(tmp_path, {})
    with pytest.raises(AssertionError, match=rf"{NAME}\.h: No such file"):
        compiled(tmp_path, built.folder)


@pytest.mark.rest
def test_a_source_that_the_module_lacks_is_missed(tmp_path: Path) -> None:
    """A negative control: CMake compiles the sources that the module names."""
    built = module_of(tmp_path, {})
    place = built.folder / "zephyr" / "CMakeLists.txt"
    place.write_bytes(place.read_bytes().replace(b"    ../dac_sequencer.c\n", b""))
    with pytest.raises(AssertionError, match="undefined reference to `dac_sequencer_init'"):
        compiled(tmp_path, built.folder, f"CONFIG_{SYMBOL}=y")


# Its files stand in a sub-folder


@pytest.fixture
def directory(tmp_path: Path) -> Path:
    """A directory with a build of the format, beside its scan."""
    assert run("build", write_pair(tmp_path), "-o", tmp_path / "out", "-f", "zephyr", "-q").status == 0
    return tmp_path / "out"


def test_verify_and_check_compare_files_in_the_sub_folder(directory: Path) -> None:
    scan, file = directory.parent / "scan.toml", directory / "zephyr" / "module.yml"
    check = ("build", scan, "-o", directory, "-f", "zephyr", "--check")
    assert run("verify", "--target", "files", directory).status == run(*check).status == 0
    file.write_bytes(b"name: other\n")
    outcome = run("verify", "--target", "files", directory)
    assert outcome.status == 5
    assert "zephyr/module.yml: stale or edited" in outcome.err
    assert run(*check).status == 1
    file.unlink()
    assert "zephyr/module.yml: missing" in run("verify", "--target", "files", directory).err
    assert f"{file}: missing" in run(*check).out
    assert run(*check[:-1], "-q").status == 0
    assert run("verify", "--target", "files", directory).status == run(*check).status == 0


def test_check_and_build_refuse_a_link_to_the_same_files(directory: Path) -> None:
    elsewhere = directory.parent / "elsewhere"
    (directory / "zephyr").rename(elsewhere)
    (directory / "zephyr").symlink_to(elsewhere)
    build = ("build", directory.parent / "scan.toml", "-o", directory, "-f", "zephyr")
    why = f"{directory / 'zephyr'}: is a symbolic link, where a directory has to go"
    checked = run(*build, "--check")
    assert checked.status == 1
    assert why in checked.out
    outcome = run(*build)
    assert outcome.status == 2
    assert why in outcome.err


def test_another_format_removes_the_sub_folder(directory: Path) -> None:
    scan = directory.parent / "scan.toml"
    assert run("build", scan, "-o", directory, "-f", "c", "-q").status == 0
    assert not (directory / "zephyr").exists()
    assert run("build", scan, "-o", directory, "-f", "c", "--check").status == 0
