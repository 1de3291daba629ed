"""The output z over the C link: dialogues against the model, real scans from the command line, and faults."""

import faulthandler
import os
import struct
import subprocess
import sys
from collections import Counter
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
from limits import PATIENCE_S, limit
from line_log import LineCheck, PlayedLine
from link_device import SANITIZED, DeviceLibrary, HostDevice, Started, compile_device, widest
from link_images import digest, random_slow_program, random_z_program
from link_programs import make_scan
from link_random import KEY, Dialogue
from link_talk import Talk
from replacing import replace
from sets import long, one_of
from tilted_scans import with_aux, write_sine, write_stepped, write_straight, write_tilted

from tablegen.base.resources import c_link, c_runtime
from tablegen.device.commit_mode import CommitMode
from tablegen.device.dual_program import AxisProgram, ScanProgram
from tablegen.fixedpoint.frame_program import FrameProgram
from tablegen.link.acceptance import first_objection
from tablegen.link.device import Device
from tablegen.link.messages import OF_Z, DeviceInfo, DeviceState, DeviceStatus, Reason, Request, ZStatus
from tablegen.link.prepare import PreparedScan
from tablegen.link.program_image import ProgramImage, join, make_image, take_apart
from tablegen.verification.play.sequencer_shape import SequencerShape

pytestmark = pytest.mark.common

SHAPES = {
    "cubic": SequencerShape(16, 3, 5, 16, 3, 4, 16),
    "lines": SequencerShape(16, 1, 5, 16, 1, 3, 14),
    "21 bits": SequencerShape(18, 3, 3, 21, 1, 4, 18),
}
CUBIC = SHAPES["cubic"]
SCANS = {"angle": write_tilted, "straight": write_straight, "steps": write_stepped, "sine": write_sine}
SCANS["both outputs"] = lambda folder: with_aux(write_straight(folder))
OPTIONS = ["-DDAC_SPLINE=1", "-DDAC_SLOW_PART=1", "-DDAC_COMMIT_MODES=1", "-DDAC_LINK_Z=1"]


def loadable(program: ScanProgram) -> bool:
    """Whether a device of widest limits takes a program."""
    image = make_image(program, bytes(32).hex())
    limits = widest(program.x.output), widest(program.y.output)
    return first_objection(take_apart(image.data, image.info.x, image.info.y), *limits, None) is None


@cache
def pair(seed: int, like: int | None = None) -> tuple[ScanProgram, ScanProgram]:
    """A program of x and y of several lines, and one of z; ``like`` another pair, with its schedule."""
    rng = np.random.default_rng(seed)
    while True:
        program = random_slow_program(rng, CUBIC)
        if like is not None:
            program = random_z_program(rng, CUBIC, pair(like)[0].schedule)
        z = random_z_program(rng, CUBIC, program.schedule)
        big = program.schedule.ticks >= 40 and program.schedule.lines >= 5
        slow = all(isinstance(axis, FrameProgram) for axis in (program.x, program.y, z.x, z.y))
        if big and slow and loadable(program) and loadable(z):
            return program, z


def image_of(pair: tuple[ScanProgram, ScanProgram], seed: int = 1) -> ProgramImage:
    """The image of an upload of both."""
    name = digest(np.random.default_rng(seed))
    return join(make_image(pair[0], name), make_image(pair[1], name))


