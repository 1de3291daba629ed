"""A scan whose y is off: x runs, y rests at its voltage, in build, certificate, manifest, verify and upload."""

import json
from pathlib import Path

import numpy as np
import pytest
from client_line import VirtualLine
from client_rig import client, info_for, model
from editing import SCAN, edited, run, write_pair
from sets import long
from verifying import make_right

import tablegen
from tablegen.link.prepare import PreparedScan
from tablegen.manifest.read import read_build

OFF = "\n[y]\nmotion = 'off'\noffset_v = 40.0\n"
LINE_SCAN = SCAN.split("\n[y]\n")[0].replace("lines = 200 ", "image_lines = 7") + OFF


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("line")
    outcome = run("build", write_pair(folder, LINE_SCAN), "-o", folder / "out", "--strict")
    assert outcome.status == 0, outcome.err
    assert "y     rests at 40 V, code 26214" in outcome.out
    assert "chosen: a line scan: y rests, and all 7 lines of a frame are imaged" in outcome.out
    return folder


def test_x_is_that_of_a_whole_scan_and_y_one_code(built: Path) -> None:
    plan = tablegen.plan(built / "scan.toml")
    whole = tablegen.plan(write_pair(built.parent))
    assert np.array_equal(plan.x.program.words, whole.x.program.words)
    assert plan.x.program.output == whole.x.program.output
    schedule = plan.schedule
    assert set(plan.y.codes(0, schedule.frame_ticks).tolist()) == {round((40.0 - 50.0) / 10.0 / 10.0 * 65536) + 32768}
    assert plan.y.program.output.park_code == 26214
    assert (schedule.lines, schedule.up.first, schedule.up.count, schedule.down.count) == (7, 0, 7, 0)
    assert schedule.turn_line == 7  # no line flies back
    assert plan.moving == (plan.x,)


def test_manifest_and_certificate_state_that_y_rests(built: Path) -> None:
    manifest = json.loads((built / "out" / "manifest.json").read_bytes())
    y = manifest["axes"]["y"]
    assert (y["drive"]["size_nm"], y["drive"]["v_offset"]) == (0.0, 40.0)
    assert set(y["table"]["words"]) == {0}
    certificate = y["certificate"]
    assert (certificate["lowest_code"], certificate["highest_code"], certificate["largest_step"]) == (26214, 26214, 0)
    assert certificate["scaling_error_percent"] == {}
    assert certificate["beyond_cutoff_db"] is None
    assert certificate["max_error_lsb"] <= 0.5
    assert read_build(built / "out").manifest.axes.y.resting


def test_verify_of_the_files_agrees_and_finds_a_y_that_is_said_to_rest(built: Path, tmp_path: Path) -> None:
    assert run("verify", built / "out", "--target", "files").status == 0
    path = write_pair(tmp_path)
    assert run("build", path, "-o", tmp_path / "out", "-q").status == 0
    manifest = json.loads((tmp_path / "out" / "manifest.json").read_bytes())
    size = json.dumps(manifest["axes"]["y"]["drive"]["size_nm"])
    text = (tmp_path / "out" / "manifest.json").read_text("ascii")
    head, tail = text.split('"y": {', 1)
    (tmp_path / "out" / "manifest.json").write_text(
        head + '"y": {' + tail.replace(f'"size_nm": {size}', '"size_nm": 0.0', 1), "ascii"
    )
    make_right(tmp_path / "out")
    found = run("verify", tmp_path / "out", "--target", "files")
    assert found.status == 5
    assert "axes.y.drive.size_nm is 0, and the waveform moves" in found.err + found.out


@pytest.mark.common
@pytest.mark.parametrize("options", long([("c",)], [("c",), ("verilog", "--axis", "blocks")]), ids=["c", "verilog"])
def test_c_and_verilog_play_it(built: Path, options: tuple[str, ...]) -> None:
    outcome = run("verify", built / "out", "--target", *options, "--ticks", "20000")
    assert outcome.status == 0, outcome.out + outcome.err


