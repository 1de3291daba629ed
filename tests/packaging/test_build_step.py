"""The build step of make and CMake: what is made again after which change, and that a failure looks like one.

``examples/build_step`` stands outside the repository, beside its scan, and ``tablegen`` is an installed wheel behind a
program that notes its runs. A project is built once for a tool and then changed by one test after the other; whatever a
test has edited is put back after it. What was compiled is seen by the times of object files, not by what tools print.
"""

import os
import re
import shutil
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from building import EXAMPLE, NAME, REPOSITORY, run
from building import tool as find_tool
from editing import SCANNER, edited
from installing import write_command
from sets import LONG_TEST, long

from tablegen import __version__
from tablegen.base.resources import c_link, c_runtime, c_store

pytestmark = pytest.mark.common

TOOLS = ("make", "Unix Makefiles", "Ninja")
OF_THE_SCAN = {"main", NAME, f"{NAME}_program"}  # what includes its header
BUILT = {*OF_THE_SCAN, *(path.stem for path in (*c_runtime(), *c_link(), *c_store()) if path.suffix == ".c")}
LINKED = {"example"}
STAMPS = {"tablegen-build.d", "tablegen-build.options"}  # of make, beside what tablegen writes


@dataclass(frozen=True)
class Made:
    """What one call of the tool did."""

    status: int
    shown: str
    runs: int  # of tablegen build
    compiled: set[str]  # objects, by the names of their sources
    linked: bool


