"""Kept programs in the C link: dialogues against the model, starts, and cuts of the power from request to flash."""

import struct
from collections import Counter
from itertools import islice
from pathlib import Path
from typing import Any

import pytest
from kept_dialogues import COMPILED, FIRMWARE, LAYOUT, SCANS, StoreDevice, faults, new_flash
from link_device import CompiledProgram, DeviceLibrary, HostDevice, compile_device, widest
from link_images import resealed
from link_programs import make_scan
from link_random import KEY, Dialogue, Differs
from replacing import replace
from sets import one_of
from test_c_link import SHAPES, STEPS

from tablegen.base.resources import c_link, c_runtime, c_store
from tablegen.device.registers import AXIS_WORDS, PAGE_WORDS
from tablegen.link.messages import (
    NO_SLOT,
    DeviceInfo,
    DeviceState,
    Feature,
    Reason,
    Request,
    SlotContent,
    StoreStatus,
    Upload,
)
from tablegen.link.store import Store

KEPT, LIBRARY, LINK, UPLOAD, REQUESTS, STORE, SEQUENCER = (
    "dac_link_kept.c", "dac_link_library.c", "dac_link.c", "dac_link_upload.c", "dac_link_requests.c", "dac_store.c",
    "dac_sequencer.c",
)  # fmt: skip
MUTANTS = {
    "another generation is saved": (KEPT, "dac_link_get(payload + 1) != generation", "false"),
    "the upload is announced": (KEPT, "    dac_link_put(info + DAC_LINK_IMAGE_CRC, ~crc);\n", ""),
    "flash is written at any time": (KEPT, "l->config->store_while_playing || (rests && !starts)", "true"),
    "flash is written only when parked": (KEPT, "const bool rests = s.swaps == 0 || ", "const bool rests = "),
    "a trigger that waits is not seen": (KEPT, "(rests && !starts)", "rests"),
    "a park that waits is a trigger": (SEQUENCER, "starts = what == TRIGGER || (", "starts = true || ("),
    "a park behind a trigger does not count": (SEQUENCER, "(starts && what != PARK && what != RESET)", "starts"),
    "a trigger that was taken is forgotten": (SEQUENCER, "starts || *running != 0", "starts"),
    "a kept program has no checks": (KEPT, "        found = check_all(l);", "        found = dac_link_fine();"),
    "checks of a second program at a start go on where the first ones ended": (
        KEPT, "    dac_link_start_check(&l->check);\n    l->loading", "    l->loading"),
    "a kept program needs a tag": (KEPT, "    l->loading = true;\n", ""),
    "no upload needs a tag any more": (KEPT, "    l->loading = false;\n", ""),
    "a kept program cannot be read back": (KEPT, "    l->uploaded = true;\n", ""),
    "a kept program has no generation": (KEPT, "    l->taken_generation = 1;\n", ""),
    "an upload seems to go on after a start": (
        KEPT, "found = commit(l);\n    l->upload = DAC_LINK_NONE;\n", "found = commit(l);\n"),
    "a refused trial leaves nothing to play": (KEPT, "(slot != store->state.selected &&", "(false &&"),
    "a refused start says nothing": (KEPT, "            l->kept_refused = found.reason;", "            (void)found;"),
    "a damaged slot says nothing": (KEPT, "    if (slot != due)\n", "    if (false)\n"),
    "a trial that did not play is confirmed": (KEPT, "if (l->kept != store->state.trial)", "if (false)"),
    "a slot of other content is the one of this start": (
        KEPT, "        l->kept = DAC_STORE_NONE;\n    return", "        l->kept = slot;\n    return"),
    "damage is not told": (KEPT, "dac_store_holds(store, slot) ? DAMAGED", "false ? DAMAGED"),
    "SELECT has any trial": (LINK, "good = payload[1] <= 1;", "good = true;"),
    "SAVE needs no tag": (LINK, "UINT32_C(1) << DAC_LINK_SAVE | ", ""),
    "DELETE needs no tag": (LINK, " | UINT32_C(1) << DAC_LINK_DELETE)", ")"),
    "a program of the device ends an upload": (LIBRARY, "|| l->upload != DAC_LINK_NONE || !dac", "|| !dac"),
    "a program of the device ignores the interlock": (LIBRARY, " || !dac_link_permits(l))\n", ")\n"),
    "a host hears of a program of the device": (UPLOAD, "if (l->loading) {", "if (false) {"),
    "a program of the device is not checked against what plays": (
        LIBRARY, "    dac_link_start_check(&l->check);\n    return found;",
        "    dac_link_start_check(&l->check);\n    l->check.stage = 7;\n    return found;"),
    "a compiled program for another converter plays": (
        LIBRARY, "    if (loaded != DAC_LOADED)\n        return", "    if (false)\n        return"),
    "a compiled program of another shape plays": (
        LIBRARY,
        "    if (found.reason == DAC_LINK_NO_REASON)\n        found = store_program", "    found = store_program"),
    "a compiled program that was refused is an upload": (
        LIBRARY, "        l->upload = DAC_LINK_NONE;\n        return found;", "        return found;"),
    "a compiled program has no CRC": (LIBRARY, "    put_crc(l);\n", ""),
    "the y of a compiled program never steps": (
        LIBRARY, "DAC_LINK_Y_STEPS, p->y.hold_ticks != 1", "DAC_LINK_Y_STEPS, 0"),
    "offsets of compiled programs have 16 low bits": (
        LIBRARY, "(uint32_t)offset & 0x3FFFF", "(uint32_t)offset & 0xFFFF"),
    "the y of a compiled program is its x": (LIBRARY, "e(l, &entry->program.y);", "e(l, &entry->program.x);"),
    "compiled programs have no settling lines": (
        LIBRARY, "    put_word(page, DAC_LINK_SETTLE_LINES, s->settle_lines);\n", ""),
    "slots have the first numbers": (LIBRARY, "number - l->config->library_programs;", "number;"),
    "slots have no numbers": (LIBRARY, "        return l->config->library_programs + l->", "        return 0 * l->"),
    "an empty slot is listed": (LIBRARY, "    if (dac_store_info(l->con", "    if (true || dac_store_info(l->con"),
    "a name finds what begins with it": (LIBRARY, "    return a[at] == b[at];", "    return a[at] == '\\0';"),
    "few digits of a hash are enough": (LIBRARY, "at >= SHORTEST && ", ""),
    "more digits than a hash has name it": (LIBRARY, " && text[at] == '\\0';", ";"),
    "the first digit of a byte is the low one": (LIBRARY, "at % 2 == 0 ? hash", "at % 2 != 0 ? hash"),
    "the feature is not announced": (REQUESTS, "c->store != NULL ? KEEPS_PROGRAMS : 0", "false ? KEEPS_PROGRAMS : 0"),
}  # fmt: skip
CUT_MUTANTS = {  # these need a cut
    "the record comes before the image": (
        STORE,
        "    dac_link_put(header, PLACE_MAGIC);",
        "    dac_store_state early = s->state;\n    early.place[slot] = (uint8_t)place;\n    (void)change(s, &early);\n"
        "    dac_link_put(header, PLACE_MAGIC);",
    ),
    "a trial plays without a mark": (
        STORE, "if (make_certain(s) && change(s, &state) == DAC_STORE_DONE && first)", "if (first)"),
}  # fmt: skip
# Too little for y of the scans 2 and 4.
NARROW = widest(FIRMWARE.program.x.output), replace(widest(FIRMWARE.program.y.output), max_step=5000)


