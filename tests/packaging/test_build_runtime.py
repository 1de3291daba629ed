"""Several scans of different widths in one program: one runtime with the highest options, by make and by CMake.

A project has a scan of 16 bits and one of 20 bits whose tables are cubic and whose output is shaped; with make a third
one at an angle, with CMake a sine with a table of pixels. What the program plays of each is held against the model.
"""

import os
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import pytest
from building import REPOSITORY, run
from building import tool as find_tool
from editing import SCAN, SCANNER, edited
from editing import run as tablegen
from foreign_plants import ForeignPlant, ManyPlays
from installing import write_command
from operator_files import operator_file
from sets import long
from short_scans import model_ticks
from sine_scans import response_csv, sine_scan, text_of
from turned_scans import write_turned

from tablegen.base.reading import BUILD_FILE, read_bytes
from tablegen.manifest.turned import parse_any

pytestmark = pytest.mark.rest

WITHOUT_OPTIONS = {"dac_link_frame", "dac_link_mac"}  # which CMake does not compile again
TICKS = 6000  # of each scan: more than a line
SHORT = ("timing.lines = 8", "x.band_limit.harmonics = 16", "y.band_limit.harmonics = 16", "- [limits]")
SCANS = {
    "survey": edited(SCAN, *SHORT),
    "detail": edited(SCAN, *SHORT, "x.table.mode = 'cubic'", "x.table.length = 256", "x.table.bits = 20",
                     "y.table.bits = 20", "dac.shaping = 'second'"),
}  # fmt: skip
SINE = (
    "- x.band_limit.harmonics", "x.motion = 'sine'", "timing.line_rate_hz = 5e3", "dac.update_rate_hz = 2e6",
    "timing.pixels = 48", "timing.lines = 16", "y.band_limit.harmonics = 4",
)  # fmt: skip
MAKEFILE = """\
include $(shell tablegen paths --make)
$(eval $(call tablegen_runtime,$(SCANS),build/scans))

CPPFLAGS += $(build/scans_CPPFLAGS) -MMD -MP
CFLAGS ?= -std=c99 -O2 -Wall -Wextra -Werror
OBJECTS := build/main.o $(build/scans_SOURCES:.c=.o)
build/example: $(OBJECTS)
	$(CC) $^ -o $@
build/main.o: main.c
	$(COMPILE.c) $< -o $@
$(OBJECTS): $(build/scans_OPTIONS)
-include $(OBJECTS:.o=.d)
.PHONY: clean last
clean:
	rm -rf build
last:
	@echo 'alone: $(build/scans/third_CPPFLAGS)'
"""
CMAKELISTS = """\
cmake_minimum_required(VERSION 3.20)
project(several LANGUAGES C)
set(CMAKE_C_FLAGS "-std=c99 -O2 -Wall -Wextra -Werror")
find_package(Tablegen REQUIRED)
tablegen_runtime(TARGET scans SCANS ${SCANS})
add_executable(example main.c)
target_link_libraries(example PRIVATE scans)
list(GET SCANS -1 last)
tablegen_build("${last}" TARGET alone)
set_property(TARGET alone PROPERTY EXCLUDE_FROM_ALL TRUE)
get_target_property(options alone INTERFACE_COMPILE_DEFINITIONS)
message(STATUS "alone: ${options}")
"""
MAIN = """\
#include <stdio.h>
#include <string.h>
%(includes)s
static void play(const char *name, const dac_program *program, const dac_converter *x, const dac_converter *y)
{
    static dac_sequencer sequencer;
    dac_tick now;
    printf("%%s\\n", name);
    if (!dac_sequencer_init(&sequencer, x, y) || dac_sequencer_load(&sequencer, program) != DAC_LOADED
        || !dac_sequencer_commit(&sequencer))
        return;
    dac_sequencer_step(&sequencer, &now);
    dac_sequencer_arm(&sequencer, 0);
    dac_sequencer_trigger(&sequencer);
    for (int i = 0; i < %(ticks)d; i++) {
        dac_sequencer_step(&sequencer, &now);
        printf("%%ld %%ld %%d\\n", (long)now.x, (long)now.y, (now.markers & DAC_PIXEL) != 0);
    }
}

int main(void)
{
%(plays)s
    return 0;
}
"""


