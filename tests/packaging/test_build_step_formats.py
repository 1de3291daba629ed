"""The build step of make and CMake where a scan chooses its formats."""

import json
from pathlib import Path

import pytest
from building import NAME, run
from editing import SCAN, edited, write_pair
from installing import write_command

pytestmark = pytest.mark.common

MAKEFILE = """\
include $(shell $(TABLEGEN) paths --make)
$(eval $(call tablegen_build,scan.toml,out))

show:
\t@echo $(out_FILES)
\t@echo $(out_SOURCES)
"""
CMAKE = """\
cmake_minimum_required(VERSION 3.20)
project(formats C)
find_package(Tablegen REQUIRED)
tablegen_build(scan.toml TARGET scan)
"""


def test_make_knows_the_files_of_every_format(tmp_path: Path, installed: Path) -> None:
    formats = ["c", "vhdl", "systemverilog", "intel-hex", "coe", "mif", "bin", "npz"]
    write_pair(tmp_path, edited(SCAN, f"+ [emit]\nformats = {json.dumps(formats)}"))
    (tmp_path / "Makefile").write_text(MAKEFILE, "ascii")
    program = write_command(tmp_path / "program", installed)
    done = run(["make", "-s", f"TABLEGEN={program}", "show"], tmp_path)
    assert done.returncode == 0, done.stderr
    files, sources = (line.split() for line in done.stdout.splitlines()[-2:])
    listed = json.loads((tmp_path / "out" / "manifest.json").read_bytes())["files"]
    assert sorted(files) == sorted(["out/manifest.json", *(f"out/{name}" for name in listed)])
    assert {f"out/{NAME}.npz", f"out/{NAME}_pkg.vhd", f"out/{NAME}_x_fourier.hex"} < set(files)
    assert sorted(sources) == sorted(f"out/{name}" for name in listed if name.endswith(".c"))


def test_make_builds_a_scan_without_c(tmp_path: Path, installed: Path) -> None:
    write_pair(tmp_path, edited(SCAN, '+ [emit]\nformats = ["bin"]'))
    (tmp_path / "Makefile").write_text(MAKEFILE, "ascii")
    program = write_command(tmp_path / "program", installed)
    for _ in range(2):
        done = run(["make", "-s", f"TABLEGEN={program}", "show"], tmp_path)
        assert done.returncode == 0, done.stderr
        assert done.stdout.splitlines()[-1] == ""
    log = (tmp_path / "program" / "log").read_text("utf-8")
    assert log.count("build scan.toml") == 1


def test_cmake_says_that_it_needs_c(tmp_path: Path, installed: Path) -> None:
    write_pair(tmp_path, edited(SCAN, '+ [emit]\nformats = ["verilog"]'))
    (tmp_path / "CMakeLists.txt").write_text(CMAKE, "ascii")
    program = write_command(tmp_path / "program", installed)
    folder = run([program, "paths", "--cmake"]).stdout.strip()
    done = run(["cmake", "-S", ".", "-B", "b", f"-DTABLEGEN={program}", f"-DTablegen_DIR={folder}"], tmp_path)
    assert done.returncode != 0
    assert 'makes a library of C sources; add "c" to emit.formats' in " ".join(done.stderr.split())
