"""Of the C link what dialogues do not show: BLAKE2s, challenges, damaged memory, answers that wait, the ring."""

import ctypes
import hashlib
import struct
import zlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from link_device import HostDevice, device_library
from link_images import random_image
from link_programs import make_scan
from link_talk import Talk, derived_nonce, is_answer
from replacing import replace

from tablegen.device.registers import AXIS_WORDS, PAGE_WORDS
from tablegen.link.frames import Frame
from tablegen.link.messages import (
    ANSWER,
    REFUSAL,
    AxisLimits,
    DeviceInfo,
    DeviceState,
    DeviceStatus,
    Feature,
    Reason,
    Refusal,
    Request,
    Upload,
)
from tablegen.link.program_image import PROGRAM_BYTES, ProgramImage, make_image
from tablegen.verification.play.sequencer_shape import SequencerShape

KEY = bytes(range(7, 31))
SCANS = [make_scan(seed) for seed in range(3)]


def device(key: bytes = b"", **how: object) -> HostDevice:
    """A device that plays nothing yet but has booted into the first scan."""
    made = HostDevice(SCANS[0].program, SCANS[0].program, key=key, boot_count=5, **how)  # type: ignore[arg-type]
    made.tick(3)
    return made


def ask(made: HostDevice, talk: Talk, wire: bytes) -> list[Frame]:
    """What is answered at once."""
    made.receive(wire)
    return talk.answers(made.transmit())


def upload(made: HostDevice, talk: Talk, image: ProgramImage) -> None:
    """All but COMMIT."""
    for wire in talk.upload(image):
        (answer,) = ask(made, talk, wire)
        assert answer.type != REFUSAL


def refusal(made: HostDevice, talk: Talk, wire: bytes) -> tuple[int, int]:
    """Reason and detail of what is refused."""
    made.receive(wire)
    (found,) = talk.refusals(made.transmit())
    return found


def status(made: HostDevice, talk: Talk) -> DeviceStatus:
    """What the device does."""
    (answer,) = ask(made, talk, talk.request(Request.STATUS))
    return DeviceStatus.unpack(answer.payload)


# BLAKE2s


def blake2s(key: bytes, parts: list[bytes], size: int) -> bytes:
    """That of C."""
    dll = device_library().dll
    state = ctypes.create_string_buffer(dll.device_sizes(4))
    result = ctypes.create_string_buffer(b"\xa5" * 33, 33)
    dll.dac_link_mac_begin(state, ctypes.c_uint8(size), key, ctypes.c_uint8(len(key)))
    for part in parts:
        dll.dac_link_mac_add(state, part, ctypes.c_uint8(len(part)))
    dll.dac_link_mac_end(state, result)
    assert result.raw[size:] == b"\xa5" * (33 - size)
    return result.raw[:size]


@pytest.mark.common
@pytest.mark.parametrize("key", [b"", b"k", bytes(16), bytes(range(32))], ids=len)
def test_blake2s_of_every_length_around_its_blocks(key: bytes) -> None:
    message = bytes(n * 7 & 255 for n in range(200))
    for length in range(200):
        for size in (16, 32):
            expected = hashlib.blake2s(message[:length], key=key, digest_size=size).digest()
            assert blake2s(key, [message[:length]], size) == expected, (length, size)


@pytest.mark.common
@given(st.binary(max_size=32), st.lists(st.binary(max_size=255), max_size=6), st.integers(1, 32))
def test_blake2s_is_that_of_hashlib(key: bytes, parts: list[bytes], size: int) -> None:
    assert blake2s(key, parts, size) == hashlib.blake2s(b"".join(parts), key=key, digest_size=size).digest()


# The key


def challenged(made: HostDevice, talk: Talk) -> bytes:
    """A nonce."""
    (answer,) = ask(made, talk, talk.request(Request.CHALLENGE))
    assert is_answer(answer, Request.CHALLENGE)
    return answer.payload


def test_a_tag_serves_one_request() -> None:
    made, talk = device(KEY), Talk(key=KEY)
    ask(made, talk, talk.hello())
    nonce = challenged(made, talk)
    assert nonce == derived_nonce(KEY, 5, 1)
    parked = talk.acting(Request.PARK, nonce=nonce)
    assert is_answer(ask(made, talk, parked)[0], Request.PARK)
    assert is_answer(ask(made, talk, parked)[0], Request.PARK)  # only told again
    assert refusal(made, talk, talk.acting(Request.PARK, nonce=nonce)) == (Reason.KEY, 0)
    assert challenged(made, talk) != nonce


