"""Programs with slow parts over the C link: its checks against their specification, and dialogues against the model."""

import faulthandler
import os
import struct
import subprocess
import sys
from collections import Counter
from ctypes import byref, c_char, c_char_p
from functools import cache
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import link_device
import numpy as np
import pytest
from building import run_clean
from client_rig import Served
from editing import run
from frame_programs import common_knots, scan_program
from kept_dialogues import LAYOUT, new_flash
from limits import PATIENCE_S, limit
from line_log import LineCheck, PlayedLine
from link_device import SANITIZED, CompiledProgram, DeviceLibrary, HostDevice, Started, compile_device, widest
from link_images import damaged_slow, digest, random_limits, random_slow_program, resealed
from link_programs import make_scan
from link_random import KEY, Dialogue
from link_talk import Talk
from programs import random_schedule
from replacing import replace
from sets import long, one_of
from test_c_link_acceptance import Bench
from test_c_link_plays import asked
from turned_scans import turned_setup

from tablegen.api.turned import build_turned
from tablegen.base.resources import c_link, c_runtime
from tablegen.device.dual_program import AxisProgram, ScanProgram
from tablegen.device.registers import OFFSET_LOW_BITS, PAGE_WORDS, SCAN_WORDS
from tablegen.fixedpoint.frame_program import MOST_KNOTS, FrameProgram, Knots
from tablegen.link.acceptance import first_objection
from tablegen.link.device import Device
from tablegen.link.messages import AxisLimits, DeviceState, DeviceStatus, Reason, Refusal, Request
from tablegen.link.prepare import PreparedScan
from tablegen.link.program_image import fast_of, make_image, take_apart
from tablegen.verification.play.sequencer_shape import SequencerShape

pytestmark = pytest.mark.common

SHAPES = {
    "cubic": SequencerShape(16, 3, 5, 16, 3, 4, 16),
    "lines": SequencerShape(16, 1, 5, 16, 1, 3, 14),
    "21 bits": SequencerShape(18, 3, 3, 21, 1, 4, 18),
}
SLOW = "-DDAC_SLOW_PART=1"
STATES = ("nothing plays", "parked", "playing")
ORDERS = {"cubic": 0, "lines": 3, "21 bits": 1}  # of shaping, of the device and of its programs
PROGRAMS = int(os.environ.get("SLOW_LINK_PROGRAMS", "120"))  # of each shape and state
CHECKED = {reason for reason in Reason if Reason.SCHEDULE <= reason <= Reason.JUMP} - {Reason.FOURIER}