class Host:
    """What a host says to a device with z, and the lines of both sequencers against the integer model."""

    def __init__(self, boot: int, key: bytes = b"", with_z: bool = True, **how: Any) -> None:
        x_y, z = pair(boot)
        self.device = HostDevice(
            x_y, x_y, slow=True, modes=True, key=key, z=z, z_boot=z if with_z else None, update_rate_hz=1000, **how
        )
        assert self.device.started is Started.STARTED
        self.checks = LineCheck(x_y, keeps=True), LineCheck(z, keeps=True)
        self.talk = Talk(key=key)
        self.ask(Request.HELLO, b"\x01")
        self.device.tick(2000)

    def ask(self, kind: int, payload: bytes = b"", acts: bool = False) -> Any:
        """The answer to a request, or its refusal as reason and detail; None if none comes at once."""
        self.device.receive(self.talk.request(kind, payload, acts))
        return self.answer(kind)

    def answer(self, kind: int) -> Any:
        """What has been answered to the request of a type."""
        for frame in self.talk.answers(self.device.transmit()):
            if frame.type == 0xFF and frame.payload[0] == kind:
                return tuple(struct.unpack("<xBI", frame.payload))
            if frame.type == kind | 0x80:
                return frame.payload
        return None

    def act(self, kind: int, payload: bytes = b"") -> Any:
        """The same of a request that acts."""
        return self.ask(kind, payload, acts=True)

    def send(self, image: ProgramImage, until: int | None = None) -> Any:
        """BEGIN and DATA up to a byte; the first refusal, or the bytes that have arrived."""
        answer = self.ask(Request.BEGIN, image.info.pack())
        while len(answer) == 4:
            (at,) = struct.unpack("<I", answer)
            end = min(at + 240, len(image.data) if until is None else until)
            if at == end:
                return at
            answer = self.ask(Request.DATA, struct.pack("<I", at) + image.data[at:end])
        return answer

    def commit(self, image: ProgramImage, mode: CommitMode = CommitMode.LINE) -> Any:
        """The answer to COMMIT, which comes with the ticks: the generation, or the refusal."""
        answer = self.act(Request.COMMIT, struct.pack("<IB", image.info.image_crc, mode))
        for _ in range(5000):
            if answer is not None:
                break
            self.device.tick(1)
            answer = self.answer(Request.COMMIT)
        return answer if answer is None or len(answer) == 2 else struct.unpack("<I", answer[:4])[0]

    def upload(self, image: ProgramImage, mode: CommitMode = CommitMode.LINE) -> Any:
        """The answer to the COMMIT of an upload, or the refusal before."""
        sent = self.send(image)
        return sent if isinstance(sent, tuple) else self.commit(image, mode)

    def start(self, frames: int = 0) -> None:
        """ARM and TRIGGER."""
        assert (self.act(Request.ARM, struct.pack("<I", frames)), self.act(Request.TRIGGER)) == (b"", b"")

    def status(self) -> tuple[DeviceStatus, ZStatus]:
        """The status of both."""
        payload = self.ask(Request.STATUS)
        return DeviceStatus.unpack(payload), ZStatus.unpack(payload[DeviceStatus.LAYOUT.size :])

    def follow(self) -> tuple[int, int]:
        """How many lines both have played; raises where one is not that of the model, or they differ."""
        for check, lines in zip(self.checks, (self.device.lines(), self.device.z_lines()), strict=True):
            check.follow(PlayedLine(**line._asdict()) for line in lines)
        assert self.device.apart == 0
        return self.checks[0].lines, self.checks[1].lines

    def offer(self, programs: tuple[ScanProgram, ScanProgram], name: str) -> None:
        """They may be uploaded from now on."""
        for check, program in zip(self.checks, programs, strict=True):
            check.offer(name, program)


# Against the model


@cache
def seen_in(name: str, key: bytes, seeds: range) -> Counter[Any]:
    """What dialogues with a device that has z have met."""
    seen: Counter[Any] = Counter()
    for seed in seeds:
        dialogue = Dialogue(SHAPES[name], seed, key, slow=True, modes=seed % 2 == 1, z=True)
        dialogue.play(200)
        assert dialogue.device.apart == 0
        seen += dialogue.seen
    return seen


def test_a_short_dialogue_is_that_of_the_model() -> None:
    assert seen_in("cubic", b"", range(2))[Request.DATA] > 10


@pytest.mark.rest
@pytest.mark.parametrize("key", [b"", KEY], ids=["open", "keyed"])
@pytest.mark.parametrize("name", SHAPES)
def test_a_random_dialogue_is_that_of_the_model(name: str, key: bytes) -> None:
    assert seen_in(name, key, range(3))[Request.DATA] > 10


