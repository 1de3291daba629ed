"""The key of the C link: what was recorded of one dialogue is worth nothing later, elsewhere, or after a start."""

import pytest
from link_device import HostDevice, Started
from link_programs import make_scan
from link_random import KEY
from link_talk import IDENTITY, Talk, derived_nonce, is_answer

from tablegen.link.frames import FrameReader
from tablegen.link.messages import DeviceState, DeviceStatus, Reason, Request
from tablegen.link.model_device import CHALLENGE_MS, ModelDevice

SCAN = make_scan(1)


def started(**how: object) -> HostDevice:
    """A device that plays nothing yet."""
    made = HostDevice(SCAN.program, SCAN.program, **{"key": KEY, "boot_count": 5, **how})  # type: ignore[arg-type]
    made.set_clock(0)
    made.tick(200)
    return made


def asked(made: HostDevice | ModelDevice, talk: Talk, wire: bytes) -> bytes:
    """The payload of the one answer; b"refused" and the reason where it is refused."""
    made.receive(wire)
    made.tick(1)
    (answer,) = talk.answers(made.transmit())
    return answer.payload if answer.type != 0xFF else b"refused" + answer.payload[1:2]


def refused_by(reason: Reason) -> bytes:
    return b"refused" + bytes([reason])


def recorded(made: HostDevice | ModelDevice) -> list[bytes]:
    """What somebody on the wire writes down while the owner of the key arms a device and triggers it."""
    talk = Talk(key=KEY)
    wires = [talk.hello()]
    asked(made, talk, wires[-1])
    for kind, payload in ((Request.ARM, bytes(4)), (Request.TRIGGER, b"")):
        wires.append(talk.request(Request.CHALLENGE))
        nonce = asked(made, talk, wires[-1])
        wires.append(talk.acting(kind, payload, nonce))
        assert asked(made, talk, wires[-1]) == b""
    return wires


def plays(made: HostDevice | ModelDevice) -> bool:
    made.tick(20)
    talk = Talk()
    return DeviceStatus.unpack(asked(made, talk, talk.hello())[56:]).state is DeviceState.PLAYING


def replayed(made: HostDevice | ModelDevice, wires: list[bytes]) -> list[int]:
    """Types of the answers to what was written down."""
    reader, types = FrameReader(), []
    for wire in wires:
        made.receive(wire)
        made.tick(1)
        types += [frame.type for frame in reader.feed(made.transmit())]
    return types


def sources() -> list[object]:
    """Each of the two that suffice, and a generator that begins anew with every start: by far too little alone."""
    return [
        pytest.param({}, id="boot count"),
        pytest.param({"boot_persists": False, "random": urandom}, id="random"),
        pytest.param({"random": lambda: bytes(16)}, id="boot count and broken random"),
    ]


def urandom() -> bytes:
    urandom.count += 1  # type: ignore[attr-defined]
    return int(urandom.count).to_bytes(16, "little")  # type: ignore[attr-defined]


urandom.count = 0  # type: ignore[attr-defined]


@pytest.mark.parametrize("how", sources())
def test_a_recorded_trigger_is_worth_nothing_after_a_power_cycle(how: dict[str, object]) -> None:
    made = started(**how)
    wires = recorded(made)
    assert plays(made)
    made.reboot()
    made.tick(200)
    assert 0x80 | Request.TRIGGER not in replayed(made, wires)
    assert not plays(made)


@pytest.mark.parametrize("how", [*sources(), pytest.param({"random": lambda: b"\1" * 16}, id="the same random")])
def test_it_is_worth_nothing_on_another_instrument(how: dict[str, object]) -> None:
    """Of the same key, the same boot count, and even the same random numbers."""
    wires = recorded(started(**how))
    other = started(identity=b"device 2", **how)
    assert 0x80 | Request.TRIGGER not in replayed(other, wires)
    assert not plays(other)
    twin = started(**how)  # the control: what it protects from is there
    assert (0x80 | Request.TRIGGER in replayed(twin, wires)) == (how.get("random") is not urandom)


def test_the_model_of_a_device_does_the_same() -> None:
    from client_rig import model

    wires = recorded(model(key=KEY))
    assert plays(model(key=KEY)) is False
    again, other, twin = model(key=KEY), model(key=KEY, identity=b"another"), model(key=KEY)
    again.reboot()
    for made in (again, other):
        assert 0x80 | Request.TRIGGER not in replayed(made, wires)
        assert not plays(made)
    assert 0x80 | Request.TRIGGER in replayed(twin, wires)