@dataclass
class Project:
    """A copy of the example, the package that it uses, and the tool that builds it."""

    tool: str
    root: Path
    packages: Path
    program: Path
    _kept: dict[Path, bytes | None] = field(default_factory=dict)

    @property
    def folder(self) -> Path:
        """Where the example is."""
        return self.root / "build_step"

    @property
    def scan(self) -> Path:
        """The scan file."""
        return self.root / EXAMPLE.name

    @property
    def scanner(self) -> Path:
        """The scanner file."""
        return self.root / "scanner.toml"

    @property
    def response(self) -> Path:
        """The response that the scanner file names."""
        return self.root / "response.csv"

    @property
    def output(self) -> Path:
        """Where tablegen writes."""
        return self.folder / "build" / ("scan" if self.tool == "make" else "tablegen/scan")

    @property
    def stamp(self) -> Path:
        """What exists only after a build that succeeded."""
        return self.output / ("tablegen-build.d" if self.tool == "make" else "tablegen-build.stamp")

    @property
    def templates(self) -> Path:
        """The templates of the installed package."""
        return self.packages / "tablegen" / "firmware_templates"

    def call(self, *command: str | Path, **environment: str) -> subprocess.CompletedProcess[str]:
        """Run a command in the project, with its tablegen first on the path and no settings of ours."""
        ours = ("PYTHONPATH", "MAKEFLAGS", "MAKELEVEL", "MFLAGS", "CC", "CFLAGS", "CPPFLAGS", "LDFLAGS")
        clean = {key: value for key, value in os.environ.items() if key not in ours}
        clean["PATH"] = f"{self.program.parent}{os.pathsep}{clean['PATH']}"
        return run(command, self.folder, {**clean, **environment})

    def configure(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        """Let CMake write the makefiles."""
        if self.tool == "Ninja":
            find_tool("ninja")
        return self.call("cmake", "-G", self.tool, "-S", ".", "-B", "build", *arguments)

    def build(self, *arguments: str) -> Made:
        """Build everything, or what the arguments say."""
        before, runs = self._times(), self.runs()
        command = ("make",) if self.tool == "make" else ("cmake", "--build", "build")
        done = self.call(*command, *arguments)
        after = self._times()
        new = {name for name in after if after[name] != before.get(name)}
        return Made(done.returncode, done.stdout + done.stderr, self.runs() - runs, new - LINKED, bool(LINKED & new))

    def clean(self) -> Made:
        """Remove what was built, by the tool's own means."""
        return self.build(*(("clean",) if self.tool == "make" else ("--target", "clean")))

    def runs(self) -> int:
        """How often tablegen build was called."""
        log = self.program.with_name("log")
        return sum(line.startswith("build ") for line in log.read_text("utf-8").splitlines()) if log.exists() else 0

    def play(self) -> str:
        """What the program prints that was linked."""
        return self.call(self.folder / "build" / "example").stdout

    def edit(self, path: Path, old: str, new: str) -> None:
        """Replace a text that stands in a file once."""
        text = path.read_text("utf-8")
        assert text.count(old) == 1, f"{path} has {old!r} {text.count(old)} times"
        self.write(path, text.replace(old, new))

    def append(self, path: Path, text: str) -> None:
        """Add a text at the end of a file."""
        self.write(path, path.read_text("utf-8") + text)

    def write(self, path: Path, text: str) -> None:
        """Write a file, to be put back after the test."""
        self._keep(path)
        path.write_text(text, "utf-8")

    def remove(self, path: Path) -> None:
        """Remove a file, to be put back after the test."""
        self._keep(path)
        path.unlink()

    def put_back(self) -> None:
        """Undo what tests have edited, and build that."""
        for path, content in self._kept.items():
            if content is None:
                path.unlink(missing_ok=True)
            else:
                path.write_bytes(content)
        self._kept.clear()

    def _keep(self, path: Path) -> None:
        self._kept.setdefault(path, path.read_bytes() if path.exists() else None)

    def _times(self) -> dict[str, int]:
        found = {path.name.split(".")[0]: path for path in (self.folder / "build").rglob("*.o")}
        found |= {name: self.folder / "build" / name for name in LINKED}
        return {name: path.stat().st_mtime_ns for name, path in found.items() if path.exists()}


def make_project(tool: str, folder: Path, installed: Path) -> Project:
    """The example, not yet built. CMake gets spaces into all paths; make cannot have them."""
    root = folder / ("project" if tool == "make" else "a project")
    packages = folder / ("packages" if tool == "make" else "the packages")
    shutil.copytree(installed, packages)
    shutil.copytree(REPOSITORY / "examples" / "build_step", root / "build_step", ignore=shutil.ignore_patterns("build"))
    program = write_command(folder / ("bin" if tool == "make" else "a bin"), packages)
    project = Project(tool, root, packages, program)
    shutil.copy(EXAMPLE, project.scan)
    measured = edited(SCANNER, "- [x.resonance]", "+ [x.resonance]\nresponse = 'response.csv'")
    project.scanner.write_text(measured, "utf-8")
    project.response.write_text("hz,gain,phase_deg\n1,1,0\n40e3,1.2,-5\n90e3,1.1,-90\n", "ascii")
    return project


@pytest.fixture(scope="module", params=long(("make", "Ninja"), TOOLS))
def built(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory, installed: Path) -> Project:
    """A project that was built once, with four jobs."""
    tool = request.param
    project = make_project(tool, tmp_path_factory.mktemp("built"), installed)
    if tool != "make":
        done = project.configure()
        assert done.returncode == 0, done.stdout + done.stderr
    made = project.build("-j4")
    assert (made.status, made.runs, made.compiled, made.linked) == (0, 1, BUILT, True), made.shown
    return project


@pytest.fixture
def project(built: Project) -> Iterator[Project]:
    """A project in which there is nothing left to do."""
    made = built.build()
    assert made.status == 0, made.shown
    assert built.stamp.exists()
    yield built
    built.put_back()


def does(made: Made, runs: int, compiled: set[str]) -> None:
    """Fail unless a build succeeded and did just that; what is compiled is linked."""
    assert (made.status, made.runs, made.compiled, made.linked) == (0, runs, compiled, bool(compiled)), made.shown


# What is made again


def test_there_is_nothing_to_do_after_a_build(project: Project) -> None:
    before = {path: path.stat().st_mtime_ns for path in (project.folder / "build").rglob("*") if path.is_file()}
    does(project.build(), 0, set())
    does(project.build("-j4"), 0, set())
    after = {path: path.stat().st_mtime_ns for path in before}
    log = re.compile(
        r"\.ninja_(log|deps)|.*\.(make|internal|ts|log|check_cache)|progress\.marks|Makefile2?|TargetDirectories\.txt"
    )
    assert {path for path in before if before[path] != after[path] and not log.fullmatch(path.name)} == set()


def test_the_program_is_that_of_the_scan(project: Project) -> None:
    assert project.play().startswith("1250 ticks a line, words of x: ")


def test_a_number_of_the_scan_recompiles_what_has_it_and_links(project: Project) -> None:
    project.edit(project.scan, "line_rate_hz = 400.0", "line_rate_hz = 500.0")
    does(project.build(), 1, OF_THE_SCAN)
    assert project.play().startswith("1000 ticks a line, ")
    does(project.build(), 0, set())


@pytest.mark.rest
@pytest.mark.parametrize("name", long(["scanner"], ["scan", "scanner", "response"]))
def test_a_comment_runs_tablegen_and_compiles_nothing(project: Project, name: str) -> None:
    project.append(getattr(project, name), "# a comment\n")
    does(project.build(), 1, set())
    does(project.build(), 0, set())


def test_what_uses_a_scan_is_compiled_for_its_widths(project: Project) -> None:
    """Words of tables and converters of more than 16 bits take 32 in memory, in every file that is compiled."""
    project.edit(project.folder / "main.c", 'printf("\\n");', 'printf(" %d\\n", SCAN_WIDTHS);')
    project.edit(
        project.folder / "main.c",
        "int main",
        "#define SCAN_WIDTHS (DAC_TABLE_STORAGE_BITS + DAC_OUTPUT_STORAGE_BITS)\nint main",
    )
    does(project.build(), 0, {"main"})
    assert project.play().endswith(" 32\n")
    scan = project.scan.read_text("utf-8")
    wide = scan.replace("\nbits = 16\n", "\nbits = 18\n")
    wide = wide.replace("[dac]\nbits = 18\n", "[dac]\nbits = 16\nword_bits = 24\n")
    assert (wide.count("\nbits = 18\n"), wide.count("word_bits")) == (2, 1)
    project.write(project.scan, wide)
    does(project.build(), 1, BUILT)
    assert project.play().endswith(" 64\n")


def snippet_project(folder: Path, snippet: str) -> Project:
    """A project whose Makefile is that of the page, of the example's scan and main."""
    root = folder / "project"
    (root / "build_step" / "build").mkdir(parents=True)
    shutil.copy(EXAMPLE, root)
    shutil.copy(REPOSITORY / "examples" / "scanner.toml", root)
    shutil.copy(REPOSITORY / "examples" / "build_step" / "main.c", root / "build_step")
    (root / "build_step" / "Makefile").write_text(snippet.replace("scan.toml", f"../{EXAMPLE.name}"), "utf-8")
    return Project("make", root, REPOSITORY, write_command(folder / "bin", REPOSITORY))


def widths_of(project: Project) -> set[str]:
    """The file names of the objects that were compiled for words of tables of 32 bits."""
    objects = {path.name: path for path in project.folder.rglob("*.o")}
    return {name for name, path in objects.items() if b"DAC_TABLE_STORAGE_BITS 32" in path.read_bytes()}


@pytest.mark.rest
@pytest.mark.parametrize("guarded", [True, False])
def test_the_snippet_of_the_page_compiles_all_objects_when_a_width_changes(tmp_path: Path, guarded: bool) -> None:
    """From 16 to 20 bits. Without its line on DIR_OPTIONS the runtime stays as it was, and does not link."""
    page = (REPOSITORY / "docs" / "build_step.md").read_text("utf-8")
    snippet = page.partition("```make\n")[2].partition("```")[0]
    guard = "$(OBJECTS): $(build/scan_OPTIONS)\n"
    assert snippet.count(guard) == 1
    project = snippet_project(tmp_path, snippet if guarded else snippet.replace(guard, ""))
    main = project.folder / "main.c"  # of a firmware, it has the types of the sequencer
    main.write_text('#include "dac_sequencer.h"\n' + main.read_text("utf-8"), "utf-8")
    flags = {"CFLAGS": "-g3"}  # macros stand in the objects
    done = project.call("make", **flags)
    assert done.returncode == 0, done.stdout + done.stderr
    assert widths_of(project) == set()
    objects = {path.name for path in project.folder.rglob("*.o")}
    assert objects == {f"{name}.o" for name in BUILT}
    project.write(
        project.scan,
        edited(project.scan.read_text("utf-8"), "x.table.bits = 20", "dac.bits = 20", "limits.max_error_lsb = 5"),
    )
    done = project.call("make", "-j2", **flags)
    assert (done.returncode == 0) == guarded, done.stdout + done.stderr
    assert ("multiple definition of `dac_objects_need_the_same_options'" in done.stderr) != guarded
    assert widths_of(project) == (objects if guarded else {f"{name}.o" for name in OF_THE_SCAN})
    if guarded:
        project.append(project.scan, "# a comment\n")
        assert not project.build(*(f"{name}={value}" for name, value in flags.items())).compiled


def test_a_number_of_the_scanner_rebuilds(project: Project) -> None:
    project.edit(project.scanner, "k_nm_per_v = 10.0                # calibrated", "k_nm_per_v = 11.0 # calibrated")
    does(project.build(), 1, OF_THE_SCAN)
    does(project.build(), 0, set())


@pytest.mark.rest
def test_a_number_of_a_response_rebuilds(project: Project) -> None:
    project.edit(project.response, "40e3,1.2,-5", "40e3,1.3,-5")
    does(project.build(), 1, OF_THE_SCAN)
    does(project.build(), 0, set())


@pytest.mark.rest
def test_a_template_rebuilds_what_comes_of_it(project: Project) -> None:
    project.append(project.templates / "c" / "tables.c.j2", "/* the end */\n")
    does(project.build(), 1, {NAME})
    project.append(project.templates / "c" / "tables.h.j2", "/* the end */\n")
    does(project.build(), 1, OF_THE_SCAN)
    assert (project.output / f"{NAME}.h").read_text("ascii").endswith("/* the end */\n")
    does(project.build(), 0, set())


@pytest.mark.rest
def test_a_file_of_the_runtime_rebuilds_itself(project: Project) -> None:
    project.append(project.templates / "c" / "dac_axis.c", "/* the end */\n")
    does(project.build(), 1, {"dac_axis"})
    project.append(project.templates / "verilog" / "dac_axis.v", "// the end\n")
    does(project.build(), 1, set())
    assert (project.output / "dac_axis.v").read_text("ascii").endswith("// the end\n")
    does(project.build(), 0, set())


def test_a_module_of_tablegen_runs_it(project: Project) -> None:
    project.append(project.packages / "tablegen" / "emit" / "render.py", "# a comment\n")
    does(project.build(), 1, set())
    does(project.build(), 0, set())


@pytest.mark.rest
def test_another_version_of_tablegen_runs_it(project: Project) -> None:
    """Though all of its files may be older than the build, as package managers that keep times leave them."""
    (record,) = project.packages.glob("piezo_tablegen-*.dist-info")
    other = record.rename(record.with_name("piezo_tablegen-999.dist-info"))
    try:
        does(project.build(), 1, set())
        does(project.build(), 0, set())
    finally:
        other.rename(record)
    does(project.build(), 1, set())


def test_what_has_nothing_to_do_with_it_does_nothing(project: Project) -> None:
    project.write(project.root / "notes.txt", "mine\n")
    project.write(project.output / "notes.txt", "mine\n")
    project.append(project.packages / "tablegen" / "cli" / "show.py", "# a comment\n")
    project.append(project.packages / "tablegen" / "examples" / "scanner.toml", "# a comment\n")
    does(project.build(), 0, set())


def test_the_source_of_the_user_compiles_itself(project: Project) -> None:
    project.append(project.folder / "main.c", "/* the end */\n")
    does(project.build(), 0, {"main"})


@pytest.mark.rest
def test_a_scan_that_becomes_header_only_loses_a_source(project: Project) -> None:
    """The sources are those of the scan as it is now; NAME.c of before is removed."""
    project.append(project.scan, "[emit]\nheader_only = true\n")
    made = project.build()
    assert (made.status, made.runs, made.compiled, made.linked) == (0, 1, {"main"}, True), made.shown
    assert not (project.output / f"{NAME}.c").exists()
    assert project.play().startswith("1250 ticks a line, ")
    does(project.build(), 0, set())
    project.put_back()
    made = project.build()
    assert (made.status, made.runs, made.compiled >= {"main"}, made.linked) == (0, 1, True, True), made.shown


@pytest.mark.rest
def test_four_jobs_after_cleaning_run_tablegen_once(project: Project) -> None:
    cleaned = project.clean()
    assert (cleaned.status, cleaned.runs) == (0, 0), cleaned.shown
    assert not project.stamp.exists()
    assert not (project.output / f"{NAME}.h").exists()
    does(project.build("-j4"), 1, BUILT)
    does(project.build("-j4"), 0, set())


# Failures


@pytest.mark.rest
@pytest.mark.parametrize(
    ("name", "old", "new", "why"),
    [
        ("scan", "update_rate_hz = 500e3", "update_rate_hz = -5.0", "dac.update_rate_hz: "),
        pytest.param(
            *("scan", 'name = "annexin_200nm"', 'name = "an nexin"', "name: 'an nexin' is no identifier"),
            marks=LONG_TEST,
        ),
        pytest.param("scan", "max_error_lsb = 1.0", "max_error_lsb = 0.1", "limits.max_error_lsb: ", marks=LONG_TEST),
        ("scanner", "m_minus = 0.92 ", "m_minus = -0.92 ", "x.offset.m_minus: "),
        ("response", "hz,gain,phase_deg", "hz,gain", "x.resonance.response: "),
    ],
)
def test_a_wrong_value_fails_with_what_is_wrong(project: Project, name: str, old: str, new: str, why: str) -> None:
    """By tablegen's own line; and again and again, until it is put right."""
    path = getattr(project, name)
    before = {path.name: path.read_bytes() for path in project.output.iterdir() if "tablegen-build" not in path.name}
    project.edit(path, old, new)
    toml = project.scan.name if name == "scan" else project.scanner.name
    for _ in range(2):
        made = project.build()
        assert made.status != 0
        assert re.search(rf"{re.escape(toml)}:\d+: {re.escape(why)}", made.shown), made.shown
        assert not project.stamp.exists()
        assert (made.compiled, made.linked) == (set(), False)
    after = {path.name: path.read_bytes() for path in project.output.iterdir() if "tablegen-build" not in path.name}
    assert after == before
    project.put_back()
    does(project.build(), 1, set())
    does(project.build(), 0, set())


def test_a_prerequisite_that_is_gone_and_no_longer_named_is_no_error(project: Project) -> None:
    project.edit(project.scanner, "[x.resonance]\nresponse = 'response.csv'\n", "")
    project.remove(project.response)
    does(project.build(), 1, OF_THE_SCAN)
    does(project.build(), 0, set())


@pytest.mark.rest
@pytest.mark.parametrize(("name", "named_by"), [("response", "scanner"), ("scanner", "scan")])
def test_a_prerequisite_that_is_gone_and_still_named_is_missed_by_name(
    project: Project, name: str, named_by: str
) -> None:
    project.remove(getattr(project, name))
    made = project.build()
    assert made.status != 0
    file = getattr(project, name).name
    naming = getattr(project, named_by).name
    assert re.search(rf"{re.escape(naming)}:\d+: .*{re.escape(file)} is not a file", made.shown), made.shown
    assert not project.stamp.exists()
    project.put_back()
    does(project.build(), 1, set())


def test_a_template_that_is_gone_is_no_error_of_the_tool(project: Project) -> None:
    """As after an update to a version that does not have it, whose CMake package is another file too."""
    project.remove(project.templates / "verilog" / "dac_skew.v")
    project.edit(project.templates / "cmake" / "TablegenConfigVersion.cmake", "# ", "# New: ")
    does(project.build(), 1, set())
    does(project.build(), 0, set())


def test_a_tablegen_that_is_killed_leaves_nothing_that_looks_built(project: Project) -> None:
    kill = project.program.with_name("kill")
    project.edit(project.scan, "line_rate_hz = 400.0", "line_rate_hz = 500.0")
    project.write(kill, "")
    for _ in range(2):
        made = project.build()
        assert made.status != 0
        assert (made.compiled, made.linked) == (set(), False)
    kill.unlink()
    does(project.build(), 1, OF_THE_SCAN)


@pytest.mark.rest
def test_files_that_were_written_without_an_end_are_not_taken_for_a_build(project: Project) -> None:
    """What a tablegen leaves that dies after its last file but before it has noted so: the next run completes it."""
    project.edit(project.scan, "line_rate_hz = 400.0", "line_rate_hz = 500.0")
    done = project.call(project.program, "build", project.scan, "-o", project.output, "--quiet")
    assert done.returncode == 0
    project.stamp.unlink()
    does(project.build(), 1, OF_THE_SCAN)


@pytest.mark.rest
@pytest.mark.parametrize("built", ["make", "Ninja"], indirect=True)
@pytest.mark.parametrize("file", long([f"{NAME}.h"], [f"{NAME}.c", f"{NAME}.h", "dac_axis.c", "manifest.json"]))
def test_a_file_of_the_build_that_somebody_removed_is_made_again(project: Project, file: str) -> None:
    """Not by Makefiles of CMake, which know no rule for what a command makes beside its target."""
    content = (project.output / file).read_bytes()
    (project.output / file).unlink()
    made = project.build()
    assert (made.status, made.runs) == (0, 1), made.shown
    assert (project.output / file).read_bytes() == content
    does(project.build(), 0, set())


# Two scans


MAKEFILE = """\
include $(shell tablegen paths --make)
$(eval $(call tablegen_build, first.toml , build/one/))
$(eval $(call tablegen_build,second.toml,build/two))

SOURCES := $(build/one_SOURCES) $(filter-out build/two/dac_%,$(build/two_SOURCES))
build/example: build/main.o $(SOURCES:.c=.o)
	$(CC) $^ -o $@
build/main.o: main.c $(build/one_HEADERS) $(build/two_HEADERS)
	$(CC) -Ibuild/one -Ibuild/two -c $< -o $@
everything := $(sort $(notdir $(build/one_FILES)))
.PHONY: list
list:
	@echo '$(everything)'
	@echo '$(sort $(notdir $(build/one_SOURCES) $(build/one_HEADERS) $(build/one_VERILOG) $(build/one_MEMORY)))'
"""
CMAKELISTS = """\
cmake_minimum_required(VERSION 3.20)
project(two LANGUAGES C)
find_package(Tablegen 0.1 REQUIRED)
tablegen_build(first.toml TARGET one)
tablegen_build(second.toml TARGET two OUTPUT "of two")
add_executable(example main.c)
target_link_libraries(example PRIVATE one two)
"""
MAIN = """\
#include "first.h"
#include "second.h"
int main(void) { return first_x_table[0] == 0 && second_x_table[0] == 0; }
"""


@pytest.fixture(params=long(("make", "Ninja"), TOOLS))
def two(request: pytest.FixtureRequest, tmp_path: Path, installed: Path) -> Project:
    """A program that plays two scans."""
    project = make_project(request.param, tmp_path, installed)
    shutil.rmtree(project.folder)
    project.folder.mkdir()
    for name in ("first", "second"):
        text = (
            EXAMPLE.read_text("utf-8")
            .replace('"annexin_200nm"', f'"{name}"')
            .replace('"scanner.toml"', '"../scanner.toml"')
        )
        (project.folder / f"{name}.toml").write_text(text, "utf-8")
    (project.folder / "Makefile").write_text(MAKEFILE, "ascii")
    (project.folder / "CMakeLists.txt").write_text(CMAKELISTS, "ascii")
    (project.folder / "main.c").write_text(MAIN, "ascii")
    return project


@pytest.mark.rest
def test_two_scans_are_built_once_each_and_one_by_itself(two: Project) -> None:
    if two.tool != "make":
        where = two.call(two.program, "paths", "--cmake").stdout.strip()
        done = two.configure(f"-DTablegen_DIR={where}")
        assert done.returncode == 0, done.stdout + done.stderr
    made = two.build("-j4")
    assert (made.status, made.runs, made.linked) == (0, 2, True), made.shown
    does(two.build("-j4"), 0, set())
    two.edit(two.folder / "second.toml", "line_rate_hz = 400.0", "line_rate_hz = 500.0")
    does(two.build("-j4"), 1, {"main", "second", "second_program"})
    folder = two.folder / "build" / "of two" if two.tool != "make" else two.folder / "build" / "two"
    assert (folder / "second.h").exists()


# Make alone


def test_the_way_in_is_the_same_wherever_it_is_shown() -> None:
    """In the example, which is tested, in the page, and in the file itself."""
    example = REPOSITORY / "examples" / "build_step" / "Makefile"
    program, include = (
        line for line in example.read_text("ascii").splitlines() if line.startswith(("TABLEGEN ?=", "include"))
    )
    page = (REPOSITORY / "docs" / "build_step.md").read_text("utf-8")
    itself = (REPOSITORY / "firmware_templates" / "make" / "tablegen.mk").read_text("ascii")
    assert f"{program}\n{include}\n$(eval $(call tablegen_build,scan.toml,build/scan))\n" in page
    assert f"#   {program}\n#   {include}\n#   $(eval $(call tablegen_build,scan.toml,build/scan))\n" in itself


@pytest.mark.parametrize("two", ["make"], indirect=True)
def test_make_knows_all_files_of_a_build_by_their_kinds(two: Project) -> None:
    everything, kinds = (set(line.split()) for line in two.build("-s", "list").shown.splitlines())
    assert everything == {path.name for path in (two.folder / "build" / "one").iterdir()} - {
        "tablegen-build.d",
        "tablegen-build.options",
    }
    assert everything - kinds == {"manifest.json", "first.vh"}


@pytest.mark.parametrize("two", ["make"], indirect=True)
@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        ("my scan.toml,build", "the scan is 'my scan.toml'; give one path without a space"),
        (",build", "the scan is ''; give one path"),
        ("scan.toml,a build", "the directory is 'a build'; give one path without a space"),
        ("scan.toml", "the directory is ''; give one path"),
    ],
)
def test_make_says_what_it_cannot_take(two: Project, arguments: str, why: str) -> None:
    (two.folder / "Makefile").write_text(
        f"include $(shell tablegen paths --make)\n$(eval $(call tablegen_build,{arguments}))\nall:\n", "ascii"
    )
    made = two.build()
    assert made.status == 2
    assert why in made.shown