@pytest.mark.rest
def test_dialogues_meet_what_z_can_be_refused_for() -> None:
    """A control of the test above."""
    seen = sum((seen_in(name, b"", range(10, 18)) for name in SHAPES), Counter())
    assert seen[Request.COMMIT] > 20, seen
    assert seen[Request.COMMIT, Reason.PLAYING] > 5, seen
    of_z = {(kind, reason) for kind, reason, *z in (each for each in seen if isinstance(each, tuple)) if z}
    expected = {
        (Request.BEGIN, Reason.SHAPE), (Request.DATA, Reason.SHAPE), (Request.DATA, Reason.HARMONICS),
        (Request.COMMIT, Reason.SCHEDULE), (Request.COMMIT, Reason.PERIOD), (Request.COMMIT, Reason.OUTPUT),
        (Request.COMMIT, Reason.WORD), (Request.COMMIT, Reason.RANGE), (Request.COMMIT, Reason.SLEW),
    }  # fmt: skip
    assert expected <= of_z, expected - of_z


# Both or neither, on one tick


def test_x_y_and_z_begin_on_one_tick_in_each_mode() -> None:
    host = Host(1)
    host.start()
    for number, mode in enumerate(CommitMode, 2):
        host.device.tick(37 * number)
        programs = pair(10 + number, 1)
        host.offer(programs, mode.name)
        assert host.upload(image_of(programs, number), mode) == number
        host.device.tick(3 * programs[0].schedule.frame_ticks)
    status, z = host.status()
    assert (status.generation, z.generation, z.plays, status.line) == (4, 4, True, z.line)
    assert min(host.follow()) > 10
    assert [check.taken[4] for check in host.checks] == [mode.name for mode in CommitMode][-1:] * 2
    host.act(Request.PARK)
    host.device.tick(70_000)
    status, z = host.status()
    assert (status.state, z.state, host.device.apart) == (DeviceState.PARKED, DeviceState.PARKED, 0)


