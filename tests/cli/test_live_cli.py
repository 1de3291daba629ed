"""``tablegen live``: requests as lines of JSON, against the model of a device in virtual time."""

import hashlib
import io
import json
import re
import sys
from contextlib import redirect_stdout
from functools import partial
from itertools import pairwise
from pathlib import Path
from random import Random
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest
from building import REPOSITORY, Variant, write_variant
from client_line import Noise, VirtualLine, intact
from client_rig import BOOT, Bench, client, info_for, model
from link_programs import INFO
from operator_files import operator_file, write_operator_scan
from replacing import replace
from sets import LONG_TEST
from turned_scans import write_turned

import tablegen
from tablegen.api.build import Build, build_planned
from tablegen.api.live import Live
from tablegen.base.input_errors import Problem, Rejected
from tablegen.certificate.certificate import EmittedPeriods
from tablegen.cli.device.live import _REQUESTS as ANSWERS
from tablegen.cli.device.live import live as live_command
from tablegen.cli.device.live_keys import KEYS
from tablegen.compensation.models.operator import OperatorIdentification
from tablegen.compensation.operator.in_time import OperatorInTime, Start
from tablegen.config.load import Setup, load
from tablegen.config.variants import variants
from tablegen.device.sequencer import Tick
from tablegen.fixedpoint.frame_program import FrameProgram
from tablegen.link.errors import LinkLost, Refused
from tablegen.link.frames import FrameReader
from tablegen.link.messages import SPLINE_DEGREE, DeviceInfo, DeviceState, Feature, More, Reason, Request
from tablegen.link.model_device import ModelDevice
from tablegen.link.players import SequencerPlayer
from tablegen.link.prepare import PreparedScan
from tablegen.manifest.format import content_hash
from tablegen.manifest.turned_record import turned_record
from tablegen.planning.line_plan import Plan, make_plan
from tablegen.planning.turned_plan import TurnedPlan, make_turned_plan

SCAN = {"timing.lines": 40}
MOST_JUMP = 12_000  # codes; the first scan begins by less from the park code


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_variant(tmp_path_factory.mktemp("live"), Variant(SCAN))


@pytest.fixture(scope="module")
def info(file: Path) -> DeviceInfo:
    """Of a device that takes every scan of this converter, and has modes of a COMMIT."""
    info = info_for(PreparedScan.of_plan(make_plan(load(file))))
    return replace(info, features=info.features | Feature.COMMIT_MODES)


def said(bench: Bench, file: Path, *requests: dict[str, Any] | str) -> list[dict[str, Any]]:
    """What a session answers, whose command ends well; the first answer is that of the start."""
    lines = [one if isinstance(one, str) else json.dumps(one) for one in requests]
    with patch.object(sys, "stdin", io.StringIO("".join(f"{line}\n" for line in lines))):
        outcome = bench.run("live", file)
    assert (outcome.status, outcome.err) == (0, "")
    answers = [json.loads(line) for line in outcome.out.splitlines()]
    assert len(answers) == 1 + len([line for line in lines if line.strip()])
    return answers


def planned(file: Path, **settings: float) -> Plan:
    """The plan of the file with other values of its keys, without the class under test."""
    _, (scan,) = variants(file, {key.replace("__", "."): [value] for key, value in settings.items()})
    return make_plan(scan.setup)


def test_a_scan_is_moved_zoomed_and_changed(info: DeviceInfo, file: Path) -> None:
    start, moved, zoomed, slower, status = said(
        Bench(model(info, boot=BOOT)),
        file,
        {"do": "move", "x_nm": 30, "y_nm": -20.5},
        {"do": "zoom", "factor": 0.8},
        {"do": "set", "values": {"timing.line_rate_hz": 200.0}},
        {"do": "status"},
    )
    assert start["scan"]["swap"] == "frame"
    for axis, by in (("x", 30.0), ("y", -20.5)):
        before, after = start["scan"][axis], moved["scan"][axis]
        assert after["position_nm"] - before["position_nm"] == pytest.approx(by, abs=1e-6)
        assert after["size_nm"] == pytest.approx(before["size_nm"])
        assert after["amplitude_v"] != before["amplitude_v"]  # the sensitivity is another one there
        assert zoomed["scan"][axis]["size_nm"] == pytest.approx(0.8 * after["size_nm"])
        assert zoomed["scan"][axis]["position_nm"] == pytest.approx(after["position_nm"])
    assert [one["scan"]["swap"] for one in (moved, zoomed)] == ["keep", "keep"]
    assert (slower["scan"]["swap"], slower["scan"]["line_rate_hz"]) == ("frame", 200.0)
    x, y = (start["scan"][axis]["position_nm"] for axis in "xy")
    same = planned(file, x__offset_nm=x + 30.0, y__offset_nm=y - 20.5, x__size_nm=160.0, y__size_nm=160.0,
                   timing__line_rate_hz=200.0)  # fmt: skip
    assert status["status"] == {
        "state": "playing",
        "line": status["status"]["line"],
        "generation": 5,
        "faults": 0,
        "digest": slower["scan"]["digest"],
        "moved": False,
        **{axis: {key: slower["scan"][axis][key] for key in ("position_nm", "size_nm")} for axis in "xy"},
        "z": None,
        "aux": None,
    }
    words = [(line.program.output, line.program.words.tolist()) for line in same.lines]
    device_words = Bench(model(info, boot=BOOT))
    said(device_words, file, *[{"do": "set", "values": {"x.offset_nm": x + 30.0, "y.offset_nm": y - 20.5,
         "x.size_nm": 160.0, "y.size_nm": 160.0, "timing.line_rate_hz": 200.0}}])  # fmt: skip
    playing = device_words.device.player.playing
    assert playing is not None
    assert [(axis.output, axis.words.tolist()) for axis in (playing.x, playing.y)] == words


