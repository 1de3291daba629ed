"""program_loader against what was written by hand from docs/protocol.md, and against the model of a device."""

import json
import struct
from binascii import crc32
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from building import HELPERS
from dialogues import GOLDEN, boot_program, dialogues, hold
from link_images import resealed
from link_talk import Talk
from loader_bridge import BREAK, NO_STOP_BIT, PULSE, Simulation, assembler
from loader_device import Loader, LoaderDevice, limited, told_to_be
from loader_dialogues import Dialogue, Differs, objection
from loader_mutants import MUTANTS
from programs import pixels_near_ticks
from replacing import replace
from sets import long

from tablegen.device.registers import AXIS_WORDS, PAGE_WORDS, SCAN_WORDS
from tablegen.device.schedule import has_ticks_for_pixels
from tablegen.device.widths import AxisWidths, Widths, misfits
from tablegen.link.frames import FrameReader
from tablegen.link.messages import AxisLimits, DeviceInfo, DeviceStatus, ImageInfo, Reason, Refusal, Request, Upload
from tablegen.link.program_image import ProgramImage, take_apart

MADE = GOLDEN["devices"]["open"]
TOLD = DeviceInfo.unpack(bytes.fromhex(MADE["device"]))
FRAMES = json.loads((HELPERS / "golden_frames.json").read_text("utf-8"))
TOP = (1 << 16) - 1
CLOCKS_PER_BIT = 8
_BYTES = bytes.fromhex(MADE["boot_image"])
BOOT_IMAGE = ProgramImage(ImageInfo(bytes(32), len(_BYTES), crc32(_BYTES), TOLD.x, TOLD.y), _BYTES)
SHORTER = "Shorter tables: BEGIN"  # from there on the dialogue is for devices that take them
# Not for this device: it has no key and no limits to narrow, keeps images, checks less, and waits for no tick to act.
LACKS = ("key", "narrows", "keeps tables", "checks", "plays", "queue of 8", "shaping")


def other_word(at: int, word: int) -> ProgramImage:
    """The boot program with another program word."""
    return resealed(BOOT_IMAGE, _BYTES[: 4 * at] + word.to_bytes(4, "little") + _BYTES[4 * at + 4 :])


@pytest.fixture(scope="module")
def loader(tmp_path_factory: pytest.TempPathFactory) -> Loader:
    """Of the device of the golden dialogues."""
    return golden_loader(tmp_path_factory.mktemp("loader"))


def golden_loader(folder: Path, **parameters: int) -> Loader:
    """Compile the device of the golden dialogues, with more parameters."""
    x, y = ((limits.code_min, limits.code_max, limits.max_step) for limits in (TOLD.x_limits, TOLD.y_limits))
    return Loader(folder, boot_program(MADE), (x, y), TOLD.harmonics, TOLD.update_rate_hz, LOW_AREA=1, **parameters)


def golden(dialogue: dict[str, Any], loader: Loader, words: list[int]) -> None:
    """A whole golden dialogue, with a loader that says of itself what the dialogue wants, but for its features."""
    info = replace(TOLD, features=loader.info.features)
    notes = [step["note"] for step in dialogue["steps"]]
    if SHORTER in notes:
        dialogue = {**dialogue, "steps": dialogue["steps"][: notes.index(SHORTER)]}
    with Simulation(loader.compiled, words, told_to_be(info)) as simulation:
        hold(dialogue, LoaderDevice(simulation, info, MADE["boot"], TOLD))


@pytest.mark.rest
@pytest.mark.parametrize("dialogue", dialogues(*LACKS), ids=lambda dialogue: dialogue["name"])
def test_golden_dialogues(dialogue: dict[str, Any], loader: Loader) -> None:
    golden(dialogue, loader, [])


def random_dialogue(loader: Loader, seed: int, steps: int, words: list[int]) -> Dialogue:
    """Raises ``Differs``."""
    wide = AxisLimits(0, TOP, TOP, TOP)
    narrow = AxisLimits(3000, 60000, 9000, TOP)
    info, memory = limited(loader.info, wide if seed % 3 else narrow, wide)
    with Simulation(loader.compiled, words, memory) as simulation:
        dialogue = Dialogue(LoaderDevice(simulation, info, seed), info, loader.boot, loader.shape, seed)
        dialogue.play(steps)
    return dialogue


@pytest.mark.rest
@pytest.mark.parametrize("seed", long(range(2), range(40)))
def test_random_dialogues(seed: int, loader: Loader) -> None:
    dialogue = random_dialogue(loader, seed, 120, [])
    assert len(dialogue.seen) > 10


