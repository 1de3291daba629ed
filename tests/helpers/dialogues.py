"""Golden dialogues: what a device has to answer, byte for byte (``golden_dialogues.json``)."""

import json
from pathlib import Path
from typing import Any, Protocol

from tablegen.device.dual_program import DualProgram
from tablegen.link.frames import FrameReader
from tablegen.link.messages import DeviceInfo
from tablegen.link.model_bank import program_of
from tablegen.link.program_image import take_apart

GOLDEN: dict[str, Any] = json.loads(Path(__file__).with_name("golden_dialogues.json").read_text("utf-8"))
START_TICKS = 200


class Talks(Protocol):
    """A device, or a model of one."""

    permits: bool

    def receive(self, data: bytes) -> None:
        """Bytes from the host."""

    def transmit(self) -> bytes:
        """Bytes to the host."""

    def tick(self, ticks: int) -> None:
        """Samples."""

    def reboot(self) -> None:
        """Start again."""


def boot_program(device: dict[str, Any]) -> DualProgram:
    """What one of the devices of the file starts with."""
    info = DeviceInfo.unpack(bytes.fromhex(device["device"]))
    return program_of(take_apart(bytes.fromhex(device["boot_image"]), info.x, info.y), info.update_rate_hz)


def hold(dialogue: dict[str, Any], device: Talks) -> None:
    """Have a whole dialogue with a device that was just made.

    Raises ``AssertionError`` at the first step whose answers are others.
    """
    info = bytes.fromhex(GOLDEN["devices"][dialogue["device"]]["device"])
    reader = FrameReader()
    device.tick(START_TICKS)
    for step in dialogue["steps"]:
        device.permits = step.get("permit", device.permits)
        if step.get("reboot"):
            device.reboot()
        device.receive(bytes.fromhex(step["wire"]))
        device.tick(step.get("ticks", 0))
        answers = [
            (frame.type, frame.seq, frame.session, frame.payload.hex()) for frame in reader.feed(device.transmit())
        ]
        expected = [
            (one["type"], one["seq"], one["session"], (info.hex() if one.get("device") else "") + one["payload"])
            for one in step["answers"]
        ]
        assert len(answers) == len(expected), (dialogue["name"], step["note"], answers, expected)
        for (*header, payload), (*wanted, pattern) in zip(answers, expected, strict=True):
            free = "".join(a if b != "?" else b for a, b in zip(payload, pattern, strict=False))
            same = header == wanted and len(payload) == len(pattern) and free == pattern
            assert same, (dialogue["name"], step["note"], [*header, payload], [*wanted, pattern])
    assert reader.bad_frames == 0, dialogue["name"]


def dialogues(*lacking: str) -> list[dict[str, Any]]:
    """Those for a device that lacks some of what ``needs`` names."""
    return [dialogue for dialogue in GOLDEN["dialogues"] if not set(dialogue["needs"]) & set(lacking)]