def test_what_is_refused_leaves_the_scan_that_plays(info: DeviceInfo, file: Path) -> None:
    """By the driver's range, by a key that does not exist, and by the device; nothing of it was sent."""
    narrow = replace(info, x_limits=replace(info.x_limits, max_jump=MOST_JUMP))
    start, far, unknown, wide, status = said(
        Bench(model(narrow, boot=BOOT)),
        file,
        {"do": "move", "x_nm": 1e6},
        {"do": "set", "values": {"x.sise_nm": 3}},
        {"do": "move", "x_nm": 250.0},
        {"do": "status"},
    )
    assert [one["ok"] for one in (start, far, unknown, wide, status)] == [True, False, False, False, True]
    assert "x.offset_nm" in far["error"]
    assert "sise_nm" in unknown["error"]
    assert "(jump)" in wide["error"]
    assert status["status"]["generation"] == start["scan"]["generation"]
    assert status["status"]["digest"] == start["scan"]["digest"]
    assert status["status"]["x"]["position_nm"] == start["scan"]["x"]["position_nm"]


def test_the_place_of_a_scan_of_somebody_else_is_not_known(info: DeviceInfo, file: Path) -> None:
    with client(VirtualLine(model(info, boot=BOOT), baud=115200, tick_hz=500_000)) as device:
        live = Live(device, file)
        live.start()
        request = ANSWERS["status"][1]
        assert request(live, device, {})["status"]["y"] is not None
        device.upload(PreparedScan.of_plan(planned(file, x__offset_nm=500.0)).image("auto", device.info))
        assert request(live, device, {})["status"]["y"] is None


def test_a_refused_change_is_forgotten(info: DeviceInfo, file: Path) -> None:
    """The next move begins where the scan is, and not where it could not go."""
    start, _, moved = said(
        Bench(model(info, boot=BOOT)), file, {"do": "move", "x_nm": 1e6}, {"do": "move", "x_nm": 10.0}
    )
    assert moved["scan"]["x"]["position_nm"] - start["scan"]["x"]["position_nm"] == pytest.approx(10.0, abs=1e-6)


def test_a_device_without_modes_begins_a_frame(info: DeviceInfo, file: Path) -> None:
    plain = replace(info, features=info.features & ~Feature.COMMIT_MODES)
    start, moved = said(Bench(model(plain, boot=BOOT)), file, {"do": "move", "x_nm": 30})
    assert [one["scan"]["swap"] for one in (start, moved)] == ["line", "line"]


@pytest.mark.parametrize(
    ("request_", "why"),
    [
        ("{", "the line is not JSON: "),
        ("[1]", 'a request is an object with "do": move, zoom, rotate, set, park, trigger, status'),
        ({"do": "jump"}, 'a request is an object with "do": move, '),
        ({"do": "move", "z_nm": 1}, "move: unknown z_nm; possible: x_nm, y_nm"),
        ({"do": "move", "x_nm": "far"}, 'x_nm is "far"; give a number'),
        ('{"do": "move", "x_nm": NaN}', "x_nm is NaN; give a number"),
        ({"do": "move", "x_nm": 1e400}, "x_nm is Infinity; give a number"),
        ("[" * 60_000, "the line is nested too deeply for a request"),
        ('{"do": "park"}'.rjust(70_000), "the line has more than 65536 characters"),
        ({"do": "set", "values": {"": 1}}, '"": unknown key'),
        ({"do": "set", "values": {"x": 1}}, "x: "),
        ({"do": "set", "values": {"x.size_nm": [1e999]}}, "x.size_nm"),
        ({"do": "set", "values": {"name": "other"}}, "name is not set"),
        ({"do": "set", "values": {"x.size_nm": 160.0, "x": {}}}, "x.size_nm lies in x"),
        ({"do": "zoom", "factor": 1e300}, "x.size_nm"),
        ({"do": ["move"]}, "a request is an object"),
        ({"do": "zoom"}, "factor is null; give a number"),
        ({"do": "zoom", "factor": 0}, "cannot be zoomed by 0"),
        ({"do": "set", "values": 3}, "values is missing, or no object"),
        ({"do": "park", "now": 1}, "park: unknown now; possible: nothing"),
    ],
)
def test_a_wrong_request_is_answered(request_: dict[str, Any] | str, why: str, info: DeviceInfo, file: Path) -> None:
    _, answer, blank_is_none = said(Bench(model(info, boot=BOOT)), file, request_, "", {"do": "status"})
    assert not answer["ok"]
    assert why in answer["error"]
    assert blank_is_none["ok"]


def test_it_parks_and_starts_again(info: DeviceInfo, file: Path) -> None:
    bench = Bench(model(info, boot=BOOT))
    said(bench, file, {"do": "park"})
    bench.device.player.advance(1_000_000)
    assert bench.device.player.state == DeviceState.PARKED
    again, _ = said(bench, file, {"do": "trigger"})
    assert again["scan"]["swap"] is None  # it was there
    bench.device.player.advance(1)
    assert bench.device.player.state == DeviceState.PLAYING


