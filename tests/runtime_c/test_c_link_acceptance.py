"""``dac_link_check.c`` against ``tablegen.link.acceptance``: the same reason and the same detail for every program."""

import os
from collections import Counter
from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from link_device import HostDevice
from link_images import damaged, random_image, random_limits
from link_programs import make_scan
from link_talk import Talk, is_answer
from programs import pixels_near_ticks
from replacing import replace
from sets import common, one_of

from tablegen.device.dual_program import ScanProgram
from tablegen.device.schedule import Window, has_ticks_for_pixels
from tablegen.link.acceptance import Playing, first_objection
from tablegen.link.frames import Frame
from tablegen.link.messages import REFUSAL, AxisLimits, Reason, Refusal, Request
from tablegen.link.program_image import ProgramImage, make_image, take_apart
from tablegen.numerics.arrays import Ints
from tablegen.verification.play.sequencer_shape import SequencerShape

pytestmark = pytest.mark.common

SHAPES = {
    "16 bits": SequencerShape(16, 1, 5, 16, 1, 4, 16),
    "24 bits": SequencerShape(24, 1, 4, 21, 1, 3, 24),
    "8 bits": SequencerShape(8, 1, 4, 8, 1, 4, 8),
    "12 bits, wide codes": SequencerShape(12, 1, 4, 12, 1, 5, 20),
    "direct": SequencerShape(16, 0, 5, 10, 0, 5, 14),
    "cubic": SequencerShape(16, 3, 5, 14, 3, 4, 16),
    "cubic and lines": SequencerShape(18, 3, 3, 21, 1, 4, 18),
}
HARMONICS = 5
STATES = ("nothing plays", "parked", "playing")
PROGRAMS = int(os.environ.get("LINK_PROGRAMS", "400"))  # of each shape and state
CHECKED = {reason for reason in Reason if Reason.SCHEDULE <= reason <= Reason.JUMP} | {Reason.SHAPING}
ORDERS = {
    "8 bits": 1,
    "24 bits": 3,
    "direct": 2,
    "cubic": 3,
}  # of the devices that shape; those of 8 bits have too low an order


class Bench:
    """A device in some state that stays the same: what it accepts is withdrawn before it is taken."""

    def __init__(
        self,
        program: ScanProgram,
        state: str,
        limits: tuple[AxisLimits, AxisLimits],
        shape: SequencerShape,
        order: int = 0,
        **features: bool,
    ) -> None:
        boot = None if state == "nothing plays" else program
        bits = max(shape.x_index_bits, 3), max(shape.y_index_bits, 3)
        self.device = HostDevice(
            program, boot, limits=limits, index_bits=bits, harmonics=HARMONICS, shaping=order, **features
        )
        self.talk = Talk()
        self.ask(self.talk.hello())
        self.device.tick(3)
        self.playing = None
        if boot is not None:
            self.playing = Playing(program.x, program.y, state == "playing")
        if state == "playing":
            self.ask(self.talk.acting(Request.ARM, bytes(4)))
            self.ask(self.talk.acting(Request.TRIGGER))
            self.device.tick(2)

    def ask(self, wire: bytes) -> list[Frame]:
        """What is answered."""
        self.device.receive(wire)
        return self.talk.answers(self.device.transmit())

    def objection(self, image: ProgramImage) -> tuple[int, int] | None:
        """To an image; None if it waits to be taken."""
        for wire in self.talk.upload(image):
            (answer,) = self.ask(wire)
            assert answer.type != REFUSAL, Refusal.unpack(answer.payload)
        answers = self.ask(self.talk.commit(image))
        if answers:
            refusal = Refusal.unpack(answers[0].payload)
            assert refusal.type == Request.COMMIT
            return refusal.reason, refusal.detail
        assert self.ask(self.talk.acting(Request.ABORT)) == []
        self.device.tick()
        refused, aborted = self.talk.answers(self.device.transmit())
        assert Refusal.unpack(refused.payload).reason == Reason.WITHDRAWN
        assert is_answer(aborted, Request.ABORT)
        return None


@pytest.mark.parametrize("state", STATES)
@pytest.mark.parametrize("name", common(("16 bits", "24 bits", "direct", "cubic"), SHAPES))
def test_a_device_objects_to_what_its_specification_objects_to(name: str, state: str) -> None:
    assert compare(SHAPES[name], state, PROGRAMS, 1)[None] > PROGRAMS // 20


