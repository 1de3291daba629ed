"""MOVE in the C link: dialogues against the model, and the lines that play while a scan is moved at random."""

import struct
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from link_device import DeviceLibrary, HostDevice, Line, Started, compile_device
from link_images import resealed
from link_random import KEY, Dialogue, Differs
from link_replay import Replay, compile_replay, differs, line_text
from link_talk import Talk
from moved_scans import BOOT, SCAN, SLOW_SCAN, SLOW_SHAPE, MovedScan
from replacing import replace
from sets import LONG_TEST, one_of
from test_c_link import SHAPES, STEPS

from tablegen.base.resources import c_link, c_runtime
from tablegen.fixedpoint.frame_program import FACTOR_FRACTION_BITS, FrameProgram
from tablegen.link.messages import AxisWords, DeviceInfo, DeviceStatus, More, Move, Reason, Refusal, Request

MOVE, LINK, UPLOAD, REQUESTS, CHECK, PARTS, IMAGE = (
    "dac_link_move.c", "dac_link.c", "dac_link_upload.c", "dac_link_requests.c", "dac_link_check.c", "dac_link_parts.h",
    "dac_link_image.c",
)  # fmt: skip
SLOW = ("-DDAC_SPLINE=1", "-DDAC_SLOW_PART=1")
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
    "moves are not announced": (REQUESTS, "(2u | (dac", "(0u | (dac"),
    "a waiting move is an upload": (REQUESTS, "l->moving && !swapped ? (uint8_t)DAC_LINK_NONE : upload", "upload"),
}  # fmt: skip
SLOW_MUTANTS = {
    "the factor is one of the gains that play": (
        MOVE, "= here->slow[l->playing].gains;", "= l->moved ? l->slow[2 + l->moved_slow][axis].gains "
        ": here->slow[l->playing].gains;"),
    "a move writes gains that play": (MOVE, "    l->moved_slow = (uint8_t)(1u - l->moved_slow);\n", ""),
    "scaled gains are cut off": (MOVE, " + (1 << 15)) >> 16", ") >> 16"),
    "gains may have any size": (MOVE, "if (gain < -(INT32_C(1) << 17) || gain >= INT32_C(1) << 17)", "if (false)"),
    "the factor of x is that of y": (MOVE, "DAC_LINK_MOVE_BYTES + 4 * axis", "DAC_LINK_MOVE_BYTES"),
    "the slow table keeps its gain": (MOVE, "    slow->gain_word = ", "    (void)"),
    "the slow table keeps its offset": (MOVE, "    slow->offset_word = ", "    (void)"),
    "factors may be too many": (MOVE, "!= has_factors)", "!= has_factors && !has_factors)"),
    "moved gains are not read back": (IMAGE, "if (l->moved && ", "if (false && "),
    "moved slow tables are not checked": (CHECK, "#define MOVED_WORDS SLOW_WORD", "#define MOVED_WORDS RANGE"),
    "moves of slow parts are not announced": (REQUESTS, "dac_link_moves_slow((l)->config) ? 32u : 0u", "0u"),
}  # fmt: skip


def _random(library: DeviceLibrary | None, keys: tuple[bytes, ...], seeds: range, slow: bool = False) -> Counter[Any]:
    seen: Counter[Any] = Counter()
    for key in keys:
        for seed in seeds:
            how: dict[str, Any] = {} if library is None else {"library": library}
            dialogue = Dialogue(SLOW_SHAPE if slow else SHAPES["16 bits"], seed, key, moves=True, slow=slow, **how)
            dialogue.play(STEPS)
            seen += dialogue.seen
    return seen


def _device(slow: bool, library: DeviceLibrary | None = None) -> HostDevice:
    how: dict[str, Any] = {"moves": True, "slow": slow} if library is None else {"library": library}
    return HostDevice(SLOW_SCAN if slow else BOOT.program, BOOT.program, index_bits=(7, 6), **how)


def _scan(seed: int, library: DeviceLibrary | None = None, slow: bool = False) -> MovedScan:
    return MovedScan(_device(slow, library), seed, slow)


@pytest.mark.common
def test_random_dialogues_with_moves_are_those_of_the_model() -> None:
    seen = _random(None, (b"", KEY), range(300, 306))
    assert seen[Request.MOVE] > 10
    for reason in (Reason.BUSY, Reason.GENERATION, Reason.RANGE, Reason.SLEW, Reason.KEY, Reason.READBACK):
        assert seen[Request.MOVE, reason] > 0, reason


@pytest.mark.rest
def test_random_dialogues_with_moves_of_slow_parts_are_those_of_the_model() -> None:
    seen = _random(None, (b"", KEY), range(300, 305), slow=True)
    assert seen[Request.MOVE, "slow"] > 10
    for reason in (Reason.SLOW_PART, Reason.WORD, Reason.RANGE, Reason.SLEW, Reason.KEY, Reason.READBACK):
        assert seen[Request.MOVE, reason] > 0, reason


