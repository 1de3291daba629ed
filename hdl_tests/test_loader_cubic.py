"""program_loader of a device that plays cubic tables: each axis takes tables of the one mode that it is made for."""

from collections import Counter
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from link_talk import Talk
from loader_bridge import Simulation, compile_loader
from loader_device import Loader
from programs import random_dual
from sets import LONG_TEST, long
from test_loader import checked_uploads, random_dialogue

from tablegen.base.resources import verilog_runtime
from tablegen.link.messages import (
    ANSWER,
    CUBIC,
    AxisShape,
    DeviceInfo,
    ImageInfo,
    Reason,
    Refusal,
    Request,
)
from tablegen.verification.play.sequencer_shape import SequencerShape

INDEX_BITS = {"X": 7, "Y": 6}  # of the bench
OF_DEGREE = {0: lambda index_bits: 0, 1: lambda index_bits: index_bits, 3: lambda index_bits: index_bits + CUBIC}
DEGREES = [(1, 3), (3, 1), (3, 0), (3, 3), (1, 1)]
# What stands in the place of what, and the device in which that shows.
SAID = "X_INTERPOLATED == 3 || Y_INTERPOLATED == 3 ? 8'd3"
MUTANTS = {
    "no device says its degree": (SAID, "1'b0 ? 8'd3", (3, 1)),
    "that of x is not said": (SAID, "Y_INTERPOLATED == 3 ? 8'd3", (3, 1)),
    "that of y is not said": (SAID, "X_INTERPOLATED == 3 ? 8'd3", (1, 3)),
    "every device says one": ("== 3 ? 8'd3 : 8'd0", "== 3 ? 8'd3 : 8'd3", (1, 1)),
    "it is said in the place of the order": (
        "DEGREE, HIGHEST_ORDER[7:0], MOST_HARMONICS", "HIGHEST_ORDER[7:0], DEGREE, MOST_HARMONICS", (3, 1)
    ),
    "x takes lines for a spline": ("X_INTERPOLATED == 3 ? CUBIC", "X_INTERPOLATED == 3 ? 8'd0", (3, 1)),
    "y takes lines for a spline": ("Y_INTERPOLATED == 3 ? CUBIC", "Y_INTERPOLATED == 3 ? 8'd0", (1, 3)),
    "x takes splines for lines": ("X_INTERPOLATED == 3 ? CUBIC", "X_INTERPOLATED != 0 ? CUBIC", (1, 3)),
    "y takes splines for lines": ("Y_INTERPOLATED == 3 ? CUBIC", "Y_INTERPOLATED != 0 ? CUBIC", (3, 1)),
    "y goes by x": ("Y_INTERPOLATED == 3 ? CUBIC", "X_INTERPOLATED == 3 ? CUBIC", (3, 1)),
    "another bit is that of a spline": ("CUBIC = 8'd128", "CUBIC = 8'd64", (3, 3)),
}  # fmt: skip
FOUND_SOON = (
    "no device says its degree",
    "that of y is not said",
    "y takes lines for a spline",
    "x takes splines for lines",
)


def keeps_to_its_modes(x: int, y: int, folder: Path, sources: list[Path]) -> None:
    """Of a device of these degrees: what HELLO says, and which tables BEGIN takes."""
    given = {"X_INTERPOLATED": x, "Y_INTERPOLATED": y, "LOW_AREA": 1, "FOURIER": 0}
    with Simulation(compile_loader(folder, given, "icarus", sources)) as simulation:
        talk = Talk()
        (hello,) = talk.answers(simulation.talk(talk.hello()))
        info = DeviceInfo.unpack(hello.payload)
        assert (info.degree, info.shaping) == (3 if 3 in (x, y) else 0, 0)
        assert (info.x.index_bits, info.y.index_bits) == (INDEX_BITS["X"], INDEX_BITS["Y"])

        def begin(x_bits: int, y_bits: int) -> tuple[Reason, int] | None:
            shapes = (AxisShape(bits, 16, 16) for bits in (x_bits, y_bits))
            image = ImageInfo(bytes(32), 400, 0, *shapes)
            (answer,) = talk.answers(simulation.talk(talk.request(Request.BEGIN, image.pack())))
            if answer.type == Request.BEGIN | ANSWER:
                return None
            refusal = Refusal.unpack(answer.payload)
            return Reason(refusal.reason), refusal.detail

        own_x, own_y = OF_DEGREE[x](INDEX_BITS["X"]), OF_DEGREE[y](INDEX_BITS["Y"])
        for of_x, of_y in product(OF_DEGREE, OF_DEGREE):
            asked = OF_DEGREE[of_x](INDEX_BITS["X"]), OF_DEGREE[of_y](INDEX_BITS["Y"])
            wanted = (Reason.SHAPE, 0) if of_x != x else (Reason.SHAPE, 1) if of_y != y else None
            assert begin(*asked) == wanted, (of_x, of_y)
        assert begin(own_x ^ 1, own_y) == (Reason.SHAPE, 0), "another length"
        assert begin(own_x, own_y ^ 1) == (Reason.SHAPE, 1), "another length"
        assert begin(own_x ^ 64, own_y) == (Reason.SHAPE, 0)


@pytest.mark.rest
@pytest.mark.parametrize(("x", "y"), [DEGREES[0], *(pytest.param(*each, marks=LONG_TEST) for each in DEGREES[1:])])
def test_it_takes_tables_of_its_own_modes_alone(x: int, y: int, tmp_path: Path) -> None:
    keeps_to_its_modes(x, y, tmp_path, verilog_runtime())


@pytest.mark.rest
@pytest.mark.parametrize("mutant", long(FOUND_SOON, MUTANTS))
def test_a_mutant_is_found(mutant: str, tmp_path: Path) -> None:
    old, new, (x, y) = MUTANTS[mutant]
    sources = []
    for path in verilog_runtime():
        text = path.read_text("utf-8")
        if path.stem == "program_loader":
            assert text.count(old) == 1, old
            path = tmp_path / path.name
            path.write_text(text.replace(old, new), "utf-8")
        sources.append(path)
    with pytest.raises(AssertionError):
        keeps_to_its_modes(x, y, tmp_path / "build", sources)


@pytest.fixture(scope="module", params=[(3, 1), pytest.param((3, 3), marks=LONG_TEST)], ids=["x cubic", "both cubic"])
def loader(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Loader:
    """Of short tables, so that an upload is short too."""
    x, y = request.param
    boot = random_dual(np.random.default_rng(x + y), SequencerShape(16, x, 4, 17, y, 3, 12), kind="smooth")
    wide = (0, 65535, 65535)
    return Loader(tmp_path_factory.mktemp("loader"), boot, (wide, wide), 6, 1_000_000)


@pytest.mark.rest
@pytest.mark.parametrize("seed", long((0,), range(4)))
def test_random_dialogues(seed: int, loader: Loader) -> None:
    assert len(random_dialogue(loader, seed, 120, []).seen) > 10


@pytest.mark.rest
def test_every_check_is_that_of_the_model(loader: Loader) -> None:
    seen: Counter[Any] = Counter()
    for seed in range(2 if loader.boot.x.mode == loader.boot.y.mode else 1):
        seen += checked_uploads(loader, seed, 40, []).seen
    assert seen[Request.COMMIT] > 10
    assert len({key[1] for key in seen if isinstance(key, tuple) and key[0] == Request.COMMIT}) >= 8