@cache
def compare(name: str, state: str, count: int, seed: int) -> Counter[Reason | None]:
    """Hold so many programs against the specification; returns how often each reason came."""
    rng, shape = np.random.default_rng([seed, *map(ord, state)]), SHAPES[name]
    seen: Counter[Reason | None] = Counter()
    everything = AxisLimits(0, (1 << shape.dac_bits) - 1, 1 << 24, 1 << 24)
    bench, limits = None, (everything, everything)
    for at in range(count):
        if at % 20 == 0:
            bench = None
        program = random_slow_program(rng, shape, ORDERS[name])
        image = make_image(program, digest(rng))
        contents = take_apart(image.data, image.info.x, image.info.y)
        if bench is None:
            if first_objection(contents, everything, everything, None, ORDERS[name]) is not None:
                continue
            limits = everything, everything
            if rng.random() < 0.2:
                limits = random_limits(rng, program)
            elif rng.random() < 0.5:
                x, y = (replace(everything, max_step=axis.output.max_step) for axis in (program.x, program.y))
                limits = replace(x, max_jump=x.code_max // 16), replace(y, max_jump=y.code_max // 4)
            bench = Bench(program, state, limits, shape, ORDERS[name], slow=True)
        if rng.random() < 0.4:
            image = damaged_slow(rng, image)
            contents = take_apart(image.data, image.info.x, image.info.y)
        expected = first_objection(contents, *limits, bench.playing, ORDERS[name])
        got = bench.objection(image)
        assert got == (None if expected is None else (int(expected[0]), expected[1])), (at, expected, got)
        seen[None if expected is None else expected[0]] += 1
    return seen


@pytest.mark.parametrize("state", STATES)
@pytest.mark.parametrize("name", SHAPES)
def test_a_device_objects_to_what_its_specification_objects_to(name: str, state: str) -> None:
    assert compare(name, state, PROGRAMS, 1)[None] > PROGRAMS // 20


def test_rare_words_are_refused() -> None:
    """A y that steps once a line, an offset that the words of the slow table carry too far, and an order too high."""
    rng, shape = np.random.default_rng(4), SHAPES["cubic"]
    schedule = replace(random_schedule(rng, 40, 1), lines=5)
    program = common_knots(rng, scan_program(rng, shape, schedule, "xy"))
    widest = (AxisLimits(0, (1 << 16) - 1, 1 << 24, 1 << 24),) * 2
    bench = Bench(program, "nothing plays", widest, shape, order=1, slow=True)
    image = make_image(program, digest(rng))
    low, high = (1 << OFFSET_LOW_BITS) - 1, (2 << (16 + program.x.output.gain_q) >> OFFSET_LOW_BITS) - 1
    for words, reason in (
        ({SCAN_WORDS.index("y_steps"): 1}, Reason.PERIOD),
        ({PAGE_WORDS + 11: 2}, Reason.SHAPING),
        ({PAGE_WORDS + 3: 1, PAGE_WORDS + 4: low, PAGE_WORDS + 5: high}, Reason.WORD),
    ):
        data = bytearray(image.data)
        for at, word in words.items():
            data[4 * at : 4 * at + 4] = word.to_bytes(4, "little")
        changed = resealed(image, bytes(data))
        expected = first_objection(take_apart(changed.data, image.info.x, image.info.y), *widest, None, 1)
        assert expected is not None
        assert expected[0] == reason
        assert bench.objection(changed) == (int(expected[0]), expected[1])


def test_every_check_was_met() -> None:
    """A control of the test above."""
    seen: Counter[Reason | None] = Counter()
    for name in SHAPES:
        for state in STATES:
            seen += compare(name, state, PROGRAMS, 1)
    assert {reason for reason in CHECKED if seen[reason] > 3} == CHECKED, seen


@pytest.mark.rest
@pytest.mark.parametrize("key", [b"", KEY], ids=["open", "keyed"])
@pytest.mark.parametrize("name", SHAPES)
def test_a_random_dialogue_is_that_of_the_model(name: str, key: bytes) -> None:
    for seed in range(3):
        Dialogue(SHAPES[name], seed, key, slow=True, modes=True).play(200)


def _without_second(axis: AxisProgram) -> AxisProgram:
    """An axis that mixes nothing into its table: C has no second table then."""
    assert isinstance(axis, FrameProgram)
    return replace(axis, second=0 * axis.second, ratios=replace(axis.ratios, words=0 * axis.ratios.words))


def _mixed(seed: int) -> tuple[ScanProgram, ScanProgram, ScanProgram]:
    """A program with two slow parts, and those that mix nothing into x, or into y; a device accepts all three."""
    rng = np.random.default_rng(seed)
    while True:
        program = random_slow_program(rng, SHAPES["cubic"])
        x, y = program.x, program.y
        if not (isinstance(x, FrameProgram) and isinstance(y, FrameProgram)) or len(y.ratios.words) == MOST_KNOTS:
            continue
        programs = program, replace(program, x=_without_second(x)), replace(program, y=_without_second(y))
        images = [make_image(each, digest(rng)) for each in programs]
        contents = [take_apart(image.data, image.info.x, image.info.y) for image in images]
        limits = widest(x.output), widest(y.output)
        if all(first_objection(each, *limits, None) is None for each in contents):
            return programs


def _other_knots(axis: AxisProgram, words: int, lines: int) -> AxisProgram:
    """An axis with so many more ratios, so many lines further apart than the gains."""
    assert isinstance(axis, FrameProgram)
    more = np.append(axis.ratios.words, np.zeros(words, dtype=np.int64))
    return replace(axis, ratios=Knots(more, axis.ratios.spacing + lines))


def check_compiled(**how: Any) -> None:
    """A compiled program is the image of an upload, byte by byte; one that no words can describe is refused."""
    plain, no_x, no_y = _mixed(1)
    apart = replace(plain, x=_other_knots(plain.x, 0, 1))
    several = replace(plain, y=_other_knots(plain.y, 1, 0))
    unused = replace(no_y, y=_other_knots(no_y.y, 1, 1))
    programs = (no_x, unused, apart, several)
    compiled = [CompiledProgram(b"program", b"%064x" % number, each) for number, each in enumerate(programs)]
    device, talk = HostDevice(plain, plain, slow=True, plays=True, compiled=compiled, **how), Talk()
    device.receive(talk.hello())
    device.tick(1000)
    device.transmit()
    for number, expected in enumerate((no_x, no_y)):
        assert asked(device, talk, number) == number + 2
        image = make_image(expected, f"{number:064x}")
        device.receive(talk.request(Request.STATUS))
        (answer,) = talk.answers(device.transmit())
        assert DeviceStatus.unpack(answer.payload).hash == image.info.hash
        parts = []
        for at in range(0, len(image.data) + 240, 240):
            device.receive(talk.request(Request.READBACK, struct.pack("<IB", at, 240)))
            parts += [answer.payload[4:] for answer in talk.answers(device.transmit())]
        assert b"".join(parts) == image.data, number
    refusals = [asked(device, talk, number) for number in (2, 3)]
    device.refuse_slow()
    refusals.append(asked(device, talk, 0))
    assert refusals == [
        Refusal(Request.PLAY, Reason.SHAPE, 0),
        Refusal(Request.PLAY, Reason.SHAPE, 1),
        Refusal(Request.PLAY, Reason.LENGTH, 192 + 2 * (len(fast_of(plain.x).words) + len(fast_of(plain.y).words))),
    ]


def test_compiled_programs_are_images_of_uploads() -> None:
    check_compiled(modes=True, flash=(new_flash(), LAYOUT))  # as the devices of the next test


@pytest.mark.rest
def test_programs_with_slow_parts_are_kept_and_play_by_number() -> None:
    seen: Counter[Any] = Counter()
    for seed in range(8):
        how = {"store": True, "slow": True, "plays": True, "modes": True, "moves": seed % 2 == 1}
        dialogue = Dialogue(SHAPES["cubic"], seed, KEY if seed > 3 else b"", **how)
        dialogue.play(250)
        seen += dialogue.seen
    assert min(seen[Request.PLAY], seen[Request.SAVE]) > 5, seen
    assert seen[Request.PLAY, Reason.SLEW] + seen[Request.PLAY, Reason.RANGE] > 1, seen


@pytest.mark.rest
def test_a_turned_scan_on_a_pty_plays_as_the_integer_model(tmp_path: Path) -> None:
    """From the command line to the samples: each line of a frame that a compiled device plays after the upload.

    Then each line of the program that was compiled with the device, in the C that was emitted: played by its number.
    """
    setup = turned_setup(
        tmp_path, 30.0, "timing.lines = 16", "x.band_limit.harmonics = 12", "timing.line_rate_hz = 400"
    )
    build_turned(setup, tmp_path / "out")
    scan = PreparedScan.of_build(tmp_path / "out")
    x = scan.program.x
    assert isinstance(x, FrameProgram)
    boot = replace(scan.program, x=replace(x, gains=replace(x.gains, words=x.gains.words * 7 // 8)))
    library, compiled = _with_build(tmp_path, scan.name)
    device = HostDevice(scan.program, boot, update_rate_hz=500_000, library=library, slow=True)
    digits = scan.digest.encode()
    library.dll.device_compile(device._device, c_char_p(b"turned"), c_char_p(digits), compiled)
    check = LineCheck(boot)
    check.offer("upload", scan.program)
    with Served(device, "pty", 500_000) as served:
        assert run("upload", tmp_path / "out", "--port", served.url, "--timeout", str(PATIENCE_S)).status == 0
        with Device(served.url) as client:
            uploaded = client.readback()
            for _ in range(2):
                client.arm(1)
                client.trigger()
                client.wait_for(DeviceState.PLAYING, PATIENCE_S)
                client.wait_for(DeviceState.PARKED, PATIENCE_S)
                played = client.play(0)
            status, readback = client.status(), client.readback()
    assert (played.generation, readback) == (4, uploaded)
    assert (status.hash.hex(), status.faults) == (scan.digest, 0)
    check.follow(PlayedLine(**line._asdict()) for line in device.lines())
    assert check.lines == 2 * scan.program.schedule.lines
    assert (check.taken[2], check.taken[3]) == ("upload", "upload")


def _with_build(folder: Path, name: str) -> tuple[DeviceLibrary, Any]:
    """A device that was compiled with the C of a build, and the program of this."""
    sources = [folder / "out" / f"{name}{end}.c" for end in ("", "_program")]
    more = ["-DDAC_SPLINE=1", SLOW, "-DDAC_LIBRARY=2", f"-I{folder / 'out'}", *sources]
    library = DeviceLibrary(compile_device(folder / "device.so", more=more))
    return library, byref(c_char.in_dll(library.dll, f"{name}_program"))


def test_a_configuration_with_one_fault_is_refused() -> None:
    scan = make_scan(1, index_bits=(5, 5))
    device = HostDevice(scan.program, scan.program, key=KEY, slow=True)
    assert device.started is Started.STARTED
    assert [device.refusal(fault) for fault in range(52, 63)] == [Started.BAD_SLOW] * 11


@pytest.mark.rest
def test_checks_and_dialogues_with_sanitizers(tmp_path: Path) -> None:
    """Memory of a slow part has just the words that the configuration says."""
    more = ["-DDAC_SPLINE=1", SLOW, "-DDAC_LIBRARY=2"]
    device = compile_device(tmp_path / "device.so", options=SANITIZED, more=more)
    runtime = run_clean(["gcc", "-print-file-name=libasan.so"]).strip()
    environment = {
        **os.environ, "LD_PRELOAD": runtime, "ASAN_OPTIONS": "detect_leaks=0", "PYTHONMALLOC": "malloc",
        "PYTHONPATH": os.pathsep.join(sys.path),
    }  # fmt: skip
    command = [sys.executable, "-c", f"import test_c_link_slow as t; t.ask_all(t.Path({str(device)!r}), 40, 1)"]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]


CHECK, IMAGE, LIBRARY = "dac_link_check.c", "dac_link_image.c", "dac_link_library.c"
MUTANTS = {
    "words always show that a line is in range": (CHECK, "return least >> o->gain_q", "return true || 0"),
    "words always show that steps are small": (CHECK, "return rest < max_step &&", "return true ||"),
    "a step does not count the ramp": (CHECK, "(ramp + gain * (3", "(gain * (3"),
    "a range does not count the ramp": (CHECK, "line->at.ramp * (int64_t)(ticks - 1)", "0"),
    "steps between lines are not checked": (CHECK, "(slew && distance(now, c->before) > max_step)", "(0)"),
    "the step to the next frame is not checked": (CHECK, "*done && slew && distance", "false && distance"),
    "steps of ticks are not checked": (CHECK, "slew ? c->at != 0 && distance", "slew ? false && distance"),
    "codes of ticks are not checked": (CHECK, ": wide < o.code_min || wide > o.code_max", ": false"),
    "only the first line is checked": (CHECK, "*done = c->line == o.lines;", "*done = true;"),
    "offsets of the slow table are not checked": (CHECK, " || offset >= reach || offset <= -reach", ""),
    "gains are not checked": (CHECK, "} else if (slow->gains", "} else if (false && slow->gains"),
    "knots need not reach the end": (CHECK, "spacing * ((slow & 127u) - 1) < lines", "false"),
    "the step of the frame is not checked": (CHECK, "!good_phase(image, axis, lines, DAC_LINK_SLOW_STEP)", "false"),
    "y may step once a line": (CHECK, "(axis == 1 && steps) || ", ""),
    "the jump is that from line 0": (CHECK, "line_of(&old, c->at);", "line_of(&old, 0);"),
    "ratios are gains": (IMAGE, "axis->slow[image].ratios[at] = (int16_t)word;", "axis->slow[image].gains[at] = word;"),
    "words behind the slow table are missing": (CHECK, "table[words + i] = table[i];", "(void)i;"),
    "the gain of a compiled program is that of its table": (
        LIBRARY, "    put_level(page, s->gain_word, s->offset_word);\n", ""),
    "the slow table of a compiled program is too short": (LIBRARY, "(uint32_t)s->index_bits << 8", "3u << 8"),
    "the frame of a compiled program has no step": (LIBRARY, "    put_step(page, DAC_LINK_SLOW_STEP, lines);\n", ""),
    "the slow part of a compiled y is that of x": (
        LIBRARY, "put_slow(words + 128, program->y", "put_slow(words + 128, program->x"),
    "compiled slow parts have no length": (LIBRARY, "        bytes += slow_bytes(axes[axis]);\n", ""),
    "nothing is mixed into a compiled program": (LIBRARY, "s->second != NULL ? (uint32_t)s->second[word] : 0", "0"),
    "a second table is always there": (LIBRARY, "s->second != NULL ? (uint32_t)s->second[word]", "1 ? s->second[word]"),
    "ratios are always there": (LIBRARY, "s->second != NULL ? (uint32_t)s->ratios[knot]", "1 ? s->ratios[knot]"),
    "compiled ratios are gains": (LIBRARY, "(uint32_t)s->ratios[knot]", "(uint32_t)s->gains[knot]"),
    "other lines of ratios are lost": (LIBRARY, " && s->ratio_spacing == s->gain_spacing", ""),
    "other numbers of ratios are lost": (LIBRARY, "s->ratio_knots == s->gain_knots && ", ""),
    "ratios count that are not used": (LIBRARY, "s == NULL || s->second == NULL\n", "s == NULL\n"),
}  # fmt: skip
_FORK = get_context("fork")


def ask_all(path: Path, programs: int, seeds: int) -> None:
    """Ask a compiled device for its opinion of programs, and talk with it; raise where it differs."""
    library = DeviceLibrary(path)
    link_device.device_library = lambda *_: library  # type: ignore[assignment]
    test_rare_words_are_refused()
    check_compiled()
    for state in ("playing", "parked"):
        for seed in range(seeds):
            compare.__wrapped__("cubic", state, programs, 2 + seed)
    for seed in range(seeds):
        Dialogue(SHAPES["cubic"], seed, slow=True).play(200)
        Dialogue(SHAPES["cubic"], seed, slow=True, plays=True).play(200)


def differs(path: Path, programs: int = 300, seeds: int = 3) -> bool:
    """Return True if a device differs from its specification, or crashes; it is asked in a process of its own."""

    def trial() -> None:
        limit(120)
        faulthandler.disable()
        try:
            ask_all(path, programs, seeds)
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
    return compile_device(
        folder / "device.so", options=options, sources=sources, more=["-DDAC_SPLINE=1", SLOW, "-DDAC_LIBRARY=2"]
    )


def test_every_mutant_is_of_the_link_as_it_is() -> None:
    texts = {path.name: path.read_text("utf-8") for path in c_link()}
    assert {breaks for breaks, (file, old, _) in MUTANTS.items() if texts[file].count(old) != 1} == set()


@pytest.mark.rest
@pytest.mark.parametrize("breaks", one_of(4, MUTANTS))
def test_every_mutant_is_found(breaks: str, tmp_path: Path) -> None:
    assert differs(device_with(MUTANTS[breaks], tmp_path))


@pytest.mark.rest
@pytest.mark.parametrize("programs", long([60], [60, 300]))
def test_the_link_as_it_is_does_not_differ(programs: int, tmp_path: Path) -> None:
    assert not differs(device_with(None, tmp_path), programs, 3 if programs == 300 else 1)