def compile_with(folder: Path, change: tuple[str, str, str]) -> DeviceLibrary:
    """Compile a device that keeps programs, with a piece of one file replaced."""
    file, old, new = change
    sources = []
    for source in (*c_runtime(), *c_link(), *c_store()):
        text = source.read_text("utf-8")
        if source.name == file:
            assert text.count(old) == 1, f"{file}: {old}"
            text = text.replace(old, new)
        (folder / source.name).write_text(text, "utf-8")
        sources.append(folder / source.name)
    return DeviceLibrary(
        compile_device(folder / "device.so", sources=sources, more=["-DDAC_STORE=1", "-DDAC_LIBRARY=1"])
    )


# Starts


def check_start(library: DeviceLibrary | None = None) -> None:
    """A scan that was uploaded as Fourier words plays after a start, with all that STATUS and READBACK say of it."""
    for key in (b"", KEY):
        device = StoreDevice(new_flash(), library, key=key)
        device.upload(SCANS[1], fourier=True)
        assert device.save(1) == 0
        assert device.act(Request.SELECT, bytes([1, 0])) == 0
        device.restart()
        assert (device.plays(), device.status().generation, device.store(1).start) == (1, 1, 1)
        table = SCANS[1].image(False)
        nonce = device.ask(Request.CHALLENGE) if key else b""
        device.device.receive(device.talk.commit(table, nonce))  # it is active already
        answers = device.talk.answers(device.device.transmit())
        assert [answer.payload for answer in answers] == [struct.pack("<II", 1, 0)]
        if key:
            image = SCANS[2].image(False)
            for wire in device.talk.upload(image):
                device.device.receive(wire)
            device.device.transmit()
            wrong = device.talk.acting(Request.COMMIT, struct.pack("<I", image.info.image_crc) + bytes(16))
            device.device.receive(wrong)
            assert device.talk.refusals(device.device.transmit()) == [(Reason.KEY, 0)]
        device.upload(SCANS[2])
        assert device.plays() == 2


