"""Devices that lie: each impossible field ends in a message with its name and value, in little memory and time."""

import struct
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from random import Random

import pytest
from building import Variant, build
from client_line import VirtualLine
from client_rig import BOOT, TABLE, Bench, client, info_for, model
from editing import Outcome
from link_programs import INFO
from replacing import replace

from tablegen.link.claims import MAXIMUM_IMAGE_BYTES, most_bytes
from tablegen.link.device import Device
from tablegen.link.errors import LinkError, NotUnderstood
from tablegen.link.frames import Frame, FrameReader
from tablegen.link.messages import ANSWER, REFUSAL, AxisLimits, DeviceInfo, Refusal, Request
from tablegen.link.prepare import PreparedScan
from tablegen.link.program_image import PROGRAM_BYTES

INVALID = 12
HOUR_S = 3600.0  # of the line's clock; every deadline of a small scan is far below
MEMORY_BYTES = 16 << 20
Lie = Callable[[bytes], bytes]  # what becomes of the payload of an answer
ALL = 0xFFFFFFFF


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build(tmp_path_factory.mktemp("example"), Variant({"timing.lines": 40})).folder


@pytest.fixture(scope="module")
def info(folder: Path) -> DeviceInfo:
    return info_for(PreparedScan.of_build(folder))


def lying(lies: dict[int, Lie]) -> Callable[[bytes], list[bytes]]:
    """A way back on which the answers to requests of these types say something else."""

    def spoil(piece: bytes) -> list[bytes]:
        frames = FrameReader().feed(piece)
        if not frames or frames[0].type == REFUSAL or frames[0].type & ~ANSWER not in lies:
            return [piece]
        answer = frames[0]
        return [replace(answer, payload=lies[answer.type & ~ANSWER](answer.payload)).encode()]

    return spoil


def put(at: int, layout: str, *values: int) -> Lie:
    """Write values into an answer, as docs/protocol.md numbers its bytes."""

    def lie(payload: bytes) -> bytes:
        changed = bytearray(payload)
        struct.pack_into(f"<{layout}", changed, at, *values)
        return bytes(changed)

    return lie


def told(bench: Bench, *arguments: str | Path) -> Outcome:
    """Run a command on a device that lies: it ends with a message, in little memory and within its deadlines."""
    tracemalloc.start()
    try:
        outcome = bench.run(*arguments)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < MEMORY_BYTES
    assert bench.line.now_s < HOUR_S
    assert outcome.out == ""
    assert outcome.err.count("\n") == 1
    return outcome


# HELLO

HELLO_LIES = [
    (put(0, "B", 7), "version is 7; possible: 1"),
    (put(2, "B", 0), "window is 0; possible: 1 to 255"),
    (put(3, "B", 0), "data_bytes is 0; possible: 1 to 240"),
    (put(3, "B", 255), "data_bytes is 255; possible: 1 to 240"),
    (put(4, "H", 65535), "harmonics is 65535; possible: 0 to 4096"),
    (put(8, "I", ALL), f"image_bytes is 4294967295; possible: 0 to {MAXIMUM_IMAGE_BYTES}"),
    (put(12, "B", 32), "x index_bits is 32; possible: 0 to 16"),
    (put(16, "B", 255), "y index_bits is 255; possible: 0 to 16"),
    (put(13, "B", 200), "x word_bits is 200; possible: 8 to 24"),
    (put(17, "B", 0), "y word_bits is 0; possible: 8 to 24"),
    (put(14, "B", 255), "x dac_bits is 255; possible: 8 to 24"),
    (put(18, "B", 7), "y dac_bits is 7; possible: 8 to 24"),
    (put(19, "B", 63), "y converter (its bits) is 63; possible: 16 to 32"),
    (put(24, "I", ALL), "x code_max is 4294967295; possible: "),
    (put(36, "2I", 9, 3), "y code_max is 3; possible: 9 to "),
    (put(28, "I", 0), "x max_step is 0; possible: 1 to 4294967295"),
    (put(56, "B", 9), "state is 9; possible: 0 to 3"),
    (put(57, "B", 200), "upload is 200; possible: 0 to 3"),
    (put(68, "I", ALL), "line is 4294967295; possible: 0 to 2147483647"),
    (put(72, "I", 4_000_000_000), "received is 4000000000; possible: 0 to 65536"),
    (lambda payload: payload[:131], "its answer has 131 bytes; at least 132 are needed"),
]


