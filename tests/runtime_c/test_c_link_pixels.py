"""Tables of pixels over the C link: its checks against their specification, dialogues, what an upload plays."""

import faulthandler
import os
import subprocess
import sys
from collections import Counter
from functools import cache
from multiprocessing import get_context
from pathlib import Path

import link_device
import numpy as np
import pytest
from building import run_clean
from limits import limit
from line_log import LineCheck, PlayedLine
from link_device import SANITIZED, TABLE_PIXELS, CompiledProgram, DeviceLibrary, HostDevice, Started, compile_device
from link_images import damaged, digest, random_image, resealed
from link_programs import make_scan
from link_random import KEY, Dialogue
from link_talk import Talk
from pixel_tables import PIXELS, damaged_table, long_windows, table_image
from programs import with_table
from replacing import replace
from sets import one_of
from test_c_link_acceptance import Bench

from tablegen.base.resources import c_link, c_runtime, c_store
from tablegen.device.dual_program import ScanProgram
from tablegen.device.registers import PIXEL_TABLE_WORD
from tablegen.link.acceptance import first_objection
from tablegen.link.messages import REFUSAL, AxisLimits, Reason, Refusal, Request
from tablegen.link.program_image import ProgramImage, make_image, take_apart
from tablegen.verification.play.sequencer_shape import SequencerShape

pytestmark = pytest.mark.common

SHAPE = SequencerShape(16, 1, 5, 16, 1, 4, 16)
EVERYTHING = (AxisLimits(0, (1 << 16) - 1, 1 << 24, 1 << 24),) * 2
PROGRAMS = int(os.environ.get("PIXEL_LINK_PROGRAMS", "150"))


def some_image(rng: np.random.Generator) -> tuple[ProgramImage, ScanProgram]:
    """An image with a table of pixels for which every device here has room, and its program without one."""
    while True:
        _, program = random_image(rng, SHAPE)
        program = replace(program, schedule=long_windows(rng, program.schedule.ticks, program.schedule.lines))
        image = table_image(rng, program)
        if int.from_bytes(image.data[4 * PIXELS : 4 * PIXELS + 4], "little") <= TABLE_PIXELS:
            return image, program


@cache
def compare(count: int, seed: int) -> Counter[tuple[Reason, int] | None]:
    """Hold so many programs against the specification; returns how often each reason came, by trace and retrace."""
    rng = np.random.default_rng(seed)
    seen: Counter[tuple[Reason, int] | None] = Counter()
    _, program = some_image(rng)
    bench = Bench(program, "parked", EVERYTHING, SHAPE, pixels=True)
    for at in range(count):
        image, _ = some_image(rng)
        if rng.random() < 0.8:
            image = damaged_table(rng, image)
        if rng.random() < 0.1:
            image = damaged(rng, image)
        try:
            contents = take_apart(image.data, image.info.x, image.info.y)
        except ValueError:
            continue  # refused before it is complete
        expected = first_objection(contents, *EVERYTHING, bench.playing)
        got = bench.objection(image)
        assert got == (None if expected is None else (int(expected[0]), expected[1])), (at, expected, got)
        seen[None if expected is None else (expected[0], expected[1] & 1)] += 1
    return seen


def test_a_device_objects_to_what_its_specification_objects_to() -> None:
    seen = compare(PROGRAMS, 1)
    assert min(seen[None], seen[Reason.PIXEL_TICKS, 0], seen[Reason.PIXEL_TICKS, 1]) > PROGRAMS // 20, seen


def test_hostile_tables_are_refused_where_their_fault_is() -> None:
    """The detail is the window and the pixel; that behind the last where ticks are left."""
    rng = np.random.default_rng(2)
    program = make_scan(2, ticks=96).program
    tables = (1, 2, 3, 26), (20, 10, 1, 1)
    schedule = replace(program.schedule, pixels=4, pixel_table=tables)
    image = make_image(replace(program, schedule=schedule), digest(rng))
    bench = Bench(program, "playing", EVERYTHING, SequencerShape(16, 1, 7, 16, 1, 6, 16), pixels=True)
    assert bench.objection(image) is None
    for pixel, ticks, detail in (
        (0, 0, 0), (3, 0, 6), (3, 27, 6), (3, 25, 8), (0, 65535, 0), (2, 4, 6),
        (4, 0, 1), (7, 0, 7), (7, 2, 7), (4, 19, 9), (4, 33, 1), (5, 65535, 3),
    ):  # fmt: skip
        at = len(image.data) - 2 * 8 + 2 * pixel
        data = bytearray(image.data)
        data[at : at + 2] = ticks.to_bytes(2, "little")
        changed = resealed(image, bytes(data))
        contents = take_apart(changed.data, image.info.x, image.info.y)
        assert first_objection(contents, *EVERYTHING, bench.playing) == (Reason.PIXEL_TICKS, detail), (pixel, ticks)
        assert bench.objection(changed) == (Reason.PIXEL_TICKS, detail), (pixel, ticks)