@pytest.mark.rest
@pytest.mark.parametrize("name", one_of(3, SHAPES))
@pytest.mark.parametrize("store", [False, True], ids=["", "store"])
def test_random_dialogues_of_other_devices_are_those_of_the_model(name: str, store: bool) -> None:
    for key in (b"", KEY):
        for seed in range(320, 322):
            Dialogue(SHAPES[name], seed, key, store=store, moves=True).play(STEPS)


@pytest.mark.parametrize("slow", [False, True], ids=["straight", "slow parts"])
@pytest.mark.parametrize("moves", [pytest.param(300, marks=pytest.mark.common), pytest.param(100_000, marks=LONG_TEST)])
def test_every_line_of_a_scan_that_is_moved_is_whole_and_within_its_limits(moves: int, slow: bool) -> None:
    scan = _scan(1, slow=slow)
    scan.play(moves)
    assert scan.seen["MOVED"] > moves // 4
    assert scan.seen["RANGE"] > 0
    assert scan.seen["BUSY"] > 0
    assert scan.check.lines > moves // 2


class _Noted:
    """A device that takes notes, with all that it has sent and played."""

    def __init__(self, slow: bool) -> None:
        self.device = _device(slow)
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
@pytest.mark.parametrize("slow", [False, True], ids=["straight", "slow parts"])
@pytest.mark.parametrize("moves", [2000, pytest.param(100_000, marks=LONG_TEST)])
def test_the_same_moves_on_another_processor(moves: int, slow: bool, tmp_path: Path) -> None:
    """A big-endian one of 32 bits, in QEMU: the same bytes and the same lines, of which each was checked here."""
    noted = _Noted(slow)
    scan = MovedScan(noted, 3, slow)
    scan.play(moves)
    lines = [line_text(line) for line in noted.played]
    assert noted.device.notes is not None
    replay = Replay(16, "\n".join(noted.device.notes) + "\n", noted.heard.hex(), tuple(lines))
    options = ("-std=c99", "-O2", "-static", "-DDAC_MOVE=1", *(SLOW if slow else ()))
    program = compile_replay(tmp_path / "replay", 16, ("mips-linux-gnu-gcc",), options)
    assert differs(program, replay, "qemu-mips") is None


def _slow_table_beyond_its_words(library: DeviceLibrary | None = None) -> Refusal:
    """What a device says of a MOVE whose offset is in range, and with that of the slow table of x is not."""
    scan, x, y = _scan(1, library, slow=True), SLOW_SCAN.x, SLOW_SCAN.y
    assert isinstance(x, FrameProgram)
    assert isinstance(y, FrameProgram)
    most = (2 << (x.output.dac_bits + x.output.gain_q)) - 1
    words = [AxisWords(axis.slow.gain_word, axis.slow.offset_word, 1 << FACTOR_FRACTION_BITS) for axis in (x, y)]
    payload = Move(2, replace(words[0], offset_word=most), words[1]).pack()
    scan.device.receive(scan.talk.acting(Request.MOVE, payload))
    for _ in range(100):
        scan.device.tick(1)
        if answers := scan.talk.answers(scan.device.transmit()):
            return Refusal.unpack(answers[0].payload)
    raise AssertionError


@pytest.mark.common
def test_a_slow_table_is_moved_within_its_words() -> None:
    """An offset of a line has as many bits as an offset word."""
    words = np.asarray(SLOW_SCAN.x.slow.words) * SLOW_SCAN.x.slow.gain_word  # type: ignore[union-attr]
    first = 2 * len(SLOW_SCAN.x.fast.words) + int(np.flatnonzero(words > 0)[0])  # type: ignore[union-attr]
    assert _slow_table_beyond_its_words() == Refusal(Request.MOVE, Reason.WORD, 2 * first)


def test_memory_of_moved_gains_is_whole_or_missing() -> None:
    device = _device(slow=True)
    faults = [device.refusal(fault) for fault in range(67, 71)]
    assert faults == [Started.BAD_SLOW, Started.BAD_SLOW, Started.BAD_SLOW, Started.STARTED]


def _try_all(library: DeviceLibrary, slow: bool) -> None:
    assert not slow or _slow_table_beyond_its_words(library).reason == Reason.WORD
    _scan(1, library, slow).play(100)
    _random(library, (b"", KEY), range(300, 340), slow=slow)


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
@pytest.mark.parametrize("name", one_of(3, MUTANTS | SLOW_MUTANTS))
def test_a_wrong_link_is_noticed(name: str, tmp_path: Path) -> None:
    slow = name in SLOW_MUTANTS
    file, old, new = (SLOW_MUTANTS if slow else MUTANTS)[name]
    sources = []
    for source in (*c_runtime(), *c_link()):
        text = source.read_text("utf-8")
        if source.name == file:
            assert text.count(old) == 1, f"{file}: {old}"
            text = text.replace(old, new)
        (tmp_path / source.name).write_text(text, "utf-8")
        sources.append(tmp_path / source.name)
    options = ["-DDAC_COMMIT_MODES=1", "-DDAC_MOVE=1", *(SLOW if slow else ())]
    library = DeviceLibrary(compile_device(tmp_path / "device.so", sources=sources, more=options))
    with pytest.raises((Differs, AssertionError)):
        _try_all(library, slow)
