"""``tablegen refine --images`` on images of the virtual scanner: rounds by hand, words and data, what it refuses."""

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest
from editing import Outcome, run, write_pair
from refining import GRATING, LATTICE, ROUGH, Sample, frames_of, play, scan_text, scanner

from tablegen.config.load import load
from tablegen.planning.line_plan import make_plan

pytestmark = pytest.mark.common

SCAN = scan_text(
    "- x.size_nm", "x.size_v = 60.0", "- y.size_nm", "y.size_v = 60.0", "timing.lines = 100", "timing.pixels = 128"
)

ON_TIME = ("--delay-pixels", "0")  # clean bars look the same a period further


def take(folder: Path, sample: Sample = GRATING, seed: int = 0, count: int = 1) -> list[Path]:
    """Images of the scan in the folder as it stands, trace and retrace of each frame."""
    found = []
    for number, pair in enumerate(frames_of(load(folder / "scan.toml"), sample, count, seed)):
        for name, heights in zip(("trace", "retrace"), pair, strict=True):
            path = folder / f"{name}{seed}_{number}.npy"
            np.save(path, heights)
            found.append(path)
    return found


def refining(folder: Path, files: list[Path], *arguments: str | Path, axis: str = "x") -> Outcome:
    pairs = [word for at in range(0, len(files), 2) for word in ("--images", *files[at : at + 2])]
    return run("refine", folder / "scan.toml", "--axis", axis, *pairs, *arguments)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_pair(tmp_path, SCAN)
    return tmp_path


def test_rounds_by_hand(folder: Path) -> None:
    """Image, refine, build; the same images a second time are refused, and so are those of a worse scan."""
    residuals = []
    for seed in range(2):
        files = take(folder, seed=seed)
        outcome = refining(folder, files, "--write", "--json", *ON_TIME)
        assert outcome.status == 0, outcome.err
        data = json.loads(outcome.out)
        residuals.append(data["measured"]["residual_rms_percent"])
        assert [pair["trace"]["name"] for pair in data["images"]] == [files[0].name]
        assert data["size_nm"] is None
        assert run("build", folder / "scan.toml", "-o", folder / "out", "-q").status == 0
    assert residuals[1] < 0.5 * residuals[0]
    text = (folder / "scan.toml").read_text("utf-8")
    layer = tomllib.loads(text)["x"]["refinement"]
    assert layer["before_percent"] == pytest.approx(residuals[1], rel=0.01)
    assert "before_of" not in layer
    rows = [row for row in text.splitlines() if row.startswith("# refine ")]
    assert "trace1_0.npy, sha256 " in rows[1]
    assert "retrace1_0.npy, sha256 " in rows[1]
    assert "periods in the line" in rows[1]
    again = refining(folder, files, "--write", *ON_TIME)
    assert again.status == 2
    assert "was already refined by these images; build, upload and record again" in again.err
    (folder / "scan.toml").write_text(text.replace("before_percent = ", "before_percent = 0.00001 # "), "utf-8")
    worse = refining(folder, take(folder, seed=7), "--write", *ON_TIME)
    assert worse.status == 2
    assert "the residual grew from 1e-05 % to" in worse.err
    assert "--force" in worse.err


def test_text_data_and_picture(folder: Path) -> None:
    files = take(folder, LATTICE, count=2)
    before = (folder / "scan.toml").read_bytes()
    constant = make_plan(load(folder / "scan.toml")).x.drive.size_nm / LATTICE.periods
    known = ("--lattice-nm", f"{constant:.9g}", "--plot", folder / "errors.png")
    shown, plain = refining(folder, files, *known), refining(folder, files, *known, "--json")
    assert (shown.status, shown.err, plain.status, plain.err) == (0, "", 0, "")
    assert (folder / "scan.toml").read_bytes() == before
    assert (folder / "errors.png").read_bytes().startswith(b"\x89PNG")
    data = json.loads(plain.out)
    assert "2 frames of 85 x 128 pixels" in shown.out
    for label in ("measured", "predicted"):
        for side in ("forward", "backward"):
            row = next(line for line in shown.out.splitlines() if line.startswith(f"{side:<9}  {label}"))
            found = data[label][side]
            keys = ("residual_rms_percent", "residual_largest_percent", "scaling_error_peak_to_peak_percent")
            assert [float(cell) for cell in row.split()[2:]] == pytest.approx([found[key] for key in keys], abs=6e-4)
    true = play(load(folder / "scan.toml"), "x", scanner().x).true.size_nm
    assert data["size_nm"] == pytest.approx(true, abs=3.0 * data["size_standard_error_nm"])
    assert data["size_standard_error_nm"] < 2e-3 * true
    assert f"size of x: {data['size_nm']:.5g} +- " in shown.out
    assert "sizes are not learnt; " in shown.out


