"""LIST and PLAY in the C link: dialogues against the model, and what only a device has: its converters, its flash."""

import struct
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from kept_dialogues import COMPILED, FIRMWARE, SCANS, StoreDevice, new_flash
from link_device import CompiledProgram, DeviceLibrary, HostDevice, compile_device
from link_programs import make_scan
from link_random import KEY, Dialogue, Differs
from link_talk import Talk
from replacing import replace
from sets import one_of
from test_c_link import SHAPES, STEPS

from tablegen.base.resources import c_link, c_runtime, c_store
from tablegen.device.commit_mode import CommitMode
from tablegen.link.messages import REFUSAL, DeviceInfo, DeviceStatus, Listing, More, Reason, Refusal, Request, Upload

OTHER = make_scan(5, lines=8)
LIBRARY, LINK, UPLOAD, REQUESTS = "dac_link_library.c", "dac_link.c", "dac_link_upload.c", "dac_link_requests.c"
MUTANTS = {
    "a mode that is none": (LINK, "good = payload[2] <= MOST_MODE;", "good = true;"),
    "a play needs no tag": (LINK, "(UINT32_C(1) << DAC_LINK_PLAY)", "0u"),
    "a device without programs lists them": (LINK, "request > DAC_LINK_MOVE && dac_link_numbers(l) == 0", "false"),
    "a move is known": (LINK, "(!DAC_MOVE && request == DAC_LINK_MOVE)", "false"),
    "numbers are not announced": (REQUESTS, "dac_link_numbers(l) != 0 ? (uint32_t)PLAYS_NUMBERS : 0u", "0u"),
    "numbers are always announced": (REQUESTS, "dac_link_numbers(l) != 0 ? (uint32_t)PLAYS_NUMBERS : 0u", "8u"),
    "a play while a program waits": (
        LIBRARY, "l->upload > DAC_LINK_RECEIVING || !dac_sequencer_writable(l->sequencer)", "false"),
    "a number without a program": (
        LIBRARY, "if (!dac_link_list(l, number, &listing))\n        return dac", "if (0)\n return dac"),
    "a play ignores the interlock": (
        LIBRARY, "    if (!dac_link_permits(l))\n        return dac_link_because(DAC_LINK_INTERLOCK, 0);\n", ""),
    "an upload in hand goes on with other bytes": (LIBRARY, "    l->upload = DAC_LINK_NONE; /* what", "    /* what"),
    "a play has the number of another request": (LIBRARY, "        l->commit_seq = l->last.seq;\n", ""),
    "a play is of another session": (LIBRARY, "        l->commit_session = l->session;\n", ""),
    "a play is not remembered": (LIBRARY, "l->asked = l->commit_is_last = true;", "l->asked = true;"),
    "a play is answered at once": (LIBRARY, "        a->type = DAC_LINK_SILENT;\n", ""),
    "a play has no answer": (LIBRARY, "l->asked = l->commit_is_last = true;", "l->commit_is_last = true;"),
    "every play at a line": (LIBRARY, "    l->commit_mode = mode;\n", "    (void)mode;\n    l->commit_mode = 0;\n"),
    "numbers of one byte": (LIBRARY, "payload[0] | (uint32_t)payload[1] << 8", "payload[0]"),
    "an empty slot is listed": (LIBRARY, "listed ? 1 : 0", "1"),
    "names are a byte shorter": (LIBRARY, "length < LONGEST", "length < LONGEST - 1"),
    "a name without its length": (LIBRARY, "    a->payload[5] = length;\n", "    a->payload[5] = 0;\n"),
    "slots count as compiled": (LIBRARY, "put_number(a->payload + 2, l->config->library_programs)",
                                "put_number(a->payload + 2, dac_link_numbers(l))"),
    "the shape of x is that of y": (LIBRARY, "DAC_LINK_REFUSED, (uint32_t)loaded", "DAC_LINK_SHAPE, 0"),
    "a play is answered as a commit": (
        UPLOAD, "            request = DAC_LINK_PLAY;", "            request = DAC_LINK_COMMIT;"),
    "a play is refused as a commit": (UPLOAD, "    if (l->asked)\n        request = DAC_LINK_PLAY;\n", ""),
    "a refused play leaves an upload": (
        UPLOAD, "        upload = DAC_LINK_NONE;\n        l->loading = l->asked", "        l->loading = l->asked"),
    "what follows a play is one too": (UPLOAD, "        l->loading = l->asked = false;", "        l->loading = false;"),
    "no upload needs a tag behind a play": (UPLOAD, "l->loading = l->asked = false;", "l->asked = false;"),
}  # fmt: skip