def test_a_library_of_scans_is_none(info: DeviceInfo, tmp_path: Path) -> None:
    file = write_variant(tmp_path, Variant(SCAN))
    file.write_text(file.read_text("utf-8") + '\n[[scans]]\nname = "a"\n\n[[scans]]\nname = "b"\n', "utf-8")
    outcome = Bench(model(info, boot=BOOT)).run("live", file)
    assert outcome.status == 2
    assert "this file is a library of scans" in outcome.err
    with client(VirtualLine(model(info, boot=BOOT))) as device, pytest.raises(Rejected, match="has 2 scans"):
        Live(device, file)


def test_a_change_that_breaks_a_limit_of_the_scan_file_is_refused(info: DeviceInfo, file: Path) -> None:
    """By the certificate, as a build is: half the size has more scaling error than the file allows."""
    start, smaller, status = said(Bench(model(info, boot=BOOT)), file, {"do": "zoom", "factor": 0.5}, {"do": "status"})
    assert "limits.max_scaling_error_percent: the x axis has a scaling error of" in smaller["error"]
    assert status["status"]["digest"] == start["scan"]["digest"]


def test_what_is_wrong_with_the_file_needs_no_device(info: DeviceInfo, file: Path, tmp_path: Path) -> None:
    bench = Bench(model(info, boot=BOOT))
    assert (bench.run("live", tmp_path / "none.toml").status, bench.asked) == (2, [])
    broken = write_variant(tmp_path, Variant({**SCAN, "x.size_nm": 60.0}))
    assert (bench.run("live", broken).status, bench.asked) == (3, [])


def test_a_zoom_that_is_none_changes_nothing(info: DeviceInfo, file: Path) -> None:
    with client(VirtualLine(model(info, boot=BOOT), baud=115200, tick_hz=500_000)) as device:
        live = Live(device, file)
        with pytest.raises(Rejected, match="cannot be zoomed by -1"):
            live.zoom(-1.0)
        assert live.plan.x.drive.size_nm == pytest.approx(200.0)


# Angle


TURNED = ("timing.lines = 16", "x.band_limit.harmonics = 24", "timing.line_rate_hz = 400")


@pytest.fixture(scope="module")
def turned(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, DeviceInfo]:
    """A scan with operators on both axes, at 0 degrees, and a device that plays it at any angle."""
    file = write_turned(tmp_path_factory.mktemp("turned"), 0.0, *TURNED)
    info = info_for(PreparedScan.of_plan(make_plan(load(file))))
    slow = {"more": More.SLOW_PARTS | More.MOVE, "slow_knots": 17, "slow_index_bits": 6, "degree": SPLINE_DEGREE}
    # At an angle y is fast too.
    steps = {f"{axis}_limits": replace(getattr(info, f"{axis}_limits"), max_step=1 << 16) for axis in "xy"}
    return file, replace(info, features=info.features | Feature.COMMIT_MODES, **slow, **steps)  # type: ignore[arg-type]


@pytest.fixture(params=[False, True], ids=["uploads", "moves"])
def previewed(request: pytest.FixtureRequest, turned: tuple[Path, DeviceInfo]) -> tuple[Path, DeviceInfo, bool]:
    """The same with devices whose previews at an angle are uploads, or moves."""
    file, info = turned
    return file, replace(info, more=info.more | More.SLOW_MOVE) if request.param else info, request.param


@pytest.mark.common
def test_a_scan_is_turned(turned: tuple[Path, DeviceInfo], tmp_path: Path) -> None:
    """From 0 degrees to an angle, on to another one, moved there, and back: each is the scan that a build makes."""
    file, info = turned
    start, at_30, again, moved, back, wrong, status = said(
        Bench(model(info, boot=BOOT)),
        file,
        {"do": "rotate", "by_deg": 30},
        {"do": "rotate", "by_deg": -190},
        {"do": "move", "x_nm": 10},
        {"do": "rotate", "by_deg": 160},
        {"do": "rotate"},
        {"do": "status"},
    )
    scans = [one["scan"] for one in (start, at_30, again, moved, back)]
    assert [scan["angle_deg"] for scan in scans] == [0.0, 30.0, -160.0, -160.0, 0.0]
    # The frame goes on where y has a slow part before and after.
    assert [scan["swap"] for scan in scans] == ["frame", "frame", "keep", "keep", "frame"]
    assert [scan["preview"] is not None for scan in scans] == [False, False, True, True, False]
    for scan in scans[2:4]:  # a turn by half a circle and more, and a move
        assert scan["preview"]["generation"] == scan["generation"] - 1
        assert all(0.0 < scan["preview"][f"{axis}_error_percent"] < 2.0 for axis in "xy")
    assert moved["scan"]["x"]["position_nm"] - again["scan"]["x"]["position_nm"] == pytest.approx(10.0, abs=1e-6)
    assert moved["scan"]["x"]["size_nm"] == pytest.approx(start["scan"]["x"]["size_nm"])
    assert again["scan"]["y"]["amplitude_v"] != at_30["scan"]["y"]["amplitude_v"]
    record = turned_record(make_turned_plan(load(write_turned(tmp_path, -160.0, *TURNED))))
    assert again["scan"]["digest"] == content_hash(record | {"name": again["scan"]["name"]})
    assert wrong["error"] == "by_deg is null; give a number"
    assert status["status"]["digest"] == back["scan"]["digest"]
    drifts = [[scan[axis]["drift_nm"] for axis in "xy"] for scan in scans]
    assert drifts[0] == [None, None]
    assert all(0.1 < drift < 30.0 for pair in drifts[1:3] for drift in pair)
    assert drifts[4][0] == 0.0 < drifts[4][1]  # lines of x begin at their lower turn, which wipes out what was before
    assert drifts[3][0] > 0.1 > drifts[3][1]  # y did not move


