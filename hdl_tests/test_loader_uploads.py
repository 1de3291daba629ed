"""Whole uploads into program_loader and dac_sequencer: every line that is played is the model's, before and after.

The last ones are by the command line, over TCP, into a simulation that runs meanwhile.
"""

import json
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest
from building import Build, Variant, build
from limits import PATIENCE_S
from line_log import LineCheck, PlayedLine, WrongLine
from link_talk import Talk
from loader_bridge import Simulation
from loader_device import Loader
from replacing import replace
from sets import long

from tablegen.device.dual_program import DualProgram
from tablegen.link.messages import ANSWER, DeviceState, DeviceStatus, Request, Upload
from tablegen.link.program_image import ProgramImage, make_image

pytestmark = pytest.mark.rest

UPDATE_RATE_HZ = 50_000
LINE = 331  # ticks
HARMONICS = 16
CLOCKS_PER_BIT = 16  # the least at which the loader keeps up with the line
BAUD = 2400  # by which a client reckons its time-outs; a simulation has no rate of its own
SHORT: dict[str, object] = {
    "timing": {"pixels": 40, "lines": 8, "line_rate_hz": 100.0, "ticks_per_line": LINE, "settle_lines": 1},
    "dac.update_rate_hz": float(UPDATE_RATE_HZ),
    "x.band_limit.harmonics": HARMONICS,
    "y.band_limit.harmonics": 8,
}
CUBIC = {"mode": "cubic", "length": 64, "bits": 14}


@dataclass(frozen=True)
class Case:
    """What the tables of a device are, the kind of its axes, and clocks from tick to tick."""

    tables: dict[str, object]
    low_area: int
    tick_every: int = 50


LINES_OF = {"x.table.length": 256, "y.table.length": 128}
CUBIC_TABLES = {"x.table": CUBIC, "y.table": {**CUBIC, "length": 32}}
CASES = {
    "low area": Case(LINES_OF, 1),
    "cubic": Case(CUBIC_TABLES, 0),
    "a sample a clock": Case(LINES_OF, 0),
    "cubic in low area": Case(CUBIC_TABLES, 1, tick_every=100),
}


@dataclass(frozen=True, eq=False)
class Scans:
    """What a device boots with, and two others."""

    boot: Build
    others: tuple[Build, Build]

    @property
    def all(self) -> dict[str, DualProgram]:
        """Programs by name."""
        names = ("boot", "first", "second")
        return {name: each.plan.program for name, each in zip(names, (self.boot, *self.others), strict=True)}


@pytest.fixture(scope="module", params=long(("low area", "cubic"), CASES))
def case(request: pytest.FixtureRequest) -> Case:
    return CASES[request.param]


@pytest.fixture(scope="module")
def scans(case: Case, tmp_path_factory: pytest.TempPathFactory) -> Scans:
    folder = tmp_path_factory.mktemp("scans")
    built = [
        build(folder / str(size), Variant({**SHORT, **case.tables, "x.size_nm": size, "y.size_nm": size}))
        for size in (200.0, 150.0, 90.0)
    ]
    return Scans(built[0], (built[1], built[2]))


@pytest.fixture(scope="module")
def loader(case: Case, scans: Scans, tmp_path_factory: pytest.TempPathFactory) -> Loader:
    boot = scans.boot.plan.program
    x, y = ((0, 65535, axis.output.max_step + 100) for axis in (boot.x, boot.y))
    folder = tmp_path_factory.mktemp("loader")
    return Loader(
        folder, boot, (x, y), HARMONICS, UPDATE_RATE_HZ, LOW_AREA=case.low_area, CLOCKS_PER_BIT=CLOCKS_PER_BIT
    )


def image_of(built: Build, fourier: bool) -> ProgramImage:
    """An upload in one of the two forms."""
    program = built.plan.program
    digest = str(built.manifest["hash"])
    if not fourier:
        return make_image(program, digest)
    return make_image(program, digest, *(line.fourier.in_order for line in built.plan.lines))


def follow(scans: Scans, simulation: Simulation) -> LineCheck:
    """Hold the log against the model. Raises ``WrongLine``."""
    programs = scans.all
    check = LineCheck(programs["boot"])
    for name, program in programs.items():
        check.offer(name, program)
    check.follow(PlayedLine.parse(line) for line in simulation.lines())
    return check


