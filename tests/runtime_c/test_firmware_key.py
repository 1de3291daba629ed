"""The key of the reference firmware: how it gets in, who can read it, what a recording is worth after a power cycle."""

import os
import socket
import subprocess
import sys
from pathlib import Path

import pytest
from building import REMOVED, REPOSITORY, VARIANTS, Variant, write_variant
from limits import PATIENCE_S
from link_qemu import LinkMachine
from link_talk import Talk, is_answer

from tablegen.link.frames import Frame
from tablegen.link.messages import ANSWER, DeviceState, DeviceStatus, Request

pytestmark = pytest.mark.rest

FIRMWARE = REPOSITORY / "examples" / "firmware" / "cortex_m"
KEY = bytes(range(0xA0, 0xB8))
BOARD = "lm3s6965evb"


def make(folder: Path, key: Path, *more: str) -> subprocess.CompletedProcess[str]:
    """The firmware of a short scan, with a key."""
    scan = write_variant(folder / "scan", Variant({**VARIANTS["short_frame"].scan, "limits": REMOVED}))
    options = [f"SCAN={scan}", f"BUILD={folder / 'build'}", f"KEY_FILE={key}", f"TABLEGEN={sys.executable} -m tablegen"]
    command = ["make", "-C", str(FIRMWARE), f"BOARD={BOARD}", *options, *more]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def key_file(path: Path, text: str, mode: int = 0o600) -> Path:
    path.write_text(text, "ascii")
    path.chmod(mode)
    return path


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("keyed")


def traces(content: bytes) -> bool:
    """Whether a text or a binary has the key in it, in any of the forms that it goes through."""
    forms = (KEY, KEY.hex().encode(), b",".join(b"0x%02x" % byte for byte in KEY))
    return any(form in content.lower() for form in (*forms, *(form.lower() for form in forms))) or KEY in content


def test_the_key_is_on_no_command_line_and_in_no_file_that_others_can_read(folder: Path) -> None:
    done = make(folder, key_file(folder / "key.hex", KEY.hex()[:20] + "\n" + KEY.hex()[20:] + "\n"))
    assert done.returncode == 0, done.stderr
    assert "scan_link.c" in done.stdout, "commands are shown"
    assert not traces((done.stdout + done.stderr).encode())
    assert "can read the key" not in done.stderr
    keyed = [path for path in (folder / "build").rglob("*") if path.is_file() and traces(path.read_bytes())]
    assert {path.name for path in keyed} == {"link_key.h", "scan_link.o", "firmware.elf"}
    assert [path.name for path in keyed if path.stat().st_mode & 0o077] == []


def test_another_key_is_another_firmware(tmp_path: Path) -> None:
    """Also if its file is older; and one that is no key stops the build."""
    key = key_file(tmp_path / "key.hex", bytes(16).hex(), 0o644)
    first = make(tmp_path, key)
    assert first.returncode == 0
    assert f"warning: {key}: others can read the key" in first.stderr
    key_file(key, KEY.hex())
    os.utime(key, (1, 1))
    assert make(tmp_path, key).returncode == 0
    assert traces((tmp_path / "build" / "firmware.elf").read_bytes())
    assert "scan_link.c" in make(tmp_path, key_file(key, KEY.hex()[::-1])).stdout
    assert "arm-none-eabi-gcc" not in make(tmp_path, key).stdout, "the same key compiles nothing"
    for text in ("", "0011", KEY.hex() + "0", KEY.hex() + "xy", bytes(33).hex()):
        done = make(tmp_path, key_file(key, text))
        assert done.returncode != 0
        assert "16 to 32 bytes in hexadecimal" in done.stderr


class Wire:
    """A raw line to the firmware, on which everything can be written down."""

    def __init__(self, port: int) -> None:
        self.line = socket.create_connection(("127.0.0.1", port), PATIENCE_S)
        self.talk = Talk(key=KEY)
        self.sent: list[bytes] = []

    def greet(self, wire: bytes) -> Frame:
        """HELLO, repeated: the firmware throws away what comes before it listens."""
        self.sent.append(wire)
        self.line.settimeout(1.0)
        while True:
            self.line.sendall(wire)
            try:
                answer = self._answer()
            except TimeoutError:
                continue
            self.line.settimeout(PATIENCE_S)
            return answer

    def ask(self, wire: bytes) -> Frame:
        self.sent.append(wire)
        self.line.sendall(wire)
        while (answer := self._answer()).type == Request.HELLO | ANSWER:
            pass  # of a HELLO that was repeated
        return answer

    def _answer(self) -> Frame:
        while received := self.line.recv(4096):
            for frame in self.talk.answers(received):
                return frame
        raise AssertionError("QEMU has ended")


def test_a_recorded_trigger_is_worth_nothing_after_a_power_cycle(folder: Path) -> None:
    """In QEMU, whose memory begins anew: the boot count of the firmware is the same again."""
    executable = folder / "build" / "firmware.elf"
    if not executable.exists():
        assert make(folder, key_file(folder / "key.hex", KEY.hex())).returncode == 0
    with LinkMachine(BOARD, executable, semihosting=True) as machine:
        wire = Wire(machine.port)
        boots = [DeviceStatus.unpack(wire.greet(wire.talk.hello()).payload[56:]).boot]
        for kind, payload in ((Request.ARM, bytes(4)), (Request.TRIGGER, b"")):
            nonce = wire.ask(wire.talk.request(Request.CHALLENGE)).payload
            assert is_answer(wire.ask(wire.talk.acting(kind, payload, nonce)), kind)
        recorded = list(wire.sent)
        machine.wait_for(lambda line: bool(line.markers & 64), lambda lines: None)
    with LinkMachine(BOARD, executable, semihosting=True) as machine:
        wire = Wire(machine.port)
        types = [wire.greet(recorded[0]).type, *(wire.ask(each).type for each in recorded[1:])]
        boots.append(DeviceStatus.unpack(wire.ask(wire.talk.request(Request.STATUS)).payload).boot)
        status = DeviceStatus.unpack(wire.ask(wire.talk.request(Request.STATUS)).payload)
    assert boots[0] == boots[1], "what would let challenges come again"
    assert types == [Request.HELLO | ANSWER, Request.CHALLENGE | ANSWER, 0xFF, Request.CHALLENGE | ANSWER, 0xFF]
    assert status.state is not DeviceState.PLAYING