def checked_uploads(loader: Loader, seed: int, uploads: int, words: list[int]) -> Dialogue:
    """Whole uploads, most of them with something wrong. Raises ``Differs``."""
    rng = np.random.default_rng(seed)
    most = 3000 if seed % 4 == 3 else 1  # most programs use the whole range
    limits = [AxisLimits(int(rng.integers(0, most)), TOP - int(rng.integers(0, most)), TOP, TOP) for _ in range(2)]
    info, memory = limited(loader.info, limits[0], limits[1])
    with Simulation(loader.compiled, words, memory) as simulation:
        dialogue = Dialogue(LoaderDevice(simulation, info, seed), info, loader.boot, loader.shape, seed)
        dialogue.upload(uploads)
    return dialogue


@pytest.mark.rest
@pytest.mark.parametrize("seed", long(range(1), range(20)))
def test_every_check_is_that_of_the_model(seed: int, loader: Loader) -> None:
    seen = checked_uploads(loader, seed, 40, []).seen
    reasons = {key[1] for key in seen if isinstance(key, tuple) and key[0] == Request.COMMIT}
    assert len(reasons) >= 4


@pytest.mark.common
def test_what_passes_the_checks_fits_the_sequencer() -> None:
    """Or the sequencer would refuse it, and no check of the model would say why: words at the ends of their range."""
    info, image = TOLD, take_apart(bytes.fromhex(MADE["boot_image"]), TOLD.x, TOLD.y)
    x, y = (AxisWidths(True, shape.index_bits, shape.word_bits, 31) for shape in (info.x, info.y))
    widths = Widths(info.x.dac_bits, 24, 16, replace(x, period_bits=25), y, info.harmonics)
    wide = AxisLimits(0, TOP, TOP, TOP)
    passed, fit = 0, 0
    for at in range(len(image.words)):
        for word in sorted({(1 << bit) + d & 0xFFFFFFFF for bit in range(33) for d in (-2, -1, 0, 1)}):
            changed = replace(image, words=(*image.words[:at], word, *image.words[at + 1 :]))
            fits = not misfits(changed.words, widths)
            if at % PAGE_WORDS != AXIS_WORDS.index("harmonics") and objection(changed, wide, wide, None) is None:
                passed += 1
                assert fits, (at, word)
            fit += fits
    assert fit > passed > 1000


def exact_limits(loader: Loader, words: list[int]) -> None:
    """Programs at the limits are taken, and one beyond them refused."""
    image = take_apart(bytes.fromhex(MADE["boot_image"]), TOLD.x, TOLD.y)
    for page, axis in ((1, 0), (2, 1)):
        code_min, code_max, max_step = (image.axis(page, name) for name in ("code_min", "code_max", "max_step"))
        for low, high, step, reason in (
            (code_min, code_max, max_step, None),
            (code_min + 1, code_max, max_step, Reason.CODES),
            (code_min, code_max - 1, max_step, Reason.CODES),
            (code_min, code_max, max_step - 1, Reason.STEP),
        ):
            own, other = AxisLimits(low, high, step, TOP), AxisLimits(0, TOP, TOP, TOP)
            _, memory = limited(loader.info, *((own, other) if axis == 0 else (other, own)))
            with Simulation(loader.compiled, words, memory) as simulation:
                talk = Talk()
                device = LoaderDevice(simulation, loader.info, 1)
                device.tick(50)
                simulation.talk(talk.hello())
                wire = upload(simulation, talk)
                simulation.ticks(20)
                answer = talk.answers(wire + simulation.talk())[-1]
                expected = struct.pack("<II", 2, 0) if reason is None else Refusal(Request.COMMIT, reason, axis).pack()
                assert answer.payload == expected


@pytest.mark.rest
def test_limits_are_exact(loader: Loader) -> None:
    exact_limits(loader, [])


def settle_lines(loader: Loader, words: list[int]) -> None:
    """As many as the sequencer counts, and not one more."""
    with Simulation(loader.compiled, words) as simulation:
        talk = Talk()
        LoaderDevice(simulation, loader.info, 1).tick(50)
        simulation.talk(talk.hello())
        for lines, expected in ((256, (Reason.SCHEDULE, 0)), (255, None), (0xFFFFFFFF, (Reason.SCHEDULE, 0))):
            wire = upload(simulation, talk, other_word(SCAN_WORDS.index("settle_lines"), lines))
            simulation.ticks(20)
            answer = talk.answers(wire + simulation.talk())[-1]
            refusal = Refusal.unpack(answer.payload)
            assert (answer.type == 0xFF and (refusal.reason, refusal.detail)) == (expected or False), lines


