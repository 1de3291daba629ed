"""The start page of firmware projects, followed from `pip install` of the wheel to programs that play the scan.

Run with ``-s`` it prints how long each recipe takes.
"""

import shutil
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest
import zephyr_tree
from building import REPOSITORY, run_clean
from installing import python, requirements
from packed_library import pack_platformio, run_offline, unpacked
from page_script import run_page
from sketches import own_warnings, run_builder, simulated_lines

from tablegen.config.load import load
from tablegen.device.sequencer import Sequencer
from tablegen.planning.line_plan import make_plan

pytestmark = pytest.mark.rest

PAGE = REPOSITORY / "docs" / "start" / "projects.md"
NAME = "annexin_200nm"
SENT = 60  # lines of a serial monitor


@contextmanager
def timed(what: str) -> Iterator[None]:
    """Print how long something takes."""
    start = time.perf_counter()
    yield
    print(f"{what}: {time.perf_counter() - start:.1f} s")


@dataclass
class Reader:
    """A reader of the page, whose home and working directory is a folder."""

    folder: Path
    before: str

    def follow(self, title: str) -> None:
        """Run the commands of a section, and compare what it shows."""
        section = PAGE.read_text("utf-8").partition(f"\n## {title}\n")[2].partition("\n## ")[0]
        assert "```" in section
        page = self.folder / "section.md"
        page.write_text(section, "utf-8")
        activate = ". piezo/bin/activate" if (self.folder / "piezo").exists() else ""
        assert run_page(page, self.folder, f"{self.before}\n{activate}") == []

    def line(self) -> list[str]:
        """Return what the model plays of a line from its park codes on, as the programs of the page print it."""
        plan = make_plan(load(self.folder / "scans" / f"{NAME}.toml"))
        program, model = plan.program, Sequencer(None)
        model.commit(program)
        while not model.step().parked:
            pass
        model.arm()
        assert model.trigger()
        ticks = [model.step() for _ in range(plan.schedule.ticks)]
        return [f"{program.x.output.word(tick.x)} {program.y.output.word(tick.y)}" for tick in ticks]


@pytest.fixture(scope="module")
def reader(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Reader:
    """After the installation; what pip would fetch is there already."""
    folder = tmp_path_factory.mktemp("reader")
    shutil.copy(wheel, folder)
    packages = requirements(folder / "requirements")
    settings = {"HOME": folder, "PYTHONPATH": packages, "PIP_NO_INDEX": 1, "PIP_NO_DEPS": 1}
    reader = Reader(folder, "export " + " ".join(f"{name}={value}" for name, value in settings.items()))
    with timed("Install, without a download"):
        reader.follow("Install")
    reader.follow("The program")
    where = python(folder, "paths", "--cmake", path=packages, program=folder / "piezo" / "bin" / "tablegen")
    assert Path(where).is_relative_to(folder / "piezo")
    return reader


def test_the_sketch_of_arduino_sends_the_model(reader: Reader, tmp_path: Path) -> None:
    sketchbook = reader.folder / "Arduino"
    with timed("Arduino, with Debian's builder"):
        reader.follow("Arduino")
        sketch, libraries = sketchbook / "play" / "play.ino", sketchbook / "libraries"
        done = run_builder(sketch, "mega:cpu=atmega2560", tmp_path, "-libraries", libraries)
    assert (done.returncode, own_warnings(done)) == (0, []), done.stderr
    assert simulated_lines(tmp_path / "play.ino.elf", SENT) == reader.line()[:SENT]


def test_what_platformio_packs_of_the_project_plays_the_model(reader: Reader, tmp_path: Path) -> None:
    """Its configuration is read by PlatformIO; its main program is compiled with the package, by gcc."""
    project, packed = reader.folder / "player", tmp_path / "packed"
    with timed("PlatformIO, packed, and compiled by gcc"):
        reader.follow("PlatformIO")
        done = pack_platformio(project / "lib" / NAME, tmp_path / "own")
        assert done.returncode == 0, done.stdout + done.stderr
        unpacked(tmp_path / "own" / "packed.tar.gz", packed)
        command = ["gcc", "-std=c99", "-Wall", "-Wextra", "-Werror", f"-I{packed}", project / "src" / "main.c"]
        run_clean([*command, *sorted(packed.glob("*.c")), "-o", tmp_path / "play"])
    assert run_clean([tmp_path / "play"]).splitlines() == reader.line()
    lint = [sys.executable, "-m", "platformio", "project", "config", "-d", project, "--lint"]
    done = run_offline(lint, tmp_path, PLATFORMIO_CORE_DIR=str(tmp_path / "own"))
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_application_with_zephyrs_module_plays_the_model(reader: Reader, tmp_path: Path) -> None:
    application = reader.folder / "app"
    with timed("Zephyr, with a stand-in for its tree"):
        reader.follow("Zephyr")
        settings = (application / "prj.conf").read_text("utf-8").splitlines()
        program = zephyr_tree.compiled(application, application / NAME, tmp_path / "made", *settings)
    assert run_clean([program]).splitlines() == reader.line()


def test_the_project_of_cmake_plays_the_model(reader: Reader) -> None:
    with timed("CMake"):
        reader.follow("CMake")
    assert run_clean([reader.folder / "program" / "build" / "play"]).splitlines() == reader.line()