@pytest.mark.common
def test_a_scan_whose_files_have_tables_in_the_header_is_turned(
    turned: tuple[Path, DeviceInfo], tmp_path: Path
) -> None:
    """A build at an angle refuses the key, which is of files; no file is written here."""
    file = write_turned(tmp_path, 0.0, *TURNED, "+ [emit]\nheader_only = true")
    _, at_30 = said(Bench(model(turned[1], boot=BOOT)), file, {"do": "rotate", "by_deg": 30})
    assert at_30["scan"]["angle_deg"] == 30.0


@pytest.mark.common
def test_keys_turn_and_move_along_the_lines(turned: tuple[Path, DeviceInfo]) -> None:
    file, info = turned
    _, start, *rest = pressed(Bench(model(info, boot=BOOT)), file, "[", "\x1b[C", "q")
    assert "learning a frame of 16 lines on the operator of x ..." in rest
    at_5, preview, right = (text for text in rest if not text.endswith(" ..."))
    assert re.fullmatch(r"preview plays, within \S+ % of x, \S+ % of y; the exact scan follows", preview)
    assert rest.index(preview) < len(rest) - 3  # before the plan
    assert at_5.splitlines()[-1] == "400 Hz, 16 lines, 5 degrees; from a new frame"
    before, after = (
        [float(row.split(" nm at ")[1].split()[0]) for row in text.splitlines() if " nm at " in row]
        for text in (at_5, right)
    )
    assert after[0] - before[0] == pytest.approx(30.0 * np.cos(np.radians(5.0)), abs=0.02)
    assert after[1] - before[1] == pytest.approx(30.0 * np.sin(np.radians(5.0)), abs=0.02)
    assert right.splitlines()[-1] == "400 Hz, 16 lines, 5 degrees; the frame goes on"
    assert right.count(" nm in the first frame") == 2
    assert start.endswith("400 Hz, 16 lines; from a new frame")


@pytest.mark.common
def test_a_preview_at_an_angle_whose_plan_is_refused_gives_way(previewed: tuple[Path, DeviceInfo, bool]) -> None:
    """By the plan, after the preview, and by the device; no frame is restarted, and the next change begins there."""
    file, info, moves = previewed
    watch, boot = _Watch(), make_plan(load(file)).program
    machine = ModelDevice(info, SequencerPlayer(boot, on_tick=watch))
    machine.tick(1)
    previews: list[str] = []
    with client(VirtualLine(machine, baud=3_000_000, tick_hz=500_000)) as device:

        def note(_: object) -> None:
            playing = machine.player.playing
            assert playing is not None
            assert isinstance(playing.x, FrameProgram)
            status = device.status()
            assert (status.moved, status.hash == bytes(32)) == (moves, moves)
            previews.append(hashlib.sha256(device.readback()).hexdigest())

        live = Live(device, file, {"angle_deg": 20.0}, on_preview=note)
        before, image = live.start(), device.readback()
        watch.lines.clear()
        problem = Rejected([Problem("scan.toml", 1, "limits", "is exceeded")])
        with patch("tablegen.api.live.build_turned", side_effect=problem), pytest.raises(Rejected):
            live.move(20.0)
        assert device.readback() == image
        assert device.status().hash.hex() == (bytes(32).hex() if moves else before.digest)
        assert machine.player.swaps == before.generation + 2
        with pytest.raises(Rejected):
            live.move(1e6)  # of which nothing is sent
        assert machine.player.swaps == before.generation + 2
        after = live.move(20.0, -10.0)
        assert device.status().hash.hex() == after.digest
    assert len(set(previews)) == len(previews) == 2
    assert hashlib.sha256(image).hexdigest() not in previews
    assert after.x.position_nm == pytest.approx(before.x.position_nm + 20.0, abs=1e-6)
    assert (after.swap, after.generation) == ("keep", before.generation + 4)
    assert all((later - earlier) % 16 == 1 for earlier, later in pairwise(watch.lines))


@pytest.mark.common
def test_a_device_without_modes_has_no_preview_at_an_angle(turned: tuple[Path, DeviceInfo]) -> None:
    file, info = turned
    plain = replace(info, features=info.features & ~Feature.COMMIT_MODES, more=info.more & ~More.MOVE)
    with client(VirtualLine(model(plain, boot=BOOT), baud=3_000_000, tick_hz=500_000)) as device:
        live = Live(device, file, {"angle_deg": 20.0})
        live.start()
        with patch("tablegen.api.live.turned_preview") as never:
            assert live.move(5.0).preview is None
    never.assert_not_called()