@pytest.mark.parametrize("form", ["table", "fourier"])
def test_a_device_takes_and_plays_the_upload(built: Path, form: str) -> None:
    scan = PreparedScan.of_build(built / "out")
    device_model = model(info_for(scan))
    with client(VirtualLine(device_model)) as device:
        device.upload(scan.image(form, device.info))  # type: ignore[arg-type]
        assert device.status().hash.hex() == scan.digest


def test_page_and_text_show_x_alone(built: Path) -> None:
    shown = run("show", built / "scan.toml", "--all")
    assert shown.status == 0
    assert "rests             at 40 V" in shown.out
    assert "y drive [V]" not in shown.out
    assert "note: a frame images 200 x 7 pixels: y rests" in shown.out
    assert run("report", built / "scan.toml", "-o", built / "page.html").status == 0
    assert "rests at 40 V" in (built / "page.html").read_text("utf-8")
    assert "y: rests at 40 V" in repr(tablegen.plan(built / "scan.toml"))


REFUSED = {
    "size_nm = 10": "scan.toml:41: y.size_nm: y.motion on line 39 keeps y where it is; leave this out, or motion = "
    "'off'",
    "turn = 0.5": "scan.toml:41: y.turn: y.motion on line 39 keeps y where it is; leave this out, or motion = 'off'",
    "park_v = 400": "scan.toml:41: y.park_v: 400 V is outside the driver's 0..100 V, by 300 V",
}


@pytest.mark.parametrize("own", REFUSED)
def test_what_y_needs_no_more_is_refused(tmp_path: Path, own: str) -> None:
    outcome = run("check", write_pair(tmp_path, LINE_SCAN + own + "\n"))
    assert outcome.status == 2
    assert outcome.err.replace(f"{tmp_path}/", "").splitlines() == [REFUSED[own]]


def test_frames_and_sizes_of_two_axes_are_refused(tmp_path: Path) -> None:
    text = edited(LINE_SCAN, "timing.frame = 'flyback'", "image_nm = [100, 100]", "- x.size_nm", "y.offset_v = 200.0")
    outcome = run("check", write_pair(tmp_path, text))
    assert outcome.err.replace(f"{tmp_path}/", "").splitlines() == [
        "scan.toml:1: image_nm: y.motion on line 40 keeps y where it is; give one number, the length of the line scan",
        "scan.toml:19: timing.frame: y.motion on line 40 keeps y where it is; leave out one of the two",
    ]


def test_commands_for_frames_say_that_this_is_none(tmp_path: Path) -> None:
    """A corrected image of a scan that has no second axis would lie."""
    path = write_pair(tmp_path, LINE_SCAN.replace("image_lines = 7", "image_lines = 64"))
    trace, retrace = tmp_path / "trace.npy", tmp_path / "retrace.npy"
    for image in (trace, retrace):
        np.save(image, np.random.default_rng(1).normal(size=(64, 200)))
    (tmp_path / "t.csv").write_text("time_s,displacement_nm,drive_v\n0,0,0\n", "ascii")
    for command in (
        ("simulate", path),
        ("correct", trace, retrace, "--scan", path, "-o", tmp_path / "o.npy"),
        ("refine", path, "--axis", "x", "--images", trace, retrace, "--mismatch"),
        ("refine", path, tmp_path / "t.csv", "--axis", "y"),
    ):
        outcome = run(*command)
        assert outcome.status == 2, outcome.out
        assert f"{path}:39: y.motion: 'off' " in outcome.err, outcome.err


def test_y_off_may_be_like_x(tmp_path: Path) -> None:
    text = LINE_SCAN.replace("offset_v = 40.0", "like = 'x'")
    y = tablegen.load(write_pair(tmp_path, text)).scan.y
    assert (y.offset_v, y.size_nm, y.off) == (50.0, None, True)