def crowded_windows(loader: Loader, words: list[int]) -> None:
    """Pixels and ticks of windows about the edge: a pixel has a tick, or the window has none."""
    rng = np.random.default_rng(30)
    ticks, *_ = struct.unpack_from("<I", _BYTES)
    names = ("pixels", "forward_count", "backward_count")
    seen = set()
    with Simulation(loader.compiled, words) as simulation:
        talk = Talk()
        LoaderDevice(simulation, loader.info, 1).tick(50)
        simulation.talk(talk.hello())
        for numbers in pixels_near_ticks(rng, ticks, 24):
            data = bytearray(_BYTES)
            for name, word in (*zip(names, numbers, strict=True), ("forward_first", 0), ("backward_first", 0)):
                struct.pack_into("<I", data, 4 * SCAN_WORDS.index(name), word)
            fits = has_ticks_for_pixels(*numbers)
            wire = upload(simulation, talk, resealed(BOOT_IMAGE, bytes(data)))
            simulation.ticks(20)
            refusals = talk.refusals(wire + simulation.talk())
            assert refusals == ([] if fits else [(Reason.SCHEDULE, 0)]), numbers
            seen.add(fits)
    assert len(seen) == 2


def refused_by_the_sequencer(loader: Loader, words: list[int]) -> None:
    """What passes the checks of a loader that is wrong about its sequencer: the host is told, and the next is taken."""
    too_far = AxisLimits(0, TOP, 1 << 20, TOP)
    _, memory = limited(loader.info, too_far, too_far)
    wide = other_word(2 * PAGE_WORDS + AXIS_WORDS.index("max_step"), 1 << 16)  # in 16 bits it would be 0
    with Simulation(loader.compiled, words, memory) as simulation:
        talk = Talk()
        LoaderDevice(simulation, loader.info, 1).tick(50)
        simulation.talk(talk.hello())

        def commit(image: ProgramImage, *then: int) -> list[tuple[int, int]]:
            """The refusals of a COMMIT, and of requests while its program waits."""
            wire = upload(simulation, talk, image)
            for kind in then:
                wire += simulation.talk(talk.acting(kind))
            simulation.ticks(20)
            return talk.refusals(wire + simulation.talk())

        assert commit(wide) == [(Reason.REFUSED, 0)]
        assert commit(wide) == [(Reason.REFUSED, 0)]
        (answer,) = talk.answers(simulation.talk(talk.request(Request.STATUS)))
        status = DeviceStatus.unpack(answer.payload)
        assert (status.upload, status.generation, status.received) == (Upload.NONE, 1, 0)
        assert commit(BOOT_IMAGE, Request.ABORT) == [(Reason.WITHDRAWN, 0)]
        assert commit(BOOT_IMAGE) == []
        (answer,) = talk.answers(simulation.talk(talk.request(Request.STATUS)))
        assert DeviceStatus.unpack(answer.payload).generation == 2


@pytest.mark.rest
@pytest.mark.parametrize("what", [settle_lines, crowded_windows, refused_by_the_sequencer])
def test_what_does_not_fit_is_refused_with_a_reason(what: Callable[[Loader, list[int]], None], loader: Loader) -> None:
    what(loader, [])


@pytest.mark.rest
@pytest.mark.parametrize("order", [0, 2])
def test_shaped_output_goes_by_the_order_of_the_sequencer(order: int, loader: Loader, tmp_path: Path) -> None:
    """HELLO says the order; a program of a higher one, or with another word, is refused by the sequencer."""
    if order != loader.info.shaping:
        loader = golden_loader(tmp_path, SHAPING=order)
    with Simulation(loader.compiled, []) as simulation:
        talk = Talk()
        LoaderDevice(simulation, loader.info, 1).tick(50)
        (hello,) = talk.answers(simulation.talk(talk.hello()))
        assert DeviceInfo.unpack(hello.payload).shaping == order
        for word in (0, 1, 2, 3, 4, 0x0102, 0x8003):
            image = other_word(2 * PAGE_WORDS + AXIS_WORDS.index("shaping"), word)
            wire = upload(simulation, talk, image)
            simulation.ticks(20)
            good = word <= order
            assert talk.refusals(wire + simulation.talk()) == ([] if good else [(Reason.REFUSED, 0)]), word


