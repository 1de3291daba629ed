"""MOVE in the C link: dialogues against the model, and the lines that play while a scan is moved at random."""

import struct
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from link_device import DeviceLibrary, HostDevice, Line, compile_device
from link_images import resealed
from link_random import KEY, Dialogue, Differs
from link_replay import Replay, compile_replay, differs, line_text
from link_talk import Talk
from moved_scans import BOOT, SCAN, MovedScan
from sets import LONG_TEST, one_of
from test_c_link import SHAPES, STEPS

from tablegen.base.resources import c_link, c_runtime
from tablegen.link.messages import DeviceInfo, DeviceStatus, More, Move, Reason, Refusal, Request

MOVE, LINK, UPLOAD, REQUESTS, CHECK, PARTS = (
    "dac_link_move.c", "dac_link.c", "dac_link_upload.c", "dac_link_requests.c", "dac_link_check.c", "dac_link_parts.h"
)  # fmt: skip
MUTANTS = {
    "words of another generation": (MOVE, "dac_link_get(payload) != generation", "false"),
    "a move while a program waits": (
        MOVE, "l->upload > DAC_LINK_RECEIVING || !dac_sequencer_writable(l->sequencer)", "false"),
    "the program of the firmware is moved": (MOVE, "if (!l->uploaded)", "if (false)"),
    "a move ignores the interlock": (MOVE, "if (!dac_link_permits(l))", "if (false)"),
    "the hash stays": (MOVE, "image->info[DAC_LINK_HASH + i] = 0;", "(void)i;"),
    "the words of x go to y": (MOVE, "payload + 4 + AXIS_BYTES * axis", "payload + 4"),
    "a move is no commit of its own number": (MOVE, "    l->commit_seq = l->last.seq;\n", ""),
    "a move begins a frame": (MOVE, "l->commit_mode = DAC_COMMIT_KEEP;", "l->commit_mode = DAC_COMMIT_LINE;"),
    "a moved program is not read back": (MOVE, "    l->image[l->playing] = l->image[MOVED_IMAGE];\n", ""),
    "a moved program is not called so": (MOVE, "    l->moved = true;\n", ""),
    "a move ends an upload": (MOVE, "withdrawn ? (uint8_t)DAC_LINK_NONE : l->upload_before", "DAC_LINK_NONE"),
    "an upload survives an abort of a move": (
        MOVE, "withdrawn ? (uint8_t)DAC_LINK_NONE : l->upload_before", "l->upload_before"),
    "an upload writes the tables that play": (
        UPLOAD, "l->uploaded ? (uint8_t)(1u - l->playing) : 0", "(uint8_t)dac_sequencer_idle(l->sequencer)"),
    "an upload goes on in the moved image": (MOVE, "    l->idle = (uint8_t)(1u - l->playing);\n", ""),
    "the moved image is that of the tables that play": (PARTS, "l->moving ? l->playing : l->idle", "l->playing"),
    "an upload is still called moved": (UPLOAD, "            l->moved = false;\n", ""),
    "a moved image is committed again": (UPLOAD, "if (l->upload == DAC_LINK_NONE && l->moved)", "if (false)"),
    "a move is answered as a commit": (
        UPLOAD, "            request = DAC_LINK_MOVE;\n        } else", "        } else"),
    "a move is refused as a commit": (UPLOAD, "        request = DAC_LINK_MOVE;\n    }\n#endif\n    dac_link_refuse",
                                      "    }\n#endif\n    dac_link_refuse"),
    "a move needs no tag": (LINK, "(UINT32_C(1) << DAC_LINK_MOVE)", "0u"),
    "kept programs are known": (LINK, "(request) > DAC_LINK_LIMITS && (request) < DAC_LINK_MOVE", "false"),
    "tables are received again": (CHECK, "        if (l->moving) { /* nothing", "        if (false) { /* nothing"),
    "a move needs the tag of an image": (CHECK, "    if (l->moving)\n        return true;\n", ""),
    "moves are not announced": (REQUESTS, "(DAC_MOVE ? 2u : 0u)", "0u"),
    "a waiting move is an upload": (REQUESTS, "l->moving && !swapped ? (uint8_t)DAC_LINK_NONE : upload", "upload"),
}  # fmt: skip


def _random(library: DeviceLibrary | None, keys: tuple[bytes, ...], seeds: range) -> Counter[Any]:
    seen: Counter[Any] = Counter()
    for key in keys:
        for seed in seeds:
            how: dict[str, Any] = {} if library is None else {"library": library}
            dialogue = Dialogue(SHAPES["16 bits"], seed, key, moves=True, **how)
            dialogue.play(STEPS)
            seen += dialogue.seen
    return seen


def _scan(seed: int, library: DeviceLibrary | None = None) -> MovedScan:
    how: dict[str, Any] = {"moves": True} if library is None else {"library": library}
    return MovedScan(HostDevice(BOOT.program, BOOT.program, **how), seed)


@pytest.mark.common
def test_random_dialogues_with_moves_are_those_of_the_model() -> None:
    seen = _random(None, (b"", KEY), range(300, 306))
    assert seen[Request.MOVE] > 10
    for reason in (Reason.BUSY, Reason.GENERATION, Reason.RANGE, Reason.SLEW, Reason.KEY, Reason.READBACK):
        assert seen[Request.MOVE, reason] > 0, reason


