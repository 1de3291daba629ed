"""Uploads of a scan with a sine on its fast axis: to devices that play tables of pixels, and to those that do not."""

from pathlib import Path

import pytest
from client_rig import Bench, VirtualLine, Watched, client, info_for, model
from editing import run
from replacing import replace
from sine_scans import short_sine

from tablegen.api.build import build as build_scan
from tablegen.api.live import Live
from tablegen.api.live_preview import preview_words
from tablegen.link.messages import AxisLimits, DeviceInfo, More, Request
from tablegen.link.prepare import PreparedScan
from tablegen.link.program_image import PROGRAM_BYTES, pixel_part, take_apart
from tablegen.link.word_difference import differences

pytestmark = pytest.mark.common

PIXELS = 48


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sine")
    setup = short_sine(folder)
    build_scan(setup, folder / "out")
    return folder / "out"


@pytest.fixture(scope="module")
def scan(folder: Path) -> PreparedScan:
    return PreparedScan.of_build(folder)


def info_with_tables(scan: PreparedScan, **changes: object) -> DeviceInfo:
    """A device with memory for a table of pixels."""
    return info_for(scan, **({"more": More.PIXEL_TABLES, "table_pixels": PIXELS} | changes))


def test_the_table_follows_the_words_of_y(scan: PreparedScan) -> None:
    image = scan.image("table")
    contents = take_apart(image.data, image.info.x, image.info.y)
    part = pixel_part(contents.words)
    assert (part.length, part.size) == (2 * PIXELS, 2)
    assert contents.pixel_ticks is not None
    assert tuple(map(tuple, contents.pixel_ticks.tolist())) == scan.program.schedule.pixel_table
    plain = replace(scan, program=replace(scan.program, schedule=replace(scan.program.schedule, pixel_table=None)))
    without = plain.image("table").data
    assert image.data[PROGRAM_BYTES : -4 * PIXELS] == without[PROGRAM_BYTES:]
    assert [at for at in range(PROGRAM_BYTES) if image.data[at] != without[at]] == [4 * 14]


def test_upload_and_readback(folder: Path, scan: PreparedScan) -> None:
    bench = Bench(model(info_with_tables(scan)), tick_hz=2_000_000)
    outcome = bench.run("upload", folder)
    assert outcome.status == 0, outcome.err
    assert outcome.out.startswith(f"annexin_200nm {scan.digest[:12]} is active, generation 2")
    playing = bench.device.player.playing
    assert playing is not None
    assert playing.schedule.pixel_table == scan.program.schedule.pixel_table
    read = bench.run("readback", folder)
    assert (read.status, read.out.split(":")[1]) == (0, f" {len(scan.image('table').data)} bytes, all equal\n")
    assert bench.run("upload", folder.parent / "scan.toml").out.count("is already active") == 1


def test_a_readback_names_the_pixel_that_differs(scan: PreparedScan) -> None:
    data = bytearray(scan.image("table").data)
    data[-1] ^= 128
    data[4 * 14] ^= 2
    names = {difference.word: difference.actual for difference in differences(scan, bytes(data))}
    assert list(names) == ["scan: pixel_table", f"scan: pixel word {2 * PIXELS - 1}"]
    assert names[f"scan: pixel word {2 * PIXELS - 1}"] > 1 << 15  # type: ignore[operator]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"more": More(0), "table_pixels": 0}, "build its firmware with DAC_PIXEL_TABLE=1 and memory for a table"),
        ({"table_pixels": PIXELS - 1}, f"a table of {PIXELS} pixels; the device has memory for {PIXELS - 1}"),
    ],
)
def test_a_device_without_room_gets_nothing(
    changes: dict[str, object], message: str, folder: Path, scan: PreparedScan
) -> None:
    bench = Bench(model(info_with_tables(scan, **changes)))
    bench.open = lambda url, baud: setattr(bench, "line", Watched(bench.device)) or bench.line  # type: ignore[method-assign]
    outcome = bench.run("upload", folder)
    assert (outcome.status, message in outcome.err) == (9, True), outcome.err
    assert bench.line.count(Request.BEGIN) == 0  # type: ignore[attr-defined]


def test_a_dry_run_prints_sizes(folder: Path, scan: PreparedScan) -> None:
    outcome = run("upload", folder, "--dry-run")
    assert outcome.status == 0
    for form in ("table", "fourier"):
        assert f"{form:<9} {len(scan.image(form).data):>6} " in outcome.out  # type: ignore[arg-type]


def test_hello_has_the_pixels_behind_the_slow_part(scan: PreparedScan) -> None:
    info = info_with_tables(scan)
    hello = info.hello(model(info).status())
    assert hello[132:] == bytes([4, 0, 0, 0, 0, 0, PIXELS, 0])
    assert DeviceInfo.unpack(hello) == info
    both = replace(info, more=More.PIXEL_TABLES | More.SLOW_PARTS, slow_knots=17, slow_index_bits=6)
    assert DeviceInfo.unpack(both.hello(model(info).status())) == both
    assert DeviceInfo.unpack(hello[:-1]).table_pixels == 0


def test_a_move_is_no_preview_of_other_pixels(scan: PreparedScan) -> None:
    program = scan.program
    assert preview_words(program, program) is not None  # type: ignore[arg-type]
    other = replace(program, schedule=replace(program.schedule, pixel_table=None))
    assert preview_words(program, other) is None  # type: ignore[arg-type]


def test_live_sends_a_zoom_with_its_pixels(folder: Path, scan: PreparedScan) -> None:
    limits = AxisLimits(0, 65535, 65535, 1 << 16)
    with client(VirtualLine(model(info_with_tables(scan, x_limits=limits, y_limits=limits)))) as device:
        zoomed = Live(device, folder.parent / "scan.toml").zoom(0.98)
        assert device.status().hash.hex() == zoomed.digest != scan.digest
