"""The client as a state machine: requests in any order, on lines that lose, damage, repeat and delay, with resets."""

from collections.abc import Callable
from random import Random
from typing import TypeVar

import pytest
from client_line import Noise, VirtualLine
from client_rig import BOOT, KEY, client, model
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule
from link_programs import SmallScan, make_scan

from tablegen.link.device import Device
from tablegen.link.errors import LinkError, NotPlaying, Refused
from tablegen.link.messages import DeviceState, Reason
from tablegen.link.upload import Uploader

pytestmark = pytest.mark.common

Result = TypeVar("Result")
SCANS = [make_scan(seed, ticks=300, lines=20, index_bits=(8, 7)) for seed in range(2, 6)]
TABLES = {scan.digest: scan.image(False).data for scan in SCANS}
# What a request may end in on a line as bad as these: never a wrong result.
CHANCES = st.sampled_from([0.0, 0.0, 0.02, 0.1])


class Instrument(RuleBasedStateMachine):
    """A model behind a line with chance from a seed; what it should do is kept beside it."""

    def __init__(self) -> None:
        super().__init__()
        self.device: Device | None = None

    @initialize(seed=st.integers(0, 1 << 32), key=st.booleans(), bridge=st.booleans())
    def start(self, seed: int, key: bool, bridge: bool) -> None:
        self.chance = Random(seed)
        self.key = KEY if key else None
        self.model = model(key=KEY if key else b"", checking=self.chance.choice([0, 200, 2000]))
        self.line = VirtualLine(self.model, batch_s=0.016 if bridge else 0.0)
        self.allowed = {BOOT.digest}  # plans that may be in force
        self.was_reset = False
        self.connect(0.0)

    def attempt(self, call: Callable[[], Result]) -> tuple[Result] | None:
        """What a call returns; nothing where it ends in an error, which the line has to be bad for."""
        try:
            return (call(),)
        except NotPlaying:
            raise
        except LinkError:
            if not self.bad:
                raise
            return None

    @rule(chance=CHANCES)
    def connect(self, chance: float) -> None:
        """Another host, or the same again; the line from now on is this bad."""
        noises = [Noise(self.chance, chance, chance, chance, chance) for _ in range(2)]
        self.line.spoil_out, self.line.spoil_back = noises
        self.bad = chance > 0.0
        found = self.attempt(lambda: client(self.line, self.chance.randrange(1 << 32), key=self.key))
        self.device = found[0] if found else None

    @precondition(lambda self: self.device is not None)
    @rule(scan=st.sampled_from(SCANS), fourier=st.booleans(), force=st.booleans())
    def upload(self, scan: SmallScan, fourier: bool, force: bool) -> None:
        device = self.device
        assert device is not None
        image = scan.image(fourier)
        before, start = self.model.player.swaps, self.line.now()
        self.allowed.add(scan.digest)
        if done := self.attempt(lambda: device.upload(image, force=force)):
            result = done[0]
            assert self.model.status().hash == image.info.hash
            if not (force and self.bad):  # a COMMIT whose BEGIN was lost is answered by the same image in force
                assert result.already_running == (self.model.player.swaps == before)
            assert not (result.already_running and force)
            assert self.bad or self.was_reset or result.retransmissions == 0
            self.was_reset = False
            self.allowed = {scan.digest}
        assert self.line.now() - start < device.upload_time_s(image) + 10.0

    @precondition(lambda self: self.device is not None)
    @rule(request=st.sampled_from(["park", "arm", "trigger", "clear", "abort"]))
    def act(self, request: str) -> None:
        done = self.attempt(getattr(self.device, request))
        self.line.sleep(0.001)
        if done and request == "park":
            assert self.model.player.state in (DeviceState.PARKED, DeviceState.PARKING)

    @precondition(lambda self: self.device is not None)
    @rule()
    def read(self) -> None:
        device = self.device
        assert device is not None
        if self.model.status().hash.hex() == BOOT.digest:
            try:
                assert not self.attempt(device.readback), "it came with the firmware"
            except Refused as refusal:
                if refusal.reason != Reason.READBACK:
                    raise
        elif image := self.attempt(device.readback):
            assert image[0] == TABLES[self.model.status().hash.hex()]

    @precondition(lambda self: self.device is not None)
    @rule(back_after=st.floats(0.1, 3.0))
    def unplug(self, back_after: float) -> None:
        """And plug it in again while the client asks."""
        device = self.device
        assert device is not None
        self.line.there = False
        back_at = self.line.now() + back_after
        sleep = self.line.sleep

        def slept(seconds: float) -> None:
            sleep(seconds)
            self.line.there = self.line.now() >= back_at

        device._session._sleep = slept
        if status := self.attempt(device.status):
            assert status[0].boot == self.model.boot
        self.line.there = True

    @rule()
    def reset(self) -> None:
        """Of the device: it plays what is in its firmware."""
        self.model.reboot()
        self.model.tick(1)
        self.allowed, self.was_reset = {BOOT.digest}, True

    @rule(seconds=st.floats(0.0, 1.0))
    def wait(self, seconds: float) -> None:
        self.line.sleep(seconds)

    @invariant()
    def nothing_else_is_in_force(self) -> None:
        if hasattr(self, "model"):
            assert self.model.status().hash.hex() in self.allowed


Instrument.TestCase.settings = settings(max_examples=80, stateful_step_count=20, deadline=None)
TestInstrument = Instrument.TestCase


class Hasty(Uploader):
    """Takes COMMIT for done as soon as it is sent."""

    def _take(self, answer: object) -> object:  # type: ignore[override]
        return (0, None) if self._committed else super()._take(answer)  # type: ignore[arg-type]


def test_a_client_that_does_not_wait_for_the_commit_is_caught(monkeypatch: pytest.MonkeyPatch) -> None:
    """Negative control of the machine's own assertion."""
    monkeypatch.setattr("tablegen.link.device.Uploader", Hasty)
    device_model = model(checking=40000)
    line = VirtualLine(device_model)
    with client(line) as device, pytest.raises(NotPlaying):
        device.upload(SCANS[0].image(False))