def test_a_challenge_expires() -> None:
    for late, begin in ((-1, 0), (0, 0), (1, 0), (-1, 0xFFFFFF00), (0, 0xFFFFFF00)):
        made, talk = started(), Talk(key=KEY)
        made.set_clock(begin)
        asked(made, talk, talk.hello())
        nonce = asked(made, talk, talk.request(Request.CHALLENGE))
        made.set_clock((begin + CHALLENGE_MS + late) & 0xFFFFFFFF)
        wanted = b"" if late < 0 else refused_by(Reason.KEY)
        assert asked(made, talk, talk.acting(Request.PARK, nonce=nonce)) == wanted, (late, begin)
        if late >= 0:  # it does not come back when the clock goes round
            made.set_clock(begin)
            assert asked(made, talk, talk.acting(Request.PARK, nonce=nonce)) == refused_by(Reason.KEY)


def test_nonces_are_of_key_identity_boot_and_count() -> None:
    for boot, identity in ((5, IDENTITY), (6, IDENTITY), (5, b"four"), (5, bytes(32))):
        made, talk = started(boot_count=boot, identity=identity), Talk(key=KEY)
        asked(made, talk, talk.hello())
        for count in (1, 2, 3):
            nonce = asked(made, talk, talk.request(Request.CHALLENGE))
            assert nonce == derived_nonce(KEY, boot, count, identity)


@pytest.mark.parametrize("before", ["used by a request", "used by a commit", "expired", "no tag"])
def test_a_commit_needs_a_challenge_of_its_own(before: str) -> None:
    """Its tag is right but for the nonce, which was good for something else, or long ago; and then there is none."""
    image = SCAN.image(False)
    made, talk = started(), Talk(key=KEY)
    asked(made, talk, talk.hello())

    def upload() -> None:
        assert all(asked(made, talk, wire)[:1] != b"r" for wire in talk.upload(image))

    upload()
    nonce = asked(made, talk, talk.request(Request.CHALLENGE))
    if before == "used by a request":
        assert asked(made, talk, talk.acting(Request.PARK, nonce=nonce)) == b""
    elif before == "used by a commit":
        assert len(asked(made, talk, talk.commit(image, nonce))) == 8
        upload()
    elif before == "expired":
        made.set_clock(CHALLENGE_MS)
    assert asked(made, talk, talk.commit(image, b"" if before == "no tag" else nonce)) == refused_by(Reason.KEY)
    nonce = asked(made, talk, talk.request(Request.CHALLENGE))
    assert len(asked(made, talk, talk.commit(image, nonce))) == 8, "the control"


UNSTARTED = [
    ({"boot_persists": False}, Started.NO_RANDOM),
    ({"identity": b""}, Started.NO_IDENTITY),
    ({"identity": b"abc"}, Started.NO_IDENTITY),
    ({"key": bytes(15)}, Started.BAD_KEY),
]


@pytest.mark.parametrize(("how", "why"), UNSTARTED)
def test_a_key_without_what_it_needs_is_refused(how: dict[str, object], why: Started) -> None:
    made = started(**how)
    assert made.started is why
    made.receive(Talk().hello())
    made.tick(10)
    assert made.transmit() == b"", "a link that was not started is silent"


def test_a_configuration_with_one_fault_is_refused() -> None:
    """Each fault of ``device_refusal`` alone, on either axis; what stands beside it is good."""
    B, F = Started.BAD_AXIS, Started.BAD_FOURIER  # noqa: N806
    axis = [B] * 18 + [F] * 2
    key = [F] * 3 + [Started.BAD_KEY] * 3 + [Started.NO_IDENTITY] * 3 + [Started.NO_RANDOM, Started.NO_CLOCK]
    wanted = [Started.STARTED, *axis, *axis, *key]
    scan = make_scan(1, index_bits=(5, 5))
    made = HostDevice(scan.program, scan.program, key=KEY)
    assert [made.refusal(fault) for fault in range(len(wanted))] == wanted


def test_without_a_key_none_of_it_is_needed() -> None:
    made = started(key=b"", identity=b"", boot_persists=False)
    assert made.started is Started.STARTED
    made.receive(Talk().hello())
    assert is_answer(Talk().answers(made.transmit())[0], Request.HELLO)
