"""Each exit status of the commands that talk to a device, and what is said with it."""

from collections.abc import Iterator
from pathlib import Path
from unittest.mock import patch

import pytest
from building import Variant, build
from client_rig import BOOT, Bench, info_for, model
from editing import run
from replacing import replace

from tablegen.link.frames import FrameReader
from tablegen.link.messages import AxisShape, DeviceInfo, Request
from tablegen.link.prepare import PreparedScan

COMMANDS = ("upload", "status", "readback", "park", "trigger", "clear", "ports")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build(tmp_path_factory.mktemp("example"), Variant({"timing.lines": 40})).folder


@pytest.fixture(scope="module")
def scan(folder: Path) -> PreparedScan:
    return PreparedScan.of_build(folder)


@pytest.fixture
def info(scan: PreparedScan) -> DeviceInfo:
    return info_for(scan)


@pytest.fixture
def bench(info: DeviceInfo) -> Bench:
    return Bench(model(info, boot=BOOT))


@pytest.fixture
def no_environment(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.delenv("TABLEGEN_PORT", raising=False)
    monkeypatch.delenv("TABLEGEN_BAUD", raising=False)
    return


def type_of(piece: bytes) -> int:
    """Of the frame that a piece is."""
    frames = FrameReader().feed(piece)
    return frames[0].type if frames else 0


# Each exit status


@pytest.mark.usefixtures("no_environment")
def test_status_2_wrong_input(tmp_path: Path, folder: Path, bench: Bench) -> None:
    outcome = run("upload", folder)
    assert (outcome.status, outcome.out) == (2, "")
    assert "--port is missing; `tablegen ports` lists" in outcome.err
    for command in ("status", "park", "trigger", "clear"):
        assert "Missing option '--port'" in run(command).err
    assert "give a scan or a build" in bench.run("readback").err
    assert bench.run("upload", tmp_path).err.startswith(f"{tmp_path / 'manifest.json'}: cannot be read")
    assert bench.run("upload", tmp_path / "absent.toml").status == 2
    assert bench.run("upload", folder, "--baud", "1").status == 2
    assert not bench.asked, "nobody was asked"


@pytest.mark.parametrize(
    ("content", "why"),
    [
        (None, "cannot be read: No such file"),
        ("xyz", "32 to 64 hexadecimal digits"),
        ("abc", "32 to 64 hexadecimal digits"),
        ("é", "32 to 64 hexadecimal digits"),
        ("00 11", "the key has 2 bytes"),
        ("00" * 33, "the key has 33 bytes"),
    ],
)
def test_status_2_wrong_key_file(tmp_path: Path, bench: Bench, content: str | None, why: str) -> None:
    path = tmp_path / "key"
    if content is not None:
        path.write_text(content, "utf-8")
    outcome = bench.run("status", "--key-file", path)
    assert (outcome.status, outcome.out) == (2, "")
    assert outcome.err.startswith(f"{path}: ")
    assert why in outcome.err
    assert not bench.asked


def test_status_5_a_device_that_plays_something_else(bench: Bench, folder: Path) -> None:
    status = bench.device.status
    bench.device.status = lambda: replace(status(), hash=bytes(31) + b"\1")  # type: ignore[method-assign]
    outcome = bench.run("upload", folder)
    assert (outcome.status, outcome.out) == (5, "")
    assert "plays 000000000000 instead of" in outcome.err


def test_status_6_without_pyserial(folder: Path) -> None:
    with patch.dict("sys.modules", {"serial": None, "serial.tools.list_ports": None}):
        for command in (("upload", folder, "--port", "x"), ("status", "--port", "x"), ("ports",)):
            outcome = run(*command)
            assert (outcome.status, outcome.out) == (6, "")
            assert outcome.err == "pyserial is missing; pip install 'piezo-tablegen[serial]'\n"


def test_status_7_no_port(tmp_path: Path, folder: Path) -> None:
    absent = tmp_path / "ttyUSB7"
    outcome = run("upload", folder, "--port", absent)
    assert (outcome.status, outcome.out) == (7, "")
    assert outcome.err == (
        f"{absent}: cannot be opened: there is no such port; `tablegen ports` lists the ports of this machine\n"
    )
    assert run("status", "--port", "socket://127.0.0.1:1").status == 7
    assert "and is this a URL that pyserial supports?" in run("status", "--port", "foo://x").err
    with patch("serial.tools.list_ports.comports", list):
        outcome = run("ports")
    assert (outcome.status, outcome.out) == (7, "")
    assert outcome.err.startswith("this machine has no serial port; ")


def test_status_8_no_answer(bench: Bench, folder: Path) -> None:
    bench.options["spoil_out"] = lambda piece: []
    outcome = bench.run("upload", folder)
    assert (outcome.status, outcome.out) == (8, "")
    assert outcome.err.startswith("the port is open, but no device answers: is it on, ")
    bench.options = {"spoil_back": lambda piece: [b"abc\0"]}
    assert "is --baud the rate of the device" in bench.run("status").err


def test_status_9_refused(folder: Path, info: DeviceInfo) -> None:
    """By the device; what can be known is said before anything is sent."""
    jumpy = replace(info.x_limits, max_jump=1)
    bench = Bench(model(replace(info, x_limits=jumpy)))
    outcome = bench.run("upload", folder)
    assert (outcome.status, outcome.out) == (9, "")
    assert outcome.err.startswith("the device refused COMMIT (jump): x: it begins further than 1 codes of the device")
    assert "`tablegen park --wait` first" in outcome.err
    wrong = replace(info, update_rate_hz=1000, x=AxisShape(9, 16, 16, 16))
    bench = Bench(model(wrong))
    outcome = bench.run("upload", folder, "--as", "table")
    assert (outcome.status, outcome.err.count("\n")) == (9, 2)
    assert bench.device.status().received == 0
    assert bench.run("upload", folder, "--as", "table", "--any-rate").err.count("\n") == 1


def test_status_10_link_lost_and_out_of_time(bench: Bench, folder: Path) -> None:
    def fall_silent(piece: bytes) -> list[bytes]:
        return [] if type_of(piece) in (Request.DATA | 0x80, Request.STATUS | 0x80) else [piece]

    bench.options["spoil_back"] = fall_silent
    outcome = bench.run("upload", folder)
    assert (outcome.status, outcome.out) == (10, "")
    bench.options = {"tick_hz": 0}
    outcome = bench.run("upload", folder, "--timeout", "2", "--force")
    assert outcome.status == 10
    assert "has not reached the start of a line" in outcome.err
    assert "increase --timeout" in outcome.err


@pytest.mark.parametrize(("after", "said"), [(0, "continues with its old scan"), (240, "to continue the upload")])
def test_status_130_interrupted(bench: Bench, folder: Path, scan: PreparedScan, after: int, said: str) -> None:
    def interrupt(piece: bytes) -> list[bytes]:
        if bench.device.status().received > after or (after == 0 and type_of(piece) == Request.BEGIN):
            raise KeyboardInterrupt
        return [piece]

    bench.options["spoil_out"] = interrupt
    outcome = bench.run("upload", folder, "--as", "table")
    assert (outcome.status, outcome.out) == (130, "")
    assert outcome.err.startswith("interrupted; the device ")
    assert said in outcome.err
    assert bench.device.status().hash.hex() == BOOT.digest
    bench.options = {}
    outcome = bench.run("upload", folder, "--as", "table")
    assert outcome.status == 0
    assert ("the device already had" in outcome.out) == (after > 0)


INTERRUPTIONS = [
    (("park",), Request.HELLO, "the device continues as before"),
    (("status",), Request.STATUS, "the device continues as before"),
    (("readback", "-o", "x.bin"), Request.READBACK, "the device continues as before"),
    (("park",), Request.PARK, "the device may have carried out PARK: see `tablegen status`"),
    (("trigger",), Request.TRIGGER, "the device may have carried out ARM and TRIGGER: see `tablegen status`"),
    (("clear",), Request.CLEAR, "the device may have carried out CLEAR: see `tablegen status`"),
    (("upload",), Request.LIMITS, "the device continues with its old scan"),
    (("upload",), Request.COMMIT, "everything was sent, and the new scan may become active: see `tablegen status`"),
]


@pytest.mark.parametrize(("command", "request_", "said"), INTERRUPTIONS)
def test_an_interruption_says_what_the_device_may_do(
    bench: Bench, folder: Path, command: tuple[str, ...], request_: Request, said: str
) -> None:
    """Ctrl-C while an answer is on its way; a request that acts has arrived then."""
    if command[0] == "readback":
        assert bench.run("upload", folder).status == 0

    def interrupt(piece: bytes) -> list[bytes]:
        if type_of(piece) == request_ | 0x80:
            raise KeyboardInterrupt
        return [piece]

    bench.options["spoil_back"] = interrupt
    outcome = bench.run(*command, *([folder] if command[0] == "upload" else []))
    assert (outcome.status, outcome.err) == (130, f"interrupted; {said}\n")