@pytest.mark.parametrize(("lie", "why"), HELLO_LIES, ids=[why.split(";")[0] for _, why in HELLO_LIES])
def test_a_lie_of_hello_is_told(info: DeviceInfo, lie: Lie, why: str) -> None:
    bench = Bench(model(info, boot=BOOT), spoil_back=lying({Request.HELLO: lie}))
    for command in (("status",), ("readback", "-o", "never.bin")):
        outcome = told(bench, *command)
        assert outcome.status == INVALID
        assert outcome.err.startswith(f"the device sent an invalid answer: HELLO: {why}")
        assert outcome.err.endswith("; do the versions of tablegen and firmware match?\n")
    assert not Path("never.bin").exists()


def test_another_device_at_the_port_is_told() -> None:
    """An upload would go on in an instrument that it was not made for."""
    line = VirtualLine(model())
    with client(line) as device:
        line.spoil_back = lying({Request.HELLO: put(2, "B", 3)})
        line.sleep(1.0)
        with pytest.raises(NotUnderstood, match="HELLO: window was 8 and is 3 now; is another device connected"):
            device.upload(TABLE)


@pytest.mark.parametrize("widths", [(8, 7), (16, 16)])
def test_sizes_are_capped_by_the_widths_and_not_by_image_bytes(widths: tuple[int, int]) -> None:
    wide = replace(INFO.x, index_bits=widths[0]), replace(INFO.y, index_bits=widths[1])
    info = replace(INFO, x=wide[0], y=wide[1], image_bytes=MAXIMUM_IMAGE_BYTES)
    assert most_bytes(info) == PROGRAM_BYTES + sum(2 << bits for bits in widths)
    assert most_bytes(replace(info, harmonics=4096, x=INFO.x, y=INFO.y)) == PROGRAM_BYTES + 2 * 4 * 8193
    assert most_bytes(replace(info, x=replace(wide[0], word_bits=24, index_bits=16))) <= MAXIMUM_IMAGE_BYTES


def test_no_rate_of_a_device_makes_an_upload_wait_for_days() -> None:
    """One tick a second, and 2^24 ticks a line, are 194 days."""
    long = replace(TABLE, data=struct.pack("<I", 1 << 24) + TABLE.data[4:])
    line = VirtualLine(model(replace(INFO, update_rate_hz=1)))
    with client(line) as device:
        assert device.upload_time_s(long) < HOUR_S
        device._session.exchange.pace.late_s = 1e9  # answers that come later and later
        assert device.upload_time_s(replace(TABLE, data=bytes(MAXIMUM_IMAGE_BYTES))) < 2 * HOUR_S


# STATUS, LIMITS, READBACK