def test_a_table_without_room_is_refused_with_its_program_words() -> None:
    """Of no pixel, of too many, and of another number than 1."""
    image, plain, program = image_and_plain()
    for pixels, word, expected in (
        (None, 1, None),
        (0, 1, (Reason.SHAPE, 0)),
        (TABLE_PIXELS + 1, 1, (Reason.SHAPE, 0)),
        (1 << 30, 1, (Reason.SHAPE, 0)),
        (None, 2, (Reason.SHAPE, 0)),
        (None, 1 << 31, (Reason.SHAPE, 0)),
        (None, 0, (Reason.LENGTH, len(plain))),
    ):
        data = bytearray(image.data)
        if pixels is not None:
            data[4 * PIXELS : 4 * PIXELS + 4] = pixels.to_bytes(4, "little")
        data[4 * PIXEL_TABLE_WORD : 4 * PIXEL_TABLE_WORD + 4] = word.to_bytes(4, "little")
        assert first_refusal(HostDevice(program, program, pixels=True), resealed(image, bytes(data))) == expected


def test_a_device_without_memory_for_tables_ignores_the_word() -> None:
    image, plain, program = image_and_plain()
    assert first_refusal(HostDevice(program, program), image) == (Reason.LENGTH, len(plain))


def image_and_plain() -> tuple[ProgramImage, bytes, ScanProgram]:
    """An image with a table of pixels, the bytes of one without, and the program without."""
    rng = np.random.default_rng(3)
    image, program = some_image(rng)
    return image, make_image(program, digest(rng)).data, program


def first_refusal(device: HostDevice, image: ProgramImage) -> tuple[int, int] | None:
    """Send an image up to its program words; return reason and detail of the first DATA that is refused."""
    talk = Talk()
    device.tick(3)
    for wire in [talk.hello(), *talk.upload(image)][:3]:
        device.receive(wire)
    refusals = [Refusal.unpack(each.payload) for each in talk.answers(device.transmit()) if each.type == REFUSAL]
    assert all(each.type == Request.DATA for each in refusals)
    return (refusals[0].reason, refusals[0].detail) if refusals else None


def test_an_uploaded_table_plays() -> None:
    """Every line of two frames, markers and all, is that of the model with the table, after others without."""
    rng = np.random.default_rng(5)
    boot = make_scan(3).program
    program = make_scan(4).program
    counts = [np.diff([0, 1, 4, 8, 9, 20, 31, 32]).tolist() for _ in range(2)]
    table = tuple(counts[0]), tuple(counts[1][::-1])
    program = replace(program, schedule=replace(program.schedule, pixels=7, pixel_table=table))
    device, talk, check = HostDevice(program, boot, pixels=True), Talk(), LineCheck(boot)
    check.offer("upload", program)
    image = make_image(program, digest(rng))
    for wire in (talk.hello(), talk.acting(Request.ARM, bytes(4)), talk.acting(Request.TRIGGER)):
        device.receive(wire)
        device.tick(50)
    for wire in (*talk.upload(image), talk.commit(image)):
        device.receive(wire)
    device.tick(3 * program.schedule.ticks * program.schedule.lines)
    check.follow(PlayedLine(**line._asdict()) for line in device.lines())
    assert check.taken[2] == "upload"
    assert check.lines > 2 * program.schedule.lines
    answers = talk.answers(device.transmit())
    assert not [answer for answer in answers if answer.type == REFUSAL]
    read = b""
    while len(read) < len(image.data):
        device.receive(talk.request(Request.READBACK, len(read).to_bytes(4, "little") + b"\x65"))
        (answer,) = talk.answers(device.transmit())
        assert answer.payload[4:]
        read += answer.payload[4:]
    assert read == image.data