@dataclass
class Project:
    """A folder with scans, and the tool that builds a program of them."""

    tool: str
    folder: Path
    program: Path
    scans: list[str]

    @property
    def names(self) -> list[str]:
        """The names of the scans."""
        return [Path(scan).stem for scan in self.scans]

    @property
    def setting(self) -> str:
        """The list of scans, for make."""
        return f"SCANS={' '.join(self.scans)}"

    @property
    def common(self) -> Path:
        """Where the scans are built."""
        return self.folder / "build" / ("scans" if self.tool == "make" else "tablegen/scans")

    def call(self, *command: str | Path) -> subprocess.CompletedProcess[str]:
        """Run a command of the project."""
        ours = ("PYTHONPATH", "MAKEFLAGS", "MAKELEVEL", "MFLAGS", "CC", "CFLAGS", "CPPFLAGS", "LDFLAGS")
        clean = {key: value for key, value in os.environ.items() if key not in ours}
        clean["PATH"] = f"{self.program.parent}{os.pathsep}{clean['PATH']}"
        return run(command, self.folder, clean)

    def build(self) -> subprocess.CompletedProcess[str]:
        """Write the main program of the scans, and build it."""
        includes = "\n".join(f'#include "{name}_program.h"' for name in self.names)
        plays = "\n".join(
            f'    play("{name}", &{name}_program, &{name}_x_converter, &{name}_y_converter);' for name in self.names
        )
        text = MAIN % {"includes": includes, "plays": plays, "ticks": TICKS}
        main = self.folder / "main.c"
        if not main.exists() or main.read_text("ascii") != text:
            main.write_text(text, "ascii")
        if self.tool == "make":
            return self.call("make", "-j2", self.setting)
        where = REPOSITORY / "firmware_templates" / "cmake"
        settings = (f"-DTablegen_DIR={where}", f"-DSCANS={';'.join(self.scans)}")
        done = self.call("cmake", "-G", self.tool, "-S", ".", "-B", "build", *settings)
        if done.returncode == 0:
            configured, done = done, self.call("cmake", "--build", "build", "-j2")
            done.stdout = configured.stdout + done.stdout
        return done

    def times(self) -> dict[str, int]:
        """When each object was compiled."""
        return {path.name.split(".")[0]: path.stat().st_mtime_ns for path in (self.folder / "build").rglob("*.o")}

    def plays_the_models(self) -> bool:
        """Compare every tick that the program plays of each scan with the model of its manifest."""
        expected = []
        for name in self.names:
            stored = parse_any(read_bytes(self.common / name / "manifest.json", BUILD_FILE))
            x, y = stored.program.x.output, stored.program.y.output
            ticks = model_ticks(stored.program, TICKS)[1:]
            expected += [name, *(f"{x.word(tick.x)} {y.word(tick.y)} {int(tick.pixel)}" for tick in ticks)]
        return self.call(self.folder / "build" / "example").stdout.splitlines() == expected