def check_refused_start(library: DeviceLibrary | None = None) -> None:
    """What the limits of a build refuse does not play; the selected scan does in place of a trial."""
    flash = new_flash()
    device = StoreDevice(flash, library)
    for slot in (0, 1):
        device.upload(SCANS[slot + 1])
        assert device.save(slot) == 0
    assert device.act(Request.SELECT, bytes([1, 0])) == 0
    flash.power_up()
    narrow = StoreDevice(flash, library, NARROW)
    store = narrow.store()
    assert (narrow.plays(), store.start, store.reason) == (0, NO_SLOT, Reason.STEP)
    assert narrow.act(Request.SELECT, bytes([0, 0])) == 0
    assert narrow.act(Request.SELECT, bytes([1, 1])) == 0
    narrow.restart()
    store = narrow.store()
    assert (narrow.plays(), store.start, store.trial, store.reason) == (1, 0, 1, Reason.STEP)
    assert narrow.act(Request.CONFIRM) == Reason.TRIAL


def check_two_refused_programs(library: DeviceLibrary | None = None) -> None:
    """The selected program has all checks too where a trial failed late ones.

    Both have the same tables: with other first words the sequencer would refuse the second table, whose first word is
    repeated behind the last by one of the checks, and hide that the checks were not made.
    """
    flash = new_flash()
    store = Store(flash, LAYOUT)
    image = SCANS[1].image(False)
    late, fast = bytearray(image.data), bytearray(image.data)
    park, most, step = (4 * (2 * PAGE_WORDS + AXIS_WORDS.index(name)) for name in ("park_code", "code_max", "max_step"))
    late[most : most + 4] = late[park : park + 4]  # of y, so that its last check fails
    fast[step : step + 4] = struct.pack("<I", NARROW[1].max_step + 1)
    store.save(0, resealed(image, bytes(fast)))
    store.save(1, resealed(image, bytes(late)))
    store.select(0)
    store.select(1, trial=True)
    flash.power_up()
    device = StoreDevice(flash, library, NARROW)
    assert (device.plays(), device.store().start, device.store().reason) == (0, NO_SLOT, Reason.RANGE)


def check_damage(library: DeviceLibrary | None = None) -> None:
    """A slot with a damaged bit does not play, and says so."""
    flash = new_flash()
    device = StoreDevice(flash, library)
    device.upload(SCANS[1])
    assert device.save(0) == 0
    assert device.act(Request.SELECT, bytes([0, 0])) == 0
    flash.cells[LAYOUT.place(0) + 200] ^= 1
    device.restart()
    store = device.store(0)
    assert (device.plays(), store.start, store.reason, store.content) == (0, NO_SLOT, Reason.IMAGE, SlotContent.DAMAGED)
    assert device.act(Request.DELETE, bytes([0])) == 0
    assert device.store(0).content == SlotContent.EMPTY


def check_playing(library: DeviceLibrary | None = None) -> None:
    """Flash is written while a scan plays only where the device can do that, and without a program."""
    for while_playing in (False, True):
        device = StoreDevice(new_flash(), library, while_playing=while_playing)
        device.upload(SCANS[1])
        assert (device.act(Request.ARM, bytes(4)), device.act(Request.TRIGGER)) == (0, 0)
        device.device.tick(200)
        assert device.save(0) == (0 if while_playing else Reason.PLAYING)
        assert device.act(Request.PARK) == 0
        device.device.tick(1000)
        assert device.save(1) == 0
        device.device.reboot()  # before its first tick a device has no program yet
        device.device.receive(device.talk.hello())
        device.device.transmit()
        assert device.act(Request.DELETE, bytes([1])) == 0