@pytest.mark.rest
@pytest.mark.parametrize("state", STATES)
@pytest.mark.parametrize("name", one_of(2, ORDERS))
def test_a_device_that_shapes_objects_to_the_same(name: str, state: str) -> None:
    seen = compare(SHAPES[name], state, PROGRAMS, 1, ORDERS[name])
    assert seen[None] > PROGRAMS // 20
    assert seen[Reason.SLEW] > 3


@pytest.mark.parametrize("first", [np.argmax, np.argmin], ids=["highest", "lowest"])
def test_the_jump_of_y_is_the_largest_there_can_be(first: Callable[[Ints], int]) -> None:
    """From the word that is furthest away, wherever in the table of the old program it stands."""
    scan = make_scan(2).program
    words = np.roll(scan.y.words, -int(first(scan.y.words)))
    program = replace(scan, y=replace(scan.y, words=words))
    codes = program.y.output.code(program.y.resting(words))
    jump = int(codes.max() - codes.min())
    assert jump > 1000
    image = make_image(program, "00" * 32)
    everything = AxisLimits(0, (1 << 16) - 1, 1 << 24, 1 << 24)
    for most, expected in ((jump, None), (jump - 1, (Reason.JUMP, 1))):
        limits = everything, replace(everything, max_jump=most)
        bench = Bench(program, "playing", limits, SequencerShape(16, 1, 7, 16, 1, 6, 16))
        assert bench.objection(image) == expected
        contents = take_apart(image.data, image.info.x, image.info.y)
        assert first_objection(contents, *limits, bench.playing) == expected


def test_each_pixel_has_a_tick_of_each_window() -> None:
    """Or the window has none: pixels and ticks about the edge, as the model judges them."""
    rng = np.random.default_rng(30)
    program = make_scan(1).program
    everything = (AxisLimits(0, (1 << 16) - 1, 1 << 24, 1 << 24),) * 2
    bench = Bench(program, "parked", everything, SequencerShape(16, 1, 7, 16, 1, 6, 16))
    ticks, seen = program.schedule.ticks, set()
    for pixels, forward, backward in pixels_near_ticks(rng, ticks, 60):
        windows = {"forward": Window(ticks - forward, forward), "backward": Window(0, backward)}
        changed = replace(program, schedule=replace(program.schedule, pixels=pixels, **windows))
        image = make_image(changed, "00" * 32)
        expected = None if has_ticks_for_pixels(pixels, forward, backward) else (Reason.SCHEDULE, 0)
        contents = take_apart(image.data, image.info.x, image.info.y)
        assert first_objection(contents, *everything, bench.playing) == expected
        assert bench.objection(image) == expected, (pixels, forward, backward)
        seen.add(expected)
    assert len(seen) == 2


def test_every_check_was_met() -> None:
    """A control of the test above: it is about programs of all kinds."""
    seen: Counter[Reason | None] = Counter()
    for shape in SHAPES.values():
        for state in STATES:
            seen += compare(shape, state, PROGRAMS, 1)
    assert {reason for reason in CHECKED if seen[reason] > 3} == CHECKED, seen


@cache
def compare(shape: SequencerShape, state: str, count: int, seed: int, order: int = 0) -> Counter[Reason | None]:
    """Hold so many programs against the specification; returns how often each reason came."""
    rng = np.random.default_rng([seed, *map(ord, state)])
    seen: Counter[Reason | None] = Counter()
    for at in range(count):
        if at % 40 == 0:
            _, program = random_image(rng, shape)
            limits = (
                random_limits(rng, program)
                if at % 80
                else (AxisLimits(0, (1 << shape.dac_bits) - 1, 1 << 24, 1 << 24),) * 2
            )
            bench = Bench(program, state, limits, shape, order)
        image, _ = random_image(rng, shape, HARMONICS, order=min(order + 1, 3) if order else 0)
        if rng.random() < 0.3:  # as what plays, so that it may be near enough
            image = make_image(program, image.info.hash.hex())
        if rng.random() < 0.85:
            image = damaged(rng, image)
        try:
            contents = take_apart(image.data, image.info.x, image.info.y)
        except ValueError:
            continue  # refused before it is complete
        expected = first_objection(contents, *limits, bench.playing, order)
        got = bench.objection(image)
        assert got == (None if expected is None else (int(expected[0]), expected[1])), (at, expected, got)
        seen[None if expected is None else expected[0]] += 1
    return seen