def test_frames_and_requests_of_the_application_reach_both() -> None:
    host = Host(1)
    ticks = pair(1)[0].schedule.frame_ticks
    host.start(2)
    host.device.tick(4 * ticks)
    assert host.follow() == (2 * pair(1)[0].schedule.lines,) * 2
    assert host.device.request("arm", 1)
    assert not host.device.request("arm", (1 << 31) + 1)
    assert host.device.request("trigger")
    host.device.tick(ticks // 2)
    assert host.device.request("park")
    host.device.tick(70_000)
    lines = host.follow()
    assert lines[0] == lines[1] > 2 * pair(1)[0].schedule.lines


def test_a_refused_z_leaves_x_y_and_z_as_they_were() -> None:
    host = Host(1)
    host.start()
    x_y, z = pair(11, 1)
    good = image_of((x_y, z))
    steep = replace(z, x=_with_output(z.x, max_step=1))
    other = pair(12)[1]
    assert other.schedule != x_y.schedule
    short = image_of((x_y, z), 5)
    shape = replace(short.info, z=replace(short.info.z, x=replace(short.info.z.x, word_bits=15)))  # type: ignore[type-var]
    refusals = {
        "slew": (host.upload(image_of((x_y, steep), 2)), (Reason.SLEW, OF_Z)),
        "schedule": (host.upload(image_of((x_y, other), 3)), (Reason.SCHEDULE, OF_Z)),
        "shape": (host.ask(Request.BEGIN, replace(shape).pack()), (Reason.SHAPE, OF_Z)),
    }
    for name, (got, expected) in refusals.items():
        assert got[0] == expected[0], name
        assert got[1] & OF_Z, name
    host.send(good)
    damaged = ProgramImage(good.info, good.data)
    host.device.poke(0, 0, 1)
    assert host.commit(damaged) == (Reason.IMAGE, 0)
    host.device.tick(2000)
    status, of_z = host.status()
    assert (status.generation, of_z.generation, of_z.plays) == (1, 1, True)
    assert min(host.follow()) > 10


def test_an_upload_goes_on_in_either_image() -> None:
    host = Host(1)
    image = image_of(pair(11, 1))
    middle = image.info.first.image_bytes
    for until in (100, middle - 1, middle, middle + 1, middle + 200, len(image.data) - 1):
        assert host.send(image, until) == until
        assert host.commit(image) == (Reason.INCOMPLETE, until)
        host.talk.session += 1  # another host, or the same after the link was lost
        host.ask(Request.HELLO, b"\x01")
        status, _ = host.status()
        assert (status.received, status.image_crc) == (until, image.info.image_crc)
    other = replace(image.info.z, x=replace(image.info.z.x, index_bits=4))  # type: ignore[type-var]
    for info in (replace(image.info, z=other), image.info.first):
        host.send(image, middle + 100)
        assert host.ask(Request.BEGIN, info.pack()) == bytes(4)
    host.send(image, middle + 100)
    unfit = replace(image.info, z=replace(other, y=replace(other.y, word_bits=15)))
    assert host.ask(Request.BEGIN, unfit.pack()) == (Reason.SHAPE, OF_Z + 1)
    assert host.status()[0].received == 0
    assert host.upload(image) == 2
    read = b""
    while len(piece := host.ask(Request.READBACK, struct.pack("<IB", len(read), 240))) > 4:
        read += piece[4:]
    assert read == image.data
    assert host.commit(image) == 2  # it is active


def test_a_scan_without_z_parks_z_and_needs_a_parked_device() -> None:
    host = Host(1)
    host.start()
    host.device.tick(100)
    x_y, z = pair(11, 1)
    plain = make_image(x_y, digest(np.random.default_rng(8)))
    assert host.upload(plain) == (Reason.PLAYING, 0)
    host.device.tick(500)
    assert host.status()[1].state == DeviceState.PLAYING
    host.act(Request.PARK)
    host.act(Request.ARM, struct.pack("<I", 0))  # which the COMMIT takes back
    host.device.tick(70_000)
    host.offer((x_y, z), "second")
    assert host.commit(plain) == 2  # the upload was kept
    host.act(Request.TRIGGER)
    host.device.tick(70_000)
    assert host.status()[0].state == DeviceState.PARKED
    before = host.follow()
    host.start()
    host.device.tick(3000)
    status, of_z = host.status()
    assert (status.state, of_z.state, of_z.plays) == (DeviceState.PLAYING, DeviceState.PARKED, False)
    x_y_lines, z_lines = host.follow()
    assert x_y_lines > before[0]
    assert z_lines == before[1]
    assert host.upload(image_of((x_y, z), 9)) == (Reason.PLAYING, 0)
    host.act(Request.PARK)
    host.device.tick(70_000)
    assert host.commit(image_of((x_y, z), 9)) == 3
    host.start()
    host.device.tick(3000)
    status, of_z = host.status()
    assert (status.generation, of_z.generation, of_z.plays) == (3, 2, True)
    assert host.follow()[1] > z_lines


def test_a_trigger_that_waits_keeps_z_from_ending() -> None:
    """Between a trigger and its tick no scan plays yet, but it begins before a program would be taken."""
    host = Host(1)
    plain = make_image(pair(11, 1)[0], digest(np.random.default_rng(8)))
    host.send(plain)
    host.start()  # no tick follows
    answer = host.act(Request.COMMIT, struct.pack("<IB", plain.info.image_crc, CommitMode.LINE))
    for _ in range(5000):
        if answer is not None:
            break
        host.device.work()
        answer = host.answer(Request.COMMIT)
    assert answer == (Reason.PLAYING, 0)
    host.device.tick(2000)
    status, of_z = host.status()
    assert (status.state, of_z.state, of_z.plays) == (DeviceState.PLAYING, DeviceState.PLAYING, True)
    assert (status.generation, of_z.generation) == (1, 1)
    host.follow()


def test_a_withdrawal_takes_back_both() -> None:
    host = Host(1)
    host.start()
    host.device.tick(10)
    image = image_of(pair(11, 1))
    host.send(image)
    host.act(Request.COMMIT, struct.pack("<I", image.info.image_crc))
    host.device.work()
    assert host.status()[0].upload == 3
    host.act(Request.ABORT)
    host.device.tick(2000)
    status, z = host.status()
    assert (status.generation, z.generation, z.plays) == (1, 1, True)
    assert min(host.follow()) > 5


def test_a_withdrawn_begin_of_z_stops_the_trigger_behind_it() -> None:
    """The trigger was for a scan with z; without it, x and y would play a scan whose z rests, or the other way."""
    host = Host(1, with_z=False)
    image = image_of(pair(11, 1))
    host.send(image)
    host.act(Request.COMMIT, struct.pack("<I", image.info.image_crc))
    host.start()
    assert host.status()[1].plays
    host.act(Request.ABORT)
    host.device.tick(200)
    status, z = host.status()
    assert (status.generation, z.generation, z.plays, host.device.apart) == (1, 0, False, 0)
    assert status.state != DeviceState.PLAYING


def test_a_full_queue_gives_neither_a_request() -> None:
    host = Host(1)
    for _ in range(8):
        assert host.act(Request.CLEAR) == b""
    assert host.act(Request.TRIGGER) == (Reason.TICKS, 0)
    assert host.act(Request.PARK) == (Reason.TICKS, 0)
    host.device.tick(1)
    host.start()
    host.device.tick(1000)
    assert min(host.follow()) > 5


def test_requests_go_to_both_between_two_ticks() -> None:
    host = Host(1)
    image = image_of(pair(11, 1))
    host.send(image)
    for kind, payload in (
        (Request.PARK, b""), (Request.ARM, bytes(4)), (Request.CLEAR, b""), (Request.TRIGGER, b""),
        (Request.COMMIT, struct.pack("<I", image.info.image_crc)), (Request.ABORT, b""),
    ):  # fmt: skip
        before = host.device.stops
        host.act(kind, payload)
        assert host.device.stops == before + 1, kind


def test_what_a_device_says_of_z() -> None:
    host = Host(1)
    info = DeviceInfo.unpack(host.ask(Request.HELLO, b"\x01"))
    assert info.z is not None
    z = pair(1)[1]
    assert (info.z.x.word_bits, info.z.x.dac_bits, info.z.x_limits) == (16, 16, widest(z.x.output))
    assert info.of_z.image_bytes == info.z.image_bytes > 192
    device = HostDevice(pair(1)[0], slow=True, modes=True)  # without the option
    talk = Talk()
    device.receive(talk.hello())
    assert DeviceInfo.unpack(talk.answers(device.transmit())[0].payload).z is None
    device.receive(talk.request(Request.BEGIN, image_of(pair(1)).info.pack()))
    assert talk.refusals(device.transmit()) == [(Reason.PAYLOAD, 0)]


def test_a_configuration_with_one_fault_is_refused() -> None:
    scan = make_scan(1, index_bits=(5, 5))
    device = HostDevice(scan.program, scan.program, key=KEY, slow=True, z=scan.program)
    assert device.started is Started.STARTED
    expected = [Started.STARTED, Started.BAD_AXIS, *[Started.BAD_Z] * 6]
    assert [device.z_refusal(fault) for fault in range(8)] == expected
    device = HostDevice(scan.program, scan.program, slow=True, pixels=True, z=scan.program)
    assert device.z_refusal(8) is Started.BAD_Z


def _with_output(axis: AxisProgram, **changes: int) -> AxisProgram:
    assert isinstance(axis, FrameProgram)
    return replace(axis, fast=replace(axis.fast, output=replace(axis.output, **changes)))


# Real scans


@pytest.mark.rest
@pytest.mark.parametrize("kind", SCANS)
def test_a_scan_from_the_command_line_plays_as_the_integer_model(kind: str, tmp_path: Path) -> None:
    """On a pty: upload, trigger, another tilt in mid-scan, park; every line of x, y and z."""
    scans = []
    for name, slope in (("one", "0.02"), ("two", "0.03")):
        (tmp_path / name).mkdir()
        edits = [30.0] if kind == "angle" else ["timing.pixels = 16"] if kind == "sine" else []
        path = SCANS[kind](tmp_path / name, *edits)  # type: ignore[operator]
        path.write_text(path.read_text("utf-8").replace("slope_x = 0.02", f"slope_x = {slope}"), "utf-8")
        assert run("build", path, "-o", tmp_path / name / "build", "-q").status == 0
        scans.append(PreparedScan.of_build(tmp_path / name / "build"))
    first, second = scans
    assert first.program_of_z is not None
    assert second.program_of_z is not None
    rate_hz = int(first.program.schedule.update_rate_hz)
    device = HostDevice(
        first.program, first.program, update_rate_hz=rate_hz, slow=True, modes=True, z=first.program_of_z,
        pixels=kind == "sine",
    )  # fmt: skip
    checks = LineCheck(first.program, keeps=True), LineCheck(first.program_of_z, keeps=True)
    for check, programs in zip(checks, zip(*((s.program, s.program_of_z) for s in scans), strict=True), strict=True):
        for name, program in zip(("one", "two"), programs, strict=True):
            check.offer(name, program)  # type: ignore[arg-type]
    with Served(device, "pty", min(rate_hz, 200_000)) as served:
        port = ("--port", served.url)
        patience = ("--timeout", str(PATIENCE_S))
        done = run("upload", tmp_path / "one" / "build", *port, *patience)
        assert done.status == 0, done.err
        assert "output z    follows the scan; faults: none" in run("status", *port).out
        assert run("readback", tmp_path / "one" / "build", *port).status == 0
        assert run("readback", tmp_path / "two" / "build", *port).status == 5
        assert run("trigger", *port).status == 0
        done = run("upload", tmp_path / "two" / "build", "--swap", "keep", *port, *patience)
        assert done.status == 0, done.err
        with Device(served.url) as client:
            client.wait_for(DeviceState.PLAYING, PATIENCE_S)
        assert run("park", "--wait", *port, *patience).status == 0
        with Device(served.url) as client:
            status = client.status()
    assert status.z is not None
    assert (status.hash.hex(), status.faults, status.z.faults) == (second.digest, 0, 0)
    assert device.apart == 0
    for check, lines in zip(checks, (device.lines(), device.z_lines()), strict=True):
        check.follow(PlayedLine(**line._asdict()) for line in lines)
    assert checks[0].lines == checks[1].lines > 2
    assert checks[1].taken[2] == "two"


# Controls


def ask_all(path: Path, seeds: int) -> None:
    """Ask a compiled device; raise where it differs."""
    library = DeviceLibrary(path)
    link_device.device_library = lambda *_: library  # type: ignore[assignment]
    test_x_y_and_z_begin_on_one_tick_in_each_mode()
    test_frames_and_requests_of_the_application_reach_both()
    test_a_refused_z_leaves_x_y_and_z_as_they_were()
    test_an_upload_goes_on_in_either_image()
    test_a_scan_without_z_parks_z_and_needs_a_parked_device()
    test_a_trigger_that_waits_keeps_z_from_ending()
    test_a_withdrawal_takes_back_both()
    test_a_withdrawn_begin_of_z_stops_the_trigger_behind_it()
    test_a_full_queue_gives_neither_a_request()
    test_requests_go_to_both_between_two_ticks()
    for seed in range(seeds):
        dialogue = Dialogue(CUBIC, seed, KEY if seed == 1 else b"", slow=True, modes=True, z=True)
        dialogue.play(200)
        assert dialogue.device.apart == 0


@pytest.mark.rest
def test_z_with_sanitizers(tmp_path: Path) -> None:
    """Memory of z has just the words that the configuration says."""
    device = compile_device(tmp_path / "device.so", options=SANITIZED, more=OPTIONS)
    runtime = run_clean(["gcc", "-print-file-name=libasan.so"]).strip()
    environment = {
        **os.environ, "LD_PRELOAD": runtime, "ASAN_OPTIONS": "detect_leaks=0", "PYTHONMALLOC": "malloc",
        "PYTHONPATH": os.pathsep.join(sys.path),
    }  # fmt: skip
    command = [sys.executable, "-c", f"import test_c_link_z as t; t.ask_all(t.Path({str(device)!r}), 2)"]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]