def check_starting(library: DeviceLibrary | None = None) -> None:
    """Between a TRIGGER and its first tick a scan plays already; an ARM or PARK that waits changes nothing."""
    device = StoreDevice(new_flash(), library)
    device.upload(SCANS[1])
    assert (device.act(Request.ARM, bytes(4)), device.act(Request.PARK), device.save(0)) == (0, 0, 0)
    device.device.tick(1)
    assert (device.act(Request.ARM, bytes(4)), device.save(0)) == (0, 0)
    assert (device.act(Request.TRIGGER), device.status().state) == (0, DeviceState.PARKED)
    change = ((Request.SELECT, bytes(2)), (Request.DELETE, bytes(1)), (Request.CONFIRM, b""))
    assert [device.save(0), *(device.act(*each) for each in change)] == [Reason.PLAYING] * 4
    device.device.take_requests()  # on another core, in front of the tick
    assert (device.status().state, device.save(0)) == (DeviceState.PARKED, Reason.PLAYING)
    assert (device.act(Request.PARK), device.save(0)) == (0, Reason.PLAYING)
    device.device.tick(1000)
    assert (device.act(Request.ARM, bytes(4)), device.act(Request.TRIGGER), device.act(Request.PARK)) == (0, 0, 0)
    assert device.save(0) == 0, "no tick of it plays"


def check_changed_slot(library: DeviceLibrary | None = None) -> None:
    """A trial cannot be confirmed whose slot has another scan now."""
    device = StoreDevice(new_flash(), library)
    device.upload(SCANS[1])
    assert (device.save(1), device.act(Request.SELECT, bytes([1, 1]))) == (0, 0)
    device.restart()
    device.upload(SCANS[3])
    assert (device.store().start, device.save(1), device.store().start) == (1, 0, NO_SLOT)
    assert device.act(Request.CONFIRM) == Reason.TRIAL


def check_index(library: DeviceLibrary | None = None) -> None:
    """Compiled programs have the first numbers, slots those behind; names and first digits of hashes find both."""
    flash = new_flash()
    device = StoreDevice(flash, library, compiled=COMPILED[:3])
    device.upload(SCANS[5])
    assert device.save(1) == 0
    device.upload(SCANS[2])
    assert device.save(2) == 0
    line = device.device
    listed = [line.listing(number) for number in range(line.numbers() + 1)]
    assert listed == [
        ("scan_1", SCANS[1].digest),
        ("scan_2", SCANS[2].digest),
        ("scan_3", SCANS[3].digest),
        None,
        (None, SCANS[5].digest),
        (None, SCANS[2].digest),
        None,
    ]
    assert [line.find(name) for name in ("scan_1", "scan_3", "scan_", "scan_33", "scan_5", "")] == [
        0,
        2,
        -1,
        -1,
        -1,
        -1,
    ]
    # The hashes of small scans differ in the last digit alone.
    assert line.find(SCANS[2].digest) == 1, "the first of two that have it"
    assert [line.find(SCANS[5].digest[:digits]) for digits in (11, 12, 64)] == [-1, 0, 4]
    assert line.find(SCANS[5].digest + "0") == line.find(SCANS[5].digest[:63] + "g") == -1
    flash.cells[LAYOUT.place(1) + 200] ^= 1
    assert line.listing(5) is None or line.listing(4) is None, "damaged"


