"""``tablegen save``, ``slots``, ``select``, ``confirm``, ``delete``, ``play`` and ``upload --store`` on a model."""

import json
from pathlib import Path

import pytest
from building import Variant, build
from client_rig import BOOT, KEY, Bench, info_for, model
from cut_flash import CutFlash
from link_images import resealed
from replacing import replace

from tablegen.link.messages import DeviceInfo, Feature, More
from tablegen.link.prepare import PreparedScan
from tablegen.link.store import Layout

LAYOUT = Layout(base=0, sector_bytes=4096, place_sectors=3, slots=3)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build(tmp_path_factory.mktemp("example"), Variant({"timing.lines": 40})).folder


@pytest.fixture(scope="module")
def scan(folder: Path) -> PreparedScan:
    return PreparedScan.of_build(folder)


def storing(info: DeviceInfo, layout: Layout = LAYOUT, key: bytes = b"") -> Bench:
    """A device with an empty flash."""
    flash = CutFlash(layout.place(layout.slots + 1), layout.sector_bytes)
    info = replace(info, features=info.features | Feature.STORE)
    return Bench(model(info, key, BOOT, flash=(flash, layout)))


@pytest.fixture
def bench(scan: PreparedScan) -> Bench:
    return storing(info_for(scan))


def restart(bench: Bench) -> None:
    """Switch the device off and on."""
    bench.device.reboot()
    bench.device.tick(1)


def test_a_scan_is_kept_selected_and_plays_after_a_start(bench: Bench, folder: Path, scan: PreparedScan) -> None:
    digest, size = scan.digest[:12], len(scan.image("table").data)
    first = bench.run("upload", folder, "--store", "1")
    assert (first.status, first.err) == (0, "")
    assert first.out.splitlines()[2:] == [
        f"slot 1 keeps {digest}, {size} bytes; `tablegen select 1` lets it play after a start",
        "the device is parked; start the scan with `tablegen trigger`",
    ]
    assert bench.run("select", "1").out == "slot 1 plays after a start\n"
    assert bench.run("save", "1").out == f"slot 1 keeps {digest}, {size} bytes; it plays after a start\n"
    restart(bench)
    assert bench.device.status().hash.hex() == scan.digest
    shown = bench.run("slots")
    assert (shown.status, shown.err) == (0, "")
    assert shown.out.splitlines() == [
        "slot  content",
        "   0  empty",
        f"   1  {digest}, {size} bytes",
        "   2  empty",
        "",
        "selected     slot 1, which plays after a start",
        "this start   began with slot 1",
        f"room         {LAYOUT.room} bytes a slot",
    ]
    assert bench.run("delete", "1").out == "slot 1 is empty; the scan of the firmware plays after a start\n"
    assert bench.run("delete", "1").status == 9


def test_a_trial_is_shown_and_confirmed(bench: Bench, folder: Path) -> None:
    bench.run("upload", folder, "--store", "2")
    tried = bench.run("select", "2", "--trial")
    assert tried.out == "slot 2 plays after the next start, as a trial: run `tablegen confirm` then to select it\n"
    assert "trial        slot 2, which plays after the next start, to be confirmed then" in bench.run("slots").out
    early = bench.run("confirm")
    assert (early.status, early.out) == (9, "")
    assert "(trial): no trial plays since the last start" in early.err
    restart(bench)
    assert "trial        slot 2, over at the next start; `tablegen confirm` selects it" in bench.run("slots").out
    assert bench.run("confirm").out == "slot 2 plays after a start\n"
    assert bench.run("select", "firmware").out == "the scan of the firmware plays after a start\n"


def test_slots_as_json(bench: Bench, folder: Path, scan: PreparedScan) -> None:
    image = scan.image("table")
    bench.run("upload", folder, "--store", "0")
    bench.run("select", "0", "--trial")
    found = json.loads(bench.run("slots", "--json").out)
    empty = {"content": "empty", "hash": None, "image_bytes": None, "image_crc": None}
    kept = {"content": "program", "hash": scan.digest, "image_bytes": len(image.data)}
    assert found == {
        "programs": [],
        "slots": [
            {"slot": 0, **kept, "image_crc": image.info.image_crc},
            {"slot": 1, **empty},
            {"slot": 2, **empty},
        ],
        "selected": None,
        "trial": 0,
        "started": False,
        "start": None,
        "reason": None,
        "room": LAYOUT.room,
        "while_playing": False,
    }


def test_a_scan_that_does_not_pass_at_a_start_is_reported(scan: PreparedScan, folder: Path) -> None:
    bench = storing(info_for(scan))
    bench.run("upload", folder, "--store", "0")
    bench.run("select", "0")
    bench.device._bank._info = replace(bench.device.info, x_limits=replace(bench.device.info.x_limits, max_step=1))
    restart(bench)
    shown = bench.run("slots").out
    assert (
        "this start   began with the scan of the firmware\n             another scan was due, but refused (step)"
        in shown
    )
    assert json.loads(bench.run("slots", "--json").out)["reason"] == "step"