@pytest.fixture
def project(request: pytest.FixtureRequest, tmp_path: Path) -> Project:
    """A project of a tool, not built yet; CMake gets a space into its paths."""
    tool = request.param
    if tool == "Ninja":
        find_tool("ninja")
    folder = tmp_path / ("project" if tool == "make" else "a project")
    third = folder / "third"
    third.mkdir(parents=True)
    (folder / "Makefile").write_text(MAKEFILE, "ascii")
    (folder / "CMakeLists.txt").write_text(CMAKELISTS, "ascii")
    (folder / "scanner.toml").write_text(SCANNER, "utf-8")
    for name, text in SCANS.items():
        (folder / f"{name}.toml").write_text(edited(text, f'name = "{name}"'), "utf-8")
    if tool == "make":
        write_turned(third, 15.0, 'name = "third"', "timing.lines = 24")
    else:
        response = response_csv(ForeignPlant(ManyPlays()), 150e3)
        sine_scan(third, text_of(operator_file("x")), response, *SINE, 'name = "third"')
    (third / "scan.toml").rename(third / "third.toml")
    program = write_command(tmp_path / "bin", REPOSITORY)
    return Project(tool, folder, program, ["survey.toml", "detail.toml", "third/third.toml"])


@pytest.mark.parametrize("project", long(["make"], ["make", "Ninja"]), indirect=True)
def test_scans_of_different_widths_play_in_one_program(project: Project) -> None:
    """First the narrow one alone; then with the others, which have all objects compiled anew."""
    everything, project.scans = project.scans, ["survey.toml"]
    done = project.build()
    assert done.returncode == 0, done.stdout + done.stderr
    assert project.plays_the_models()
    header = project.common / "dac_options.h"
    assert "TABLE_STORAGE_BITS 16" in header.read_text("ascii")
    before = project.times()

    project.scans = everything
    done = project.build()
    assert done.returncode == 0, done.stdout + done.stderr
    text = header.read_text("ascii")
    more = "DAC_SLOW_PART 1" if project.tool == "make" else "DAC_PIXEL_TABLE 1"
    for option in ("DAC_TABLE_STORAGE_BITS 32", "DAC_SPLINE 1", "DAC_SHAPING 2", more):
        assert f"#define {option}\n" in text
    assert project.plays_the_models()
    after = project.times()
    assert {name for name in before if before[name] == after[name]} <= WITHOUT_OPTIONS
    assert set(after) - set(before) == {"detail", "detail_program", "third", "third_program"}

    with (project.folder / "detail.toml").open("a", encoding="utf-8") as file:
        file.write("# a comment\n")
    done = project.build()
    assert (done.returncode, project.times()) == (0, after), done.stdout + done.stderr
    alone = done.stdout if project.tool != "make" else project.call("make", "-s", "last", project.setting).stdout
    last = "DAC_SLOW_PART=1" if project.tool == "make" else "DAC_PIXEL_TABLE=1"
    (told,) = (line for line in alone.splitlines() if "alone: " in line)
    assert last in told


def built(folder: Path, name: str, text: str) -> Path:
    """A build in C of a scan under a name, in a folder of its own."""
    (folder / "scanner.toml").write_text(SCANNER, "utf-8")
    scan = folder / f"{name}.toml"
    scan.write_text(edited(text, f'name = "{name}"', '+ [emit]\nformats = ["c"]'), "utf-8")
    assert tablegen("build", scan, "-o", folder / name, "-q").status == 0
    return folder / name