@pytest.mark.parametrize("two", ["make"], indirect=True)
def test_cleaning_what_was_never_built_builds_nothing(two: Project) -> None:
    text = (two.folder / "Makefile").read_text("ascii")
    (two.folder / "Makefile").write_text(f"{text}\nclean:\n\trm -rf build\nidle:\n\t@echo idle\n", "ascii")
    assert two.build("clean").runs == 0
    assert two.build("idle", "TABLEGEN_IDLE_GOALS=idle").runs == 0
    assert two.build("idle", "clean").runs == 2
    assert not (two.folder / "build").exists()


# Where tablegen is not


def nowhere(project: Project) -> dict[str, str]:
    """A path on which the tools are, and no tablegen."""
    folders = {str(Path(found).parent) for tool in ("sh", "make", "cmake", "cc") if (found := shutil.which(tool))}
    path = os.pathsep.join(sorted(folders))
    assert shutil.which("tablegen", path=path) is None, "this test needs a tablegen that is not installed beside make"
    return {"PATH": path}


def test_without_tablegen_the_examples_say_what_to_do(tmp_path: Path, installed: Path) -> None:
    for tool in ("make", "Unix Makefiles"):
        project = make_project(tool, tmp_path / tool, installed)
        command = ("make",) if tool == "make" else ("cmake", "-G", tool, "-S", ".", "-B", "build")
        done = project.call(*command, **nowhere(project))
        assert done.returncode != 0
        message = " ".join(done.stderr.split())
        assert re.search(r"(does not run|is not on PATH): install piezo-tablegen,? or give (-D)?TABLEGEN=PATH", message)


