"""The commands that talk to a device: what they print, and each exit status; in this process and on virtual lines."""

import json
from collections.abc import Iterator
from pathlib import Path
from unittest.mock import patch

import pytest
from building import Variant, build
from client_line import VirtualLine
from client_rig import BOOT, KEY, Bench, info_for, model
from editing import run
from link_programs import INFO
from replacing import replace

from tablegen.cli.shared.progress_bar import Bar
from tablegen.link.frames import FrameReader
from tablegen.link.messages import DeviceInfo, Feature, Reason, Request
from tablegen.link.prepare import PreparedScan

COMMANDS = ("upload", "live", "status", "readback", "park", "trigger", "clear", "ports")
COMMANDS += ("save", "slots", "select", "confirm", "delete", "play")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build(tmp_path_factory.mktemp("example"), Variant({"timing.lines": 40})).folder


@pytest.fixture(scope="module")
def scan(folder: Path) -> PreparedScan:
    return PreparedScan.of_build(folder)


@pytest.fixture
def info(scan: PreparedScan) -> DeviceInfo:
    return info_for(scan)


@pytest.fixture
def bench(info: DeviceInfo) -> Bench:
    return Bench(model(info, boot=BOOT))


@pytest.fixture
def no_environment(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.delenv("TABLEGEN_PORT", raising=False)
    monkeypatch.delenv("TABLEGEN_BAUD", raising=False)
    return


def type_of(piece: bytes) -> int:
    """Of the frame that a piece is."""
    frames = FrameReader().feed(piece)
    return frames[0].type if frames else 0


# upload


def test_an_upload_says_what_came_of_it(bench: Bench, folder: Path, scan: PreparedScan) -> None:
    first = bench.run("upload", folder)
    assert (first.status, first.err) == (0, "")
    name = f"annexin_200nm {scan.digest[:12]}"
    lines = first.out.splitlines()
    assert lines[0] == f"{name} is active, generation 2, after line 0 of the old scan"
    assert lines[1].startswith(f"{len(scan.image('fourier').data)} bytes as Fourier words in 0.")
    assert lines[1].endswith(" kB/s)")
    assert lines[2:] == ["the device is parked; start the scan with `tablegen trigger`"]
    bench.run("trigger")
    again = bench.run("upload", folder)
    assert again.out == f"{name} is already active, generation 2: nothing sent (--force sends it again)\n"
    forced = bench.run("upload", folder, "--force", "--as", "table", "--baud", "460800")
    assert forced.out.startswith(f"{name} is active, generation 3")
    assert f"{len(scan.image('table').data)} bytes as tables in " in forced.out
    assert bench.asked == [*[("virtual", 115200)] * 3, ("virtual", 460800)]


def test_a_running_scan_is_swapped_as_asked(bench: Bench, folder: Path, info: DeviceInfo) -> None:
    refused = bench.run("upload", folder, "--swap", "keep", "--dry-run")
    assert (refused.status, refused.err.count("\n")) == (9, 1)
    assert "--swap keep: the device starts a new scan at the next line, from line 0; build its firmware" in refused.err
    modes = Bench(model(replace(info, features=info.features | Feature.COMMIT_MODES), boot=BOOT))
    assert modes.run("upload", folder, "--swap", "frame").status == 0
    wrong = modes.run("upload", folder, "--swap", "now")
    assert (wrong.status, "'line', 'keep', 'frame'" in wrong.err) == (2, True)


def test_a_scan_is_built_and_uploaded(folder: Path, bench: Bench) -> None:
    shown = bench.run("upload", folder.parent / "annexin_200nm.toml")
    assert shown.status == 0
    assert shown.out.startswith("annexin_200nm ")


def test_port_and_rate_come_from_the_environment(bench: Bench, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TABLEGEN_PORT", "mine")
    monkeypatch.setenv("TABLEGEN_BAUD", "9600")
    with patch("tablegen.link.device.open_port", bench.open):
        assert run("status").status == 0
        assert run("status", "--port", "other", "--baud", "19200").status == 0
    assert bench.asked == [("mine", 9600), ("other", 19200)]


@pytest.mark.usefixtures("no_environment")
def test_a_dry_run_without_a_port_tells_sizes_and_times(folder: Path, scan: PreparedScan) -> None:
    outcome = run("upload", folder, "--dry-run", "--baud", "9600")
    assert (outcome.status, outcome.err) == (0, "")
    lines = outcome.out.splitlines()
    assert lines[0] == f"annexin_200nm {scan.digest[:12]}"
    assert lines[2] == "form       bytes  at 9600 baud"
    rows = {line.split()[0]: line.split()[1:] for line in lines[3:]}
    assert {name: int(row[0]) for name, row in rows.items()} == {
        "table": len(scan.image("table").data),
        "fourier": len(scan.image("fourier").data),
    }
    # 8384 bytes are 34 frames of 240 and one of 224: 12 bytes of frame, 4 of offset; BEGIN 60, COMMIT 16.
    assert float(rows["table"][1]) == pytest.approx((8384 + 35 * 16 + 76) * 10 / 9600, abs=6e-4)


def test_a_dry_run_with_a_port_asks_and_sends_nothing(bench: Bench, folder: Path, info: DeviceInfo) -> None:
    outcome = bench.run("upload", folder, "--dry-run")
    assert outcome.status == 0
    assert outcome.out.splitlines()[-1].startswith("the device would accept the scan: ")
    assert bench.device.status().received == 0
    assert bench.device.status().hash.hex() == BOOT.digest
    bench.device.permits = False
    assert "its interlock is open" in bench.run("upload", folder, "--dry-run").out
    bench.device.permits = True
    bench.run("upload", folder)
    assert bench.run("upload", folder, "--dry-run").out.splitlines()[-1] == "the scan is already active on the device"
    small = Bench(model(replace(info, image_bytes=500)))
    outcome = small.run("upload", folder, "--dry-run")
    assert (outcome.status, outcome.err.count("\n")) == (9, 1)
    assert "bytes; the device accepts 500: " in outcome.err


@pytest.mark.parametrize("options", [(), ("--dry-run",)])
def test_a_dry_run_without_the_key_ends_as_the_upload_does(
    options: tuple[str, ...], folder: Path, info: DeviceInfo, tmp_path: Path
) -> None:
    """With one it says that the key is not tried; of a scan that is active neither needs it, unless forced."""
    keyed = Bench(model(replace(info, features=info.features | Feature.KEY), boot=BOOT, key=KEY))
    outcome = keyed.run("upload", folder, *options)
    assert (outcome.status, outcome.err) == (
        9,
        "the device has a key, and refuses COMMIT without it; give the key of this device (--key-file FILE)\n",
    )
    assert "would accept" not in outcome.out
    assert keyed.device.status().received == 0
    key_file = tmp_path / "key"
    key_file.write_text(KEY.hex(), "ascii")
    key_file.chmod(0o600)
    outcome = keyed.run("upload", folder, *options, "--key-file", key_file)
    assert outcome.status == 0
    assert outcome.out.rstrip().endswith("if the key is right, which only an upload shows") == bool(options)
    keyed.run("upload", folder, "--key-file", key_file)
    assert "already active" in keyed.run("upload", folder, *options).out
    assert keyed.run("upload", folder, *options, "--force").status == 9


def test_a_direct_table_is_said_to_have_no_fourier_form(tmp_path: Path) -> None:
    direct = build(tmp_path, Variant({"x.table": {"mode": "direct", "bits": 16}, "timing.lines": 40})).folder
    outcome = run("upload", direct, "--dry-run")
    assert outcome.status == 0
    assert "fourier   none: x: a direct table cannot be computed" in outcome.out
    with patch("tablegen.link.device.open_port", Bench(model()).open):
        outcome = run("upload", direct, "--as", "fourier", "--port", "virtual")
    assert (outcome.status, outcome.out) == (9, "")


# status, park, trigger, clear, readback


def test_status_in_words(bench: Bench, folder: Path, scan: PreparedScan) -> None:
    shown = bench.run("status")
    assert (shown.status, shown.err) == (0, "")
    rows = dict(line.split(maxsplit=1) for line in shown.out.splitlines())
    assert rows["state"].startswith("parked; start the scan with") or rows["state"] == "ramping to the park codes"
    assert rows["scan"] == f"{BOOT.digest[:12]}, generation 1"
    assert rows["upload"] == "none in progress"
    assert rows["faults"] == "none"
    assert rows["device"].startswith("500000 ticks/s, accepts tables and Fourier words of 64 harmonics")
    assert rows["x"].startswith("2^11 words of 16 bits, codes 0..65535 of 16 bits, steps up to 2621")
    assert "interlock" not in rows
    bench.run("upload", folder)
    bench.run("trigger")
    rows = dict(line.split(maxsplit=1) for line in bench.run("status").out.splitlines())
    assert rows["state"].startswith("playing, line ")
    assert rows["scan"] == f"{scan.digest[:12]}, generation 2"


def test_status_of_a_device_that_waits_for_much(info: DeviceInfo) -> None:
    features = info.features | Feature.INTERLOCK
    bench = Bench(model(replace(info, features=features, update_rate_hz=0), KEY, boot=None))
    bench.device.permits = False
    bench.device.player.faults, bench.device.player.fault_counts = 5, (3, 0, 1, 0)  # type: ignore[misc]
    rows = dict(line.split(maxsplit=1) for line in bench.run("status").out.splitlines())
    assert rows["state"] == "no scan yet; send one with `tablegen upload`"
    assert rows["scan"] == "hash unknown, generation 0"
    assert rows["faults"] == "slew 3, overrun 1; clear with `tablegen clear`"
    assert rows["interlock"] == "open: no upload can become active"
    assert "rate unknown" in rows["device"]
    assert rows["device"].endswith("has a key")


def test_status_in_json(bench: Bench) -> None:
    shown = json.loads(bench.run("status", "--json").out)
    status, device = shown["status"], shown["device"]
    assert status["hash"] == BOOT.digest
    assert status["state"] in ("parked", "parking")
    assert (status["faults"], status["fault_counts"]["slew"], status["permits"]) == ([], 0, True)
    assert (device["features"], device["window"]) == (["tables", "fourier", "readback", "narrows"], INFO.window)
    assert device["axes"]["x"]["limits"] == device["axes"]["x"]["limits_in_force"]
    assert device["axes"]["y"]["index_bits"] == 11


def test_trigger_and_park(bench: Bench, folder: Path) -> None:
    bench.run("upload", folder)
    assert bench.run("trigger").out == "plays until it is parked\n"
    assert bench.run("trigger").out.startswith("already playing, line ")
    counted = bench.run("trigger", "--frames", "2")
    assert (counted.status, counted.out) == (9, "")
    assert "`tablegen park --wait` first" in counted.err
    bench.options["tick_hz"] = 200  # some ticks of ramp, and a few ms from PARK to STATUS
    assert bench.run("park").out == "ramping to the park codes\n"
    bench.options["tick_hz"] = 500_000
    assert bench.run("park", "--wait").out == "parked\n"
    assert bench.run("park").out == "parked\n"
    assert bench.run("trigger", "--frames", "2").out == "plays 2 frames\n"
    assert bench.run("park", "--wait", "--timeout", "5").out == "parked\n"
    bench.options["tick_hz"] = 500_000_000
    short = bench.run("trigger", "--frames", "1")
    assert (short.status, short.out) in [
        (0, "triggered; 1 frame over, or the scan did not start: see `tablegen status`\n"),
        (0, "plays 1 frame\n"),
    ]
    assert bench.run("clear").out == "faults cleared\n"


def test_trigger_without_a_scan_or_a_clock(info: DeviceInfo) -> None:
    empty = Bench(model(info, boot=None)).run("trigger")
    assert (empty.status, empty.out) == (9, "")
    assert "has no scan yet" in empty.err
    stopped = Bench(model(info), tick_hz=0).run("trigger")
    assert stopped.status == 9
    assert "the device does not play" in stopped.err


def test_park_without_a_scan(info: DeviceInfo) -> None:
    parked = Bench(model(info, boot=None)).run("park")
    assert (parked.status, parked.out) == (0, "the device has no scan yet, and nothing to park\n")


def test_what_a_device_was_asked_is_not_said_to_be_done(bench: Bench) -> None:
    """Its clock stands still: it passes requests on, and nothing comes of them. STATUS shows that."""
    bench.run("trigger")
    bench.options["tick_hz"] = 0
    still = bench.run("park")
    assert (still.status, still.out) == (9, "")
    assert "took the request to park, but still plays" in still.err
    bench.device.player.faults = 1  # type: ignore[misc]
    faulty = bench.run("clear")
    assert (faulty.status, faulty.out) == (9, "")
    assert "but has faults" in faulty.err


@pytest.mark.parametrize(("command", "request_"), [("park", "PARK"), ("trigger", "ARM"), ("clear", "CLEAR")])
def test_without_a_key_the_request_is_named_that_needs_it(info: DeviceInfo, command: str, request_: str) -> None:
    outcome = Bench(model(info, KEY)).run(command)
    assert (outcome.status, outcome.out) == (9, "")
    assert outcome.err == (
        f"the device has a key, and refuses {request_} without it; give the key of this device (--key-file FILE)\n"
    )


def test_a_slow_line_is_named(info: DeviceInfo, folder: Path) -> None:
    class Slow(VirtualLine):
        """At an eighth of the rate that it was opened with."""

        @property
        def _byte_s(self) -> float:
            return 8 * super()._byte_s

    bench = Bench(model(info, boot=BOOT))
    with patch("client_rig.VirtualLine", Slow):
        shown = bench.run("upload", folder, "--as", "table", "--baud", "76800")
    assert shown.status == 0
    assert shown.out.splitlines()[2] == "the line is slow: answers come at about 9600 baud (--baud 9600)"
    assert "baud" not in bench.run("upload", folder, "--as", "table", "--force").out


def test_a_power_cycle_in_mid_upload_is_said_to_be_one(info: DeviceInfo, folder: Path) -> None:
    device = model(info, boot=BOOT)
    bench = Bench(device)

    class Cut(VirtualLine):
        def write(self, data: bytes) -> None:
            if device.boot == 0 and device.status().received > 3000:
                device.reboot()
            super().write(data)

    with patch("client_rig.VirtualLine", Cut):
        outcome = bench.run("upload", folder, "--as", "table")
    assert (outcome.status, device.boot) == (0, 1)
    assert "the device restarted once meanwhile: was its power cut, or" in outcome.out
    assert "its old scan ended" in outcome.out


def test_park_that_does_not_come_about(bench: Bench) -> None:
    bench.run("trigger")
    bench.options["tick_hz"] = 0
    outcome = bench.run("park", "--wait", "--timeout", "1")
    assert (outcome.status, outcome.out) == (10, "")
    assert "did not become parked within 1 s" in outcome.err


def test_readback_compares_and_saves(bench: Bench, folder: Path, scan: PreparedScan, tmp_path: Path) -> None:
    outcome = bench.run("readback", folder)
    assert (outcome.status, outcome.out) == (9, ""), "the scan came with the firmware"
    assert "there is nothing to read" in outcome.err
    bench.run("upload", folder)
    size = len(scan.image("table").data)
    shown = bench.run("readback", folder, "-o", tmp_path / "playing.bin")
    assert (shown.status, shown.err) == (0, "")
    assert shown.out.splitlines() == [
        f"{tmp_path / 'playing.bin'}: {size} bytes",
        f"the device plays annexin_200nm {scan.digest[:12]}: {size} bytes, all equal",
    ]
    assert (tmp_path / "playing.bin").read_bytes() == scan.image("table").data


def test_readback_says_the_first_difference(bench: Bench, folder: Path, scan: PreparedScan) -> None:
    bench.run("upload", folder)

    def damaged(piece: bytes) -> list[bytes]:
        (frame,) = FrameReader().feed(piece)
        if frame.type != Request.READBACK | 0x80:
            return [piece]
        at, data = int.from_bytes(frame.payload[:4], "little"), bytearray(frame.payload)
        for word in (100, 200):
            index = 4 + 192 + 2 * word - at
            if 4 <= index < len(data):
                data[index] ^= 1
        return [replace(frame, payload=bytes(data)).encode()]

    bench.options["spoil_back"] = damaged
    word = int(scan.program.x.words[100])
    outcome = bench.run("readback", folder)
    assert (outcome.status, outcome.out) == (5, "")
    assert outcome.err == (
        "the device plays a different scan than annexin_200nm: "
        f"x: table word 100 (byte 392) is {word ^ 1}, not {word} (and 1 more)\n"
    )


def test_a_key_opens_what_is_locked(tmp_path: Path, folder: Path, info: DeviceInfo) -> None:
    bench = Bench(model(info, KEY))
    path = tmp_path / "key"
    path.write_text(KEY.hex()[:16] + "\n" + KEY.hex()[16:] + "\n", "ascii")
    path.chmod(0o600)
    for command in (("upload", folder), ("park",)):
        outcome = bench.run(*command)
        assert (outcome.status, outcome.out) == (9, "")
        assert "(--key-file FILE)" in outcome.err
        assert bench.run(*command, "--key-file", path).status == 0
    path.write_text(bytes(16).hex(), "ascii")
    assert bench.run("upload", folder, "--force", "--key-file", path).status == 9


def test_a_key_that_others_can_read_is_warned_of(tmp_path: Path, info: DeviceInfo) -> None:
    bench = Bench(model(info, KEY))
    path = tmp_path / "key"
    path.write_text(KEY.hex(), "ascii")
    for mode, warned in ((0o600, False), (0o400, False), (0o640, True), (0o604, True), (0o644, True), (0o620, True)):
        path.chmod(mode)
        outcome = bench.run("park", "--key-file", path)
        assert outcome.status == 0
        assert (
            outcome.err.startswith(f"warning: {path}: others can read the key (mode {mode:04o}): run `chmod 600 ")
            == warned
        )
        assert warned or outcome.err == ""
        assert KEY.hex() not in outcome.out + outcome.err


def test_ports_are_listed() -> None:
    class Port:
        def __init__(self, device: str, description: str | None) -> None:
            self.device, self.description, self.hwid = device, description, "USB VID:PID=0403:6001"

    found = [Port("/dev/ttyUSB1", "FT232R"), Port("/dev/ttyS0", "n/a")]
    with patch("serial.tools.list_ports.comports", lambda: found):
        shown, as_json = run("ports"), run("ports", "--json")
    assert (shown.status, shown.out) == (0, "/dev/ttyS0\n/dev/ttyUSB1  FT232R\n")
    assert [port["port"] for port in json.loads(as_json.out)] == ["/dev/ttyS0", "/dev/ttyUSB1"]


# Help, and the bar


@pytest.mark.parametrize("command", COMMANDS)
def test_help_teaches_and_fits(command: str) -> None:
    outcome = run(command, "--help")
    assert (outcome.status, outcome.err) == (0, "")
    assert max(map(len, outcome.out.splitlines())) <= 100
    if command != "ports":
        for text in ("--port URL", "TABLEGEN_PORT", "TABLEGEN_BAUD", "--key-file FILE", "socket://"):
            assert text in " ".join(outcome.out.split())


def test_the_main_help_names_commands_and_statuses() -> None:
    shown = " ".join(run("--help").out.split())
    for text in (*COMMANDS, "7 no port", "8 no answer", "9 refused by the device", "10 link lost"):
        assert text in shown


def test_the_bar_shows_rate_and_time_left(monkeypatch: pytest.MonkeyPatch) -> None:
    class Terminal:
        def __init__(self) -> None:
            self.text = ""

        def isatty(self) -> bool:
            return True

        def write(self, text: str) -> None:
            self.text += text

        def flush(self) -> None:
            pass

    screen, clock = Terminal(), [0.0]
    monkeypatch.setattr("sys.stderr", screen)
    bar = Bar(lambda: clock[0])
    for now, done in ((0.0, 0), (0.05, 1000), (2.0, 2000), (4.0, 8000)):
        clock[0] = now
        bar(done, 8000)
    bar.close()
    bar.close()
    shown = [line.rstrip() for line in screen.text.split("\r")]
    assert shown == [
        "",
        "[........................] 0/8000 bytes",
        "[######..................] 2000/8000 bytes  1.0 kB/s  6.0 s left",
        "[########################] 8000/8000 bytes  checked, then waiting for a line",
        "",
        "",
    ]


def test_without_a_terminal_there_is_no_bar(bench: Bench, folder: Path) -> None:
    assert bench.run("upload", folder, "--as", "table").err == ""


def test_reasons_reach_the_user_by_name(bench: Bench) -> None:
    bench.device._requests.pop(Request.PARK)
    outcome = bench.run("park")
    assert (outcome.status, outcome.out) == (9, "")
    assert outcome.err.startswith(f"the device refused PARK ({Reason.TYPE.name.lower()}): ")