def test_an_axis_without_an_operator_is_not_turned(info: DeviceInfo, file: Path) -> None:
    start, refused, status = said(Bench(model(info, boot=BOOT)), file, {"do": "rotate", "by_deg": 5}, {"do": "status"})
    assert "is no operator" in refused["error"]
    assert status["status"]["digest"] == start["scan"]["digest"]


# The link


def test_a_lost_link_leaves_the_scan_that_plays(info: DeviceInfo, file: Path) -> None:
    """The port vanishes with the last bytes of a move, and is there again for the next."""
    line = VirtualLine(model(info, boot=BOOT), baud=115200, tick_hz=500_000)
    with client(line) as device:
        live = Live(device, file)
        before = live.start()

        def cut(piece: bytes) -> list[bytes]:
            line.there = all(frame.type != Request.COMMIT for frame in FrameReader().feed(piece))
            return [piece] if line.there else []

        line.spoil_out = cut
        with pytest.raises(LinkLost):
            live.move(20.0)
        line.device.tick(100_000)
        assert line.device.player.swaps == before.generation
        assert live.plan.x.drive.position_nm == before.x.position_nm
        line.spoil_out, line.there = intact, True
        after = live.move(20.0)
    assert (after.generation, line.device.player.swaps) == (before.generation + 1, before.generation + 1)
    assert after.x.position_nm == pytest.approx(before.x.position_nm + 20.0, abs=1e-6)


def test_a_change_whose_answer_was_lost_counts(info: DeviceInfo, file: Path) -> None:
    """The device took it: the next move begins where the scan is."""
    line = VirtualLine(model(info, boot=BOOT), baud=115200, tick_hz=500_000)
    with client(line) as device:
        live = Live(device, file)
        before = live.start()

        def cut(piece: bytes) -> list[bytes]:
            line.there = all(frame.type != Request.COMMIT | 0x80 for frame in FrameReader().feed(piece))
            return [piece] if line.there else []

        line.spoil_back = cut
        with pytest.raises(LinkLost):
            live.move(20.0)
        assert line.device.player.swaps == before.generation + 1
        line.spoil_back, line.there = intact, True
        after = live.move(20.0)
    assert after.x.position_nm == pytest.approx(before.x.position_nm + 40.0, abs=1e-6)
    assert after.swap == "keep"


def test_a_line_with_faults_plays_what_was_asked_for(info: DeviceInfo, file: Path) -> None:
    noise = Noise(Random(5), lose=0.05, damage=0.05, repeat=0.05, swap=0.05)
    line = VirtualLine(model(info, boot=BOOT), baud=115200, tick_hz=500_000, spoil_out=noise, spoil_back=noise)
    with client(line) as device:
        live = Live(device, file)
        live.start()
        for number in range(6):
            scan = live.move(5.0, -5.0)
            assert (scan.swap, device.status().hash.hex()) == ("keep", scan.digest), number
    assert noise.spoilt > 20
    assert line.device.player.swaps == 2 + 6


# Previews


@pytest.fixture(scope="module")
def moves(info: DeviceInfo) -> DeviceInfo:
    """Of a device that takes MOVE as well."""
    return replace(info, more=More.MOVE)


def test_a_change_plays_its_preview_first(moves: DeviceInfo, file: Path) -> None:
    start, moved, zoomed, slower, status = said(
        Bench(model(moves, boot=BOOT)),
        file,
        {"do": "move", "x_nm": 30, "y_nm": -20.5},
        {"do": "zoom", "factor": 0.8},
        {"do": "set", "values": {"timing.line_rate_hz": 200.0}},
        {"do": "status"},
    )
    assert start["scan"]["preview"] is slower["scan"]["preview"] is None  # words cannot change the rate
    for change in (moved, zoomed):
        preview = change["scan"]["preview"]
        assert preview["generation"] == change["scan"]["generation"] - 1
        assert 0.0 < preview["x_error_percent"] < 3.0
        assert 0.0 < preview["y_error_percent"] < 3.0
        assert change["scan"]["swap"] == "keep"
    assert status["status"]["generation"] == 7
    assert not status["status"]["moved"]


def test_a_preview_has_the_size_of_the_plan(moves: DeviceInfo, file: Path) -> None:
    """The offset alone would leave the size of the old place, from which the sensitivity differs."""
    machine = model(moves, boot=BOOT)
    played: list[tuple[float, float]] = []
    with client(VirtualLine(machine, baud=115200, tick_hz=500_000)) as device:

        def note(_: object) -> None:
            playing = machine.player.playing
            assert playing is not None
            axis = playing.x
            codes = axis.output.code(axis.samples(np.arange(axis.phase.ticks)))
            played.append((float(np.ptp(codes)), float(np.mean(codes))))

        live = Live(device, file, on_preview=note)
        live.start()
        old = live.plan.x.program
        live.move(200.0)
        new = live.plan.x.program
    ((size, middle),) = played
    spans, middles = (
        [float(of(axis.output.code(axis.samples(np.arange(axis.phase.ticks))))) for axis in (old, new)]
        for of in (np.ptp, np.mean)
    )
    assert abs(spans[0] / spans[1] - 1.0) > 0.02
    assert abs(size / spans[1] - 1.0) < 0.01
    assert abs(middle - middles[1]) < 0.01 * spans[1]