def compiled(source: Path, target: Path, *options: str) -> subprocess.CompletedProcess[str]:
    """Compile a C file of a build."""
    return run(["gcc", "-std=c99", *options, f"-I{source.parent}", "-c", source, "-o", target])


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Builds of a narrow and of a wide scan."""
    folder = tmp_path_factory.mktemp("pair")
    return built(folder, "survey", SCANS["survey"]), built(folder, "detail", SCANS["detail"])


def test_a_scan_that_the_options_do_not_cover_does_not_compile(pair: tuple[Path, Path], tmp_path: Path) -> None:
    """The compiler says which option is missing, and what writes the options of several scans."""
    survey, detail = pair
    header = tmp_path / "dac_options.h"
    assert tablegen("runtime", survey, "-o", header).out == f"{header}: written\n"
    config = (f"-I{tmp_path}", '-DDAC_CONFIG_FILE="dac_options.h"')
    source = detail / "detail_program.c"
    done = compiled(source, tmp_path / "a.o", *config)
    assert done.returncode != 0
    for option in ("DAC_TABLE_STORAGE_BITS=32", "DAC_SPLINE=1", "DAC_SHAPING=2"):
        why = f"detail needs {option} in all files (tablegen runtime writes the options of several scans)"
        assert why in done.stderr
    assert tablegen("runtime", survey, detail, "-o", header).status == 0
    assert compiled(source, tmp_path / "a.o", *config).returncode == 0
    assert tablegen("runtime", survey, detail, "-o", header).out == f"{header}: up to date\n"
    assert tablegen("runtime", survey, detail).out == header.read_text("ascii")


def test_the_header_serves_beside_the_runtime_without_flags(pair: tuple[Path, Path], tmp_path: Path) -> None:
    """As ``tablegen_options.h``, for sketches of several scans of one width; the control is the same without it."""
    folder = tmp_path / "sketch"
    shutil.copytree(pair[1], folder)
    source = folder / "detail_program.c"
    assert "detail needs DAC_SPLINE=1" in compiled(source, tmp_path / "a.o").stderr
    assert tablegen("runtime", pair[1], "-o", folder / "tablegen_options.h").status == 0
    assert compiled(source, tmp_path / "a.o").stderr == ""


def test_tables_with_words_of_another_size_do_not_link(pair: tuple[Path, Path], tmp_path: Path) -> None:
    """An old NAME.o beside a new NAME_program.o: its words are of 16 bits, and would be read as 32."""
    survey, _ = pair
    objects = [tmp_path / "tables.o", tmp_path / "program.o"]
    for bits, links in ((16, False), (32, True)):
        assert compiled(survey / "survey.c", objects[0], f"-DDAC_TABLE_STORAGE_BITS={bits}").returncode == 0
        assert compiled(survey / "survey_program.c", objects[1], "-DDAC_TABLE_STORAGE_BITS=32").returncode == 0
        done = run(["gcc", "-r", "-nostdlib", *objects, "-o", tmp_path / "both.o"])
        assert (done.returncode == 0) == links, done.stderr
        assert ("multiple definition of `survey_objects_need_the_same_words'" in done.stderr) != links


def test_what_is_no_set_of_builds_is_refused(pair: tuple[Path, Path], tmp_path: Path) -> None:
    survey, _ = pair
    other = tmp_path / "other"
    shutil.copytree(survey, other)
    outcome = tablegen("runtime", survey, other)
    assert outcome.status == 2
    assert f"{other}: its scan has the name 'survey', as that of {survey}; " in outcome.err
    outcome = tablegen("runtime", survey, tmp_path)
    assert (outcome.status, outcome.out) == (2, "")
    assert outcome.err.startswith(f"{tmp_path / 'manifest.json'}: cannot be read: No such file or directory; ")
    (other / "manifest.json").write_text('{"tablegen": "0"}', "ascii")
    assert tablegen("runtime", other).err == f"{other / 'manifest.json'}: is not a manifest of tablegen\n"
    (other / "manifest.json").write_text("{", "ascii")
    assert f"{other / 'manifest.json'}: is damaged: " in tablegen("runtime", other).err
    assert tablegen("build", survey.parent / "survey.toml", "-o", tmp_path / "v", "-f", "verilog", "-q").status == 0
    assert 'has no C; add "c" to emit.formats' in tablegen("runtime", tmp_path / "v").err


@pytest.mark.parametrize("project", ["make", "Ninja"], indirect=True)
def test_two_scan_files_of_one_name_are_refused(project: Project) -> None:
    project.scans = ["survey.toml", "third/survey.toml"]
    shutil.copy(project.folder / "survey.toml", project.folder / "third")
    done = project.build()
    assert done.returncode != 0
    why = {
        "make": "the scans are 'survey.toml third/survey.toml'; give some, whose files have different names",
        "Ninja": "two scans would be the library scans_survey, by the names of their files; rename one",
    }
    assert why[project.tool] in " ".join(done.stderr.split())