def _random(
    library: DeviceLibrary | None, seeds: range, modes: tuple[bool, ...] = (False, True), shape: str = "16 bits"
) -> Counter[Any]:
    """Dialogues with a device that keeps programs and has modes of a COMMIT, or not, with a key and without."""
    how: dict[str, Any] = {} if library is None else {"library": library}
    seen: Counter[Any] = Counter()
    for with_modes in modes:
        for seed in seeds:
            key = KEY if seed % 2 else b""
            dialogue = Dialogue(SHAPES[shape], seed, key, store=seed % 3 != 0, modes=with_modes, plays=True, **how)
            dialogue.play(STEPS)
            if dialogue.flashes and dialogue.flashes[0].cells != dialogue.flashes[1].cells:
                raise Differs("the flash of the device is not that of its model")
            seen += dialogue.seen
    return seen


@pytest.mark.common
def test_random_dialogues_about_numbers_are_those_of_the_model() -> None:
    seen = _random(None, range(500, 514))
    assert min(seen[Request.LIST], seen[Request.PLAY], seen[Request.LIST, Reason.NUMBER]) > 10
    reasons = (Reason.NUMBER, Reason.PAYLOAD, Reason.BUSY, Reason.KEY, Reason.INTERLOCK, Reason.WITHDRAWN, Reason.KEEP)
    for reason in reasons:
        assert seen[Request.PLAY, reason] > 0, reason


@pytest.mark.rest
@pytest.mark.parametrize("shape", one_of(2, (shape for shape in SHAPES if shape != "16 bits")))
def test_random_dialogues_of_other_shapes(shape: str) -> None:
    assert _random(None, range(520, 524), (False,), shape)[Request.PLAY]


@pytest.mark.rest
def test_random_dialogues_with_moves() -> None:
    for seed in range(530, 534):
        Dialogue(SHAPES["16 bits"], seed, KEY if seed % 2 else b"", store=True, moves=True, plays=True).play(STEPS)


def asked(device: HostDevice, talk: Talk, number: int, mode: CommitMode = CommitMode.LINE) -> Refusal | int:
    """Ask for a program; the generation that it began, or the refusal."""
    device.receive(talk.acting(Request.PLAY, struct.pack("<HB", number, mode)))
    device.tick(1000)
    answers = talk.answers(device.transmit())
    assert len(answers) == 1
    payload = answers[0].payload
    assert answers[0].type in (REFUSAL, Request.PLAY | 0x80)
    return Refusal.unpack(payload) if answers[0].type == REFUSAL else int.from_bytes(payload[:4], "little")


def _refused(device: StoreDevice, number: int) -> tuple[int, int, int]:
    """Ask for a program that is refused: request, reason and detail."""
    refusal = asked(device.device, device.talk, number)
    assert isinstance(refusal, Refusal)
    return refusal.type, refusal.reason, refusal.detail


def check_numbers(library: DeviceLibrary | None = None) -> None:
    """Compiled programs and slots play by their numbers, and nothing is written into flash for it."""
    flash = new_flash()
    device = StoreDevice(flash, library, compiled=COMPILED[:2], by_number=True)
    device.upload(SCANS[4])
    assert device.save(1) == 0
    events = flash.events
    listed = [Listing.unpack(device.ask(Request.LIST, struct.pack("<H", number))) for number in range(5)]
    assert [(each.numbers, each.compiled) for each in listed] == [(5, 2)] * 5
    assert [each.name for each in listed] == [b"scan_1", b"scan_2", b"", b"", b""]
    assert [each.content for each in listed] == [1, 1, 0, 1, 0]
    assert [each.hash.hex() for each in listed[:2]] == [SCANS[1].digest, SCANS[2].digest]
    for number, scan in ((0, 1), (3, 4), (1, 2)):
        generation = device.status().generation
        assert asked(device.device, device.talk, number) == generation + 1
        assert (device.plays(), device.status().upload) == (scan, Upload.NONE)
    for number in (2, 4, 5, 256, 0xFFFF):
        assert _refused(device, number) == (Request.PLAY, Reason.NUMBER, 5)
    assert flash.events == events
    device.restart()
    assert device.plays() == 0, "a start is as it was"


def check_of_another_kind(library: DeviceLibrary | None = None) -> None:
    """A compiled program for another converter, or with a longer table, is refused with its reason."""
    program = SCANS[2].program
    coded = replace(program, y=replace(program.y, output=replace(program.y.output, coding="twos-complement")))
    longer = make_scan(3, index_bits=(6, 8)).program
    others = tuple(CompiledProgram(b"other", SCANS[2].digest.encode(), each) for each in (coded, longer))
    device = StoreDevice(new_flash(), library, compiled=others, by_number=True)
    assert _refused(device, 0)[1] == Reason.REFUSED
    assert _refused(device, 1) == (Request.PLAY, Reason.SHAPE, 1)
    assert (device.plays(), device.status().upload) == (0, Upload.NONE)