def test_nothing_is_sent_that_could_not_be_saved(scan: PreparedScan, folder: Path) -> None:
    size = len(scan.image("table").data)
    small = storing(info_for(scan), Layout(0, 4096, 1, 2))
    refused = small.run("upload", folder, "--store", "2")
    assert (refused.status, refused.out) == (9, "")
    assert refused.err.splitlines() == [
        "there is no slot 2; the device has slots 0 to 1",
        f"the tables need {size} bytes; a slot has room for 4032",
    ]
    assert small.device.player.swaps == 1


def test_a_scan_that_plays_is_parked_first(bench: Bench, folder: Path) -> None:
    bench.run("upload", folder)
    bench.run("trigger")
    for arguments in (("save", "0"), ("upload", folder, "--store", "0"), ("confirm",)):
        refused = bench.run(*arguments)
        assert (refused.status, refused.out) == (9, "")
        assert "cannot write its flash while a scan plays; `tablegen park --wait` first" in refused.err
    bench.run("park", "--wait")
    assert bench.run("upload", folder, "--store", "0").status == 0  # it is active already


def test_a_key_is_needed(scan: PreparedScan, folder: Path, tmp_path: Path) -> None:
    bench = storing(info_for(scan), key=KEY)
    file = tmp_path / "key"
    file.write_text(KEY.hex())
    file.chmod(0o600)
    assert bench.run("upload", folder, "--store", "0", "--key-file", file).status == 0
    for arguments in (("save", "0"), ("select", "0"), ("delete", "0"), ("confirm",)):
        refused = bench.run(*arguments)
        assert (refused.status, "the device has a key" in refused.err) == (9, True)
    assert bench.run("select", "0", "--key-file", file).status == 0
    assert bench.run("slots").status == 0


def test_a_device_that_keeps_nothing(scan: PreparedScan, folder: Path) -> None:
    bench = Bench(model(info_for(scan), boot=BOOT))
    for arguments in (("slots",), ("save", "0"), ("select", "0"), ("delete", "0"), ("upload", folder, "--store", "0")):
        refused = bench.run(*arguments)
        assert (refused.status, refused.out) == (9, "")
        assert "the device keeps no programs: its firmware was built without DAC_STORE" in refused.err
    assert bench.device.player.swaps == 1


def with_programs(scan: PreparedScan, slots: bool) -> Bench:
    """A device with a compiled program, and one more in its slot 2."""
    info = replace(info_for(scan), more=More.PLAY)
    kept = {}
    if slots:
        flash = CutFlash(LAYOUT.place(LAYOUT.slots + 1), LAYOUT.sector_bytes)
        info = replace(info, features=info.features | Feature.STORE)
        kept = {"flash": (flash, LAYOUT)}
    image = scan.image("table")
    other = resealed(replace(image, info=replace(image.info, hash=bytes(range(32)))), image.data)
    return Bench(model(info, boot=BOOT, compiled={"square_40": other}, **kept))


def test_programs_play_by_number_name_and_hash(scan: PreparedScan, folder: Path) -> None:
    bench = with_programs(scan, slots=True)
    assert bench.run("upload", folder, "--store", "2").status == 0
    shown = bench.run("slots").out.splitlines()
    rows = ["number  program", "     0  square_40, 000102030405", f"     3  slot 2, {scan.digest[:12]}", ""]
    assert shown[:5] == [*rows, "slot  content"]
    assert json.loads(bench.run("slots", "--json").out)["programs"] == [
        {"number": 0, "name": "square_40", "slot": None, "hash": bytes(range(32)).hex()},
        {"number": 3, "name": None, "slot": 2, "hash": scan.digest},
    ]
    parked = "the device is parked; start the scan with `tablegen trigger`\n"
    for generation, (program, number, digest) in enumerate(
        (("0", 0, "000102030405"), (scan.digest[:12], 3, scan.digest[:12]), ("square_40", 0, "000102030405")), 3
    ):
        played = bench.run("play", program)
        assert (played.status, played.err) == (0, "")
        assert played.out == f"program {number} ({digest}) is active, generation {generation}\n{parked}"
    for program, message in (
        ("1", "refused PLAY (number): there is no program of this number; the device has numbers 0 to 3"),
        ("square_4", "the device has no program 'square_4'; `tablegen slots` lists those that it has"),
    ):
        refused = bench.run("play", program)
        assert (refused.status, refused.out) == (9, "")
        assert message in refused.err
    assert "--swap keep: the device starts a new scan at the next line" in bench.run("play", "0", "--swap", "keep").err


def test_programs_of_a_device_without_slots(scan: PreparedScan) -> None:
    bench = with_programs(scan, slots=False)
    assert bench.run("slots").out == "number  program\n     0  square_40, 000102030405\n"
    assert json.loads(bench.run("slots", "--json").out)["slots"] == []


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("save", "15"), "15 is not in the range 0<=x<=14"),
        (("select", "fifteen"), "'fifteen' is neither a slot, 0 to 14, nor the word firmware"),
        (("select", "15"), "'15' is neither a slot"),
        (("select", "firmware", "--trial"), "--trial needs the number of a slot"),
        (("delete", "-1"), "No such option"),
    ],
)
def test_wrong_usage(arguments: tuple[str, ...], message: str, bench: Bench) -> None:
    wrong = bench.run(*arguments)
    assert (wrong.status, wrong.out) == (2, "")
    assert message in wrong.err
