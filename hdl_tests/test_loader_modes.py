"""COMMIT with a mode over the serial link of the Verilog core: what is refused, and what of a frame goes on."""

import struct
from pathlib import Path

import numpy as np
import pytest
from link_images import random_image
from link_talk import Talk
from loader_bridge import Simulation
from loader_device import Loader, LoaderDevice, limited
from loader_dialogues import Dialogue
from sets import long
from test_loader import golden_loader, other_word

from tablegen.device.commit_mode import CommitMode
from tablegen.device.registers import AXIS_WORDS, PAGE_WORDS, SCAN_WORDS
from tablegen.link.messages import ANSWER, AxisLimits, DeviceInfo, Feature, Reason, Request
from tablegen.link.program_image import ProgramImage

TOP = (1 << 16) - 1
SETTLE_LINES = SCAN_WORDS.index("settle_lines")


@pytest.fixture(scope="module")
def loader(tmp_path_factory: pytest.TempPathFactory) -> Loader:
    return golden_loader(tmp_path_factory.mktemp("modes"), COMMIT_MODES=1)


def sent(simulation: Simulation, talk: Talk, image: ProgramImage, mode: int) -> bytes:
    """What a loader says to an upload and its COMMIT with a mode."""
    wire = b"".join(simulation.talk(part) for part in talk.upload(image))
    return wire + simulation.talk(commit(talk, image, mode))


def commit(talk: Talk, image: ProgramImage, mode: int) -> bytes:
    return talk.acting(Request.COMMIT, struct.pack("<IB", image.info.image_crc, mode))


def scanning(simulation: Simulation, loader: Loader) -> Talk:
    """A host of a device that plays the second line of its boot program."""
    talk = Talk()
    LoaderDevice(simulation, loader.info, 1).tick(5)
    (hello,) = talk.answers(simulation.talk(talk.hello()))
    assert bool(DeviceInfo.unpack(hello.payload).features & Feature.COMMIT_MODES) == bool(
        loader.info.features & Feature.COMMIT_MODES
    )
    simulation.talk(talk.acting(Request.ARM, bytes(4)))
    simulation.talk(talk.acting(Request.TRIGGER))
    simulation.ticks(loader.boot.schedule.ticks + 5)
    return talk


@pytest.mark.rest
def test_a_frame_goes_on_or_says_that_it_cannot(loader: Loader) -> None:
    schedule = loader.boot.schedule
    other = other_word(SETTLE_LINES, 5)
    wider = other_word(PAGE_WORDS + AXIS_WORDS.index("park_code"), loader.boot.x.output.code_min)
    with Simulation(loader.compiled, []) as simulation:
        talk = scanning(simulation, loader)
        assert talk.refusals(sent(simulation, talk, other, 3)) == [(Reason.PAYLOAD, 0)]
        assert talk.refusals(simulation.talk(commit(talk, other, CommitMode.KEEP))) == []
        simulation.ticks(schedule.ticks)
        (answer,) = talk.answers(simulation.talk())
        assert answer.type == Request.COMMIT | ANSWER
        assert struct.unpack("<II", answer.payload) == (2, 1)
        talk.answers(sent(simulation, talk, wider, CommitMode.FRAME))
        simulation.ticks(schedule.frame_ticks)
        (answer,) = talk.answers(simulation.talk())
        assert struct.unpack("<II", answer.payload) == (3, schedule.lines - 1)


@pytest.mark.rest
def test_another_frame_cannot_go_on_and_its_upload_stays(loader: Loader) -> None:
    image, program = random_image(np.random.default_rng(1), loader.shape, loader.info.harmonics, "smooth")
    assert program.schedule.ticks != loader.boot.schedule.ticks
    wide = AxisLimits(0, TOP, TOP, TOP)
    with Simulation(loader.compiled, [], limited(loader.info, wide, wide)[1]) as simulation:
        talk = scanning(simulation, loader)
        assert talk.refusals(sent(simulation, talk, image, CommitMode.KEEP)) == [(Reason.KEEP, 0)]
        assert talk.refusals(simulation.talk(commit(talk, image, CommitMode.LINE))) == []
        simulation.ticks(loader.boot.schedule.ticks)
        assert struct.unpack("<II", talk.answers(simulation.talk())[0].payload)[0] == 2


@pytest.mark.rest
def test_a_device_without_modes_refuses_one(tmp_path: Path) -> None:
    loader = golden_loader(tmp_path)
    with Simulation(loader.compiled, []) as simulation:
        talk = scanning(simulation, loader)
        assert talk.refusals(sent(simulation, talk, other_word(SETTLE_LINES, 5), 0)) == [(Reason.PAYLOAD, 0)]


@pytest.mark.rest
@pytest.mark.parametrize("seed", long(range(2), range(6)))
def test_random_dialogues_with_modes(seed: int, loader: Loader) -> None:
    wide = AxisLimits(0, TOP, TOP, TOP)
    info, memory = limited(loader.info, wide, wide)
    with Simulation(loader.compiled, [], memory) as simulation:
        dialogue = Dialogue(LoaderDevice(simulation, info, seed), info, loader.boot, loader.shape, seed)
        dialogue.play(120)
    assert len(dialogue.seen) > 10
