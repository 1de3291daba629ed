"""A shaped build on its way into devices: one that has the order plays its codes, another one is sent nothing."""

from pathlib import Path

import pytest
from building import Variant, build
from client_rig import BOOT, Bench, info_for, model

from tablegen.device.dual_program import DualProgram
from tablegen.device.sequencer import Sequencer
from tablegen.fixedpoint.shaping import Shaping
from tablegen.link.frames import FrameReader
from tablegen.link.messages import Request
from tablegen.link.prepare import PreparedScan
from tablegen.manifest.read import read_build

SECOND_ORDER = {"frequency_hz": 1000.0, "quality": 10.0}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Of the third order in x, of the second in y."""
    variant = Variant({"timing.lines": 20, "dac.shaping": "scanner"}, {"y.resonance": SECOND_ORDER})
    return build(tmp_path_factory.mktemp("shaped"), variant).folder


def codes(program: DualProgram, ticks: int) -> list[tuple[int, int]]:
    sequencer = Sequencer(program)
    sequencer.arm()
    sequencer.trigger()
    return [(tick.x, tick.y) for tick in (sequencer.step() for _ in range(ticks))]


@pytest.mark.parametrize("form", ["table", "fourier"])
def test_a_device_of_this_order_plays_it(folder: Path, form: str) -> None:
    info = info_for(PreparedScan.of_build(folder), shaping=3)
    bench = Bench(model(info, boot=BOOT))
    outcome = bench.run("upload", folder, "--as", form)
    assert outcome.status == 0, outcome.err
    got, wanted = bench.device.player.playing, read_build(folder).program
    assert got is not None
    assert (got.x.output.shaping, got.y.output.shaping) == (Shaping(3, 110), Shaping(2))
    ticks = 3 * wanted.schedule.ticks
    assert codes(got, ticks) == codes(wanted, ticks)


@pytest.mark.parametrize("order", [0, 1, 2])
def test_a_device_without_it_is_sent_nothing(folder: Path, order: int) -> None:
    info = info_for(PreparedScan.of_build(folder), shaping=order)
    asked: list[int] = []

    def noted(piece: bytes) -> list[bytes]:
        asked.extend(frame.type for frame in FrameReader().feed(piece))
        return [piece]

    bench = Bench(model(info, boot=BOOT), spoil_out=noted)
    before = bench.device.player.playing
    outcome = bench.run("upload", folder)
    assert outcome.status != 0
    assert "shap" in outcome.err
    assert bench.device.player.playing is before
    assert asked[0] == Request.HELLO
    assert not {Request.BEGIN, Request.DATA, Request.COMMIT} & {*asked}