@pytest.mark.parametrize("kind", [Request.PARK, Request.ARM, Request.TRIGGER, Request.CLEAR, Request.LIMITS])
def test_every_bit_of_a_tag_counts(kind: Request) -> None:
    made, talk = device(KEY), Talk(key=KEY)
    ask(made, talk, talk.hello())
    payload = {Request.ARM: bytes(4), Request.LIMITS: bytes(32)}.get(kind, b"")
    for bit in (0, 7, 63, 64, 120, 127):
        seq = talk.seq
        wire = talk.acting(kind, payload, challenged(made, talk))
        (frame,) = Talk().answers(wire)
        at = len(payload) + bit // 8
        wrong = bytearray(frame.payload)
        wrong[at] ^= 1 << bit % 8
        assert refusal(made, talk, replace(frame, payload=bytes(wrong)).encode()) == (Reason.KEY, 0)
        talk.seq = seq  # the number is still free
    nonce = challenged(made, talk)
    assert is_answer(ask(made, talk, talk.acting(kind, payload, nonce))[0], kind)
    assert refusal(made, talk, talk.acting(kind, payload)) == (Reason.KEY, 0)


def test_the_tag_of_a_commit_covers_the_image_in_memory() -> None:
    """Another image of the same CRC, as somebody on the wire may make one, is not taken."""
    made, talk = device(KEY), Talk(key=KEY)
    ask(made, talk, talk.hello())
    meant, sent = SCANS[1].image(False), SCANS[2].image(False)
    upload(made, talk, sent)
    nonce = challenged(made, talk)
    seq = talk.seq
    forged = talk.acting(Request.COMMIT, struct.pack("<I", sent.info.image_crc), nonce, meant.data)
    assert refusal(made, talk, forged) == (Reason.KEY, 0)
    assert status(made, talk).upload == Upload.RECEIVING
    talk.seq = seq
    assert ask(made, talk, talk.commit(sent, challenged(made, talk))) == []
    made.tick()
    (taken,) = talk.answers(made.transmit())
    assert struct.unpack("<II", taken.payload)[0] == 2


def test_nonces_are_others_after_each_start() -> None:
    made, talk = device(KEY), Talk(key=KEY)
    seen = []
    for _ in range(4):
        ask(made, talk, talk.hello())
        seen += [challenged(made, talk) for _ in range(3)]
        made.reboot()
    assert len(set(seen)) == len(seen)


# Memory


@pytest.mark.parametrize("fourier", [False, True])
@pytest.mark.parametrize("axis", [0, 1])
def test_a_word_that_changes_in_memory_is_found(axis: int, fourier: bool) -> None:
    made, talk = device(), Talk()
    ask(made, talk, talk.hello())
    image = SCANS[1].image(fourier)
    upload(made, talk, image)
    made.poke(axis, 5, 12345)
    assert refusal(made, talk, talk.commit(image)) == (Reason.IMAGE, 0)
    assert status(made, talk).upload == Upload.NONE
    upload(made, talk, image)
    assert ask(made, talk, talk.commit(image)) == []
    made.tick()
    assert is_answer(talk.answers(made.transmit())[0], Request.COMMIT)


def test_the_form_of_an_upload_does_not_show_in_what_plays_or_is_read_back() -> None:
    played, read = [], []
    for fourier in (False, True):
        made, talk = device(), Talk()
        ask(made, talk, talk.hello())
        image = SCANS[1].image(fourier)
        upload(made, talk, image)
        for wire in (talk.commit(image), talk.acting(Request.ARM, bytes(4)), talk.acting(Request.TRIGGER)):
            ask(made, talk, wire)
        made.tick(1000)
        made.transmit()
        lines = made.lines()
        assert len(lines) > 8
        played.append(lines)
        read.append(read_back(made, talk))
    assert played[0] == played[1]
    assert read[0] == read[1] == SCANS[1].image(False).data