STATUS_LIES: list[tuple[tuple[str, ...], int, Lie, str]] = [
    (("status",), Request.STATUS, put(0, "B", 4), "STATUS: state is 4; possible: 0 to 3"),
    (("status",), Request.STATUS, put(1, "B", 4), "STATUS: upload is 4; possible: 0 to 3"),
    (("status",), Request.STATUS, put(12, "I", 1 << 31), "STATUS: line is 2147483648; possible"),
    (("status",), Request.STATUS, put(16, "I", ALL), "STATUS: received is 4294967295; possible: 0 to 65536"),
    (("status",), Request.STATUS, lambda payload: payload[:75], "STATUS: its answer has 75 bytes; at least 76"),
    (("status",), Request.LIMITS, lambda payload: payload[:31], "LIMITS: its answer has 31 bytes; at least 32"),
    (("status",), Request.LIMITS, put(4, "I", ALL), "LIMITS: x code_max is 4294967295, wider than "),
    (("status",), Request.LIMITS, put(24, "I", ALL), "LIMITS: y max_step is 4294967295, wider than "),
    (("readback",), Request.READBACK, put(0, "I", 0), "READBACK: offset is 0 in the answer to a request for 240"),
    (("readback",), Request.READBACK, put(0, "I", ALL), "READBACK: offset is 4294967295 in the answer to a request"),
    (("readback",), Request.READBACK, lambda _: b"\0\0", "READBACK: its answer has 2 bytes; at least 4 are needed"),
    (("readback",), Request.READBACK, lambda old: old[:4], "READBACK: the image has 0 bytes; possible: 192 to "),
    (
        ("readback",),
        Request.READBACK,
        lambda old: old[:5],
        "READBACK: 1 bytes at offset 240, though the image ended at",
    ),
    (("readback",), Request.READBACK, lambda old: old[:4] + bytes(240), "READBACK: 240 bytes at offset "),
]


@pytest.mark.parametrize(
    ("command", "request_", "lie", "why"), STATUS_LIES, ids=[why.split(";")[0] for *_, why in STATUS_LIES]
)
def test_a_lie_of_other_answers_is_told(
    tmp_path: Path, info: DeviceInfo, folder: Path, command: tuple[str, ...], request_: int, lie: Lie, why: str
) -> None:
    bench = Bench(model(info, boot=BOOT))
    output = tmp_path / "image.bin"
    if command[0] == "readback":
        assert bench.run("upload", folder).status == 0
        command = (*command, "-o", str(output))
    bench.options["spoil_back"] = lying({request_: lie})
    outcome = told(bench, *command)
    assert outcome.status == INVALID
    assert outcome.err.startswith(f"the device sent an invalid answer: {why}")
    assert not output.exists()


def test_endless_data_names_the_widths(tmp_path: Path, info: DeviceInfo, folder: Path) -> None:
    """The widths allow this many bytes, though ``image_bytes`` announces more."""
    bench = Bench(model(info, boot=BOOT))
    assert bench.run("upload", folder).status == 0
    bench.options["spoil_back"] = lying({Request.READBACK: lambda old: old[:4] + bytes(240)})
    outcome = told(bench, "readback", folder)
    assert f"by the widths in HELLO no image has more than {most_bytes(info)}" in outcome.err


def test_boots_that_change_with_every_answer_end(folder: Path, info: DeviceInfo) -> None:
    bench = Bench(model(info, boot=BOOT))
    assert bench.run("upload", folder).status == 0
    random = Random(1)
    bench.options["spoil_back"] = lying(
        {Request.STATUS: lambda payload: put(4, "I", random.randrange(1 << 32))(payload)}
    )
    outcome = told(bench, "readback", folder)
    assert (outcome.status, "the scan changed while it was read" in outcome.err) == (10, True)


# Uploads

UPLOAD_LIES: list[tuple[int, Lie, int, str]] = [
    (Request.BEGIN, put(0, "I", ALL), INVALID, "BEGIN: received is 4294967295; the image has "),
    (Request.BEGIN, lambda _: b"", INVALID, "BEGIN: its answer has 0 bytes; at least 4 are needed"),
    (Request.DATA, put(0, "I", ALL), INVALID, "DATA: received is 4294967295; the image has "),
    (Request.DATA, put(0, "I", 0), 10, "timeout: by its last answer the device has 0 of "),
    (Request.COMMIT, lambda _: b"\1", INVALID, "COMMIT: its answer has 1 bytes; at least 8 are needed"),
    (Request.COMMIT, put(0, "I", ALL), INVALID, "COMMIT: generation is 4294967295, and that of STATUS after it 2"),
]