Z, CHECK, LINK = "dac_link_z.c", "dac_link_check.c", "dac_link.c"
MUTANTS = {
    "z is not committed": (Z, "        found = commit(z);", "        (void)0;"),
    "z has no mode of its COMMIT": (Z, "        z->commit_mode = l->commit_mode;\n", ""),
    "z is not checked": (Z, "    if (!first || !l->has_z) {", "    if (1) {"),
    "z may have another schedule": (Z, "return same_schedule(l) ? dac_link_fine()", "return true ? dac_link_fine()"),
    "a trigger is of x and y alone": (Z, "(what != DAC_LINK_TRIGGER || l->plays_z)", "(what != DAC_LINK_TRIGGER)"),
    "a trigger reaches a z that rests": (Z, "(what != DAC_LINK_TRIGGER || l->plays_z)", "true"),
    "ticks go on": (Z, "        l->config->stop_ticks(stopped);", "        (void)stopped;"),
    "z may begin in a scan": (Z, "    if (changes && (plays", "    if (false && (plays"),
    "a waiting trigger is overlooked": (Z, "    return starts || ", "    return "),
    "an old ARM stays": (Z, "    if (found.reason == DAC_LINK_NO_REASON && changes) {", "    if (false) {"),
    "a frame of z need not go on": (Z, "(l->has_z && !dac_sequencer_can_keep(l->z->sequencer))", "false"),
    "one queue may be full": (Z, " && (z == NULL || has_room(z, 1));", ";"),
    "z is not withdrawn": (Z, "        (void)dac_sequencer_withdraw(z->sequencer);\n", ""),
    "a trigger outlives a withdrawal": (Z, "    if (room && changes && dac", "    if (false && dac"),
    "a withdrawn z stays": (Z, "        l->plays_z = l->played_z;\n        return;", "        return;"),
    "the image of z is always the first": (Z, "        l->z->playing = l->z->idle;\n", ""),
    "an upload of another z goes on": (Z, "&& (!has_z || dac_link_same(second", "&& (true || dac_link_same(second"),
    "an upload with z is one without": (Z, "l->upload == DAC_LINK_RECEIVING && has_z == l->has_z\n",
                                        "l->upload == DAC_LINK_RECEIVING\n"),
    "bytes of z go to x and y": (Z, "l->received != bytes_of(l) ? l : l->z", "true ? l : l->z"),
    "half an upload is whole": (Z, "        if (l->z->received != bytes_of(l->z))\n", "        if (false)\n"),
    "a refused z is one of x": (Z, "return part->is_z ? dac_link_of_z(found) : found;", "return found;"),
    "a z that does not fit leaves its upload": (
        Z, "            l->upload = DAC_LINK_NONE;\n            return dac_link_of_z(found);",
        "            return dac_link_of_z(found);"),
    "z is not read back": (Z, "    if (done != count) {", "    if (false) {"),
    "checks of z begin twice": (Z, "        l->checks_z = false;\n", ""),
    "the CRC is that of x and y": (CHECK, "    *done = at->part == DAC_LINK_END && (part != l || !l->has_z);",
                                   "    *done = at->part == DAC_LINK_END;"),
    "a long BEGIN is refused": (LINK, "            return length;\n#endif\n        return DAC_LINK_INFO;",
                                "            return 0;\n#endif\n        return DAC_LINK_INFO;"),
}  # fmt: skip
_FORK = get_context("fork")


def differs(path: Path, seeds: int = 4) -> bool:
    """Return True if a device differs, or crashes; it is asked in a process of its own."""

    def trial() -> None:
        limit(120)
        faulthandler.disable()
        try:
            ask_all(path, seeds)
        except BaseException:
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
    return compile_device(folder / "device.so", options=("-std=c99", "-O1", "-w"), sources=sources, more=OPTIONS)


def test_every_mutant_is_of_the_link_as_it_is() -> None:
    texts = {path.name: path.read_text("utf-8") for path in c_link()}
    assert {breaks for breaks, (file, old, _) in MUTANTS.items() if texts[file].count(old) != 1} == set()


@pytest.mark.rest
@pytest.mark.parametrize("breaks", one_of(4, MUTANTS))
def test_every_mutant_is_found(breaks: str, tmp_path: Path) -> None:
    assert differs(device_with(MUTANTS[breaks], tmp_path))


@pytest.mark.rest
@pytest.mark.parametrize("seeds", long([4], [4, 20]))
def test_the_link_as_it_is_does_not_differ(seeds: int, tmp_path: Path) -> None:
    assert not differs(device_with(None, tmp_path), seeds)