def read_back(made: HostDevice, talk: Talk) -> bytes:
    """The image of what plays."""
    data = b""
    while True:
        (answer,) = ask(made, talk, talk.request(Request.READBACK, struct.pack("<IB", len(data), 101)))
        if len(answer.payload) == 4:
            return data
        data += answer.payload[4:]


def test_an_upload_leaves_what_plays_alone() -> None:
    """Bytes of another image at every moment of a scan: its lines are those of a device that hears nothing."""
    quiet, busy, talk = device(), device(), Talk()
    for made in (quiet, busy):
        for wire in (talk.hello(), talk.acting(Request.ARM, bytes(4)), talk.acting(Request.TRIGGER)):
            ask(made, talk, wire)
        talk.seq = 0
    others = [SCANS[n % 3].image(n % 2 == 0) for n in range(6)]
    for number in range(20):
        for wire in talk.upload(others[number % 6], 60):
            busy.receive(wire)
            for made in (quiet, busy):
                made.tick(7)
    assert quiet.lines() == busy.lines() != []


# The line


def test_no_answer_is_lost_where_nothing_can_leave() -> None:
    made, talk = device(), Talk()
    made.stall(True)
    wires = [talk.hello(), *(replace(frame, seq=n).encode() for n in range(6) for frame in [Frame(6, 0, talk.session)])]
    assert made.feed(b"".join(wires)) == sum(map(len, wires))
    made.work(1000)
    assert made.transmit() == b""
    made.stall(False)
    made.work()
    answers = talk.answers(made.transmit())
    assert [frame.seq for frame in answers] == [0, *range(6)]
    assert [frame.type for frame in answers] == [0x81, *[0x86] * 6]