@pytest.mark.common
@pytest.mark.parametrize(
    ("request_", "lie", "status", "why"), UPLOAD_LIES, ids=[why.split(";")[0] for *_, why in UPLOAD_LIES]
)
def test_a_lie_during_an_upload_is_told(
    folder: Path, info: DeviceInfo, request_: int, lie: Lie, status: int, why: str
) -> None:
    bench = Bench(model(info, boot=BOOT), spoil_back=lying({request_: lie}))
    outcome = told(bench, "upload", folder, "--as", "table", "--timeout", "5")
    assert outcome.status == status
    assert why in outcome.err


def refusing(kind: int, reason: int, detail: int) -> Callable[[bytes], list[bytes]]:
    """A way back on which answers to one request become refusals."""

    def spoil(piece: bytes) -> list[bytes]:
        frames = FrameReader().feed(piece)
        if not frames or frames[0].type != kind | ANSWER:
            return [piece]
        answer = frames[0]
        return [Frame(REFUSAL, answer.seq, answer.session, Refusal(kind, reason, detail).pack()).encode()]

    return spoil


def test_a_refusal_without_a_reason_is_no_success(info: DeviceInfo) -> None:
    bench = Bench(model(info, boot=BOOT), spoil_back=refusing(Request.PARK, 0, 0))
    outcome = told(bench, "park")
    assert outcome.status == INVALID
    assert f"a refusal of request {Request.PARK:d}: reason is 0; possible: 1 to 255" in outcome.err


def test_an_upload_that_is_complete_and_incomplete_is_told(folder: Path, info: DeviceInfo) -> None:
    bench = Bench(model(info, boot=BOOT), spoil_back=refusing(Request.COMMIT, 12, ALL))
    outcome = told(bench, "upload", folder)
    assert outcome.status == INVALID
    assert "COMMIT refused as incomplete: received is 4294967295; the image has " in outcome.err


def test_a_short_answer_to_abort_is_told() -> None:
    line = VirtualLine(model(), spoil_back=lying({Request.ABORT: lambda _: b"\1"}))
    with client(line) as device, pytest.raises(NotUnderstood, match="ABORT: its answer has 1 bytes; at least 4"):
        device.abort()


def test_limits_may_be_narrower_than_those_of_the_build() -> None:
    with client(VirtualLine(model())) as device:
        narrow = AxisLimits(2000, 60000, 100, 100)
        assert device.narrow(narrow, narrow) == (narrow, narrow) == device.limits()
        wide = AxisLimits(0, ALL, ALL, ALL)
        assert device.narrow(wide, wide) == (INFO.x_limits, INFO.y_limits)


@pytest.mark.common
@pytest.mark.parametrize("seed", range(40))
def test_answers_of_any_bytes_end_in_a_link_error_or_a_result(seed: int) -> None:
    """Whatever field it is: every answer has the right frame, and any bytes in one place of its payload."""
    random = Random(seed)

    def lie(payload: bytes) -> bytes:
        changed = bytearray(payload)
        if changed and random.random() < 0.5:
            at = random.randrange(len(changed))
            changed[at : at + 4] = random.randbytes(min(4, len(changed) - at))
        return bytes(changed[: random.randrange(len(changed) + 1)] if random.random() < 0.05 else changed)

    line = VirtualLine(model(), spoil_back=lying(dict.fromkeys(Request, lie)))
    tracemalloc.start()
    try:
        use(line, seed)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < MEMORY_BYTES
    assert line.now_s < HOUR_S


def use(line: VirtualLine, seed: int) -> None:
    """Everything that a program may ask a device."""
    try:
        device = Device(line.open, random=Random(seed), sleep=line.sleep)
    except LinkError:
        return
    with device:
        for ask in (device.status, device.limits, lambda: device.upload(TABLE), device.readback, device.abort):
            try:
                ask()
            except LinkError:
                continue