def test_nothing_is_sent_of_what_a_limit_refuses(moves: DeviceInfo, file: Path) -> None:
    narrow = replace(moves, x_limits=replace(moves.x_limits, max_jump=MOST_JUMP))
    machine = model(narrow, boot=BOOT)
    start, smaller, far, wide, status = said(
        Bench(machine),
        file,
        {"do": "zoom", "factor": 0.5},
        {"do": "move", "x_nm": 1e6},
        {"do": "move", "x_nm": 250.0},
        {"do": "status"},
    )
    assert [one["ok"] for one in (smaller, far, wide)] == [False] * 3
    assert "(jump)" in wide["error"]
    assert status["status"]["generation"] == start["scan"]["generation"]


def test_a_plan_that_is_refused_behind_its_preview_leaves_the_scan_that_plays(moves: DeviceInfo, file: Path) -> None:
    """The words of the scan before play again, and the next change begins there."""
    machine = model(moves, boot=BOOT)
    with client(VirtualLine(machine, baud=115200, tick_hz=500_000)) as device:
        live = Live(device, file)
        before = live.start()
        outputs = [line.program.output for line in live.plan.lines]
        refusal = Refused(Request.COMMIT, Reason.JUMP, 0, "the device refused COMMIT")
        with patch.object(device, "upload", side_effect=refusal), pytest.raises(Refused):
            live.move(20.0)
        playing = machine.player.playing
        assert playing is not None
        assert [axis.output for axis in (playing.x, playing.y)] == outputs
        assert machine.player.swaps == before.generation + 2
        after = live.move(10.0)
    assert after.x.position_nm == pytest.approx(before.x.position_nm + 10.0, abs=1e-6)
    assert after.preview is not None


def test_a_preview_plays_before_its_certificate_where_no_limit_breaks(
    moves: DeviceInfo, file: Path, tmp_path: Path
) -> None:
    """With limits and without; a certificate that refuses the plan nevertheless leaves the scan that plays."""
    free = write_variant(tmp_path, Variant({**SCAN, "limits": {}}))
    events: list[str] = []

    def certified(setup: Setup, periods: EmittedPeriods) -> Build:
        events.append("certificate")
        return build_planned(setup, periods)

    for path in (file, free):
        machine = model(moves, boot=BOOT)
        with client(VirtualLine(machine, baud=115200, tick_hz=500_000)) as device:
            live = Live(device, path, on_preview=lambda _: events.append("preview"))
            before = live.start()
            outputs = [line.program.output for line in live.plan.lines]
            events.clear()
            with patch("tablegen.api.live.build_planned", certified):
                live.move(20.0)
                live.move(-20.0)
            assert events == 2 * ["preview", "certificate"]
            swaps = machine.player.swaps
            broken = Rejected([Problem(str(path), 1, "limits", "would break")])
            with patch("tablegen.api.live.build_planned", side_effect=broken), pytest.raises(Rejected, match="would"):
                live.move(30.0)
            assert machine.player.swaps == swaps + 2  # there, and back
            playing = machine.player.playing
            assert playing is not None
            assert [axis.output for axis in (playing.x, playing.y)] == outputs
            assert live.move(0.0, 10.0).y.position_nm == pytest.approx(before.y.position_nm + 10.0, abs=1e-6)


def test_no_byte_of_a_change_beyond_a_limit_is_sent(moves: DeviceInfo, tmp_path: Path) -> None:
    """A limit of errors between those of two places refuses the move before its preview; one above both does not."""
    middle = write_variant(tmp_path, Variant(SCAN))
    places = [line.drive.position_nm for line in planned(middle).lines]

    def figure(key: str, by_nm: float) -> float:
        plan = planned(middle, x__offset_nm=places[0] + by_nm, y__offset_nm=places[1] + by_nm)
        of = {"max_error_lsb": "max_error_lsb", "max_scaling_error_percent": "scaling_error_percent"}[key]
        return max(getattr(certificate, of) for certificate in tablegen.certify(plan).values())

    for key in ("max_error_lsb", "max_scaling_error_percent"):
        here, by_nm = figure(key, 0.0), max(range(-90, 91, 15), key=partial(figure, key))
        there = figure(key, by_nm)
        assert there > 1.001 * here
        for limit, swaps in ((0.5 * (here + there), 0), (1.0001 * there, 2)):
            path = write_variant(tmp_path, Variant({**SCAN, "limits": {key: limit}}))
            machine = model(moves, boot=BOOT)
            with client(VirtualLine(machine, baud=115200, tick_hz=500_000)) as device:
                live = Live(device, path)
                live.start()
                before = device._session.exchange.bytes_sent, machine.player.swaps
                if swaps:
                    live.move(by_nm, by_nm)
                else:
                    with pytest.raises(Rejected, match=key):
                        live.move(by_nm, by_nm)
                assert (device._session.exchange.bytes_sent > before[0]) is bool(swaps)
                assert machine.player.swaps == before[1] + swaps


def test_a_lost_link_behind_a_preview_leaves_it_playing(moves: DeviceInfo, file: Path) -> None:
    """The next change begins where the preview is."""
    line = VirtualLine(model(moves, boot=BOOT), baud=115200, tick_hz=500_000)
    with client(line) as device:
        live = Live(device, file)
        before = live.start()

        def cut(piece: bytes) -> list[bytes]:
            line.there = all(frame.type != Request.COMMIT for frame in FrameReader().feed(piece))
            return [piece] if line.there else []

        line.spoil_out = cut
        with pytest.raises(LinkLost):
            live.move(20.0)
        line.device.tick(100_000)
        assert line.device.player.swaps == before.generation + 1
        assert line.device.status().moved
        line.spoil_out, line.there = intact, True
        after = live.move(20.0)
    assert after.preview is not None
    assert after.x.position_nm == pytest.approx(before.x.position_nm + 40.0, abs=1e-6)