def test_without_tablegen_what_is_included_says_what_to_do(tmp_path: Path, installed: Path) -> None:
    """For those who know where it is without asking tablegen."""
    project = make_project("make", tmp_path, installed)
    (project.folder / "Makefile").write_text(f"include {project.templates}/make/tablegen.mk\nall:\n", "ascii")
    (project.folder / "CMakeLists.txt").write_text(CMAKELISTS, "ascii")
    remedy = r"put (tablegen|it) on PATH \('pip install piezo-tablegen' does\), or give (-D)?TABLEGEN=PATH"
    cmake = ("cmake", "-S", ".", "-B", "build", f"-DTablegen_DIR={project.templates}/cmake")
    for command in (("make",), ("make", "TABLEGEN=/nowhere/tablegen --fast"), cmake):
        done = project.call(*command, **nowhere(project))
        assert done.returncode != 0
        assert re.search(remedy, " ".join(done.stderr.split())), done.stderr


@pytest.mark.rest
def test_the_program_may_be_named(tmp_path: Path, installed: Path) -> None:
    """In TABLEGEN; with arguments of its own too."""
    for tool in ("make", "Ninja"):
        project = make_project(tool, tmp_path / tool, installed)
        program = project.program.rename(project.program.with_name("other"))
        environment = nowhere(project)
        if tool == "make":
            done = project.call("make", f"TABLEGEN=env {program}", **environment)
        else:
            project.call("cmake", "-G", tool, "-S", ".", "-B", "build", f"-DTABLEGEN=env;{program}", **environment)
            done = project.call("cmake", "--build", "build", **environment)
        assert done.returncode == 0, done.stdout + done.stderr
        assert project.play().startswith("1250 ticks a line, ")