def check_upload_in_hand(library: DeviceLibrary | None = None) -> None:
    """What was received of an upload is forgotten, even of the image that a slot has."""
    device = StoreDevice(new_flash(), library, by_number=True)
    device.upload(SCANS[1])
    assert device.save(0) == 0
    image = device.ask(Request.SLOT, bytes([0]))[12:]
    device.upload(SCANS[2])
    device.device.receive(device.talk.request(Request.BEGIN, image))
    device.device.receive(device.talk.request(Request.DATA, bytes(4 + 100)))
    device.device.transmit()
    assert device.status().received == 100
    assert asked(device.device, device.talk, 0) == 4
    assert device.plays() == 1


def check_no_programs(library: DeviceLibrary | None = None) -> None:
    """A device without programs has neither feature nor requests."""
    how: dict[str, Any] = {"plays": True} if library is None else {"library": library}
    device, talk = HostDevice(FIRMWARE.program, FIRMWARE.program, **how), Talk()
    device.receive(talk.hello())
    (hello,) = talk.answers(device.transmit())
    assert DeviceInfo.unpack(hello.payload).more == More(0)
    for request, size in ((Request.LIST, 2), (Request.PLAY, 3), (Request.MOVE, 28)):
        device.receive(talk.request(request, bytes(size)))
        assert talk.refusals(device.transmit()) == [(Reason.TYPE, 0)]


def check_modes(library: DeviceLibrary | None = None) -> None:
    """An application names the mode of the commit too: the frame goes on, or ends first; a host has the reason."""
    for mode, first in ((CommitMode.LINE, 0), (CommitMode.KEEP, 3), (CommitMode.FRAME, 0)):
        how: dict[str, Any] = {"modes": True, "plays": True} if library is None else {"library": library}
        programs = COMPILED[1], CompiledProgram(b"longer", OTHER.digest.encode(), OTHER.program)
        device, talk = HostDevice(FIRMWARE.program, FIRMWARE.program, compiled=programs, **how), Talk()
        device.receive(talk.hello())
        device.tick(1000)
        device.receive(talk.acting(Request.ARM, bytes(4)) + talk.acting(Request.TRIGGER))
        device.tick(2 * 96 + 20)
        device.transmit()
        device.lines()
        assert device.play(0, mode)
        device.tick(8 * 96)
        lines = [(line.generation, line.line) for line in device.lines()]
        old = [line for generation, line in lines if generation == 1]
        assert old == ([2, 3, 4, 5] if mode is CommitMode.FRAME else [2]), mode
        assert (2, first) == next(line for line in lines if line[0] == 2), mode
        refusal = asked(device, talk, 1, CommitMode.KEEP)
        assert isinstance(refusal, Refusal)
        assert refusal.reason == Reason.KEEP, "the frame has other lines"
        device.receive(talk.request(Request.STATUS))
        (status,) = talk.answers(device.transmit())
        assert DeviceStatus.unpack(status.payload).upload == Upload.NONE


@pytest.mark.parametrize(
    "check",
    [check_numbers, check_of_another_kind, check_upload_in_hand, check_no_programs, check_modes],
    ids=lambda check: check.__name__,
)
def test_programs_by_number(check: Any) -> None:
    check()


def _check_all(library: DeviceLibrary) -> None:
    for check in (check_numbers, check_of_another_kind, check_upload_in_hand, check_no_programs, check_modes):
        check(library)
    _random(library, range(500, 520), (True,))


def _compile(folder: Path, change: tuple[str, str, str], *more: str) -> DeviceLibrary:
    file, old, new = change
    sources = []
    for source in (*c_runtime(), *c_link(), *c_store()):
        text = source.read_text("utf-8")
        if source.name == file:
            assert text.count(old) == 1, f"{file}: {old}"
            text = text.replace(old, new)
        sources.append(folder / source.name)
        sources[-1].write_text(text, "utf-8")
    options = ["-DDAC_STORE=1", "-DDAC_LIBRARY=2", *more]
    return DeviceLibrary(compile_device(folder / "device.so", sources=sources, more=options))


@pytest.mark.rest
@pytest.mark.parametrize("name", one_of(3, MUTANTS))
def test_a_wrong_link_is_noticed(name: str, tmp_path: Path) -> None:
    library = _compile(tmp_path, MUTANTS[name], "-DDAC_COMMIT_MODES=1")
    with pytest.raises((Differs, AssertionError)):
        _check_all(library)