# Keys


def pressed(bench: Bench, file: Path, *keys: str) -> list[str]:
    """What a terminal shows of keys, a text for each change; the first two are the help and the start."""
    terminal = patch.multiple("sys", stdin=_Terminal(), stdout=_Terminal())
    with (
        patch("tablegen.link.device.open_port", bench.open),
        patch("click.getchar", side_effect=[*keys, EOFError()]),
        patch("click.echo") as echo,
        terminal,
    ):
        status = live_command.main([str(file), "--port", "virtual"], standalone_mode=False)
    assert status == 0
    return [call.args[0] for call in echo.call_args_list]


class _Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_keys_move_zoom_and_change_the_rate(info: DeviceInfo, file: Path) -> None:
    bench = Bench(model(info, boot=BOOT))
    keys, start, right, up, smaller, faster = pressed(bench, file, "\x1b[C", "\x1b[A", "+", ">", "?", "q", "+")
    assert keys == KEYS
    x, y, rate = start.splitlines()
    assert (x[0], y[0], rate) == ("x", "y", "400 Hz, 40 lines; from a new frame")
    assert x.count("=") == pytest.approx(40 * 0.01 * planned(file).x.drive.v_amplitude, abs=2.0)
    at = float(x.split()[-2])
    assert float(right.splitlines()[0].split()[-2]) == pytest.approx(at + 20.0, abs=0.01)
    assert right.splitlines()[2].endswith("the frame goes on")
    assert float(up.splitlines()[1].split()[-2]) == pytest.approx(float(y.split()[-2]) + 20.0, abs=0.01)
    assert " 160 nm at " in smaller.splitlines()[0]
    assert faster.splitlines()[2] == "500 Hz, 40 lines; from a new frame"
    assert bench.device.player.swaps == 6


def test_keys_show_the_preview_and_the_plan_behind_it(moves: DeviceInfo, file: Path) -> None:
    _, _, preview, right = pressed(Bench(model(moves, boot=BOOT)), file, "\x1b[C", "q")
    assert re.fullmatch(r"preview plays, within \S+ % of x, \S+ % of y; the exact scan follows", preview)
    assert right.splitlines()[2].endswith("the frame goes on")


def test_a_key_that_leaves_the_range_says_so(info: DeviceInfo, file: Path) -> None:
    bench = Bench(model(info, boot=BOOT))
    texts = pressed(bench, file, *["\x1b[C"] * 20)[2:]
    assert len(texts) == 20
    assert texts[0].startswith("x 0 V [")
    assert texts[-1].startswith("not possible: ")
    moves = sum(not text.startswith("not possible") for text in texts)
    assert bench.device.player.swaps == 2 + moves


def test_keys_park_and_start(info: DeviceInfo, file: Path) -> None:
    bench = Bench(model(info, boot=BOOT))
    assert pressed(bench, file, "p", "q")[2:] == ["parks"]
    bench.device.player.advance(1_000_000)
    assert bench.device.player.state == DeviceState.PARKED
    assert pressed(bench, file, "p", "t")[2:] == ["parks", "starts a frame"]
    bench.device.player.advance(1)
    assert bench.device.player.state == DeviceState.PLAYING


