"""Uploads of a scan with the output z: to devices with a second sequencer, and to those without."""

import json
from pathlib import Path
from random import Random

import pytest
from client_line import VirtualLine
from client_rig import Bench, LoseOnce, Watched, client, info_for, z_info_for
from editing import run
from link_images import resealed
from replacing import replace
from tilted_scans import with_aux, write_straight, write_tilted

from tablegen.link.claims import check_device
from tablegen.link.device import Device
from tablegen.link.errors import LinkError, NotUnderstood, Refused
from tablegen.link.messages import (
    OF_Z,
    AxisLimits,
    AxisShape,
    DeviceInfo,
    DeviceState,
    DeviceStatus,
    ImageInfo,
    More,
    Reason,
    Request,
)
from tablegen.link.model_device import ModelDevice
from tablegen.link.players import LinePlayer
from tablegen.link.prepare import PreparedScan
from tablegen.link.refusal_reasons import explain, refused
from tablegen.link.word_difference import differences

pytestmark = pytest.mark.common


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = write_straight(tmp_path_factory.mktemp("straight"))
    assert run("build", path, "-o", path.parent / "build", "-q").status == 0
    return path.parent / "build"


@pytest.fixture(scope="module")
def scan(folder: Path) -> PreparedScan:
    return PreparedScan.of_build(folder)


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same scan without z."""
    path = write_straight(tmp_path_factory.mktemp("plain"))
    text = path.read_text("utf-8")
    path.write_text(text[: text.index("[z]")], "utf-8")
    assert run("build", path, "-o", path.parent / "build", "-q").status == 0
    return path.parent / "build"


def device_for(scan: PreparedScan, boot: bool = False, window: int = 8, **changes: object) -> ModelDevice:
    """A device with z that was built for a scan; it boots into it without z, or into nothing."""
    program, info = scan.program if boot else None, replace(z_info_for(scan, **changes), window=window)
    device = ModelDevice(info, LinePlayer(program), z_player=LinePlayer(None))
    device.tick(1)
    return device


def test_upload_status_readback_and_park(folder: Path, scan: PreparedScan) -> None:
    bench = Bench(device_for(scan))
    outcome = bench.run("upload", folder)
    assert outcome.status == 0, outcome.err
    assert f"{len(scan.image('auto').data)} bytes as " in outcome.out
    assert "is already active" in bench.run("upload", folder).out
    read = bench.run("readback", folder)
    assert (read.status, "all equal" in read.out) == (0, True)
    assert bench.run("trigger").status == 0
    text = bench.run("status").out
    assert "output z    follows the scan; faults: none" in text
    assert "\nz           2^" in text
    record = json.loads(bench.run("status", "--json").out)
    assert (record["status"]["z"]["plays"], record["status"]["z"]["state"]) == (True, "playing")
    assert record["device"]["z"]["axes"]["z"]["dac_bits"] == 16
    assert bench.run("park", "--wait").status == 0
    assert bench.device.z_player is not None
    assert bench.device.z_player.state == DeviceState.PARKED
    assert bench.run("clear").status == 0


def test_a_device_without_z_gets_nothing(folder: Path, scan: PreparedScan) -> None:
    device = ModelDevice(info_for(scan), LinePlayer(None))
    device.tick(1)
    bench = Bench(device)
    bench.open = lambda url, baud: setattr(bench, "line", Watched(bench.device)) or bench.line  # type: ignore[method-assign]
    outcome = bench.run("upload", folder)
    assert outcome.status == 9
    assert "the scan has the output z, and the device has none: build its firmware with DAC_LINK_Z=1" in outcome.err
    assert bench.line.count(Request.BEGIN) == 0  # type: ignore[attr-defined]
    assert json.loads(bench.run("status", "--json").out)["device"]["z"] is None


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"slow_knots": 0, "slow_index_bits": 0}, "z has a slow part, for which the device has no memory"),
        ({"slow_index_bits": 3}, "z: a slow table of 64 words; the device holds 8: raise its slow_index_bits"),
        ({"x_limits": AxisLimits(0, 100, 1 << 20, 1 << 20)}, "z: its codes 0..65535 go beyond 0..100 of the device"),
        ({"x": AxisShape(2, 16, 16, 16)}, "z: a table of "),
        ({"y": AxisShape(9, 17, 16, 16)}, "the axis beside z: table words of 16 bits; the device has 17"),
        ({"image_bytes": 300}, "the device accepts 300"),
    ],
)
def test_a_device_whose_z_does_not_fit_gets_nothing(
    changes: dict[str, object], message: str, folder: Path, scan: PreparedScan
) -> None:
    bench = Bench(device_for(scan, **changes))
    bench.open = lambda url, baud: setattr(bench, "line", Watched(bench.device)) or bench.line  # type: ignore[method-assign]
    outcome = bench.run("upload", folder)
    assert outcome.status == 9
    assert message in outcome.err, outcome.err
    assert bench.line.count(Request.BEGIN) == 0  # type: ignore[attr-defined]


def test_a_link_that_is_lost_between_the_images_goes_on_there(scan: PreparedScan) -> None:
    """The port vanishes as soon as a byte of z has arrived; another host ends what the first one began."""
    image = scan.image("table")
    middle = image.info.first.image_bytes
    device = device_for(scan, boot=True, window=1)
    line = VirtualLine(device)

    def vanish(done: int, total: int) -> None:
        line.there = done <= middle

    with client(line) as host, pytest.raises(LinkError, match="port"):
        host.upload(image, vanish, timeout_s=3.0)
    assert middle < device.status().received < len(image.data)
    status = device.status()
    assert (status.generation, status.z is not None and status.z.generation) == (1, 0)
    line.there = True
    with client(line, 2) as host:
        result = host.upload(image)
    assert result.resumed > middle
    status = device.status()
    assert (status.hash.hex(), status.z is not None and status.z.plays) == (scan.digest, True)


@pytest.mark.parametrize("kind", [Request.BEGIN, Request.DATA, Request.COMMIT])
@pytest.mark.parametrize("way", ["spoil_out", "spoil_back"])
def test_a_lost_frame_is_sent_again(kind: Request, way: str, scan: PreparedScan) -> None:
    device = device_for(scan)
    lost = LoseOnce(kind if way == "spoil_out" else kind | 0x80, 2 if kind is Request.DATA else 1)
    with client(VirtualLine(device, **{way: lost})) as host:
        assert host.upload(scan.image("table")).generation == 1
        assert host.readback() == scan.image("table").data
    assert lost.left <= 0


def test_a_refusal_of_z_says_so(scan: PreparedScan) -> None:
    image = scan.image("table")
    data = bytearray(image.data)
    data[image.info.first.image_bytes] ^= 1  # its line_ticks
    device = device_for(scan)
    with client(VirtualLine(device)) as host, pytest.raises(Refused, match="z: its lines, windows and pixels") as error:
        host.upload(resealed(image, bytes(data)))
    assert (error.value.reason, error.value.detail) == (Reason.SCHEDULE, OF_Z)
    assert device.status().generation == 0
    info = device.info
    assert explain(Reason.SHAPE, OF_Z + 1, info).startswith("the axis beside z: its table is too long")
    assert explain(Reason.SLEW, OF_Z + 2 * 7, info).startswith("z: ")
    assert "at most 70000 bytes" in explain(
        Reason.LENGTH, OF_Z + 70000, replace(info, z=replace(info.z, image_bytes=70000))
    )


def test_z_begins_and_ends_on_a_parked_device(folder: Path, plain: Path, scan: PreparedScan) -> None:
    bench = Bench(device_for(scan))
    assert bench.run("upload", plain).status == 0
    assert bench.run("trigger").status == 0
    assert "is not in the scan, and rests at its park code" in bench.run("status").out
    for source, other in ((folder, plain), (plain, folder)):
        outcome = bench.run("upload", source)
        assert outcome.status == 9, other
        assert "has the output z, which begins and ends to play only where no scan plays" in outcome.err
        assert "tablegen park --wait" in outcome.err
        assert bench.run("park", "--wait").status == 0
        outcome = bench.run("upload", source)
        assert outcome.status == 0, outcome.err
        assert "the device already had" in outcome.out
        assert bench.run("trigger").status == 0
    assert "another" not in str(refused(Request.SAVE, Reason.PLAYING, 0))
    assert "flash" in str(refused(Request.SAVE, Reason.PLAYING, 0))


def test_a_readback_names_the_word_of_z_that_differs(scan: PreparedScan) -> None:
    image = scan.image("table")
    data = bytearray(image.data)
    data[image.info.first.image_bytes + 64] ^= 1
    data[-1] ^= 1
    names = [difference.word for difference in differences(scan, bytes(data))]
    assert names[0] == "z, x: phase_step"
    assert names[1].startswith("z, y: ratio word ")
    assert len(names) == 2
    assert not differences(scan, image.data)


def test_the_images_of_an_upload(scan: PreparedScan) -> None:
    image = scan.image("table")
    second = image.second
    assert second is not None
    assert image.first.data + second.data == image.data
    assert ImageInfo.of_begin(image.info.pack()) == image.info
    assert len(image.info.pack()) == 60
    assert ImageInfo.unpack(image.info.pack()).z is None  # as a slot announces it


def test_a_dry_run_prints_the_bytes_of_all(folder: Path, scan: PreparedScan) -> None:
    outcome = run("upload", folder, "--dry-run")
    assert f"table     {len(scan.image('table').data):>6} " in outcome.out
    assert f"fourier   {len(scan.image('fourier').data):>6} " in outcome.out  # of x and y; z has tables


def test_what_a_device_says_of_z(scan: PreparedScan) -> None:
    device = device_for(scan)
    answer = device.info.hello(device.status())
    assert len(answer) == 188
    assert DeviceInfo.unpack(answer) == device.info
    assert DeviceStatus.unpack(answer[56:]).z is None
    check_device(device.info)
    assert device.info.z is not None
    wrong = replace(device.info, z=replace(device.info.z, slow_knots=66))
    with pytest.raises(NotUnderstood, match="knots of a slow part is 66"):
        check_device(wrong)
    wrong = replace(device.info, z=replace(device.info.z, x_limits=AxisLimits(0, 1 << 16, 1, 1)))
    with pytest.raises(NotUnderstood, match="z code_max is 65536"):
        check_device(wrong)


def test_a_model_with_z_is_a_whole_one(scan: PreparedScan) -> None:
    info = z_info_for(scan)
    with pytest.raises(ValueError, match="go together"):
        ModelDevice(info, LinePlayer(None))
    with pytest.raises(ValueError, match="takes no moves"):
        ModelDevice(replace(info, more=info.more | More.MOVE, features=info.features | 64), LinePlayer(None),
                    z_player=LinePlayer(None))  # fmt: skip
    with pytest.raises(ValueError, match="no output z"):
        _ = info_for(scan).of_z


def test_a_scan_at_an_angle_with_z_is_uploaded_too(tmp_path: Path) -> None:
    path = write_tilted(tmp_path, 30.0)
    assert run("build", path, "-o", tmp_path / "build", "-q").status == 0
    scan = PreparedScan.of_build(tmp_path / "build")
    bench = Bench(device_for(scan))
    outcome = bench.run("upload", tmp_path / "build")
    assert outcome.status == 0, outcome.err
    assert bench.run("readback", tmp_path / "build").status == 0
    line = VirtualLine(bench.device)
    with Device(line.open, random=Random(1), sleep=line.sleep) as host:
        assert host.upload(scan.image("table"), force=True).generation == 2


def test_both_outputs_are_uploaded_as_one_program(tmp_path: Path) -> None:
    """The second output is the y of the image of z: its words are read back, and its converter counts."""
    path = with_aux(write_straight(tmp_path))
    assert run("build", path, "-o", tmp_path / "build", "-q").status == 0
    scan = PreparedScan.of_build(tmp_path / "build")
    bench = Bench(device_for(scan))
    outcome = bench.run("upload", tmp_path / "build")
    assert outcome.status == 0, outcome.err
    assert "all equal" in bench.run("readback", tmp_path / "build").out
    image = scan.image("table")
    data = bytearray(image.data)
    data[-1] ^= 1
    assert [difference.word[:9] for difference in differences(scan, bytes(data))] == ["z, y: rat"]
    plain = device_for(scan, y=AxisShape(9, 16, 16, 16))
    outcome = Bench(plain).run("upload", tmp_path / "build")
    assert outcome.status == 9
    assert "the axis beside z: converter words of 16 bits, twos-complement; the device sends of 16 bits" in outcome.err