def check_compiled(library: DeviceLibrary | None = None) -> None:
    """A compiled program plays as an upload of it does: checks, readback, hash, and a slot that keeps it."""
    for key in (b"", KEY):
        flash = new_flash()
        device = StoreDevice(flash, library, key=key, while_playing=True, compiled=COMPILED[:3])
        assert (device.act(Request.ARM, bytes(4)), device.act(Request.TRIGGER)) == (0, 0)
        device.device.tick(200)
        device.device.lines()
        for number in range(3):
            assert device.device.play(number)
            assert not device.device.play(number), "one is on its way"
            device.device.tick(200)
            assert device.device.transmit() == b""
            assert (device.plays(), device.status().generation) == (number + 1, number + 2)
        assert next(line.line for line in device.device.lines() if line.generation == 4) == 0
        image = SCANS[3].image(False)
        device.device.receive(device.talk.commit(image, device.ask(Request.CHALLENGE) if key else b""))
        assert [answer.type for answer in device.talk.answers(device.device.transmit())] == [Request.COMMIT | 0x80]
        assert device.save(0) == 0
        assert device.device.play(0)
        device.device.tick(200)
        assert device.device.play(3)
        device.device.tick(200)
        assert device.plays() == 3
        device.device.permits = True


def check_compiled_is_refused(library: DeviceLibrary | None = None) -> None:
    """Limits, another converter, another table and an upload in hand are reasons not to play; the old one goes on."""
    narrow = StoreDevice(new_flash(), library, NARROW, compiled=COMPILED[:3])
    assert narrow.device.play(1), "its steps are found by the checks"
    narrow.device.tick(200)
    assert (narrow.plays(), narrow.status().upload) == (0, Upload.NONE)
    assert narrow.device.play(0)
    narrow.device.tick(200)
    assert narrow.plays() == 1

    program = SCANS[2].program
    coded = replace(program, y=replace(program.y, output=replace(program.y.output, coding="twos-complement")))
    longer = make_scan(3, index_bits=(8, 6)).program
    others = tuple(CompiledProgram(b"other", SCANS[2].digest.encode(), each) for each in (coded, longer))
    device = StoreDevice(new_flash(), library, compiled=(*COMPILED[:2], *others))
    assert not device.device.play(2), "another converter"
    assert not device.device.play(3), "a longer table"
    assert not device.device.play(7), "behind the last slot"
    assert not device.device.play(0xFFFFFFFF)
    device.device.receive(device.talk.request(Request.BEGIN, SCANS[4].image(False).info.pack()))
    device.device.transmit()
    assert not device.device.play(0), "an upload is on its way"
    assert device.status().upload == Upload.RECEIVING
    device.device.receive(device.talk.acting(Request.ABORT))
    device.device.tick(10)
    device.device.transmit()
    assert device.device.play(0)
    device.device.tick(200)
    assert device.plays() == 1
    assert not device.device.play(3), "a longer table, behind a program that has played"


def check_words_of_no_program(library: DeviceLibrary | None = None) -> None:
    """A slot whose program words make no image of its length is refused at once, and leaves no upload behind."""
    flash = new_flash()
    image = SCANS[1].image(False)
    words = bytearray(image.data)
    words[4 * (PAGE_WORDS + AXIS_WORDS.index("harmonics"))] = 9
    Store(flash, LAYOUT).save(0, resealed(image, bytes(words)))
    device = StoreDevice(flash, library, compiled=COMPILED[:1])
    assert not device.device.play(1)
    assert device.status().upload == Upload.NONE
    assert device.device.play(0)


def check_play(library: DeviceLibrary | None = None) -> None:
    """The application plays kept programs: at a line, without a word on the line, after the checks of an upload."""
    for key in (b"", KEY):
        flash = new_flash()
        device = StoreDevice(flash, library, key=key, while_playing=True)
        for slot in (0, 1):
            device.upload(SCANS[slot + 1])
            assert device.save(slot) == 0
        assert (device.act(Request.ARM, bytes(4)), device.act(Request.TRIGGER)) == (0, 0)
        device.device.tick(200)
        device.device.lines()
        assert device.device.play(0)
        assert not device.device.play(1), "one is on its way"
        device.device.tick(200)
        assert device.device.transmit() == b""
        assert (device.plays(), device.status().generation) == (1, 4)
        assert next(line.line for line in device.device.lines() if line.generation == 4) == 0
        assert not device.device.play(2), "an empty slot"
        flash.power_up()
        narrow = StoreDevice(flash, library, NARROW, key)
        assert narrow.device.play(1)
        narrow.device.tick(200)
        assert (narrow.plays(), narrow.status().upload) == (0, Upload.NONE)
        assert narrow.device.play(0)
        narrow.device.tick(200)
        assert narrow.plays() == 1