# Frames


def bad_frames(simulation: Simulation) -> int:
    """What STATUS counts; ends whatever has been begun."""
    talk = Talk()
    answers = talk.answers(simulation.talk(b"\0" + talk.hello() + talk.request(Request.STATUS)))
    assert talk.reader.bad_frames == 0
    return DeviceStatus.unpack(answers[-1].payload).bad_frames


@pytest.mark.rest
def test_golden_frames(loader: Loader) -> None:
    golden_frames(loader, [])


def golden_frames(loader: Loader, words: list[int]) -> None:
    """Every frame of the file."""
    with Simulation(loader.compiled, words) as simulation:
        for frame in FRAMES["good"]:
            answers = FrameReader().feed(simulation.talk(bytes.fromhex(frame["wire"])))
            assert len(answers) == (0 if frame["type"] & 0x80 else 1), frame["name"]
            for answer in answers:
                assert (answer.seq, answer.session) == (frame["seq"], frame["session"]), frame["name"]
        assert bad_frames(simulation) == 0
        for count, frame in enumerate(FRAMES["bad"], 1):
            assert simulation.talk(bytes.fromhex(frame["wire"])) == b"", frame["name"]
            assert bad_frames(simulation) == count, frame["name"]
        status = bytearray.fromhex(FRAMES["good"][1]["wire"])
        status[0] += 1  # its only distance: past the end, though all the bytes are there
        assert simulation.talk(status) == b""
        for frame in FRAMES["empty"]:
            assert simulation.talk(bytes.fromhex(frame["wire"])) == b""
        assert bad_frames(simulation) == len(FRAMES["bad"]) + 1


def upload(
    simulation: Simulation,
    talk: Talk,
    image: ProgramImage = BOOT_IMAGE,
    before_commit: Callable[[], None] = lambda: None,
) -> bytes:
    """The answer to COMMIT."""
    for wire in talk.upload(image):
        simulation.talk(wire)
    before_commit()
    return simulation.talk(talk.commit(image))


# The line


@pytest.mark.rest
def test_a_baud_rate_may_be_off_by_three_per_cent(loader: Loader) -> None:
    talk = Talk()
    with Simulation(loader.compiled) as simulation:
        for per_cent in (-3, 3):
            # at 8 clocks a bit the grid of the clock itself takes a part of the margin
            simulation.set(bit_time=round(16 * CLOCKS_PER_BIT * (1 + per_cent / 100)))
            for _ in range(3):
                (answer,) = talk.answers(simulation.talk(talk.hello()))
                assert answer.type == Request.HELLO | 0x80
        simulation.set(bit_time=round(16 * CLOCKS_PER_BIT * 1.1))
        assert simulation.talk(talk.hello()) == b"", "negative control: 10 % are too much"


@pytest.mark.rest
def test_what_is_no_byte_spoils_at_most_a_frame(loader: Loader) -> None:
    talk = Talk()
    with Simulation(loader.compiled) as simulation:
        status = [0, *talk.hello(), *talk.request(Request.STATUS)]
        simulation.talk(status)
        for noise in ([PULSE], [BREAK], [BREAK, BREAK], [NO_STOP_BIT | 0x55], [0x55, PULSE, 0], [1, 2, 3]):
            answers = talk.answers(simulation.talk([*noise, *status]))
            assert [answer.type for answer in answers] == [Request.HELLO | 0x80, Request.STATUS | 0x80], noise
        inside = [status[0], status[1], NO_STOP_BIT | status[2], *status[3:]]
        assert [answer.type for answer in talk.answers(simulation.talk(inside))] == [Request.STATUS | 0x80]


@pytest.mark.rest
def test_a_backlog_of_requests_is_answered(loader: Loader) -> None:
    """As many bytes as the ring holds, while the loader is still answering."""
    talk = Talk()
    with Simulation(loader.compiled) as simulation:
        simulation.talk(talk.hello())
        answers = talk.answers(simulation.talk(talk.hello() + talk.request(Request.STATUS) * 5))
        assert len(answers) == 6


