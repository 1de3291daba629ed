"""Packages of a scan with the output z: they name the files of both sequencers, and what they compile plays both."""

import json
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
import yaml
import zephyr_tree
from building import NAME, REPOSITORY, run_clean
from editing import run
from tilted_scans import write_straight

import tablegen
from tablegen.base.input_errors import Rejected
from tablegen.config.schema import FORMATS_WITH_Z
from tablegen.device.sequencer import Sequencer
from tablegen.manifest.read import read_build
from tablegen.verification.run import verify

PACKAGES = [name for name in FORMATS_WITH_Z if name not in ("c", "verilog")]
TICKS = 300
TWO_SEQUENCERS = REPOSITORY / "tests" / "verification" / "two_sequencers.c"
OF_Z = {f"{NAME}_z.c", f"{NAME}_z_program.c"}
TOP_OF_Z = f"{NAME}_z_top.v"
ZEPHYR = """
cmake_minimum_required(VERSION 3.20)
list(APPEND ZEPHYR_EXTRA_MODULES ${CMAKE_CURRENT_SOURCE_DIR}/module)
find_package(Zephyr REQUIRED HINTS $ENV{ZEPHYR_BASE})
project(play C)
target_sources(app PRIVATE main.c)
"""


@pytest.fixture(scope="module")
def build(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A short frame in all of them."""
    folder = tmp_path_factory.mktemp("packages")
    tablegen.build(write_straight(folder), folder / "out", formats=PACKAGES)
    return folder / "out"


def text_of(build: Path, name: str) -> str:
    return (build / name).read_text("ascii")


def c_sources(build: Path) -> set[str]:
    return {path.name for path in build.glob("*.c")}


def named_sources(build: Path, package: str) -> set[str]:
    """The C files that a package names as its sources."""
    if package == "platformio":
        filters = json.loads(text_of(build, "library.json"))["build"]["srcFilter"]
        return {each.removeprefix("+<").removesuffix(">") for each in filters[1:]}
    file = {"cmsis-pack": f"tablegen.{NAME}.pdsc", "esp-idf": "CMakeLists.txt", "zephyr": "zephyr/CMakeLists.txt"}
    return set(re.findall(r"\w+\.c\b", text_of(build, file[package])))


@pytest.mark.parametrize("package", ["platformio", "cmsis-pack", "esp-idf", "zephyr"])
def test_it_names_the_c_files_of_both_sequencers(package: str, build: Path) -> None:
    assert c_sources(build) > OF_Z
    assert named_sources(build, package) == c_sources(build)


def test_its_headers_are_those_of_both_programs(build: Path) -> None:
    headers = [f"{NAME}{end}" for end in (".h", "_program.h", "_z.h", "_z_program.h")]
    assert json.loads(text_of(build, "library.json"))["headers"] == headers
    assert f"includes={','.join(headers)}\n" in text_of(build, "library.properties")
    assert all((build / name).exists() for name in headers)


def test_it_names_the_verilog_of_both_tops(build: Path) -> None:
    modules = {path.name for path in build.glob("*.v")}
    memories = {path.name for path in build.glob("*.mem")}
    core = yaml.safe_load(text_of(build, f"{NAME}.core"))["filesets"]
    entries = [each for part in ("rtl", "memories") for each in core[part]["files"]]
    named = [name for each in entries for name in (each if isinstance(each, dict) else [each])]
    assert modules > {TOP_OF_Z, "dac_slow_engine.v", "dac_synchronise.v"}
    assert memories > {f"{NAME}_z_slow.mem"}
    assert sorted(named) == sorted([*modules - {"dac_synchronise.v"}, *memories, f"{NAME}.vh", f"{NAME}_z.vh"])
    for tool in ("vivado", "quartus"):
        words = set(text_of(build, f"{NAME}_{tool}.tcl").split())
        assert words >= {*modules, *memories, f"{NAME}_z.vh"}


def played(program: Path) -> list[list[int]]:
    """The words of z, and the markers of x and y and of z, by the program of two sequencers."""
    done = subprocess.run([program, str(TICKS)], capture_output=True, text=True, check=True)
    return [[int(word) for word in line.split()] for line in done.stdout.splitlines()]


def modelled(build: Path) -> list[int]:
    """The words of z by the model."""
    program = read_build(build).program_of_z
    assert program is not None
    model = Sequencer(None)
    model.commit(program)
    model.arm()
    model.trigger()
    return [program.x.output.word(model.step().x) for _ in range(TICKS)]


@pytest.mark.common
def test_the_sources_of_a_package_play_both(build: Path, tmp_path: Path) -> None:
    """With the options that the package brings, and none of the compiler."""
    sources = [build / name for name in sorted(named_sources(build, "platformio"))]
    program = tmp_path / "play"
    run_clean(["gcc", "-std=c99", "-O1", "-Wall", "-Wextra", f"-I{build}", TWO_SEQUENCERS, *sources, "-o", program])
    rows = played(program)
    assert [row[0] for row in rows] == modelled(build)
    assert len(np.unique([row[0] for row in rows])) > 100


@pytest.mark.rest
def test_an_application_of_zephyr_plays_both(build: Path, tmp_path: Path) -> None:
    """The module gives its slow part to the application too."""
    shutil.copytree(build, tmp_path / "module")
    (tmp_path / "CMakeLists.txt").write_text(ZEPHYR, "ascii")
    shutil.copy(TWO_SEQUENCERS, tmp_path / "main.c")
    setting = f"CONFIG_TABLEGEN_{NAME.upper()}=y"
    program = zephyr_tree.compiled(tmp_path, tmp_path / "module", tmp_path / "made", setting)
    assert [row[0] for row in played(program)] == modelled(build)


def test_a_module_without_the_slow_part_is_missed(build: Path, tmp_path: Path) -> None:
    """A negative control: the option stands for the runtime and for the tables."""
    folder = shutil.copytree(build, tmp_path / "out")
    options = text_of(folder, "tablegen_options.h").replace("#define DAC_SLOW_PART 1", "#define DAC_SLOW_PART 0")
    (folder / "tablegen_options.h").write_text(options, "ascii")
    command = ["gcc", "-std=c99", "-fsyntax-only", folder / f"{NAME}_z_program.c"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode
    assert "DAC_SLOW_PART" in done.stderr


def test_an_avr_is_refused_by_the_compiler(build: Path, tmp_path: Path) -> None:
    """Its tables are in flash, from which no slow part is read."""
    (tmp_path / "avr").mkdir()
    (tmp_path / "avr" / "pgmspace.h").write_text("#define PROGMEM\n", "ascii")
    command = ["gcc", "-std=c99", "-fsyntax-only", "-D__AVR__", f"-I{tmp_path}", build / f"{NAME}_z_program.c"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert "DAC_PROGMEM has no slow parts" in done.stderr


@pytest.mark.rest
def test_the_files_of_the_core_elaborate_the_top_of_z(build: Path) -> None:
    files = yaml.safe_load(text_of(build, f"{NAME}.core"))["filesets"]["rtl"]["files"]
    sources = [build / name for name in files if isinstance(name, str)]
    run_clean(["iverilog", "-g2005", "-t", "null", "-s", TOP_OF_Z.removesuffix(".v"), f"-I{build}", *sources])
    without = [path for path in sources if path.name != "dac_slow_engine.v"]
    command = ["iverilog", "-g2005", "-t", "null", "-s", TOP_OF_Z.removesuffix(".v"), f"-I{build}", *without]
    assert subprocess.run(command, capture_output=True, check=False).returncode


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [("library.json", "_z_program.c", "_program.c"), (f"{NAME}.core", TOP_OF_Z, "other_top.v")],
)
def test_a_changed_package_is_found(name: str, old: str, new: str, build: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(build, tmp_path / "out")
    assert verify(folder, "files").failures == []
    (folder / name).write_text(text_of(folder, name).replace(old, new), "ascii")
    failures = verify(folder, "files").failures
    assert any(name in failure for failure in failures), failures


@pytest.mark.parametrize("name", ["cargo", "csv", "coe"])
def test_a_format_of_one_sequencer_is_refused(name: str, build: Path) -> None:
    outcome = run("build", build.parent / "scan.toml", "-o", build.parent / "other", "-f", name)
    assert outcome.status == 2
    assert f"'{name}' plays no output z; take c, verilog, {', '.join(PACKAGES)}, or leave [z] out" in outcome.err


def test_the_clock_of_z_is_checked_for_a_package_of_verilog(tmp_path: Path) -> None:
    """Though its formats do not name Verilog; it takes 93 clocks a tick."""
    scan = write_straight(tmp_path, "+ [emit]\nclock_hz = 46e6\nformats = ['fusesoc']")
    with pytest.raises(Rejected, match="the sequencer of z takes 93"):
        _ = tablegen.build(scan).files