def test_another_constant_than_said_is_refused(folder: Path) -> None:
    wrong = refining(folder, take(folder, LATTICE), "--lattice-nm", "100", "--write")
    assert wrong.status == 2
    assert "by the sample's constant" in wrong.err
    assert "refinement" not in (folder / "scan.toml").read_text("utf-8")


def test_a_sample_without_a_period(folder: Path) -> None:
    files = take(folder, ROUGH)
    refused = refining(folder, files, "--write")
    assert refused.status == 2
    assert "refinement" not in (folder / "scan.toml").read_text("utf-8")
    learnt = refining(folder, files, "--mismatch", "--write")
    assert learnt.status == 0, learnt.err
    assert "note: only the mismatch of trace and retrace was measured" in learnt.out
    text = (folder / "scan.toml").read_text("utf-8")
    assert tomllib.loads(text)["x"]["refinement"]["before_of"] == "mismatch"
    assert "trace against retrace, residual" in text
    data = json.loads(refining(folder, take(folder, ROUGH, seed=1), "--mismatch", "--json").out)
    assert data["mismatch"] is True
    assert data["match"] > 0.9


def test_y_from_two_frames(folder: Path) -> None:
    outcome = refining(folder, take(folder, LATTICE, count=2), "--write", axis="y")
    assert outcome.status == 0, outcome.err
    assert "forward    measured" in outcome.out
    assert "backward" not in outcome.out
    layer = tomllib.loads((folder / "scan.toml").read_text("utf-8"))["y"]["refinement"]
    assert layer["directions"] == "forward"


def test_one_file_may_have_both(folder: Path) -> None:
    from image_writers import gwy

    trace, retrace = (np.load(path) for path in take(folder))
    gwy(folder / "both.gwy", HeightTrace=trace, HeightRetrace=retrace)
    both = refining(folder, [folder / "both.gwy"], "--channel", "Height", "--json", *ON_TIME)
    assert both.status == 0, both.err
    apart = refining(folder, take(folder), "--json", *ON_TIME)
    assert json.loads(both.out)["measured"] == json.loads(apart.out)["measured"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ((), "give TRACE.CSV of a sensor, or --images TRACE RETRACE, one of them"),
        (("t.csv", "--images", "t.npy", "r.npy"), "give TRACE.CSV of a sensor, or --images TRACE RETRACE, one of them"),
        (("--images", "t.npy", "r.npy", "--triggered"), "--triggered is for the trace of a sensor, not for --images"),
        (("--images", "t.npy", "r.npy", "--drift", "0"), "--drift is for the trace of a sensor, not for --images"),
        (("t.csv", "--mismatch"), "--mismatch is for --images"),
        (("t.csv", "--pitch-nm", "50"), "--pitch-nm or --angle-deg is for --images"),
        (("--images", "t.npy", "r.npy", "--mismatch", "--lattice-nm", "5"), "it has no constant"),
    ],
)
def test_options_that_do_not_go_together(folder: Path, words: tuple[str, ...], message: str) -> None:
    outcome = run("refine", folder / "scan.toml", "--axis", "x", *words)
    assert outcome.status == 2
    assert message in outcome.err


def test_clean_bars_without_a_known_delay_are_refused(folder: Path) -> None:
    """A period further they look the same: the layer was wrong, with status 0."""
    files = take(folder)
    outcome = refining(folder, files, "--write")
    assert outcome.status == 2
    assert f"{files[0]} and {files[1]}: ambiguous shift of the sample" in outcome.err
    assert "give --delay-pixels, 0 if they are not late" in outcome.err
    assert "refinement" not in (folder / "scan.toml").read_text("utf-8")


def test_a_file_that_is_no_image_is_named(folder: Path) -> None:
    files = take(folder)
    files[1].write_bytes(b"no image")
    outcome = refining(folder, files)
    assert outcome.status == 2
    assert str(files[1]) in outcome.err