@pytest.mark.rest
@pytest.mark.parametrize("name", one_of(3, SHAPES))
@pytest.mark.parametrize("store", [False, True], ids=["", "store"])
def test_random_dialogues_of_other_devices_are_those_of_the_model(name: str, store: bool) -> None:
    for key in (b"", KEY):
        for seed in range(320, 322):
            Dialogue(SHAPES[name], seed, key, store=store, moves=True).play(STEPS)


@pytest.mark.parametrize("moves", [pytest.param(300, marks=pytest.mark.common), pytest.param(100_000, marks=LONG_TEST)])
def test_every_line_of_a_scan_that_is_moved_is_whole_and_within_its_limits(moves: int) -> None:
    scan = _scan(1)
    scan.play(moves)
    assert scan.seen["MOVED"] > moves // 3
    assert scan.seen["RANGE"] > 0
    assert scan.seen["BUSY"] > 0
    assert scan.check.lines > moves // 2


class _Noted:
    """A device that takes notes, with all that it has sent and played."""

    def __init__(self) -> None:
        self.device = HostDevice(BOOT.program, BOOT.program, moves=True)
        self.device.take_notes()
        self.heard, self.played = bytearray(), []  # type: ignore[var-annotated]
        self.receive, self.tick = self.device.receive, self.device.tick

    def transmit(self) -> bytes:
        """Bytes to the host."""
        sent = self.device.transmit()
        self.heard += sent
        return sent

    def lines(self) -> list[Line]:
        """The lines that ended since the last call."""
        lines = self.device.lines()
        self.played += lines
        return lines


@pytest.mark.rest
@pytest.mark.parametrize("moves", [2000, pytest.param(100_000, marks=LONG_TEST)])
def test_the_same_moves_on_another_processor(moves: int, tmp_path: Path) -> None:
    """A big-endian one of 32 bits, in QEMU: the same bytes and the same lines, of which each was checked here."""
    noted = _Noted()
    scan = MovedScan(noted, 3)
    scan.play(moves)
    lines = [line_text(line) for line in noted.played]
    assert noted.device.notes is not None
    replay = Replay(16, "\n".join(noted.device.notes) + "\n", noted.heard.hex(), tuple(lines))
    options = ("-std=c99", "-O2", "-static", "-DDAC_MOVE=1")
    program = compile_replay(tmp_path / "replay", 16, ("mips-linux-gnu-gcc",), options)
    assert differs(program, replay, "qemu-mips") is None


def _try_all(library: DeviceLibrary) -> None:
    _scan(1, library).play(100)
    _random(library, (b"", KEY), range(300, 340))


def _ask(device: HostDevice, talk: Talk, wire: bytes) -> Any:
    device.receive(wire)
    (answer,) = talk.answers(device.transmit())
    return answer


def test_a_device_without_moves_does_not_know_them() -> None:
    device, talk = HostDevice(BOOT.program, BOOT.program, modes=True), Talk()
    assert DeviceInfo.unpack(_ask(device, talk, talk.hello()).payload).more == More(0)
    refused = _ask(device, talk, talk.acting(Request.MOVE, bytes(Move.LAYOUT.size)))
    assert Refusal.unpack(refused.payload).reason == Reason.TYPE


def test_a_program_with_a_slow_part_is_not_moved() -> None:
    device, talk = HostDevice(BOOT.program, BOOT.program, moves=True), Talk()
    assert DeviceInfo.unpack(_ask(device, talk, talk.hello()).payload).more == More.MOVE
    device.tick(1)
    image = SCAN.image(False)
    data = bytearray(image.data)
    data[4 * (2 * 16 + 12)] = 3  # the word of y
    changed = resealed(image, bytes(data))
    for wire in talk.upload(changed):
        _ask(device, talk, wire)
    device.receive(talk.commit(changed))
    device.tick(1000)
    (taken,) = talk.answers(device.transmit())
    assert struct.unpack_from("<I", taken.payload) == (2,)
    refused = _ask(device, talk, talk.acting(Request.MOVE, struct.pack("<I", 2) + bytes(24)))
    refusal = Refusal.unpack(refused.payload)
    assert (refusal.reason, refusal.detail) == (Reason.SLOW_PART, 1)
    status = DeviceStatus.unpack(_ask(device, talk, talk.request(Request.STATUS)).payload)
    assert (status.generation, status.moved, status.hash) == (2, False, changed.info.hash)


@pytest.mark.rest
@pytest.mark.parametrize("name", one_of(3, MUTANTS))
def test_a_wrong_link_is_noticed(name: str, tmp_path: Path) -> None:
    file, old, new = MUTANTS[name]
    sources = []
    for source in (*c_runtime(), *c_link()):
        text = source.read_text("utf-8")
        if source.name == file:
            assert text.count(old) == 1, f"{file}: {old}"
            text = text.replace(old, new)
        (tmp_path / source.name).write_text(text, "utf-8")
        sources.append(tmp_path / source.name)
    options = ["-DDAC_COMMIT_MODES=1", "-DDAC_MOVE=1"]
    library = DeviceLibrary(compile_device(tmp_path / "device.so", sources=sources, more=options))
    with pytest.raises((Differs, AssertionError)):
        _try_all(library)