CHECKS = (
    check_play,
    check_index,
    check_compiled,
    check_compiled_is_refused,
    check_words_of_no_program,
    check_start,
    check_refused_start,
    check_two_refused_programs,
    check_damage,
    check_playing,
    check_starting,
    check_changed_slot,
)


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.__name__)
def test_starts(check: Any) -> None:
    check()


def test_the_slots_of_an_empty_flash() -> None:
    device = StoreDevice(new_flash())
    expected = StoreStatus(3, NO_SLOT, NO_SLOT, 0, NO_SLOT, 0, SlotContent.EMPTY, 0, LAYOUT.room)
    assert device.store() == device.store(2) == expected


def test_a_device_without_flash_has_no_such_requests() -> None:
    """Neither if its code has them nor if it was compiled without."""
    library = StoreDevice(new_flash()).device.library
    for how in ({"library": library}, {}):
        device = HostDevice(FIRMWARE.program, FIRMWARE.program, **how)  # type: ignore[arg-type]
        talk = StoreDevice(new_flash()).talk
        device.receive(talk.hello())
        (hello,) = talk.answers(device.transmit())
        assert Feature.STORE not in DeviceInfo.unpack(hello.payload).features
        for kind, size in ((Request.SLOT, 1), (Request.SAVE, 5), (Request.SELECT, 2), (Request.CONFIRM, 0)):
            device.receive(talk.request(kind, bytes(size)))
            assert talk.refusals(device.transmit()) == [(Reason.TYPE, 0)]


# Dialogues


def _random(library: DeviceLibrary | None, seeds: range, shape: str = "16 bits") -> Counter[Any]:
    how: dict[str, Any] = {} if library is None else {"library": library}
    seen: Counter[Any] = Counter()
    for key in (b"", KEY):
        for seed in seeds:
            dialogue = Dialogue(SHAPES[shape], seed, key, store=True, **how)
            dialogue.play(STEPS)
            ours, theirs = dialogue.flashes
            if ours.cells != theirs.cells:
                raise Differs("the flash of the device is not that of its model")
            seen += dialogue.seen
    return seen


@pytest.mark.common
def test_random_dialogues_about_kept_programs_are_those_of_the_model() -> None:
    seen = _random(None, range(300, 320))
    for kind in (Request.SLOT, Request.SAVE, Request.SELECT, Request.CONFIRM, Request.DELETE):
        assert seen[kind] > 5, kind
    reasons = (Reason.SLOT, Reason.ROOM, Reason.PLAYING, Reason.GENERATION, Reason.TRIAL, Reason.FLASH)
    for reason in reasons:
        assert sum(count for each, count in seen.items() if isinstance(each, tuple) and each[1] == reason), reason
    assert min(seen[what, kind] for what in ("played", "not played") for kind in ("compiled", "kept")) > 5
    assert seen[Request.SAVE, Reason.READBACK]
    assert seen[Request.SAVE, Reason.KEY]


@pytest.mark.rest
@pytest.mark.parametrize("shape", one_of(2, (shape for shape in SHAPES if shape != "16 bits")))
def test_random_dialogues_of_other_shapes(shape: str) -> None:
    assert _random(None, range(330, 336), shape)[Request.SLOT]


def _check_all(library: DeviceLibrary) -> None:
    for check in CHECKS:
        check(library)
    _random(library, range(300, 320))


# Cuts


@pytest.mark.common
def test_no_cut_of_the_power_makes_a_mixture() -> None:
    assert list(islice(faults(modes=("mixed",)), 3)) == []


@pytest.mark.rest
def test_no_cut_of_the_power_makes_a_mixture_whatever_it_reads_as() -> None:
    assert list(islice(faults(), 3)) == []


@pytest.mark.rest
@pytest.mark.parametrize("name", CUT_MUTANTS)
def test_a_wrong_store_is_found_by_cuts(name: str, tmp_path: Path) -> None:
    assert list(islice(faults(compile_with(tmp_path, CUT_MUTANTS[name])), 1))


@pytest.mark.rest
@pytest.mark.parametrize("name", one_of(3, MUTANTS))
def test_a_wrong_link_is_noticed(name: str, tmp_path: Path) -> None:
    library = compile_with(tmp_path, MUTANTS[name])
    with pytest.raises((Differs, AssertionError)):
        _check_all(library)
