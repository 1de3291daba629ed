"""Uploads by the real client to the real C device over a line with every fault: no wrong line is ever played.

That the rig would see one is shown by devices and a client that are broken on purpose.
"""

from collections import Counter
from pathlib import Path
from random import Random

import pytest
from fault_trial import Instrument, Trial
from line_log import WrongLine
from link_device import DeviceLibrary, compile_device
from link_faults import KINDS, MIXED, Chances
from link_line import Line
from link_programs import INFO, SmallScan, make_scan
from sets import long

from tablegen.base.resources import c_link, c_runtime
from tablegen.link.device import Device
from tablegen.link.errors import LinkError, Refused
from tablegen.link.exchange import Exchange
from tablegen.link.messages import Request
from tablegen.link.model_device import ModelDevice
from tablegen.link.players import LinePlayer

pytestmark = pytest.mark.common

UPLOADS = 4  # of a trial
_KEY = bytes(range(20))
_FLIPS = Chances(flip=0.003)


def _upload_some(trial: Trial) -> None:
    for number in range(UPLOADS):
        trial.upload(number)


def _try(seeds: range, chances: Chances, key: bytes = b"") -> tuple[Counter[str], Counter[str]]:
    """What became of so many uploads, and the faults there were."""
    outcomes: Counter[str] = Counter()
    faults: Counter[str] = Counter()
    for seed in seeds:
        trial = Trial(seed, chances, key=key)
        _upload_some(trial)
        trial.end()
        outcomes += Counter(trial.outcomes)
        faults += trial.line.out.done + trial.line.back.done
    return outcomes, faults


@pytest.mark.parametrize("part", range(3))
def test_mixed_faults(part: int) -> None:
    outcomes, faults = _try(range(5 * part, 5 * part + 5), MIXED)
    assert outcomes.total() == 20
    assert outcomes["in force"] >= 16
    assert len(faults) >= 9


@pytest.mark.rest
@pytest.mark.parametrize("part", long(range(2), range(10)))
def test_a_thousand_uploads(part: int) -> None:
    outcomes, faults = _try(range(100 + 25 * part, 125 + 25 * part), MIXED)
    assert outcomes.total() == 100
    assert outcomes["in force"] >= 90
    assert set(faults) == set(KINDS)


def test_a_line_that_is_worse() -> None:
    """Here many uploads fail, and say so in time."""
    outcomes, _ = _try(range(4), MIXED.times(4.0))
    assert outcomes.total() == 16
    assert len(outcomes) > 1


def test_a_device_with_a_key() -> None:
    outcomes, _ = _try(range(4), MIXED, _KEY)
    assert outcomes["in force"] >= 12


def test_a_seed_makes_the_same_faults_again() -> None:
    ends = []
    for _ in range(2):
        trial = Trial(7, MIXED.times(2.0))
        _upload_some(trial)
        ends.append((trial.line.now_s, trial.outcomes, trial.line.out.done, trial.line.back.done))
    assert ends[0] == ends[1]


@pytest.mark.parametrize("kind", KINDS)
def test_each_fault_alone(kind: str) -> None:
    """None of them stops an upload for good."""
    chance = 0.002 if kind in ("drop", "flip", "insert", "double") else 0.02 if kind in ("reset", "vanish") else 0.1
    outcomes, faults = _try(range(2), Chances(**{kind: chance}))
    assert faults[kind]
    assert outcomes["in force"] >= 6


# A model of a device in place of C


@pytest.mark.parametrize("staged", [False, True])
@pytest.mark.parametrize("checking", [0, 150])
def test_the_model_of_a_device(staged: bool, checking: int) -> None:
    for seed in range(4):
        _upload_to_model(seed, staged, checking)


def _upload_to_model(seed: int, staged: bool, checking: int) -> None:
    boot = make_scan(0)
    device = ModelDevice(INFO, LinePlayer(boot.program), staged=staged, checking=checking)
    line = Line(device, chances=MIXED, seed=seed)
    random = Random(seed)
    for number in range(UPLOADS):
        image = make_scan(1000 * seed + number + 1).image(fourier=number % 2 == 0)
        start = line.now_s
        try:
            with Device(line.open, random=random, sleep=line.sleep) as client:
                client.arm()
                client.trigger()
                start, resets = line.now_s, line.resets
                client.upload(image, timeout_s=8.0)
                if line.resets == resets:
                    assert device.status().hash == image.info.hash
        except Refused:
            raise
        except LinkError:
            line.sleep(1.0)
        assert line.now_s - start < 11.0