def test_a_compiled_table_plays_from_the_library(tmp_path: Path) -> None:
    """It goes the way of an upload; one with more pixels than the link has memory for is refused."""
    options = [f"-D{name}=1" for name in ("DAC_STORE", "DAC_LIBRARY", "DAC_PIXEL_TABLE")]
    path = compile_device(tmp_path / "device.so", sources=[*c_runtime(), *c_link(), *c_store()], more=options)
    rng = np.random.default_rng(6)
    boot, plain = make_scan(1).program, make_scan(2).program
    counts = tuple(np.full(8, 4).tolist()), (1, 1, 1, 1, 7, 7, 7, 7)
    sine = replace(plain, schedule=replace(plain.schedule, pixels=8, pixel_table=counts))
    many = replace(plain, schedule=with_table(rng, plain.schedule))
    while many.schedule.pixels <= TABLE_PIXELS:
        many = replace(plain, schedule=with_table(rng, plain.schedule))
    entries = [
        CompiledProgram(name, bytes(f"{at:064x}", "ascii"), each)
        for at, (name, each) in enumerate(((b"sine", sine), (b"many", many)))
    ]
    device, talk, check = HostDevice(sine, boot, library=DeviceLibrary(path), compiled=entries), Talk(), LineCheck(boot)
    check.offer("sine", sine)
    device.tick(3)
    assert not device.play(1)
    assert device.play(0)
    for wire in (talk.hello(), talk.acting(Request.ARM, bytes(4)), talk.acting(Request.TRIGGER)):
        device.tick(3)
        device.receive(wire)
    device.tick(2 * sine.schedule.ticks * sine.schedule.lines)
    check.follow(PlayedLine(**line._asdict()) for line in device.lines())
    assert check.taken[2] == "sine"


@pytest.mark.rest
@pytest.mark.parametrize("key", [b"", KEY], ids=["open", "keyed"])
def test_a_random_dialogue_is_that_of_the_model(key: bytes) -> None:
    seen: Counter[object] = Counter()
    for seed in range(10):
        dialogue = Dialogue(SHAPE, seed, key, pixels=True, modes=True)
        dialogue.play(200)
        seen += dialogue.seen
    assert seen[Request.COMMIT, Reason.PIXEL_TICKS] > 1, seen
    assert seen[Request.DATA, Reason.SHAPE] > 3, seen


@pytest.mark.rest
def test_tables_of_pixels_are_kept_and_moved() -> None:
    for seed in range(2):
        Dialogue(SHAPE, seed, store=True, pixels=True, moves=seed % 2 == 1).play(250)


@pytest.mark.rest
def test_a_table_of_pixels_stands_beside_slow_parts_and_shaped_output() -> None:
    seen: Counter[object] = Counter()
    for seed in range(3):
        for features in ({"slow": True}, {"order": 3}):
            dialogue = Dialogue(SHAPE, seed, pixels=True, **features)  # type: ignore[arg-type]
            dialogue.play(150)
            seen += dialogue.seen
    assert seen[Request.COMMIT] > 10, seen


def test_a_configuration_with_one_fault_is_refused() -> None:
    scan = make_scan(1, index_bits=(5, 5))
    device = HostDevice(scan.program, scan.program, key=KEY, pixels=True)
    faults = [device.refusal(fault) for fault in range(63, 67)]
    assert faults == [*[Started.BAD_PIXEL_TABLE] * 3, Started.STARTED]


@pytest.mark.rest
def test_checks_and_dialogues_with_sanitizers(tmp_path: Path) -> None:
    """Memory of a table of pixels has just the words that the configuration says."""
    device = compile_device(tmp_path / "device.so", options=SANITIZED, more=["-DDAC_PIXEL_TABLE=1"])
    runtime = run_clean(["gcc", "-print-file-name=libasan.so"]).strip()
    environment = {
        **os.environ, "LD_PRELOAD": runtime, "ASAN_OPTIONS": "detect_leaks=0", "PYTHONMALLOC": "malloc",
        "PYTHONPATH": os.pathsep.join(sys.path),
    }  # fmt: skip
    command = [sys.executable, "-c", f"import test_c_link_pixels as t; t.ask_all(t.Path({str(device)!r}))"]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]