# CMake alone


@pytest.mark.rest
@pytest.mark.parametrize(
    ("call", "why"),
    [
        ("tablegen_build(first.toml)", "write tablegen_build(SCAN TARGET NAME [OUTPUT DIRECTORY])"),
        ("tablegen_build(first.toml TARGET)", "write tablegen_build(SCAN TARGET NAME [OUTPUT DIRECTORY])"),
        ("tablegen_build(first.toml TARGET a INTO b)", "write tablegen_build(SCAN TARGET NAME [OUTPUT DIRECTORY])"),
        ("tablegen_build(absent.toml TARGET a)", "absent.toml: cannot be read: No such file or directory"),
        ("find_package(Tablegen 99 REQUIRED)", 'compatible with requested version "99"'),
        (
            f'find_package(Tablegen {__version__} EXACT REQUIRED)\nmessage(FATAL_ERROR "is ${{Tablegen_VERSION}}")',
            f"is {__version__}",
        ),
    ],
)
@pytest.mark.parametrize("two", ["Ninja"], indirect=True)
def test_cmake_says_what_it_cannot_take(two: Project, call: str, why: str) -> None:
    head, _, _ = CMAKELISTS.partition("tablegen_build")
    (two.folder / "CMakeLists.txt").write_text(f"{head}{call}\n", "ascii")
    done = two.configure(f"-DTablegen_DIR={two.templates}/cmake")
    assert done.returncode != 0
    assert why in " ".join(done.stderr.split())


@pytest.mark.parametrize("two", ["Ninja"], indirect=True)
def test_a_program_that_is_gone_is_named(two: Project) -> None:
    done = two.configure(f"-DTablegen_DIR={two.templates}/cmake", "-DTABLEGEN=/nowhere/tablegen")
    assert done.returncode != 0
    assert "TABLEGEN is /nowhere/tablegen" in " ".join(done.stderr.split())