@pytest.mark.rest
def test_the_bench_loses_no_byte_between_two_commands(loader: Loader) -> None:
    """An answer is whole where commands of 7 clocks cut it at every place of a bit."""
    talk = Talk()
    with Simulation(loader.compiled) as simulation:
        whole = simulation.talk(talk.hello())
        byte = 10 * CLOCKS_PER_BIT
        received = simulation.run(len(talk.hello()) * byte + 1, talk.hello())
        for _ in range(2 * len(whole) * byte // 7):
            received += simulation.run(7)
        assert received == whole


@pytest.mark.rest
def test_a_reset_forgets_session_and_upload_but_not_what_plays(loader: Loader) -> None:
    talk = Talk()
    with Simulation(loader.compiled) as simulation:
        device = LoaderDevice(simulation, loader.info, 1)
        device.tick(50)
        before = DeviceStatus.unpack(talk.answers(simulation.talk(talk.hello()))[0].payload[56:])
        simulation.talk([5, 1, 2])
        simulation.set(reset=1)
        simulation.run(3)
        simulation.set(reset=0)
        simulation.run(200)
        (refusal,) = talk.answers(simulation.talk(talk.request(Request.STATUS)))
        assert refusal.payload[1] == 4
        assert DeviceStatus.unpack(talk.answers(simulation.talk(talk.hello()))[0].payload[56:]) == before


# Negative controls

FINDERS: dict[str, Callable[[Loader, list[int]], object]] = {
    "random": lambda loader, words: [random_dialogue(loader, seed, 120, words) for seed in range(5)],
    "frames": golden_frames,
    "limits": exact_limits,
    "settle lines": settle_lines,
    "pixels": crowded_windows,
    "refused": refused_by_the_sequencer,
    "uploads": lambda loader, words: [checked_uploads(loader, seed, 40, words) for seed in range(8)],
    **{
        dialogue["name"]: lambda loader, words, dialogue=dialogue: golden(dialogue, loader, words)  # type: ignore[misc]
        for dialogue in dialogues(*LACKS)
    },
}


# One for each way of finding it, of those that are found soon.
FOUND_SOON = {
    "the CRC of a frame is not checked",
    "a distance past the end is not seen",
    "code_min may be one less",
    "settle_lines may be 256",
    "pixels of the retrace are not checked",
    "the sequencer's refusal is not told",
    "a word may have more bits",
    "the offset is ignored",
    "a request that comes again acts again",
    "an image may be too long",
    "any session will do",
    "the interlock is ignored",
}
BY_NAME = {mutant.breaks: mutant for mutant in MUTANTS}
assert {BY_NAME[name].by for name in FOUND_SOON} == {mutant.by for mutant in MUTANTS}


@pytest.mark.rest
@pytest.mark.parametrize("name", long(FOUND_SOON, BY_NAME))
def test_a_program_with_a_fault_is_found(name: str, loader: Loader) -> None:
    mutant = BY_NAME[name]
    words = mutant.words()
    with pytest.raises((AssertionError, Differs)):
        FINDERS[mutant.by](loader, words)


@pytest.mark.rest
def test_no_processor_commits_against_the_interlock(loader: Loader) -> None:
    """Even one that does not ask."""
    (mutant,) = (mutant for mutant in MUTANTS if mutant.breaks == "the interlock is ignored")
    talk = Talk()
    with Simulation(loader.compiled, mutant.words()) as simulation:
        device = LoaderDevice(simulation, loader.info, 1)
        device.tick(50)
        (hello,) = talk.answers(simulation.talk(talk.hello()))
        upload(simulation, talk, before_commit=lambda: setattr(device, "permits", False))
        device.tick(200)
        (status,) = talk.answers(simulation.talk(talk.request(Request.STATUS)))
        assert DeviceStatus.unpack(status.payload).generation == DeviceStatus.unpack(hello.payload[56:]).generation == 1


# The program


def test_the_module_is_what_its_sources_make() -> None:
    """Run ``python firmware_templates/loader/assembler.py --write`` after a change."""
    assert assembler.MODULE.read_text("ascii") == assembler.assemble()


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("ld1 nowhere", "what is nowhere"),
        ("jump 3", "what is jump 3"),
        ("ld #256", "beyond"),
        ("st4 0xe0", "not there"),
        ("ld4 0x31", "not there"),
        ("a: ret\na: ret", "twice"),
        (".at 1\n.var b 4", "crosses"),
        (".at 0xdf\n.var b 2\n", "crosses"),
    ],
)
def test_the_assembler_refuses(text: str, why: str) -> None:
    with pytest.raises(assembler.Wrong, match=why):
        assembler.read({"a.s": text}).words()


def test_calls_that_are_too_deep_are_seen() -> None:
    text = "\n".join(f"f{i}: call f{i + 1}\nret" for i in range(5)) + "\nf5: ret"
    assert assembler.depth(assembler.read({"a.s": text})) == 5