CHECK, IMAGE, REQUESTS = "dac_link_check.c", "dac_link_image.c", "dac_link_requests.c"
THIS, OTHER = "l->config->pixel_ticks[{}]", "l->config->pixel_ticks[1u - {}]"
TABLE, PLAYING = "dac_link_tables(l)", "l->playing"
HAS = "dac_link_pixel_word(l, image) != 0"
MUTANTS = {
    "a pixel may have no tick": (CHECK, "ticks[c->at] == 0 || ", ""),
    "pixels may go beyond their window": (CHECK, " || ticks[c->at] > count - c->sum", ""),
    "ticks may be left": (CHECK, "return *done && c->sum != count ?", "return false ?"),
    "the retrace has the window of the trace": (CHECK, "(window == 0 ? DAC_LINK_FORWARD", "(true ? DAC_LINK_FORWARD"),
    "the retrace is not looked at": (CHECK, "pixel_ticks[l->idle] + window * pixels", "pixel_ticks[l->idle]"),
    "the table that plays is looked at": (CHECK, THIS.format("l->idle"), OTHER.format("l->idle")),
    "any number of pixels has room": (IMAGE, " && pixels <= l->config->table_pixels", ""),
    "a table may have no pixels": (IMAGE, "pixels >= 1 && ", ""),
    "any word means a table": (IMAGE, "(word == 1 && pixels", "(pixels"),
    "the program plays without its table": (IMAGE, f"{HAS} ? {THIS.format(TABLE)}", f"{HAS} ? NULL"),
    "the program plays the other table": (IMAGE, THIS.format(TABLE), OTHER.format(TABLE)),
    "the other table is read back": (IMAGE, THIS.format(PLAYING), OTHER.format(PLAYING)),
    "a readback ends before the table": (IMAGE, "y[DAC_LINK_PARTS] = pixels_of(l, image);", "y[1].words = 0;"),
    "images may not be longer": (IMAGE, "UINT32_C(4) * config->table_pixels", "0 * config->table_pixels"),
    "HELLO does not say it": (REQUESTS, "    further |= PLAYS_PIXEL_TABLES;\n", ""),
    "HELLO says too few pixels": (REQUESTS, "(uint8_t)c->table_pixels;", "(uint8_t)(c->table_pixels / 2);"),
    "HELLO has slow parts": (REQUESTS, "at[4] = at[5] = 0;", "at[4] = at[5] = 1;"),
}
_FORK = get_context("fork")


def ask_all(path: Path) -> None:
    """Ask a compiled device for its opinion of programs, and talk with it; raise where it differs."""
    library = DeviceLibrary(path)
    link_device.device_library = lambda *_: library  # type: ignore[assignment]
    test_hostile_tables_are_refused_where_their_fault_is()
    test_a_table_without_room_is_refused_with_its_program_words()
    test_an_uploaded_table_plays()
    Dialogue(SHAPE, 1, pixels=True).play(100)


def differs(path: Path) -> bool:
    """Return True if a device differs from its specification, or crashes; it is asked in a process of its own."""

    def trial() -> None:
        limit(120)
        faulthandler.disable()
        try:
            ask_all(path)
        except Exception:
            os._exit(1)
        os._exit(0)

    process = _FORK.Process(target=trial)
    process.start()
    process.join()
    return process.exitcode != 0


def device_with(mutant: tuple[str, str, str] | None, folder: Path) -> Path:
    """Compile a device with another text in one of its files."""
    sources = []
    for path in (*c_runtime(), *c_link()):
        text = path.read_text("utf-8")
        if mutant is not None and path.name == mutant[0]:
            assert text.count(mutant[1]) == 1, mutant
            text = text.replace(mutant[1], mutant[2])
        (folder / path.name).write_text(text, "utf-8")
        sources.append(folder / path.name)
    options = ("-std=c99", "-O1", "-w")
    return compile_device(folder / "device.so", options=options, sources=sources, more=["-DDAC_PIXEL_TABLE=1"])


def test_every_mutant_is_of_the_link_as_it_is() -> None:
    texts = {path.name: path.read_text("utf-8") for path in c_link()}
    assert {breaks for breaks, (file, old, _) in MUTANTS.items() if texts[file].count(old) != 1} == set()


@pytest.mark.rest
@pytest.mark.parametrize("breaks", one_of(4, MUTANTS))
def test_every_mutant_is_found(breaks: str, tmp_path: Path) -> None:
    assert differs(device_with(MUTANTS[breaks], tmp_path))


@pytest.mark.rest
def test_the_link_as_it_is_does_not_differ(tmp_path: Path) -> None:
    assert not differs(device_with(None, tmp_path))