# Broken on purpose


def _changed(folder: Path, file: str, changes: dict[str, str]) -> DeviceLibrary:
    """The device with some places of a source file changed."""
    sources = []
    for path in [*c_runtime(), *c_link()]:
        if path.name == file:
            text = path.read_text("utf-8")
            for old, new in changes.items():
                assert text.count(old) == 1, old
                text = text.replace(old, new)
            path = folder / file
            path.write_text(text, "utf-8")
        sources.append(path)
    return DeviceLibrary(compile_device(folder / "changed.so", sources=sources))


class _Damage:
    """A low bit of a table word turns over when the first COMMIT arrives: only a CRC can see that."""

    def __init__(self, scan: SmallScan) -> None:
        self.done = False
        self._word = int(scan.program.x.words[17]) ^ 0x40

    def __call__(self, instrument: Instrument, frame: bytes) -> None:
        if frame[1:2] == bytes([Request.COMMIT]) and not self.done:
            self.done = True
            instrument.device.poke(0, 17, self._word)


def _damaged(library: DeviceLibrary | None = None) -> Trial:
    """An upload of a table that is damaged in memory."""
    damage = _Damage(make_scan(1001))
    trial = Trial(1, Chances(), on_frame=damage, library=library)
    trial.upload(0)
    assert damage.done
    return trial


def test_damaged_memory_is_seen_by_the_device() -> None:
    assert _damaged().outcomes == ["in force"]  # at the second try


def test_a_device_that_does_not_check_the_image_is_caught(tmp_path: Path) -> None:
    changed = _changed(tmp_path, "dac_link_check.c", {"*done && ~c->crc !=": "false && ~c->crc !="})
    with pytest.raises(WrongLine):
        _damaged(changed)


def test_a_device_that_does_not_check_frames_is_caught(tmp_path: Path) -> None:
    """It obeys, or objects to, what nobody has sent."""
    changed = _changed(tmp_path, "dac_link_frame.c", {" && r->crc == WHOLE;": ";"})
    caught = 0
    for seed in range(4):
        trials = [Trial(seed, _FLIPS), Trial(seed, _FLIPS, library=changed)]
        _upload_some(trials[0])
        try:
            _upload_some(trials[1])
        except AssertionError:
            caught += 1
    assert caught


@pytest.mark.parametrize(
    "changes",
    [
        {"(s->running && s->tick != 0)": "false"},
        {
            "(s->running && s->tick != 0)": "false",
            "    if (s->running)\n        begin(s);\n    return true;": "    return true;",
        },
    ],
    ids=["cuts the line off", "mixes programs in a line"],
)
def test_a_device_that_swaps_in_mid_line_is_caught(tmp_path: Path, changes: dict[str, str]) -> None:
    changed = _changed(tmp_path, "dac_sequencer.c", changes)
    with pytest.raises(WrongLine):
        _upload_some(Trial(2, Chances(), library=changed))


def _deaf_upload(trial: Trial) -> SmallScan:
    """A client that sends everything once, and takes it for done."""
    scan = make_scan(1)
    image = scan.image(fourier=False)
    trial.instrument.check.offer(scan.digest, scan.program)
    with trial.client() as device:
        device.arm()
        device.trigger()
    exchange = Exchange(trial.line.open(), 0.016, Random(3))
    exchange.send(Request.HELLO, 0, b"\1")
    exchange.send(Request.BEGIN, 1, image.info.pack())
    for at in range(0, len(image.data), 240):
        exchange.send(Request.DATA, 2, at.to_bytes(4, "little") + image.data[at : at + 240])
    exchange.send(Request.COMMIT, 3, image.info.image_crc.to_bytes(4, "little"))
    trial.line.sleep(0.5)
    return scan


def test_a_client_that_ignores_acknowledgements_is_caught() -> None:
    """It is right on a line without faults, and wrong on a line that loses what it does not repeat."""
    well = Trial(0, Chances())
    assert _deaf_upload(well).digest in well.instrument.check.taken.values()
    missing = 0
    for seed in range(10):
        trial = Trial(seed, Chances(lose=0.1))
        missing += _deaf_upload(trial).digest not in trial.instrument.check.taken.values()
        trial.end()
    assert missing