def test_the_page_s_python_runs(info: DeviceInfo, file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = (REPOSITORY / "docs" / "live.md").read_text("utf-8")
    (block,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    monkeypatch.chdir(file.parent)
    bench, out = Bench(model(info, boot=BOOT)), io.StringIO()
    with patch("tablegen.link.device.open_port", bench.open), redirect_stdout(out):
        exec(block, {"tablegen": tablegen})
    assert re.fullmatch(r"frame \d+\.\d+\n", out.getvalue())
    assert bench.device.player.swaps == 5


@pytest.mark.rest
@pytest.mark.parametrize("pairs", [8, pytest.param(200, marks=LONG_TEST)])
def test_no_code_jumps_and_no_frame_restarts_while_it_is_moved(pairs: int, info: DeviceInfo, file: Path) -> None:
    """Random moves and zooms, on the model tick by tick; what leaves the range of the piezo is refused."""
    rng = np.random.default_rng(7)
    boot = make_plan(load(file)).program
    watch = _Watch()
    machine = ModelDevice(info, SequencerPlayer(boot, on_tick=watch))
    machine.tick(1)
    refused = 0
    with client(VirtualLine(machine, baud=3_000_000, tick_hz=500_000)) as device:
        live = Live(device, file)
        live.start()
        for _ in range(pairs):
            for change in (
                partial(live.move, float(rng.uniform(-60.0, 60.0)), float(rng.uniform(-60.0, 60.0))),
                partial(live.zoom, float(rng.uniform(0.7, 1.4))),
            ):
                try:
                    assert change().swap == "keep"
                except Rejected:
                    refused += 1
    assert all(
        step <= limits.max_step for step, limits in zip(watch.steps, (info.x_limits, info.y_limits), strict=True)
    )
    assert watch.low >= min(info.x_limits.code_min, info.y_limits.code_min)
    assert watch.high <= max(info.x_limits.code_max, info.y_limits.code_max)
    lines = boot.schedule.lines
    assert all((after - before) % lines == 1 for before, after in pairwise(watch.lines))
    assert machine.player.swaps == 2 + 2 * pairs - refused
    assert len(watch.lines) > 4 * pairs
    assert refused < pairs


@pytest.mark.rest
@pytest.mark.parametrize("rounds", [2, pytest.param(40, marks=LONG_TEST)])
def test_no_code_jumps_and_no_frame_restarts_while_it_is_turned(
    rounds: int, previewed: tuple[Path, DeviceInfo, bool]
) -> None:
    """Random moves, zooms and turns at an angle, tick by tick, with the previews: each line is of one program."""
    file, info, _ = previewed
    rng, watch = np.random.default_rng(11), _Watch()
    machine = ModelDevice(info, SequencerPlayer(make_plan(load(file)).program, on_tick=watch))
    machine.tick(1)
    previews = refused = changes = 0
    with client(VirtualLine(machine, baud=3_000_000, tick_hz=500_000)) as device:
        live = Live(device, file, {"angle_deg": 25.0})
        first = live.start()
        watch.lines.clear()
        for _ in range(rounds):
            for change in (
                partial(live.move, float(rng.uniform(-60.0, 60.0)), float(rng.uniform(-60.0, 60.0))),
                partial(live.zoom, float(rng.uniform(0.7, 1.4))),
                partial(live.rotate, float(rng.uniform(-40.0, 40.0))),
            ):
                changes += 1
                try:
                    scan = change()
                except Rejected:
                    refused += 1
                    continue
                assert scan.swap == "keep"
                previews += scan.preview is not None
                if scan.preview is not None:
                    assert max(scan.preview.x_error_percent, scan.preview.y_error_percent) < 10.0
        assert device.status().faults == 0
        assert isinstance(live.plan, TurnedPlan)
        assert device.readback() == PreparedScan.of_turned(live.plan).image("table").data
    assert all(
        step <= limits.max_step for step, limits in zip(watch.steps, (info.x_limits, info.y_limits), strict=True)
    )
    assert watch.low >= min(info.x_limits.code_min, info.y_limits.code_min)
    assert watch.high <= max(info.x_limits.code_max, info.y_limits.code_max)
    assert all((after - before) % 16 == 1 for before, after in pairwise(watch.lines))
    assert not watch.mixed
    assert previews > changes // 2 > refused
    assert machine.player.swaps >= first.generation + previews + changes - refused


class _Watch:
    """The largest step of each axis, the codes at the ends, and the number of each line, of all ticks so far."""

    def __init__(self) -> None:
        self.steps = [0, 0]
        self.low, self.high = 1 << 30, 0
        self.lines: list[int] = []
        self.mixed = 0  # ticks inside a line at which another program has come
        self._generation = -1
        self._before: tuple[int, int] | None = None

    def __call__(self, generation: int, line: int, tick: Tick) -> None:
        codes = tick.x, tick.y
        if self._before is not None:
            self.steps = [max(most, abs(a - b)) for most, a, b in zip(self.steps, codes, self._before, strict=True)]
        self._before = codes
        self.low, self.high = min(self.low, *codes), max(self.high, *codes)
        self.mixed += tick.playing and not tick.line and self._generation not in (-1, generation)
        self._generation = generation
        if tick.playing and tick.line:
            self.lines.append(line)


def test_the_drift_after_a_change_is_that_of_the_operator_in_time(tmp_path: Path) -> None:
    """Lines before the move and a frame after it, stepped in time on the operator; y has none."""
    file = write_operator_scan(tmp_path, operator_file(creep=0.03), "y.band_limit.harmonics = 32", "- [limits]")
    first, then = planned(file), planned(file, x__offset_nm=planned(file).x.drive.position_nm + 100.0)
    shapes = info_for(PreparedScan.of_plan(first), features=INFO.features | Feature.COMMIT_MODES)
    start, moved, zoomed = said(
        Bench(model(shapes, boot=BOOT)), file, {"do": "move", "x_nm": 100.0}, {"do": "zoom", "factor": 0.5}
    )
    assert [start["scan"][axis]["drift_nm"] for axis in "xy"] == [None, None]
    assert moved["scan"]["y"]["drift_nm"] is None
    assert zoomed["scan"]["x"]["drift_nm"] not in (None, moved["scan"]["x"]["drift_nm"])

    known, drive = then.x.drive.shape.identification, then.x.drive
    assert isinstance(known, OperatorIdentification)
    ticks, lines = then.x.program.ticks, then.schedule.lines
    line = np.arange(0, ticks, 5)
    volts = then.x.converter
    played = [
        drive.driver.share(volts.v_zero + volts.v_per_code * plan.x.codes(0, ticks)[line]) for plan in (first, then)
    ]
    u = np.concatenate([np.tile(played[0], 3), np.tile(played[1], lines + 1)])
    at = (np.arange(len(u)) / len(line)) / float(then.schedule.line_rate)
    axis = OperatorInTime(known.operator, lambda _: known.factor)
    means = axis.position(at, u, Start.LINE).reshape(-1, len(line)).mean(axis=1)[3:]
    assert moved["scan"]["x"]["drift_nm"] == pytest.approx(abs(means[-1] - means[0]), rel=0.1)
    assert moved["scan"]["x"]["drift_nm"] > 0.1
