"""``tablegen channels``, and trace and retrace from the files of instruments."""

import json
from pathlib import Path

import numpy as np
import pytest
from calibrating import Scanner, grating
from editing import Outcome, run, write_pair
from image_writers import npy
from instrument_files import asd, ibw, jpk, spm, sxm

NOTE = {"FastScanSize": "5e-07", "SlowScanSize": "2.5e-07", "ScanRate": "2.5", "ScanDown": "0"}


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with one scan of a grating in the files of several instruments."""
    pair = Scanner().images(100.0, grating(16.0, pixels=128, lines=96), 0.05, np.random.default_rng(8))
    scale = 15.0 / max(np.max(np.abs(pair.trace)), np.max(np.abs(pair.retrace)))
    trace, retrace = pair.trace * scale, pair.retrace * scale
    both = {"Height": (trace, retrace)}
    (tmp_path / "t.npy").write_bytes(npy(trace))
    (tmp_path / "r.npy").write_bytes(npy(retrace))
    (tmp_path / "a.sxm").write_bytes(sxm(both))
    labelled = {"DeflectionTrace": retrace, "HeightTrace": trace, "HeightRetrace": retrace}
    (tmp_path / "a.ibw").write_bytes(ibw(labelled, NOTE))
    (tmp_path / "a.001").write_bytes(spm(both | {"Phase": (retrace, trace)}))
    (tmp_path / "a.jpk").write_bytes(jpk({"Height": (trace, retrace)}))
    (tmp_path / "a.asd").write_bytes(asd({"TP": np.stack([retrace, trace]), "ER": np.stack([trace, retrace])}))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def one(*words: str) -> Outcome:
    return run("calibrate", "images", "--axis", "x", "--v-max", "100", "--json", "--pair", "100", *words)


def branches(outcome: Outcome) -> list[float]:
    assert (outcome.status, outcome.err) == (0, "")
    trace = json.loads(outcome.out)["branches"][0]["traces"][0]
    return [trace[side][key]["value"] for side in ("forward", "backward") for key in ("beta", "u_peak")]


@pytest.mark.common
def test_a_pair_from_one_file_of_every_instrument(lab: Path) -> None:
    expected = branches(one("t.npy", "r.npy"))
    for words, near in (
        (("a.sxm",), 1e-6),
        (("a.ibw",), 1e-6),  # the height, which is neither the first channel nor the last
        (("a.ibw", "--channel", "Height"), 1e-6),
        (("a.ibw", "a.ibw", "--channel", "1"), 1e-6),
        (("a.001", "--channel", "Height"), 1e-4),
        (("a.jpk", "--channel", "Height"), 1e-3),
        (("a.asd", "--channel", "TP", "--retrace-channel", "ER", "--frame", "1"), 2e-3),
    ):
        assert branches(one(*words)) == pytest.approx(expected, abs=near), words


def test_what_is_no_pair_is_said(lab: Path) -> None:
    there = "0 (DeflectionTrace), 1 (HeightTrace), 2 (HeightRetrace)"
    for words, said in (
        (("a.ibw", "--channel", "Phase"), f"a.ibw: has no channel 'Phase'; there is {there}"),
        (("a.ibw", "--channel", "Deflection"), "is the trace by the file; the retrace is needed here"),
        (("a.asd", "--channel", "TP", "--retrace-channel", "ER"), "is a movie of 2 frames; choose one with --frame, 0"),
        (("a.asd", "--channel", "TP", "--frame", "2"), "has no frame 2; the last one is 1"),
        (("a.sxm", "--pair", "50", "t.npy"), "t.npy: channel 0 ('') has no retrace in this file; give it too"),
        (("t.npy",), "t.npy: channel 0 ('') has no retrace in this file; give it too"),
    ):  # fmt: skip
        outcome = one(*words)
        assert outcome.status == 2
        assert said in outcome.err


SEVERAL = {
    "correct by a fit": "correct two.sxm --fit --pitch-nm 16",
    "correct by a scanner": "correct two.sxm --scanner scanner.toml --size-v 60",
    "lattice": "lattice two.sxm",
    "calibrate images": "calibrate images --axis x --v-max 100 --pair 100 two.sxm",
    "calibrate operator": "calibrate operator --axis x --v-max 100 --pitch-nm 16 --pair 50 50 10 two.sxm",
    "calibrate size": "calibrate size --axis x --v-max 100 --pitch-nm 16 --image 100 two.sxm",
    "refine": "refine scan.toml --axis x --pitch-nm 16 --images two.sxm",
    "report": "report scan.toml -o page.html --image two.sxm",
}


@pytest.mark.parametrize("command", SEVERAL)
def test_two_channels_of_one_name_are_refused_with_their_numbers(command: str, lab: Path) -> None:
    """Each command lists both, with the name and without it."""
    write_pair(lab)
    heights = np.load(lab / "t.npy"), np.load(lab / "r.npy")
    two = sxm({"Z": heights, "I": heights[::-1]}).replace(b"\tI\t", b"\tZ\t")
    (lab / "two.sxm").write_bytes(two)
    outcome = run(*SEVERAL[command].split(), "--channel", "Z")
    assert outcome.status == 2
    assert (
        "two.sxm: has more than one channel 'Z': 0 (Z forward), 2 (Z forward); choose one by its number" in outcome.err
    )
    outcome = run(*SEVERAL[command].split())
    assert outcome.status == 2
    assert "two.sxm: has " in outcome.err
    assert all(part in outcome.err for part in ("0 (Z forward)", "2 (Z forward)", "; choose with --channel"))
    assert not (lab / "page.html").exists()


def test_what_is_in_a_file(lab: Path) -> None:
    outcome = run("channels", "a.ibw", "a.asd", "t.npy")
    assert (outcome.status, outcome.err) == (0, "")
    assert outcome.out.splitlines() == [
        "a.ibw",
        "   channel          direction  pixels    size [nm]  unit  lines [Hz]  frames  first row",
        "0  DeflectionTrace  trace      128 x 96  500 x 250  m     2.5                 bottom",
        "1  HeightTrace      trace      128 x 96  500 x 250  m     2.5                 bottom",
        "2  HeightRetrace    retrace    128 x 96  500 x 250  m     2.5                 bottom",
        "a.asd",
        "   channel  direction  pixels    size [nm]  unit  lines [Hz]  frames  first row",
        "0  TP                  128 x 96  400 x 200  nm    192         2",
        "1  ER                  128 x 96  400 x 200  nm    192         2",
        "t.npy",
        "   channel  direction  pixels    size [nm]  unit  lines [Hz]  frames  first row",
        "0                      128 x 96",
    ]


def test_the_same_as_data(lab: Path) -> None:
    (file,) = json.loads(run("channels", "--json", "a.sxm").out)
    assert file["file"] == "a.sxm"
    assert file["channels"][1] == {
        "number": 1,
        "title": "Height backward",
        "signal": "Height",
        "direction": "retrace",
        "rows_columns": [96, 128],
        "width_nm": pytest.approx(500.0),
        "height_nm": pytest.approx(250.0),
        "unit": "m",
        "line_rate_hz": pytest.approx(2.0),
        "frames": 1,
        "first_row": "bottom",
        "scan_angle_deg": 0.0,
        "turn": pytest.approx(0.8),
        "window": None,
    }


def test_a_turn_and_a_window_have_a_column_where_they_say_something(lab: Path) -> None:
    rows = run("channels", "a.sxm").out.splitlines()
    assert rows[1].endswith("first row  turn")
    assert [row.split()[-2:] for row in rows[2:]] == [["bottom", "0.8"]] * 2
    (lab / "over.ibw").write_bytes(ibw({"HeightTrace": np.eye(40)}, NOTE | {"ScanSpeed": "3.125e-06"}))
    rows = run("channels", "over.ibw").out.splitlines()
    assert rows[1].endswith("first row  window")
    assert rows[2].endswith("bottom     0.1 to 0.9")


def test_an_angle_other_than_0_has_a_column(lab: Path) -> None:
    turned = {"HeightTrace": np.eye(40), "HeightRetrace": np.eye(40)}
    (lab / "turned.ibw").write_bytes(ibw(turned, NOTE | {"ScanAngle": "90"}))
    lines = run("channels", "turned.ibw").out.splitlines()
    assert lines[1].endswith("first row  angle [deg]")
    assert [line.split()[-2:] for line in lines[2:]] == [["bottom", "90"]] * 2
    (file,) = json.loads(run("channels", "--json", "turned.ibw").out)
    assert [one["scan_angle_deg"] for one in file["channels"]] == [90.0, 90.0]


@pytest.mark.parametrize(
    ("angle", "axis", "said"),
    [
        ("90", "x", "the fast axis was y, not x; give --axis y, or scan at 0 degrees"),
        ("-90", "x", "the fast axis was y, not x; give --axis y, or scan at 0 degrees"),
        ("30", "x", "a line moved both piezos; scan at 0 degrees for --axis x"),
        ("30", "y", "a line moved both piezos; scan at 90 degrees for --axis y"),
        ("180", "x", "which exchanges trace and retrace; scan at 0 degrees"),
        ("180", "y", "the fast axis was x, not y; give --axis x, or scan at 90 degrees"),
    ],
)
def test_branches_of_another_axis_are_refused(angle: str, axis: str, said: str, lab: Path) -> None:
    pair = {"HeightTrace": np.load(lab / "t.npy"), "HeightRetrace": np.load(lab / "r.npy")}
    (lab / "turned.ibw").write_bytes(ibw(pair, NOTE | {"ScanAngle": angle}))
    (lab / "s.toml").write_text('name = "s"\nv_max = 100.0\n')
    words = ("--axis", axis, "--scanner", "s.toml", "--write", "--pair", "100", "turned.ibw")
    outcome = run("calibrate", "images", *words)
    assert (outcome.status, outcome.out) == (2, "")
    assert outcome.err.startswith(f"turned.ibw: scan angle {angle} degrees: ")
    assert said in outcome.err
    assert (lab / "s.toml").read_text() == 'name = "s"\nv_max = 100.0\n'


@pytest.mark.common
def test_branches_of_the_axis_that_was_fast_are_fitted_and_the_angle_is_said(lab: Path) -> None:
    pair = {"HeightTrace": np.load(lab / "t.npy"), "HeightRetrace": np.load(lab / "r.npy")}
    (lab / "turned.ibw").write_bytes(ibw(pair, NOTE | {"ScanAngle": "90"}))
    words = ("--axis", "y", "--v-max", "100", "--no-plot", "--pair", "100", "turned.ibw")
    outcome = run("calibrate", "images", *words)
    assert (outcome.status, outcome.err) == (0, "")
    assert "note: turned.ibw: scan angle 90 degrees: the fast axis was y, as --axis y; " in outcome.out
    remarks = json.loads(run("calibrate", "images", *words, "--json").out)["remarks"]
    assert any("scan angle 90 degrees" in text for text in remarks)


def test_a_damaged_file_and_a_missing_library(lab: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (lab / "b.sxm").write_bytes((lab / "a.sxm").read_bytes()[:-1])
    outcome = run("channels", "a.sxm", "b.sxm")
    assert (outcome.status, outcome.out) == (2, "")
    assert outcome.err.startswith("b.sxm: ends in the middle of its images (2 images of 128 x 96 pixels")
    monkeypatch.setattr("tablegen.cli.shared.common._installed", lambda module: module != "tifffile")
    outcome = run("channels", "a.jpk")
    assert outcome.status == 6
    assert outcome.err == "tifffile is missing; install it with: pip install 'piezo-tablegen[images]'\n"
    assert run("channels", "a.sxm").status == 0


def test_a_title_does_not_steer_the_terminal(lab: Path) -> None:
    evil = {"Height\x1b[2JTrace": np.eye(40)}
    (lab / "evil.ibw").write_bytes(ibw(evil, NOTE))
    outcome = run("channels", "evil.ibw")
    assert "\x1b" not in outcome.out
    assert "Height\\x1b[2JTrace  trace" in outcome.out