def test_what_the_ring_has_no_room_for_is_counted_and_recovered_from() -> None:
    made, talk = device(), Talk()
    ring = made.library.ring
    ask(made, talk, talk.hello())
    wire = talk.request(Request.STATUS)
    sent = wire * (ring // len(wire) + 9)
    taken = made.feed(sent)
    assert ring - ring // 128 < taken <= ring
    assert made.lost == len(sent) - taken
    made.work()
    whole = taken // len(wire)
    assert len(talk.answers(made.transmit())) == whole
    made.receive(b"\0")
    now = status(made, talk)
    assert now.bad_frames == (1 if taken % len(wire) else 0)


def test_a_ring_that_goes_round_many_times_loses_nothing() -> None:
    made, talk = device(), Talk()
    ask(made, talk, talk.hello())
    size = made.library.ring - made.library.ring // 128
    answers = 0
    stream = b"".join(replace(f, seq=n & 255).encode() for n in range(3000) for f in [Frame(6, 0, talk.session)])
    for at in range(0, len(stream), size):
        part = stream[at : at + size]
        assert made.feed(part) == len(part)
        made.work()
        answers += len(talk.answers(made.transmit()))
    assert answers == 3000
    assert status(made, talk).bad_frames == made.lost == 0


# While a program is checked


def test_a_device_that_checks_hears_and_is_busy() -> None:
    """COMMIT and what follows come in one piece: slices of the checks and frames take turns."""
    made, talk = device(), Talk()
    ask(made, talk, talk.hello())
    image, other = SCANS[1].image(False), SCANS[2].image(False)
    upload(made, talk, image)
    wires = [talk.commit(image), talk.request(Request.STATUS), talk.request(Request.BEGIN, other.info.pack())]
    made.receive(b"".join([*wires, talk.acting(Request.COMMIT, struct.pack("<I", image.info.image_crc))]))
    checking, busy, again = talk.answers(made.transmit())
    assert DeviceStatus.unpack(checking.payload).upload == Upload.CHECKING
    assert Refusal.unpack(busy.payload).reason == Refusal.unpack(again.payload).reason == Reason.BUSY
    made.tick()
    (taken,) = talk.answers(made.transmit())
    assert is_answer(taken, Request.COMMIT)


def test_an_abort_withdraws_a_program_that_is_checked() -> None:
    made, talk = device(), Talk()
    ask(made, talk, talk.hello())
    image = SCANS[1].image(False)
    upload(made, talk, image)
    made.receive(talk.commit(image) + talk.acting(Request.ABORT))
    refused, aborted = talk.answers(made.transmit())
    assert Refusal.unpack(refused.payload) == Refusal(Request.COMMIT, Reason.WITHDRAWN, 0)
    assert aborted.payload == struct.pack("<I", 1)
    made.tick(5)
    assert (status(made, talk).generation, status(made, talk).upload) == (1, Upload.NONE)


def test_an_abort_too_many() -> None:
    """Where nobody asks for samples, withdrawals pile up; all are answered when somebody does."""
    made, talk = device(), Talk()
    ask(made, talk, talk.hello())
    image = SCANS[1].image(False)
    upload(made, talk, image)
    assert ask(made, talk, talk.commit(image)) == []
    refused = []
    for _ in range(10):
        made.receive(talk.acting(Request.ABORT))
        refused += talk.refusals(made.transmit())
    assert refused == [(Reason.TICKS, 0)] * 3  # COMMIT and seven of them wait
    made.tick()
    answers = talk.answers(made.transmit())
    assert [frame.type for frame in answers] == [REFUSAL, *[Request.ABORT | ANSWER] * 7]
    assert [frame.seq for frame in answers] == list(range(1, 9))


def test_a_commit_where_nobody_asks_for_samples() -> None:
    made, talk = device(), Talk()
    ask(made, talk, talk.hello())
    image = SCANS[1].image(False)
    upload(made, talk, image)
    for _ in range(8):
        assert is_answer(ask(made, talk, talk.acting(Request.CLEAR))[0], Request.CLEAR)
    assert refusal(made, talk, talk.acting(Request.CLEAR)) == (Reason.TICKS, 0)
    assert refusal(made, talk, talk.commit(image)) == (Reason.TICKS, 0)
    assert status(made, talk).upload == Upload.RECEIVING
    made.tick()
    assert ask(made, talk, talk.commit(image)) == []
    made.tick()
    assert is_answer(talk.answers(made.transmit())[0], Request.COMMIT)


def test_an_interlock_that_opens_during_the_checks_leaves_the_upload() -> None:
    made, talk = device(interlock=True), Talk()
    ask(made, talk, talk.hello())
    image = SCANS[1].image(False)
    upload(made, talk, image)
    wire = talk.commit(image)
    made.feed(wire)
    made.work(2)
    assert made.transmit() == b""
    made.permits = False
    made.work()
    assert talk.refusals(made.transmit()) == [(Reason.INTERLOCK, 0)]
    now = status(made, talk)
    assert (now.upload, now.received, now.permits) == (Upload.RECEIVING, len(image.data), False)
    made.permits = True
    assert ask(made, talk, talk.commit(image)) == []
    made.tick()
    assert is_answer(talk.answers(made.transmit())[0], Request.COMMIT)


def test_another_image_of_the_same_bytes_begins_again() -> None:
    made, talk = device(), Talk()
    ask(made, talk, talk.hello())
    image = SCANS[1].image(False)
    for wire in [*talk.upload(image)][:2]:
        ask(made, talk, wire)
    for info, received in ((image.info, 240), (replace(image.info, hash=bytes(32)), 0), (image.info, 0)):
        (begun,) = ask(made, talk, talk.request(Request.BEGIN, info.pack()))
        assert struct.unpack("<I", begun.payload) == (received,)


def test_the_line_of_a_commit_is_the_last_of_the_old_program() -> None:
    ticks = SCANS[0].program.schedule.ticks
    for line in range(4):
        made, talk = device(), Talk()
        image = SCANS[1].image(True)
        for wire in (talk.hello(), talk.acting(Request.ARM, bytes(4)), talk.acting(Request.TRIGGER)):
            ask(made, talk, wire)
        made.tick(line * ticks + 10)
        upload(made, talk, image)
        assert ask(made, talk, talk.commit(image)) == []
        made.tick(ticks - 10)
        assert made.transmit() == b"", "the line is not over"
        made.tick(1)
        (taken,) = talk.answers(made.transmit())
        assert struct.unpack("<II", taken.payload) == (2, line + 1)


# What the device says of itself


def test_what_a_device_is() -> None:
    limits = AxisLimits(100, 60000, 7000, 900), AxisLimits(200, 50000, 6000, 800)
    made, talk = device(limits=limits, index_bits=(9, 8), harmonics=33, window=3, update_rate_hz=48000), Talk()
    (answer,) = ask(made, talk, talk.hello())
    info = DeviceInfo.unpack(answer.payload)
    assert info.features == Feature.TABLES | Feature.FOURIER | Feature.READBACK | Feature.NARROWS
    assert (info.window, info.data_bytes, info.harmonics, info.update_rate_hz) == (3, 240, 33, 48000)
    assert (info.x.index_bits, info.y.index_bits, info.image_bytes) == (9, 8, 192 + 2 * 512 + 2 * 256)
    assert (info.x_limits, info.y_limits) == limits
    assert DeviceStatus.unpack(answer.payload[DeviceInfo.LAYOUT.size :]).state in (
        DeviceState.PARKED,
        DeviceState.PARKING,
    )


def test_tables_that_are_shorter_than_fourier_words() -> None:
    made = HostDevice(SCANS[0].program, None, index_bits=(3, 3), harmonics=50)
    talk = Talk()
    info = DeviceInfo.unpack(ask(made, talk, talk.hello())[0].payload)
    assert info.image_bytes == 192 + 2 * 4 * 101


def test_bytes_that_an_image_has_too_many_or_too_few_are_refused_when_its_words_are_complete() -> None:
    made, talk = device(), Talk()
    ask(made, talk, talk.hello())
    image = make_image(SCANS[1].program, "ab" * 32)
    for other in (len(image.data) - 1, len(image.data) + 1, len(image.data) + 2):
        wrong = replace(image.info, image_bytes=other)
        fits = other <= DeviceInfo.unpack(ask(made, talk, talk.hello())[0].payload).image_bytes
        (begun,) = ask(made, talk, talk.request(Request.BEGIN, wrong.pack()))
        assert (begun.type != REFUSAL) == fits
        if fits:
            data = talk.request(Request.DATA, bytes(4) + image.data[:240])
            assert refusal(made, talk, data) == (Reason.LENGTH, len(image.data))


def test_a_length_is_known_in_the_middle_of_any_frame() -> None:
    """The program words may end anywhere in a DATA, and a word between two."""
    for size in (1, 7, 191, 192, 193, 240):
        made, talk = device(), Talk()
        ask(made, talk, talk.hello())
        image = SCANS[2].image(True)
        for wire in talk.upload(image, size):
            ask(made, talk, wire)
        assert ask(made, talk, talk.commit(image)) == [], size
        made.tick()
        assert is_answer(talk.answers(made.transmit())[0], Request.COMMIT)


def test_a_table_of_no_words() -> None:
    """An image may say so; its period is then refused."""
    image, program = random_image(np.random.default_rng(3), SequencerShape(16, 0, 5, 16, 0, 5, 16))
    for axis in (0, 1):
        made, talk = HostDevice(program, program, index_bits=(5, 5)), Talk()
        made.tick()
        ask(made, talk, talk.hello())
        sizes = 2 * len(program.x.words), 2 * len(program.y.words)
        words = bytearray(image.data[:PROGRAM_BYTES])
        at = 4 * (PAGE_WORDS * (axis + 1) + AXIS_WORDS.index("phase_period"))
        words[at : at + 4] = bytes(4)
        tables = image.data[PROGRAM_BYTES : PROGRAM_BYTES + sizes[0]], image.data[PROGRAM_BYTES + sizes[0] :]
        data = bytes(words) + tables[1 - axis]
        info = replace(image.info, image_bytes=len(data), image_crc=zlib.crc32(data))
        upload(made, talk, ProgramImage(info, data))
        assert refusal(made, talk, talk.commit(ProgramImage(info, data))) == (Reason.PERIOD, axis)


def test_a_harmonic_too_many() -> None:
    made, talk = device(harmonics=4), Talk()
    ask(made, talk, talk.hello())
    image = SCANS[1].image(True)
    count = image.data[4 * (PAGE_WORDS + AXIS_WORDS.index("harmonics"))]
    assert count > 4
    made.receive(b"".join(talk.upload(image)))
    assert talk.refusals(made.transmit())[0] == (Reason.HARMONICS, 4)


def test_the_reason_of_a_refusal_is_told_with_its_request() -> None:
    made, talk = device(), Talk()
    ask(made, talk, talk.hello())
    (answer,) = ask(made, talk, talk.acting(Request.COMMIT, bytes(4)))
    assert Refusal.unpack(answer.payload) == Refusal(Request.COMMIT, Reason.UPLOAD, 0)
