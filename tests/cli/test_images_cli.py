"""``tablegen calibrate images`` as its users meet it: from files of any kind to a scanner file that builds."""

import hashlib
import importlib.util
import json
import tomllib
from pathlib import Path

import numpy as np
import pytest
from calibrating import AMPLITUDES, Scanner, grating
from editing import Outcome, run, write_pair
from image_writers import ascii_of, gwy, npy, png
from PIL import Image as Pillow

from tablegen.numerics.arrays import Floats

pytestmark = pytest.mark.common

V = 100.0


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the shipped pair and a pair of images an amplitude."""
    write_pair(tmp_path)
    random = np.random.default_rng(8)
    for v in AMPLITUDES:
        pair = Scanner().images(v, grating(16.0, pixels=128, lines=96), 0.05, random)
        np.save(tmp_path / f"t{v:g}.npy", pair.trace)
        np.save(tmp_path / f"r{v:g}.npy", pair.retrace)
    monkeypatch.chdir(tmp_path)
    return tmp_path


PAIRS = [word for v in AMPLITUDES for word in ("--pair", f"{v:g}", f"t{v:g}.npy", f"r{v:g}.npy")]


def calibrate(*words: str, pairs: list[str] | None = None) -> Outcome:
    return run("calibrate", "images", "--axis", "x", *(PAIRS if pairs is None else pairs), *words)


def one(trace: str, retrace: str, *words: str) -> Outcome:
    return calibrate(*words, "--v-max", "100", pairs=["--pair", "100", trace, retrace])


def test_a_scanner_file_from_images_builds(lab: Path) -> None:
    outcome = calibrate("--scanner", "scanner.toml", "--write")
    assert (outcome.status, outcome.err) == (0, "")
    assert outcome.out.splitlines()[0].startswith("hysteresis of x, 73728 pixels of t30.npy, r30.npy, t60.npy")
    assert outcome.out.splitlines()[-1] == "scanner.toml: x.hysteresis written"
    assert max(map(len, (line for line in outcome.out.splitlines() if not line.startswith("note")))) <= 120
    text = (lab / "scanner.toml").read_text("utf-8")
    (branch,) = tomllib.loads(text)["x"]["hysteresis"]["branches"]
    assert branch["turn"] == 0.5
    assert branch["forward"] == pytest.approx({"beta_max": 0.037, "rho": 4.0, "u_peak": 0.37}, rel=0.05)
    assert branch["backward"] == pytest.approx({"beta_max": 0.080, "rho": 1.5, "u_peak": 0.48}, rel=0.05)
    assert "# calibrate hysteresis, turn 0.5: 3 pairs of images, 73728 pixels, residual 0." in text
    for v in AMPLITUDES:
        for name in (f"t{v:g}.npy", f"r{v:g}.npy"):
            assert f"# from {name}, sha256 {hashlib.sha256((lab / name).read_bytes()).hexdigest()[:16]}\n" in text
    checked = run("check", "scan.toml")
    assert (checked.status, checked.err) == (0, "")
    assert checked.out.endswith("\nscan.toml: correct\n")
    assert run("build", "scan.toml", "-o", "out", "-q").status == 0
    again = calibrate("--scanner", "scanner.toml", "--write")
    assert again.out.splitlines()[-1] == "scanner.toml: x.hysteresis up to date"


def test_json_and_a_picture(lab: Path) -> None:
    outcome = calibrate("--v-max", "100", "--json", "--plot", "a.svg")
    record = json.loads(outcome.out)
    assert (record["kind"], record["axis"], record["points"]) == ("hysteresis", "x", 73728)
    assert record["branches"][0]["turn"] == {"value": 0.5, "standard_error": None}
    first = record["branches"][0]["traces"][0]
    assert first["v_scan"] == 30.0
    assert first["periods"] == pytest.approx(4.8, abs=0.02)
    assert first["explained"] == pytest.approx(0.97, abs=0.02)
    assert first["forward"]["beta"]["value"] == pytest.approx(0.0264, abs=1e-3)
    assert "<svg" in (lab / "a.svg").read_text("utf-8")


def write(folder: Path, ending: str, name: str, heights: Floats) -> str:
    """Heights as a file of this kind, written by another hand than reads it."""
    path = folder / f"{name}.{ending}"
    steps = np.round((heights - np.min(heights)) / np.ptp(heights) * 60000.0)
    if ending == "png":
        path.write_bytes(png(steps))
    elif ending == "tif":
        Pillow.fromarray(heights.astype(np.float32)).save(path)
    elif ending == "gwy":
        gwy(path, Height=heights)
    elif ending == "npy":
        path.write_bytes(npy(heights))
    else:
        path.write_bytes(ascii_of(heights, {"txt": "\t", "asc": " ", "csv": ",", "dat": ";"}[ending], ending == "dat"))
    return path.name


@pytest.mark.parametrize("ending", ["npy", "tif", "png", "gwy", "txt", "asc", "csv", "dat"])
def test_every_format_says_the_same(ending: str, lab: Path) -> None:
    expected = json.loads(one("t100.npy", "r100.npy", "--json").out)
    names = [write(lab, ending, f"{side}_", np.load(lab / f"{side}100.npy")) for side in "tr"]
    outcome = one(*names, "--json")
    assert outcome.err == ""
    found = json.loads(outcome.out)
    for side in ("forward", "backward"):
        for key in ("beta", "u_peak"):
            ours, theirs = (record["branches"][0]["traces"][0][side][key]["value"] for record in (found, expected))
            # 16 bits, or a scale of its own for each image, which the fit has to share, move it by a part of its error.
            assert ours == pytest.approx(theirs, abs=1e-5 if ending == "png" else 1e-7)


def test_both_images_in_one_gwyddion_file(lab: Path) -> None:
    gwy(lab / "scan.gwy", Trace=np.load("t100.npy"), Retrace=np.load("r100.npy"))
    words = ("--channel", "Trace", "--retrace-channel", "Retrace")
    outcome = one("scan.gwy", "scan.gwy", *words, "--json")
    record = json.loads(outcome.out)
    assert [source["name"] for source in record["sources"]] == ["scan.gwy"]
    expected = json.loads(one("t100.npy", "r100.npy", "--json").out)
    assert record["branches"] == expected["branches"]
    assert "has several channels, 0 (Trace), 1 (Retrace); choose with --channel" in one("scan.gwy", "scan.gwy").err


def test_a_mirrored_retrace_and_a_window(lab: Path) -> None:
    np.save("m.npy", np.load("r100.npy")[:, ::-1])
    refused = one("t100.npy", "m.npy")
    assert refused.status == 2
    assert "it needs --retrace-mirrored" in refused.err
    mirrored = json.loads(one("t100.npy", "m.npy", "--retrace-mirrored", "--json").out)
    assert mirrored["branches"] == json.loads(one("t100.npy", "r100.npy", "--json").out)["branches"]
    sample = grating(16.0, pixels=128, lines=96, window=(0.05, 0.95))
    pair = Scanner().images(100.0, sample, 0.02, np.random.default_rng(9))
    np.save("t.npy", pair.trace)
    np.save("r.npy", pair.retrace)
    window = json.loads(one("t.npy", "r.npy", "--window", "0.05", "0.95", "--json").out)
    assert window["branches"][0]["traces"][0]["forward"]["beta"]["value"] == pytest.approx(0.037, abs=3e-4)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "Missing option '--pair'"),
        (["--pair", "100", "t100.npy"], "t100.npy: channel 0 ('') has no retrace in this file; give it too"),
        (["--pair", "x", "t100.npy", "r100.npy"], "'x' is not a valid float"),
        (["--pair", "0", "t100.npy", "r100.npy"], "0.0 is not in the range"),
        (["--pair", "100", "t100.npy", "absent.npy"], "absent.npy: is not a file"),
        (["--pair", "100", "t100.npy", "scan.toml"], "scan.toml: .toml is not one of .npy"),
        (["--pair", "120", "t100.npy", "r100.npy"], "a scan of 120 V is outside the driver's 0..100 V"),
        (["--pair", "100", "r100.npy", "t100.npy"], "r100.npy and t100.npy: both sweeps lead the drive"),
        (["--pair", "100", "t100.npy", "t60.npy"], "t100.npy and t60.npy:"),
        (["--pair", "100", "t100.npy", "r100.npy", "--window", "0.5", "0.4"], "is not a large part of the sweep"),
    ],
)
def test_what_is_refused(words: list[str], said: str, lab: Path) -> None:
    outcome = calibrate("--v-max", "100", "--scanner", "new.toml", "--write", pairs=words)
    assert (outcome.status, outcome.out) == (2, "")
    assert said in outcome.err
    assert not (lab / "new.toml").exists()


@pytest.mark.parametrize(("module", "ending"), [("PIL", "png"), ("tifffile", "tif")])
def test_a_missing_library_is_status_6(module: str, ending: str, lab: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    there = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name, *rest: None if name == module else there(name, *rest))
    outcome = one(f"a.{ending}", f"b.{ending}")
    assert outcome.status == 6
    assert outcome.err == f"{module} is missing; install it with: pip install 'piezo-tablegen[images]'\n"
    assert one("t100.npy", "r100.npy").status == 0


def test_help_teaches() -> None:
    page = run("calibrate", "images", "--help")
    assert page.status == 0
    assert max(map(len, page.out.splitlines())) <= 100
    for word in ("--pair", "VOLTS TRACE RETRACE", "--channel", "--retrace-mirrored", "--window", "--turn", ".gwy"):
        assert word in page.out
    assert "\n  images " in run("calibrate", "--help").out
