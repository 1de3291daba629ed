"""Cubic tables in the C runtime: what it loads, and what a device that was compiled without them refuses."""

from pathlib import Path

import numpy as np
import pytest
from c_benches import FILL, SANITIZED, words_of
from c_library import BAD_TABLE, LOADED, Device, Library, compile_library, converter_of
from c_scripts import LONG, long_dual, long_play
from link_device import HostDevice, device_library
from link_images import random_image
from link_talk import Talk
from replacing import replace
from sets import common

from tablegen.link.messages import CUBIC, DeviceInfo, Reason
from tablegen.verification.c.bench import CBench, defines
from tablegen.verification.play.sequencer_shape import SequencerShape
from tablegen.verification.play.stream import compare

pytestmark = pytest.mark.common

SHAPE = SequencerShape(16, 3, 4, 16, 1, 4, 16)
WIDE = SequencerShape(16, 3, 4, 21, 1, 4, 21)


def library(folder: Path, bits: int, spline: bool) -> Library:
    more = ["-DDAC_SPLINE=1"] if spline else []
    return Library(compile_library(folder / f"library_{bits}.so", bits, 16, more=more))


def loaded(of: Library, shape: SequencerShape, **changes: int) -> int:
    """What loading says of a program whose x is cubic, with other numbers in x; ``behind`` changes a word there."""
    dual = long_dual(np.random.default_rng(1), shape, (100, 200))
    device = Device(of, *(converter_of(axis.output) for axis in (dual.x, dual.y)))
    program, axes = of.program(dual)
    if (at := changes.pop("behind", None)) is not None:
        axes[0].words[len(dual.x.words) + at] ^= 1
    for key, value in changes.items():
        setattr(program.x, key, value)
    result = device.load(program)
    device.alive.append(axes)
    return result


def test_what_is_loaded(tmp_path: Path) -> None:
    with_splines = library(tmp_path, 16, spline=True)
    assert loaded(with_splines, SHAPE) == LOADED
    for at in range(3):
        assert loaded(with_splines, SHAPE, behind=at) == BAD_TABLE, f"another word {at} behind the last"
    for index_bits in (CUBIC, CUBIC + 2, CUBIC + 3, CUBIC + 5, CUBIC + 17, 64 + 4):
        assert loaded(with_splines, SHAPE, index_bits=index_bits) == BAD_TABLE, index_bits
    for index_bits, expected in ((14, LOADED), (15, BAD_TABLE)):
        assert loaded(with_splines, replace(SHAPE, x_index_bits=index_bits)) == expected
    wide = library(tmp_path, 32, spline=True)
    assert loaded(wide, WIDE) == LOADED
    assert loaded(wide, WIDE, bits=22, gain_q=16 + 22 + 3 - 16) == BAD_TABLE
    assert loaded(wide, WIDE, bits=22, gain_q=16 + 22 + 3 - 16, index_bits=4) == LOADED, "as lines"


def test_without_splines_a_cubic_table_is_not_loaded(tmp_path: Path) -> None:
    without = library(tmp_path, 16, spline=False)
    assert loaded(without, SHAPE) == BAD_TABLE
    assert loaded(without, SHAPE, index_bits=4) == LOADED, "as lines"


@pytest.mark.parametrize("fill", common([FILL], [0, FILL]), ids=["step", "fill"])
@pytest.mark.parametrize("name", common(["cubic_and_lines"], ["cubic", "cubic_and_lines"]))
@pytest.mark.parametrize("long_multiply", common([0], [1, 0]), ids=["long", "short"])
def test_a_spline_is_shaped_as_lines_are(name: str, fill: int, long_multiply: int, tmp_path: Path) -> None:
    """Every order on splines, by runs where there are some and by steps."""
    shape, script = LONG[name][0], long_play(name, 60_000, order=3)
    macro_values = {**defines(shape, fill), "DAC_SHAPING": 3, "DAC_LONG_MULTIPLY": long_multiply}
    played = CBench(shape, tmp_path, "gcc", (*SANITIZED, "-DDAC_WAIT=0"), macro_values=macro_values).run(
        words_of(script, shape)
    )
    kept = (1 << 56) - 1 if fill else (1 << 64) - 1  # a fill tells faults at its end
    assert compare([word & kept for word in script.expected], played.capture) is None
    assert played.counts[:2] == script.counts


@pytest.mark.parametrize("spline", [False, True])
def test_a_device_says_which_degree_it_plays(spline: bool) -> None:
    image, program = random_image(np.random.default_rng(2), SHAPE)
    talk = Talk()
    device = HostDevice(program, library=device_library(16, spline=spline))
    device.receive(talk.hello())
    (answer,) = talk.answers(device.transmit())
    assert DeviceInfo.unpack(answer.payload).degree == (3 if spline else 0)
    device.receive(next(talk.upload(image)))
    refused = [] if spline else [(Reason.SHAPE, 0)]
    assert talk.refusals(device.transmit()) == refused