def status(simulation: Simulation, talk: Talk) -> DeviceStatus:
    """The answer to STATUS, whatever else is answered meanwhile."""
    answers = talk.answers(simulation.talk(talk.request(Request.STATUS)))
    (answer,) = (frame for frame in answers if frame.type == Request.STATUS | ANSWER)
    return DeviceStatus.unpack(answer.payload)


def test_uploads_while_a_scan_plays(case: Case, loader: Loader, scans: Scans) -> None:
    talk = Talk()
    with Simulation(loader.compiled) as simulation:
        simulation.set(tick_every=case.tick_every)
        simulation.ticks(None)
        simulation.run(case.tick_every * 200)
        simulation.talk(talk.hello())
        simulation.talk(talk.acting(Request.ARM, bytes(4)) + talk.acting(Request.TRIGGER))
        simulation.run(case.tick_every * LINE * 3)
        for count, (built, fourier) in enumerate(
            [(scans.others[0], False), (scans.others[1], True), (scans.boot, True), (scans.others[1], False)], 2
        ):
            image = image_of(built, fourier)
            for wire in talk.upload(image):
                simulation.talk(wire)
            simulation.talk(talk.commit(image))
            now = status(simulation, talk)
            assert now.upload == Upload.WAITING or now.generation == count
            simulation.run(case.tick_every * LINE * 3)
            now = status(simulation, talk)
            assert (now.state, now.generation, now.hash) == (DeviceState.PLAYING, count, image.info.hash)
            assert (now.faults, now.bad_frames) == (0, 0)
        check = follow(scans, simulation)
        assert check.taken == {1: "boot", 2: "first", 3: "second", 4: "boot", 5: "second"}
        assert check.lines > 12

        # Negative control: one line, as if a tick of it had been another.
        log = [PlayedLine.parse(line) for line in simulation.lines()]
        log[5] = replace(log[5], crc=log[5].crc ^ 1)
        with pytest.raises(WrongLine):
            LineCheck(scans.all["boot"]).follow(log)


def test_it_keeps_up_with_the_line(case: Case, loader: Loader, scans: Scans) -> None:
    """A whole upload without a pause between two bytes."""
    talk, image = Talk(), image_of(scans.others[0], fourier=False)
    with Simulation(loader.compiled) as simulation:
        simulation.ticks(None)
        simulation.run(case.tick_every * 200)
        simulation.talk(talk.hello())
        wire = b"".join(talk.upload(image)) + talk.commit(image)
        answers = talk.answers(simulation.talk(wire) + simulation.run(case.tick_every * 10))
        assert [frame.type for frame in answers][-1] == Request.COMMIT | ANSWER
        assert status(simulation, talk).bad_frames == 0


def command(*arguments: str | Path | int) -> subprocess.CompletedProcess[str]:
    """The command line as people use it."""
    return subprocess.run(
        [sys.executable, "-m", "tablegen", *map(str, arguments)],
        capture_output=True,
        text=True,
        stdin=subprocess.DEVNULL,
        timeout=PATIENCE_S,
    )


@pytest.mark.parametrize("case", long(("low area",), CASES), indirect=True)
def test_the_command_line(case: Case, loader: Loader, scans: Scans) -> None:
    with Simulation(loader.compiled) as simulation:
        simulation.set(tick_every=case.tick_every)
        simulation.ticks(None)
        with simulation.bridged() as port:
            where = ("--port", port, "--baud", BAUD)
            steps: list[tuple[str | Path | int, ...]] = [
                ("trigger", *where),
                ("upload", scans.others[0].folder, *where, "--as", "table"),
                ("readback", scans.others[0].folder, *where),
                ("upload", scans.others[1].folder, *where, "--as", "fourier"),
                ("status", *where, "--json"),
                ("park", *where),
            ]
            done = [command(*step) for step in steps]
            for step, each in zip(steps, done, strict=True):
                assert each.returncode == 0, (step, each.stdout, each.stderr)
            assert json.loads(done[4].stdout)
        check = follow(scans, simulation)
        assert check.taken == {1: "boot", 2: "first", 3: "second"}
